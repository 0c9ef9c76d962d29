"""The filter in real time: one sample, one fix at a time, late fixes at their own time.

The kernel is that of the batch filter, entered with what the filter remembers, so that the same
samples and fixes give the same numbers. A fix that comes late goes back to the latest snapshot of
the filter before its time; the samples since then, which are kept, are taken once more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.data import GnssRecording, ImuRecording
from schuler.errors import InputError, NavigationError
from schuler.navigation.aiding.schedule import (
    GENERAL,
    POSITION,
    VELOCITY,
    AidingSchedule,
    for_states,
)
from schuler.navigation.causal import ConstraintStream, GapNoise, VibrationStream
from schuler.navigation.engine import NodeStretch, fill_row, gate_thresholds
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.lagged import lag_horizons, smooth_nodes_with_lag
from schuler.navigation.outputs import AidingOutputs, NodeOutputs, SampleOutputs
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.stepping import (
    NO_SCALE,
    NO_VEHICLE,
    FilterStepper,
    InitialState,
    VehicleStates,
    aiding_arrays,
    check_references,
    node_arrays,
    sample_arrays,
)
from schuler.types import FloatArray

# samples between two snapshots that a late fix may go back to
SNAPSHOT_EVERY = 16
# measurements that wait or may be used once more
MEASUREMENTS_KEPT = 4096
# where the memory of a filter keeps the time of its last sample, see kernels/memory.py
TIME_PLACE = 72

_NO_ARM = np.zeros(3)
_NONE = np.full(3, -1, dtype=np.int64)


@dataclass(frozen=True, slots=True, eq=False)
class FilterState:
    """The filter's state at one time.

    Parameters
    ----------
    time : float
        Seconds on the IMU's axis.
    position, velocity : (3,) ndarray
        Latitude rad, longitude rad, height m; north, east, down m/s.
    rotation : (3, 3) ndarray
        C_nb.
    sensor_state : (m,) ndarray
        Sensor error states, SI.
    covariance : (9 + m, 9 + m) ndarray
        Of position (m), velocity, attitude (rad), sensor states.
    """

    time: float
    position: FloatArray
    velocity: FloatArray
    rotation: FloatArray
    sensor_state: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class GnssReceiver:
    """How fixes are used that a stream brings.

    Parameters
    ----------
    lever_arm : (3,) array_like
        Antenna from IMU in the body frame, m.
    position_offset, velocity_offset : float
        Seconds added to the time of a fix to put its position and velocity on the IMU's axis.
    position_factor, velocity_factor : float
        Multiply the receiver's standard deviations.
    offset_states : (3,) sequence of int
        Places of sensor states that add to what positions measure; -1: none.
    """

    lever_arm: ArrayLike = (0.0, 0.0, 0.0)
    position_offset: float = 0.0
    velocity_offset: float = 0.0
    position_factor: float = 1.0
    velocity_factor: float = 1.0
    offset_states: Sequence[int] = (-1, -1, -1)


@dataclass(slots=True, eq=False)
class _Samples:
    """The latest samples of a stream, in a row: what came, and what the filter made of it."""

    places: int
    keep_outputs: bool
    time: FloatArray = field(init=False)
    gyro: FloatArray = field(init=False)
    accel: FloatArray = field(init=False)
    scale: FloatArray = field(init=False)
    outputs: SampleOutputs = field(init=False)
    first: int = 0
    count: int = 0

    def __post_init__(self) -> None:
        rows = 2 * self.places
        self.time, self.scale = np.empty(rows), np.ones((rows, 6))
        self.gyro, self.accel = np.empty((rows, 3)), np.empty((rows, 3))
        self.outputs = SampleOutputs.empty(rows if self.keep_outputs else 0)

    def add(self, time: float, gyro: ArrayLike, accel: ArrayLike) -> int:
        """Append one; its row."""
        row = self.count - self.first
        if row == len(self.time):
            for values in (self.time, self.gyro, self.accel, self.scale):
                values[: self.places] = values[self.places :]
            if self.keep_outputs:
                for values in sample_arrays(self.outputs):
                    values[: self.places] = values[self.places :]
            self.first += self.places
            row = self.places
        self.time[row] = time
        self.gyro[row] = gyro
        self.accel[row] = accel
        self.count += 1
        return row


class NavigationFilter:
    """A filter that is fed sample by sample.

    Parameters
    ----------
    initial : InitialState
        At the first sample.
    model : SensorErrorModel
        Sensor error states and white noise.
    gate : (4,) ndarray
        See `gate_thresholds`.
    rate : float
        Samples a second, about; for the size of what is kept.
    late : float
        How late a fix may come, s.
    lag : float or None
        How long `smoothed_state` waits for later measurements, s; None: no smoothing.
    vehicle : VehicleStates
        Of a wheeled vehicle whose constraints are given to `add`.
    receiver : GnssReceiver
        How fixes are used.
    constraints : ConstraintStream or None
        Makes the constraints of a vehicle out of the samples.
    vibration : VibrationStream or None
        Makes the noise follow vibration.
    gaps : GapNoise or None
        Bridges gaps in the samples, with noise for what may have happened; None: the sample after
        a gap is taken as the mean over it.
    node_interval : float
        As in `run_engine`.
    robustness : (9,) ndarray or None
        As in `run_engine`.

    Notes
    -----
    Not for several threads at a time. Kernels compile at the first sample unless they were
    compiled before (`schuler warm`).
    """

    def __init__(
        self,
        initial: InitialState,
        model: SensorErrorModel,
        *,
        gate: FloatArray,
        rate: float,
        late: float = 1.0,
        lag: float | None = None,
        vehicle: VehicleStates = NO_VEHICLE,
        receiver: GnssReceiver | None = None,
        constraints: ConstraintStream | None = None,
        vibration: VibrationStream | None = None,
        gaps: GapNoise | None = None,
        node_interval: float = 0.25,
        robustness: FloatArray | None = None,
    ) -> None:
        if not (rate > 0.0 and late >= 0.0 and (lag is None or lag > 0.0)):
            raise InputError(
                f"a rate of {rate} Hz, fixes {late} s late, a lag of {lag} s",
                expected="a positive rate and lag, and a lateness of zero or more",
            )
        self._stepper = FilterStepper(
            initial,
            model,
            gate=gate,
            robustness=robustness,
            vehicle=vehicle,
            node_interval=node_interval,
            accumulating=lag is not None,
        )
        self.late, self.lag = late, lag
        self.late_fixes_refused = 0
        self._states = model.size
        self._constraints, self._vibration, self._gaps = constraints, vibration, gaps
        self._receiver = receiver or GnssReceiver()
        self._lever = np.asarray(self._receiver.lever_arm, dtype=np.float64)
        self._offset = np.asarray(self._receiver.offset_states, dtype=np.int64)
        held = max(late, 0.0 if lag is None else lag + 2.0 * node_interval)
        places = int(held * rate * 1.5) + 4 * SNAPSHOT_EVERY
        self._samples = _Samples(places, keep_outputs=lag is not None)
        rows = MEASUREMENTS_KEPT
        self._time = np.full(rows, np.inf)
        self._rank = np.zeros(rows, dtype=np.int64)
        self._kind = np.zeros(rows, dtype=np.int64)
        self._value, self._variance = np.zeros((rows, 3)), np.zeros((rows, 3))
        self._arm = np.zeros((rows, 3))
        self._offset_state = np.full((rows, 3), -1, dtype=np.int64)
        self._matrix = np.full(rows, -1, dtype=np.int64)
        self._matrices = np.zeros((rows, 3, 12 + self._states))
        self._matrices_taken = 0
        self._measured = (
            self._time,
            self._kind,
            self._value,
            self._variance,
            self._arm,
            self._offset_state,
            self._matrix,
        )
        self._known, self._changed = 0, True
        self._same: tuple[Any, ...] = ()
        size, width = self._stepper.size, self._stepper.width
        nodes = int(held * rate * 1.5) + 64 if lag is not None else 0
        kept = min(rows, 4 * nodes)
        self._aiding = AidingOutputs.empty(rows, kept, size)
        self._nodes = NodeOutputs.empty(max(nodes, 8), nodes, size, width)
        self._after = (aiding_arrays(self._aiding), node_arrays(self._nodes))
        snapshots = int(np.ceil(late * rate * 1.5 / SNAPSHOT_EVERY)) + 2
        self._memories = np.zeros((snapshots, self._stepper.memory.size))
        self._counters = np.zeros((snapshots, self._stepper.counters.size), dtype=np.int64)
        self._taken = 0
        self._last = -np.inf
        self._begin = -np.inf
        self._scaled = False
        self._snapshot()

    @classmethod
    def from_setup(
        cls,
        setup: RunSetup,
        imu: ImuRecording,
        gnss: GnssRecording,
        *,
        false_alarm: float = 1e-6,
        late: float = 1.0,
        lag: float | None = None,
    ) -> NavigationFilter:
        """Start a stream with what a recording has taught: alignment, noise, vehicle, lags.

        Parameters
        ----------
        setup : RunSetup
            From `prepare`.
        imu : ImuRecording
            Its first sample is the one that the setup starts at, and has to be the first of the
            stream; it also says how strong vibration typically is, and how much motion a gap hides.
        gnss : GnssRecording
            An epoch near the start gives the position.
        false_alarm : float
            Of the innovation gate.
        late, lag : float
            As in the class.

        Returns
        -------
        NavigationFilter
            Before its first sample.

        Raises
        ------
        InputError
            The setup has measurements that a stream does not make by itself.
        """
        more = setup.measurements
        other = setup.sources or more.correlated is not None
        if other or (setup.vehicle is not None and "wheel" in setup.vehicle.constraints):
            raise InputError(
                "a setup with speed from wheel vibration or measurements of other sources",
                expected="GNSS, nhc and zupt in a stream",
                cure="leave 'wheel' out, and give other measurements to `add`",
            )
        receiver = GnssReceiver(
            setup.lever_arm,
            setup.offsets.position,
            setup.offsets.velocity,
            setup.factors.position_sd,
            setup.factors.velocity_sd,
        )
        return cls(
            setup.initial_state(imu, gnss),
            setup.model,
            gate=gate_thresholds(false_alarm),
            robustness=more.weighting.array(),
            rate=imu.rate,
            late=late,
            lag=lag,
            vehicle=NO_VEHICLE if setup.vehicle is None else setup.vehicle.states,
            receiver=receiver,
            constraints=None
            if setup.vehicle is None
            else ConstraintStream(setup.vehicle, setup.model.white_density[3:], imu.rate),
            vibration=VibrationStream(setup.vibration, imu) if setup.vibration.active else None,
            gaps=GapNoise(setup.model.white_density, imu),
        )

    @property
    def time(self) -> float:
        """Time of the last sample, s; minus infinity before the first."""
        return self._last

    @property
    def log_likelihood(self) -> float:
        """Of the accepted measurements so far."""
        return self._stepper.log_likelihood

    def add_imu(
        self,
        time: float,
        gyro: ArrayLike,
        accel: ArrayLike,
        white_scale: ArrayLike | None = None,
    ) -> None:
        """Take one sample.

        Parameters
        ----------
        time : float
            Seconds; later than the sample before.
        gyro, accel : (3,) array_like
            Mean rate (rad/s) and specific force (m/s²) since the sample before.
        white_scale : (6,) array_like or None
            Factors on the squared white-noise densities, accelerometers first; None: by the
            vibration, if the filter was told to.

        Raises
        ------
        InputError
            Time does not increase.
        NavigationError
            The state stopped being finite.
        """
        if not time > self._last:
            raise InputError(
                f"a sample at {time:.6f} s after one at {self._last:.6f} s",
                expected="time that increases",
            )
        rate, force = np.asarray(gyro, dtype=np.float64), np.asarray(accel, dtype=np.float64)
        if self._constraints is not None:
            for when, kind, value, variance in self._constraints.rows(time, rate, force):
                self._insert(when, kind, 2, value, variance, _NO_ARM, _NONE)
        if self._gaps is not None and self._gaps.shortest < time - self._last < math.inf:
            self._bridge(time, rate, force, self._gaps)
        if white_scale is None and self._vibration is not None:
            white_scale = self._vibration.scale(rate, force)
        self._take(time, rate, force, white_scale)

    def _take(
        self, time: float, gyro: FloatArray, accel: FloatArray, white_scale: ArrayLike | None
    ) -> None:
        samples = self._samples
        row = samples.add(time, gyro, accel)
        if white_scale is not None:
            self._scaled = True
            samples.scale[row] = white_scale
        elif self._scaled:
            samples.scale[row] = 1.0
        if samples.count == 1:
            self._begin = time
        self._last = time
        if samples.count > 1:
            self._run()

    def _bridge(self, time: float, gyro: FloatArray, accel: FloatArray, gaps: GapNoise) -> None:
        """Put the mean of the samples around a gap into it, with the noise of what was missed."""
        samples = self._samples
        before = samples.count - samples.first - 1
        seconds = time - gaps.step - self._last
        self._take(
            time - gaps.step,
            0.5 * (samples.gyro[before] + gyro),
            0.5 * (samples.accel[before] + accel),
            gaps.scale(seconds),
        )

    def add_gnss(
        self,
        time: float,
        position: ArrayLike | None = None,
        position_sd: ArrayLike = np.inf,
        velocity: ArrayLike | None = None,
        velocity_sd: ArrayLike = np.inf,
    ) -> bool:
        """Take one fix, now or late; one of the future waits for its time.

        Parameters
        ----------
        time : float
            Seconds, by the receiver's clock.
        position : (3,) array_like or None
            Latitude rad, longitude rad, height m, of the antenna.
        position_sd : array_like
            North, east, down, m.
        velocity : (3,) array_like or None
            North, east, down, m/s, of the antenna.
        velocity_sd : array_like
            North, east, down, m/s.

        Returns
        -------
        bool
            False if something of it came too late.
        """
        taken, receiver = True, self._receiver
        if position is not None:
            variance = (np.asarray(position_sd) * receiver.position_factor) ** 2
            when = float(time) + receiver.position_offset
            taken = self._insert(when, POSITION, 0, position, variance, self._lever, self._offset)
        if velocity is not None:
            variance = (np.asarray(velocity_sd) * receiver.velocity_factor) ** 2
            when = float(time) + receiver.velocity_offset
            taken &= self._insert(when, VELOCITY, 1, velocity, variance, self._lever, _NONE)
        self._catch_up()
        return taken

    def add(self, measurements: AidingSchedule) -> bool:
        """Take any measurements: constraints of a vehicle, other sensors, models of one's own.

        Parameters
        ----------
        measurements : AidingSchedule
            Sorted by time; at one time they come behind what is there already.

        Returns
        -------
        bool
            False if one came too late.

        Raises
        ------
        NavigationError
            They refer to states that do not exist.
        """
        if any(measurements.general):
            measurements = for_states(measurements, self._states)
        check_references(measurements, self._states)
        taken = True
        for k in range(measurements.size):
            when, matrix = float(measurements.time[k]), int(measurements.matrix[k])
            if measurements.kind[k] == GENERAL and (when > self._last or self._go_back(when)):
                fill_row(measurements, k, self._stepper)
            if matrix >= 0:
                place = self._matrices_taken % len(self._matrices)
                self._matrices[place] = measurements.matrices[matrix]
                self._matrices_taken += 1
                matrix = place
            taken &= self._insert(
                when,
                int(measurements.kind[k]),
                2,
                measurements.value[k],
                measurements.variance[k],
                measurements.lever_arm[k],
                measurements.offset_state[k],
                matrix,
            )
        self._catch_up()
        return taken

    def state(self) -> FilterState:
        """Return the state at the last sample.

        Returns
        -------
        FilterState
            Copies.
        """
        return FilterState(self._last, *(v.copy() for v in self._stepper.views()))

    def smoothed_state(self) -> FilterState | None:
        """Return the state at the newest sample that is `lag` old, with what came since.

        Returns
        -------
        FilterState or None
            As fixed-lag smoothing of the whole recording gives it (`smooth_run_with_lag`), with
            the sensor states of the node before, and a covariance without what lies between its
            position, velocity and attitude parts; None before the stream is old enough.

        Raises
        ------
        InputError
            The filter was made without a lag.
        """
        if self.lag is None:
            raise InputError("this filter keeps nothing to smooth with", cure="give it a lag")
        samples, made = self._samples, self._stepper.nodes_made
        rows = samples.count - samples.first
        row = int(np.searchsorted(samples.time[:rows], self._last - self.lag + 1e-9, "right")) - 1
        if row < 0 or made < 2:
            return None
        time = float(samples.time[row])
        places = self._nodes.size
        numbers = np.arange(max(made - places, 0), made)
        node_time = self._nodes.time[numbers % places]
        at = int(np.searchsorted(node_time, time, "right")) - 1
        if at < 0:
            return None
        horizon = lag_horizons(node_time, self.lag)[at]
        node = int(numbers[at])
        lagged = smooth_nodes_with_lag(
            NodeStretch(int(numbers[0]), made, self._nodes, self._aiding.row, self._aiding.gain),
            self._aiding,
            self._stepper.block,
            node,
            np.array([numbers[horizon]]),
        )
        one = slice(row, row + 1)
        values = SampleOutputs(*(a[one].copy() for a in sample_arrays(samples.outputs)))
        ahead = float(node_time[at + 1]) if at + 1 < node_time.size else np.inf
        share = np.array([min((time - float(node_time[at])) / (ahead - float(node_time[at])), 1.0)])
        found = lagged.corrected(values, np.zeros(1, dtype=np.int64), share)
        s = self._stepper.size
        covariance = np.zeros((s, s))
        covariance[:3, :3] = found.position_covariance[0]
        sd = np.concatenate([found.velocity_sd[0], found.attitude_sd[0], lagged.sd[0, 9:]])
        covariance[range(3, s), range(3, s)] = sd**2
        place = node % places
        return FilterState(
            time,
            found.position[0],
            found.velocity[0],
            found.rotation[0],
            self._nodes.sensor_state[place] + lagged.error[0, 9:],
            covariance,
        )

    def _insert(
        self,
        time: float,
        kind: int,
        rank: int,
        value: ArrayLike,
        variance: ArrayLike,
        arm: FloatArray,
        offset: NDArray[np.int64],
        matrix: int = -1,
    ) -> bool:
        """Put one measurement in its place; go back to before it if it is late."""
        if not math.isfinite(time):
            raise InputError(f"a measurement at the time {time}", expected="a finite time")
        if time <= self._last and not self._go_back(time):
            self.late_fixes_refused += 1
            return False
        rows = self._time.size
        if self._known - int(self._counters[self._oldest() % len(self._counters), 1]) >= rows:
            raise NavigationError(
                f"{rows} measurements wait for samples of their time",
                expected="measurements not far ahead of the IMU",
            )
        at = self._known
        while at > 0:
            before = (at - 1) % rows
            if (self._time[before], self._rank[before]) <= (time, rank):
                break
            self._rank[at % rows] = self._rank[before]
            for values in self._measured:
                values[at % rows] = values[before]
            at -= 1
        own = at % rows
        self._time[own], self._rank[own], self._kind[own] = time, rank, kind
        self._value[own], self._variance[own], self._arm[own] = value, variance, arm
        self._offset_state[own], self._matrix[own] = offset, matrix
        self._known += 1
        self._changed = True
        return True

    def _oldest(self) -> int:
        """Number of the oldest snapshot that is still there."""
        return max(self._taken - len(self._memories), 0)

    def _snapshot(self) -> None:
        place = self._taken % len(self._memories)
        self._memories[place] = self._stepper.memory
        self._counters[place] = self._stepper.counters
        self._taken += 1

    def _go_back(self, time: float) -> bool:
        """Return the filter to before a time, if it is behind it; False if nobody remembers."""
        if self._stepper.time < time:
            return True
        if time < self._last - self.late or time < self._begin:
            return False
        for number in range(self._taken - 1, self._oldest() - 1, -1):
            place = number % len(self._memories)
            if self._memories[place, TIME_PLACE] < time:
                self._stepper.memory[:] = self._memories[place]
                self._stepper.counters[:] = self._counters[place]
                self._taken = number + 1
                return True
        return False

    def _catch_up(self) -> None:
        if self._samples.count > 1 and self._stepper.samples_taken < self._samples.count:
            self._run()

    def _tail(self) -> tuple[Any, ...]:
        """What goes to the kernel behind the samples; the same until a measurement comes."""
        measurements = (self._known, *self._measured, self._matrices)
        return self._stepper.tail(measurements, sample_arrays(self._samples.outputs), *self._after)

    def _run(self) -> None:
        """Take all samples that have come, with a snapshot now and then."""
        samples, stepper = self._samples, self._stepper
        begun, count = int(stepper.counters[0]), samples.count
        while begun < count:
            stop = min(count, begun - begun % SNAPSHOT_EVERY + SNAPSHOT_EVERY)
            first, last = begun - samples.first, stop - samples.first
            if self._changed:
                self._same = self._tail()
                self._changed = False
            bad = stepper.advance(
                samples.time[first:last],
                samples.gyro[first:last],
                samples.accel[first:last],
                samples.scale[first:last] if self._scaled else NO_SCALE,
                False,
                self._same,
                first,
            )
            if bad >= 0:
                raise NavigationError(
                    f"the navigation state stopped being finite at "
                    f"{samples.time[first + bad]:.3f} s",
                    expected="a bounded trajectory",
                    cure="check units and axes of the IMU and the noise model",
                )
            begun = stop
            if stop % SNAPSHOT_EVERY == 0:
                self._snapshot()
