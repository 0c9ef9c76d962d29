"""Covariance propagation of the navigation error and the sensor error states, in 3x3 blocks.

The error state is (position 3, velocity 3, attitude 3, sensor states m), spec 7.2. A transition
over one short step acts on rows of nine as

    psi' = psi - dt w_in x psi - dt C y_gyro + dt W dv
    dv'  = dv + dt f x (psi + psi')/2 + dt C y_accel - dt (2 w_ie + w_en) x dv + vertical gradient
    dr'  = dr + dt (dv + dv')/2

which is the second-order Taylor transition of the dominant terms. y are the six channel errors,
the sums of the sensor states. Applying the rows twice, to P and to the transpose of the result,
gives F P F' without ever forming F; applied to an identity they accumulate F itself.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.compile import kernel

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@kernel(inline=True)
def navigation_rows(
    rows: Array,
    channel_errors: Array,
    result: Array,
    width: int,
    dt: float,
    rotation: Array,
    earth: Array,
    transport: Array,
) -> None:
    """Apply one step of the transition to nine rows. Spec 7.2.

    `rows` (9 rows), `channel_errors` (6 rows): accelerometer then gyro errors in the body frame,
    `result` (9 rows): flat arrays with 264 places a row, so that the compiler knows the rows lie
    apart and vectorises along them; `width` is at most 256. `earth` (10,) as `strapdown_step`
    leaves it; `transport` (3,): 1/(R_N + h), -1/(R_M + h), -tan(latitude)/(R_N + h).
    """
    s = 264
    half = 0.5 * dt
    a0, a1, a2 = earth[0] * half, earth[1] * half, earth[2] * half
    w0, w1, w2 = earth[3] * dt, earth[4] * dt, earth[5] * dt
    k0, k1, k2 = earth[6] * dt, earth[7] * dt, earth[8] * dt
    gradient = earth[9] * dt
    t0, t1, t2 = transport[0] * dt, transport[1] * dt, transport[2] * dt
    c00, c01, c02 = rotation[0, 0] * dt, rotation[0, 1] * dt, rotation[0, 2] * dt
    c10, c11, c12 = rotation[1, 0] * dt, rotation[1, 1] * dt, rotation[1, 2] * dt
    c20, c21, c22 = rotation[2, 0] * dt, rotation[2, 1] * dt, rotation[2, 2] * dt
    for k in range(width):
        v0, v1, v2 = rows[3 * s + k], rows[4 * s + k], rows[5 * s + k]
        p0, p1, p2 = rows[6 * s + k], rows[7 * s + k], rows[8 * s + k]
        y0 = channel_errors[3 * s + k]
        y1 = channel_errors[4 * s + k]
        y2 = channel_errors[5 * s + k]
        q0 = p0 + w2 * p1 - w1 * p2 - (c00 * y0 + c01 * y1 + c02 * y2) + t0 * v1
        q1 = p1 + w0 * p2 - w2 * p0 - (c10 * y0 + c11 * y1 + c12 * y2) + t1 * v0
        q2 = p2 + w1 * p0 - w0 * p1 - (c20 * y0 + c21 * y1 + c22 * y2) + t2 * v1
        result[6 * s + k] = q0
        result[7 * s + k] = q1
        result[8 * s + k] = q2
        s0, s1, s2 = p0 + q0, p1 + q1, p2 + q2
        x0 = channel_errors[k]
        x1 = channel_errors[s + k]
        x2 = channel_errors[2 * s + k]
        u0 = v0 + (a1 * s2 - a2 * s1) + (c00 * x0 + c01 * x1 + c02 * x2) - (k1 * v2 - k2 * v1)
        u1 = v1 + (a2 * s0 - a0 * s2) + (c10 * x0 + c11 * x1 + c12 * x2) - (k2 * v0 - k0 * v2)
        u2 = v2 + (a0 * s1 - a1 * s0) + (c20 * x0 + c21 * x1 + c22 * x2) - (k0 * v1 - k1 * v0)
        u2 += gradient * rows[2 * s + k]
        result[3 * s + k] = u0
        result[4 * s + k] = u1
        result[5 * s + k] = u2
        result[k] = rows[k] + half * (v0 + u0)
        result[s + k] = rows[s + k] + half * (v1 + u1)
        result[2 * s + k] = rows[2 * s + k] + half * (v2 + u2)


@kernel(inline=True)
def channel_rows(
    covariance: Array, channel: Integers, direction: Array, width: int, result: Array
) -> None:
    """Sum the rows of the sensor states into the six channel errors of the body frame.

    State j, row 9 + j of `covariance`, adds direction[j] (3,) times its row to the accelerometer
    (channel[j] < 3) or gyro triad; a state that does not show (the slope of a ramp) has direction
    zero. The common case, a state that is the whole error of the axis channel[j], is marked by
    direction[j, 0] = NaN: only one of the three rows is then touched. `result`: 6 rows of 264.
    """
    s = 264
    for c in range(6):
        for k in range(width):
            result[c * s + k] = 0.0
    for j in range(channel.size):
        c = channel[j]
        d0 = direction[j, 0]
        if math.isnan(d0):
            for k in range(width):
                result[c * s + k] += covariance[9 + j, k]
        else:
            base = 0 if c < 3 else 3 * s
            d1, d2 = direction[j, 1], direction[j, 2]
            for k in range(width):
                value = covariance[9 + j, k]
                result[base + k] += d0 * value
                result[base + s + k] += d1 * value
                result[base + 2 * s + k] += d2 * value


@kernel(inline=True)
def sensor_transition(
    dt: float,
    drift: Array,
    diffusion: Array,
    partner: Integers,
    transition: Array,
    noise: Array,
) -> None:
    """Discretise the sensor states for one step, exactly for single states.

    drift (m, 2): rate of a state on itself and of its partner on it, 1/s; partner (m,): index of
    the other state of a 2x2 block, or -1. diffusion (m, 2): noise density on the state and
    between it and its partner. Writes transition (m, 2) and noise (m, 2) in the same layout.
    Spec 1.1 and 7.3; 2x2 blocks by the closed form of their exponential.
    """
    for j in range(drift.shape[0]):
        other = partner[j]
        if other < 0:
            rate = drift[j, 0]
            transition[j, 1] = 0.0
            noise[j, 1] = 0.0
            if rate == 0.0:
                transition[j, 0] = 1.0
                noise[j, 0] = diffusion[j, 0] * dt
            else:
                transition[j, 0] = math.exp(rate * dt)
                noise[j, 0] = diffusion[j, 0] * math.expm1(2.0 * rate * dt) / (2.0 * rate)
        else:
            a, b = drift[j, 0], drift[j, 1]
            c, d = drift[other, 1], drift[other, 0]
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
            transition[j, 0], transition[j, 1] = own, cross
            # trapezoid of the noise integral: third order in the step
            qa, qb, qd = diffusion[j, 0], diffusion[j, 1], diffusion[other, 0]
            far, near = grow * c * odd, grow * (even - half * odd)
            noise[j, 0] = (
                0.5 * dt * (qa + own * own * qa + 2.0 * own * cross * qb + cross * cross * qd)
            )
            noise[j, 1] = (
                0.5
                * dt
                * (qb + own * far * qa + (own * near + cross * far) * qb + cross * near * qd)
            )


@kernel(inline=True)
def propagate_covariance(
    covariance: Array,
    dt: float,
    rotation: Array,
    earth: Array,
    transport: Array,
    channel: Integers,
    direction: Array,
    partner: Integers,
    transition: Array,
    noise: Array,
    white: Array,
    rows: Array,
    errors: Array,
    top: Array,
    block_top: Array,
) -> None:
    """P <- F P F' + Q over one step, in place. Spec 7.2 and 7.3.

    `covariance` (n, n) with n = 9 + m <= 256; `white` (6,): squared densities of the
    accelerometer then gyro channels in the body frame; work arrays of 264 places a row: rows,
    top and block_top of 9 rows, errors of 6.
    """
    s = 264
    n = covariance.shape[0]
    m = n - 9
    for i in range(9):
        for k in range(n):
            rows[i * s + k] = covariance[i, k]
    channel_rows(covariance, channel, direction, n, errors)
    navigation_rows(rows, errors, top, n, dt, rotation, earth, transport)
    for i in range(9):
        for k in range(9):
            rows[k * s + i] = top[i * s + k]
    for c in range(6):
        for i in range(9):
            errors[c * s + i] = 0.0
    for j in range(m):
        c = channel[j]
        d0 = direction[j, 0]
        if math.isnan(d0):
            for i in range(9):
                errors[c * s + i] += top[i * s + 9 + j]
        else:
            base = 0 if c < 3 else 3 * s
            d1, d2 = direction[j, 1], direction[j, 2]
            for i in range(9):
                value = top[i * s + 9 + j]
                errors[base + i] += d0 * value
                errors[base + s + i] += d1 * value
                errors[base + 2 * s + i] += d2 * value
    navigation_rows(rows, errors, block_top, 9, dt, rotation, earth, transport)
    for i in range(9):
        for k in range(i + 1):
            covariance[i, k] = block_top[i * s + k]
            covariance[k, i] = block_top[i * s + k]

    # sensor states: F_s P_ss F_s' + Q, and the cross blocks
    for j in range(m):
        other = partner[j]
        own, cross = transition[j, 0], transition[j, 1]
        for i in range(9):
            value = own * top[i * s + 9 + j]
            if other >= 0:
                value += cross * top[i * s + 9 + other]
            covariance[i, 9 + j] = value
            covariance[9 + j, i] = value
    paired = False
    for j in range(m):
        if partner[j] >= 0:
            paired = True
    if paired:
        for j in range(m):
            for k in range(m):
                rows[k] = covariance[9 + j, 9 + k]
            for k in range(m):
                other = partner[k]
                value = transition[k, 0] * rows[k]
                if other >= 0:
                    value += transition[k, 1] * rows[other]
                covariance[9 + j, 9 + k] = value
        for k in range(m):
            for j in range(m):
                rows[j] = covariance[9 + j, 9 + k]
            for j in range(m):
                other = partner[j]
                value = transition[j, 0] * rows[j]
                if other >= 0:
                    value += transition[j, 1] * rows[other]
                covariance[9 + j, 9 + k] = value
        for j in range(m):
            for k in range(j):
                covariance[9 + k, 9 + j] = covariance[9 + j, 9 + k]
    else:
        for j in range(m):
            own = transition[j, 0]
            for k in range(m):
                covariance[9 + j, 9 + k] *= own * transition[k, 0]
    for j in range(m):
        covariance[9 + j, 9 + j] += noise[j, 0]
        other = partner[j]
        if other > j:
            covariance[9 + j, 9 + other] += noise[j, 1]
            covariance[9 + other, 9 + j] += noise[j, 1]

    for i in range(3):
        for k in range(i + 1):
            force = 0.0
            rate = 0.0
            for c in range(3):
                product = rotation[i, c] * rotation[k, c] * dt
                force += product * white[c]
                rate += product * white[3 + c]
            covariance[3 + i, 3 + k] += force
            covariance[6 + i, 6 + k] += rate
            if k != i:
                covariance[3 + k, 3 + i] += force
                covariance[6 + k, 6 + i] += rate
