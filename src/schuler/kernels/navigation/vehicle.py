"""What a wheeled vehicle tells: it moves along its forward axis, and sometimes not at all.

The kinds of measurement that follow those of kernels/navigation/update.py:

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

from schuler.kernels.compile import kernel
from schuler.kernels.navigation.filter_data import (
    FilterState,
    Measurement,
    Rules,
    SensorModel,
    VehicleWork,
    Work,
)
from schuler.kernels.navigation.update import clear
from schuler.kernels.types import FloatArray, IntArray


@kernel(inline=True)
def mounting_rotation(
    a: float, b: float, c: float, nominal: FloatArray, rotation: FloatArray, jacobian: FloatArray
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
def gyro_direction(j: int, channel: IntArray, direction: FloatArray, shown: FloatArray) -> bool:
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
def zero_velocity_model(state: FilterState, z: Measurement) -> None:
    """Write residual and H of zero velocity, in NED."""
    clear(z.design)
    for i in range(3):
        z.residual[i] = state.velocity[i]
        z.design[i, 3 + i] = 1.0


@kernel()
def zero_rate_model(state: FilterState, model: SensorModel, work: Work, z: Measurement) -> None:
    """Write residual and H of a zero rate of turn, in NED.

    The rate of the body is the mean of the gyros. Only its down component should be used: gravity
    shows the tilt, and with it the same gyro noise a second time.
    """
    design, residual, rotation, shown = z.design, z.residual, state.rotation, work.vehicle.shown
    clear(design)
    for i in range(3):
        residual[i] = (
            rotation[i, 0] * z.body_rate[0]
            + rotation[i, 1] * z.body_rate[1]
            + rotation[i, 2] * z.body_rate[2]
        )
    # -psi x C w
    design[0, 7], design[0, 8] = -residual[2], residual[1]
    design[1, 6], design[1, 8] = residual[2], -residual[0]
    design[2, 6], design[2, 7] = -residual[1], residual[0]
    for j in range(model.channel.size):
        if gyro_direction(j, model.channel, work.shown, shown):
            for i in range(3):
                design[i, 9 + j] = (
                    rotation[i, 0] * shown[0]
                    + rotation[i, 1] * shown[1]
                    + rotation[i, 2] * shown[2]
                )


@kernel()
def look_from_vehicle(state: FilterState, rules: Rules, v: VehicleWork, design: FloatArray) -> None:
    """Write what vehicle axes see of the motion, and how velocity and attitude show in it."""
    rotation, velocity, acceleration = state.rotation, state.velocity, v.acceleration
    first = rules.vehicle
    mounting_rotation(
        state.sensor[first],
        state.sensor[first + 1],
        state.sensor[first + 2],
        rules.mounting,
        v.mount,
        v.jacobian,
    )
    v0, v1, v2 = velocity[0], velocity[1], velocity[2]
    for c in range(3):
        sure = v.rate[c] * v.rate[c] > 9.0 * v.rate_variance[c]
        v.turning[c] = 1.0 if sure else 0.0
    w0, w1, w2 = v.rate[0] * v.turning[0], v.rate[1] * v.turning[1], v.rate[2] * v.turning[2]
    for i in range(3):
        m0, m1, m2 = v.mount[i, 0], v.mount[i, 1], v.mount[i, 2]
        t0 = m0 * rotation[0, 0] + m1 * rotation[0, 1] + m2 * rotation[0, 2]
        t1 = m0 * rotation[1, 0] + m1 * rotation[1, 1] + m2 * rotation[1, 2]
        t2 = m0 * rotation[2, 0] + m1 * rotation[2, 1] + m2 * rotation[2, 2]
        v.here[i] = t0 * v0 + t1 * v1 + t2 * v2
        v.turn[i] = m0 * w0 + m1 * w1 + m2 * w2
        v.force[i] = m0 * acceleration[0] + m1 * acceleration[1] + m2 * acceleration[2]
        design[i, 3], design[i, 4], design[i, 5] = t0, t1, t2
        # C' (I + [psi x]) v: M C' (psi x v)
        design[i, 6] = t2 * v1 - t1 * v2
        design[i, 7] = t0 * v2 - t2 * v0
        design[i, 8] = t1 * v0 - t0 * v1
    l0, l1, l2 = state.sensor[first + 3], state.sensor[first + 4], state.sensor[first + 5]
    v.u[0] = v.here[0] + v.turn[1] * l2 - v.turn[2] * l1
    v.u[1] = v.here[1] + v.turn[2] * l0 - v.turn[0] * l2
    v.u[2] = v.here[2] + v.turn[0] * l1 - v.turn[1] * l0
    slip, pitch = state.sensor[first + 6], state.sensor[first + 7]
    v.by_slip[0], v.by_pitch[0] = 2.0 * slip * v.turn[2] * v.u[0], pitch * v.force[0]


@kernel()
def lever_design(first: int, v: VehicleWork, design: FloatArray) -> None:
    """Write how the point that does not slip shows, then slip and pitch in what is across."""
    turn = v.turn
    # -[turn x] for l that is true minus estimated
    lever = 9 + first + 3
    design[0, lever + 1], design[0, lever + 2] = turn[2], -turn[1]
    design[1, lever], design[1, lever + 2] = -turn[2], turn[0]
    design[2, lever], design[2, lever + 1] = turn[1], -turn[0]
    by_slip, by_pitch = v.by_slip[0], v.by_pitch[0]
    for k in range(design.shape[1]):
        design[1, k] += by_slip * design[0, k]
        design[2, k] += by_pitch * design[0, k]


@kernel()
def rate_design(
    state: FilterState, model: SensorModel, rules: Rules, work: Work, design: FloatArray
) -> None:
    """Write how the rate of the body shows, and through it the states of the gyros."""
    v, first = work.vehicle, rules.vehicle
    l0, l1, l2 = state.sensor[first + 3], state.sensor[first + 4], state.sensor[first + 5]
    slip, u, by_rate, shown = state.sensor[first + 6], v.u, v.by_rate, v.shown
    # about axis c: M w, then x l, and the slip in a curve
    for c in range(3):
        m0, m1, m2 = (
            v.mount[0, c] * v.turning[c],
            v.mount[1, c] * v.turning[c],
            v.mount[2, c] * v.turning[c],
        )
        ahead = m1 * l2 - m2 * l1
        by_rate[0, c] = ahead
        by_rate[1, c] = m2 * l0 - m0 * l2 + slip * u[0] * u[0] * m2 + v.by_slip[0] * ahead
        by_rate[2, c] = m0 * l1 - m1 * l0 + v.by_pitch[0] * ahead
    for j in range(model.channel.size):
        if gyro_direction(j, model.channel, work.shown, shown):
            for i in range(3):
                design[i, 9 + j] = (
                    by_rate[i, 0] * shown[0] + by_rate[i, 1] * shown[1] + by_rate[i, 2] * shown[2]
                )


@kernel()
def mounting_design(state: FilterState, first: int, v: VehicleWork, design: FloatArray) -> None:
    """Write how the mounting shows.

    A turn phi of M on its left adds phi x here + (phi x turn) x l, phi x turn and phi x force.
    """
    here, turn, force, u, turned = v.here, v.turn, v.force, v.u, v.turned
    l0, l1, l2 = state.sensor[first + 3], state.sensor[first + 4], state.sensor[first + 5]
    slip, pitch = state.sensor[first + 6], state.sensor[first + 7]
    curve, brake = slip * u[0] * u[0], pitch * u[0]
    along = turn[0] * l0 + turn[1] * l1 + turn[2] * l2
    for i in range(3):
        turned[i, 0], turned[i, 1], turned[i, 2] = turn[i] * l0, turn[i] * l1, turn[i] * l2
        turned[i, i] -= along
    turned[0, 1] += here[2]
    turned[0, 2] -= here[1]
    turned[1, 0] -= here[2]
    turned[1, 2] += here[0]
    turned[2, 0] += here[1]
    turned[2, 1] -= here[0]
    for k in range(3):
        turned[1, k] += v.by_slip[0] * turned[0, k]
        turned[2, k] += v.by_pitch[0] * turned[0, k]
    turned[1, 0] += curve * turn[1]
    turned[1, 1] -= curve * turn[0]
    turned[2, 1] += brake * force[2]
    turned[2, 2] -= brake * force[1]
    for i in range(3):
        for k in range(3):
            total = 0.0
            for c in range(3):
                total += turned[i, c] * v.jacobian[c, k]
            design[i, 9 + first + k] = -total


@kernel()
def vehicle_velocity_model(
    state: FilterState, model: SensorModel, rules: Rules, work: Work, z: Measurement
) -> None:
    """Write residual and H of the velocity in vehicle axes.

    From place `rules.vehicle` on the sensor states hold mu (3, rad), l (3, m), s (s²/m) and p
    (rad s²/m). The value is the measured velocity, of which a vehicle that only rolls gives right
    and down, zero. Of `work.vehicle` rate (3,), rate_variance (3,) and acceleration (3,) over
    ground, in the body frame, are given: an axis that turns by less than three standard
    deviations is taken not to turn, as noise that passes for turning would shorten the estimated
    arms; the acceleration is taken as measured, only the tilt that takes gravity out of it counts
    as wrong. by_rate (3, 3) is left there, through which the noise of the gyros shows.
    """
    first, v, design, residual = rules.vehicle, work.vehicle, z.design, z.residual
    clear(design)
    look_from_vehicle(state, rules, v, design)
    lever_design(first, v, design)
    rate_design(state, model, rules, work, design)
    slip, pitch = state.sensor[first + 6], state.sensor[first + 7]
    u = v.u
    # gravity that a tilt leaves in the acceleration: M C' (psi x g), forward
    leak = pitch * u[0] * 9.8
    design[2, 6] -= leak * design[0, 4]
    design[2, 7] += leak * design[0, 3]
    mounting_design(state, first, v, design)
    side, ahead = v.turn[2] * u[0] * u[0], v.force[0] * u[0]
    design[1, 9 + first + 6] = -side
    design[2, 9 + first + 7] = -ahead
    residual[0] = u[0] - z.value[0]
    residual[1] = u[1] + slip * side - z.value[1]
    residual[2] = u[2] + pitch * ahead - z.value[2]
