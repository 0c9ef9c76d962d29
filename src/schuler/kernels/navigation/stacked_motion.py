"""How the solutions of all IMUs, and their common covariance, move on by a step."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.compile import kernel
from schuler.kernels.navigation.covariance import channel_rows, navigation_rows, work_rows
from schuler.kernels.navigation.geodesy import radii_of_curvature
from schuler.kernels.navigation.stacked_data import Stack
from schuler.kernels.navigation.strapdown import (
    coning_and_sculling,
    remember_sample,
    strapdown_step,
)
from schuler.kernels.navigation.transition import (
    correct_sample,
    move_sensor_states,
    sensor_transition,
)
from schuler.kernels.navigation.update import (
    clear,
)

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@kernel()
def correct_all(f: Stack, k: int, step: float) -> None:
    """Increments of sample k with the estimated sensor errors taken off."""
    state, model, sensors = f.state, f.model, f.model.sensors
    for i in range(model.weight.size):
        a, b = model.first[i], model.first[i + 1]
        correct_sample(
            f.samples.gyro[k, i],
            f.samples.accel[k, i],
            step,
            state.sensor[a:b],
            sensors.channel[a:b],
            sensors.direction[a:b],
            state.angle[i],
            state.velocity_increment[i],
        )


@kernel()
def twist_all(f: Stack, step: float) -> None:
    """What the sample turns and pushes every IMU beyond its increments."""
    state = f.state
    for i in range(f.model.weight.size):
        coning_and_sculling(
            state.angle[i],
            state.velocity_increment[i],
            state.past[i],
            step,
            state.coning[i],
            state.sculling[i],
        )


@kernel()
def take_samples(f: Stack, k: int, step: float) -> bool:
    """Read sample k; returns whether rates changed smoothly since the samples before."""
    state, work = f.state, f.work
    blocks = f.model.weight.size
    correct_all(f, k, step)
    if k == 0:
        state.step[0] = step
        for i in range(blocks):
            for _ in range(3):
                remember_sample(state.angle[i], state.velocity_increment[i], step, state.past[i])
    # nobody knows how rates changed in a gap
    smooth: bool = step < 3.0 * state.step[0]
    if smooth:
        twist_all(f, step)
    else:
        clear(state.coning)
        clear(state.sculling)
    if f.samples.white_scale.shape[0] > 0:
        for i in range(blocks):
            for c in range(6):
                work.white[i, c] = f.model.white[i, c] * f.samples.white_scale[k, c]
    return smooth


@kernel()
def discretise(f: Stack, dt: float) -> None:
    """Transition and noise of all sensor states over a step."""
    state, model, sensors = f.state, f.model, f.model.sensors
    for i in range(model.weight.size):
        a, b = model.first[i], model.first[i + 1]
        sensor_transition(
            dt,
            sensors.drift[a:b],
            sensors.diffusion[a:b],
            sensors.block[a:b],
            sensors.interval[a:b],
            state.transition[a:b],
            state.noise[a:b],
        )
    state.discretised[0] = dt


@kernel()
def move_solution(f: Stack, i: int, dt: float, share: float) -> None:
    """Strapdown of one IMU over a step that is a share of the sample."""
    state, part = f.state, f.work.of_filter
    for c in range(3):
        part.angle[c] = state.angle[i, c] * share
        part.velocity_increment[c] = state.velocity_increment[i, c] * share
        part.coning[c] = state.coning[i, c] * share
        part.sculling[c] = state.sculling[i, c] * share
    strapdown_step(
        dt,
        part.angle,
        part.velocity_increment,
        part.coning,
        part.sculling,
        state.position[i],
        state.velocity[i],
        state.quaternion[i],
        state.rotation[i],
        state.earth[i],
    )


@kernel(inline=True)
def sensor_rows(part: Array, block: Integers, transition: Array, width: int, rows: Array) -> None:
    """Left-multiply the rows of sensor states, from the tenth on, by their transition."""
    for j in range(block.shape[0]):
        start, states = block[j, 0], block[j, 1]
        if states == 1:
            own = transition[j, 0]
            for k in range(width):
                part[9 + j, k] *= own
        elif start == j:
            for q in range(states):
                for k in range(width):
                    rows[q * 264 + k] = part[9 + j + q, k]
                    part[9 + j + q, k] = 0.0
            for i in range(states):
                for q in range(states):
                    factor = transition[j + i, q]
                    for k in range(width):
                        part[9 + j + i, k] += factor * rows[q * 264 + k]


@kernel()
def multiply_rows(f: Stack, i: int, dt: float) -> None:
    """Left-multiply the rows of one IMU in the covariance by its transition, in place."""
    state, model, sensors, transport = f.state, f.model, f.model.sensors, f.work.transport
    errors, top, _, rows = work_rows(f.work.of_filter)
    a, b = model.first[i], model.first[i + 1]
    sine = math.sin(state.position[i, 0])
    meridian, transverse = radii_of_curvature(sine)
    transport[0] = 1.0 / (transverse + state.position[i, 2])
    transport[1] = -1.0 / (meridian + state.position[i, 2])
    transport[2] = -sine / math.sqrt(1.0 - sine * sine) * transport[0]
    columns = state.covariance.shape[1]
    for left in range(0, columns, 256):
        width = min(256, columns - left)
        part = state.covariance[model.offset[i] : model.offset[i + 1], left : left + width]
        for r in range(9):
            for k in range(width):
                rows[r * 264 + k] = part[r, k]
        channel_rows(part, sensors.channel[a:b], sensors.direction[a:b], width, errors)
        navigation_rows(rows, errors, top, width, dt, state.rotation[i], state.earth[i], transport)
        for r in range(9):
            for k in range(width):
                part[r, k] = top[r * 264 + k]
        sensor_rows(part, sensors.block[a:b], state.transition[a:b], width, rows)


@kernel()
def transpose(matrix: Array) -> None:
    """Transpose a square matrix in place."""
    for i in range(matrix.shape[0]):
        for j in range(i):
            value = matrix[i, j]
            matrix[i, j] = matrix[j, i]
            matrix[j, i] = value


@kernel()
def add_noise(f: Stack, i: int, dt: float) -> None:
    """Add the process noise of one IMU over a step to its block."""
    covariance, block, white = f.state.covariance, f.model.sensors.block, f.work.white[i]
    rotation, begin = f.state.rotation[i], f.model.offset[i]
    for j in range(f.model.first[i], f.model.first[i + 1]):
        row = 9 * (i + 1) + j
        for q in range(block[j, 1]):
            covariance[row, begin + 9 + block[j, 0] + q] += f.state.noise[j, q]
    for a in range(3):
        for b in range(3):
            for c in range(3):
                product = rotation[a, c] * rotation[b, c] * dt
                covariance[begin + 3 + a, begin + 3 + b] += product * white[c]
                covariance[begin + 6 + a, begin + 6 + b] += product * white[3 + c]


@kernel()
def move_stack(f: Stack, dt: float, share: float) -> None:
    """Move all solutions and their covariance on by one step: P <- F P F' + Q."""
    state, model = f.state, f.model
    covariance = state.covariance
    size, blocks = covariance.shape[0], model.weight.size
    for i in range(blocks):
        move_solution(f, i, dt, share)
        multiply_rows(f, i, dt)
    transpose(covariance)
    for i in range(blocks):
        multiply_rows(f, i, dt)
    for a in range(size):
        for b in range(a):
            # what was left stands transposed
            value = covariance[b, a]
            covariance[a, b] = value
    for i in range(blocks):
        a, b = model.first[i], model.first[i + 1]
        add_noise(f, i, dt)
        move_sensor_states(
            state.sensor[a:b],
            model.sensors.block[a:b],
            state.transition[a:b],
            f.work.of_filter.sensor,
        )
    tied = model.offset[blocks]
    for a in range(tied, size):
        covariance[a, a] += dt * model.creep[0 if (a - tied) % 6 < 3 else 1]


@kernel()
def advance_stack(f: Stack, span: float, step: float) -> None:
    """Advance inside a sample, in steps as long as allowed."""
    pieces = max(math.ceil(span / f.rules.longest_step - 1e-6), 1)
    dt = span / pieces
    if abs(dt - f.state.discretised[0]) > 1e-4 * dt:
        discretise(f, dt)
    for _ in range(pieces):
        move_stack(f, dt, dt / step)
