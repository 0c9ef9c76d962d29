"""Redundant axes followed on line: variances, bias differences, fused vector, faults.

Time goes in blocks of some samples. Within a block the weights stand still; at its end variances,
bias differences and smoothed residuals are brought up to date, axes and units that fail their test
are taken out, and those that behave again come back. Whatever a block uses comes from the blocks
before it.
"""

from __future__ import annotations

import math

from schuler.kernels.arrays.axis_noise import (
    follow_biases,
    follow_variances,
    load_sample,
    median_of,
    out_of_use,
    tally,
    working_variances,
)
from schuler.kernels.arrays.fusion import (
    arrange,
    axis_statistics,
    fuse_sample,
    weighted_squares,
    worst_unit,
)
from schuler.kernels.arrays.parity import let_in, smooth, take_out
from schuler.kernels.arrays.redundancy_data import Redundancy
from schuler.kernels.compile import kernel


@kernel()
def begin_block(r: Redundancy, b: int, start: int, stop: int) -> None:
    """See which axes deliver values, choose the variances, and arrange the axes in use."""
    given, memory, work, out = r.given, r.memory, r.work, r.out
    measurements = given.measurements
    total = memory.use.size
    for m in range(total):
        # an axis is missing when it is so at both ends; single samples are seen to below
        first, last = measurements[start, m], measurements[stop - 1, m]
        work.here[m] = first == first or last == last
        memory.use[m] = memory.status[m] == 0 and work.here[m]
        out.usage[b, m] = memory.status[m] if work.here[m] else 3
        work.means[m] = work.excess[m] = work.seen[m] = 0.0
    if given.given.shape[0] == 0:
        if b % 16 == 0:
            memory.level[0] = r.tuning.floor * median_of(memory.variance, memory.use, work.ratio)
        working_variances(
            memory.variance, memory.use, memory.level[0], r.tuning.scatter, work.working
        )
    else:
        for m in range(total):
            work.working[m] = given.given[b, m]
    motion = max(memory.mean_extra[0], given.extra[start]) if given.extra.size > 0 else 0.0
    for m in range(total):
        out.variances[b, m] = work.working[m]
        work.working[m] += motion
    arrange(given.axes, given.unit, work.working, memory.use, r.plan)
    out.freedom[b] = max(r.plan.count[0] - 3, 0)
    memory.sample[0] = stop - 1


@kernel()
def leave_out(r: Redundancy, b: int, start: int, stop: int) -> None:
    """Write a block that leaves a direction unmeasured."""
    out = r.out
    for i in range(6):
        out.covariance[b, i] = math.nan
    for j in range(out.smoothed.shape[1]):
        out.smoothed[b, j] = math.nan
    for t in range(start, stop):
        for i in range(3):
            out.fused[t, i] = math.nan
        out.statistic[t] = out.axis_statistic[t] = out.unit_statistic[t] = math.nan
        out.axis_suspect[t] = out.unit_suspect[t] = -1


@kernel()
def fuse_without_missing(r: Redundancy, t: int) -> None:
    """Fuse a sample in which some axis is missing in this sample alone."""
    given, memory, work, out, spare = r.given, r.memory, r.work, r.out, r.spare
    out.statistic[t] = out.axis_statistic[t] = out.unit_statistic[t] = math.nan
    out.axis_suspect[t] = out.unit_suspect[t] = -1
    for i in range(3):
        out.fused[t, i] = math.nan
    for m in range(memory.use.size):
        value = given.measurements[t, m]
        work.spare_use[m] = memory.use[m] and value == value
    left = arrange(given.axes, given.unit, work.working, work.spare_use, spare)
    if left <= 0:
        return
    load_sample(
        given.measurements, t, given.arm_tensor, given.arm, memory.bias, spare.active, left, work.y
    )
    x0, x1, x2 = fuse_sample(work.y, spare.h, spare.pi, left, work.f)
    out.fused[t, 0], out.fused[t, 1], out.fused[t, 2] = x0, x1, x2
    best, _ = axis_statistics(work.f, spare.testing, left, work.ratio)
    share = min(1.0, r.tuning.clip / best) if best > 0.0 else 1.0
    for a in range(left):
        m = spare.active[a]
        work.means[m] += math.sqrt(share) * work.f[a]
        work.excess[m] += share * work.ratio[a]
        work.seen[m] += 1.0


