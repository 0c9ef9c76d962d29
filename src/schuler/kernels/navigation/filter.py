"""The closed-loop error-state Kalman filter over a stretch of samples. Spec 7.1 to 7.3.

One pass over the IMU samples; an aiding measurement that falls inside a sample splits it. What
the filter remembers lies in its state, so that a stretch may be a whole recording, one sample of
a stream, or a part that is run once more. The steps of a sample:

    take_sample         increments, coning and sculling, noise
    advance             strapdown and covariance to the next measurement, or to the end
    open_node           a node of the smoother begins
    aid                 compare, judge, update, feed back
    close_node          what the smoother wants of the node
    remember            what the next sample needs of this one
    write_outputs       the state at the sample
"""

from __future__ import annotations

import math

from schuler.kernels.compile import kernel
from schuler.kernels.navigation.aiding import aiding_model, constraint_applies, read_measurement
from schuler.kernels.navigation.covariance import propagate_covariance
from schuler.kernels.navigation.filter_data import Filter
from schuler.kernels.navigation.geodesy import radii_of_curvature
from schuler.kernels.navigation.robust import adapt_noise, robust_weight, scale_noise
from schuler.kernels.navigation.strapdown import (
    coning_and_sculling,
    remember_sample,
    strapdown_step,
)
from schuler.kernels.navigation.transition import (
    accumulate_transition,
    correct_sample,
    move_sensor_states,
    raise_blocks,
    reset_transition,
    scale_directions,
    sensor_transition,
    set_blocks,
)
from schuler.kernels.navigation.update import feed_back, innovation_statistics, scalar_update


@kernel()
def correct(f: Filter, k: int, step: float) -> None:
    """Increments of sample k with the estimated sensor errors taken off."""
    correct_sample(
        f.samples.gyro[k],
        f.samples.accel[k],
        step,
        f.state.sensor,
        f.model.channel,
        f.work.shown,
        f.state.angle,
        f.state.velocity_increment,
    )


@kernel()
def twist(f: Filter, step: float, smooth: bool) -> None:
    """What the sample turns and pushes beyond its increments; nothing known behind a gap."""
    state = f.state
    if smooth:
        coning_and_sculling(
            state.angle,
            state.velocity_increment,
            state.past,
            step,
            state.coning,
            state.sculling,
        )
    else:
        for i in range(3):
            state.coning[i] = 0.0
            state.sculling[i] = 0.0


@kernel(inline=True)
def scale_white(f: Filter, k: int) -> None:
    """Write the white noise of sample k."""
    work, white = f.work, f.model.white
    for i in range(6):
        work.root[i] = math.sqrt(f.samples.white_scale[k, i])
    for part in range(2):
        for i in range(3):
            for c in range(3):
                both = work.root[3 * part + i] * work.root[3 * part + c]
                work.white[part, i, c] = white[part, i, c] * both


@kernel()
def choose_blocks(f: Filter, moving: bool) -> None:
    """Let the blocks of one interval move over a step, or stand still."""
    state, model = f.state, f.model
    set_blocks(
        moving,
        model.block,
        model.interval,
        state.power,
        state.power_noise,
        state.transition,
        state.noise,
    )
    state.moved[0] = 1 if moving else 0


@kernel()
def take_sample(f: Filter, k: int, step: float, first: bool) -> bool:
    """Read sample k; returns whether rates changed smoothly since the samples before."""
    state, model, samples = f.state, f.model, f.samples
    if model.modulated:
        scale_directions(
            samples.gyro[k], samples.accel[k], model.scaled_by, model.direction, f.work.shown
        )
    if model.discrete:
        changed = raise_blocks(
            step,
            model.drift,
            model.diffusion,
            model.block,
            model.interval,
            state.steps,
            state.power,
            state.power_noise,
        )
        if changed:
            choose_blocks(f, not changed)
    # nobody knows how rates changed in a gap
    smooth: bool = step < 3.0 * state.step[0]
    correct(f, k, step)
    if first:
        for _ in range(3):
            remember_sample(state.angle, state.velocity_increment, step, state.past)
    twist(f, step, smooth)
    if samples.white_scale.shape[0] > 0:
        scale_white(f, k)
    return smooth


