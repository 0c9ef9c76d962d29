"""Weighted least squares of redundant axes: the plan, one sample, and its test statistics.

Spec 6.2, 6.4, 6.5 for a diagonal covariance: x = (A'PA)^-1 A'P y, residual f = y - A x, variance
of a residual q = s - h (A'PA)^-1 h', D = sum f²/s, one faulty axis F = f²/q, one faulty unit
F = f_T' Q_TT^-1 f_T.

`arrange` fills a plan: the axes in use are put close together, so that a sample costs no look-up.
"""

from __future__ import annotations

from schuler.kernels.arrays.redundancy_data import Plan
from schuler.kernels.compile import kernel
from schuler.kernels.types import BoolArray, FloatArray, IntArray


@kernel(inline=True)
def invert_symmetric(
    a: float, b: float, c: float, d: float, e: float, f: float
) -> tuple[float, float, float, float, float, float, float]:
    """Invert a positive semidefinite 3 x 3 matrix.

    a, b, c, d, e, f: its upper triangle, row by row. Numbers, because handing on arrays costs more
    than this. Returns its determinant over that of its diagonal, between 0 (singular) and 1
    (orthogonal), and the upper triangle of the inverse; zeros when the determinant is not positive.
    """
    m00, m01, m02 = d * f - e * e, c * e - b * f, b * e - c * d
    determinant = a * m00 + b * m01 + c * m02
    scale = a * d * f
    if not determinant > 0.0 or not scale > 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    g = 1.0 / determinant
    m11, m12, m22 = a * f - c * c, b * c - a * e, a * d - b * b
    return determinant / scale, m00 * g, m01 * g, m02 * g, m11 * g, m12 * g, m22 * g


@kernel()
def arrange(
    axes: FloatArray, unit: IntArray, variance: FloatArray, use: BoolArray, plan: Plan
) -> int:
    """Fill the plan for the axes in use.

    axes (M, 3): unit rows h of all axes; unit (M,): unit of each, not decreasing; variance (M,): s
    of a sample; use (M,): which to use; plan: filled. Returns number of axes in use; -1 when they
    leave a direction unmeasured.
    """
    active, bounds, h, pi, weight = plan.active, plan.bounds, plan.h, plan.pi, plan.weight
    testing, inverse = plan.testing, plan.inverse
    units = bounds.size - 1
    count, filled = 0, 0
    xx = xy = xz = yy = yz = zz = 0.0
    for m in range(use.size):
        while filled < unit[m]:
            filled += 1
            bounds[filled] = count
        if not use[m]:
            continue
        active[count] = m
        w = 1.0 / variance[m]
        weight[count] = w
        x, y, z = axes[m, 0], axes[m, 1], axes[m, 2]
        h[0, count], h[1, count], h[2, count] = x, y, z
        xx, xy, xz = xx + w * x * x, xy + w * x * y, xz + w * x * z
        yy, yz, zz = yy + w * y * y, yz + w * y * z, zz + w * z * z
        count += 1
    while filled < units:
        filled += 1
        bounds[filled] = count
    share, xx, xy, xz, yy, yz, zz = invert_symmetric(xx, xy, xz, yy, yz, zz)
    if count < 3 or not share > 1e-9:
        plan.count[0] = -1
        return -1
    plan.count[0] = count
    inverse[0, 0], inverse[0, 1], inverse[0, 2] = xx, xy, xz
    inverse[1, 0], inverse[1, 1], inverse[1, 2] = xy, yy, yz
    inverse[2, 0], inverse[2, 1], inverse[2, 2] = xz, yz, zz
    for a in range(count):
        x, y, z, w = h[0, a], h[1, a], h[2, a], weight[a]
        p = xx * x + xy * y + xz * z
        q = xy * x + yy * y + yz * z
        r = xz * x + yz * y + zz * z
        pi[0, a], pi[1, a], pi[2, a] = p * w, q * w, r * w
        left = variance[active[a]] - (x * p + y * q + z * r)
        testing[a] = 1.0 / left if left * w > 1e-9 else 0.0
    _arrange_units(bounds, h, pi, weight, plan.unit_testing)
    return count


