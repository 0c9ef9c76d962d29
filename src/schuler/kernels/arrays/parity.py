"""Faults in smoothed residuals: found, put on an axis or a unit, taken out and let back in.

Residuals smoothed over a time constant have the covariance of one sample times a share that the
smoothing leaves (theta / (2 - theta) for independent samples), times a factor that is learnt from
healthy data, because biases wander (spec 6.5), plus what motion adds to all of them.
"""

from __future__ import annotations

from schuler.kernels.arrays.fusion import arrange, unit_statistic
from schuler.kernels.arrays.redundancy_data import Plan, Redundancy
from schuler.kernels.compile import kernel
from schuler.kernels.types import FloatArray


@kernel()
def log_event(
    r: Redundancy,
    kind: int,
    index: int,
    scale: int,
    statistic: float,
    threshold: float,
    size: float,
    other: int,
) -> None:
    """Write one line of the log, if there is room; see `FollowedOutputs`."""
    events, number = r.out.events, r.memory.events[0]
    if number < events.shape[0]:
        events[number, 0], events[number, 1] = r.memory.sample[0], kind
        events[number, 2], events[number, 3] = index, scale
        events[number, 4], events[number, 5] = statistic, threshold
        events[number, 6], events[number, 7] = size, other
    r.memory.events[0] += 1


@kernel()
def reproject(average: FloatArray, axes: FloatArray, plan: Plan) -> None:
    """Refer smoothed residuals (M,) of all axes to the axes now in use, in place.

    They are y - A x for some x, so that their projection needs no measurement.
    """
    x0 = x1 = x2 = 0.0
    for a in range(plan.count[0]):
        value = average[plan.active[a]]
        x0 += plan.pi[0, a] * value
        x1 += plan.pi[1, a] * value
        x2 += plan.pi[2, a] * value
    for m in range(average.size):
        average[m] -= axes[m, 0] * x0 + axes[m, 1] * x1 + axes[m, 2] * x2


@kernel()
def alike(a: int, plan: Plan) -> int:
    """Return another axis in use whose fault would look the same as that of place a, or -1.

    Its residual is wholly correlated with that of the suspect.
    """
    h, pi, weight, testing = plan.h, plan.pi, plan.weight, plan.testing
    for b in range(plan.count[0]):
        if b != a:
            cross = h[0, a] * pi[0, b] + h[1, a] * pi[1, b] + h[2, a] * pi[2, b]
            cross /= weight[b]
            if cross * cross * testing[a] * testing[b] > 0.98:
                return int(plan.active[b])
    return -1


@kernel()
def smooth(r: Redundancy, j: int) -> float:
    """Bring the smoothed residuals of time constant j up to date, and the worst F of each axis.

    Returns the mean over the axes of F without the factor, each limited to nine times the factor;
    -1 when there is none.
    """
    work, plan, average = r.work, r.plan, r.memory.average
    theta, factor = r.tuning.smoothing[j], r.memory.factor[j]
    threshold = r.tuning.axis_threshold[j]
    for m in range(work.means.size):
        average[j, m] += theta * work.shares[m] * (work.means[m] - average[j, m])
    total, number = 0.0, 0
    for a in range(plan.count[0]):
        if plan.testing[a] > 0.0:
            m = plan.active[a]
            value = average[j, m]
            ratio = value * value * plan.testing[a]
            ratio /= work.spread[j] + plan.weight[a] * work.slow[j]
            work.worst[m] = max(work.worst[m], ratio / (factor * threshold))
            total += min(ratio, 9.0 * factor)
            number += 1
    return total / number if number else -1.0