@kernel()
def navigate_step(f: Filter, dt: float) -> None:
    """Move state and covariance on by one step. Spec 7.1 and 7.2."""
    state, work = f.state, f.work
    position, transport = state.position, state.transport
    sine = math.sin(position[0])
    meridian, transverse = radii_of_curvature(sine)
    transport[0] = 1.0 / (transverse + position[2])
    transport[1] = -1.0 / (meridian + position[2])
    transport[2] = -sine / math.sqrt(1.0 - sine * sine) * transport[0]
    strapdown_step(
        dt,
        work.angle,
        work.velocity_increment,
        work.coning,
        work.sculling,
        position,
        state.velocity,
        state.quaternion,
        state.rotation,
        state.earth,
    )
    propagate_covariance(state, f.model, work, dt)
    if state.node_top.size > 0:
        accumulate_transition(state, f.model, work, dt)
    move_sensor_states(state.sensor, f.model.block, state.transition, work.sensor)


@kernel()
def advance(f: Filter, now: float, target: float, end: float, step: float) -> None:
    """Advance to the target, inside a sample that ends at `end`, in steps as long as allowed."""
    state, model, work = f.state, f.model, f.work
    span = target - now
    pieces = max(math.ceil(span / f.rules.longest_step - 1e-6), 1)
    dt = span / pieces
    share = dt / step
    for i in range(3):
        work.angle[i] = state.angle[i] * share
        work.velocity_increment[i] = state.velocity_increment[i] * share
        work.coning[i] = state.coning[i] * share
        work.sculling[i] = state.sculling[i] * share
    if abs(dt - state.discretised[0]) > 1e-4 * dt:
        sensor_transition(
            dt,
            model.drift,
            model.diffusion,
            model.block,
            model.interval,
            state.transition,
            state.noise,
        )
        state.discretised[0] = dt
    for piece in range(pieces):
        if model.discrete:
            moving = piece == pieces - 1 and end - target <= 1e-9 * step
            if moving != (state.moved[0] > 0):
                choose_blocks(f, moving)
        navigate_step(f, dt)


@kernel()
def open_node(f: Filter, now: float) -> None:
    """Begin a node, unless there is one at this time."""
    state, nodes = f.state, f.nodes
    if state.nodes[0] > 0 and now <= state.node_time[0] + 1e-9:
        return
    number = state.nodes[0]
    state.nodes[0] += 1
    state.node_time[0] = now
    nodes.time[number % nodes.time.size] = now
    if state.node_top.size == 0:
        return
    if nodes.covariance.shape[0] > 0:
        place = number % nodes.covariance.shape[0]
        size = state.covariance.shape[0]
        for i in range(9):
            for j in range(size):
                nodes.top[place, i, j] = state.node_top[i * 264 + j]
        for j in range(size - 9):
            for q in range(state.node_sensor.shape[1]):
                nodes.transition[place, j, q] = state.node_sensor[j, q]
        for j in range(size):
            nodes.error[place, j] = 0.0
        nodes.aid[place, 0] = state.aided[0]
        nodes.aid[place, 1] = state.aided[0]
    reset_transition(state.node_top, state.node_sensor, f.model.block)


@kernel()
def close_node(f: Filter) -> None:
    """Write what is known at the node."""
    state, nodes = f.state, f.nodes
    number = state.nodes[0] - 1
    place = number % nodes.time.size
    size = state.covariance.shape[0]
    for j in range(size - 9):
        nodes.sensor_state[place, j] = state.sensor[j]
        nodes.sensor_sd[place, j] = math.sqrt(max(state.covariance[9 + j, 9 + j], 0.0))
    if nodes.covariance.shape[0] > 0:
        place = number % nodes.covariance.shape[0]
        for i in range(size):
            for j in range(size):
                nodes.covariance[place, i, j] = state.covariance[i, j]


