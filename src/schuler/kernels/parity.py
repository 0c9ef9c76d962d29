"""Faults in smoothed residuals: found, put on an axis or a unit, taken out and let back in.

Residuals smoothed over a time constant have the covariance of one sample times a share that the
smoothing leaves (theta / (2 - theta) for independent samples), times a factor that is learnt from
healthy data, because biases wander (spec 6.5), plus what motion adds to all of them.
"""

from __future__ import annotations

import numpy as np

from schuler.kernels.compile import kernel
from schuler.kernels.fusion import (
    BoolArray,
    FloatArray,
    IntArray,
    Plan,
    arrange,
    unit_statistic,
)


@kernel()
def log_event(
    events: FloatArray,
    number: int,
    sample: int,
    kind: int,
    index: int,
    scale: int,
    statistic: float,
    threshold: float,
    size: float,
    other: int,
) -> int:
    """Write one line of the log, if there is room, and return the number of lines.

    Parameters
    ----------
    events : (e, 8) ndarray
        The log.
    number : int
        Lines so far.
    sample, kind, index, scale, statistic, threshold, size, other
        What is written; see `schuler.kernels.redundancy.follow`.

    Returns
    -------
    int
        number + 1.
    """
    if number < events.shape[0]:
        events[number, 0], events[number, 1] = sample, kind
        events[number, 2], events[number, 3] = index, scale
        events[number, 4], events[number, 5] = statistic, threshold
        events[number, 6], events[number, 7] = size, other
    return number + 1


@kernel()
def reproject(average: FloatArray, axes: FloatArray, plan: Plan, count: int) -> None:
    """Refer smoothed residuals of all axes to the axes now in use, in place.

    Parameters
    ----------
    average : (M,) ndarray
        Residuals y - A x for some x, so that their projection needs no measurement.
    axes : (M, 3) ndarray
        All axes.
    plan, count
        From `arrange`.
    """
    active, _, _, pi, _, _, _, _ = plan
    x0 = x1 = x2 = 0.0
    for a in range(count):
        value = average[active[a]]
        x0 += pi[0, a] * value
        x1 += pi[1, a] * value
        x2 += pi[2, a] * value
    for m in range(average.size):
        average[m] -= axes[m, 0] * x0 + axes[m, 1] * x1 + axes[m, 2] * x2


@kernel()
def alike(a: int, plan: Plan, count: int) -> int:
    """Return another axis in use whose fault would look the same, or -1.

    Parameters
    ----------
    a : int
        Place of the suspect among the axes in use.
    plan, count
        From `arrange`.

    Returns
    -------
    int
        Number of the other axis: its residual is wholly correlated with that of the suspect.
    """
    active, _, h, pi, weight, testing, _, _ = plan
    for b in range(count):
        if b != a:
            cross = h[0, a] * pi[0, b] + h[1, a] * pi[1, b] + h[2, a] * pi[2, b]
            cross /= weight[b]
            if cross * cross * testing[a] * testing[b] > 0.98:
                return int(active[b])
    return -1


@kernel()
def smooth(
    means: FloatArray,
    shares: FloatArray,
    theta: float,
    noise_share: float,
    extra: float,
    factor: float,
    threshold: float,
    average: FloatArray,
    worst: FloatArray,
    plan: Plan,
    count: int,
) -> float:
    """Bring smoothed residuals of one time constant up to date.

    Parameters
    ----------
    means : (M,) ndarray
        Mean residuals of the block.
    shares : (M,) ndarray
        Share of the block's samples that were there.
    theta : float
        Share of a block.
    noise_share : float
        What smoothing, and the mean that is removed, leave of the variance of a sample.
    extra : float
        Variance from motion and wander, which smoothing does not lessen.
    factor : float
        How much larger than that the smoothed residuals have been.
    threshold : float
        F beyond which an axis is faulty.
    average : (M,) ndarray
        Smoothed residuals, brought up to date.
    worst : (M,) ndarray
        Largest F over its threshold of each axis, brought up to date.
    plan, count
        From `arrange`.

    Returns
    -------
    float
        Mean over the axes of F without the factor, each limited to nine times the factor; -1
        when there is none.
    """
    active, _, _, _, weight, testing, _, _ = plan
    for m in range(means.size):
        average[m] += theta * shares[m] * (means[m] - average[m])
    total, number = 0.0, 0
    for a in range(count):
        if testing[a] > 0.0:
            value = average[active[a]]
            ratio = value * value * testing[a] / (noise_share + weight[a] * extra)
            worst[active[a]] = max(worst[active[a]], ratio / (factor * threshold))
            total += min(ratio, 9.0 * factor)
            number += 1
    return total / number if number else -1.0


