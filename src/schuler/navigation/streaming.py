"""The filter in real time: one sample, one fix at a time, late fixes at their own time.

The kernel is that of the batch filter, entered with what the filter remembers, so that the same
samples and fixes give the same numbers. A fix that comes late goes back to the latest snapshot of
the filter before its time; the samples since then, which are kept, are taken once more.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from schuler.data import GnssRecording, ImuRecording
from schuler.errors import InputError, NavigationError
from schuler.kernels.navigation.filter_data import (
    AidingOutputs,
    Filter,
    NodeOutputs,
    SampleOutputs,
    Samples,
    Schedule,
)
from schuler.kernels.navigation.filter_data import FilterState as KernelState
from schuler.navigation.aiding.gnss import CorrelatedGnss, GnssErrorModel
from schuler.navigation.aiding.schedule import (
    GENERAL,
    LINEAR,
    POSITION,
    VELOCITY,
    AidingSchedule,
    for_states,
)
from schuler.navigation.causal import ConstraintStream, GapNoise, VibrationStream
from schuler.navigation.engine import NodeStretch, ask_model, gate_thresholds
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.lagged import lag_horizons, smooth_nodes_with_lag
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.stepping import (
    NO_SCALE,
    NO_VEHICLE,
    FilterOptions,
    FilterStepper,
    InitialState,
    SensorStretches,
    check_references,
)
from schuler.navigation.stream_buffers import LinearRows, RowBuffer, SampleBuffer
from schuler.navigation.stream_checks import (
    FARTHEST_AHEAD,
    check_ahead,
    check_measurements,
    checked_position,
    checked_sample,
    checked_scale,
    checked_time,
    checked_velocity,
)
from schuler.types import FloatArray

# samples between two snapshots that a late fix may go back to
SNAPSHOT_EVERY = 8
# measurements that wait or may be used once more
MEASUREMENTS_KEPT = 4096
# of which so many may wait that a user gives; the rest is for constraints of the vehicle
MOST_WAITING = 3584
# at one time positions come first, then velocities, then all else
OTHER_RANK = 2

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

    Examples
    --------
    >>> from schuler import NavigationFilter, NoiseModel, Scenario, WhiteNoise
    >>> from schuler import prepare, simulate_drive
    >>> from schuler.simulation import RTK_FIXED
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> drive = simulate_drive(Scenario("car_urban", model, RTK_FIXED, duration=120.0), seed=1)
    >>> imu, gnss = drive.imus[0], drive.gnss
    >>> ready, setup = prepare(imu, gnss, model, time_offset=0.0, tune_noise=False)
    >>> stream = NavigationFilter.from_setup(setup, ready, gnss)
    >>> stream.state().position.shape
    (3,)
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
    white_share, slow_share : float
        Of the claimed variances of position: what is noise, and what those states are seen with;
        see `GnssErrorModel`.

    Examples
    --------
    >>> from schuler import GnssReceiver
    >>> GnssReceiver(lever_arm=(0.0, 0.0, -1.2), position_offset=0.05).position_factor
    1.0
    """

    lever_arm: ArrayLike = (0.0, 0.0, 0.0)
    position_offset: float = 0.0
    velocity_offset: float = 0.0
    position_factor: float = 1.0
    velocity_factor: float = 1.0
    offset_states: Sequence[int] = (-1, -1, -1)
    white_share: float = 1.0
    slow_share: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class _Shown:
    """How sensor errors show from a sample of the stream on; see `SensorStretches`."""

    sample: int
    stretch: SensorStretches


