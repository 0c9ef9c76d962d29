"""Aiding measurements and the scalar-sequential update of the error-state filter.

A measurement has up to three independent components. Its kinds are numbered:

    0  position of the antenna (latitude, longitude, height), residual in NED metres
    1  velocity of the antenna in NED

What a vehicle tells (kinds 2 to 4) is in vehicle.py. To the components of any kind states
may be added that show in the measurement only: slowly varying errors of GNSS, a barometer's bias.

Residuals are predicted minus measured, so that z = H x + noise with x = computed - true.
"""

from __future__ import annotations

import math

import numpy as np

from schuler.kernels.compile import kernel
from schuler.kernels.navigation.geodesy import radii_of_curvature
from schuler.kernels.navigation.strapdown import rotate_after, rotation_from_quaternion
from schuler.kernels.types import FloatArray, IntArray


@kernel(inline=True)
def clear(design: FloatArray) -> None:
    """Set to zero."""
    for i in range(design.shape[0]):
        for k in range(design.shape[1]):
            design[i, k] = 0.0


@kernel()
def measurement_model(
    kind: int,
    value: FloatArray,
    lever_arm: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    rotation: FloatArray,
    body_rate: FloatArray,
    channel: IntArray,
    direction: FloatArray,
    residual: FloatArray,
    design: FloatArray,
) -> None:
    """Write residual (3,) and design matrix H (3, n) of one measurement. Spec 7.2.

    `lever_arm` (3,): antenna from IMU in the body frame, m; `body_rate` (3,): rate of the body
    with respect to n, in the body frame, rad/s.
    """
    n = design.shape[1]
    clear(design)
    if kind == 0:
        x, y, z = lever_arm[0], lever_arm[1], lever_arm[2]
    else:
        w0, w1, w2 = body_rate[0], body_rate[1], body_rate[2]
        x = w1 * lever_arm[2] - w2 * lever_arm[1]
        y = w2 * lever_arm[0] - w0 * lever_arm[2]
        z = w0 * lever_arm[1] - w1 * lever_arm[0]
    a = rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z
    b = rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z
    c = rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z
    first = 3 * kind
    for i in range(3):
        design[i, first + i] = 1.0
    # delta(C l) = -psi x C l = [C l x] psi
    design[0, 7], design[0, 8] = -c, b
    design[1, 6], design[1, 8] = c, -a
    design[2, 6], design[2, 7] = -b, a
    if kind == 0:
        sine = math.sin(position[0])
        meridian, transverse = radii_of_curvature(sine)
        residual[0] = (position[0] - value[0]) * (meridian + position[2]) + a
        turn = position[1] - value[1]
        turn -= 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
        residual[1] = turn * (transverse + position[2]) * math.cos(position[0]) + b
        residual[2] = value[2] - position[2] + c
    else:
        residual[0] = velocity[0] + a - value[0]
        residual[1] = velocity[1] + b - value[1]
        residual[2] = velocity[2] + c - value[2]
        # an error y of the rate moves the antenna by C (y x l) = -C [l x] y
        l0, l1, l2 = lever_arm[0], lever_arm[1], lever_arm[2]
        for j in range(n - 9):
            if channel[j] < 3:
                continue
            if math.isnan(direction[j, 0]):
                d0 = 1.0 if channel[j] == 3 else 0.0
                d1 = 1.0 if channel[j] == 4 else 0.0
                d2 = 1.0 if channel[j] == 5 else 0.0
            else:
                d0, d1, d2 = direction[j, 0], direction[j, 1], direction[j, 2]
            x = d1 * l2 - d2 * l1
            y = d2 * l0 - d0 * l2
            z = d0 * l1 - d1 * l0
            for i in range(3):
                design[i, 9 + j] = rotation[i, 0] * x + rotation[i, 1] * y + rotation[i, 2] * z


@kernel()
def add_offset_states(
    offset: IntArray,
    scale: FloatArray,
    sensor_state: FloatArray,
    residual: FloatArray,
    design: FloatArray,
) -> None:
    """Add states to what a measurement is predicted to be.

    `offset` (3,): for each component the place among the sensor states of an error that adds to
    what is measured, or -1; `scale` (3,): by which it is multiplied.
    """
    for i in range(3):
        j = offset[i]
        if j >= 0:
            residual[i] += scale[i] * sensor_state[j]
            design[i, 9 + j] -= scale[i]


