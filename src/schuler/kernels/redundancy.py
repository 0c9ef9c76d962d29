"""Redundant axes followed on line: variances, bias differences, fused vector, faults.

Time goes in blocks of some samples. Within a block the weights stand still; at its end variances,
bias differences and smoothed residuals are brought up to date, axes and units that fail their test
are taken out, and those that behave again come back. Whatever a block uses comes from the blocks
before it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.axis_noise import (
    follow_biases,
    follow_variances,
    load_sample,
    median_of,
    out_of_use,
    tally,
    working_variances,
)
from schuler.kernels.compile import kernel
from schuler.kernels.fusion import (
    FloatArray,
    IntArray,
    arrange,
    axis_statistics,
    fuse_sample,
    make_plan,
    weighted_squares,
    worst_unit,
)
from schuler.kernels.parity import let_in, smooth, take_out


@kernel()
def follow(
    measurements: FloatArray,
    arm_tensor: FloatArray,
    arm: FloatArray,
    extra: FloatArray,
    axes: FloatArray,
    unit: IntArray,
    units: int,
    block: int,
    given: FloatArray,
    adaptation: float,
    common: float,
    scatter: float,
    clip: float,
    floor: float,
    bias_gain: float,
    bias_samples: float,
    wander: float,
    spike: float,
    smoothing: FloatArray,
    axis_threshold: FloatArray,
    unit_threshold: FloatArray,
    unit_margin: float,
    factor_gain: float,
    learning: int,
    readmission: float,
    recall: int,
    patience: IntArray,
    bias: FloatArray,
    variance: FloatArray,
    factor: FloatArray,
    status: IntArray,
    fused: FloatArray,
    covariance: FloatArray,
    variances: FloatArray,
    usage: NDArray[np.int8],
    freedom: NDArray[np.int16],
    statistic: FloatArray,
    axis_statistic: FloatArray,
    axis_suspect: NDArray[np.int16],
    unit_statistics: FloatArray,
    unit_suspect: NDArray[np.int16],
    smoothed: FloatArray,
    events: FloatArray,
) -> int:
    """Fuse, weigh and watch redundant axes through a recording.

    Parameters
    ----------
    measurements : (n, M) ndarray
        NaN where missing.
    arm_tensor : (n, 9) or (0, 9) ndarray
        [dw/dt x] + [w x][w x], row by row, 1/s²; empty: no lever arms.
    arm : (9, M) ndarray
        h_b l_c of each axis: times the tensor, what rotation adds to it.
    extra : (n,) or (0,) ndarray
        Variance besides the noise, the same for all axes, that does not average out.
    axes : (M, 3) ndarray
        Unit rows.
    unit : (M,) ndarray of int
        Not decreasing from zero.
    units : int
        Their number.
    block : int
        Samples in a block.
    given : (blocks, M) or (0, M) ndarray
        Variances to use in each block; empty: estimated on line.
    adaptation, common : float
        Share of a block in the estimated variances, and in their common level.
    scatter, floor
        For `working_variances`; the floor is a share of the median.
    clip : float
        Largest f²/q that counts as it is; residuals with a larger one are made smaller together.
    bias_gain : float
        Share of a block in the differences of the biases; zero: they stay.
    bias_samples : float
        Samples behind the differences of the biases at the beginning; infinite: they are known.
    wander : float
        Variance of slow wander of a bias that is no fault.
    spike : float
        F of one axis in one sample beyond which the sample of this axis is not used.
    smoothing : (J,) ndarray
        Share of a block in the smoothed residuals; empty: no faults are looked for.
    axis_threshold, unit_threshold : (J,) ndarray
        F beyond which an axis or a unit is taken out.
    unit_margin : float
        By how much the F of a unit must exceed that of its worst axis to blame the unit.
    factor_gain : float
        Share of a block in the calibration factors of the smoothed residuals.
    learning : int
        Blocks at the beginning in which nothing is taken out.
    readmission : float
        F of an axis taken out below which it behaves.
    recall : int
        Blocks within which what was taken out comes back when the others turn out no better.
    patience : (M,) ndarray of int
        Blocks that it has to behave; doubled each time.
    bias, variance : (M,) ndarray
        At the beginning; brought up to date.
    factor : (J,) ndarray
        Calibration factors, at least one; brought up to date.
    status : (M,) ndarray of int
        0 in use, 1 taken out by itself, 2 with its unit; brought up to date.
    fused : (n, 3) ndarray
        Filled; NaN where the axes that remain leave a direction unmeasured.
    covariance : (blocks, 6) ndarray
        Filled: xx, xy, xz, yy, yz, zz.
    variances : (blocks, M) ndarray
        Filled: s as used.
    usage : (blocks, M) ndarray
        Filled: 0 used, 1 and 2 as status, 3 missing.
    freedom : (blocks,) ndarray
        Filled: degrees of freedom of D.
    statistic, axis_statistic, unit_statistics : (n,) ndarray
        Filled: D, largest F of an axis, largest F of a unit; NaN where some axis is missing in
        this sample alone.
    axis_suspect, unit_suspect : (n,) ndarray
        Filled: which.
    smoothed : (blocks, J) ndarray
        Filled: largest F of an axis by smoothed residuals.
    events : (e, 8) ndarray
        Filled: last sample of the block, kind, axis or unit, scale, F, threshold, size of the
        fault, other axis. Kinds: 0 axis out, 1 unit out, 2 axis back, 3 unit back, 4 axes (6 units)
        contradict one another and none can be blamed, 5 consistent again.

    Returns
    -------
    int
        Number of events; those beyond the space are counted only.
    """
    n, total = measurements.shape
    scales = smoothing.size
    plan, spare, gauge = make_plan(total, units), make_plan(total, units), make_plan(total, units)
    active, bounds, h, pi, weight, testing, inverse, unit_testing = plan
    use, spare_use, here = (
        np.zeros(total, np.bool_),
        np.zeros(total, np.bool_),
        np.zeros(total, np.bool_),
    )
    gauged, gauge_count = np.zeros(total, np.bool_), -1
    y, f, f_spare, ratio = np.zeros(total), np.zeros(total), np.zeros(total), np.zeros(total)
    sums, squares = np.zeros(total), np.zeros(total)
    means, excess, shares = np.zeros(total), np.zeros(total), np.zeros(total)
    trust = np.zeros(total)
    seen = np.zeros(total)
    working, one, worst = variance.copy(), np.ones(total), np.zeros(total)
    average, extra_average = np.zeros((scales, total)), np.zeros(scales)
    noise_share = smoothing / (2.0 - smoothing) / block
    spread, slow = np.zeros(scales), np.zeros(scales)
    steady_share = bias_gain / (2.0 - bias_gain) / block
    quiet, taken = np.zeros(total, np.int64), np.zeros(total, np.int64)
    unresolved = np.zeros(1, np.bool_)
    level, number, mean_extra = 0.0, 0, 0.0
    with_extra, adapting = extra.size > 0, given.shape[0] == 0
    for b in range((n + block - 1) // block):
        start, stop = b * block, min(n, (b + 1) * block)
        for m in range(total):
            # an axis is missing when it is so at both ends; single samples are seen to below
            first, last = measurements[start, m], measurements[stop - 1, m]
            here[m] = first == first or last == last
            use[m] = status[m] == 0 and here[m]
            usage[b, m] = status[m] if here[m] else 3
            means[m] = excess[m] = seen[m] = 0.0
        if adapting:
            if b % 16 == 0:
                level = floor * median_of(variance, use, ratio)
            working_variances(variance, use, level, scatter, working)
        else:
            working[:] = given[b]
        for m in range(total):
            variances[b, m] = working[m]
        motion = max(mean_extra, extra[start]) if with_extra else 0.0
        for m in range(total):
            working[m] += motion
        count = arrange(axes, unit, working, use, plan)
        freedom[b] = max(count - 3, 0)
        if count < 0:
            covariance[b] = np.nan
            smoothed[b] = np.nan
            fused[start:stop] = np.nan
            statistic[start:stop] = axis_statistic[start:stop] = np.nan
            unit_statistics[start:stop] = np.nan
            axis_suspect[start:stop] = unit_suspect[start:stop] = -1
            continue
        covariance[b, 0], covariance[b, 1] = inverse[0, 0], inverse[0, 1]
        covariance[b, 2] = inverse[0, 2]
        covariance[b, 3], covariance[b, 4] = inverse[1, 1], inverse[1, 2]
        covariance[b, 5] = inverse[2, 2]
        for a in range(count):
            sums[a] = squares[a] = 0.0
        whole = 0
        mean_extra = float(np.mean(extra[start:stop])) if with_extra else 0.0
        for t in range(start, stop):
            load_sample(measurements, t, arm_tensor, arm, bias, active, count, y)
            x0, x1, x2 = fuse_sample(y, h, pi, count, f)
            if x0 + x1 + x2 != x0 + x1 + x2:
                # some axis is missing in this sample alone
                statistic[t] = axis_statistic[t] = unit_statistics[t] = np.nan
                axis_suspect[t] = unit_suspect[t] = -1
                fused[t] = np.nan
                for m in range(total):
                    spare_use[m] = use[m] and measurements[t, m] == measurements[t, m]
                left = arrange(axes, unit, working, spare_use, spare)
                if left > 0:
                    load_sample(measurements, t, arm_tensor, arm, bias, spare[0], left, y)
                    fused[t] = fuse_sample(y, spare[2], spare[3], left, f)
                    best, where = axis_statistics(f, spare[5], left, ratio)
                    share = min(1.0, clip / best) if best > 0.0 else 1.0
                    for a in range(left):
                        m = spare[0][a]
                        means[m] += np.sqrt(share) * f[a]
                        excess[m] += share * ratio[a]
                        seen[m] += 1.0
                continue
            fused[t, 0], fused[t, 1], fused[t, 2] = x0, x1, x2
            statistic[t] = weighted_squares(f, weight, count)
            best, where = axis_statistics(f, testing, count, ratio)
            unit_statistics[t], unit_suspect[t] = worst_unit(f, bounds, unit_testing)
            axis_statistic[t], axis_suspect[t] = best, active[where]
            tally(f, ratio, best, clip, count, sums, squares)
            whole += 1
            if best > spike:
                for m in range(total):
                    spare_use[m] = use[m] and m != active[where]
                left = arrange(axes, unit, working, spare_use, spare)
                if left > 3:
                    for a in range(where, count - 1):
                        y[a] = y[a + 1]
                    fused[t] = fuse_sample(y, spare[2], spare[3], left, f_spare)
        for a in range(count):
            m = active[a]
            means[m] += sums[a]
            seen[m] += whole
            # what motion may explain teaches nothing about the noise
            excess[m] += squares[a] + seen[m] * motion * weight[a]
        if adapting and adaptation > 0.0:
            follow_variances(excess, seen, use, block, adaptation, common, variance, f_spare, ratio)
        for m in range(total):
            if seen[m] > 0.0:
                means[m] /= seen[m]
            elif status[m] != 0 and here[m]:
                means[m] = out_of_use(
                    measurements, arm_tensor, arm, start, stop, m, axes[m], bias[m], fused
                )
                seen[m] = block if means[m] == means[m] else 0
                means[m] = means[m] if means[m] == means[m] else 0.0
            shares[m] = min(seen[m] / block, 1.0)
            worst[m] = 0.0
        # the bias differences are means of what has been seen so far, until memory fades
        known = max(bias_samples, (b + 1.0) * block)
        bias_share = max(1.0 / known, steady_share) if bias_samples < np.inf else steady_share
        for j in range(scales):
            extra_average[j] += smoothing[j] * (mean_extra - extra_average[j])
            spread[j] = noise_share[j] + bias_share
            slow[j] = max(extra_average[j] + wander - spread[j] * motion, 0.0)
            size = smooth(
                means,
                shares,
                smoothing[j],
                spread[j],
                slow[j],
                factor[j],
                axis_threshold[j],
                average[j],
                worst,
                plan,
                count,
            )
            if size >= 0.0:
                gain = factor_gain if b > learning else max(factor_gain, 1.0 / (b + 1.0))
                factor[j] = max(factor[j] + gain * (size - factor[j]), 1.0)
            spread[j] *= factor[j]
            slow[j] *= factor[j]
        if bias_gain > 0.0:
            changed = gauge_count < 0
            for m in range(total):
                changed = changed or use[m] != gauged[m]
            if changed:
                gauged[:] = use
                gauge_count = arrange(axes, unit, one, gauged, gauge)
            if gauge_count > 0:
                gain = max(bias_gain, block / known if b >= learning else 0.0)
                for m in range(total):
                    sure = working[m] / (working[m] + motion * block) if motion > 0.0 else 1.0
                    trust[m] = sure if worst[m] < 0.25 else 0.0
                follow_biases(means, trust, gain, axes, gauge, gauge_count, bias)
        smoothed[b] = 0.0
        if scales == 0 or b < learning:
            continue
        count, number = take_out(
            average,
            spread,
            slow,
            axis_threshold,
            unit_threshold,
            unit_margin,
            axes,
            unit,
            working,
            use,
            status,
            quiet,
            taken,
            b,
            recall,
            plan,
            spare,
            count,
            smoothed[b],
            stop - 1,
            unresolved,
            events,
            number,
        )
        number = let_in(
            average,
            spread,
            slow,
            readmission,
            axes,
            unit,
            working,
            here,
            status,
            quiet,
            patience,
            plan,
            stop - 1,
            events,
            number,
        )
    return number
