"""Several IMUs on one body, each with its own navigation solution, in one filter. Spec 7.6.

Every IMU is integrated by itself; what ties them is the covariance between their blocks, the
constraints of the body, and GNSS, which is used once: against the weighted mean of what all IMUs
say of the antenna. Steps as in filter.py, over the IMUs.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.compile import kernel
from schuler.kernels.navigation.constraint import constraint_model
from schuler.kernels.navigation.covariance import channel_rows, navigation_rows, work_rows
from schuler.kernels.navigation.geodesy import radii_of_curvature
from schuler.kernels.navigation.stacked_data import Stack
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
    clear,
    feed_back,
    innovation_statistics,
    measurement_model,
    scalar_update,
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
            value = covariance[a, b]
            covariance[b, a] = value
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


@kernel()
def feed_back_all(f: Stack) -> None:
    """Take the estimated errors out of every block and of the relative poses; error to zero."""
    state, model, error = f.state, f.model, f.measurement.error
    blocks = model.weight.size
    for i in range(blocks):
        feed_back(
            error[model.offset[i] : model.offset[i + 1]],
            state.position[i],
            state.velocity[i],
            state.quaternion[i],
            state.rotation[i],
            state.sensor[model.first[i] : model.first[i + 1]],
        )
        if i > 0:
            at = model.offset[blocks] + 6 * (i - 1)
            turned = state.relative_quaternion[i]
            rotate_after(turned, error[at], error[at + 1], error[at + 2])
            rotation_from_quaternion(turned, state.relative[i])
            for c in range(3):
                state.arm[i, c] -= error[at + 3 + c]
    for j in range(error.size):
        error[j] = 0.0


@kernel()
def fix_model(f: Stack, u: int, kind: int, step: float) -> None:
    """Compare a fix with the weighted mean of what all IMUs say of the antenna."""
    state, model, work, z = f.state, f.model, f.work, f.measurement
    clear(z.design)
    for c in range(3):
        z.residual[c], z.noise_variance[c] = 0.0, f.schedule.variance[u, c]
    for i in range(model.weight.size):
        a, b = model.first[i], model.first[i + 1]
        width = 9 + b - a
        design = work.design[: 3 * width].reshape(3, width)
        measurement_model(
            kind,
            f.schedule.value[u],
            model.lever[i],
            state.position[i],
            state.velocity[i],
            state.rotation[i],
            work.body_rate[i],
            model.sensors.channel[a:b],
            model.sensors.direction[a:b],
            work.residual[i],
            design,
        )
        noise, share = work.rate_noise[i], model.weight[i]
        for c in range(3):
            noise[c] = 0.0
        if kind == 1:
            for c in range(3):
                work.density[1, c, c] = work.white[i, 3 + c]
            add_rate_noise(model.lever[i], state.rotation[i], work.density, step, noise)
        for c in range(3):
            z.residual[c] += share * work.residual[i, c]
            z.noise_variance[c] += share**2 * noise[c]
            for j in range(width):
                z.design[c, model.offset[i] + j] = share * design[c, j]


@kernel()
def judge_fix(f: Stack, u: int, kind: int, nis: float, degrees: int) -> bool:
    """Whether a fix is used, as in `judge` of filter.py; one kind of answer for all IMUs."""
    state, model, rules, z = f.state, f.model, f.rules, f.measurement
    accepted = degrees > 0 and nis <= rules.gate[degrees]
    if degrees > 0 and not accepted and state.refused[kind] >= rules.patience:
        accepted = True
        for i in range(model.weight.size):
            for j in range(model.weight.size):
                row, column = model.offset[i] + 3 * kind, model.offset[j] + 3 * kind
                for c in range(3):
                    if math.isfinite(f.schedule.variance[u, c]):
                        state.covariance[row + c, column + c] += z.residual[c] ** 2
    state.refused[kind] = 0 if accepted else state.refused[kind] + 1
    return accepted


@kernel()
def use_component(f: Stack, c: int, residual: float) -> None:
    """Update all blocks with one component of the measurement at hand."""
    z = f.measurement
    innovation = residual
    for j in range(z.error.size):
        innovation -= z.design[c, j] * z.error[j]
    scalar_update(innovation, z.design[c], z.noise_variance[c], f.state.covariance, z.error, z.gain)


@kernel()
def take_fix(f: Stack, u: int, kind: int, step: float) -> None:
    """Use GNSS once for all IMUs."""
    state, out, z = f.state, f.outputs, f.measurement
    fix_model(f, u, kind, step)
    nis, log_determinant, degrees = innovation_statistics(
        z.residual, z.design, z.noise_variance, state.covariance, z.deviation
    )
    accepted = judge_fix(f, u, kind, nis, degrees)
    out.nis[u], out.degrees[u], out.accepted[u] = nis, degrees, accepted
    if accepted:
        state.log_likelihood[0] -= 0.5 * (nis + log_determinant + degrees * math.log(2.0 * math.pi))
    for c in range(3):
        finite = math.isfinite(f.schedule.variance[u, c])
        out.residual[u, c] = z.residual[c] if finite else math.nan
        out.deviation[u, c] = z.deviation[c]
        if accepted and finite:
            use_component(f, c, z.residual[c])
    feed_back_all(f)


@kernel()
def tie_design(f: Stack, i: int, group: int, step: float) -> None:
    """Rows of H and noise of one constraint: 0 on attitude, 1 on position, 2 on velocity."""
    model, sensors, z, tie = f.model, f.model.sensors, f.measurement, f.work.tie
    at = model.offset[model.weight.size] + 6 * (i - 1)
    clear(z.design)
    for c in range(3):
        row, variance = 3 * group + c, model.tie_variance[group]
        for j in range(9):
            z.design[c, j] = tie.by_first[row, j]
            z.design[c, model.offset[i] + j] = tie.by_second[row, j]
        for j in range(6):
            z.design[c, at + j] = tie.by_relative[row, j]
        if group == 2:
            for j in range(model.first[0], model.first[1]):
                q = sensors.channel[j]
                if q < 3:
                    continue
                if math.isnan(sensors.direction[j, 0]):
                    z.design[c, 9 + j] = tie.by_gyro[c, q - 3]
                else:
                    for d in range(3):
                        z.design[c, 9 + j] += tie.by_gyro[c, d] * sensors.direction[j, d]
            # the rate of one sample is noisy, and the lever carries it
            for d in range(3):
                variance += tie.by_gyro[c, d] ** 2 * f.work.white[0, 3 + d] / step
        z.noise_variance[c] = variance


@kernel()
def take_ties(f: Stack, step: float) -> None:
    """Tie every further IMU to the first by what a rigid body allows."""
    state, out, z, tie = f.state, f.outputs, f.measurement, f.work.tie
    for i in range(1, f.model.weight.size):
        constraint_model(
            state.position[0],
            state.velocity[0],
            state.rotation[0],
            state.position[i],
            state.velocity[i],
            state.rotation[i],
            state.relative[i],
            state.arm[i],
            f.work.body_rate[0],
            state.earth[0, 3:6],
            tie,
        )
        for group in range(3):
            tie_design(f, i, group, step)
            for c in range(3):
                z.residual[c] = tie.residual[3 * group + c]
                for j in range(z.error.size):
                    z.residual[c] -= z.design[c, j] * z.error[j]
                out.tie_residual[state.ties[0], i - 1, 3 * group + c] = z.residual[c]
            nis, _, _ = innovation_statistics(
                z.residual, z.design, z.noise_variance, state.covariance, z.deviation
            )
            out.tie_nis[state.ties[0], i - 1, group] = nis
            for c in range(3):
                out.tie_deviation[state.ties[0], i - 1, 3 * group + c] = z.deviation[c]
                use_component(f, c, tie.residual[3 * group + c])
        feed_back_all(f)
    state.ties[0] += 1


@kernel()
def aid_stack(f: Stack, k: int, step: float, smooth: bool) -> None:
    """Take the next measurement, which falls into sample k."""
    state, work = f.state, f.work
    u = state.aided[0]
    kind = f.schedule.kind[u]
    for i in range(f.model.weight.size):
        for c in range(3):
            rate = state.angle[i, c] / step
            for j in range(3):
                rate -= state.rotation[i, j, c] * state.earth[i, 3 + j]
            work.body_rate[i, c] = rate
    if kind < 2:
        take_fix(f, u, kind, step)
    else:
        take_ties(f, step)
    correct_all(f, k, step)
    if smooth:
        twist_all(f, step)
    state.aided[0] += 1


@kernel()
def open_stack_node(f: Stack, now: float) -> None:
    """Begin a node, unless there is one at this time."""
    nodes = f.state.nodes
    if nodes[0] == 0 or now > f.outputs.node_time[nodes[0] - 1] + 1e-9:
        f.outputs.node_time[nodes[0]] = now
        nodes[0] += 1


@kernel()
def close_stack_node(f: Stack) -> None:
    """Write what is known at the node of the sensors and of the relative poses."""
    state, model, out = f.state, f.model, f.outputs
    covariance, node, blocks = state.covariance, state.nodes[0] - 1, model.weight.size
    for i in range(blocks):
        for j in range(model.first[i], model.first[i + 1]):
            at = 9 * (i + 1) + j
            out.node_sensor[node, j] = state.sensor[j]
            out.node_sensor_sd[node, j] = math.sqrt(max(covariance[at, at], 0.0))
    for i in range(1, blocks):
        for c in range(3):
            out.node_arm[node, i, c] = state.arm[i, c]
            for d in range(3):
                out.node_relative[node, i, c, d] = state.relative[i, c, d]
    tied = model.offset[blocks]
    for j in range(tied, covariance.shape[0]):
        out.node_relative_sd[node, j - tied] = math.sqrt(covariance[j, j])


@kernel()
def remember_stack(f: Stack, step: float) -> bool:
    """Keep of a sample what the next one needs; returns whether the state is finite."""
    state = f.state
    total = 0.0
    for i in range(f.model.weight.size):
        remember_sample(state.angle[i], state.velocity_increment[i], step, state.past[i])
        at = f.model.offset[i]
        total += state.position[i, 0] + state.position[i, 2] + state.velocity[i, 2]
        total += state.covariance[at, at]
    state.step[0] = step
    return math.isfinite(total)


@kernel()
def variance_of_rows(rows: Array, covariance: Array, result: Array) -> None:
    """Covariance of three combinations of the states, rows (3, s), into result (3, 3)."""
    n = covariance.shape[0]
    clear(result)
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
def mean_of_origin(f: Stack) -> None:
    """Covariance of the weighted mean of what all IMUs say of the body's origin."""
    model, mean = f.model, f.work.mean
    clear(mean)
    for i in range(model.weight.size):
        rotation, at, w = f.state.rotation[i], model.offset[i], model.weight[i]
        place = model.place[i]
        x, y, z = place[0], place[1], place[2]
        a = -w * (rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z)
        b = -w * (rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z)
        c = -w * (rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z)
        for r in range(3):
            mean[r, at + r] = w
        mean[0, at + 7], mean[0, at + 8] = -c, b
        mean[1, at + 6], mean[1, at + 8] = c, -a
        mean[2, at + 6], mean[2, at + 7] = -b, a
    variance_of_rows(mean, f.state.covariance, f.work.spread)