@kernel()
def find_fault(r: Redundancy) -> tuple[float, int, int, int]:
    """Find the axis or unit whose fault explains the smoothed residuals best.

    Returns F over its threshold, the place of the axis (or of the unit's first), the unit or -1,
    and the time constant; the largest F of an axis is left in the work.
    """
    work, plan, tuning = r.work, r.plan, r.tuning
    f, ratio, bounds, weight = work.f, work.ratio, plan.bounds, plan.weight
    best, chosen, chosen_unit, scale = 0.0, 0, -1, 0
    for j in range(work.spread.size):
        spread, slow = work.spread[j], work.slow[j]
        largest = 0.0
        for a in range(plan.count[0]):
            f[a] = r.memory.average[j, plan.active[a]]
            ratio[a] = f[a] * f[a] * plan.testing[a] / (spread + weight[a] * slow)
            largest = max(largest, ratio[a])
            if ratio[a] > best * tuning.axis_threshold[j]:
                best, chosen, chosen_unit, scale = ratio[a] / tuning.axis_threshold[j], a, -1, j
        work.peak[j] = largest
        for u in range(bounds.size - 1):
            first, size = bounds[u], bounds[u + 1] - bounds[u]
            if size < 2 or size > 3:
                continue
            value = unit_statistic(f, first, size, plan.unit_testing, u)
            strongest, most = 0.0, 0.0
            for a in range(first, first + size):
                strongest = max(strongest, ratio[a])
                most = max(most, weight[a])
            # by the axis that is known best, so that motion is not blamed on a unit
            value /= spread + most * slow
            limit = tuning.unit_threshold[j]
            if value - strongest > tuning.unit_margin and value > best * limit:
                best, chosen, chosen_unit, scale = value / limit, first, u, j
    return best, chosen, chosen_unit, scale


@kernel()
def accuse(r: Redundancy, m: int, blamed: int, rival: int) -> int:
    """Set axis m or unit `blamed` aside; returns how many axes are left, -1 if it cannot be."""
    memory, given = r.memory, r.given
    for i in range(memory.use.size):
        out = i == m if blamed < 0 else given.unit[i] == blamed
        if out and memory.use[i]:
            memory.use[i] = False
            memory.status[i] = -1
    if rival >= 0:
        return -1
    return arrange(given.axes, given.unit, r.work.working, memory.use, r.spare)


@kernel()
def acquit(r: Redundancy, rival: int, now: int) -> None:
    """Take back what was set aside: it is not known who is wrong."""
    memory, given = r.memory, r.given
    for i in range(memory.use.size):
        if memory.status[i] == -1:
            memory.use[i], memory.status[i] = True, 0
    if rival < 0:
        # the accused would be the majority: it is not they who are wrong
        recall(r, now - r.tuning.recall)
        for j in range(memory.average.shape[0]):
            for i in range(memory.use.size):
                memory.average[j, i] = r.work.before[j, i]
        arrange(given.axes, given.unit, r.work.working, memory.use, r.plan)


@kernel()
def condemn(r: Redundancy, blamed: int, now: int) -> None:
    """Leave out what was set aside, and refer all residuals to what remains."""
    memory, given = r.memory, r.given
    for i in range(memory.use.size):
        if memory.status[i] == -1:
            memory.status[i], memory.quiet[i] = (1 if blamed < 0 else 2), 0
            memory.taken[i] = now
    arrange(given.axes, given.unit, r.work.working, memory.use, r.plan)
    for j in range(memory.average.shape[0]):
        reproject(memory.average[j], given.axes, r.plan)


@kernel()
def look_first(r: Redundancy, now: int, best: float) -> None:
    """Write the largest F before anything is taken out, and whether the axes agree again."""
    for j in range(r.work.peak.size):
        r.out.smoothed[now, j] = r.work.peak[j]
    if r.memory.unresolved[0] and best < 0.5:
        r.memory.unresolved[0] = False
        log_event(r, 5, -1, -1, 0.0, 0.0, 0.0, -1)