@kernel()
def _arrange_units(
    bounds: IntArray, h: FloatArray, pi: FloatArray, weight: FloatArray, testing: FloatArray
) -> None:
    """Fill Q_TT^-1 of the units of one to three axes; zero when one cannot be tested."""
    for u in range(bounds.size - 1):
        first, size = bounds[u], bounds[u + 1] - bounds[u]
        # the block is made where its inverse is wanted
        for i in range(3):
            for j in range(3):
                testing[u, i, j] = 0.0
        if size < 1 or size > 3:
            continue
        share = 1.0
        for j in range(size):
            b = first + j
            variance = 1.0 / weight[b]
            for i in range(j + 1):
                a = first + i
                cross = h[0, a] * pi[0, b] + h[1, a] * pi[1, b] + h[2, a] * pi[2, b]
                testing[u, i, j] = ((1.0 if i == j else 0.0) - cross) * variance
            share *= testing[u, j, j] * weight[b]
        middle = testing[u, 1, 1] if size > 1 else 1.0
        last = testing[u, 2, 2] if size > 2 else 1.0
        good, xx, xy, xz, yy, yz, zz = invert_symmetric(
            testing[u, 0, 0], testing[u, 0, 1], testing[u, 0, 2], middle, testing[u, 1, 2], last
        )
        if not share > 1e-9 or not good > 1e-9:
            xx = xy = xz = yy = yz = zz = 0.0
        testing[u, 0, 0], testing[u, 0, 1], testing[u, 0, 2] = xx, xy, xz
        testing[u, 1, 0], testing[u, 1, 1], testing[u, 1, 2] = xy, yy if size > 1 else 0.0, yz
        testing[u, 2, 0], testing[u, 2, 1], testing[u, 2, 2] = xz, yz, zz if size > 2 else 0.0


@kernel(reduction=True, inline=True)
def fuse_sample(
    y: FloatArray, h: FloatArray, pi: FloatArray, count: int, f: FloatArray
) -> tuple[float, float, float]:
    """Fuse one sample and find its residuals.

    y (M,): measurements of the axes in use; h, pi (3, M): from the plan; count: axes in use; f
    (M,): filled with the residuals. Returns the fused vector.
    """
    x0 = x1 = x2 = 0.0
    for a in range(count):
        x0 += pi[0, a] * y[a]
        x1 += pi[1, a] * y[a]
        x2 += pi[2, a] * y[a]
    for a in range(count):
        f[a] = y[a] - (h[0, a] * x0 + h[1, a] * x1 + h[2, a] * x2)
    return x0, x1, x2


@kernel(reduction=True, inline=True)
def weighted_squares(f: FloatArray, weight: FloatArray, count: int) -> float:
    """Return the chi-square statistic of one sample.

    f, weight (M,): residuals and 1/s; count: axes in use.
    """
    total = 0.0
    for a in range(count):
        total += f[a] * f[a] * weight[a]
    return total


@kernel(inline=True)
def axis_statistics(
    f: FloatArray, testing: FloatArray, count: int, ratio: FloatArray
) -> tuple[float, int]:
    """Find the likelihood statistics of a fault of one axis.

    f, testing (M,): residuals and 1/q; count: axes in use; ratio (M,): filled with F = f²/q, each
    chi-square with one degree of freedom (spec 6.5). Returns the largest F, and its place.
    """
    for a in range(count):
        ratio[a] = f[a] * f[a] * testing[a]
    # four at a time: a comparison need not wait for the one before
    p = q = r = s = -1.0
    fours = count - count % 4
    for a in range(0, fours, 4):
        p, q = max(p, ratio[a]), max(q, ratio[a + 1])
        r, s = max(r, ratio[a + 2]), max(s, ratio[a + 3])
    for a in range(fours, count):
        p = max(p, ratio[a])
    best = max(max(p, q), max(r, s))
    where = 0
    while where < count - 1 and ratio[where] != best:
        where += 1
    return best, where


@kernel(inline=True)
def unit_statistic(f: FloatArray, first: int, size: int, unit_testing: FloatArray, u: int) -> float:
    """Return the likelihood statistic of a fault of one unit.

    f (M,): residuals of the axes in use; first, size: where the unit's axes are: one, two or three;
    unit_testing (units, 3, 3): Q_TT^-1 of all units; u: which unit.
    """
    if size == 3:
        x, y, z = f[first], f[first + 1], f[first + 2]
        return float(
            x * (unit_testing[u, 0, 0] * x)
            + 2.0 * x * (unit_testing[u, 0, 1] * y + unit_testing[u, 0, 2] * z)
            + y * (unit_testing[u, 1, 1] * y + 2.0 * unit_testing[u, 1, 2] * z)
            + z * z * unit_testing[u, 2, 2]
        )
    if size == 1:
        return float(f[first] * f[first] * unit_testing[u, 0, 0])
    x, y = f[first], f[first + 1]
    return float(
        x * (unit_testing[u, 0, 0] * x + 2.0 * unit_testing[u, 0, 1] * y)
        + y * y * unit_testing[u, 1, 1]
    )


@kernel(inline=True)
def worst_unit(f: FloatArray, bounds: IntArray, unit_testing: FloatArray) -> tuple[float, int]:
    """Find the unit whose fault would explain the residuals best.

    f (M,): residuals of the axes in use; bounds, unit_testing: from the plan. Returns its F and its
    number; -1, -1 when there is none.
    """
    best, which = -1.0, -1
    for u in range(bounds.size - 1):
        size = bounds[u + 1] - bounds[u]
        if 0 < size < 4:
            value = unit_statistic(f, bounds[u], size, unit_testing, u)
            # without a branch: which unit is the worst cannot be foreseen
            which = u if value > best else which
            best = max(best, value)
    return best, which