@kernel()
def judge(f: Filter, kind: int, nis: float, degrees: int) -> bool:
    """Whether a measurement is used; with robust weights it is, for what it is worth."""
    state, rules, z = f.state, f.rules, f.measurement
    accepted = degrees > 0 and nis <= rules.gate[degrees]
    forced = not accepted and state.refused[kind] >= rules.patience
    if degrees > 0 and forced and kind < 2:
        # measurements that keep agreeing with each other are right and the filter is wrong, or
        # what lasts of their errors is another one: say by how much before it is corrected, or
        # the correction would be spread over states that are right. Nothing is refused again
        # until one fits by itself.
        accepted = True
        for i in range(3):
            if not math.isfinite(z.variance[i]):
                continue
            state.covariance[3 * kind + i, 3 * kind + i] += z.residual[i] * z.residual[i]
            for j in range(9, z.error.size):
                if kind == 0 and z.design[i, j] != 0.0:
                    away = z.residual[i] / z.design[i, j]
                    state.covariance[j, j] += away * away
    elif accepted:
        state.refused[kind] = 0
    else:
        state.refused[kind] += 1
    if kind < 2 and degrees > 0 and rules.robustness[0] > 0.0:
        # nothing is refused: what is far off counts for little
        accepted = True
        weight = robust_weight(nis, degrees, rules.robustness)
        for i in range(3):
            z.noise_variance[i] /= weight
    return accepted


@kernel()
def write_innovation(f: Filter, u: int, nis: float, degrees: int, accepted: bool) -> None:
    """Write what was found about the measurement in row u."""
    aiding, z = f.aiding, f.measurement
    aiding.nis[u] = nis
    aiding.degrees[u] = degrees
    aiding.accepted[u] = accepted
    for i in range(3):
        used = math.isfinite(z.variance[i])
        aiding.residual[u, i] = z.residual[i] if used else math.nan
        aiding.deviation[u, i] = z.deviation[i]
        aiding.scalar[u, i, 0] = 0.0
        aiding.scalar[u, i, 1] = 0.0


@kernel()
def update(f: Filter, u: int) -> None:
    """Use the components of a measurement one after the other."""
    state, aiding, z = f.state, f.aiding, f.measurement
    size = z.error.size
    kept = aiding.row.shape[0]
    for i in range(3):
        if not math.isfinite(z.variance[i]):
            continue
        innovation = z.residual[i]
        for j in range(size):
            innovation -= z.design[i, j] * z.error[j]
        s = scalar_update(
            innovation, z.design[i], z.noise_variance[i], state.covariance, z.error, z.gain
        )
        aiding.scalar[u, i, 0] = innovation
        aiding.scalar[u, i, 1] = s
        if kept > 0:
            place = state.aided[0] % kept
            for j in range(size):
                aiding.row[place, i, j] = z.design[i, j]
                aiding.gain[place, i, j] = z.gain[j]


@kernel()
def correct_state(f: Filter) -> None:
    """Take the estimated error out of the state, and keep it for the smoother."""
    state, nodes, error = f.state, f.nodes, f.measurement.error
    feed_back(error, state.position, state.velocity, state.quaternion, state.rotation, state.sensor)
    if nodes.covariance.shape[0] > 0:
        place = (state.nodes[0] - 1) % nodes.covariance.shape[0]
        for j in range(error.size):
            nodes.error[place, j] += error[j]