@kernel()
def take_out(r: Redundancy, now: int) -> None:
    """Take out what fails its test, one after another, as long as it can be told apart."""
    memory, plan, tuning = r.memory, r.plan, r.tuning
    total = memory.use.size
    for j in range(memory.average.shape[0]):
        for i in range(total):
            r.work.before[j, i] = memory.average[j, i]
    first_look = True
    while True:
        best, chosen, blamed, scale = find_fault(r)
        if first_look:
            look_first(r, now, best)
            first_look = False
        if best <= 1.0:
            return
        m = plan.active[chosen]
        by_axis = blamed < 0
        index = m if by_axis else blamed
        threshold = tuning.axis_threshold[scale] if by_axis else tuning.unit_threshold[scale]
        rival = alike(chosen, plan) if by_axis else other_unit(blamed, plan)
        left = accuse(r, m, blamed, rival)
        if left < 0 or 2 * (left - 3) < total - 3:
            acquit(r, rival, now)
            if not memory.unresolved[0]:
                kind = 4 if by_axis else 6
                log_event(r, kind, index, scale, best * threshold, threshold, 0.0, rival)
            memory.unresolved[0] = True
            return
        # what shows in its own residual is the share q/s of the fault
        share = 1.0
        if plan.testing[chosen] > 0.0:
            share = 1.0 / (plan.testing[chosen] / plan.weight[chosen])
        size = memory.average[scale, m] / share
        log_event(r, 0 if by_axis else 1, index, scale, best * threshold, threshold, size, -1)
        condemn(r, blamed, now)


@kernel()
def put_back(r: Redundancy, m: int, whole: bool) -> None:
    """Log that axis m, or its whole unit, is in use again."""
    kind = 3 if whole else 2
    index = r.given.unit[m] if whole else m
    log_event(r, kind, index, -1, 0.0, 0.0, 0.0, -1)


@kernel()
def recall(r: Redundancy, since: int) -> None:
    """Put back what was taken out since a block."""
    status, unit = r.memory.status, r.given.unit
    for m in range(status.size):
        if status[m] > 0 and r.memory.taken[m] >= since:
            whole = status[m] == 2
            put_back(r, m, whole)
            for i in range(m, status.size):
                if i == m or (whole and unit[i] == unit[m] and status[i] == 2):
                    status[i] = 0
                    r.memory.use[i] = True


@kernel()
def other_unit(blamed: int, plan: Plan) -> int:
    """Return an axis of the only other unit, which could be the faulty one as well; or -1."""
    bounds = plan.bounds
    others, last = 0, -1
    for u in range(bounds.size - 1):
        if u != blamed and bounds[u + 1] > bounds[u]:
            others += 1
            last = plan.active[bounds[u]]
    return last if others < 2 else -1


@kernel()
def watch_excluded(r: Redundancy) -> None:
    """Count for how many blocks each axis that is out has agreed with what the others predict."""
    memory, work, axes, inverse = r.memory, r.work, r.given.axes, r.plan.inverse
    for m in range(memory.status.size):
        if memory.status[m] == 0:
            continue
        p = work.working[m]
        for i in range(3):
            for c in range(3):
                p += axes[m, i] * inverse[i, c] * axes[m, c]
        behaves = work.here[m]
        for j in range(work.spread.size):
            allowed = r.tuning.readmission * (p * work.spread[j] + work.slow[j])
            if memory.average[j, m] ** 2 > allowed:
                behaves = False
        memory.quiet[m] = memory.quiet[m] + 1 if behaves else 0


@kernel()
def let_in(r: Redundancy) -> None:
    """Let back in what has agreed with the others for long enough."""
    watch_excluded(r)
    status, quiet, patience = r.memory.status, r.memory.quiet, r.memory.patience
    unit = r.given.unit
    for m in range(status.size):
        if status[m] == 0:
            continue
        whole = status[m] == 2
        ready = quiet[m] >= patience[m]
        for i in range(status.size):
            if whole and unit[i] == unit[m] and status[i] == 2 and quiet[i] < patience[i]:
                ready = False
        if ready:
            put_back(r, m, whole)
            for i in range(status.size):
                if i == m or (whole and unit[i] == unit[m] and status[i] == 2):
                    status[i], quiet[i] = 0, 0
                    patience[i] *= 2
