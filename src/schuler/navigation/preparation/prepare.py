"""Before the first run: alignment, time offsets, noise, and how the IMU sits in the vehicle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal, Unpack

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.errors import NavigationError
from schuler.navigation.aiding.gnss import GnssErrorModel
from schuler.navigation.aiding.options import MeasurementOptions
from schuler.navigation.aiding.vehicle import VehicleConstraint, with_vehicle_states
from schuler.navigation.error_models.sensor_error_model import (
    generic_noise_model,
    sensor_error_model,
)
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.innovation_likelihood import slower_imu
from schuler.navigation.preparation.alignment import Alignment, align
from schuler.navigation.preparation.clock_drift import find_clock_drift
from schuler.navigation.preparation.diagnosis import GYROS_IN_DEGREES, turns_too_fast
from schuler.navigation.preparation.drive_fit import judge_constraints, require_fit
from schuler.navigation.preparation.drive_screening import screen_drive
from schuler.navigation.preparation.felt_lag import find_felt_lag
from schuler.navigation.preparation.gaps import (
    DriveCondition,
    WorseStretch,
    align_segments,
    knock_gap,
    split_at_gaps,
)
from schuler.navigation.preparation.knocks import (
    LEAST_PROMISE,
    MARGIN,
    UNSURE,
    begun_anew,
    explains,
    finding_on,
    moment_of_knock,
    squares_of,
)
from schuler.navigation.preparation.mounting import estimate_mounting
from schuler.navigation.preparation.setup import NoiseFactors, RunSetup, TimeOffsets
from schuler.navigation.preparation.standing import judge_standing
from schuler.navigation.preparation.usable import check_inputs, from_first_fix
from schuler.navigation.preparation.worse_stretches import find_worse_stretches, findings_on
from schuler.navigation.run import run
from schuler.navigation.settings import (
    NavigationOptions,
    NavigationSettings,
    Progress,
    TimeOffset,
    navigation_settings,
    nobody_listens,
)
from schuler.navigation.tuning.gnss_errors import fit_split
from schuler.navigation.tuning.lever_arm import arm_finding, find_lever_arm
from schuler.navigation.tuning.likelihood import enough_to_tune, find_time_offset, velocity_lag
from schuler.navigation.tuning.told_noise import contradicting_noise, tuned_after_all
from schuler.navigation.tuning.tune import Sought, tune
from schuler.noise.noise_model import NoiseModel
from schuler.screening.screen import Finding

# seconds around the first guess within which a time offset is looked for: where nothing tells it,
# and where accelerations do
UNKNOWN_OFFSET, FELT_OFFSET = 1.0, 0.3
CLOCK_ROUNDS = 2
MOST_KNOCKS = 2
ALIGNED_WITHIN = 0.1
"""Change of the offset (s) that needs no other alignment."""


@dataclass(frozen=True, slots=True, eq=False)
class PreparedDrive:
    """A recording as it is used, and everything a run of it needs."""

    imu: ImuRecording  # cut to where it can be used, short gaps bridged
    setup: RunSetup  # ready to run


def prepare(
    imu: ImuRecording,
    gnss: GnssRecording,
    noise_model: NoiseModel | None = None,
    *,
    progress: Progress | None = None,
    **options: Unpack[NavigationOptions],
) -> tuple[ImuRecording, RunSetup]:
    """Align, find time offsets, noise and mounting, and return all that a run needs.

    Parameters
    ----------
    imu, gnss, noise_model, progress, **options
        As for `navigate`.

    Returns
    -------
    imu : ImuRecording
        Cut to where it can be used.
    setup : RunSetup
        For `NavigationFilter.from_setup`.

    Raises
    ------
    InputError
        Recordings without what is needed.
    NavigationError
        No overlap, no heading, or no mounting where it is needed.

    Examples
    --------
    >>> from schuler import NoiseModel, Scenario, WhiteNoise, prepare, simulate_drive
    >>> from schuler.simulation import RTK_FIXED
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> drive = simulate_drive(Scenario("car_urban", model, RTK_FIXED, duration=120.0), seed=1)
    >>> imu, gnss = drive.imus[0], drive.gnss
    >>> ready, setup = prepare(imu, gnss, model, time_offset=0.0, tune_noise=False)
    >>> ready.complete
    True
    """
    settings = navigation_settings(prepare, options)
    done = prepare_drive(imu, gnss, noise_model, settings, progress)
    return done.imu, done.setup


def prepare_drive(
    imu: ImuRecording,
    gnss: GnssRecording,
    noise_model: NoiseModel | None,
    settings: NavigationSettings,
    progress: Progress | None = None,
) -> PreparedDrive:
    """As `prepare`; what the drive contradicts of noise and of GNSS is taken as the drive tells."""
    done = _with_clocks(imu, gnss, noise_model, settings, progress, NOTHING)
    known = NOTHING
    told: tuple[Finding, ...] = ()
    if settings.tune_noise is None and noise_model is not None:
        found = contradicting_noise(done.imu, gnss, done.setup)
        if found is not None:
            settings = replace(settings, tune_noise=True)
            # what noise that is too small has made of arm and clocks is looked for anew
            known = replace(known, rough=found)
            done = _with_clocks(imu, gnss, noise_model, settings, progress, known)
            told = (tuned_after_all(done.setup.factors),)
    worse = find_worse_stretches(done.imu, gnss, done.setup)
    if worse:
        # and so is what such fixes have made of them
        known = replace(known, worse=worse)
        done = _with_clocks(imu, gnss, noise_model, settings, progress, known)
        told = (*told, *findings_on(worse))
    for _ in range(MOST_KNOCKS):
        before = squares_of(done.imu, gnss, done.setup)
        moment = moment_of_knock(before, gnss, done.setup)
        if moment is None or any(abs(moment - t) < MARGIN for t in known.knocks):
            break
        trial = begun_anew(done.imu, gnss, done.setup, moment)
        if trial is None or not explains(before, squares_of(done.imu, gnss, trial), LEAST_PROMISE):
            break
        again = replace(known, knocks=tuple(sorted((*known.knocks, moment))))
        knocked = _with_clocks(imu, gnss, noise_model, settings, progress, again)
        if not explains(before, squares_of(knocked.imu, gnss, knocked.setup)):
            break
        known, done = again, knocked
        told = (*told, finding_on(moment))
    return replace(done, setup=done.setup.telling(*told)) if told else done


@dataclass(frozen=True, slots=True, eq=False)
class _Known:
    """What a first look at the drive has told."""

    rough: NoiseFactors  # noise for a search that comes before that of the drive is known
    worse: tuple[WorseStretch, ...] = ()
    knocks: tuple[float, ...] = ()


NOTHING = _Known(NoiseFactors(white=np.full(6, 2.0)))
"""Noise that forgives anything."""


def _with_clocks(
    imu: ImuRecording,
    gnss: GnssRecording,
    noise_model: NoiseModel | None,
    settings: NavigationSettings,
    progress: Progress | None,
    known: _Known,
) -> PreparedDrive:
    """Align, find time offsets, noise and mounting, and the drift of the clocks."""
    done = _prepare_once(imu, gnss, noise_model, settings, progress, known)
    whole = None
    for _ in range(CLOCK_ROUNDS if settings.estimates_offset else 0):
        drift = find_clock_drift(done.imu, done.setup.condition.usable(gnss), done.setup)
        if drift is None:
            break
        whole = drift if whole is None else replace(whole, share=whole.share + drift.share)
        done = _prepare_once(whole.corrected(imu), gnss, noise_model, settings, progress, known)
    return done if whole is None else replace(done, setup=done.setup.telling(whole.finding(imu)))


def _prepare_once(
    imu: ImuRecording,
    gnss: GnssRecording,
    noise_model: NoiseModel | None,
    settings: NavigationSettings,
    progress: Progress | None,
    known: _Known,
) -> PreparedDrive:
    say = progress or nobody_listens
    check_inputs(imu, gnss)
    offset = None if settings.estimates_offset else float(np.max(settings.time_offset))
    imu, condition = screen_drive(imu, gnss, mounting=settings.mounting, time_offset=offset)
    condition = replace(condition, worse=known.worse, knocks=known.knocks)
    gnss = condition.usable(gnss)
    imu = from_first_fix(imu, gnss)
    base = sensor_error_model(
        noise_model or generic_noise_model(),
        turn_on_accel=settings.turn_on_accel,
        turn_on_gyro=settings.turn_on_gyro,
        interval=float(np.median(np.diff(imu.time))),
    )
    breaks = [knock_gap(t, UNSURE) for t in known.knocks]
    segments, bridged = split_at_gaps(
        imu, sorted([*condition.gaps, *breaks], key=lambda gap: gap.start)
    )
    felt = (
        find_felt_lag(max(segments, key=lambda part: part.duration), gnss)
        if settings.estimates_offset
        else None
    )
    tuned = noise_model is None if settings.tune_noise is None else settings.tune_noise
    forgiving = known.rough if tuned else NoiseFactors.none()
    start = _Start(gnss, settings, segments, replace(condition, gaps=bridged), felt, forgiving)
    say("aligning")
    prepared = start.first(base, imu)
    if not (settings.estimates_offset or tuned):
        aided = _aided(prepared, gnss, say)
        judged = judge_constraints(prepared.imu, gnss, prepared.setup, aided)
        return _finished(replace(prepared, setup=judged), gnss)
    if settings.estimates_offset:
        say("looking for the time offset")
        prepared = start.with_offset(prepared)
    say("tuning noise and time offsets" if tuned else "refining the time offsets")
    return _finished(_tuned(prepared, gnss, tuned, say), gnss)


def _finished(prepared: PreparedDrive, gnss: GnssRecording) -> PreparedDrive:
    """With errors of GNSS by the noise that was found, and a word on an antenna that was."""
    setup = fit_split(prepared.imu, gnss, prepared.setup)
    if setup.arm_covariance is not None:
        arm, covariance, settings = setup.lever_arm, setup.arm_covariance, setup.settings
        finding = arm_finding(arm, covariance, settings.arm, asked=settings.estimates_arm)
        setup = setup.telling(finding)
    return replace(prepared, setup=setup)


@dataclass(frozen=True, slots=True, eq=False)
class _Start:
    """Alignment of every segment of a drive, again for every time offset."""

    gnss: GnssRecording
    settings: NavigationSettings
    segments: list[ImuRecording]
    condition: DriveCondition
    felt: float | None
    forgiving: NoiseFactors

    def align_one(
        self, imu: ImuRecording, velocity_offset: float, first: bool, hopeless: float = np.inf
    ) -> Alignment:
        return align(
            imu,
            self.gnss,
            velocity_offset=velocity_offset,
            heading=self.settings.heading if first else None,
            mounting=self.settings.mounting,
            lever_arm=self.settings.arm,
            hopeless=hopeless,
        )

    def aligned(self, offset: float) -> tuple[ImuRecording, Alignment, DriveCondition]:
        return align_segments(
            self.segments, lambda imu, first: self.align_one(imu, offset, first), self.condition
        )

    def first(self, base: SensorErrorModel, imu: ImuRecording) -> PreparedDrive:
        """With the offsets that were given, or a first guess of them."""
        offsets = _given_offsets(self.settings.time_offset, self.gnss, self.felt)
        try:
            used, alignment, condition = self.aligned(offsets.velocity)
        except NavigationError:
            _name_wrong_unit(imu, lambda other: self.align_one(other, offsets.velocity, True))
            raise
        setup = RunSetup(
            base,
            NoiseFactors.none(),
            offsets,
            alignment,
            self.settings.arm,
            condition=condition,
            measurements=self._measurements(),
            settings=self.settings,
        ).with_sensors(base)
        found = PreparedDrive(used, setup)
        if self.settings.estimates_offset:
            return found
        return self._fitting(self._armed(found, self.forgiving.applied(setup.model)))

    def _measurements(self) -> MeasurementOptions:
        """Those that were asked for, slow errors of GNSS at the levels of what it claims."""
        told = self.settings.measurements
        if not isinstance(told.correlated, GnssErrorModel):
            return told
        return replace(told, correlated=told.correlated.levelled(self.gnss))

    def with_offset(self, prepared: PreparedDrive) -> PreparedDrive:
        """With the time offset that a coarse search finds."""
        setup = prepared.setup
        rough = self.forgiving.applied(setup.model)
        part = prepared.imu.between(-np.inf, enough_to_tune(prepared.imu, self.gnss, setup))
        reach = UNKNOWN_OFFSET if self.felt is None else FELT_OFFSET
        rough_setup = replace(setup, model=rough)
        shift = find_time_offset(slower_imu(part), self.gnss, rough_setup, reach=reach)
        offsets = TimeOffsets(setup.offsets.position + shift, setup.offsets.velocity + shift)
        prepared = replace(prepared, setup=replace(setup, offsets=offsets))
        if self.felt is None or abs(shift) > ALIGNED_WITHIN:
            imu, alignment, condition = self.aligned(offsets.velocity)
            again = replace(prepared.setup, alignment=alignment, condition=condition)
            prepared = PreparedDrive(imu, again)
        return self._fitting(self._armed(prepared, rough))

    def _armed(self, prepared: PreparedDrive, model: SensorErrorModel) -> PreparedDrive:
        """With the antenna where the drive puts it, if it is asked or contradicts what was told."""
        settings, setup = self.settings, prepared.setup
        asked, told = settings.estimates_arm, setup.lever_arm
        if not asked and np.any(told):
            return prepared  # who told an arm has measured it; innovations say if it is wrong
        found = find_lever_arm(
            prepared.imu,
            self.gnss,
            replace(setup, model=model),
            asked=asked,
            offsets=settings.estimates_offset,
        )
        if found is None or not (asked or found.differs(told)):
            return prepared
        known = replace(self, settings=replace(settings, lever_arm=found.arm))
        imu, alignment, condition = known.aligned(found.offsets.velocity)
        setup = replace(
            setup,
            lever_arm=found.arm,
            arm_covariance=np.diag(found.sd**2),
            offsets=found.offsets,
            alignment=alignment,
            condition=condition,
        )
        return PreparedDrive(imu, setup)

    def _fitting(self, prepared: PreparedDrive) -> PreparedDrive:
        imu, setup = require_fit(prepared.imu, self.gnss, prepared.setup, self.align_one)
        return PreparedDrive(imu, setup)


def _tuned(
    prepared: PreparedDrive, gnss: GnssRecording, tuned: bool, say: Progress
) -> PreparedDrive:
    """Noise, time offsets and constraints by the likelihood of the drive."""
    imu, setup = prepared.imu, prepared.setup
    settings = setup.settings
    noise: Literal["channels"] | None = "channels" if tuned else None
    until = enough_to_tune(imu, gnss, setup)
    found = tune(imu, gnss, setup, Sought(noise, settings.estimates_offset, until=until), say)
    # what is not known of the noise counts once all is found
    plain = replace(found.setup, spread=None)
    aided = _aided(PreparedDrive(imu, plain), gnss, say)
    if not tuned or "nhc" not in settings.constraints:
        judged = judge_constraints(imu, gnss, plain, aided)
        return PreparedDrive(imu, replace(judged, spread=found.setup.spread))
    # how well the vehicle keeps to its forward axis, with the noise of the sensors as it is now
    say("tuning the constraints of the vehicle")
    once_more = replace(
        setup,
        model=with_vehicle_states(setup.model, settings.constraints),
        offsets=found.setup.offsets,
        vehicle=aided.vehicle,
        condition=aided.condition,
    )
    known = {name: v for name, v in found.values.items() if "offset" not in name}
    again = Sought(noise, offsets=False, fixed=known, until=until)
    both = tune(imu, gnss, once_more, again, say)
    judged = judge_constraints(imu, gnss, plain, both.setup)
    return PreparedDrive(imu, replace(judged, spread=found.setup.spread))


def _name_wrong_unit(imu: ImuRecording, align_one: Callable[[ImuRecording], Alignment]) -> None:
    """Say so where a start fails with gyros that spin, and succeeds when they are in deg/s."""
    if not turns_too_fast(imu):
        return
    try:
        align_one(GYROS_IN_DEGREES.undo(imu))
    except NavigationError:
        return
    raise NavigationError(
        f"no start is found, but one would be if {GYROS_IN_DEGREES.name}",
        expected="rates in rad/s",
        cure=GYROS_IN_DEGREES.cure,
        where=imu.name,
    ) from None


def _aided(prepared: PreparedDrive, gnss: GnssRecording, say: Progress) -> RunSetup:
    """Add what the vehicle tells; where it has to, a first pass without it finds the mounting."""
    imu, setup = prepared.imu, prepared.setup
    constraints, mounting = setup.settings.constraints, setup.settings.mounting
    if not constraints:
        return setup
    say("looking at the vehicle without its constraints")
    zupt = "zupt" in constraints
    plain = run(imu, gnss, setup, smooth=zupt)
    standing = None
    if zupt and plain.smoothed is not None:
        standing, finding = judge_standing(imu, plain.smoothed)
        if finding is not None:
            setup = setup.telling(finding)
    if "nhc" not in constraints:
        return replace(
            setup, vehicle=VehicleConstraint(constraints, np.eye(3), -1, standing=standing)
        )
    if mounting is None:
        found = estimate_mounting(plain.causal.trajectory)
        if found is None:
            raise NavigationError(
                "the drive does not tell how the IMU is mounted in the vehicle",
                expected="ten seconds of driving straight at 3 m/s or faster, with GNSS",
                cure="give the mounting (roll, pitch, yaw), or leave nhc out",
                where=imu.name,
            )
        mounting = found.rotation
    vehicle = VehicleConstraint(
        constraints, np.asarray(mounting), setup.model.size, standing=standing
    )
    return replace(setup, model=with_vehicle_states(setup.model, constraints), vehicle=vehicle)


def _given_offsets(time_offset: TimeOffset, gnss: GnssRecording, felt: float | None) -> TimeOffsets:
    if isinstance(time_offset, str):
        # a velocity that lags was true earlier than its stamp says
        lag = velocity_lag(gnss)
        return TimeOffsets(0.0, -lag) if felt is None else TimeOffsets(felt + lag, felt)
    if isinstance(time_offset, tuple):
        return TimeOffsets(float(time_offset[0]), float(time_offset[1]))
    return TimeOffsets(float(time_offset), float(time_offset))
