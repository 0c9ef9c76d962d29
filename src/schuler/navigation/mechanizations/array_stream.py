"""An array of IMUs in real time: fused sample by sample, faults out from their onset.

The filter is that of a single IMU (navigation/stream). The latest samples of all sensors are
kept: when a fault is noticed, they are fused once more without it from its onset on, and the filter
takes them again.
"""

from __future__ import annotations

from dataclasses import replace
from math import lcm
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from schuler.arrays.detection.fault_log import FaultRecord
from schuler.arrays.detection.fault_settings import FaultSettings
from schuler.arrays.detection.fault_stream import FaultStream
from schuler.arrays.lever_arms import arm_coefficients, turning_tensor
from schuler.arrays.redundant import redundant_sensors
from schuler.arrays.tracking import follow_sensors
from schuler.data import GnssRecording
from schuler.errors import InputError, NavigationError
from schuler.navigation.mechanizations.array_faults import (
    MARGIN,
    SensorAbsence,
    against_others,
    onset_of,
    settings_for,
)
from schuler.navigation.mechanizations.array_in_use import ArrayInUse, FusionsInUse
from schuler.navigation.mechanizations.array_preparation import PreparedArray
from schuler.navigation.stepping import SensorStretches
from schuler.navigation.stream.buffers import ROOM, LinearRows
from schuler.navigation.stream.checks import (
    FASTEST_TURN,
    LONGEST_GAP,
    STRONGEST_PUSH,
    checked_stamp,
)
from schuler.navigation.stream.navigation_filter import NavigationFilter
from schuler.navigation.stream.rewinding import SNAPSHOT_EVERY
from schuler.navigation.stream.state import FilterState
from schuler.types import BoolArray, FloatArray

if TYPE_CHECKING:
    from schuler.kernels.arrays.array_stream import ArrayStream

LOOK_BACK = 6.0
"""Seconds of samples that are kept to go back to the onset of a fault."""
PARITY, PARITY_SAMPLES = 1.0, 200
"""Seconds and samples, at least, between measurements of what sensors differ by: one costs as much
as ten samples."""
LEAST_PARITY = 10
"""Samples of which such a measurement is made where the sensors in use change."""


