"""What is followed on line of redundant axes: their variances and the differences of their biases.

The sums of a block of samples, and what they bring up to date at its end.
"""

from __future__ import annotations

import numpy as np

from schuler.kernels.arrays.redundancy_data import Plan, Redundancy
from schuler.kernels.compile import kernel
from schuler.kernels.types import BoolArray, FloatArray, IntArray


@kernel()
def working_variances(
    variance: FloatArray, use: BoolArray, level: float, scatter: float, working: FloatArray
) -> None:
    """Draw variances together as far as their scatter is no more than that of estimation."""
    mean = square = 0.0
    count = 0
    for m in range(variance.size):
        working[m] = max(variance[m], level)
        count += use[m]
    if scatter <= 0.0 or count < 4:
        return
    for m in range(variance.size):
        if use[m]:
            value = np.log(working[m])
            working[m] = value
            mean += value
            square += value * value
    mean /= count
    spread = square / count - mean * mean
    # three of `count` degrees of freedom go into the mean and the comparison
    chance = scatter * (count - 3.0) / count
    keep = 1.0 - chance / spread if spread > chance else 0.0
    together = np.exp(mean)
    for m in range(variance.size):
        if use[m]:
            working[m] = np.exp(mean + keep * (working[m] - mean)) if keep > 0.0 else together


@kernel()
def median_of(values: FloatArray, use: BoolArray, work: FloatArray) -> float:
    """Return the median of the values in use.

    values (M,): numbers; use (M,): which; work (M,): work space.
    """
    count = 0
    for m in range(values.size):
        count += use[m]
    if count == 0:
        return 0.0
    # the smaller half in order; every place is found without asking where the value belongs
    half = count // 2
    for place in range(half + 1):
        work[place] = np.inf
    for m in range(values.size):
        if use[m]:
            value = values[m]
            for place in range(half, 0, -1):
                work[place] = max(work[place - 1], min(work[place], value))
            work[0] = min(work[0], value)
    return float(0.5 * (work[half] + work[(count - 1) // 2]))


@kernel(inline=True)
def load_sample(
    measurements: FloatArray,
    t: int,
    arm_tensor: FloatArray,
    arm: FloatArray,
    bias: FloatArray,
    active: IntArray,
    count: int,
    y: FloatArray,
) -> None:
    """Take one sample of the axes in use, less bias differences and what rotation adds.

    measurements, arm_tensor, arm: as in `schuler.kernels.arrays.redundancy.follow`; t: the sample;
    bias (M,): bias differences; active, count: from the plan; y (M,): filled in place.
    """
    if count == bias.size:
        for m in range(count):
            y[m] = measurements[t, m] - bias[m]
    else:
        for a in range(count):
            m = active[a]
            y[a] = measurements[t, m] - bias[m]
    if arm_tensor.shape[0] > 0:
        for c in range(9):
            value = arm_tensor[t, c]
            for a in range(count):
                y[a] -= value * arm[c, active[a]]


@kernel(inline=True)
def tally(
    f: FloatArray,
    ratio: FloatArray,
    best: float,
    clip: float,
    count: int,
    sums: FloatArray,
    squares: FloatArray,
) -> None:
    """Add residuals and their ratios to the sums of the block, outliers made smaller.

    f, ratio (M,): residuals, and f²/q; best: the largest ratio; clip: largest ratio that counts as
    it is; count: axes in use; sums, squares (M,): brought up to date.
    """
    if best <= clip:
        for a in range(count):
            sums[a] += f[a]
            squares[a] += ratio[a]
        return
    # all residuals by the same share: their pattern is what tells who it was
    share = clip / best
    limit = np.sqrt(share)
    for a in range(count):
        sums[a] += limit * f[a]
        squares[a] += share * ratio[a]


@kernel()
def follow_biases(
    means: FloatArray,
    trust: FloatArray,
    gain: float,
    axes: FloatArray,
    plan: Plan,
    bias: FloatArray,
) -> None:
    """Let bias differences follow the mean residuals, in the gauge of the mean of the axes."""
    active, pi, count = plan.active, plan.pi, plan.count[0]
    x0 = x1 = x2 = 0.0
    for a in range(count):
        m = active[a]
        change = gain * trust[m] * means[m]
        x0 += pi[0, a] * change
        x1 += pi[1, a] * change
        x2 += pi[2, a] * change
    for a in range(count):
        m = active[a]
        change = gain * trust[m] * means[m]
        bias[m] += change - axes[m, 0] * x0 - axes[m, 1] * x1 - axes[m, 2] * x2


@kernel()
def follow_variances(r: Redundancy) -> None:
    """Let variances follow the squares of a block: their common level soon, each one slowly."""
    tuning, use, variance = r.tuning, r.memory.use, r.memory.variance
    excess, seen, ratio = r.work.excess, r.work.seen, r.work.ratio
    number, samples = 0, 0.0
    for m in range(variance.size):
        ratio[m] = excess[m] / seen[m] if seen[m] > 0.0 else 1.0
        if use[m] and seen[m] > 0.0:
            number += 1
            samples += seen[m]
    if number == 0:
        return
    # median of a mean of squares (Wilson and Hilferty)
    middle = (1.0 - 2.0 * number / (9.0 * samples)) ** 3
    level = median_of(ratio, use, r.work.f_spare) / middle
    level = min(max(level, 0.25), 4.0)
    together, inverse = 1.0 + tuning.common * (level - 1.0), 1.0 / level
    whole = tuning.adaptation / tuning.block
    for m in range(variance.size):
        if use[m] and seen[m] > 0.0:
            own = 1.0 + whole * seen[m] * (ratio[m] * inverse - 1.0)
            variance[m] *= together * own


@kernel()
def out_of_use(r: Redundancy, start: int, stop: int, m: int) -> float:
    """Return by how much axis m, which is out, differs from what the others say, mean of a block.

    start, stop: samples of the block.
    """
    measurements, arm_tensor, arm = r.given.measurements, r.given.arm_tensor, r.given.arm
    axis, bias, fused = r.given.axes[m], r.memory.bias[m], r.out.fused
    total = 0.0
    for t in range(start, stop):
        total += measurements[t, m] - bias
        for c in range(3):
            total -= axis[c] * fused[t, c]
        if arm_tensor.shape[0] > 0:
            for c in range(9):
                total -= arm_tensor[t, c] * arm[c, m]
    return total / (stop - start)
