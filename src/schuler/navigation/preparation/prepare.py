"""Before the first run: alignment, time offsets, noise, and how the IMU sits in the vehicle."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from schuler.data import GnssRecording, ImuRecording
from schuler.errors import InputError, NavigationError
from schuler.navigation.aiding.gnss import require_overlap
from schuler.navigation.aiding.options import PLAIN, MeasurementOptions
from schuler.navigation.aiding.vehicle import (
    VehicleConstraint,
    check_constraints,
    with_vehicle_states,
)
from schuler.navigation.engine import InitialState
from schuler.navigation.error_models.generic_noise import (
    TURN_ON_ACCEL,
    TURN_ON_GYRO,
    generic_noise_model,
)
from schuler.navigation.error_models.sensor_error_model import sensor_error_model
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.preparation.alignment import Alignment, align
from schuler.navigation.preparation.condition import DriveCondition
from schuler.navigation.preparation.degraded_data import align_pieces, split_at_unseen
from schuler.navigation.preparation.diagnosis import (
    BAD,
    DOUBTFUL,
    GYROS_IN_DEGREES,
    LONGEST,
    Trial,
    find_slip,
    try_drive,
    turns_too_fast,
)
from schuler.navigation.preparation.drive_screening import screen_drive
from schuler.navigation.preparation.mounting import estimate_mounting
from schuler.navigation.preparation.rest import find_initial_rest
from schuler.navigation.preparation.setup import NoiseFactors, RunSetup, TimeOffsets
from schuler.navigation.preparation.time_offsets import (
    enough_for_offsets,
    find_time_offset,
    velocity_lag,
)
from schuler.navigation.run import run
from schuler.navigation.tuning.likelihood import slower_imu
from schuler.navigation.tuning.tune import tune
from schuler.noise.noise_model import NoiseModel
from schuler.screening.screen import Finding
from schuler.types import FloatArray

Progress = Callable[[str], None]


def prepare(
    imu: ImuRecording,
    gnss: GnssRecording,
    noise_model: NoiseModel | None = None,
    *,
    lever_arm: ArrayLike = (0.0, 0.0, 0.0),
    heading: float | None = None,
    mounting: FloatArray | None = None,
    time_offset: Literal["estimate"] | float | tuple[float, float] = "estimate",
    tune_noise: bool | None = None,
    aiding: Sequence[str] = (),
    turn_on_accel: float = TURN_ON_ACCEL,
    turn_on_gyro: float = TURN_ON_GYRO,
    measurements: MeasurementOptions = PLAIN,
    progress: Progress | None = None,
) -> tuple[ImuRecording, RunSetup]:
    """Align, find time offsets, noise and mounting. Parameters as for `navigate`."""
    say = progress or (lambda _: None)
    constraints = check_constraints(aiding)
    _check_inputs(imu, gnss)
    arm = np.asarray(lever_arm, dtype=np.float64)
    imu, condition = screen_drive(
        imu,
        gnss,
        mounting=mounting,
        time_offset=None if isinstance(time_offset, str) else float(np.max(time_offset)),
    )
    gnss = condition.usable(gnss)
    imu = _from_first_fix(imu, gnss)
    pieces, short = split_at_unseen(imu, condition.unseen)
    condition = replace(condition, unseen=short)
    tuned = noise_model is None if tune_noise is None else tune_noise
    base = sensor_error_model(
        noise_model or generic_noise_model(),
        turn_on_accel=turn_on_accel,
        turn_on_gyro=turn_on_gyro,
        interval=float(np.median(np.diff(imu.time))),
    )
    base, placed = measurements.placed(base)
    estimate = time_offset == "estimate"
    offsets = _given_offsets(time_offset, gnss)
    say("aligning")

    def align_one(piece: ImuRecording, velocity_offset: float, first: bool) -> Alignment:
        return align(
            piece,
            gnss,
            velocity_offset=velocity_offset,
            heading=heading if first else None,
            mounting=mounting,
            lever_arm=arm,
        )

    def aligned(velocity_offset: float) -> tuple[ImuRecording, Alignment, DriveCondition]:
        return align_pieces(
            pieces, lambda piece, first: align_one(piece, velocity_offset, first), condition
        )

    try:
        imu, start, coping = aligned(offsets.velocity)
    except NavigationError:
        _name_wrong_unit(imu, lambda other: align_one(other, offsets.velocity, True))
        raise
    setup = RunSetup(
        base, NoiseFactors.none(), offsets, start, arm, condition=coping, measurements=placed
    )
    if not estimate:
        coping = _require_fit(imu, gnss, setup, align_one)
        setup = replace(setup, condition=coping)
    if not (estimate or tuned):
        return imu, _aided(imu, gnss, setup, constraints, mounting, say)
    if estimate:
        say("looking for the time offset")
        rough = _rough(base) if tuned else base
        part = enough_for_offsets(imu, gnss, setup)
        shift = find_time_offset(slower_imu(part), gnss, replace(setup, model=rough))
        offsets = TimeOffsets(offsets.position + shift, offsets.velocity + shift)
        imu, start, coping = aligned(offsets.velocity)
        setup = replace(setup, offsets=offsets, alignment=start, condition=coping)
        coping = _require_fit(imu, gnss, setup, align_one)
    say("tuning noise and time offsets" if tuned else "refining the time offsets")
    setup = replace(setup, condition=coping)
    noise: Literal["channels"] | None = "channels" if tuned else None
    part = imu if tuned else enough_for_offsets(imu, gnss, setup)
    found = tune(part, gnss, setup, noise=noise, offsets=estimate, progress=progress)
    aided = _aided(imu, gnss, found.setup, constraints, mounting, say)
    if not tuned or "nhc" not in constraints:
        return imu, aided
    # how well the vehicle keeps to its forward axis, with the noise of the sensors as it is now
    say("tuning the constraints of the vehicle")
    once_more = replace(
        setup,
        model=with_vehicle_states(base, constraints),
        offsets=found.setup.offsets,
        vehicle=aided.vehicle,
    )
    known = {name: v for name, v in found.values.items() if "offset" not in name}
    both = tune(imu, gnss, once_more, noise=noise, offsets=False, fixed=known, progress=progress)
    return imu, both.setup


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


def _require_fit(
    imu: ImuRecording,
    gnss: GnssRecording,
    setup: RunSetup,
    align_one: Callable[[ImuRecording, float, bool], Alignment],
) -> DriveCondition:
    """Stop when the IMU cannot have felt what GNSS saw and a slip explains it; say it if none."""
    if gnss.velocity is None:
        return setup.condition
    part = imu.between(float(imu.time[0]), float(imu.time[0]) + LONGEST)
    restarts = [r for r in setup.restarts(gnss) if r[0] < part.time[-1] - 1.0]
    offset = setup.offsets.velocity

    def tried(
        recording: ImuRecording, alignment: Alignment, later: Sequence[tuple[float, InitialState]]
    ) -> Trial:
        state = replace(setup, alignment=alignment).initial_state(recording, gnss)
        return try_drive(
            recording,
            gnss,
            state,
            later,
            gyro_bias=alignment.gyro_bias,
            lever_arm=setup.lever_arm,
            velocity_offset=offset,
        )

    trial = tried(part, setup.alignment, restarts)
    if trial.misfit < DOUBTFUL:
        return setup.condition
    first = part.between(float(part.time[0]), setup.condition.first_break)
    here = tried(first, setup.alignment, ())
    slip = find_slip(first, here, lambda other: tried(other, align_one(other, offset, True), ()))
    if slip is not None:
        raise NavigationError(
            f"the IMU did not feel what GNSS saw; it would have if {slip.name}",
            expected="right-handed axes, rates in rad/s and specific force in m/s^2",
            cure=slip.cure,
            where=imu.name,
        )
    if trial.misfit < BAD:
        return setup.condition
    finding = Finding(
        "disagreement",
        "warning",
        "IMU and GNSS do not fit each other, even with forgiving noise (innovations "
        f"{np.sqrt(trial.misfit):.1f} times what they should be)",
        value=trial.misfit,
        cure="check time offset, lever arm, axes and units",
    )
    return replace(setup.condition, findings=(*setup.condition.findings, finding))


def _aided(
    imu: ImuRecording,
    gnss: GnssRecording,
    setup: RunSetup,
    constraints: tuple[str, ...],
    mounting: FloatArray | None,
    say: Progress,
) -> RunSetup:
    """Add what the vehicle tells; where it has to, a first pass without it finds the mounting."""
    if not constraints:
        return setup
    if "nhc" not in constraints:
        return replace(setup, vehicle=VehicleConstraint(constraints, np.eye(3), -1))
    if mounting is None:
        say("looking for the mounting of the IMU in the vehicle")
        found = estimate_mounting(run(imu, gnss, setup).causal.trajectory)
        if found is None:
            raise NavigationError(
                "the drive does not tell how the IMU is mounted in the vehicle",
                expected="ten seconds of driving straight at 3 m/s or faster, with GNSS",
                cure="give the mounting (roll, pitch, yaw), or leave nhc out",
                where=imu.name,
            )
        mounting = found.rotation
    vehicle = VehicleConstraint(constraints, np.asarray(mounting), setup.model.size)
    return replace(setup, model=with_vehicle_states(setup.model, constraints), vehicle=vehicle)


def _check_inputs(imu: ImuRecording, gnss: GnssRecording) -> None:
    if not imu.complete:
        raise InputError(
            f"recording '{imu.name}' has only {', '.join(imu.channels)}",
            expected="three gyros and three accelerometers",
        )
    for name in imu.channels:
        if not np.any(imu.channel(name)):
            raise InputError(
                f"{name} of '{imu.name}' is zero throughout",
                expected="a sensor that is connected",
                cure="check the columns of the file",
            )
    require_overlap(gnss, float(imu.time[0]), float(imu.time[-1]))


def _from_first_fix(imu: ImuRecording, gnss: GnssRecording) -> ImuRecording:
    """Cut what comes before GNSS, unless it is rest, which tells level and biases."""
    if imu.time[0] >= gnss.time[0] - 2.0:
        return imu
    rest = find_initial_rest(imu, gnss)
    if rest is not None and rest[1] >= gnss.time[0] - 2.0:
        return imu
    cut = imu.between(float(gnss.time[0]) - 1.0, np.inf)
    if cut.size < 100:
        raise NavigationError(
            f"only {cut.size} IMU samples after the first GNSS fix", expected="at least 100"
        )
    return cut


def _given_offsets(
    time_offset: Literal["estimate"] | float | tuple[float, float], gnss: GnssRecording
) -> TimeOffsets:
    if isinstance(time_offset, str):
        # a velocity that lags was true earlier than its stamp says
        return TimeOffsets(0.0, -velocity_lag(gnss))
    if isinstance(time_offset, tuple):
        return TimeOffsets(float(time_offset[0]), float(time_offset[1]))
    return TimeOffsets(float(time_offset), float(time_offset))


def _rough(base: SensorErrorModel) -> SensorErrorModel:
    """Noise that forgives anything, for a first search."""
    return NoiseFactors(white=np.full(6, 2.0)).applied(base)
