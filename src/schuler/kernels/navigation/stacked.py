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
from schuler.kernels.navigation.stacked_aiding import aid_stack
from schuler.kernels.navigation.stacked_data import Stack
from schuler.kernels.navigation.stacked_motion import advance_stack, take_samples
from schuler.kernels.navigation.strapdown import (
    remember_sample,
)
from schuler.kernels.navigation.update import (
    clear,
)

Array = NDArray[np.float64]


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
