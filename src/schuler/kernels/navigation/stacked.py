"""Several IMUs on one body, each with its own navigation solution, in one filter. Spec 7.6.

The error state is the stack of one block an IMU (position 3, velocity 3, attitude 3, its sensor
states) and of the errors of the relative attitude and lever arm of every further IMU against the
first. Every IMU is integrated by itself; what ties them is the covariance between the blocks,
the constraints at the update stage, and GNSS, which is used once.

The same recursion with a gain for each block by itself is the covariance of several filters that
know nothing of each other: redundancy at system level (S002, Fig 2), with the correlation that
their common receiver gives their errors.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.compile import kernel
from schuler.kernels.navigation.constraint import constraint_model
from schuler.kernels.navigation.covariance import channel_rows, navigation_rows
from schuler.kernels.navigation.geodesy import radii_of_curvature
from schuler.kernels.navigation.strapdown import (
    coning_and_sculling,
    remember_sample,
    rotate_after,
    rotation_from_quaternion,
    strapdown_step,
)
from schuler.kernels.navigation.transition import (
    correct_sample,
    move_sensor_states,
    sensor_transition,
)
from schuler.kernels.navigation.update import (
    add_rate_noise,
    feed_back,
    innovation_statistics,
    measurement_model,
    scalar_update,
)

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@kernel()
def transition_of_block(
    matrix: Array,
    begin: int,
    end: int,
    dt: float,
    rotation: Array,
    earth: Array,
    transport: Array,
    channel: Integers,
    direction: Array,
    block: Integers,
    transition: Array,
    rows: Array,
    errors: Array,
    top: Array,
) -> None:
    """Left-multiply rows begin to end of a matrix by the transition of one IMU, in place.

    Work arrays as in `propagate_covariance`; any number of columns.
    """
    m = end - begin - 9
    columns = matrix.shape[1]
    for left in range(0, columns, 256):
        width = min(256, columns - left)
        part = matrix[begin:end, left : left + width]
        for i in range(9):
            for k in range(width):
                rows[i * 264 + k] = part[i, k]
        channel_rows(part, channel, direction, width, errors)
        navigation_rows(rows, errors, top, width, dt, rotation, earth, transport)
        for i in range(9):
            for k in range(width):
                part[i, k] = top[i * 264 + k]
        for j in range(m):
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
def transpose(matrix: Array) -> None:
    """Transpose a square matrix in place."""
    for i in range(matrix.shape[0]):
        for j in range(i):
            value = matrix[i, j]
            matrix[i, j] = matrix[j, i]
            matrix[j, i] = value


@kernel()
def add_block_noise(
    covariance: Array,
    begin: int,
    dt: float,
    rotation: Array,
    block: Integers,
    noise: Array,
    white: Array,
) -> None:
    """Add the process noise of one IMU over a step to its block."""
    for j in range(block.shape[0]):
        for q in range(block[j, 1]):
            covariance[begin + 9 + j, begin + 9 + block[j, 0] + q] += noise[j, q]
    for i in range(3):
        for k in range(3):
            for c in range(3):
                product = rotation[i, c] * rotation[k, c] * dt
                covariance[begin + 3 + i, begin + 3 + k] += product * white[c]
                covariance[begin + 6 + i, begin + 6 + k] += product * white[3 + c]


@kernel()
def variance_of_rows(rows: Array, covariance: Array, result: Array) -> None:
    """Covariance of three combinations of the states, rows (3, s), into result (3, 3)."""
    n = covariance.shape[0]
    result[:, :] = 0.0
    for a in range(n):
        if rows[0, a] == 0.0 and rows[1, a] == 0.0 and rows[2, a] == 0.0:
            continue
        for b in range(n):
            value = covariance[a, b]
            for i in range(3):
                left = rows[i, a] * value
                for j in range(3):
                    result[i, j] += left * rows[j, b]


@kernel()
def separate_update(
    residual: Array,
    design: Array,
    offset: Integers,
    used: NDArray[np.bool_],
    variance: float,
    own: Array,
    covariance: Array,
    error: Array,
) -> None:
    """Let every block update itself with one and the same scalar measurement.

    Block i uses the gain of a filter that knows its own covariance only; residual (k,), design
    (s,) the rows of all blocks one after the other. The covariance between the blocks follows
    with the gains that are used: P <- (I - K H) P (I - K H)' + K R K', where the noise of the
    measurement is common to all, R = r 1 1', but for what each block adds of its `own` (k,).
    """
    n = covariance.shape[0]
    blocks = residual.size
    shared = np.zeros((n, blocks))
    gain = np.zeros(n)
    owner = np.empty(n, np.int64)
    sums = np.zeros((blocks, blocks))
    for i in range(blocks):
        begin, end = offset[i], offset[i + 1]
        owner[begin:end] = i
        for b in range(begin, end):
            h = design[b]
            if h != 0.0:
                for a in range(n):
                    shared[a, i] += h * covariance[a, b]
    for i in range(blocks):
        begin, end = offset[i], offset[i + 1]
        for j in range(blocks):
            for a in range(begin, end):
                sums[i, j] += design[a] * shared[a, j]
        if not used[i]:
            continue
        innovation = residual[i]
        for a in range(begin, end):
            innovation -= design[a] * error[a]
        inverse = 1.0 / (sums[i, i] + variance + own[i])
        for a in range(begin, end):
            gain[a] = shared[a, i] * inverse
        for a in range(begin, end):
            error[a] += gain[a] * innovation
    last = offset[blocks]
    for a in range(last):
        i = owner[a]
        for b in range(a + 1):
            j = owner[b]
            value = covariance[a, b] - gain[a] * shared[b, i] - shared[a, j] * gain[b]
            common = variance + own[i] if i == j else variance
            value += gain[a] * (sums[i, j] + common) * gain[b]
            covariance[a, b] = value
            covariance[b, a] = value
    for a in range(last, n):
        for b in range(last):
            value = covariance[a, b] - shared[a, owner[b]] * gain[b]
            covariance[a, b] = value
            covariance[b, a] = value


@kernel()
def feed_back_all(
    error: Array,
    offset: Integers,
    first: Integers,
    position: Array,
    velocity: Array,
    quaternion: Array,
    rotation: Array,
    sensor_state: Array,
    relative_quaternion: Array,
    relative: Array,
    arm: Array,
) -> None:
    """Take the estimated errors out of every block and of the relative poses; error to zero."""
    blocks = position.shape[0]
    for i in range(blocks):
        feed_back(
            error[offset[i] : offset[i + 1]],
            position[i],
            velocity[i],
            quaternion[i],
            rotation[i],
            sensor_state[first[i] : first[i + 1]],
        )
        at = int(offset[blocks]) + 6 * (i - 1)
        if i > 0 and at < error.size:
            rotate_after(relative_quaternion[i], error[at], error[at + 1], error[at + 2])
            rotation_from_quaternion(relative_quaternion[i], relative[i])
            for c in range(3):
                arm[i, c] -= error[at + 3 + c]
    error[:] = 0.0


@kernel()
def run_stacked(
    time: Array,
    gyro: Array,
    accel: Array,
    position: Array,
    velocity: Array,
    quaternion: Array,
    sensor_state: Array,
    first: Integers,
    relative_quaternion: Array,
    arm: Array,
    covariance: Array,
    channel: Integers,
    direction: Array,
    block: Integers,
    drift: Array,
    diffusion: Array,
    white: Array,
    white_scale: Array,
    relative_noise: Array,
    weight: Array,
    lever: Array,
    place: Array,
    separate: bool,
    aid_time: Array,
    aid_kind: Integers,
    aid_value: Array,
    aid_variance: Array,
    constraint_variance: Array,
    gate: Array,
    patience: int,
    longest_step: float,
    out_position: Array,
    out_velocity: Array,
    out_rotation: Array,
    out_sd: Array,
    out_position_covariance: Array,
    out_velocity_sd: Array,
    out_attitude_sd: Array,
    aid_residual: Array,
    aid_deviation: Array,
    aid_nis: Array,
    aid_degrees: Integers,
    aid_accepted: NDArray[np.bool_],
    constraint_residual: Array,
    constraint_nis: Array,
    node_time: Array,
    node_sensor: Array,
    node_sensor_sd: Array,
    node_arm: Array,
    node_relative: Array,
    node_relative_sd: Array,
) -> tuple[float, int, int]:
    """Run the stacked filter; the state arrays end as the final state.

    Sizes: n samples, k IMUs, M sensor states of all IMUs one after the other, those of IMU i from
    first[i] to first[i + 1]; places in `block` count
    within an IMU, and all states exist in continuous time. s = 9 k + M, and 6 (k - 1) more where
    the relative poses are states. u measurements, c epochs of constraints among them.

    gyro, accel (n, k, 3) in the axes of each IMU; white (k, 6) squared densities; lever (k, 3)
    from each IMU to the antenna and place (k, 3) from the body's origin to each IMU, in the axes
    of that IMU; relative_quaternion and arm (k, 4), (k, 3): C_1i and a, the first ones not used;
    relative_noise (2,): squared densities of their walks.

    Measurements: kind 0 and 1 GNSS position and velocity, 2 the constraints of all pairs with
    constraint_variance (3,). GNSS is compared with the mean of all IMUs by `weight` (k,), and
    updates the stack once; with `separate` each IMU uses it by itself, then aid outputs have k
    columns, otherwise one, and there must be no constraints.

    Sample outputs: out_position, out_velocity (n, k, 3), out_rotation (n, k, 3, 3) and standard
    deviations out_sd (n, k, 9) of each IMU; covariance of the weighted mean of what they say of
    the body's origin. Nodes are made at every measurement.

    Returns the log-likelihood of accepted GNSS measurements, the number of nodes, and the first
    sample at which the state was no longer finite (-1: none).
    """
    n = time.size
    blocks = position.shape[0]
    size = covariance.shape[0]
    updates = aid_time.size
    offset = np.empty(blocks + 1, np.int64)
    for i in range(blocks + 1):
        offset[i] = 9 * i + first[i]
    tied = size > offset[blocks]
    answers = aid_nis.shape[1]

    rotation, relative = np.empty((blocks, 3, 3)), np.empty((blocks, 3, 3))
    for i in range(blocks):
        rotation_from_quaternion(quaternion[i], rotation[i])
        rotation_from_quaternion(relative_quaternion[i], relative[i])
    earth, transport = np.zeros((blocks, 10)), np.zeros(3)
    angle, increment = np.zeros((blocks, 3)), np.zeros((blocks, 3))
    past = np.zeros((blocks, 3, 6))
    coning, sculling = np.zeros((blocks, 3)), np.zeros((blocks, 3))
    part_coning, part_sculling = np.zeros(3), np.zeros(3)
    part_angle, part_increment = np.zeros(3), np.zeros(3)
    rows, errors, top = np.zeros(9 * 264), np.zeros(6 * 264), np.zeros(9 * 264)
    transition, noise = np.zeros(drift.shape), np.zeros(drift.shape)
    interval, state_work = np.zeros(drift.shape[0]), np.empty(drift.shape[0])
    residual, deviation = np.empty(3), np.empty(3)
    many = np.empty((blocks, 3))
    block_residual = np.empty(blocks)
    rate_noise, own = np.zeros((blocks, 3)), np.zeros(blocks)
    rate_density, noise_variance = np.zeros((2, 3, 3)), np.empty(3)
    body_rate = np.empty((blocks, 3))
    design = np.zeros((3, size))
    wide = np.zeros((3, size))
    error, gain = np.zeros(size), np.empty(size)
    noise_now = white.copy()
    refused = np.zeros((answers, 2), np.int64)
    used = np.ones(blocks, np.bool_)
    nine = np.empty(9)
    by_first, by_second = np.empty((9, 9)), np.empty((9, 9))
    by_relative, by_gyro = np.empty((9, 6)), np.empty((3, 3))
    three = np.empty(3)
    mean_rows, spread = np.zeros((3, size)), np.empty((3, 3))
    likelihood = 0.0
    discretised = -1.0
    step_before, smooth = 0.0, True
    done, nodes, constraints = 0, -1, 0

    for k in range(n):
        end = time[k]
        now = end if k == 0 else time[k - 1]
        step = time[1] - time[0] if k == 0 else end - now
        for i in range(blocks):
            a, b = first[i], first[i + 1]
            correct_sample(
                gyro[k, i],
                accel[k, i],
                step,
                sensor_state[a:b],
                channel[a:b],
                direction[a:b],
                angle[i],
                increment[i],
            )
            if k == 0:
                step_before = step
                for _ in range(3):
                    remember_sample(angle[i], increment[i], step, past[i])
            # nobody knows how rates changed in a gap
            smooth = step < 3.0 * step_before
            if smooth:
                coning_and_sculling(angle[i], increment[i], past[i], step, coning[i], sculling[i])
            else:
                coning[i, :] = 0.0
                sculling[i, :] = 0.0
            if white_scale.shape[0] > 0:
                for c in range(6):
                    noise_now[i, c] = white[i, c] * white_scale[k, c]

        while True:
            aiding = done < updates and aid_time[done] <= end
            target = aid_time[done] if aiding else end
            span = target - now
            if span > 1e-9 * step and k > 0:
                pieces = max(math.ceil(span / longest_step - 1e-6), 1)
                dt = span / pieces
                share = dt / step
                if abs(dt - discretised) > 1e-4 * dt:
                    for i in range(blocks):
                        a, b = first[i], first[i + 1]
                        sensor_transition(
                            dt,
                            drift[a:b],
                            diffusion[a:b],
                            block[a:b],
                            interval[a:b],
                            transition[a:b],
                            noise[a:b],
                        )
                    discretised = dt
                for _ in range(pieces):
                    for side in range(2):
                        for i in range(blocks):
                            a, b = first[i], first[i + 1]
                            if side == 0:
                                for c in range(3):
                                    part_angle[c] = angle[i, c] * share
                                    part_increment[c] = increment[i, c] * share
                                    part_coning[c] = coning[i, c] * share
                                    part_sculling[c] = sculling[i, c] * share
                                strapdown_step(
                                    dt,
                                    part_angle,
                                    part_increment,
                                    part_coning,
                                    part_sculling,
                                    position[i],
                                    velocity[i],
                                    quaternion[i],
                                    rotation[i],
                                    earth[i],
                                )
                            sine = math.sin(position[i, 0])
                            meridian, transverse = radii_of_curvature(sine)
                            transport[0] = 1.0 / (transverse + position[i, 2])
                            transport[1] = -1.0 / (meridian + position[i, 2])
                            transport[2] = -sine / math.sqrt(1.0 - sine * sine) * transport[0]
                            transition_of_block(
                                covariance,
                                offset[i],
                                offset[i + 1],
                                dt,
                                rotation[i],
                                earth[i],
                                transport,
                                channel[a:b],
                                direction[a:b],
                                block[a:b],
                                transition[a:b],
                                rows,
                                errors,
                                top,
                            )
                        transpose(covariance)
                    for a in range(size):
                        for b in range(a):
                            covariance[b, a] = covariance[a, b]
                    for i in range(blocks):
                        a, b = first[i], first[i + 1]
                        add_block_noise(
                            covariance,
                            offset[i],
                            dt,
                            rotation[i],
                            block[a:b],
                            noise[a:b],
                            noise_now[i],
                        )
                        move_sensor_states(
                            sensor_state[a:b], block[a:b], transition[a:b], state_work
                        )
                    for a in range(offset[blocks], size):
                        turns = (a - offset[blocks]) % 6 < 3
                        covariance[a, a] += dt * (relative_noise[0] if turns else relative_noise[1])
                now = target
            if not aiding and k > 0 and k < n - 1:
                break

            if nodes < 0 or now > node_time[nodes] + 1e-9:
                nodes += 1
                node_time[nodes] = now
            if aiding:
                for i in range(blocks):
                    for c in range(3):
                        rate = angle[i, c] / step
                        for j in range(3):
                            rate -= rotation[i, j, c] * earth[i, 3 + j]
                        body_rate[i, c] = rate
                kind = aid_kind[done]
                if kind < 2:
                    wide[:, :] = 0.0
                    residual[:] = 0.0
                    for i in range(blocks):
                        a, b = first[i], first[i + 1]
                        measurement_model(
                            kind,
                            aid_value[done],
                            lever[i],
                            position[i],
                            velocity[i],
                            rotation[i],
                            body_rate[i],
                            channel[a:b],
                            direction[a:b],
                            many[i],
                            design[:, : 9 + b - a],
                        )
                        rate_noise[i] = 0.0
                        if kind == 1:
                            for c in range(3):
                                rate_density[1, c, c] = noise_now[i, 3 + c]
                            add_rate_noise(lever[i], rotation[i], rate_density, step, rate_noise[i])
                        share = 1.0 if separate else weight[i]
                        for c in range(3):
                            residual[c] += share * many[i, c]
                            for j in range(9 + b - a):
                                wide[c, offset[i] + j] = share * design[c, j]
                    for answer in range(answers):
                        design[:, :] = wide
                        if separate:
                            residual[:] = many[answer]
                            design[:, : offset[answer]] = 0.0
                            design[:, offset[answer + 1] :] = 0.0
                        for c in range(3):
                            noise_variance[c] = aid_variance[done, c]
                            for i in range(blocks):
                                if not separate:
                                    noise_variance[c] += weight[i] ** 2 * rate_noise[i, c]
                                elif i == answer:
                                    noise_variance[c] += rate_noise[i, c]
                        nis, log_determinant, degrees = innovation_statistics(
                            residual, design, noise_variance, covariance, deviation
                        )
                        accepted = degrees > 0 and nis <= gate[degrees]
                        if degrees > 0 and not accepted and refused[answer, kind] >= patience:
                            accepted = True
                            for i in range(blocks):
                                if separate and i != answer:
                                    continue
                                for j in range(blocks):
                                    if separate and j != answer:
                                        continue
                                    for c in range(3):
                                        if math.isfinite(aid_variance[done, c]):
                                            covariance[
                                                offset[i] + 3 * kind + c, offset[j] + 3 * kind + c
                                            ] += residual[c] ** 2
                        refused[answer, kind] = 0 if accepted else refused[answer, kind] + 1
                        used[answer] = accepted
                        aid_nis[done, answer] = nis
                        aid_degrees[done] = degrees
                        aid_accepted[done, answer] = accepted
                        for c in range(3):
                            finite = math.isfinite(aid_variance[done, c])
                            aid_residual[done, answer, c] = residual[c] if finite else math.nan
                            aid_deviation[done, answer, c] = deviation[c]
                        if accepted:
                            likelihood -= 0.5 * (
                                nis + log_determinant + degrees * math.log(2.0 * math.pi)
                            )
                    for c in range(3):
                        if not math.isfinite(aid_variance[done, c]):
                            continue
                        if separate:
                            for i in range(blocks):
                                block_residual[i] = many[i, c]
                                own[i] = rate_noise[i, c]
                            separate_update(
                                block_residual,
                                wide[c],
                                offset,
                                used,
                                aid_variance[done, c],
                                own,
                                covariance,
                                error,
                            )
                        elif used[0]:
                            innovation = residual[c]
                            for j in range(size):
                                innovation -= wide[c, j] * error[j]
                            scalar_update(
                                innovation, wide[c], noise_variance[c], covariance, error, gain
                            )
                    feed_back_all(
                        error,
                        offset,
                        first,
                        position,
                        velocity,
                        quaternion,
                        rotation,
                        sensor_state,
                        relative_quaternion,
                        relative,
                        arm,
                    )
                else:
                    for i in range(1, blocks):
                        a = first[0]
                        b = first[1]
                        constraint_model(
                            position[0],
                            velocity[0],
                            rotation[0],
                            position[i],
                            velocity[i],
                            rotation[i],
                            relative[i],
                            arm[i],
                            body_rate[0],
                            earth[0, 3:6],
                            nine,
                            by_first,
                            by_second,
                            by_relative,
                            by_gyro,
                        )
                        at = int(offset[blocks]) + 6 * (i - 1)
                        for group in range(3):
                            wide[:, :] = 0.0
                            for c in range(3):
                                three[c] = constraint_variance[group]
                                row = 3 * group + c
                                for j in range(9):
                                    wide[c, j] = by_first[row, j]
                                    wide[c, offset[i] + j] = by_second[row, j]
                                for j in range(6):
                                    wide[c, at + j] = by_relative[row, j]
                                if group < 2:
                                    continue
                                for j in range(a, b):
                                    q = channel[j]
                                    if q < 3:
                                        continue
                                    if math.isnan(direction[j, 0]):
                                        wide[c, 9 + j] = by_gyro[c, q - 3]
                                    else:
                                        for d in range(3):
                                            wide[c, 9 + j] += by_gyro[c, d] * direction[j, d]
                                # the rate of one sample is noisy, and the lever carries it
                                for d in range(3):
                                    three[c] += by_gyro[c, d] ** 2 * noise_now[0, 3 + d] / step
                            for c in range(3):
                                residual[c] = nine[3 * group + c]
                                for j in range(size):
                                    residual[c] -= wide[c, j] * error[j]
                                constraint_residual[constraints, i - 1, 3 * group + c] = residual[c]
                            nis, log_determinant, degrees = innovation_statistics(
                                residual, wide, three, covariance, deviation
                            )
                            constraint_nis[constraints, i - 1, group] = nis
                            for c in range(3):
                                innovation = nine[3 * group + c]
                                for j in range(size):
                                    innovation -= wide[c, j] * error[j]
                                scalar_update(
                                    innovation, wide[c], three[c], covariance, error, gain
                                )
                        feed_back_all(
                            error,
                            offset,
                            first,
                            position,
                            velocity,
                            quaternion,
                            rotation,
                            sensor_state,
                            relative_quaternion,
                            relative,
                            arm,
                        )
                    constraints += 1
                for i in range(blocks):
                    a, b = first[i], first[i + 1]
                    correct_sample(
                        gyro[k, i],
                        accel[k, i],
                        step,
                        sensor_state[a:b],
                        channel[a:b],
                        direction[a:b],
                        angle[i],
                        increment[i],
                    )
                    if smooth:
                        coning_and_sculling(
                            angle[i], increment[i], past[i], step, coning[i], sculling[i]
                        )
                done += 1
            for i in range(blocks):
                for j in range(first[i], first[i + 1]):
                    node_sensor[nodes, j] = sensor_state[j]
                    at = 9 * (i + 1) + j
                    node_sensor_sd[nodes, j] = math.sqrt(max(covariance[at, at], 0.0))
            if tied:
                for i in range(1, blocks):
                    node_arm[nodes, i] = arm[i]
                    node_relative[nodes, i] = relative[i]
                for j in range(offset[blocks], size):
                    node_relative_sd[nodes, j - offset[blocks]] = math.sqrt(covariance[j, j])
            if not aiding:
                break

        step_before = step
        total = 0.0
        for i in range(blocks):
            remember_sample(angle[i], increment[i], step, past[i])
            at = int(offset[i])
            total += position[i, 0] + position[i, 2] + velocity[i, 2] + covariance[at, at]
        if not math.isfinite(total):
            return likelihood, nodes + 1, k
        mean_rows[:, :] = 0.0
        for i in range(blocks):
            x, y, z = place[i, 0], place[i, 1], place[i, 2]
            for c in range(3):
                three[c] = -weight[i] * (
                    rotation[i, c, 0] * x + rotation[i, c, 1] * y + rotation[i, c, 2] * z
                )
                mean_rows[c, offset[i] + c] = weight[i]
            at = int(offset[i]) + 6
            mean_rows[0, at + 1], mean_rows[0, at + 2] = -three[2], three[1]
            mean_rows[1, at], mean_rows[1, at + 2] = three[2], -three[0]
            mean_rows[2, at], mean_rows[2, at + 1] = -three[1], three[0]
        variance_of_rows(mean_rows, covariance, spread)
        for c in range(3):
            for j in range(3):
                out_position_covariance[k, c, j] = spread[c, j]
            speed, turn = 0.0, 0.0
            for i in range(blocks):
                for j in range(3):
                    at = int(offset[i]) + 3 * j + c
                    out_sd[k, i, 3 * j + c] = math.sqrt(max(covariance[at, at], 0.0))
                out_position[k, i, c] = position[i, c]
                out_velocity[k, i, c] = velocity[i, c]
                for j in range(3):
                    out_rotation[k, i, c, j] = rotation[i, c, j]
                for j in range(blocks):
                    both = weight[i] * weight[j]
                    speed += both * covariance[offset[i] + 3 + c, offset[j] + 3 + c]
                    turn += both * covariance[offset[i] + 6 + c, offset[j] + 6 + c]
            out_velocity_sd[k, c] = math.sqrt(max(speed, 0.0))
            out_attitude_sd[k, c] = math.sqrt(max(turn, 0.0))
    return likelihood, nodes + 1, -1
