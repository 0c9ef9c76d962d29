"""What one sample measured, and the transition that steps add up to between two nodes.

Shared by the batch filter and by whatever feeds samples one at a time. Spec 7.2.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.compile import kernel
from schuler.kernels.covariance import navigation_rows

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@kernel(inline=True)
def correct_sample(
    gyro: Array,
    accel: Array,
    dt: float,
    sensor_state: Array,
    channel: Integers,
    direction: Array,
    angle: Array,
    velocity: Array,
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
def accumulate_transition(
    top: Array,
    sensor: Array,
    dt: float,
    rotation: Array,
    earth: Array,
    transport: Array,
    channel: Integers,
    direction: Array,
    partner: Integers,
    transition: Array,
    errors: Array,
    work: Array,
) -> None:
    """Left-multiply the accumulated transition by that of one step, in place.

    The transition is kept as its nine navigation rows `top` (9 rows of 264) and the sensor
    blocks `sensor` (m, 2) in the layout of `sensor_transition`.
    """
    s = 264
    m = sensor.shape[0]
    n = 9 + m
    for c in range(6):
        for k in range(n):
            errors[c * s + k] = 0.0
    for j in range(m):
        c = channel[j]
        other = partner[j]
        if math.isnan(direction[j, 0]):
            errors[c * s + 9 + j] += sensor[j, 0]
            if other >= 0:
                errors[c * s + 9 + other] += sensor[j, 1]
        else:
            base = 0 if c < 3 else 3
            for i in range(3):
                row = (base + i) * s + 9
                errors[row + j] += direction[j, i] * sensor[j, 0]
                if other >= 0:
                    errors[row + other] += direction[j, i] * sensor[j, 1]
    navigation_rows(top, errors, work, n, dt, rotation, earth, transport)
    for i in range(9):
        for k in range(n):
            top[i * s + k] = work[i * s + k]
    for j in range(m):
        other = partner[j]
        if other < 0:
            sensor[j, 0] *= transition[j, 0]
        elif other > j:
            a, b = sensor[j, 0], sensor[j, 1]
            c0, d = sensor[other, 1], sensor[other, 0]
            p, q = transition[j, 0], transition[j, 1]
            r, t = transition[other, 1], transition[other, 0]
            sensor[j, 0], sensor[j, 1] = p * a + q * c0, p * b + q * d
            sensor[other, 1], sensor[other, 0] = r * a + t * c0, r * b + t * d


@kernel(inline=True)
def reset_transition(top: Array, sensor: Array) -> None:
    """Set the accumulated transition to the identity."""
    top[:] = 0.0
    for i in range(9):
        top[i * 264 + i] = 1.0
    sensor[:, 0] = 1.0
    sensor[:, 1] = 0.0