@kernel()
def aid(f: Filter, k: int, step: float, smooth: bool) -> None:
    """Take the next measurement, which falls into sample k."""
    state, rules, z = f.state, f.rules, f.measurement
    u = state.aided[0] % f.schedule.rows.size
    kind = read_measurement(f, u)
    aiding_model(f, u, kind, k, step)
    if kind < 2:
        scale_noise(kind, rules.robustness, state.adapted, z.noise_variance)
    nis, log_determinant, degrees = innovation_statistics(
        z.residual, z.design, z.noise_variance, state.covariance, z.deviation
    )
    if kind > 1 and not constraint_applies(
        kind, state.velocity, state.covariance, rules.rolling, rules.standing
    ):
        nis, degrees = 0.0, 0
    accepted = judge(f, kind, nis, degrees)
    write_innovation(f, u, nis, degrees, accepted)
    for j in range(z.error.size):
        z.error[j] = 0.0
    if accepted:
        state.log_likelihood[0] -= 0.5 * (nis + log_determinant + degrees * math.log(2.0 * math.pi))
        update(f, u)
    if kind < 2 and degrees > 0:
        adapt_noise(kind, rules.robustness, nis, degrees, z, state.covariance, state.adapted)
    if accepted:
        correct_state(f)
        correct(f, k, step)
        twist(f, step, smooth)
    state.aided[0] += 1
    if f.nodes.aid.shape[0] > 0:
        f.nodes.aid[(state.nodes[0] - 1) % f.nodes.aid.shape[0], 1] = state.aided[0]


@kernel()
def remember(f: Filter, step: float, first: bool) -> None:
    """Keep of a sample what the next one needs."""
    state = f.state
    if f.rules.vehicle >= 0:
        # the springs of a vehicle answer within a fraction of a second; single samples of the
        # gyros are mostly noise
        share = 1.0 if first else min(step / 0.2, 1.0)
        blend = 1.0 if first else min(step / 0.1, 1.0)
        state.rate_share[0] = blend
        state.rate_noise[0] = blend / ((2.0 - blend) * step)
        for i in range(3):
            force = state.velocity_increment[i] / step
            state.mean_force[i] += share * (force - state.mean_force[i])
            rate = state.angle[i] / step
            for c in range(3):
                rate -= state.rotation[c, i] * state.earth[3 + c]
            state.mean_rate[i] += blend * (rate - state.mean_rate[i])
    remember_sample(state.angle, state.velocity_increment, step, state.past)


@kernel(inline=True)
def write_outputs(f: Filter, row: int) -> None:
    """Write the state at a sample."""
    state, out = f.state, f.outputs
    covariance = state.covariance
    for i in range(3):
        out.position[row, i] = state.position[i]
        out.velocity[row, i] = state.velocity[i]
        out.velocity_sd[row, i] = math.sqrt(max(covariance[3 + i, 3 + i], 0.0))
        out.attitude_sd[row, i] = math.sqrt(max(covariance[6 + i, 6 + i], 0.0))
        for j in range(3):
            out.rotation[row, i, j] = state.rotation[i, j]
            out.position_covariance[row, i, j] = covariance[i, j]


@kernel()
def run_filter(f: Filter, begin: int, stop: int, updates: int, closing: bool) -> int:
    """Take samples begin to stop - 1, and the first `updates` measurements as they fall due."""
    state, samples, schedule, rules = f.state, f.samples, f.schedule, f.rules
    for k in range(begin, stop):
        end = samples.time[k]
        first = state.samples[0] == 0
        if first:
            state.time[0] = end
            state.step[0] = samples.time[k + 1] - end
        now = state.time[0]
        step = state.step[0] if first else end - now
        smooth = take_sample(f, k, step, first)
        while True:
            aiding, target = False, end
            if state.aided[0] < updates:
                due = schedule.rows[state.aided[0] % schedule.rows.size]["time"]
                if due <= end:
                    aiding, target = True, due
            if target - now > 1e-9 * step and not first:
                advance(f, now, target, end, step)
                now = target
            if not aiding:
                wanted = first or (closing and k == stop - 1)
                if not wanted and now - state.node_time[0] < rules.node_interval:
                    break
            open_node(f, now)
            if aiding:
                aid(f, k, step, smooth)
            close_node(f)
            if not aiding:
                break
        remember(f, step, first)
        state.time[0], state.step[0] = end, step
        state.samples[0] += 1
        position, velocity = state.position, state.velocity
        if not math.isfinite(position[0] + position[2] + velocity[2] + state.covariance[6, 6]):
            return k
        if f.outputs.position.shape[0] > 0:
            write_outputs(f, k)
    return -1
