"""The filter in real time, as a user feeds and asks it."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Unpack

import numpy as np
from numpy.typing import ArrayLike

from schuler.data import GnssRecording, ImuRecording
from schuler.errors import InputError
from schuler.navigation.aiding.gnss import CorrelatedGnss, GnssErrorModel
from schuler.navigation.aiding.schedule import POSITION, VELOCITY, AidingSchedule, for_states
from schuler.navigation.causal import ConstraintStream, GapNoise, VibrationStream
from schuler.navigation.engine import gate_thresholds
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.stepping import NO_VEHICLE, FilterOptions, InitialState, check_references
from schuler.navigation.stream.buffers import RowBuffer
from schuler.navigation.stream.checks import (
    check_ahead,
    check_measurements,
    checked_position,
    checked_sample,
    checked_scale,
    checked_time,
    checked_velocity,
)
from schuler.navigation.stream.rewinding import MEASUREMENTS_KEPT, OTHER_RANK, RewindingFilter
from schuler.navigation.stream.smoothed import smoothed_state
from schuler.navigation.stream.state import FilterState, GnssReceiver
from schuler.types import FloatArray

_NONE = np.full(3, -1, dtype=np.int64)


class NavigationFilter(RewindingFilter):
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
        super().__init__(initial, model, rate=rate, late=late, lag=lag, **how)
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
        parts = self._samples, self._nodes, self._aiding
        return smoothed_state(self._stepper, *parts, self._last, self.lag)

    def add_fused(self, time: float, gyro: FloatArray, accel: FloatArray) -> None:
        """Take a sample that was looked at already; see `add_imu`."""
        scale = None
        if time - self._last > self._plain:
            scale = self._watch(time, gyro, accel, None)
        self._take(time, gyro, accel, scale)
