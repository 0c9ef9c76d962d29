"""What a wheeled vehicle tells: it moves along its forward axis, and sometimes not at all.

The kinds of measurement that follow those of kernels/update.py:

    2  velocity in vehicle axes (forward, right, down) at the point that does not slip
    3  zero velocity in NED
    4  zero rate of turn against the earth about the vertical

The IMU is mounted by M = exp([mu x]) M_0, vehicle from IMU, and the point that does not slip sits
at l from it, in vehicle axes. With C = C_nb, v the velocity in NED, w the rate of the body and a
its acceleration over ground, both in IMU axes, vehicle axes see

    u = M C' v + (M w) x l,   turn = (M w)_down,   ahead = (M a)_forward

and a wheeled vehicle, whose rear axle slips in proportion to the force in a curve (s) and whose
springs let it pitch in proportion to its acceleration (p), keeps

    u_right + s turn u_forward^2 = 0,   u_down + p ahead u_forward = 0.

Residuals are predicted minus measured. Navigation errors are computed minus true, sensor and
vehicle states true minus estimated, hence the signs below. Groves, Principles of GNSS, Inertial
and Multisensor Integrated Navigation Systems, 2nd ed., sections 15.3 and 15.4.1.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.compile import kernel

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@kernel(inline=True)
def mounting_rotation(
    a: float, b: float, c: float, nominal: Array, rotation: Array, jacobian: Array
) -> None:
    """Write M = exp([mu x]) M_0 (3, 3) and the left Jacobian of mu = (a, b, c), rad.

    A change d of mu turns M by J d on its left: J = I + [mu x]/2 + [mu x]^2/6 and so on. Series,
    good to 1e-9 for mu up to 0.1 rad.
    """
    square = a * a + b * b + c * c
    s1 = 1.0 - square * (1.0 / 6.0 - square / 120.0)
    s2 = 0.5 - square * (1.0 / 24.0 - square / 720.0)
    s3 = 1.0 / 6.0 - square * (1.0 / 120.0 - square / 5040.0)
    for i in range(3):
        for j in range(3):
            # [mu x] and its square, mu mu' - mu^2 I
            x = 0.0
            if i == 0 and j == 1:
                x = -c
            elif i == 1 and j == 0:
                x = c
            elif i == 0 and j == 2:
                x = b
            elif i == 2 and j == 0:
                x = -b
            elif i == 1 and j == 2:
                x = -a
            elif i == 2 and j == 1:
                x = a
            left = a if i == 0 else (b if i == 1 else c)
            right = a if j == 0 else (b if j == 1 else c)
            y = left * right
            one = 0.0
            if i == j:
                y -= square
                one = 1.0
            jacobian[i, j] = one + s2 * x + s3 * y
            x = one + s1 * x + s2 * y
            for k in range(3):
                if j == 0:
                    rotation[i, k] = 0.0
                rotation[i, k] += x * nominal[j, k]


@kernel(inline=True)
def gyro_direction(j: int, channel: Integers, direction: Array, shown: Array) -> bool:
    """Write how sensor state j shows in the rate of the body (3,); False if it does not."""
    if channel[j] < 3:
        return False
    if math.isnan(direction[j, 0]):
        for i in range(3):
            shown[i] = 1.0 if channel[j] == 3 + i else 0.0
        return True
    for i in range(3):
        shown[i] = direction[j, i]
    return bool(shown[0] != 0.0 or shown[1] != 0.0 or shown[2] != 0.0)


@kernel()
def standstill_model(
    kind: int,
    velocity: Array,
    rotation: Array,
    body_rate: Array,
    channel: Integers,
    direction: Array,
    residual: Array,
    design: Array,
) -> None:
    """Write residual (3,) and H (3, n) of zero velocity (kind 3) or zero rate (kind 4), in NED.

    `body_rate` (3,): of the body against the earth, in the body frame, rad/s, from the mean of
    the gyros. Only its down component should be used: gravity shows the tilt, and with it the
    same gyro noise a second time.
    """
    design[:, :] = 0.0
    if kind == 3:
        for i in range(3):
            residual[i] = velocity[i]
            design[i, 3 + i] = 1.0
        return
    shown = np.zeros(3)
    for i in range(3):
        residual[i] = (
            rotation[i, 0] * body_rate[0]
            + rotation[i, 1] * body_rate[1]
            + rotation[i, 2] * body_rate[2]
        )
    # -psi x C w
    design[0, 7], design[0, 8] = -residual[2], residual[1]
    design[1, 6], design[1, 8] = residual[2], -residual[0]
    design[2, 6], design[2, 7] = -residual[1], residual[0]
    for j in range(channel.size):
        if gyro_direction(j, channel, direction, shown):
            for i in range(3):
                design[i, 9 + j] = (
                    rotation[i, 0] * shown[0]
                    + rotation[i, 1] * shown[1]
                    + rotation[i, 2] * shown[2]
                )


@kernel()
def vehicle_velocity_model(
    value: Array,
    velocity: Array,
    rotation: Array,
    body_rate: Array,
    rate_variance: Array,
    acceleration: Array,
    channel: Integers,
    direction: Array,
    sensor_state: Array,
    first: int,
    nominal: Array,
    residual: Array,
    design: Array,
    by_rate: Array,
) -> None:
    """Write residual (3,) and design matrix H (3, n) of the velocity in vehicle axes.

    Parameters are the state, `body_rate` (3,) with the variance of its noise (an axis that turns
    by less than three standard deviations is taken not to turn: noise that passes for turning
    would shorten the estimated arms), `acceleration` (3,) over ground, rad/s and m/s² in the body
    frame (the latter taken as measured: only the tilt that takes gravity out of
    it counts as wrong), and `nominal` (3, 3), M_0. From place `first` on, `sensor_state` holds mu
    (3, rad), l (3, m), s (s²/m) and p (rad s²/m). `value` (3,): the measured velocity, of which a
    vehicle that only rolls gives right and down, zero. `by_rate` (3, 3) receives the derivative
    of the residual by `body_rate`, through which the noise of the gyros shows.
    """
    design[:, :] = 0.0
    mount, jacobian = np.empty((3, 3)), np.empty((3, 3))
    mounting_rotation(
        sensor_state[first],
        sensor_state[first + 1],
        sensor_state[first + 2],
        nominal,
        mount,
        jacobian,
    )
    l0, l1, l2 = sensor_state[first + 3], sensor_state[first + 4], sensor_state[first + 5]
    slip, pitch = sensor_state[first + 6], sensor_state[first + 7]
    v0, v1, v2 = velocity[0], velocity[1], velocity[2]
    here, rate, force = np.empty(3), np.empty(3), np.empty(3)
    turning = np.empty(3)
    for c in range(3):
        sure = body_rate[c] * body_rate[c] > 9.0 * rate_variance[c]
        turning[c] = 1.0 if sure else 0.0
    w0, w1, w2 = body_rate[0] * turning[0], body_rate[1] * turning[1], body_rate[2] * turning[2]
    for i in range(3):
        m0, m1, m2 = mount[i, 0], mount[i, 1], mount[i, 2]
        t0 = m0 * rotation[0, 0] + m1 * rotation[0, 1] + m2 * rotation[0, 2]
        t1 = m0 * rotation[1, 0] + m1 * rotation[1, 1] + m2 * rotation[1, 2]
        t2 = m0 * rotation[2, 0] + m1 * rotation[2, 1] + m2 * rotation[2, 2]
        here[i] = t0 * v0 + t1 * v1 + t2 * v2
        rate[i] = m0 * w0 + m1 * w1 + m2 * w2
        force[i] = m0 * acceleration[0] + m1 * acceleration[1] + m2 * acceleration[2]
        design[i, 3], design[i, 4], design[i, 5] = t0, t1, t2
        # C' (I + [psi x]) v: M C' (psi x v)
        design[i, 6] = t2 * v1 - t1 * v2
        design[i, 7] = t0 * v2 - t2 * v0
        design[i, 8] = t1 * v0 - t0 * v1
    u = np.empty(3)
    u[0] = here[0] + rate[1] * l2 - rate[2] * l1
    u[1] = here[1] + rate[2] * l0 - rate[0] * l2
    u[2] = here[2] + rate[0] * l1 - rate[1] * l0
    # -[rate x] for l that is true minus estimated
    lever = 9 + first + 3
    design[0, lever + 1], design[0, lever + 2] = rate[2], -rate[1]
    design[1, lever], design[1, lever + 2] = -rate[2], rate[0]
    design[2, lever], design[2, lever + 1] = rate[1], -rate[0]
    by_slip, by_pitch = 2.0 * slip * rate[2] * u[0], pitch * force[0]
    for k in range(design.shape[1]):
        design[1, k] += by_slip * design[0, k]
        design[2, k] += by_pitch * design[0, k]
    # the rate of the body about axis c: M w, then x l, and the slip in a curve
    for c in range(3):
        m0, m1, m2 = mount[0, c] * turning[c], mount[1, c] * turning[c], mount[2, c] * turning[c]
        ahead = m1 * l2 - m2 * l1
        by_rate[0, c] = ahead
        by_rate[1, c] = m2 * l0 - m0 * l2 + slip * u[0] * u[0] * m2 + by_slip * ahead
        by_rate[2, c] = m0 * l1 - m1 * l0 + by_pitch * ahead
    shown = np.zeros(3)
    for j in range(channel.size):
        if gyro_direction(j, channel, direction, shown):
            for i in range(3):
                design[i, 9 + j] = (
                    by_rate[i, 0] * shown[0] + by_rate[i, 1] * shown[1] + by_rate[i, 2] * shown[2]
                )
    # gravity that a tilt leaves in the acceleration: M C' (psi x g), forward
    leak = pitch * u[0] * 9.8
    design[2, 6] -= leak * design[0, 4]
    design[2, 7] += leak * design[0, 3]
    # a turn phi of M on its left adds phi x here + (phi x rate) x l, phi x rate and phi x force
    curve, brake = slip * u[0] * u[0], pitch * u[0]
    along = rate[0] * l0 + rate[1] * l1 + rate[2] * l2
    turned = np.empty((3, 3))
    for i in range(3):
        turned[i, 0], turned[i, 1], turned[i, 2] = rate[i] * l0, rate[i] * l1, rate[i] * l2
        turned[i, i] -= along
    turned[0, 1] += here[2]
    turned[0, 2] -= here[1]
    turned[1, 0] -= here[2]
    turned[1, 2] += here[0]
    turned[2, 0] += here[1]
    turned[2, 1] -= here[0]
    for k in range(3):
        turned[1, k] += by_slip * turned[0, k]
        turned[2, k] += by_pitch * turned[0, k]
    turned[1, 0] += curve * rate[1]
    turned[1, 1] -= curve * rate[0]
    turned[2, 1] += brake * force[2]
    turned[2, 2] -= brake * force[1]
    for i in range(3):
        for k in range(3):
            total = 0.0
            for c in range(3):
                total += turned[i, c] * jacobian[c, k]
            design[i, 9 + first + k] = -total
    side, ahead = rate[2] * u[0] * u[0], force[0] * u[0]
    design[1, 9 + first + 6] = -side
    design[2, 9 + first + 7] = -ahead
    residual[0] = u[0] - value[0]
    residual[1] = u[1] + slip * side - value[1]
    residual[2] = u[2] + pitch * ahead - value[2]