@kernel()
def fuse_without_spike(r: Redundancy, t: int, where: int) -> None:
    """Fuse a sample once more without the axis that is in place `where` of the plan."""
    given, memory, work, spare = r.given, r.memory, r.work, r.spare
    for m in range(memory.use.size):
        work.spare_use[m] = memory.use[m] and m != r.plan.active[where]
    left = arrange(given.axes, given.unit, work.working, work.spare_use, spare)
    if left > 3:
        for a in range(where, r.plan.count[0] - 1):
            work.y[a] = work.y[a + 1]
        x0, x1, x2 = fuse_sample(work.y, spare.h, spare.pi, left, work.f_spare)
        r.out.fused[t, 0], r.out.fused[t, 1], r.out.fused[t, 2] = x0, x1, x2


@kernel()
def fuse_block(r: Redundancy, b: int, start: int, stop: int) -> None:
    """Fuse and test the samples of a block, and add up their residuals."""
    given, memory, work, out, plan = r.given, r.memory, r.work, r.out, r.plan
    inverse, count = plan.inverse, plan.count[0]
    active, y, f, ratio = plan.active, work.y, work.f, work.ratio
    out.covariance[b, 0], out.covariance[b, 1] = inverse[0, 0], inverse[0, 1]
    out.covariance[b, 2] = inverse[0, 2]
    out.covariance[b, 3], out.covariance[b, 4] = inverse[1, 1], inverse[1, 2]
    out.covariance[b, 5] = inverse[2, 2]
    for a in range(count):
        work.sums[a] = work.squares[a] = 0.0
    whole = 0
    for t in range(start, stop):
        load_sample(
            given.measurements, t, given.arm_tensor, given.arm, memory.bias, active, count, y
        )
        x0, x1, x2 = fuse_sample(y, plan.h, plan.pi, count, f)
        if x0 + x1 + x2 != x0 + x1 + x2:
            fuse_without_missing(r, t)
            continue
        out.fused[t, 0], out.fused[t, 1], out.fused[t, 2] = x0, x1, x2
        out.statistic[t] = weighted_squares(f, plan.weight, count)
        best, where = axis_statistics(f, plan.testing, count, ratio)
        out.unit_statistic[t], out.unit_suspect[t] = worst_unit(f, plan.bounds, plan.unit_testing)
        out.axis_statistic[t], out.axis_suspect[t] = best, active[where]
        tally(f, ratio, best, r.tuning.clip, count, work.sums, work.squares)
        whole += 1
        if best > r.tuning.spike:
            fuse_without_spike(r, t, where)
    motion = motion_of(r, start)
    for a in range(count):
        m = active[a]
        work.means[m] += work.sums[a]
        work.seen[m] += whole
        # what motion may explain teaches nothing about the noise
        work.excess[m] += work.squares[a] + work.seen[m] * motion * plan.weight[a]


@kernel()
def motion_of(r: Redundancy, start: int) -> float:
    """Variance of motion that the block was weighed with."""
    extra = r.given.extra
    return max(r.memory.mean_extra[0], extra[start]) if extra.size > 0 else 0.0


@kernel()
def mean_residuals(r: Redundancy, start: int, stop: int) -> None:
    """Let variances follow, and make means of the residuals, also of axes that are out."""
    given, memory, work, tuning = r.given, r.memory, r.work, r.tuning
    if given.given.shape[0] == 0 and tuning.adaptation > 0.0:
        follow_variances(r)
    for m in range(memory.use.size):
        if work.seen[m] > 0.0:
            work.means[m] /= work.seen[m]
        elif memory.status[m] != 0 and work.here[m]:
            mean = out_of_use(r, start, stop, m)
            work.seen[m] = tuning.block if mean == mean else 0.0
            work.means[m] = mean if mean == mean else 0.0
        work.shares[m] = min(work.seen[m] / tuning.block, 1.0)
        work.worst[m] = 0.0