@kernel(inline=True)
def add_rate_noise(
    lever: FloatArray,
    rotation: FloatArray,
    white: FloatArray,
    step: float,
    noise_variance: FloatArray,
) -> None:
    """Add what the gyros' noise of one sample puts into the velocity of an antenna, (3,).

    The antenna moves by C (w x l), and w is one noisy sample: N^2/dt through -C [l x]. Left out,
    a metre of lever arm at 200 Hz makes velocities look wrong that are right.
    """
    by_rate = np.empty((3, 3))
    l0, l1, l2 = lever[0], lever[1], lever[2]
    for i in range(3):
        by_rate[i, 0] = rotation[i, 2] * l1 - rotation[i, 1] * l2
        by_rate[i, 1] = rotation[i, 0] * l2 - rotation[i, 2] * l0
        by_rate[i, 2] = rotation[i, 1] * l0 - rotation[i, 0] * l1
    for i in range(3):
        total = 0.0
        for c in range(3):
            for d in range(3):
                total += by_rate[i, c] * white[1, c, d] * by_rate[i, d]
        noise_variance[i] += total / step


@kernel()
def innovation_statistics(
    residual: FloatArray,
    design: FloatArray,
    variance: FloatArray,
    covariance: FloatArray,
    deviation: FloatArray,
) -> tuple[float, float, int]:
    """Normalised innovation squared, log det S and degrees of freedom of a measurement.

    Components of infinite variance are left out. `deviation` (3,) receives the claimed standard
    deviation of each component (NaN where left out).
    """
    n = design.shape[1]
    s = np.zeros((3, 3))
    used = np.empty(3, np.int64)
    count = 0
    for i in range(3):
        deviation[i] = math.nan
        if math.isfinite(variance[i]):
            used[count] = i
            count += 1
    for a in range(count):
        i = used[a]
        for k in range(n):
            if design[i, k] == 0.0:
                continue
            for b in range(a + 1):
                j = used[b]
                value = 0.0
                for q in range(n):
                    value += covariance[k, q] * design[j, q]
                s[a, b] += design[i, k] * value
        s[a, a] += variance[i]
        deviation[i] = math.sqrt(s[a, a])
    nis = 0.0
    log_determinant = 0.0
    y = np.zeros(3)
    for a in range(count):
        value = residual[used[a]]
        for b in range(a):
            total = s[a, b]
            for c in range(b):
                total -= s[a, c] * s[b, c]
            s[a, b] = total / s[b, b]
            value -= s[a, b] * y[b]
        diagonal = s[a, a]
        for c in range(a):
            diagonal -= s[a, c] * s[a, c]
        s[a, a] = math.sqrt(diagonal)
        y[a] = value / s[a, a]
        nis += y[a] * y[a]
        log_determinant += 2.0 * math.log(s[a, a])
    return nis, log_determinant, count


@kernel()
def scalar_update(
    innovation: float,
    row: FloatArray,
    variance: float,
    covariance: FloatArray,
    error: FloatArray,
    gain: FloatArray,
) -> float:
    """Joseph-form update with one scalar z = h x + v; returns its innovation variance.

    P <- (I - K h) P (I - K h)' + K r K' written out as P - K d' - d K' + s K K' with d = P h',
    evaluated once for each pair and mirrored, hence symmetric by construction. `error` (n,)
    gathers the estimate; `gain` (n,) receives K. `innovation` is already reduced by h times the
    estimate so far.
    """
    n = covariance.shape[0]
    for i in range(n):
        gain[i] = 0.0
    for k in range(n):
        h = row[k]
        if h != 0.0:
            for i in range(n):
                gain[i] += h * covariance[k, i]
    s = variance
    for k in range(n):
        s += row[k] * gain[k]
    inverse = 1.0 / s
    for i in range(n):
        ki = gain[i] * inverse
        for j in range(i + 1):
            kj = gain[j] * inverse
            value = covariance[i, j] - ki * gain[j] - gain[i] * kj + s * ki * kj
            covariance[i, j] = value
            covariance[j, i] = value
    for i in range(n):
        gain[i] *= inverse
        error[i] += gain[i] * innovation
    return s


@kernel()
def feed_back(
    error: FloatArray,
    position: FloatArray,
    velocity: FloatArray,
    quaternion: FloatArray,
    rotation: FloatArray,
    sensor_state: FloatArray,
) -> None:
    """Take the estimated error out of the state (closed loop). Spec 7.2.

    Navigation: true = computed - error, and C = (I + psi x) C_computed; the sensor states are
    true minus already subtracted, so they are added.
    """
    sine = math.sin(position[0])
    meridian, transverse = radii_of_curvature(sine)
    position[0] -= error[0] / (meridian + position[2])
    position[1] -= error[1] / ((transverse + position[2]) * math.cos(position[0]))
    position[2] += error[2]
    for i in range(3):
        velocity[i] -= error[3 + i]
    rotate_after(quaternion, error[6], error[7], error[8])
    rotation_from_quaternion(quaternion, rotation)
    for j in range(sensor_state.size):
        sensor_state[j] += error[9 + j]
