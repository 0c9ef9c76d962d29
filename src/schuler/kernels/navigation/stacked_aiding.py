"""What GNSS and the rigid body tell the stacked filter."""

from __future__ import annotations

import math

from schuler.kernels.compile import kernel
from schuler.kernels.navigation.constraint import constraint_model
from schuler.kernels.navigation.stacked_data import Stack
from schuler.kernels.navigation.stacked_motion import correct_all, twist_all
from schuler.kernels.navigation.strapdown import (
    rotate_after,
    rotation_from_quaternion,
)
from schuler.kernels.navigation.update import (
    add_rate_noise,
    clear,
    feed_back,
    innovation_statistics,
    measurement_model,
    scalar_update,
)


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
    elif accepted:
        state.refused[kind] = 0
    else:
        state.refused[kind] += 1
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
        constraint_model(state, i, f.work.body_rate[0], tie)
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
