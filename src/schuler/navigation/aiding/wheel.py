"""Speed of a vehicle from the vibration of its wheels, for outages of GNSS.

While GNSS is there, the lines of the wheels are learned (aiding/wheel_lines.py). From then on
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

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from schuler.data import ImuRecording
from schuler.kernels.navigation.filter_data import AidingOutputs, NodeOutputs, SampleOutputs
from schuler.navigation.aiding.schedule import (
    VEHICLE_VELOCITY,
    AidingSchedule,
    merge_schedules,
    schedule_rows,
)
from schuler.navigation.aiding.vehicle import WHEEL_STATE
from schuler.navigation.aiding.wheel_lines import (
    BLOCK_SECONDS,
    VibrationBlock,
    WheelMemory,
    vibration_block,
)
from schuler.navigation.engine import asked_at, diverged, fill_row
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.segments import RunSegment
from schuler.navigation.stepping import (
    FilterStepper,
    InitialState,
    VehicleStates,
    kernel_samples,
    kernel_schedule,
)
from schuler.types import FloatArray

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
# a speed found at a sample is used just after it (s)
JUST_AFTER = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class WheelSpeeds:
    """Forward speeds found in vibration."""

    time: FloatArray  # (k,): seconds on the IMU's axis
    # speed, sd: (k,) m/s
    speed: FloatArray
    sd: FloatArray
    place: int  # of the state of what is wrong with them for longer than a moment
    order: float | None = None  # turns of a wheel per metre; None if no wheel was found.

    def rows(self) -> AidingSchedule:
        """Return one measurement a speed."""
        count = self.time.size
        value, variance = np.zeros((count, 3)), np.full((count, 3), np.inf)
        value[:, 0], variance[:, 0] = self.speed, self.sd**2
        offset = (self.place, -1, -1)
        return schedule_rows(self.time, VEHICLE_VELOCITY, value, variance, offset_state=offset)


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
    run: RunSegment, model: SensorErrorModel, vehicle: VehicleStates, *, gate: FloatArray
) -> WheelSpeeds:
    """Run the filter block by block, and let the vibration of each speak before the next."""
    imu = run.imu
    channels = np.concatenate([imu.accel, imu.gyro], axis=1)
    step = max(round(BLOCK_INTERVAL * imu.rate), 2)
    length = round(BLOCK_SECONDS / BLOCK_INTERVAL) * step
    ends = np.arange(step, imu.size, step)
    blocks = _filtered_blocks(run, model, vehicle, ends, gate)
    memory = WheelMemory(channels.shape[1])
    found: list[tuple[float, float, float]] = []
    pool: list[_Evidence] = []
    path = np.empty(0)
    for last, now in zip(ends.tolist(), blocks, strict=True):
        speed = np.linalg.norm(now.velocity, axis=1)
        # one smooth profile: what was told at the end of the last block shifts what came before
        if now.told:
            path = path + (speed[0] - 2.0 * path[-1] + path[-2])
        path = np.concatenate([path, speed])[-length:]
        stretch = slice(last + 1 - length, last + 1)
        if path.size < length or imu.time[last] - imu.time[stretch.start] > 1.1 * BLOCK_SECONDS:
            pool = []
            continue
        if path.min() < SLOWEST:
            continue
        block = vibration_block(imu.time[stretch], channels[stretch], path)
        prior = _error_of_speed(now.state, model, imu, stretch.stop)
        if memory.order is not None:
            pool = [e for e in pool if imu.time[last] - e.end < POOL_SECONDS]
            told = _weigh(memory, block, float(imu.time[last]), prior, pool)
            if told is not None:
                turning = float(np.abs(imu.gyro[stretch].mean(axis=0) @ now.state.rotation[2]))
                own = ROLLING_SD**2 + (WHEEL_ASIDE * turning) ** 2
                sd = float(np.sqrt(told[1] + own))
                if sd < LARGEST_SD:
                    pool = []
                    now.tell(float(path[-1]) + told[0], sd)
                    found.append((now.end, float(path[-1]) + told[0], sd))
        if np.sqrt(prior[0, 0]) < KNOWN_SPEED_SD:
            memory.learn(block)
    table = np.array(found).reshape(-1, 3)
    place = model.names.index(WHEEL_STATE)
    columns = np.ascontiguousarray(table.T)
    return WheelSpeeds(columns[0], columns[1], columns[2], place, memory.order)


@dataclass(frozen=True, slots=True, eq=False)
class _FilteredBlock:
    """The filter at the end of a block of samples.

    `velocity` (n, 3) at its samples, `told`: whether something was told at its beginning, `state`
    at its end, at the time `end`; `tell` gives the filter a speed and its standard deviation
    there.
    """

    velocity: FloatArray
    told: bool
    state: InitialState
    end: float
    tell: Callable[[float, float], None]


def _filtered_blocks(
    run: RunSegment,
    model: SensorErrorModel,
    vehicle: VehicleStates,
    ends: NDArray[np.int64],
    gate: FloatArray,
) -> Iterator[_FilteredBlock]:
    """Run the filter up to each of the samples `ends`; speeds told there are used from there on.

    Rows for all speeds that may come are in the schedule from the beginning, of infinite variance.
    """
    imu = run.imu
    due = imu.time[ends] + JUST_AFTER
    place = model.names.index(WHEEL_STATE)
    blank = WheelSpeeds(due, np.zeros(ends.size), np.full(ends.size, np.inf), place)
    whole = merge_schedules([run.schedule, blank.rows()], float(imu.time[0]), float(due[-1]))
    wheel = (whole.kind == VEHICLE_VELOCITY) & ~np.isfinite(whole.variance).any(axis=1)
    rows = np.flatnonzero(wheel & np.isin(whole.time, due))
    stepper = FilterStepper(run.start, model, gate=gate, vehicle=vehicle, node_interval=1e9)
    filter_ = stepper.filter(
        kernel_samples(imu, run.white_scale),
        kernel_schedule(whole, model.size),
        SampleOutputs.empty(imu.size),
        AidingOutputs.empty(whole.size, 0, stepper.size),
        NodeOutputs.empty(whole.size + 3, 0, stepper.size, stepper.width),
    )
    table, asked = filter_.schedule.rows, asked_at(imu.time, whole)
    stops = sorted(asked)
    first, told = 0, False
    for last, row in zip(ends, rows, strict=True):
        own = slice(first, int(last) + 1)
        inner = (k for k in stops if own.start < k < own.stop)
        for begin, stop in pairwise([own.start, *inner, own.stop]):
            for u in asked.get(begin, ()):
                fill_row(whole, u, filter_)
            bad = stepper.advance(filter_, begin, stop, whole.size)
            if bad >= 0:
                raise diverged(imu, bad)
        first = own.stop

        def tell(speed: float, sd: float, row: int = int(row)) -> None:
            nonlocal told
            told = True
            table["value"][row, 0], table["variance"][row, 0] = speed, sd**2

        before, told = told, False
        yield _FilteredBlock(
            filter_.outputs.velocity[own],
            before,
            InitialState(*stepper.copies()),
            float(whole.time[row]),
            tell,
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