class NavigationFilter:
    """A filter that is fed sample by sample.

    Parameters
    ----------
    initial : InitialState
        At the first sample.
    model : SensorErrorModel
        Sensor error states and white noise.
    rate : float
        Samples a second, about; for the size of what is kept.
    late : float
        How late a fix may come, s.
    lag : float or None
        How long `smoothed_state` waits for later measurements, s; None: no smoothing.
    receiver : GnssReceiver
        How fixes are used.
    constraints : ConstraintStream or None
        Makes the constraints of a vehicle out of the samples.
    vibration : VibrationStream or None
        Makes the noise follow vibration.
    gaps : GapNoise or None
        Bridges gaps in the samples, with noise for what may have happened; None: the sample after
        a gap is taken as the mean over it.
    gate : (4,) ndarray
        See `gate_thresholds`.
    robustness : (9,) ndarray or None, default None
        See `GnssWeighting`; None: a gate, and the noise that the receiver claims.
    vehicle : VehicleStates, default NO_VEHICLE
        Of a wheeled vehicle whose constraints are given to `add`.
    node_interval : float, default 0.25
        Longest time between nodes, s.

    Notes
    -----
    Not for several threads at a time. Kernels compile at the first sample unless they were
    compiled before (`schuler warm`).

    Examples
    --------
    >>> from schuler import NavigationFilter, NoiseModel, Scenario, WhiteNoise
    >>> from schuler import prepare, simulate_drive
    >>> from schuler.simulation import RTK_FIXED
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> drive = simulate_drive(Scenario("car_urban", model, RTK_FIXED, duration=120.0), seed=1)
    >>> imu, gnss = drive.imus[0], drive.gnss
    >>> ready, setup = prepare(imu, gnss, model, time_offset=0.0, tune_noise=False)
    >>> stream = NavigationFilter.from_setup(setup, ready, gnss)
    >>> for time, gyro, accel in zip(ready.time[-90:], ready.gyro[-90:], ready.accel[-90:]):
    ...     stream.add_imu(time, gyro, accel)
    >>> bool(stream.time == ready.time[-1])
    True
    """

    def __init__(
        self,
        initial: InitialState,
        model: SensorErrorModel,
        *,
        rate: float,
        late: float = 1.0,
        lag: float | None = None,
        receiver: GnssReceiver | None = None,
        constraints: ConstraintStream | None = None,
        vibration: VibrationStream | None = None,
        gaps: GapNoise | None = None,
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
        self._constraints, self._vibration, self._gaps = constraints, vibration, gaps
        # steps longer than this are looked at by the means above; all are where some look at each
        self._plain = math.inf if gaps is None else gaps.shortest
        if constraints is not None or vibration is not None:
            self._plain = 0.0
        self._receiver = receiver or GnssReceiver()
        lever = np.asarray(self._receiver.lever_arm, dtype=np.float64)
        self._antenna = (
            RowBuffer.of_antenna(POSITION, lever, self._receiver.offset_states),
            RowBuffer.of_antenna(VELOCITY, lever, _NONE),
        )
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
        slow = more.correlated
        other = setup.sources or isinstance(slow, CorrelatedGnss)
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
        if isinstance(slow, GnssErrorModel):
            receiver = replace(
                receiver,
                offset_states=tuple(range(slow.place, slow.place + 3)),
                white_share=slow.white,
                slow_share=slow.slow,
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
            Time that does not increase or jumps, or no sample of an IMU; nothing has changed, and
            the next good sample is taken.
        NavigationError
            The state stopped being finite: the filter is back at the last moment that it was
            finite at, a few samples ago.
        """
        time, rate, force = checked_sample(time, gyro, accel, self._last)
        if white_scale is not None:
            white_scale = checked_scale(white_scale)
        if time - self._last > self._plain:
            white_scale = self._watch(time, rate, force, white_scale)
        self._take(time, rate, force, white_scale)

    def _watch(
        self, time: float, gyro: FloatArray, accel: FloatArray, white_scale: ArrayLike | None
    ) -> ArrayLike | None:
        """Make of a sample what else it tells: constraints, a bridge over a gap, its noise."""
        if self._constraints is not None:
            for when, kind, value, variance in self._constraints.rows(time, gyro, accel):
                row = RowBuffer.blank(1)
                row.table["kind"], row.table["rank"] = kind, OTHER_RANK
                row.first[0], row.value[:], row.variance[:] = when, value, variance
                self._insert(row.first, when, OTHER_RANK, MEASUREMENTS_KEPT)
        if self._gaps is not None and self._gaps.shortest < time - self._last < math.inf:
            self._bridge(time, gyro, accel, self._gaps)
        if white_scale is None and self._vibration is not None:
            return self._vibration.scale(gyro, accel)
        return white_scale

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

        Raises
        ------
        InputError
            No fix: numbers that are not finite, degrees, deviations that cannot be, a time far
            ahead of the IMU; nothing has changed.
        """
        taken, receiver = True, self._receiver
        time = checked_time(time, "fix")
        later = max(receiver.position_offset, receiver.velocity_offset)
        check_ahead(time + later, self._last)
        place = None if position is None else checked_position(position, position_sd)
        speed = None if velocity is None else checked_velocity(velocity, velocity_sd)
        try:
            if place is not None:
                when = time + receiver.position_offset
                taken = self._fix(POSITION, when, *place, receiver.position_factor)
            if speed is not None:
                when = time + receiver.velocity_offset
                taken &= self._fix(VELOCITY, when, *speed, receiver.velocity_factor)
        finally:
            self._catch_up()
        return taken

    def _fix(
        self, rank: int, time: float, value: FloatArray, sd: FloatArray, factor: float
    ) -> bool:
        """Put what an antenna measured in its place: rank 0 a position, 1 a velocity."""
        row = self._antenna[rank]
        row.value[:] = value
        variance = row.variance
        np.multiply(sd, factor, out=variance)
        np.multiply(variance, variance, out=variance)
        if rank == POSITION and self._receiver.slow_share > 0.0:
            row.table["offset_scale"][0] = np.sqrt(self._receiver.slow_share * variance)
            np.multiply(variance, self._receiver.white_share, out=variance)
        row.first[0] = time
        return self._insert(row.first, time, rank)

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
        InputError
            One of them cannot be used; nothing has changed.
        NavigationError
            They refer to states that do not exist.
        """
        check_measurements(measurements, self._last)
        if any(measurements.general):
            measurements = for_states(measurements, self._states)
        check_references(measurements, self._states)
        try:
            return self._inserted(measurements)
        finally:
            # a model of one's own may fail after the filter went back
            self._catch_up()

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

    def state(self) -> FilterState:
        """Return the state at the last sample.

        Returns
        -------
        FilterState
            Copies.
        """
        return FilterState(self._last, *self._stepper.copies())

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
            NodeStretch(int(numbers[0]), made, self._nodes, self._aiding),
            self._stepper.model.block,
            node,
            np.array([numbers[horizon]]),
        )
        one = slice(row, row + 1)
        values = SampleOutputs(
            *(getattr(samples.outputs, f.name)[one].copy() for f in fields(SampleOutputs))
        )
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

    def add_fused(self, time: float, gyro: FloatArray, accel: FloatArray) -> None:
        """Take a sample that was looked at already; see `add_imu`."""
        scale = None
        if time - self._last > self._plain:
            scale = self._watch(time, gyro, accel, None)
        self._take(time, gyro, accel, scale)

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
