"""What one sample measured, how its sensor states move, and what steps add up to between nodes.

Sensor states come in blocks. block (m, 2) holds for every state where its block starts and how
many states it has; matrices of blocks are kept as (m, w), row j of the block in row j. Blocks in
continuous time (interval[j] = 0, one or two states) have their rates in `drift` and noise
densities in `diffusion`; a block that exists at one sample interval only has its transition and
noise covariance over that interval there. Spec 1.1, 7.2, 7.3.
"""

from __future__ import annotations

import math

import numpy as np

from schuler.kernels.compile import kernel
from schuler.kernels.navigation.covariance import full_lanes, navigation_rows, work_rows
from schuler.kernels.navigation.filter_data import FilterState, SensorModel, Work
from schuler.kernels.types import FloatArray, IntArray


@kernel(inline=True)
def correct_sample(
    gyro: FloatArray,
    accel: FloatArray,
    dt: float,
    sensor_state: FloatArray,
    channel: IntArray,
    direction: FloatArray,
    angle: FloatArray,
    velocity: FloatArray,
) -> None:
    """Increments over one sample with the estimated sensor errors taken off. Spec 7.2.

    `channel` and `direction` as in `channel_rows`. Writes angle (3,) rad and velocity (3,) m/s.
    """
    for i in range(3):
        angle[i] = gyro[i]
        velocity[i] = accel[i]
    for j in range(sensor_state.size):
        value = sensor_state[j]
        c = channel[j]
        if c < 0:
            continue
        if math.isnan(direction[j, 0]):
            if c < 3:
                velocity[c] -= value
            else:
                angle[c - 3] -= value
        else:
            for i in range(3):
                if c < 3:
                    velocity[i] -= direction[j, i] * value
                else:
                    angle[i] -= direction[j, i] * value
    for i in range(3):
        angle[i] *= dt
        velocity[i] *= dt


@kernel(inline=True)
def scale_directions(
    gyro: FloatArray,
    accel: FloatArray,
    scaled_by: IntArray,
    direction: FloatArray,
    shown: FloatArray,
) -> None:
    """Write how states show that are in proportion to what a channel measures (m, 3).

    Scale factor, misalignment and g-sensitivity: state j shows along direction[j] times the
    measured value of the channel scaled_by[j] (0-2 accelerometer, 3-5 gyro; -1: not at all). As
    the measured value is taken, not the true one, truth = (1 - S) measured is linear in the state.
    """
    for j in range(scaled_by.size):
        c = scaled_by[j]
        if c >= 0:
            value = accel[c] if c < 3 else gyro[c - 3]
            for i in range(3):
                shown[j, i] = direction[j, i] * value


@kernel(inline=True)
def sensor_transition(
    dt: float,
    drift: FloatArray,
    diffusion: FloatArray,
    block: IntArray,
    interval: FloatArray,
    transition: FloatArray,
    noise: FloatArray,
) -> None:
    """Discretise the sensor states in continuous time for one step, exactly for single states.

    Blocks of two by the closed form of their exponential, with the trapezoid of the noise
    integral. Rows of blocks that exist at one interval only are left alone.
    """
    for j in range(drift.shape[0]):
        if interval[j] > 0.0:
            continue
        if block[j, 1] == 1:
            rate = drift[j, 0]
            if rate == 0.0:
                transition[j, 0] = 1.0
                noise[j, 0] = diffusion[j, 0] * dt
            else:
                transition[j, 0] = math.exp(rate * dt)
                noise[j, 0] = diffusion[j, 0] * math.expm1(2.0 * rate * dt) / (2.0 * rate)
        elif block[j, 0] == j:
            a, b = drift[j, 0], drift[j, 1]
            c, d = drift[j + 1, 0], drift[j + 1, 1]
            mean, half = 0.5 * (a + d), 0.5 * (a - d)
            square = half * half + b * c
            grow = math.exp(mean * dt)
            if square > 0.0:
                root = math.sqrt(square)
                even, odd = math.cosh(root * dt), math.sinh(root * dt) / root
            elif square < 0.0:
                root = math.sqrt(-square)
                even, odd = math.cos(root * dt), math.sin(root * dt) / root
            else:
                even, odd = 1.0, dt
            own, cross = grow * (even + half * odd), grow * b * odd
            far, near = grow * c * odd, grow * (even - half * odd)
            transition[j, 0], transition[j, 1] = own, cross
            transition[j + 1, 0], transition[j + 1, 1] = far, near
            # trapezoid: third order in the step
            qa, qb, qd = diffusion[j, 0], diffusion[j, 1], diffusion[j + 1, 1]
            both = own * far * qa + (own * near + cross * far) * qb + cross * near * qd
            first = own * own * qa + 2.0 * own * cross * qb + cross * cross * qd
            second = far * far * qa + 2.0 * far * near * qb + near * near * qd
            noise[j, 0] = 0.5 * dt * (qa + first)
            noise[j, 1] = 0.5 * dt * (qb + both)
            noise[j + 1, 0] = noise[j, 1]
            noise[j + 1, 1] = 0.5 * dt * (qd + second)