@kernel()
def write_stack_outputs(f: Stack, k: int) -> None:
    """Write all solutions at a sample, and what their mean claims."""
    state, model, out = f.state, f.model, f.outputs
    covariance, offset, blocks = state.covariance, model.offset, model.weight.size
    mean_of_origin(f)
    for c in range(3):
        speed, turn = 0.0, 0.0
        for j in range(3):
            out.position_covariance[k, c, j] = f.work.spread[c, j]
        for i in range(blocks):
            out.position[k, i, c] = state.position[i, c]
            out.velocity[k, i, c] = state.velocity[i, c]
            for j in range(3):
                at = offset[i] + 3 * j + c
                out.sd[k, i, 3 * j + c] = math.sqrt(max(covariance[at, at], 0.0))
                out.rotation[k, i, c, j] = state.rotation[i, c, j]
            for j in range(blocks):
                both = model.weight[i] * model.weight[j]
                speed += both * covariance[offset[i] + 3 + c, offset[j] + 3 + c]
                turn += both * covariance[offset[i] + 6 + c, offset[j] + 6 + c]
        out.velocity_sd[k, c] = math.sqrt(max(speed, 0.0))
        out.attitude_sd[k, c] = math.sqrt(max(turn, 0.0))


@kernel()
def run_stacked(f: Stack) -> int:
    """Run the stacked filter over all samples; the state ends as the final state.

    Returns the first sample at which the state was no longer finite, or -1.
    """
    time, schedule, state = f.samples.time, f.schedule, f.state
    n = time.size
    for k in range(n):
        end = time[k]
        now = end if k == 0 else time[k - 1]
        step = time[1] - time[0] if k == 0 else end - now
        smooth = take_samples(f, k, step)
        while True:
            aiding, target = False, end
            if state.aided[0] < schedule.time.size and schedule.time[state.aided[0]] <= end:
                aiding, target = True, schedule.time[state.aided[0]]
            if target - now > 1e-9 * step and k > 0:
                advance_stack(f, target - now, step)
                now = target
            if not aiding and 0 < k < n - 1:
                break
            open_stack_node(f, now)
            if aiding:
                aid_stack(f, k, step, smooth)
            close_stack_node(f)
            if not aiding:
                break
        if not remember_stack(f, step):
            return k
        write_stack_outputs(f, k)
    return -1