@kernel()
def smooth_block(r: Redundancy, b: int, motion: float, known: float) -> None:
    """Bring the smoothed residuals of all time constants up to date."""
    memory, work, tuning = r.memory, r.work, r.tuning
    steady = tuning.bias_gain / (2.0 - tuning.bias_gain) / tuning.block
    bias_share = max(1.0 / known, steady) if tuning.bias_samples < math.inf else steady
    for j in range(tuning.smoothing.size):
        share = tuning.smoothing[j]
        memory.extra_average[j] += share * (memory.mean_extra[0] - memory.extra_average[j])
        work.spread[j] = work.noise_share[j] + bias_share
        slow = memory.extra_average[j] + tuning.wander - work.spread[j] * motion
        work.slow[j] = max(slow, 0.0)
        size = smooth(r, j)
        if size >= 0.0:
            gain = tuning.factor_gain
            if b <= tuning.learning:
                gain = max(gain, 1.0 / (b + 1.0))
            memory.factor[j] = max(memory.factor[j] + gain * (size - memory.factor[j]), 1.0)
        work.spread[j] *= memory.factor[j]
        work.slow[j] *= memory.factor[j]


@kernel()
def gauge_biases(r: Redundancy, b: int, motion: float, known: float) -> None:
    """Let the differences of the biases follow the mean residuals."""
    memory, work, tuning, gauge = r.memory, r.work, r.tuning, r.gauge
    changed = gauge.count[0] < 0
    for m in range(memory.use.size):
        changed = changed or memory.use[m] != memory.gauged[m]
    if changed:
        for m in range(memory.use.size):
            memory.gauged[m] = memory.use[m]
        arrange(r.given.axes, r.given.unit, work.one, memory.gauged, gauge)
    if gauge.count[0] > 0:
        gain = max(tuning.bias_gain, tuning.block / known if b >= tuning.learning else 0.0)
        for m in range(memory.use.size):
            sure = 1.0
            if motion > 0.0:
                sure = work.working[m] / (work.working[m] + motion * tuning.block)
            work.trust[m] = sure if work.worst[m] < 0.25 else 0.0
        follow_biases(work.means, work.trust, gain, r.given.axes, gauge, memory.bias)


@kernel()
def follow(r: Redundancy) -> int:
    """Fuse, weigh and watch redundant axes through a recording; returns the number of events."""
    memory, tuning, extra = r.memory, r.tuning, r.given.extra
    n, block = r.given.measurements.shape[0], tuning.block
    for b in range((n + block - 1) // block):
        start, stop = b * block, min(n, (b + 1) * block)
        begin_block(r, b, start, stop)
        if r.plan.count[0] < 0:
            leave_out(r, b, start, stop)
            continue
        motion = motion_of(r, start)
        fuse_block(r, b, start, stop)
        memory.mean_extra[0] = 0.0
        if extra.size > 0:
            total = 0.0
            for t in range(start, stop):
                total += extra[t]
            memory.mean_extra[0] = total / (stop - start)
        mean_residuals(r, start, stop)
        # the bias differences are means of what has been seen so far, until memory fades
        known = max(tuning.bias_samples, memory.seen[0] + (b + 1.0) * block)
        smooth_block(r, b, motion, known)
        if tuning.bias_gain > 0.0:
            gauge_biases(r, b, motion, known)
        for j in range(tuning.smoothing.size):
            r.out.smoothed[b, j] = 0.0
        if tuning.smoothing.size == 0 or b < tuning.learning:
            continue
        take_out(r, b)
        let_in(r)
    return int(memory.events[0])