class ArrayFilter:
    """The extended filter of an array, fed sample by sample.

    Parameters
    ----------
    prepared : PreparedArray
        From `prepare_array` on a recording that begins where the stream does; it also teaches what
        healthy sensors differ by.
    gnss : GnssRecording
        An epoch near the start gives the position.
    late, lag : float
        As for `NavigationFilter`.
    faults : bool
        Whether faults of sensors are looked for.

    Raises
    ------
    InputError
        As `NavigationFilter`.

    Notes
    -----
    The state is that of the middle of the array, in the axes of the body.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> rng, place = np.random.default_rng(1), schuler.tetrahedron_mounting(0.05)
    >>> ride = schuler.motorcycle(60.0, 1, standstill=15.0)
    >>> gyro, accel = schuler.WhiteNoise(1e-3), schuler.WhiteNoise(3e-3)
    >>> noise = schuler.NoiseModel.isotropic(gyro, accel)
    >>> parts = schuler.simulate_array(ride, place.rotation, place.position, noise, 50.0, rng)
    >>> array = schuler.ImuArray.from_recordings(parts, place)
    >>> gnss = schuler.simulate_gnss(ride, 1.0, position_sd=0.1, velocity_sd=0.05, rng=rng)
    >>> settings = schuler.NavigationSettings(time_offset=0.0, tune_noise=False)
    >>> live = schuler.ArrayFilter(schuler.prepare_array(array, gnss, noise, settings), gnss)
    >>> for k in range(100):
    ...     live.add_array(array.time[k], array.gyro[k], array.accel[k])
    >>> bool(live.out.any())
    False
    """

    def __init__(
        self,
        prepared: PreparedArray,
        gnss: GnssRecording,
        *,
        late: float = 1.0,
        lag: float | None = None,
        faults: bool = True,
    ) -> None:
        from schuler.kernels.arrays.array_stream import take_sample, watch_block

        setup = replace(prepared.extended_setup(parity=True), sources=(), stretches=None)
        rate = prepared.recording.rate
        self.filter = NavigationFilter.from_setup(
            setup, prepared.recording, gnss, late=max(late, LOOK_BACK if faults else 0.0), lag=lag
        )
        self.absences: list[SensorAbsence] = []
        self._fusions = FusionsInUse(prepared, setup)
        self._places, self._kept = int(LOOK_BACK * rate * 1.5) + 2, 0
        count = prepared.array.count
        self._shape = (count, 3)
        self._out = np.zeros((2, 3 * count), bool)
        self._stream = _stream(prepared, ROOM * self._places)
        self._sample = self._stream.values.reshape(-1, 2, count, 3)
        self._tests = _tests(prepared) if faults else {}
        self._taken, self._turns = 0, _turns({k: t.size for k, t in self._tests.items()})
        self._step, self._parity_row = 1.0 / rate, 0
        self._parity_every = min(max(round(PARITY * rate), PARITY_SAMPLES), self._places // 2)
        self._take, self._watch, self._last = take_sample, watch_block, -np.inf
        self._use(self._out, self._stream.silent)

    def _use(self, out: BoolArray, silent: BoolArray) -> ArrayInUse:
        """Fuse the sensors that are in use from now on."""
        used, stream = self._fusions.without(out, silent), self._stream
        stream.out[:], stream.pi[:], stream.moment[:] = used.out, used.pi, used.moment
        self._used = used
        return used

    @property
    def out(self) -> BoolArray:
        """Which accelerometers and gyros are not used now, (2, 3 k)."""
        return np.asarray(self._out | np.repeat(self._stream.silent, 3))

    def add_array(self, time: float, gyro: ArrayLike, accel: ArrayLike) -> None:
        """Take one sample of all IMUs.

        Parameters
        ----------
        time : float
            Seconds; later than the sample before.
        gyro, accel : (k, 3) array_like
            In the axes of each IMU, rad/s and m/s²; NaN where an IMU is silent.

        Raises
        ------
        InputError
            Other shapes, no IMU with values, or what `NavigationFilter.add_imu` refuses; nothing
            has changed.
        NavigationError
            As `NavigationFilter.add_imu`.
        """
        # one comparison for what is as it mostly is; not a number is not
        if not (type(time) is float and 0.0 < time - self._last < LONGEST_GAP):
            time = checked_stamp(time, self.filter.time)
        stream, row = self._stream, self._kept
        if row == len(stream.time):
            row = self._move_up()
        try:
            rates, forces = np.asarray(gyro, np.float64), np.asarray(accel, np.float64)
        except (TypeError, ValueError):
            rates = forces = np.empty(0)
        if rates.shape != self._shape or forces.shape != self._shape:
            raise InputError(
                f"a sample of shape {np.shape(gyro)} and {np.shape(accel)}",
                expected=f"numbers of shape {self._shape}, twice",
            )
        sample = self._sample[row]
        sample[0], sample[1] = forces, rates
        stream.time[row] = time
        if self._take(stream, row):
            self._silences(row)
        if row + 1 - self._parity_row >= self._parity_every:
            # before its sample: nothing has to be taken once more
            if row:
                self.filter.add_linear(self._parity(time, row + 1 - self._parity_row))
            stream.sums[:], self._parity_row = 0.0, row + 1
        try:
            self.filter.add_fused(time, stream.rate, stream.force)
        except NavigationError:
            # the filter is back at an earlier sample
            self._last = self.filter.time
            self._kept = int(np.searchsorted(stream.time[:row], self._last, "right"))
            raise
        self._kept, self._last = row + 1, time
        self._taken += 1
        for kind, ago in self._turns[self._taken % len(self._turns)]:
            self._look(kind, row + 1 - ago)

    def add_gnss(self, *fix: object, **more: object) -> bool:
        """Take one fix; see `NavigationFilter.add_gnss`."""
        return self.filter.add_gnss(*fix, **more)  # type: ignore[arg-type]

    def state(self) -> FilterState:
        """Return the state at the last sample."""
        return self.filter.state()

    def smoothed_state(self) -> FilterState | None:
        """Return the state that is `lag` old; see `NavigationFilter.smoothed_state`."""
        return self.filter.smoothed_state()

    def _move_up(self) -> int:
        """Forget all but the latest."""
        s, kept = self._stream, self._places
        for rows in (s.time, s.values, s.unheard, s.absent, s.tensor):
            rows[:kept] = rows[-kept:]
        self._parity_row -= len(s.time) - kept
        self._kept = kept
        return kept

    def _silences(self, row: int) -> None:
        """Leave out IMUs without values, and let those in that have some again."""
        stream = self._stream
        time, sample = float(stream.time[row]), self._sample[row]
        for values, most, what in (
            (sample[1], FASTEST_TURN, "a gyro shows"),
            (sample[0], STRONGEST_PUSH, "an accelerometer shows"),
        ):
            largest = float(np.nanmax(np.abs(values), initial=0.0))
            if largest > most and np.isfinite(largest):
                raise InputError(
                    f"{what} {largest:g} at {time:.6f} s",
                    expected=f"finite numbers within {most:g} in SI units",
                    cure="leave this sample out, or give NaN for this IMU",
                )
        there = np.isfinite(sample).all(axis=(0, 2))
        if not there.any():
            raise InputError(f"at {time:.3f} s no IMU has a whole sample", expected="at least one")
        before, count = self._used, row - self._parity_row
        stream.silent[:] = ~there
        used = self._use(self._out, stream.silent)
        self._fuse_rows(row, row)
        if self._kept:
            nothing = np.empty((0, 3))
            self.filter.fuse_again(np.empty(0), nothing, nothing, [(time, used.stretch)])
        if count >= LEAST_PARITY and self._kept:
            self.filter.add_linear(self._parity(time, count, before))
        self._sum_rows(row, row)
        self._parity_row = row
        self._take(stream, row)

    def _look(self, kind: int, stop: int) -> None:
        """Test the block before a row; act when somebody is taken out or let back in."""
        kept, test = self._kept, self._tests[kind]
        if stop < test.size or not (number := self._watch(self._stream, test.tests, kind, stop)):
            return
        records = test.log(number, self._stream.time[stop - test.size : stop])
        out = test.out
        if np.array_equal(out, self._out[kind]):
            return
        added = np.flatnonzero(out & ~self._out[kind])
        now = float(self._stream.time[kept - 1])
        start = self._onset(kind, added) if added.size else now
        told = [r for r in records if r.kind in ("axis", "unit") and r.stop is None]
        self.absences += [SensorAbsence(r, start) for r in told]
        self._end(kind, test)
        self._out[kind] = out
        if added.size:
            first = int(np.searchsorted(self._stream.time[:kept], start - 1e-9))
            first = min(max(first, kept - self._places), kept - 1)
            self._stream.absent[first:kept, kind, added] = True
            self._go_back(first)
        else:
            self._go_back(kept - 1)

    def _end(self, kind: int, test: FaultStream) -> None:
        """Write into the log who is used again."""
        now = float(self._stream.time[self._kept - 1])
        sensor = "gyro" if kind else "accel"
        names, units = test.sensors.names, test.sensors.unit_names
        for place, absence in enumerate(self.absences):
            record: FaultRecord = absence.record
            if record.sensor != sensor or record.stop is not None:
                continue
            axes = (
                [names.index(record.name)]
                if record.kind == "axis"
                else np.flatnonzero(test.sensors.unit == units.index(record.name)).tolist()
            )
            if not test.out[axes].any():
                self.absences[place] = replace(absence, record=replace(record, stop=now))

    def _onset(self, kind: int, added: np.ndarray) -> float:
        """When those that are taken out now began to be off; within what is kept."""
        test, stream = self._tests[kind], self._stream
        rows = slice(max(self._kept - self._places, 0), self._kept)
        x = stream.values[rows, kind]
        if kind == 0 and stream.turning:
            x = x - stream.tensor[rows] @ stream.arm
        others = ~(test.out | stream.absent[rows, kind].any(axis=0))
        off = against_others(x, test.sensors.axes, added.tolist(), others, test.variance)
        found = None if off is None else onset_of(off, stream.time[rows], test.size)
        now = float(stream.time[self._kept - 1])
        earliest = max(float(stream.time[rows.start]), now - LOOK_BACK + 0.5)
        return max((now - 1.0 if found is None else found) - MARGIN, earliest)

    def _go_back(self, first: int) -> None:
        """Fuse the rows since the first once more, each with the sensors that it may use."""
        stream, kept = self._stream, self._kept
        wanted = stream.absent[first:kept].copy()
        edges = np.flatnonzero(np.any(wanted[1:] != wanted[:-1], axis=(1, 2))) + 1
        edges = np.concatenate([[0], edges, [kept - first]])
        fused = np.empty((2, kept - first, 3))
        pieces: list[tuple[float, SensorStretches]] = []
        measured: list[LinearRows] = []
        for begin, stop in zip(edges[:-1] + first, edges[1:] + first, strict=True):
            silent = stream.unheard[begin]
            used = self._use(wanted[begin - first], silent)
            fused[:, begin - first : stop - first] = self._fuse_rows(begin, stop)
            pieces.append((float(stream.time[begin]), used.stretch))
            at = begin
            while stop - at >= (self._parity_every if stop == kept else LEAST_PARITY):
                to = min(at + self._parity_every, stop)
                self._sum_rows(at, to)
                measured.append(self._parity(float(stream.time[to - 1]), to - at, used))
                at = to
            self._sum_rows(at, kept)
            self._parity_row = int(at)
        now = self._use(self._out, stream.silent)
        if now is not used:
            # from the next sample on: what this one says of parity is of those before
            pieces.append((float(np.nextafter(stream.time[kept - 1], np.inf)), now.stretch))
            stream.sums[:], self._parity_row = 0.0, kept
            self._fuse_rows(kept, kept)
        self.filter.fuse_again(stream.time[first:kept], fused[1], fused[0], pieces, measured)

    def _fuse_rows(self, first: int, stop: int) -> FloatArray:
        """Fuse rows once more, forces and rates (2, rows, 3)."""
        from schuler.kernels.arrays.array_stream import fuse_again

        fused = np.empty((2, stop - first, 3))
        fuse_again(self._stream, int(first), int(stop), fused)
        return fused

    def _sum_rows(self, first: int, stop: int) -> None:
        from schuler.kernels.arrays.array_stream import sum_rows

        sum_rows(self._stream, int(first), int(stop))

    def _parity(self, time: float, count: int, used: ArrayInUse | None = None) -> LinearRows:
        """What the sensors in use differ by, from the sums of so many samples."""
        mean = self._stream.sums / count
        return (self._used if used is None else used).parity(time, mean, count * self._step)


def _turns(blocks: dict[int, int]) -> tuple[tuple[tuple[int, int], ...], ...]:
    """Which kinds are tested after which sample, and how many samples ago their block ended.

    The kinds take turns, and wait for a sample where the filter keeps a snapshot: no sample waits
    for two of these.
    """
    turns = []
    for n in range(lcm(SNAPSHOT_EVERY, *blocks.values())):
        now = []
        for kind, block in blocks.items():
            phase = 0 if kind else block // 2
            if n % SNAPSHOT_EVERY and n % block == phase:
                now.append((kind, 0))
            if n % SNAPSHOT_EVERY == 1 and (n - 1) % block == phase:
                now.append((kind, 1))
        turns.append(tuple(now))
    return tuple(turns)


def _stream(prepared: PreparedArray, rows: int) -> ArrayStream:
    """Room for the latest samples of an array."""
    from schuler.kernels.arrays.array_stream import ArrayStream

    wide = 3 * prepared.array.count
    arms = np.repeat(prepared.array.mounting.position - prepared.fusion.centre, 3, axis=0)
    arm = arm_coefficients(prepared.fusion.axes, arms)
    return ArrayStream(
        # written to now: memory that nobody has touched costs the first sample that does
        time=np.full(rows, 0.0),
        values=np.full((rows, 2, wide), 0.0),
        unheard=np.full((rows, wide // 3), False),
        absent=np.full((rows, 2, wide), False),
        tensor=np.full((rows, 9), 0.0),
        silent=np.zeros(wide // 3, bool),
        out=np.zeros((2, wide), bool),
        pi=np.zeros((2, 3, wide)),
        arm=arm,
        moment=np.zeros((9, 3)),
        sums=np.zeros((2, wide)),
        force=np.zeros(3),
        rate=np.zeros(3),
        most=np.array([STRONGEST_PUSH, FASTEST_TURN]),
        turning=bool(np.abs(arm).max() > 1e-12),
    )


def _tests(prepared: PreparedArray) -> dict[int, FaultStream]:
    """Tests that know the noise of a recording; none where it could not be judged by noise."""
    if not prepared.faults.noise_only:
        return {}
    settings: FaultSettings = settings_for(prepared.models, prepared.array.rate)
    found: dict[int, FaultStream] = {}
    rate: FloatArray | None = None
    for kind in (1, 0):
        sensors = redundant_sensors(prepared.array, "gyro" if kind else "accel")
        tensor = None
        if rate is not None and sensors.spacing > 0.0:
            tensor = turning_tensor(sensors.time, rate, causal=True)
        watch = settings.watch(sensors)
        followed = follow_sensors(
            sensors, None, settings.online_of(sensors.sensor), watch, tensor=tensor
        )
        rate = followed.fused if kind == 1 else rate
        found[kind] = FaultStream(followed, settings)
    return found
