"""What is followed on line of redundant axes: their variances and the differences of their biases.

The sums of a block of samples, and what they bring up to date at its end.
"""

from __future__ import annotations

import numpy as np

from schuler.kernels.arrays.redundancy_data import Plan
from schuler.kernels.compile import kernel
from schuler.kernels.types import BoolArray, FloatArray, IntArray


@kernel()
def working_variances(
    variance: FloatArray, use: BoolArray, level: float, scatter: float, working: FloatArray
) -> None:
    """Draw variances together as far as their scatter is no more than that of estimation.

    variance (M,): estimated s; use (M,): axes in use; the others keep their s; level: smallest
    variance allowed; scatter: variance of ln s that estimation alone makes; zero: s is taken as it
    is; working (M,): filled in place: ln s pulled to its mean by the share that chance explains
    (James-Stein).
    """
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
    """Let bias differences follow the mean residuals, in the gauge of the mean of the axes.

    means (M,): mean residuals of the block; trust (M,): share of the gain for each axis: less in
    motion, none for a suspect; gain: share of a block; axes (M, 3): all axes; plan: of the axes in
    use with equal weights; bias (M,): brought up to date.
    """
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
def follow_variances(
    excess: FloatArray,
    seen: FloatArray,
    use: BoolArray,
    block: int,
    adaptation: float,
    common: float,
    variance: FloatArray,
    work: FloatArray,
    ratio: FloatArray,
) -> None:
    """Let variances follow the squares of a block: their common level soon, each one slowly.

    What all axes do together is known from all of them, so it can be followed with a short memory;
    by its median, so that one axis does not move the others. excess, seen (M,): sums of f²/q of the
    block, and of how many samples; use (M,): axes in use; block: samples of a block; adaptation,
    common: share of a block in each variance, and in the common level; variance (M,): brought up to
    date; work, ratio (M,): work space.
    """
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
    level = median_of(ratio, use, work) / middle
    level = min(max(level, 0.25), 4.0)
    together, whole, inverse = 1.0 + common * (level - 1.0), adaptation / block, 1.0 / level
    for m in range(variance.size):
        if use[m] and seen[m] > 0.0:
            own = 1.0 + whole * seen[m] * (ratio[m] * inverse - 1.0)
            variance[m] *= together * own


@kernel()
def out_of_use(
    measurements: FloatArray,
    arm_tensor: FloatArray,
    arm: FloatArray,
    start: int,
    stop: int,
    m: int,
    axis: FloatArray,
    bias: float,
    fused: FloatArray,
) -> float:
    """Return by how much an axis that is out differs from what the others say, mean of a block.

    measurements, arm_tensor, arm, fused: as in `schuler.kernels.arrays.redundancy.follow`; start,
    stop: samples of the block; m: the axis; axis (3,): its direction; bias: its bias difference.
    """
    total = 0.0
    for t in range(start, stop):
        total += measurements[t, m] - bias
        for c in range(3):
            total -= axis[c] * fused[t, c]
        if arm_tensor.shape[0] > 0:
            for c in range(9):
                total -= arm_tensor[t, c] * arm[c, m]
    return total / (stop - start)