@kernel()
def raise_blocks(
    step: float,
    drift: FloatArray,
    diffusion: FloatArray,
    block: IntArray,
    interval: FloatArray,
    steps: IntArray,
    power: FloatArray,
    power_noise: FloatArray,
) -> bool:
    """Raise the blocks of one interval to the number of their steps in one sample. Spec 7.3.

    T^k and Q + T Q T' + ... of k = round(step / interval) >= 1 steps: one in the common case,
    more after a gap or at a lower rate. `steps` (m,) remembers k; writes power and power_noise
    (m, w) and tells whether anything changed.
    """
    changed = False
    for first in range(block.shape[0]):
        if interval[first] <= 0.0 or block[first, 0] != first:
            continue
        count = max(math.floor(step / interval[first] + 0.5), 1)
        if count == steps[first]:
            continue
        changed = True
        steps[first] = count
        size = block[first, 1]
        total, noise = np.zeros((size, size)), np.zeros((size, size))
        left, half = np.empty((size, size)), np.empty((size, size))
        for i in range(size):
            total[i, i] = 1.0
        for _ in range(count):
            for i in range(size):
                for k in range(size):
                    value, spread = 0.0, 0.0
                    for q in range(size):
                        value += drift[first + i, q] * total[q, k]
                        spread += drift[first + i, q] * noise[q, k]
                    left[i, k], half[i, k] = value, spread
            for i in range(size):
                for k in range(size):
                    total[i, k] = left[i, k]
            for i in range(size):
                for k in range(i + 1):
                    value = diffusion[first + i, k]
                    for q in range(size):
                        value += half[i, q] * drift[first + k, q]
                    noise[i, k] = value
                    noise[k, i] = value
        for i in range(size):
            for k in range(size):
                power[first + i, k] = total[i, k]
                power_noise[first + i, k] = noise[i, k]
    return changed


@kernel()
def set_blocks(
    moving: bool,
    block: IntArray,
    interval: FloatArray,
    power: FloatArray,
    power_noise: FloatArray,
    transition: FloatArray,
    noise: FloatArray,
) -> None:
    """Let the blocks of one interval move over a step, or stand still.

    A sample has one error, however often fixes split it: the blocks stand still in all its parts
    and move on at its end.
    """
    for j in range(block.shape[0]):
        if interval[j] > 0.0:
            for q in range(block[j, 1]):
                if moving:
                    transition[j, q] = power[j, q]
                    noise[j, q] = power_noise[j, q]
                else:
                    transition[j, q] = 1.0 if block[j, 0] + q == j else 0.0
                    noise[j, q] = 0.0


@kernel(inline=True)
def move_sensor_states(
    sensor_state: FloatArray, block: IntArray, transition: FloatArray, work: FloatArray
) -> None:
    """X <- F_s x, in place; `work` (m,)."""
    m = sensor_state.size
    for j in range(m):
        work[j] = sensor_state[j]
    for j in range(m):
        if block[j, 1] == 1:
            sensor_state[j] = transition[j, 0] * work[j]
        else:
            value = 0.0
            for q in range(block[j, 1]):
                value += transition[j, q] * work[block[j, 0] + q]
            sensor_state[j] = value


@kernel(inline=True)
def multiply_blocks(
    sensor: FloatArray, block: IntArray, transition: FloatArray, work: FloatArray
) -> None:
    """Left-multiply the blocks of the sensor states (m, w) by those of one step, in place."""
    for j in range(block.shape[0]):
        first, size = block[j, 0], block[j, 1]
        if size == 1:
            sensor[j, 0] *= transition[j, 0]
        elif first == j:
            for k in range(size):
                for q in range(size):
                    work[q] = sensor[j + q, k]
                for i in range(size):
                    value = 0.0
                    for q in range(size):
                        value += transition[j + i, q] * work[q]
                    sensor[j + i, k] = value


@kernel()
def accumulate_transition(state: FilterState, model: SensorModel, work: Work, dt: float) -> None:
    """Left-multiply the transition since the last node by that of one step, in place."""
    s = 264
    top, sensor, direction = state.node_top, state.node_sensor, work.shown
    errors, result, _, _ = work_rows(work)
    channel, block = model.channel, model.block
    m = sensor.shape[0]
    # states behind the last that shows in a channel change nothing of navigation
    n = 9
    for j in range(m):
        if channel[j] >= 0:
            n = 10 + j
    for c in range(6):
        for k in range(n):
            errors[c * s + k] = 0.0
    for j in range(m):
        c = channel[j]
        if c < 0:
            continue
        first = block[j, 0]
        for q in range(block[j, 1]):
            if math.isnan(direction[j, 0]):
                errors[c * s + 9 + first + q] += sensor[j, q]
            else:
                base = 0 if c < 3 else 3
                for i in range(3):
                    errors[(base + i) * s + 9 + first + q] += direction[j, i] * sensor[j, q]
    rotation, earth, transport = state.rotation, state.earth, state.transport
    navigation_rows(top, errors, result, full_lanes(n), dt, rotation, earth, transport)
    for i in range(9):
        for k in range(n):
            top[i * s + k] = result[i * s + k]
    multiply_blocks(sensor, block, state.transition, work.blocks)


@kernel(inline=True)
def reset_transition(top: FloatArray, sensor: FloatArray, block: IntArray) -> None:
    """Set the accumulated transition to the identity."""
    for i in range(9):
        for k in range(9 + sensor.shape[0]):
            top[i * 264 + k] = 0.0
        top[i * 264 + i] = 1.0
    for j in range(sensor.shape[0]):
        for q in range(sensor.shape[1]):
            sensor[j, q] = 0.0
        sensor[j, j - block[j, 0]] = 1.0
