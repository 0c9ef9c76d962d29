"""The closed-loop error-state Kalman filter over a stretch of samples. Spec 7.1 to 7.3.

One pass over the IMU samples; an aiding measurement that falls inside a sample splits it. What
the filter remembers lies in one array (kernels/memory.py), so that a stretch may be a whole
recording, one sample of a stream, or a part that is run once more.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.aiding import aiding_model, constraint_applies
from schuler.kernels.compile import kernel
from schuler.kernels.covariance import propagate_covariance
from schuler.kernels.geodesy import radii_of_curvature
from schuler.kernels.memory import carve_navigation, carve_sensors, carve_total
from schuler.kernels.robust import adapt_noise, robust_weight, scale_noise
from schuler.kernels.strapdown import coning_and_sculling, remember_sample, strapdown_step
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
from schuler.kernels.update import feed_back, innovation_statistics, scalar_update

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@kernel()
def run_filter(
    memory: Array,
    counters: Integers,
    scratch: Array,
    time: Array,
    gyro: Array,
    accel: Array,
    white_scale: Array,
    closing: bool,
    out_first: int,
    channel: Integers,
    direction: Array,
    scaled_by: Integers,
    block: Integers,
    interval: Array,
    drift: Array,
    diffusion: Array,
    white: Array,
    updates: int,
    aid_time: Array,
    aid_kind: Integers,
    aid_value: Array,
    aid_variance: Array,
    aid_lever: Array,
    aid_offset: Integers,
    aid_matrix: Integers,
    matrices: Array,
    gate: Array,
    robustness: Array,
    patience: int,
    longest_step: float,
    vehicle: int,
    mounting: Array,
    rolling: float,
    standing: float,
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
    aid_scalar: Array,
    aid_row: Array,
    aid_gain: Array,
    node_interval: float,
    node_time: Array,
    node_sensor: Array,
    node_sensor_sd: Array,
    node_covariance: Array,
    node_top: Array,
    node_transition: Array,
    node_error: Array,
    node_aid: Integers,
) -> int:
    """Run the filter over n samples, from what `memory` and `counters` hold and into them.

    Sizes: n samples, m sensor states in blocks of at most w, s = 9 + m; `scratch` is work without
    memory. The first stretch of a run needs two samples, as the first one only tells the start.
    Per sample outputs are written from row `out_first` on, or not at all if they have no rows.

    Aiding measurements, sorted by time: `updates` of them so far, number u in row u modulo the
    rows there are, so that a stream may keep the latest only; the same holds for what is written
    about them, and for nodes. aid_scalar (.., 3, 2): innovation and its variance of every
    component that was used. aid_offset, aid_matrix and matrices: see kernels/update.py.

    Nodes are made at every aiding time and at least every `node_interval`, at the first sample
    and, if `closing`, at the last. With rows in node_covariance (.., s, s) all that the smoother
    needs is kept: node_top (.., 9, s) and node_transition (.., m, w) from the node before,
    node_error (.., s) the correction fed back there, node_aid (.., 2) the range of measurements
    used there, aid_row and aid_gain (.., 3, s). The memory has to accumulate the transition then.

    The sensor states and their blocks: see kernels/transition.py. white (2, 3, 3): covariance
    densities of the accelerometers and of the gyros; white_scale (n, 6) or (0, 6) multiplies the
    variances sample by sample, accelerometers first. gate (4,): largest normalised innovation
    squared accepted for 0 to 3 degrees of freedom; after `patience` refusals in a row of one kind
    the next one is let in, as measurements that keep agreeing with each other are right and the
    filter is wrong: its own variance is first raised by the square of the residual. Constraints
    of the vehicle and linear measurements (kinds above 1) are never forced in. robustness (9,):
    how GNSS is weighted and its noise adapted, see kernels/robust.py.

    vehicle: place of the vehicle's states among the sensor states (-1: none), mounting (3, 3) the
    nominal one, see kernels/vehicle.py; rolling and standing: see `constraint_applies`. A zero
    rate has the mean of the gyros in its value.

    Returns the sample of the stretch at which the state was no longer finite, or -1.
    """
    n = time.size
    m = channel.size
    size = 9 + m
    widest = drift.shape[1]
    keep_samples = out_position.shape[0] > 0
    keep_nodes = node_covariance.shape[0] > 0
    scaled = white_scale.shape[0] > 0
    discrete, modulated = False, False
    for j in range(m):
        discrete = discrete or interval[j] > 0.0
        modulated = modulated or scaled_by[j] >= 0
    aid_places, node_places = max(aid_time.size, 1), node_time.size
    aid_kept, node_kept = max(aid_row.shape[0], 1), max(node_covariance.shape[0], 1)

    (
        position,
        velocity,
        quaternion,
        rotation,
        earth,
        transport,
        angle,
        velocity_increment,
        coning,
        sculling,
        past,
        habits,
    ) = carve_navigation(memory)
    sensor_state, transition, noise, power, power_noise, covariance = carve_sensors(
        memory, m, widest
    )
    total_top, total_sensor = carve_total(memory, m, widest)
    accumulating = total_top.size > 0
    refused, steps = counters[4:20], counters[20:]
    done, nodes, moved = counters[1], counters[2] - 1, counters[3] > 0
    discretised, likelihood, last, step_before = habits[8], habits[9], habits[10], habits[11]
    adapted = memory[76:80]

    # 264 places a row: see navigation_rows
    a, b = 0, max(9, widest) * 264
    rows, errors = scratch[a:b], scratch[b : b + 6 * 264]
    a = b + 6 * 264
    top, block_top = scratch[a : a + 9 * 264], scratch[a + 9 * 264 : a + 18 * 264]
    a += 18 * 264
    state_work, error, gain = scratch[a : a + m], scratch[a + m :][:size], scratch[a + m + size :]
    gain = gain[:size]
    a += m + 2 * size
    design = scratch[a : a + 3 * size].reshape((3, size))
    a += 3 * size
    shown = direction
    if modulated:
        shown = scratch[a : a + 3 * m].reshape((m, 3))
        shown[:, :] = direction
    a += 3 * m
    part_angle, part_velocity = scratch[a : a + 3], scratch[a + 3 : a + 6]
    part_coning, part_sculling = scratch[a + 6 : a + 9], scratch[a + 9 : a + 12]
    residual, deviation = scratch[a + 12 : a + 15], scratch[a + 15 : a + 18]
    noise_variance, root = scratch[a + 18 : a + 21], scratch[a + 21 : a + 27]
    noise_now = scratch[a + 27 : a + 45].reshape((2, 3, 3))
    noise_now[:, :, :] = white
    moving = False

    for k in range(n):
        end = time[k]
        first = counters[0] == 0
        if first:
            now = end
            step = time[1] - time[0]
            step_before = step
        else:
            now = last
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
        # nobody knows how rates changed in a gap
        smooth = step < 3.0 * step_before
        if first:
            for _ in range(3):
                remember_sample(angle, velocity_increment, step, past)
        if smooth:
            coning_and_sculling(angle, velocity_increment, past, step, coning, sculling)
        else:
            coning[:] = 0.0
            sculling[:] = 0.0
        if scaled:
            for i in range(6):
                root[i] = math.sqrt(white_scale[k, i])
            for part in range(2):
                for i in range(3):
                    for c in range(3):
                        both = root[3 * part + i] * root[3 * part + c]
                        noise_now[part, i, c] = white[part, i, c] * both

        while True:
            aiding = done < updates and aid_time[done % aid_places] <= end
            target = aid_time[done % aid_places] if aiding else end
            # advance to the target in steps no longer than allowed
            span = target - now
            if span > 1e-9 * step and not first:
                pieces = math.ceil(span / longest_step - 1e-6)
                pieces = max(pieces, 1)
                dt = span / pieces
                share = dt / step
                for i in range(3):
                    part_angle[i] = angle[i] * share
                    part_velocity[i] = velocity_increment[i] * share
                    part_coning[i] = coning[i] * share
                    part_sculling[i] = sculling[i] * share
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
                        part_coning,
                        part_sculling,
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
                    if accumulating:
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
            if not aiding:
                due = first or (closing and k == n - 1)
                if not due and now - node_time[nodes % node_places] < node_interval:
                    break

            if nodes < 0 or now > node_time[nodes % node_places] + 1e-9:
                nodes += 1
                node_time[nodes % node_places] = now
                if accumulating:
                    if keep_nodes:
                        place = nodes % node_kept
                        for i in range(9):
                            for j in range(size):
                                node_top[place, i, j] = total_top[i * 264 + j]
                        node_transition[place] = total_sensor
                        node_error[place] = 0.0
                        node_aid[place, 0] = done
                        node_aid[place, 1] = done
                    reset_transition(total_top, total_sensor, block)
            if aiding:
                u = done % aid_places
                kind = aid_kind[u]
                aiding_model(
                    kind,
                    aid_value[u],
                    aid_variance[u],
                    aid_lever[u],
                    aid_offset[u],
                    matrices[max(aid_matrix[u], 0)],
                    position,
                    velocity,
                    rotation,
                    earth,
                    angle,
                    accel[k],
                    step,
                    sensor_state,
                    channel,
                    shown,
                    noise_now,
                    habits,
                    vehicle,
                    mounting,
                    residual,
                    design,
                    noise_variance,
                )
                if kind < 2:
                    scale_noise(kind, robustness, adapted, noise_variance)
                nis, log_determinant, degrees = innovation_statistics(
                    residual, design, noise_variance, covariance, deviation
                )
                if kind > 1 and not constraint_applies(
                    kind, velocity, covariance, rolling, standing
                ):
                    nis, degrees = 0.0, 0
                aid_nis[u] = nis
                aid_degrees[u] = degrees
                accepted = degrees > 0 and nis <= gate[degrees]
                if degrees > 0 and not accepted and refused[kind] >= patience and kind < 2:
                    # the state is wrong by that much: say so before it is corrected, or the
                    # correction would be spread over states that are right
                    accepted = True
                    for i in range(3):
                        if math.isfinite(aid_variance[u, i]):
                            covariance[3 * kind + i, 3 * kind + i] += residual[i] * residual[i]
                refused[kind] = 0 if accepted else refused[kind] + 1
                if kind < 2 and degrees > 0 and robustness[0] > 0.0:
                    # nothing is refused: what is far off counts for little
                    accepted = True
                    weight = robust_weight(nis, degrees, robustness)
                    for i in range(3):
                        noise_variance[i] /= weight
                aid_accepted[u] = accepted
                for i in range(3):
                    used = math.isfinite(aid_variance[u, i])
                    aid_residual[u, i] = residual[i] if used else math.nan
                    aid_deviation[u, i] = deviation[i]
                    aid_scalar[u, i, 0] = 0.0
                    aid_scalar[u, i, 1] = 0.0
                if accepted:
                    likelihood -= 0.5 * (nis + log_determinant + degrees * math.log(2.0 * math.pi))
                    error[:] = 0.0
                    for i in range(3):
                        if not math.isfinite(aid_variance[u, i]):
                            continue
                        innovation = residual[i]
                        for j in range(size):
                            innovation -= design[i, j] * error[j]
                        s = scalar_update(
                            innovation, design[i], noise_variance[i], covariance, error, gain
                        )
                        aid_scalar[u, i, 0] = innovation
                        aid_scalar[u, i, 1] = s
                        if keep_nodes:
                            aid_row[done % aid_kept, i] = design[i]
                            aid_gain[done % aid_kept, i] = gain
                    if kind < 2:
                        adapt_noise(
                            kind,
                            robustness,
                            nis,
                            degrees,
                            aid_variance[u],
                            residual,
                            design,
                            error,
                            covariance,
                            adapted,
                        )
                    feed_back(error, position, velocity, quaternion, rotation, sensor_state)
                    if keep_nodes:
                        node_error[nodes % node_kept] += error
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
                    if smooth:
                        coning_and_sculling(angle, velocity_increment, past, step, coning, sculling)
                elif kind < 2 and degrees > 0:
                    error[:] = 0.0
                    adapt_noise(
                        kind,
                        robustness,
                        nis,
                        degrees,
                        aid_variance[u],
                        residual,
                        design,
                        error,
                        covariance,
                        adapted,
                    )
                done += 1
                if keep_nodes:
                    node_aid[nodes % node_kept, 1] = done
            place = nodes % node_places
            node_sensor[place] = sensor_state
            for j in range(m):
                node_sensor_sd[place, j] = math.sqrt(max(covariance[9 + j, 9 + j], 0.0))
            if keep_nodes:
                node_covariance[nodes % node_kept] = covariance
            if not aiding:
                break

        if vehicle >= 0:
            # the springs of a vehicle answer within a fraction of a second; single samples of the
            # gyros are mostly noise
            share = 1.0 if first else min(step / 0.2, 1.0)
            blend = 1.0 if first else min(step / 0.1, 1.0)
            habits[6] = blend
            habits[7] = blend / ((2.0 - blend) * step)
            for i in range(3):
                habits[i] += share * (velocity_increment[i] / step - habits[i])
                rate = angle[i] / step
                for c in range(3):
                    rate -= rotation[c, i] * earth[3 + c]
                habits[3 + i] += blend * (rate - habits[3 + i])
        remember_sample(angle, velocity_increment, step, past)
        last, step_before = end, step
        counters[0] += 1
        if not math.isfinite(position[0] + position[2] + velocity[2] + covariance[6, 6]):
            return k
        if keep_samples:
            row = out_first + k
            for i in range(3):
                out_position[row, i] = position[i]
                out_velocity[row, i] = velocity[i]
                out_velocity_sd[row, i] = math.sqrt(max(covariance[3 + i, 3 + i], 0.0))
                out_attitude_sd[row, i] = math.sqrt(max(covariance[6 + i, 6 + i], 0.0))
                for j in range(3):
                    out_rotation[row, i, j] = rotation[i, j]
                    out_position_covariance[row, i, j] = covariance[i, j]
    counters[1], counters[2], counters[3] = done, nodes + 1, 1 if moved else 0
    habits[8], habits[9], habits[10], habits[11] = discretised, likelihood, last, step_before
    return -1
