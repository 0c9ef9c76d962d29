"""Where a run starts: level from gravity at rest, heading from the first motion seen by GNSS.

Spec 7.7 and Groves, 2nd ed., section 5.6. The heading needs no mounting angle: the accelerations
that the levelled IMU felt are turned about the vertical until they match the velocity changes
that GNSS saw. A course alone would need the mounting, and is wrong while the vehicle turns.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.errors import NavigationError
from schuler.navigation.aiding.schedule import POSITION, schedule_rows
from schuler.navigation.engine import InitialState, gate_thresholds, run_engine
from schuler.navigation.error_models.sensor_states import no_sensor_states
from schuler.navigation.preparation.moving_start import (
    LEVELLING,
    MOTION_GYRO_SD,
    MOTION_TILT_SD,
    attitude_history,
    inflated_model,
    really_moves,
    settle_heading,
    start_in_motion,
    velocity_doubt,
)
from schuler.navigation.preparation.rest import (
    REST_GYRO,
    find_initial_rest,
    level_from_gravity,
    moves,
)
from schuler.rotations import dcm_from_euler
from schuler.types import FloatArray

# seconds of motion in which a course is looked for where the mounting is known
COURSE_STRETCH = 60.0
# a heading known worse than this (rad) is no start
WORST_HEADING = np.radians(10.0)
# seconds before the first real motion at which it is looked at, and after which a slow beginning
# is too long to look for the heading from its start
BEFORE_MOTION = 5.0
LONG_CREEPING = 40.0
EARTH_RATE = 7.3e-5
# by which the bias of a gyro may be another one minutes later, rad/s
GYRO_DRIFT = np.radians(0.015)
# standard deviation of heading (rad) that is claimed at best
LEAST_HEADING_SD = np.radians(1.5)


@dataclass(frozen=True, slots=True, eq=False)
class Alignment:
    """Attitude at the first IMU sample and how well it is known."""

    rotation: FloatArray  # (3, 3): C_nb at the first sample
    # tilt_sd, heading_sd: standard deviations in rad
    tilt_sd: float
    heading_sd: float
    gyro_bias: FloatArray  # (3,): mean rate at rest less the earth's, rad/s; zero without rest.
    gyro_bias_sd: float | None  # its standard deviation; None without rest.
    rest: tuple[float, float] | None  # start and end of the rest at the beginning, s
    method: str  # how it was found, for people
    velocity: FloatArray  # (3,): north, east, down at the first sample, m/s


def align(
    imu: ImuRecording,
    gnss: GnssRecording,
    *,
    velocity_offset: float = 0.0,
    heading: float | None = None,
    mounting: FloatArray | None = None,
    lever_arm: FloatArray | None = None,
    hopeless: float = np.inf,
) -> Alignment:
    """Find the attitude at the first sample.

    A start in which every heading leaves a misfit above `hopeless` is given up at once.
    """
    rest = find_initial_rest(imu, gnss)
    if heading is not None:
        if rest is None:
            raise NavigationError(
                "a heading was given, but the IMU is not at rest at the start",
                expected="two seconds at rest for levelling",
                cure="leave the heading out: it is then found in motion",
                where=imu.name,
            )
        level, bias, bias_sd = _at_rest(imu, gnss, rest)
        yaw = heading - np.arctan2(level[1, 0], level[0, 0])
        return Alignment(
            rotation=dcm_from_euler(0.0, 0.0, yaw) @ level,
            tilt_sd=_tilt_sd(),
            heading_sd=np.radians(2.0),
            gyro_bias=bias,
            gyro_bias_sd=bias_sd,
            rest=rest,
            method="levelled at rest, heading given",
            velocity=np.zeros(3),
        )
    if gnss.velocity is None:
        gnss = _with_velocity_from_position(gnss)
    arm = np.zeros(3) if lever_arm is None else lever_arm
    found = align_where_it_moves(imu, gnss, rest, velocity_offset, arm, hopeless)
    if found is not None:
        return found
    if rest is None:
        return _align_in_motion(imu, gnss, velocity_offset, mounting, arm, hopeless)
    level, bias, bias_sd = _at_rest(imu, gnss, rest)
    yaw, heading_sd, method = _heading_from_motion(
        imu, gnss, (rest, level, bias), velocity_offset, mounting, arm, hopeless
    )
    return Alignment(
        rotation=dcm_from_euler(0.0, 0.0, yaw) @ level,
        tilt_sd=_tilt_sd(),
        heading_sd=heading_sd,
        gyro_bias=bias,
        gyro_bias_sd=bias_sd,
        rest=rest,
        method=f"levelled over {rest[1] - rest[0]:.0f} s at rest, {method}",
        velocity=np.zeros(3),
    )


def align_where_it_moves(
    imu: ImuRecording,
    gnss: GnssRecording,
    rest: tuple[float, float] | None,
    offset: float,
    lever_arm: FloatArray,
    hopeless: float,
) -> Alignment | None:
    """Attitude where the vehicle really begins to move, carried back to the first sample.

    For drives that begin with long creeping, which shows little but the errors of the receiver;
    None for others, or where that motion tells no heading either.
    """
    moving = gnss.time[really_moves(gnss)] + offset
    begin = float(imu.time[0]) if rest is None else rest[1] - 1.0
    moving = moving[moving > begin]
    if not moving.size or moving[0] - BEFORE_MOTION - begin < LONG_CREEPING:
        return None
    later = imu.between(float(moving[0]) - BEFORE_MOTION, np.inf)
    try:
        start = start_in_motion(later, gnss, offset, lever_arm, hopeless)
    except NavigationError:
        return None
    if start.heading_sd > WORST_HEADING:
        return None
    before = imu.between(begin, float(later.time[0]))
    bias, bias_sd = start.gyro_bias, start.gyro_bias_sd
    level, velocity = None, np.zeros(3)
    if rest is not None:
        level, bias, bias_sd = _at_rest(imu, gnss, rest)
    step = np.diff(before.time, prepend=before.time[0])[:, None]
    turned = attitude_history((before.gyro - bias) * step)
    if level is None:
        some = before.time < begin + LEVELLING
        level = level_from_gravity(np.einsum("kij,kj->i", turned[some], before.accel[some]))
        assert gnss.velocity is not None
        velocity = gnss.velocity[int(np.argmax(gnss.time + offset >= begin))].copy()
    back = start.rotation @ turned[-1].T @ level.T
    yaw = np.arctan2(back[1, 0] - back[0, 1], back[0, 0] + back[1, 1])
    carried = float(before.time[-1]) - begin
    drift = np.hypot(bias_sd, GYRO_DRIFT) * carried
    return Alignment(
        rotation=dcm_from_euler(0.0, 0.0, yaw) @ level,
        tilt_sd=float(MOTION_TILT_SD) if rest is None else _tilt_sd(),
        heading_sd=float(np.hypot(max(start.heading_sd, LEAST_HEADING_SD), drift)),
        gyro_bias=bias,
        gyro_bias_sd=bias_sd,
        rest=rest,
        method=f"heading by hypotheses over {start.seconds:.0f} s of real motion, "
        f"carried back {carried:.0f} s by the gyros",
        velocity=velocity,
    )


def _tilt_sd() -> float:
    # accelerometer biases of 10 to 30 mg turn into this much tilt
    return float(np.radians(1.0))


def _at_rest(
    imu: ImuRecording, gnss: GnssRecording, rest: tuple[float, float]
) -> tuple[FloatArray, FloatArray, float]:
    part = slice(*np.searchsorted(imu.time, [rest[0], rest[1]], side="left"))
    level = level_from_gravity(imu.accel[part].mean(axis=0))
    gyro = imu.gyro[part]
    block = max(round(imu.rate), 1)
    count = gyro.shape[0] // block
    means = gyro[: count * block].reshape(count, block, 3).mean(axis=1)
    spread = float(means.std(axis=0, ddof=1).max()) if count > 1 else REST_GYRO
    # the earth's rate about unknown north: 15 deg/h at most stays in the bias
    return level, gyro.mean(axis=0), float(np.hypot(spread / np.sqrt(count), EARTH_RATE))


def _heading_from_motion(
    imu: ImuRecording,
    gnss: GnssRecording,
    levelled: tuple[tuple[float, float], FloatArray, FloatArray],
    offset: float,
    mounting: FloatArray | None,
    lever_arm: FloatArray,
    hopeless: float,
) -> tuple[float, float, str]:
    """Angle about the vertical that takes the frame, levelled at rest, to north."""
    rest, level, bias = levelled
    assert gnss.velocity is not None
    moving = np.flatnonzero((gnss.time + offset > rest[1]) & moves(gnss))
    if not moving.size:
        raise NavigationError(
            "GNSS shows no motion after the rest at the start, so nothing tells the heading",
            expected="a run in which the vehicle moves",
            cure="give the heading with --heading",
            where=gnss.name,
        )
    begin = float(gnss.time[moving[0]]) + offset - 3.0
    # from the end of the rest, as the vehicle may turn before GNSS is there to see it
    first = max(rest[0], min(begin, rest[1] - 1.0))
    after = _without_bias(imu.between(first, np.inf), bias)
    near = int(np.argmin(np.abs(gnss.time + offset - first)))
    extra = velocity_doubt(gnss, lever_arm)
    start = _rest_starts(level, gnss.position[near])
    found, stretch = settle_heading(after, gnss, start, lever_arm, offset, extra, hopeless)
    if found.sd < WORST_HEADING:
        text = f"heading by hypotheses over {stretch.duration:.0f} s"
        return found.mean, max(found.sd, LEAST_HEADING_SD), text
    if mounting is not None:
        part = after.between(first, begin + COURSE_STRETCH)
        _, _, rotation = dead_reckon(part, gnss.position[near], np.zeros(3), level)
        yaw, sd = _heading_from_course(part, rotation, gnss, offset, mounting)
        return yaw, sd, "heading from the first GNSS course"
    raise NavigationError(
        f"the first {stretch.duration:.0f} s after the rest do not tell the heading to 10 deg "
        f"(known to {np.degrees(found.sd):.0f} deg)",
        expected="a start, a brake or a turn in that time",
        cure="give the heading with --heading, or the mounting of the IMU in the vehicle",
        where=gnss.name,
    )


def _rest_starts(level: FloatArray, position: FloatArray) -> Callable[[float], InitialState]:
    """Initial state at rest for a heading of the levelled frame."""
    model = inflated_model()
    covariance = np.zeros((9 + model.size, 9 + model.size))
    sd = [10.0, 10.0, 15.0, 0.1, 0.1, 0.1, _tilt_sd(), _tilt_sd(), 1e-3]
    covariance[:9, :9] = np.diag(np.square(sd))
    covariance[9:, 9:] = model.initial_covariance
    for axis in range(3):
        # the mean rate at rest has been taken off
        place = 9 + model.constant_states(3 + axis)[0]
        covariance[place, place] = np.radians(0.05) ** 2
    return lambda heading: InitialState(
        position.copy(),
        np.zeros(3),
        dcm_from_euler(0.0, 0.0, heading) @ level,
        np.zeros(model.size),
        covariance,
    )


def _heading_from_course(
    part: ImuRecording,
    rotation: FloatArray,
    gnss: GnssRecording,
    offset: float,
    mounting: FloatArray,
) -> tuple[float, float]:
    assert gnss.velocity is not None
    time = gnss.time + offset
    fast = np.linalg.norm(gnss.velocity[:, :2], axis=1) > 2.0
    pick = np.flatnonzero(fast & (time > part.time[0]) & (time < part.time[-1]))
    if not pick.size:
        raise NavigationError(
            "GNSS is never faster than 2 m/s in the first minute of motion",
            expected="a course over ground",
            cure="give the heading with --heading",
            where=gnss.name,
        )
    nearest = np.clip(np.searchsorted(part.time, time[pick]), 0, part.size - 1)
    forward = rotation[nearest] @ mounting[0]
    course = gnss.velocity[pick, :2] @ np.array([1.0, 1.0j])
    turn = course * np.conj(forward[:, 0] + 1j * forward[:, 1])
    mean = np.sum(turn)
    spread = np.angle(turn * np.conj(mean))
    return float(np.angle(mean)), float(max(np.sqrt(np.mean(spread**2)), np.radians(3.0)))


def _align_in_motion(
    imu: ImuRecording,
    gnss: GnssRecording,
    offset: float,
    mounting: FloatArray | None,
    lever_arm: FloatArray,
    hopeless: float,
) -> Alignment:
    """Attitude by hypotheses; where they do not tell, the course, if the mounting is known."""
    start = start_in_motion(imu, gnss, offset, lever_arm, hopeless)
    rotation, heading_sd = start.rotation, start.heading_sd
    method = f"in motion, heading by hypotheses over {start.seconds:.0f} s"
    if heading_sd > WORST_HEADING:
        if mounting is None:
            raise NavigationError(
                "no rest at the start, and too little acceleration to find the attitude in motion "
                f"in the first {start.seconds:.0f} s (heading known to "
                f"{np.degrees(heading_sd):.0f} deg)",
                expected="two seconds at rest, or a start, brake or turn in the first minutes",
                cure="cut the recording so that it starts at rest, or give the mounting of the "
                "IMU in the vehicle with --mounting",
                where=imu.name,
            )
        still = start.levelled
        step = np.diff(still.time, prepend=still.time[0])[:, None]
        turned = rotation @ attitude_history(still.gyro * step)
        yaw, heading_sd = _heading_from_course(still, turned, gnss, offset, mounting)
        rotation = dcm_from_euler(0.0, 0.0, yaw) @ rotation
        method = "in motion, levelled over the first 20 s, heading from the GNSS course"
    return Alignment(
        rotation=rotation,
        tilt_sd=float(MOTION_TILT_SD),
        heading_sd=float(max(heading_sd, LEAST_HEADING_SD)),
        gyro_bias=start.gyro_bias,
        gyro_bias_sd=float(MOTION_GYRO_SD),
        rest=None,
        method=method,
        velocity=start.velocity,
    )


def _without_bias(imu: ImuRecording, bias: FloatArray) -> ImuRecording:
    from dataclasses import replace

    return replace(imu, gyro=imu.gyro - bias)


def _with_velocity_from_position(gnss: GnssRecording) -> GnssRecording:
    """Central differences of position; only for alignment."""
    from dataclasses import replace

    from schuler.earth import ned_from_geodetic

    local = ned_from_geodetic(gnss.position, gnss.position[0])
    velocity = np.gradient(local, gnss.time, axis=0) if gnss.size > 1 else np.zeros((1, 3))
    step = np.gradient(gnss.time) if gnss.size > 1 else np.ones(1)
    # a metre in two epochs, and what the vehicle may do between them
    sd = np.repeat((0.5 + 0.5 * np.maximum(step - 1.0, 0.0))[:, None], 3, axis=1)
    return replace(gnss, velocity=velocity, velocity_sd=sd)


def dead_reckon(
    imu: ImuRecording, position: FloatArray, velocity: FloatArray, rotation: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Integrate an IMU without any aiding."""
    nothing = schedule_rows(np.empty(0), POSITION, np.empty((0, 3)), np.empty((0, 3)))
    start = InitialState(position, velocity, rotation, np.empty(0), np.zeros((9, 9)))
    run = run_engine(
        imu, start, no_sensor_states(), nothing, gate=gate_thresholds(0.0), keep_nodes=False
    )
    return run.samples.position, run.samples.velocity, run.samples.rotation
