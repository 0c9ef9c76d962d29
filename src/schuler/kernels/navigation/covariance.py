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

from schuler.kernels.compile import kernel
from schuler.kernels.navigation.filter_data import FilterState, SensorModel, Work
from schuler.kernels.types import FloatArray, IntArray


@kernel(inline=True)
def work_rows(work: Work) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Rows of 264 for channel errors (6), two results and what is multiplied (9 each).

    Parts of one array of known length, so that the compiler knows that they lie apart.
    """
    s = 264
    flat = work.rows
    return flat[: 6 * s], flat[6 * s : 15 * s], flat[15 * s : 24 * s], flat[24 * s : 33 * s]


@kernel(inline=True)
def full_lanes(width: int) -> int:
    """The next multiple of four: a loop over so many places leaves no rest to do one by one."""
    return (width + 3) & -4


@kernel(inline=True)
def navigation_rows(
    rows: FloatArray,
    channel_errors: FloatArray,
    result: FloatArray,
    width: int,
    dt: float,
    rotation: FloatArray,
    earth: FloatArray,
    transport: FloatArray,
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
    covariance: FloatArray, channel: IntArray, direction: FloatArray, width: int, result: FloatArray
) -> None:
    """Sum the rows of the sensor states into the six channel errors of the body frame.

    State j, row 9 + j of `covariance`, adds direction[j] (3,) times its row to the accelerometer
    (channel[j] of 0 to 2) or gyro triad (3 to 5); a state that shows in no channel has channel
    -1, one that does not show by itself (the slope of a ramp) direction zero. The common case, a
    state that is the whole error of the axis channel[j], is marked by direction[j, 0] = NaN: only
    one of the three rows is then touched. `result`: 6 rows of 264.
    """
    s = 264
    for c in range(6):
        for k in range(width):
            result[c * s + k] = 0.0
    for j in range(channel.size):
        c = channel[j]
        if c < 0:
            continue
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
def sensor_covariance(
    covariance: FloatArray,
    block: IntArray,
    transition: FloatArray,
    noise: FloatArray,
    rows: FloatArray,
) -> None:
    """F_s P_ss F_s' + Q of the sensor states, in place, with blocks of any size.

    `transition` and `noise` (m, w): row j of its block, which starts at block[j, 0] and has
    block[j, 1] states; `rows`: work for as many rows of 264 as the largest block has states.
    """
    s = 264
    m = block.shape[0]
    single = True
    for j in range(m):
        if block[j, 1] > 1:
            single = False
    if single:
        for j in range(m):
            own = transition[j, 0]
            for k in range(m):
                covariance[9 + j, 9 + k] *= own * transition[k, 0]
            covariance[9 + j, 9 + j] += noise[j, 0]
        return
    # F_s P: rows of a block mix
    for j in range(m):
        first, size = block[j, 0], block[j, 1]
        if size == 1:
            own = transition[j, 0]
            for k in range(m):
                covariance[9 + j, 9 + k] *= own
        elif first == j:
            for q in range(size):
                for k in range(m):
                    rows[q * s + k] = covariance[9 + j + q, 9 + k]
                    covariance[9 + j + q, 9 + k] = 0.0
            for i in range(size):
                for q in range(size):
                    factor = transition[j + i, q]
                    if factor != 0.0:
                        for k in range(m):
                            covariance[9 + j + i, 9 + k] += factor * rows[q * s + k]
    # times F_s': columns of a block mix; what lies above the diagonal is its mirror image
    for j in range(m):
        last = block[j, 0] + block[j, 1]
        for k in range(last):
            rows[k] = covariance[9 + j, 9 + k]
        for k in range(j + 1):
            size = block[k, 1]
            if size == 1:
                value = transition[k, 0] * rows[k]
            else:
                first = block[k, 0]
                value = 0.0
                for q in range(size):
                    value += transition[k, q] * rows[first + q]
            covariance[9 + j, 9 + k] = value
    for j in range(m):
        first = block[j, 0]
        for k in range(first, j + 1):
            covariance[9 + j, 9 + k] += noise[j, k - first]
        for k in range(j):
            covariance[9 + k, 9 + j] = covariance[9 + j, 9 + k]


@kernel(inline=True)
def add_white_noise(
    covariance: FloatArray, rotation: FloatArray, white: FloatArray, dt: float
) -> None:
    """Add C W C' dt of both triads."""
    for part in range(2):
        first = 3 + 3 * part
        for i in range(3):
            c0, c1, c2 = rotation[i, 0] * dt, rotation[i, 1] * dt, rotation[i, 2] * dt
            w0 = c0 * white[part, 0, 0] + c1 * white[part, 1, 0] + c2 * white[part, 2, 0]
            w1 = c0 * white[part, 0, 1] + c1 * white[part, 1, 1] + c2 * white[part, 2, 1]
            w2 = c0 * white[part, 0, 2] + c1 * white[part, 1, 2] + c2 * white[part, 2, 2]
            for k in range(i + 1):
                value = w0 * rotation[k, 0] + w1 * rotation[k, 1] + w2 * rotation[k, 2]
                covariance[first + i, first + k] += value
                if k != i:
                    covariance[first + k, first + i] += value


@kernel(inline=True)
def channel_columns(
    channel: IntArray, direction: FloatArray, top: FloatArray, errors: FloatArray
) -> None:
    """Sum the columns of the sensor states in `top` into six rows of nine, `errors`."""
    s = 264
    for c in range(6):
        for i in range(9):
            errors[c * s + i] = 0.0
    for j in range(channel.size):
        c = channel[j]
        if c < 0:
            continue
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


@kernel(inline=True)
def cross_covariance(
    covariance: FloatArray, block: IntArray, transition: FloatArray, top: FloatArray
) -> None:
    """Write what the sensor states share with the navigation error: columns of `top` times F_s'."""
    s = 264
    for j in range(block.shape[0]):
        first, size = block[j, 0], block[j, 1]
        if size == 1:
            own = transition[j, 0]
            for i in range(9):
                value = own * top[i * s + 9 + j]
                covariance[i, 9 + j] = value
                covariance[9 + j, i] = value
        else:
            for i in range(9):
                value = 0.0
                for q in range(size):
                    value += transition[j, q] * top[i * s + 9 + first + q]
                covariance[i, 9 + j] = value
                covariance[9 + j, i] = value


@kernel()
def propagate_covariance(state: FilterState, model: SensorModel, work: Work, dt: float) -> None:
    """P <- F P F' + Q over one step, in place. Spec 7.2 and 7.3."""
    s = 264
    covariance = state.covariance
    errors, top, block_top, rows = work_rows(work)
    rotation, earth, transport = state.rotation, state.earth, state.transport
    n = covariance.shape[0]
    for i in range(9):
        for k in range(n):
            rows[i * s + k] = covariance[i, k]
    channel_rows(covariance, model.channel, work.shown, n, errors)
    # behind the last column stand zeros
    navigation_rows(rows, errors, top, full_lanes(n), dt, rotation, earth, transport)
    for i in range(9):
        for k in range(9):
            rows[k * s + i] = top[i * s + k]
    channel_columns(model.channel, work.shown, top, errors)
    navigation_rows(rows, errors, block_top, full_lanes(9), dt, rotation, earth, transport)
    for i in range(9):
        for k in range(i + 1):
            covariance[i, k] = block_top[i * s + k]
            covariance[k, i] = block_top[i * s + k]
    cross_covariance(covariance, model.block, state.transition, top)
    sensor_covariance(covariance, model.block, state.transition, state.noise, work.blocks)
    add_white_noise(covariance, rotation, work.white, dt)