@kernel()
def find_fault(
    average: FloatArray,
    spread: FloatArray,
    extra: FloatArray,
    axis_threshold: FloatArray,
    unit_threshold: FloatArray,
    unit_margin: float,
    plan: Plan,
    count: int,
    largest: FloatArray,
) -> tuple[float, int, int, int]:
    """Find the axis or unit whose fault explains the smoothed residuals best.

    Parameters
    ----------
    average : (J, M) ndarray
        Smoothed residuals.
    spread, extra : (J,) ndarray
        What is left of the variance of a sample, and what motion and wander add.
    axis_threshold, unit_threshold : (J,) ndarray
        F beyond which an axis or a unit is faulty.
    unit_margin : float
        By how much F of a unit must exceed that of its worst axis to blame the unit.
    plan, count
        From `arrange`.
    largest : (J,) ndarray
        Filled with the largest F of an axis.

    Returns
    -------
    tuple
        F over its threshold, the place of the axis (or of the unit's first), the unit or -1, and
        the time constant.
    """
    active, bounds, _, _, weight, testing, _, unit_testing = plan
    f, ratio = np.zeros(count), np.zeros(count)
    best, chosen, chosen_unit, scale = 0.0, 0, -1, 0
    for j in range(spread.size):
        largest[j] = 0.0
        for a in range(count):
            f[a] = average[j, active[a]]
            ratio[a] = f[a] * f[a] * testing[a] / (spread[j] + weight[a] * extra[j])
            largest[j] = max(largest[j], ratio[a])
            if ratio[a] > best * axis_threshold[j]:
                best, chosen, chosen_unit, scale = ratio[a] / axis_threshold[j], a, -1, j
        for u in range(bounds.size - 1):
            first, size = bounds[u], bounds[u + 1] - bounds[u]
            if size < 2 or size > 3:
                continue
            value = unit_statistic(f, first, size, unit_testing, u)
            strongest, most = 0.0, 0.0
            for a in range(first, first + size):
                strongest = max(strongest, ratio[a])
                most = max(most, weight[a])
            # by the axis that is known best, so that motion is not blamed on a unit
            value /= spread[j] + most * extra[j]
            if value - strongest > unit_margin and value > best * unit_threshold[j]:
                best, chosen, chosen_unit, scale = value / unit_threshold[j], first, u, j
    return best, chosen, chosen_unit, scale


@kernel()
def take_out(
    average: FloatArray,
    spread: FloatArray,
    extra: FloatArray,
    axis_threshold: FloatArray,
    unit_threshold: FloatArray,
    unit_margin: float,
    axes: FloatArray,
    unit: IntArray,
    working: FloatArray,
    use: BoolArray,
    status: IntArray,
    quiet: IntArray,
    taken: IntArray,
    now: int,
    recall: int,
    plan: Plan,
    spare: Plan,
    count: int,
    largest: FloatArray,
    sample: int,
    unresolved: BoolArray,
    events: FloatArray,
    number: int,
) -> tuple[int, int]:
    """Take out what fails its test, one after another, as long as it can be told apart.

    Parameters
    ----------
    average, spread, extra, axis_threshold, unit_threshold, unit_margin, largest
        As in `find_fault`; the averages are referred to the axes that remain.
    axes, unit, working
        Of all axes; their variances.
    use, status, quiet, taken : (M,) ndarray
        Brought up to date; taken is the block in which an axis was taken out.
    now : int
        Number of the block.
    recall : int
        Blocks within which what was taken out comes back when the others turn out no better.
    plan, spare : tuple
        The plan, brought up to date, and room for another.
    count : int
        Axes in use.
    sample : int
        For the log.
    unresolved : (1,) ndarray of bool
        Whether the axes disagree in a way that blames nobody; brought up to date.
    events, number
        The log and its length.

    Returns
    -------
    tuple of int
        Axes in use, and the length of the log.
    """
    active, bounds, _, _, weight, testing, _, _ = plan
    peak = np.zeros(largest.size)
    first_look = True
    before = average.copy()
    while True:
        best, chosen, blamed, scale = find_fault(
            average, spread, extra, axis_threshold, unit_threshold, unit_margin, plan, count, peak
        )
        if first_look:
            largest[:] = peak
            first_look = False
            if unresolved[0] and best < 0.5:
                unresolved[0] = False
                number = log_event(events, number, sample, 5, -1, -1, 0.0, 0.0, 0.0, -1)
        if best <= 1.0:
            return count, number
        m = active[chosen]
        threshold = axis_threshold[scale] if blamed < 0 else unit_threshold[scale]
        rival = alike(chosen, plan, count) if blamed < 0 else _other_unit(blamed, bounds, active)
        for i in range(use.size):
            out = i == m if blamed < 0 else unit[i] == blamed
            if out and use[i]:
                use[i] = False
                status[i] = -1
        left = arrange(axes, unit, working, use, spare) if rival < 0 else -1
        if left < 0 or 2 * (left - 3) < use.size - 3:
            for i in range(use.size):
                if status[i] == -1:
                    use[i], status[i] = True, 0
            if rival < 0:
                # the accused would be the majority: it is not they who are wrong
                number = _recall(unit, status, taken, now - recall, use, sample, events, number)
                average[:] = before
                count = arrange(axes, unit, working, use, plan)
            if not unresolved[0]:
                number = log_event(
                    events,
                    number,
                    sample,
                    4 if blamed < 0 else 6,
                    m if blamed < 0 else blamed,
                    scale,
                    best * threshold,
                    threshold,
                    0.0,
                    rival,
                )
            unresolved[0] = True
            return count, number
        for i in range(use.size):
            if status[i] == -1:
                status[i], quiet[i], taken[i] = (1 if blamed < 0 else 2), 0, now
        # what shows in its own residual is the share q/s of the fault
        share = 1.0 / (testing[chosen] / weight[chosen]) if testing[chosen] > 0.0 else 1.0
        number = log_event(
            events,
            number,
            sample,
            0 if blamed < 0 else 1,
            m if blamed < 0 else blamed,
            scale,
            best * threshold,
            threshold,
            average[scale, m] / share,
            -1,
        )
        count = arrange(axes, unit, working, use, plan)
        for j in range(spread.size):
            reproject(average[j], axes, plan, count)


