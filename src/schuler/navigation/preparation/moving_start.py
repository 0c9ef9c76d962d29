"""Where a run starts that begins in motion: level and biases from means, heading by hypotheses.

The gyros' bias is what is left of their mean when the turn of the course is taken off: over tens
of seconds a vehicle turns about the vertical only. The mean force, turned into the axes of the
first sample, points where gravity and the change of velocity say. The heading is then judged by
filters that start from every one (preparation/headings.py), over as long a stretch as it takes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from schuler.data import GnssRecording, ImuRecording
from schuler.errors import NavigationError
from schuler.navigation.engine import InitialState, gate_thresholds, run_engine
from schuler.navigation.error_models.sensor_error_model import (
    TURN_ON_ACCEL,
    TURN_ON_GYRO,
    generic_noise_model,
    sensor_error_model,
)
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.preparation.headings import (
    HeadingPosterior,
    decimated_inputs,
    judge_headings,
)
from schuler.navigation.preparation.rest import REST_SPEED, level_from_gravity, moves
from schuler.rotations import dcm_from_euler, dcm_from_rotation_vector
from schuler.types import FloatArray

LEVELLING = 20.0
"""Seconds over which level and biases are averaged."""
ROUNDS = 4
"""Of bias from level and level from bias."""
STRETCHES = (20.0, 40.0, 60.0, 90.0, 120.0, 180.0)
"""Seconds of motion in which the heading is looked for, tried in turn."""
MOTION_STRETCHES = (15.0, 30.0, 60.0, 120.0)
"""Seconds of real motion until which it is looked for where a drive begins without any."""
LONGEST_STRETCH = 900.0
SELDOM = 15.0
"""Seconds between fixes from which motion between them is unknown."""
SHORTEST_STEP = 4.0
"""Seconds by which a stretch is longer than the one before, or the recording is at its end."""
FEWEST_EPOCHS = 8
"""Of GNSS in a stretch."""
ENOUGH = np.radians(2.0)
"""Standard deviation of heading at which no longer stretch is tried."""
MOTION_GYRO_SD = np.radians(0.5)
"""Of gyro biases found in motion, rad/s: slopes and leans of the vehicle over the stretch."""
MOTION_TILT_SD = np.radians(3.0)
UNSURE_TILT_SD = np.radians(6.0)
"""Of a level for which GNSS does not tell the acceleration."""
NOISE_INFLATION = 2.0
"""On the white noise of a generic sensor: engines and roads shake it."""
_TRIAL = 60.0
"""Seconds in which a bounded process of a sensor is taken to reach its size."""
STAMPS = 0.2
"""Seconds that stamps may be off before anybody has looked for it."""
SHARE_OF_FAST = 0.3
"""Of the speed that a vehicle exceeds a tenth of the time: slower is creeping."""
KNOWN_ARM = 0.2
UNKNOWN_ARM = 1.5
"""Metres that a lever arm may be off where one was given, and where none was."""


@dataclass(frozen=True, slots=True, eq=False)
class MovingStart:
    """Attitude at the first sample of a run that begins in motion."""

    rotation: FloatArray  # (3, 3): C_nb
    heading_sd: float  # its standard deviation, rad
    gyro_bias: FloatArray  # (3,): mean rate less the turn of the course, rad/s
    gyro_bias_sd: float  # as the stretch leaves it, of the axis that is known least
    velocity: FloatArray  # (3,): north, east, down, m/s
    seconds: float  # length of the stretch that told it
    levelled: ImuRecording  # the first seconds, the biases of the gyros taken off


def start_in_motion(
    imu: ImuRecording,
    gnss: GnssRecording,
    offset: float,
    lever_arm: FloatArray,
    hopeless: float = np.inf,
) -> MovingStart:
    """Find attitude and biases at the first sample."""
    assert gnss.velocity is not None
    window = imu.between(float(imu.time[0]), float(imu.time[0]) + LEVELLING)
    time = gnss.time + offset
    inside = (time > window.time[0]) & (time < window.time[-1])
    ahead = (time > window.time[0]) & (time < window.time[0] + LONGEST_STRETCH)
    usual = float(np.median(np.diff(time[ahead]))) if ahead.sum() >= FEWEST_EPOCHS else np.inf
    if usual > SELDOM:
        seen = f"a fix every {usual:.0f} s" if np.isfinite(usual) else f"{ahead.sum()} fixes"
        raise NavigationError(
            f"no rest at the start, and {seen} in the first {LONGEST_STRETCH / 60.0:.0f} minutes: "
            "too seldom to find level and heading in motion",
            expected=f"GNSS at least every {SELDOM:.0f} s, or two seconds at rest",
            cure="cut the recording so that it starts at rest, or to where GNSS is there",
            where=gnss.name,
        )
    level, bias, levelled = _level_and_bias(window, time[inside], gnss, inside)
    first = int(np.argmax(ahead))
    start = _starts(level, bias, gnss, first, window, time[inside])
    extra = velocity_doubt(gnss, lever_arm)
    found, part = settle_heading(imu, gnss, start, lever_arm, offset, extra, hopeless)
    rotation, bias, bias_sd = _looking_back(part, gnss, start, found, lever_arm, offset, extra)
    return MovingStart(
        rotation=rotation,
        heading_sd=float(np.hypot(found.sd, np.radians(0.5))),
        gyro_bias=bias,
        gyro_bias_sd=bias_sd,
        velocity=gnss.velocity[first].copy(),
        seconds=part.duration,
        levelled=levelled,
    )


def settle_heading(
    imu: ImuRecording,
    gnss: GnssRecording,
    start: Callable[[float], InitialState],
    lever_arm: FloatArray,
    offset: float,
    velocity_sd: FloatArray,
    hopeless: float = np.inf,
) -> tuple[HeadingPosterior, ImuRecording]:
    """Judge headings over longer and longer stretches until one is known well enough.

    Raises NavigationError where even the best one leaves a `hopeless` misfit.
    """
    found: HeadingPosterior | None = None
    part = imu
    for stretch in _stretches(imu, gnss, offset):
        longer = imu.between(float(imu.time[0]), float(imu.time[0]) + stretch)
        if found is not None and longer.duration < part.duration + SHORTEST_STEP:
            break
        part = longer
        found = judge_headings(
            part,
            gnss,
            inflated_model(),
            start,
            lever_arm=lever_arm,
            velocity_offset=offset,
            velocity_sd=velocity_sd,
        )
        if found.misfit > hopeless:
            raise NavigationError(f"no heading explains the first {part.duration:.0f} s")
        if found.sd < ENOUGH:
            break
    assert found is not None
    return found, part


def _stretches(imu: ImuRecording, gnss: GnssRecording, offset: float) -> list[float]:
    """Lengths of stretches with as much motion as a heading takes, the usual ones first.

    A vehicle that creeps for minutes shows little but the errors of its receiver: a heading is
    looked for until it really moves.
    """
    since = gnss.time + offset - float(imu.time[0])
    usual = [s for s in STRETCHES if ((since > 0.0) & (since < s)).sum() >= FEWEST_EPOCHS]
    inside = (since > 0.0) & (since < LONGEST_STRETCH)
    if not usual:
        usual = [float(since[inside][-1])] if inside.any() else list(STRETCHES)
    moving = inside & really_moves(gnss)
    step = np.minimum(np.diff(since, prepend=since[0]), 1.5 * LEVELLING)
    moved = np.cumsum(np.where(moving, step, 0.0))
    if moved[-1] < MOTION_STRETCHES[0]:
        return usual
    ends = [float(since[np.argmax(moved >= m)]) for m in MOTION_STRETCHES if m <= moved[-1]]
    longer = [e for e in ends if e > usual[-1]]
    return [s for s in usual if s >= ends[0]] + longer


def really_moves(gnss: GnssRecording) -> NDArray[np.bool_]:
    """Epochs with a speed that is no creeping, by what the vehicle does later on."""
    assert gnss.velocity is not None
    fast = float(np.quantile(np.linalg.norm(gnss.velocity[:, :2], axis=1), 0.9))
    return moves(gnss, max(SHARE_OF_FAST * fast, REST_SPEED))


def _level_and_bias(
    window: ImuRecording, epochs: FloatArray, gnss: GnssRecording, inside: NDArray[np.bool_]
) -> tuple[Callable[[float], FloatArray], FloatArray, ImuRecording]:
    """Attitude for a heading of the levelled frame, bias of the gyros, recording without it."""
    from schuler.earth import gravity

    assert gnss.velocity is not None
    seen = gnss.velocity[inside]
    near = gnss.position[int(np.argmax(inside))]
    pull = np.array([0.0, 0.0, float(gravity(near[0], near[2]))])
    # what the accelerometers should feel on average, in north-east-down
    force = -pull
    if _tells_acceleration(epochs, window):
        force += (seen[-1] - seen[0]) / (epochs[-1] - epochs[0])
    rate, turn = mean_rates(window, epochs, seen)
    down = -window.accel.mean(axis=0)
    down /= np.linalg.norm(down)
    step = np.diff(window.time, prepend=window.time[0])[:, None]
    felt = -down
    for _ in range(ROUNDS):
        bias = rate - down * turn
        turned = attitude_history((window.gyro - bias) * step)
        felt = np.einsum("kij,kj->i", turned, window.accel * step) / step.sum()
        # down of the first sample, seen from every sample: the mean is what turns with the course
        down = np.einsum("kij,i->j", turned, -felt / np.linalg.norm(felt)) / turned.shape[0]
        down /= np.linalg.norm(down)
    level = level_from_gravity(felt)

    def attitude(heading: float) -> FloatArray:
        flat = dcm_from_euler(0.0, 0.0, heading) @ level
        a, b = flat @ felt, force
        axis = np.cross(a / np.linalg.norm(a), b / np.linalg.norm(b))
        return np.asarray(dcm_from_rotation_vector(axis) @ flat)

    return attitude, bias, replace(window, gyro=window.gyro - bias)


def _tells_acceleration(epochs: FloatArray, window: ImuRecording) -> bool:
    """Whether GNSS covers a window well enough for the mean acceleration in it."""
    return bool(epochs.size >= 4 and epochs[-1] - epochs[0] > 0.5 * window.duration)


def _starts(
    attitude: Callable[[float], FloatArray],
    bias: FloatArray,
    gnss: GnssRecording,
    first: int,
    window: ImuRecording,
    epochs: FloatArray,
) -> Callable[[float], InitialState]:
    """Initial state for a heading."""
    assert gnss.velocity is not None
    model = inflated_model()
    covariance = np.zeros((9 + model.size, 9 + model.size))
    sure = _tells_acceleration(epochs, window)
    velocity_sd, tilt_sd = (1.0, MOTION_TILT_SD) if sure else (3.0, UNSURE_TILT_SD)
    sd = [10.0, 10.0, 15.0, *(velocity_sd,) * 3, tilt_sd, tilt_sd, 1e-3]
    covariance[:9, :9] = np.diag(np.square(sd))
    covariance[9:, 9:] = model.initial_covariance
    state = np.zeros(model.size)
    for axis in range(3):
        state[model.constant_states(3 + axis)[0]] = bias[axis]
    position, velocity = gnss.position[first], gnss.velocity[first]
    return lambda heading: InitialState(
        position.copy(), velocity.copy(), attitude(heading), state, covariance
    )


def _looking_back(
    part: ImuRecording,
    gnss: GnssRecording,
    start: Callable[[float], InitialState],
    found: HeadingPosterior,
    lever_arm: FloatArray,
    offset: float,
    extra: FloatArray,
) -> tuple[FloatArray, FloatArray, float]:
    """Attitude and gyro biases with their deviation at the first sample, smoothed over the stretch.

    The heading keeps the mean over all hypotheses.
    """
    from schuler.navigation.smoother import smooth_run

    initial, model = start(found.mean), inflated_model()
    slow, schedule = decimated_inputs(part, gnss, lever_arm, offset, extra)
    done = run_engine(slow, initial, model, schedule, gate=gate_thresholds(1e-6))
    smoothed = smooth_run(done, model, slow.time)
    places = [model.constant_states(3 + axis)[0] for axis in range(3)]
    return (
        smoothed.samples.rotation[0].copy(),
        smoothed.sensor_state[0, places].copy(),
        float(smoothed.sensor_sd[0, places].max()),
    )


def inflated_model(known: SensorErrorModel | None = None) -> SensorErrorModel:
    """Return a generic sensor whose noise forgives engines and roads, and all that is known."""
    model = sensor_error_model(
        generic_noise_model(), turn_on_accel=TURN_ON_ACCEL, turn_on_gyro=TURN_ON_GYRO
    )
    white, diffusion = NOISE_INFLATION * model.white_density, model.diffusion.copy()
    if known is not None:
        white = np.maximum(white, known.white_density)
        # a bounded process as the walk that reaches its size in a trial
        time = 1.0 / np.maximum(-known.drift[:, 0], 1e-12)
        drive = known.diffusion[:, 0] * (time / np.maximum(time, _TRIAL))
        for channel in range(6):
            own = float(drive[known.channel == channel].sum())
            places = model.constant_states(channel)
            diffusion[places, 0] = np.maximum(diffusion[places, 0], own)
    return replace(model, white_density=white, diffusion=diffusion)


def velocity_doubt(gnss: GnssRecording, lever_arm: FloatArray) -> FloatArray:
    """Return what stamps and lever arm may do to a velocity before anybody has looked for them."""
    assert gnss.velocity is not None
    if gnss.size < 2:
        return np.zeros(gnss.size)
    change = np.gradient(gnss.velocity[:, :2], gnss.time, axis=0)
    push = np.linalg.norm(change, axis=1)
    north, east = gnss.velocity[:, 0], gnss.velocity[:, 1]
    square = np.maximum(north**2 + east**2, 1.0)
    turn = np.abs(north * change[:, 1] - east * change[:, 0]) / square
    arm = KNOWN_ARM if np.any(lever_arm) else UNKNOWN_ARM
    return np.asarray(np.hypot(STAMPS * push, arm * turn))


def mean_rates(
    imu: ImuRecording, time: FloatArray, velocity: FloatArray
) -> tuple[FloatArray, float]:
    """Mean of the gyros and of the rate of the course (rad/s) over one and the same time.

    From the first to the last epoch that is fast enough for a course: a slope fitted in between
    would count a turn in the middle of the time one and a half times.
    """
    fast = np.flatnonzero(np.linalg.norm(velocity[:, :2], axis=1) > 2.0)
    if fast.size < 3:
        return imu.gyro.mean(axis=0), 0.0
    first, last = time[fast[0]], time[fast[-1]]
    course = np.unwrap(np.arctan2(velocity[fast, 1], velocity[fast, 0]))
    part = imu.between(float(first), float(last))
    return part.gyro.mean(axis=0), float((course[-1] - course[0]) / (last - first))


def attitude_history(increments: FloatArray) -> FloatArray:
    """Return the rotations of all samples into the frame of the first one."""
    steps = dcm_from_rotation_vector(increments)
    history = np.empty_like(steps)
    now = np.eye(3)
    for k in range(steps.shape[0]):
        now = now @ steps[k]
        history[k] = now
    return history
