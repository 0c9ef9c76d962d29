"""The closed-loop error-state Kalman filter over a whole recording. Spec 7.1 to 7.3.

One pass over the IMU samples; an aiding measurement that falls inside a sample splits it. The
same step functions serve a streaming filter.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.compile import kernel
from schuler.kernels.covariance import propagate_covariance
from schuler.kernels.geodesy import radii_of_curvature
from schuler.kernels.strapdown import rotation_from_quaternion, strapdown_step
from schuler.kernels.transition import (
    accumulate_transition,
    correct_sample,
    move_sensor_states,
    raise_blocks,
    reset_transition,
    scale_directions,
    sensor_transition,
    set_blocks,
)
from schuler.kernels.update import (
    add_offset_states,
    feed_back,
    innovation_statistics,
    linear_model,
    measurement_model,
    scalar_update,
)
from schuler.kernels.vehicle import standstill_model, vehicle_velocity_model

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@kernel(inline=True)
def constraint_applies(
    kind: int, velocity: Array, covariance: Array, rolling: float, standing: float
) -> bool:
    """Whether the vehicle moves as a constraint supposes, by the filter's own speed.

    A vehicle that only rolls (kind 2) must be faster than `rolling`. One that was taken for
    standing (kinds 3, 4) must be slower than `standing` within three standard deviations, of
    which no more than 1 m/s each is granted: a smooth road feels like no road. Other kinds always
    apply.
    """
    speed = math.sqrt(velocity[0] ** 2 + velocity[1] ** 2)
    if kind == 2:
        return speed > rolling
    if kind > 4:
        return True
    sd = math.sqrt(max(covariance[3, 3] + covariance[4, 4], 0.0))
    return speed < standing + 3.0 * min(sd, 1.0)


@kernel()
def run_filter(
    time: Array,
    gyro: Array,
    accel: Array,
    position: Array,
    velocity: Array,
    quaternion: Array,
    sensor_state: Array,
    covariance: Array,
    channel: Integers,
    direction: Array,
    scaled_by: Integers,
    block: Integers,
    interval: Array,
    drift: Array,
    diffusion: Array,
    white: Array,
    white_scale: Array,
    aid_time: Array,
    aid_kind: Integers,
    aid_value: Array,
    aid_variance: Array,
    aid_lever: Array,
    aid_offset: Integers,
    aid_matrix: Integers,
    matrices: Array,
    gate: Array,
    patience: int,
    longest_step: float,
    out_position: Array,
    out_velocity: Array,
    out_rotation: Array,
    out_position_covariance: Array,
    out_velocity_sd: Array,
    out_attitude_sd: Array,
    aid_residual: Array,
    aid_deviation: Array,
    aid_nis: Array,
    aid_degrees: Integers,
    aid_accepted: NDArray[np.bool_],
    node_interval: float,
    node_time: Array,
    node_sensor: Array,
    node_sensor_sd: Array,
    node_covariance: Array,
    node_top: Array,
    node_transition: Array,
    node_error: Array,
    node_aid: Integers,
    aid_row: Array,
    aid_gain: Array,
    aid_scalar: Array,
    vehicle: int,
    mounting: Array,
    rolling: float,
    standing: float,
) -> tuple[float, int, int]:
    """Run the filter; the state arrays end as the final state.

    Sizes: n samples, m sensor states, s = 9 + m, u aiding measurements (sorted by time), k
    nodes. Per sample outputs have n rows (or none, then nothing is written). Nodes are made at
    every aiding time and at least every `node_interval`; with node_covariance of k rows
    (k, s, s) all that the smoother needs is kept: node_top (k, 9, s) and node_transition
    (k, m, w) from the node before, node_error (k, s) the correction fed back there, node_aid
    (k, 2) the range of measurements used there, aid_row and aid_gain (u, 3, s). aid_scalar
    (u, 3, 2), always written: innovation and its variance of every component that was used.

    The sensor states and their blocks: see kernels/transition.py. white (2, 3, 3): covariance
    densities of the accelerometers and of the gyros; white_scale (n, 6) or (0, 6) multiplies the
    variances sample by sample, accelerometers first. aid_offset (u, 3), aid_matrix (u,) and
    matrices (t, 3, m): see kernels/update.py. gate (4,): largest normalised innovation squared
    accepted for 0 to 3 degrees of freedom; after `patience` refusals in a row of one kind the
    next one is let in, as measurements that keep agreeing with each other are right and the
    filter is wrong: its own variance is first raised by the square of the residual. Constraints
    of the vehicle and linear measurements (kinds above 1) are never forced in.

    vehicle: place of the vehicle's states among the sensor states (-1: none), mounting (3, 3) the
    nominal one, see kernels/vehicle.py; rolling and standing: see `constraint_applies`. A zero
    rate has the mean of the gyros in its value.

    Returns the log-likelihood of the accepted measurements, the number of nodes, and the index
    of the first sample at which the state was no longer finite (-1: none).
    """
    n = time.size
    m = sensor_state.size
    size = 9 + m
    updates = aid_time.size
    widest = drift.shape[1]
    keep_samples = out_position.shape[0] > 0
    keep_nodes = node_covariance.shape[0] > 0
    scaled = white_scale.shape[0] > 0
    discrete, modulated = False, False
    for j in range(m):
        discrete = discrete or interval[j] > 0.0
        modulated = modulated or scaled_by[j] >= 0
    shown = direction.copy() if modulated else direction

    rotation = np.empty((3, 3))
    rotation_from_quaternion(quaternion, rotation)
    earth = np.zeros(10)
    transport = np.zeros(3)
    body_rate = np.zeros(3)
    angle, velocity_increment = np.zeros(3), np.zeros(3)
    previous_angle, previous_velocity = np.zeros(3), np.zeros(3)
    part_angle, part_velocity = np.zeros(3), np.zeros(3)
    # 264 places a row: see navigation_rows
    rows, errors = np.zeros(max(9, widest) * 264), np.zeros(6 * 264)
    top, block_top = np.zeros(9 * 264), np.zeros(9 * 264)
    transition, noise = np.zeros((m, widest)), np.zeros((m, widest))
    power, power_noise = np.zeros((m, widest)), np.zeros((m, widest))
    steps, moving, moved = np.zeros(m, np.int64), False, False
    total_top, total_sensor = np.zeros(9 * 264), np.zeros((m, widest))
    reset_transition(total_top, total_sensor, block)
    state_work = np.empty(m)
    residual, deviation = np.empty(3), np.empty(3)
    design = np.empty((3, size))
    error, gain = np.empty(size), np.empty(size)
    noise_now, root = white.copy(), np.ones(6)
    likelihood = 0.0
    discretised = -1.0
    refused = np.zeros(6, np.int64)
    force, turn, acceleration = np.zeros(3), np.zeros(3), np.zeros(3)
    turn_variance, blend, turn_noise = np.zeros(3), 1.0, 1.0
    by_rate, noise_variance = np.zeros((3, 3)), np.zeros(3)
    done = 0
    nodes = -1

    for k in range(n):
        end = time[k]
        if k == 0:
            now = end
            step = time[1] - time[0]
        else:
            now = time[k - 1]
            step = end - now
        if modulated:
            scale_directions(gyro[k], accel[k], scaled_by, direction, shown)
        if discrete and raise_blocks(
            step, drift, diffusion, block, interval, steps, power, power_noise
        ):
            moved = False
            set_blocks(moved, block, interval, power, power_noise, transition, noise)
        correct_sample(
            gyro[k], accel[k], step, sensor_state, channel, shown, angle, velocity_increment
        )
        if scaled:
            for i in range(6):
                root[i] = math.sqrt(white_scale[k, i])
            for part in range(2):
                for i in range(3):
                    for c in range(3):
                        both = root[3 * part + i] * root[3 * part + c]
                        noise_now[part, i, c] = white[part, i, c] * both
        if k == 0:
            previous_angle[:] = angle
            previous_velocity[:] = velocity_increment

        while True:
            aiding = done < updates and aid_time[done] <= end
            target = aid_time[done] if aiding else end
            # advance to the target in steps no longer than allowed
            span = target - now
            if span > 1e-9 * step and k > 0:
                pieces = math.ceil(span / longest_step - 1e-6)
                pieces = max(pieces, 1)
                dt = span / pieces
                share = dt / step
                for i in range(3):
                    part_angle[i] = angle[i] * share
                    part_velocity[i] = velocity_increment[i] * share
                if abs(dt - discretised) > 1e-4 * dt:
                    sensor_transition(dt, drift, diffusion, block, interval, transition, noise)
                    discretised = dt
                # in full here: a function of these 26 arrays would cost a fifth of the time
                for piece in range(pieces):
                    if discrete:
                        moving = piece == pieces - 1 and end - target <= 1e-9 * step
                        if moving != moved:
                            set_blocks(
                                moving, block, interval, power, power_noise, transition, noise
                            )
                            moved = moving
                    sine = math.sin(position[0])
                    meridian, transverse = radii_of_curvature(sine)
                    transport[0] = 1.0 / (transverse + position[2])
                    transport[1] = -1.0 / (meridian + position[2])
                    transport[2] = -sine / math.sqrt(1.0 - sine * sine) * transport[0]
                    strapdown_step(
                        dt,
                        part_angle,
                        part_velocity,
                        previous_angle,
                        previous_velocity,
                        position,
                        velocity,
                        quaternion,
                        rotation,
                        earth,
                    )
                    propagate_covariance(
                        covariance,
                        dt,
                        rotation,
                        earth,
                        transport,
                        channel,
                        shown,
                        block,
                        transition,
                        noise,
                        noise_now,
                        rows,
                        errors,
                        top,
                        block_top,
                    )
                    if keep_nodes:
                        accumulate_transition(
                            total_top,
                            total_sensor,
                            dt,
                            rotation,
                            earth,
                            transport,
                            channel,
                            shown,
                            block,
                            transition,
                            errors,
                            top,
                        )
                    move_sensor_states(sensor_state, block, transition, state_work)
                now = target
            if not aiding and not (k == 0 or k == n - 1 or now - node_time[nodes] >= node_interval):
                break

            if nodes < 0 or now > node_time[nodes] + 1e-9:
                nodes += 1
                node_time[nodes] = now
                if keep_nodes:
                    for i in range(9):
                        for j in range(size):
                            node_top[nodes, i, j] = total_top[i * 264 + j]
                    node_transition[nodes] = total_sensor
                    reset_transition(total_top, total_sensor, block)
                    node_error[nodes] = 0.0
                    node_aid[nodes, 0] = done
                    node_aid[nodes, 1] = done
            if aiding:
                for i in range(3):
                    rate = angle[i] / step
                    for c in range(3):
                        rate -= rotation[c, i] * earth[3 + c]
                    body_rate[i] = rate
                kind = aid_kind[done]
                for i in range(3):
                    noise_variance[i] = aid_variance[done, i]
                if kind < 2:
                    measurement_model(
                        aid_kind[done],
                        aid_value[done],
                        aid_lever[done],
                        position,
                        velocity,
                        rotation,
                        body_rate,
                        channel,
                        shown,
                        residual,
                        design,
                    )
                elif kind == 2:
                    for i in range(3):
                        acceleration[i] = force[i] + 9.8 * rotation[2, i]
                        body_rate[i] = turn[i] + blend * (body_rate[i] - turn[i])
                        turn_variance[i] = turn_noise * noise_now[1, i, i]
                    vehicle_velocity_model(
                        aid_value[done],
                        velocity,
                        rotation,
                        body_rate,
                        turn_variance,
                        acceleration,
                        channel,
                        shown,
                        sensor_state,
                        vehicle,
                        mounting,
                        residual,
                        design,
                        by_rate,
                    )
                    for i in range(3):
                        for c in range(3):
                            noise_variance[i] += by_rate[i, c] ** 2 * turn_variance[c]
                elif kind < 5:
                    if kind == 4:
                        correct_sample(
                            aid_value[done],
                            accel[k],
                            1.0,
                            sensor_state,
                            channel,
                            shown,
                            body_rate,
                            part_velocity,
                        )
                        for i in range(3):
                            for c in range(3):
                                body_rate[i] -= rotation[c, i] * earth[3 + c]
                    standstill_model(
                        kind,
                        velocity,
                        rotation,
                        body_rate,
                        channel,
                        shown,
                        residual,
                        design,
                    )
                else:
                    linear_model(
                        aid_value[done],
                        matrices[aid_matrix[done]],
                        sensor_state,
                        residual,
                        design,
                    )
                add_offset_states(aid_offset[done], sensor_state, residual, design)
                nis, log_determinant, degrees = innovation_statistics(
                    residual, design, noise_variance, covariance, deviation
                )
                if kind > 1 and not constraint_applies(
                    kind, velocity, covariance, rolling, standing
                ):
                    nis, degrees = 0.0, 0
                aid_nis[done] = nis
                aid_degrees[done] = degrees
                accepted = degrees > 0 and nis <= gate[degrees]
                if degrees > 0 and not accepted and refused[kind] >= patience and kind < 2:
                    # the state is wrong by that much: say so before it is corrected, or the
                    # correction would be spread over states that are right
                    accepted = True
                    for i in range(3):
                        if math.isfinite(aid_variance[done, i]):
                            covariance[3 * kind + i, 3 * kind + i] += residual[i] * residual[i]
                refused[kind] = 0 if accepted else refused[kind] + 1
                aid_accepted[done] = accepted
                for i in range(3):
                    used = math.isfinite(aid_variance[done, i])
                    aid_residual[done, i] = residual[i] if used else math.nan
                    aid_deviation[done, i] = deviation[i]
                if accepted:
                    likelihood -= 0.5 * (nis + log_determinant + degrees * math.log(2.0 * math.pi))
                    error[:] = 0.0
                    for i in range(3):
                        if not math.isfinite(aid_variance[done, i]):
                            continue
                        innovation = residual[i]
                        for j in range(size):
                            innovation -= design[i, j] * error[j]
                        s = scalar_update(
                            innovation, design[i], noise_variance[i], covariance, error, gain
                        )
                        aid_scalar[done, i, 0] = innovation
                        aid_scalar[done, i, 1] = s
                        if keep_nodes:
                            aid_row[done, i] = design[i]
                            aid_gain[done, i] = gain
                    feed_back(error, position, velocity, quaternion, rotation, sensor_state)
                    if keep_nodes:
                        node_error[nodes] += error
                    correct_sample(
                        gyro[k],
                        accel[k],
                        step,
                        sensor_state,
                        channel,
                        shown,
                        angle,
                        velocity_increment,
                    )
                done += 1
                if keep_nodes:
                    node_aid[nodes, 1] = done
            node_sensor[nodes] = sensor_state
            for j in range(m):
                node_sensor_sd[nodes, j] = math.sqrt(max(covariance[9 + j, 9 + j], 0.0))
            if keep_nodes:
                node_covariance[nodes] = covariance
            if not aiding:
                break

        if vehicle >= 0:
            # the springs of a vehicle answer within a fraction of a second; single samples of the
            # gyros are mostly noise
            share = min(step / 0.2, 1.0) if k > 0 else 1.0
            blend = min(step / 0.1, 1.0) if k > 0 else 1.0
            turn_noise = blend / ((2.0 - blend) * step)
            for i in range(3):
                force[i] += share * (velocity_increment[i] / step - force[i])
                rate = angle[i] / step
                for c in range(3):
                    rate -= rotation[c, i] * earth[3 + c]
                turn[i] += blend * (rate - turn[i])
        previous_angle[:] = angle
        previous_velocity[:] = velocity_increment
        if not math.isfinite(position[0] + position[2] + velocity[2] + covariance[6, 6]):
            return likelihood, nodes + 1, k
        if keep_samples:
            for i in range(3):
                out_position[k, i] = position[i]
                out_velocity[k, i] = velocity[i]
                out_velocity_sd[k, i] = math.sqrt(max(covariance[3 + i, 3 + i], 0.0))
                out_attitude_sd[k, i] = math.sqrt(max(covariance[6 + i, 6 + i], 0.0))
                for j in range(3):
                    out_rotation[k, i, j] = rotation[i, j]
                    out_position_covariance[k, i, j] = covariance[i, j]
    return likelihood, nodes + 1, -1
