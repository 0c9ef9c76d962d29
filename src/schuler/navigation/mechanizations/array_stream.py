"""An array of IMUs in real time: fused sample by sample, faults out from their onset.

The filter is that of a single IMU (navigation/streaming.py). The latest samples of all sensors are
kept: when a fault is noticed, they are fused once more without it from its onset on, and the filter
takes them again.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from schuler.arrays.detection.fault_log import FaultRecord
from schuler.arrays.detection.fault_settings import FaultSettings
from schuler.arrays.detection.fault_stream import FaultStream
from schuler.arrays.lever_arms import arm_coefficients, turning_tensor
from schuler.arrays.redundant import redundant_sensors
from schuler.arrays.tracking import follow_sensors
from schuler.data import GnssRecording
from schuler.errors import InputError
from schuler.navigation.aiding.parity import Parity, axis_rows
from schuler.navigation.aiding.schedule import linear_measurements
from schuler.navigation.mechanizations.array_faults import (
    MARGIN,
    SensorAbsence,
    against_others,
    onset_of,
    settings_for,
)
from schuler.navigation.mechanizations.array_preparation import PreparedArray
from schuler.navigation.mechanizations.sensor_table import Absence, SensorTable, sensor_table
from schuler.navigation.streaming import FilterState, NavigationFilter
from schuler.types import BoolArray, FloatArray

LOOK_BACK = 6.0
"""Seconds of samples that are kept to go back to the onset of a fault."""
PARITY = 1.0
"""Seconds between measurements of what sensors differ by."""


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
        setup = replace(prepared.extended_setup(parity=True), sources=(), stretches=None)
        rate = prepared.recording.rate
        self.filter = NavigationFilter.from_setup(
            setup, prepared.recording, gnss, late=max(late, LOOK_BACK if faults else 0.0), lag=lag
        )
        self.absences: list[SensorAbsence] = []
        self._prepared, self._factors = prepared, setup.factors
        self._states = setup.model.size
        self._shown = [axis_rows(prepared.models, kind, self._states) for kind in (0, 1)]
        count = 3 * prepared.array.count
        places = int(LOOK_BACK * rate * 1.5) + 2
        self._time, self._values = np.empty(2 * places), np.empty((2 * places, 2, count))
        self._places, self._kept = places, 0
        self._out, self._silent = np.zeros((2, count), bool), np.zeros(prepared.array.count, bool)
        self._arms = arm_coefficients(
            prepared.fusion.axes,
            np.repeat(prepared.array.mounting.position - prepared.fusion.centre, 3, axis=0),
        )
        self._tests = _tests(prepared) if faults else {}
        self._block = max((t.size for t in self._tests.values()), default=0)
        self._since, self._parity_from = 0, -np.inf
        self._use()

    def _use(self) -> None:
        """Make the fusion of the sensors that are in use."""
        prepared, out = self._prepared, self._out | np.repeat(self._silent, 3)
        absences = [
            Absence(kind, tuple(np.flatnonzero(out[kind]).tolist()), -np.inf, np.inf)
            for kind in (0, 1)
            if out[kind].any()
        ]
        table: SensorTable = sensor_table(
            np.array([-1e300, 1e300]), prepared.array.mounting, prepared.models, absences
        )
        fusion = table.fusions[0]
        self._table, self._pi = table, (fusion.accel, fusion.gyro)
        # what rotation adds to the fused force: nothing where the middle of those in use stays
        moment = self._arms @ fusion.accel.T
        self._moment = moment if np.abs(moment).max() > 1e-12 else None
        self._stretch = table.stretches(prepared.models, self._factors)
        self._parity = Parity(prepared.array, table, prepared.models, self._states)

    @property
    def out(self) -> BoolArray:
        """Which accelerometers and gyros are not used now, (2, 3 k)."""
        return np.asarray(self._out | np.repeat(self._silent, 3))

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
            Other shapes, no IMU with values, or what `NavigationFilter.add_imu` refuses.
        """
        row = self._kept
        if row == len(self._time):
            row = self._move_up()
        values = self._values[row]
        try:
            values[0], values[1] = np.ravel(accel), np.ravel(gyro)
        except ValueError:
            raise InputError(
                f"a sample of shape {np.shape(gyro)} and {np.shape(accel)}",
                expected=f"two of ({self._silent.size}, 3)",
            ) from None
        self._time[row] = time
        # one sum tells whether something is missing
        if self._silent.any() or not np.isfinite(values.sum()):
            self._silences(values, row)
        rate, force = self._pi[1] @ values[1], self._pi[0] @ values[0]
        if self._moment is not None:
            force = force - self._turned(row, rate[None])[0] @ self._moment
        if self._kept and time - self._parity_from >= PARITY - 1e-9 and time > self.filter.time:
            # before its sample: nothing has to be taken once more
            self._kept = row + 1
            self._measure_parity(self._parity_from, time)
            self._parity_from, self._kept = time, row
        self.filter.add_imu(time, rate, force)
        self._kept = row + 1
        if self._kept == 1:
            self._parity_from = time
        self._since += 1
        if self._block and self._since >= self._block:
            self._since = 0
            self._look()

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
        """Forget the older half."""
        self._time[: self._places] = self._time[self._places :]
        self._values[: self._places] = self._values[self._places :]
        self._kept = self._places
        return self._kept

    def _silences(self, values: FloatArray, row: int) -> None:
        """Leave out IMUs without values, and let those in that have some again."""
        there = np.isfinite(values.reshape(2, -1, 3)).all(axis=(0, 2))
        if not there.any():
            raise InputError(
                f"at {self._time[row]:.3f} s no IMU has a whole sample", expected="at least one"
            )
        if np.any(self._silent == there):
            self._silent = np.asarray(~there)
            self._use()
            nothing = np.empty((0, 3))
            self.filter.fuse_again(self._time[row], nothing, nothing, self._stretch)
        values.reshape(2, -1, 3)[:, ~there] = 0.0

    def _turned(self, row: int, rate: FloatArray) -> FloatArray:
        """Tensor of the last samples of a row of rates, (m, 9)."""
        before = max(row - len(rate), 0)
        if before == row or row == 0:
            return turning_tensor(self._time[: len(rate)], rate, causal=True)
        first = row - len(rate) + 1
        last = self._values[first - 1, 1] @ self._pi[1].T
        whole = np.concatenate([last[None], rate])
        return turning_tensor(self._time[first - 1 : row + 1], whole, causal=True)[1:]

    def _look(self) -> None:
        """Test the last block; act when somebody is taken out or let back in."""
        rows = slice(self._kept - self._block, self._kept)
        if rows.start < 1:
            return
        rate = self._values[rows, 1] @ self._pi[1].T
        tensor = self._turned(self._kept - 1, rate) if self._tests[0].arms else None
        for kind, test in self._tests.items():
            measured = self._values[rows, kind].copy()
            measured[:, np.repeat(self._silent, 3)] = np.nan
            records = test.take(self._time[rows], measured, None if kind else tensor)
            if np.array_equal(test.out, self._out[kind]):
                continue
            added = np.flatnonzero(test.out & ~self._out[kind])
            start = self._onset(kind, added) if added.size else self._time[self._kept - 1]
            told = [r for r in records if r.kind in ("axis", "unit") and r.stop is None]
            self.absences += [SensorAbsence(r, start) for r in told]
            self._end(kind, test)
            self._out[kind] = test.out
            self._go_back(start)

    def _end(self, kind: int, test: FaultStream) -> None:
        """Write into the log who is used again."""
        now = float(self._time[self._kept - 1])
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
        test = self._tests[kind]
        rows = slice(max(self._kept - self._places, 0), self._kept)
        x = self._values[rows, kind]
        if kind == 0 and test.arms:
            rate = self._values[rows, 1] @ self._pi[1].T
            tensor = turning_tensor(self._time[rows], rate, causal=True)
            x = x - tensor @ arm_coefficients(test.sensors.axes, test.sensors.arms)
        others = ~(test.out | self._out[kind] | np.repeat(self._silent, 3))
        off = against_others(x, test.sensors.axes, added.tolist(), others, test.variance)
        found = None if off is None else onset_of(off, self._time[rows], test.size)
        now = float(self._time[self._kept - 1])
        earliest = max(float(self._time[rows.start]), now - LOOK_BACK + 0.5)
        return max((now - 1.0 if found is None else found) - MARGIN, earliest)

    def _go_back(self, start: float) -> None:
        """Fuse the samples since a time once more, with those in use now."""
        self._use()
        first = int(np.searchsorted(self._time[: self._kept], start - 1e-9))
        first = min(max(first, self._kept - self._places), self._kept - 1)
        rows = slice(first, self._kept)
        rate = self._values[rows, 1] @ self._pi[1].T
        force = self._values[rows, 0] @ self._pi[0].T
        if self._moment is not None:
            force = force - self._turned(self._kept - 1, rate) @ self._moment
        self.filter.fuse_again(float(self._time[first]), rate, force, self._stretch)
        begin = float(self._time[first])
        while self._parity_from - begin >= PARITY:
            self._measure_parity(begin, begin + PARITY)
            begin += PARITY

    def _measure_parity(self, begin: float, end: float) -> None:
        """Take what the sensors in use differ by over some time."""
        first, stop = np.searchsorted(self._time[: self._kept], [begin + 1e-9, end + 1e-9])
        if stop - first < 2:
            return
        values = self._values[first:stop].mean(axis=0)
        if np.abs(self._arms).max() > 1e-12:
            rate = self._values[first:stop, 1] @ self._pi[1].T
            tensor = self._turned(int(stop) - 1, rate).mean(axis=0)
            values[0] = values[0] - tensor @ self._arms
        for kind in (0, 1):
            found = self._parity.measured(kind, 0, values[kind][None], self._shown[kind])
            if found is not None:
                z, matrix, noise = found
                when = float(self._time[stop - 1])
                self.filter.add(linear_measurements(when, z, matrix, noise / (end - begin)))


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
