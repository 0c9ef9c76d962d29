"""Speed of a vehicle from the vibration of its wheels, for outages of GNSS.

While GNSS is there, the lines of the wheels are learned (navigate/wheel_lines.py). From then on
every two seconds of vibration are asked how likely each error of the filter's own speed would make
them. The filter runs from block to block: its speed and acceleration, with their claimed
covariance, are the prior. Blocks that do not decide are pooled, for as long as an error of
acceleration may be taken as constant, until the posterior is clearly narrower than the prior; what
the vibration added to the prior, and only that, becomes a measurement of forward speed at the end
of the block. Blocks without lines, or with those of something else, are part of the likelihood, so
that a doubtful block says little instead of something wrong.

Everything looks at the past only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from schuler.data import ImuRecording
from schuler.navigate.aiding import VEHICLE_VELOCITY, AidingSchedule, merge_schedules
from schuler.navigate.engine import FilterRun, InitialState, VehicleStates, run_engine
from schuler.navigate.sensor_states import SensorErrorModel
from schuler.navigate.vehicle import WHEEL_STATE
from schuler.navigate.wheel_lines import (
    BLOCK_SECONDS,
    VibrationBlock,
    WheelMemory,
    vibration_block,
)

FloatArray = NDArray[np.float64]

# a new block every so often (s); tapered blocks that overlap by half are nearly independent
BLOCK_INTERVAL = 2.0
# slower vehicles make lines too low to be told from the road (m/s)
SLOWEST = 5.0
# lines are learned where the filter knows its speed this well (m/s)
KNOWN_SPEED_SD = 0.15
# the prior is somewhat wider than the filter says, as lines must not confirm a wrong filter
WIDER_PRIOR = 1.5
# probability that a block shows no lines, and that it shows others
ABSENT = 0.3
OTHER_LINES = 0.1
# a pool of blocks decides when it leaves this share of the prior variance
DECIDED = 0.7
# blocks older than this no longer share one error of acceleration (s)
POOL_SECONDS = 12.0
# largest standard deviation of speed that is worth a measurement (m/s)
LARGEST_SD = 1.0
# what tyres and roads do to a single speed (m/s), and how far off the middle a wheel may be (m)
ROLLING_SD = 0.03
WHEEL_ASIDE = 0.4


@dataclass(frozen=True, slots=True, eq=False)
class WheelSpeeds:
    """Forward speeds found in vibration.

    Parameters
    ----------
    time : (k,) ndarray
        Seconds on the IMU's axis.
    speed, sd : (k,) ndarray
        m/s.
    order : float or None
        Turns of a wheel per metre; None if no wheel was found.
    """

    time: FloatArray
    speed: FloatArray
    sd: FloatArray
    order: float | None

    def rows(self, model: SensorErrorModel) -> AidingSchedule:
        """Return one measurement a speed.

        Parameters
        ----------
        model : SensorErrorModel
            With the state `WHEEL_STATE`, which adds to what is measured.

        Returns
        -------
        AidingSchedule
            Kind `VEHICLE_VELOCITY`, forward only.
        """
        count = self.time.size
        value, variance = np.zeros((count, 3)), np.full((count, 3), np.inf)
        value[:, 0], variance[:, 0] = self.speed, self.sd**2
        offset = np.full((count, 3), -1, dtype=np.int64)
        offset[:, 0] = model.names.index(WHEEL_STATE)
        return AidingSchedule(
            time=self.time,
            kind=np.full(count, VEHICLE_VELOCITY, dtype=np.int64),
            value=value,
            variance=variance,
            lever_arm=np.zeros((count, 3)),
            offset_state=offset,
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Evidence:
    """Log-likelihood (a, g) of a block by errors of acceleration and of speed at its end."""

    end: float
    shifts: FloatArray
    accelerations: FloatArray
    value: FloatArray

    def at(self, end: float, shifts: FloatArray, accelerations: FloatArray) -> FloatArray:
        """The same by the error of speed at a later time."""
        first, last = self.accelerations[0], self.accelerations[-1]
        found = np.empty((accelerations.size, shifts.size))
        outside = float(np.log(ABSENT))
        for row, acceleration in enumerate(accelerations):
            place = 0.0
            if last > first:
                place = (np.clip(acceleration, first, last) - first) / (last - first)
            place *= self.accelerations.size - 1
            low = min(int(place), max(self.accelerations.size - 2, 0))
            high = min(low + 1, self.accelerations.size - 1)
            mixed = self.value[low] + (place - low) * (self.value[high] - self.value[low])
            then = shifts + acceleration * (self.end - end)
            found[row] = np.interp(then, self.shifts, mixed, left=outside, right=outside)
        return found


def find_wheel_speeds(
    imu: ImuRecording,
    initial: InitialState,
    model: SensorErrorModel,
    schedule: AidingSchedule,
    vehicle: VehicleStates,
    *,
    gate: FloatArray,
    white_scale: FloatArray | None = None,
    progress: Callable[[str], None] | None = None,
) -> WheelSpeeds:
    """Run the filter block by block, and let the vibration of each speak before the next.

    Parameters
    ----------
    imu, initial, model, schedule, vehicle, gate, white_scale
        As for `run_engine`; the schedule without wheel speeds.
    progress : callable or None
        Called with a line of text now and then.

    Returns
    -------
    WheelSpeeds
        Causal measurements: each rests on what was recorded up to its time.
    """
    channels = np.concatenate([imu.accel, imu.gyro], axis=1)
    step = max(round(BLOCK_INTERVAL * imu.rate), 2)
    length = round(BLOCK_SECONDS / BLOCK_INTERVAL) * step
    memory = WheelMemory(channels.shape[1])
    found: list[tuple[float, float, float]] = []
    pool: list[_Evidence] = []
    path = np.empty(0)
    news: WheelSpeeds | None = None
    for first in range(0, imu.size - step, step):
        last = first + step
        run = _run_piece(
            imu, initial, model, schedule, vehicle, first, last, news, gate, white_scale
        )
        initial, news = run.final, None
        speed = np.linalg.norm(run.samples.velocity, axis=1)
        # one smooth profile: a correction shifts what came before it
        path = np.concatenate([path[:-1] + (speed[0] - path[-1]) if path.size else path, speed])
        path = path[-length:]
        stretch = slice(last + 1 - length, last + 1)
        if path.size < length or imu.time[last] - imu.time[stretch.start] > 1.1 * BLOCK_SECONDS:
            pool = []
            continue
        if path.min() < SLOWEST:
            continue
        block = vibration_block(imu.time[stretch], channels[stretch], path)
        prior = _error_of_speed(initial, model, imu, stretch.stop)
        if memory.order is not None:
            pool = [e for e in pool if imu.time[last] - e.end < POOL_SECONDS]
            told = _weigh(memory, block, float(imu.time[last]), prior, pool)
            if told is not None:
                turning = float(np.abs(imu.gyro[stretch].mean(axis=0) @ initial.rotation[2]))
                own = ROLLING_SD**2 + (WHEEL_ASIDE * turning) ** 2
                sd = float(np.sqrt(told[1] + own))
                if sd < LARGEST_SD:
                    pool = []
                    found.append((float(imu.time[last]), float(path[-1]) + told[0], sd))
                    news = _speeds(found[-1:], memory.order)
        if np.sqrt(prior[0, 0]) < KNOWN_SPEED_SD:
            memory.learn(block)
        if progress is not None and first % (50 * step) == 0:
            progress(f"listening to the wheels: {imu.time[last] - imu.time[0]:.0f} s")
    return _speeds(found, memory.order)


def _run_piece(
    imu: ImuRecording,
    initial: InitialState,
    model: SensorErrorModel,
    schedule: AidingSchedule,
    vehicle: VehicleStates,
    first: int,
    last: int,
    news: WheelSpeeds | None,
    gate: FloatArray,
    white_scale: FloatArray | None,
) -> FilterRun:
    """From sample `first`, where `news` are used, to sample `last`."""
    begin, end = imu.time[first], imu.time[last]
    # what is due at the first sample was used by the piece before
    after = begin if first == 0 else np.nextafter(begin, np.inf)
    part = merge_schedules([schedule], float(after), float(end))
    if news is not None:
        part = merge_schedules([news.rows(model), part], float(begin), float(end))
    piece = slice(first, last + 1)
    cut = replace(
        imu,
        time=imu.time[piece],
        gyro=imu.gyro[piece],
        accel=imu.accel[piece],
        temperature=None,
    )
    return run_engine(
        cut,
        initial,
        model,
        part,
        gate=gate,
        white_scale=None if white_scale is None else white_scale[piece],
        vehicle=vehicle,
        keep_nodes=False,
        node_interval=1e9,
    )


def _error_of_speed(
    state: InitialState, model: SensorErrorModel, imu: ImuRecording, stop: int
) -> FloatArray:
    """Claimed covariance (2, 2) of speed and of acceleration along the way. Spec 7.2."""
    ahead = state.velocity / max(float(np.linalg.norm(state.velocity)), 1e-3)
    half = max(round(0.5 * imu.rate), 1)
    force = state.rotation @ imu.accel[max(stop - half, 0) : stop].mean(axis=0)
    rows = np.zeros((2, state.covariance.shape[0]))
    rows[0, 3:6] = ahead
    # u . (f x psi) + u . C b
    rows[1, 6:9] = np.cross(ahead, force)
    body = ahead @ state.rotation
    for axis in range(3):
        for j in model.constant_states(axis):
            rows[1, 9 + j] = body[axis]
    return np.asarray(rows @ state.covariance @ rows.T)


def _weigh(
    memory: WheelMemory,
    block: VibrationBlock,
    end: float,
    prior: FloatArray,
    pool: list[_Evidence],
) -> tuple[float, float] | None:
    """Add a block to the pool; return what the pool says of the speed, if it decides.

    The shift of speed, m/s, and its variance, with the prior taken out again: the inverse variances
    of posterior and prior are subtracted (moments of the marginal of speed).
    """
    wide = WIDER_PRIOR**2 * prior + np.diag([0.02**2, 0.01**2])
    reach = min(4.0 * float(np.sqrt(wide[0, 0])), 0.3 * block.speed)
    shifts = np.linspace(-reach, reach, 401)
    most = min(3.0 * float(np.sqrt(wide[1, 1])), 0.4)
    accelerations = np.linspace(-most, most, 2 * int(np.ceil(most / 0.06)) + 1)
    ratio = np.exp(memory.log_likelihood(block, shifts, accelerations))
    lines = 1.0 - ABSENT - OTHER_LINES
    evidence = np.log(lines * ratio + OTHER_LINES * ratio.mean() + ABSENT)
    pool.append(_Evidence(end, shifts, accelerations, evidence))
    inverse = np.linalg.inv(wide)
    grid = np.meshgrid(accelerations, shifts, indexing="ij")
    before = -0.5 * (
        inverse[0, 0] * grid[1] ** 2
        + 2.0 * inverse[0, 1] * grid[0] * grid[1]
        + inverse[1, 1] * grid[0] ** 2
    )
    after = before + sum(e.at(end, shifts, accelerations) for e in pool)
    mean, variance = _moments(before, shifts)
    new_mean, new_variance = _moments(after, shifts)
    if new_variance > DECIDED * variance:
        return None
    alone = 1.0 / (1.0 / new_variance - 1.0 / variance)
    return alone * (new_mean / new_variance - mean / variance), alone


def _moments(logarithm: FloatArray, shifts: FloatArray) -> tuple[float, float]:
    """Mean and variance of the marginal over the rows."""
    weight = np.exp(logarithm - logarithm.max()).sum(axis=0)
    weight /= weight.sum()
    mean = float(weight @ shifts)
    return mean, float(weight @ (shifts - mean) ** 2)


def _speeds(found: list[tuple[float, float, float]], order: float | None) -> WheelSpeeds:
    table = np.array(found).reshape(-1, 3)
    return WheelSpeeds(
        time=table[:, 0].copy(), speed=table[:, 1].copy(), sd=table[:, 2].copy(), order=order
    )
