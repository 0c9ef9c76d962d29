"""A filter that remembers: it goes back to before a late measurement and comes forward again.

The kernel is that of the batch filter, entered with what the filter remembers, so that the same
samples and fixes give the same numbers. A fix that comes late goes back to the latest snapshot of
the filter before its time; the samples since then, which are kept, are taken once more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import InputError, NavigationError
from schuler.kernels.navigation.filter_data import (
    AidingOutputs,
    Filter,
    NodeOutputs,
    Samples,
    Schedule,
)
from schuler.kernels.navigation.filter_data import FilterState as KernelState
from schuler.navigation.aiding.schedule import GENERAL, LINEAR, AidingSchedule
from schuler.navigation.engine import ask_model
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.stepping import (
    NO_SCALE,
    FilterOptions,
    FilterStepper,
    InitialState,
    SensorStretches,
)
from schuler.navigation.stream.buffers import LinearRows, RowBuffer, SampleBuffer
from schuler.navigation.stream.checks import FARTHEST_AHEAD
from schuler.types import FloatArray

# samples between two snapshots that a late fix may go back to
SNAPSHOT_EVERY = 8
# measurements that wait or may be used once more
MEASUREMENTS_KEPT = 4096
# of which so many may wait that a user gives; the rest is for constraints of the vehicle
MOST_WAITING = 3584
# at one time positions come first, then velocities, then all else
OTHER_RANK = 2


@dataclass(frozen=True, slots=True, eq=False)
class _Shown:
    """How sensor errors show from a sample of the stream on; see `SensorStretches`."""

    sample: int
    stretch: SensorStretches


class RewindingFilter:
    """Samples and rows of measurements in their places, snapshots, and the runs between them."""

    def __init__(
        self,
        initial: InitialState,
        model: SensorErrorModel,
        *,
        rate: float,
        late: float,
        lag: float | None,
        **how: Unpack[FilterOptions],
    ) -> None:
        if not (rate > 0.0 and late >= 0.0 and (lag is None or lag > 0.0)):
            raise InputError(
                f"a rate of {rate} Hz, fixes {late} s late, a lag of {lag} s",
                expected="a positive rate and lag, and a lateness of zero or more",
            )
        self._stepper = FilterStepper(initial, model, accumulating=lag is not None, **how)
        self.late, self.lag = late, lag
        self.late_fixes_refused = 0
        self._states = model.size
        self._linear = RowBuffer.blank(1)
        self._linear.table["kind"], self._linear.table["rank"] = LINEAR, OTHER_RANK
        held = max(late, 0.0 if lag is None else lag + 2.0 * self._stepper.rules.node_interval)
        places = int(held * rate * 1.5) + 4 * SNAPSHOT_EVERY
        self._samples = SampleBuffer(places, keep_outputs=lag is not None)
        self._rows = RowBuffer.blank(MEASUREMENTS_KEPT)
        self._matrices = np.full((MEASUREMENTS_KEPT, 3, 12 + self._states), 0.0)
        self._matrices_taken = 0
        self._known = 0
        size, width = self._stepper.size, self._stepper.width
        nodes = int(held * rate * 1.5) + 64 if lag is not None else 0
        kept = min(MEASUREMENTS_KEPT, 4 * nodes)
        self._aiding = AidingOutputs.empty(MEASUREMENTS_KEPT, kept, size)
        self._nodes = NodeOutputs.empty(max(nodes, 8), nodes, size, width)
        self._scaled = False
        self._shown: list[_Shown] = []
        self._shown_now = -1
        self._filter = self._built()
        snapshots = int(np.ceil(late * rate * 1.5 / SNAPSHOT_EVERY)) + 2
        self._snapshots = [
            KernelState.empty(model.size, width, lag is not None) for _ in range(snapshots)
        ]
        for snapshot in self._snapshots:
            # memory that nobody has written to costs the first sample that does
            snapshot.memory.fill(0.0)
        self._taken = 0
        self._begun = 0
        self._last = -math.inf
        self._begin = -math.inf
        self._snapshot()

    def _built(self) -> Filter:
        """The filter with what it takes and where it writes; the same for all calls."""
        samples = self._samples
        return self._stepper.filter(
            Samples(
                time=samples.time,
                gyro=samples.gyro,
                accel=samples.accel,
                white_scale=samples.scale if self._scaled else NO_SCALE,
            ),
            Schedule(rows=self._rows.table, matrices=self._matrices),
            samples.outputs,
            self._aiding,
            self._nodes,
        )

    def _take(
        self, time: float, gyro: ArrayLike, accel: ArrayLike, white_scale: ArrayLike | None
    ) -> None:
        samples = self._samples
        row = samples.add(time, gyro, accel)
        if white_scale is not None:
            if not self._scaled:
                self._scaled = True
                self._filter = self._built()
            samples.scale[row] = white_scale
        elif self._scaled:
            samples.scale[row] = 1.0
        self._last = time
        count = samples.count
        if count > 1:
            # mostly one sample is due, and nothing else
            plain = self._begun + 1 == count and count % SNAPSHOT_EVERY and not self._shown
            if plain and self._stepper.kernel(self._filter, row, row + 1, self._known, False) < 0:
                self._begun = count
            else:
                self._run()
        else:
            self._begin = time
            self._forget_others()

    def _forget_others(self) -> None:
        """Leave out what waits for the first sample but is of another time."""
        waiting = self._rows.bytes[: self._known]
        after = waiting[:, 0] - self._begin
        near = (after >= -self.late) & (after <= FARTHEST_AHEAD)
        kept = int(near.sum())
        waiting[:kept] = waiting[near]
        self.late_fixes_refused += self._known - kept
        self._known = kept

    def _inserted(self, measurements: AidingSchedule) -> bool:
        """Put checked measurements in their places; False if one came too late."""
        taken = True
        for k in range(measurements.size):
            when, matrix = float(measurements.time[k]), int(measurements.matrix[k])
            if measurements.kind[k] == GENERAL and (when > self._last or self._go_back(when)):
                ask_model(measurements, k, self._stepper.state)
            row = RowBuffer(measurements.select(slice(k, k + 1)).table())
            row.table["rank"] = OTHER_RANK
            if matrix >= 0:
                place = self._matrices_taken % len(self._matrices)
                self._matrices[place] = measurements.matrices[matrix]
                self._matrices_taken += 1
                row.table["matrix"] = place
            taken &= self._insert(row.bytes[0], when, OTHER_RANK)
        return taken

    def _insert(self, row: FloatArray, time: float, rank: int, most: int = MOST_WAITING) -> bool:
        """Put one measurement in its place; go back to before it if it is late."""
        if self._known - int(self._oldest().aided[0]) >= most:
            raise NavigationError(
                f"{most} measurements wait for samples of their time",
                expected="measurements not far ahead of the IMU",
            )
        if time <= self._last and not self._go_back(time):
            self.late_fixes_refused += 1
            return False
        places = MEASUREMENTS_KEPT
        at, rows, table = self._known, self._rows.bytes, self._rows.table
        while at > 0:
            before = (at - 1) % places
            due = rows[before, 0]
            if due < time or (due == time and table["rank"][before] <= rank):
                break
            rows[at % places] = rows[before]
            at -= 1
        rows[at % places] = row
        self._known += 1
        return True

    def _oldest(self) -> KernelState:
        """The oldest snapshot that is still there."""
        kept = len(self._snapshots)
        return self._snapshots[max(self._taken - kept, 0) % kept]

    def _snapshot(self) -> None:
        _copy_state(self._stepper.state, self._snapshots[self._taken % len(self._snapshots)])
        self._taken += 1

    def _go_back(self, time: float) -> bool:
        """Return the filter to before a time, if it is behind it; False if nobody remembers."""
        state = self._stepper.state
        if state.time[0] < time:
            return True
        if time < self._last - self.late or time < self._begin:
            return False
        kept = len(self._snapshots)
        for number in range(self._taken - 1, max(self._taken - kept, 0) - 1, -1):
            snapshot = self._snapshots[number % kept]
            if snapshot.time[0] < time:
                _copy_state(snapshot, state)
                self._taken = number + 1
                self._begun = int(state.samples[0])
                return True
        return False

    def add_linear(self, measured: LinearRows) -> None:
        """Take linear measurements that were looked at already, of a time that is to come."""
        row, matrices = self._linear, len(self._matrices)
        for value, variance, matrix in zip(
            measured.value, measured.variance, measured.matrix, strict=True
        ):
            place = self._matrices_taken % matrices
            self._matrices[place] = matrix
            self._matrices_taken += 1
            row.table["matrix"] = place
            row.first[0], row.value[:], row.variance[:] = measured.time, value, variance
            self._insert(row.first, measured.time, OTHER_RANK)

    def fuse_again(
        self,
        time: FloatArray,
        gyro: FloatArray,
        accel: FloatArray,
        pieces: Sequence[tuple[float, SensorStretches]],
        measured: Sequence[LinearRows] = (),
    ) -> None:
        """Take samples once more that are fused in another way, and those to come likewise.

        `time` (m,), `gyro`, `accel` (m, 3): all samples from a time on. `pieces`: how sensor errors
        show from which time on. Linear measurements since then rest on the fusion before: what was
        `measured` takes their place.
        """
        samples, begin = self._samples, pieces[0][0]
        if time.size and not self._go_back(begin):
            raise InputError(
                f"a fusion that changes from {begin:.3f} s on, {self._last - begin:.2f} s ago",
                expected=f"{self.late:g} s at most",
            )
        held = samples.time[: samples.count - samples.first]
        if time.size:
            rows = np.searchsorted(held, time)
            samples.gyro[rows], samples.accel[rows] = gyro, accel
            for row in np.setdiff1d(np.arange(rows[0] + 1, rows[-1]), rows):
                # what bridges a gap is the mean of its neighbours
                for values in (samples.gyro, samples.accel):
                    values[row] = 0.5 * (values[row - 1] + values[row + 1])
        starts = [samples.first + int(np.searchsorted(held, when)) for when, _ in pieces]
        before = [s for s in self._shown if s.sample < max(starts[0], 1)]
        # nobody goes back to before the oldest snapshot
        needless = sum(s.sample <= int(self._oldest().samples[0]) for s in before) - 1
        self._shown = before[max(needless, 0) :]
        for start, (_, stretch) in zip(starts, pieces, strict=True):
            self._shown.append(_Shown(start if start > 1 else 0, stretch))
        # whatever the filter shows now may be of a time it has left
        self._shown_now = -1
        self._forget_linear(begin)
        for rows_of_one_time in measured:
            self.add_linear(rows_of_one_time)
        self._catch_up()

    def _forget_linear(self, time: float) -> None:
        """Leave out linear measurements that are not taken yet and not before a time."""
        begun, places = int(self._stepper.state.aided[0]), MEASUREMENTS_KEPT
        rows, kind, kept = self._rows.bytes, self._rows.table["kind"], begun
        for number in range(begun, self._known):
            place = number % places
            if kind[place] == LINEAR and rows[place, 0] >= time:
                continue
            rows[kept % places] = rows[place]
            kept += 1
        self._known = kept

    def _show(self, begun: int, stop: int) -> int:
        """Let sensor errors show as they do from a sample on; returns where that changes next."""
        now = -1
        for place, shown in enumerate(self._shown):
            if shown.sample <= begun:
                now = place
            else:
                stop = min(stop, shown.sample)
                break
        if now >= 0 and now != self._shown_now:
            self._shown[now].stretch.enter(0, self._filter)
        self._shown_now = now
        return stop

    def _catch_up(self) -> None:
        if self._samples.count > 1 and self._begun < self._samples.count:
            self._run()

    def _run(self) -> None:
        """Take all samples that have come, with a snapshot now and then."""
        first, count, begun = self._samples.first, self._samples.count, self._begun
        advance, filter_, known = self._stepper.advance, self._filter, self._known
        while begun < count:
            stop = min(count, begun - begun % SNAPSHOT_EVERY + SNAPSHOT_EVERY)
            if self._shown:
                stop = self._show(begun, stop)
            bad = advance(filter_, begun - first, stop - first, known)
            if bad >= 0:
                when = float(self._samples.time[bad])
                self._forget_since_snapshot()
                raise NavigationError(
                    f"the navigation state stopped being finite at {when:.3f} s",
                    expected="a bounded trajectory",
                    cure="check units and axes of the IMU and the noise model; the filter is back "
                    f"at {self._last:.3f} s",
                )
            self._begun = begun = stop
            if stop % SNAPSHOT_EVERY == 0:
                self._snapshot()

    def _forget_since_snapshot(self) -> None:
        """Go back to the newest snapshot that is finite, without what came since."""
        kept = len(self._snapshots)
        for number in range(self._taken - 1, max(self._taken - kept, 0) - 1, -1):
            snapshot = self._snapshots[number % kept]
            if all(np.isfinite(v).all() for v in (snapshot.position, snapshot.covariance)):
                break
        _copy_state(snapshot, self._stepper.state)
        self._taken = number + 1
        self._known = int(snapshot.aided[0])
        samples = self._samples
        self._begun = samples.count = int(snapshot.samples[0])
        last = samples.count - samples.first - 1
        self._last = float(samples.time[last]) if last >= 0 else -math.inf


def _copy_state(source: KernelState, target: KernelState) -> None:
    target.memory[:], target.counters[:] = source.memory, source.counters