@kernel()
def _recall(
    unit: IntArray,
    status: IntArray,
    taken: IntArray,
    since: int,
    use: BoolArray,
    sample: int,
    events: FloatArray,
    number: int,
) -> int:
    """Put back what was taken out since a block, and log it; return the length of the log."""
    for m in range(status.size):
        if status[m] > 0 and taken[m] >= since:
            whole = status[m] == 2
            kind, index = (3, unit[m]) if whole else (2, m)
            number = log_event(events, number, sample, kind, index, -1, 0.0, 0.0, 0.0, -1)
            for i in range(m, status.size):
                if i == m or (whole and unit[i] == unit[m] and status[i] == 2):
                    status[i] = 0
                    use[i] = True
    return number


@kernel()
def _other_unit(blamed: int, bounds: IntArray, active: IntArray) -> int:
    """Return an axis of the only other unit, which could be the faulty one as well; or -1."""
    others, last = 0, -1
    for u in range(bounds.size - 1):
        if u != blamed and bounds[u + 1] > bounds[u]:
            others += 1
            last = active[bounds[u]]
    return last if others < 2 else -1


@kernel()
def let_in(
    average: FloatArray,
    spread: FloatArray,
    extra: FloatArray,
    readmission: float,
    axes: FloatArray,
    unit: IntArray,
    working: FloatArray,
    here: BoolArray,
    status: IntArray,
    quiet: IntArray,
    patience: IntArray,
    plan: Plan,
    sample: int,
    events: FloatArray,
    number: int,
) -> int:
    """Let back in what has agreed with the others for long enough.

    Parameters
    ----------
    average, spread, extra
        As in `find_fault`.
    readmission : float
        F of an axis that is out, against what the others predict, below which it behaves.
    axes, unit, working
        Of all axes; their variances.
    here : (M,) ndarray of bool
        Whether an axis delivers values.
    status, quiet, patience : (M,) ndarray of int
        Brought up to date; the patience with an axis is doubled each time it comes back.
    plan : tuple
        From `arrange`.
    sample, events, number
        The log.

    Returns
    -------
    int
        Length of the log.
    """
    _, _, _, _, _, _, inverse, _ = plan
    for m in range(status.size):
        if status[m] == 0:
            continue
        p = working[m]
        for i in range(3):
            for c in range(3):
                p += axes[m, i] * inverse[i, c] * axes[m, c]
        behaves = here[m]
        for j in range(spread.size):
            if average[j, m] ** 2 > readmission * (p * spread[j] + extra[j]):
                behaves = False
        quiet[m] = quiet[m] + 1 if behaves else 0
    for m in range(status.size):
        if status[m] == 0:
            continue
        whole = status[m] == 2
        ready = quiet[m] >= patience[m]
        for i in range(status.size):
            if whole and unit[i] == unit[m] and status[i] == 2 and quiet[i] < patience[i]:
                ready = False
        if ready:
            kind, index = (3, unit[m]) if whole else (2, m)
            number = log_event(events, number, sample, kind, index, -1, 0.0, 0.0, 0.0, -1)
            for i in range(status.size):
                if i == m or (whole and unit[i] == unit[m] and status[i] == 2):
                    status[i], quiet[i] = 0, 0
                    patience[i] *= 2
    return number
