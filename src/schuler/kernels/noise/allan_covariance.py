"""How the Allan variances of one Gaussian record scatter, and how they hang together.

Every process is described by its generalised covariance K(u) of the running sum theta, up to
polynomials that second differences do not see; the units of time are samples. Second
differences over m and n samples whose centres are s apart then have the covariance

    C(s) = sum_a sum_b c_a c_b K(s + a m - b n),   a, b = -1, 0, 1,   c = (1, -2, 1)

and the overlapping estimators have cov = 2 sum_s w(s) C(s)² / (2 m² M_m 2 n² M_n), where w(s) is
the number of pairs of terms that are s apart. (Gaussian fourth moments; compare Greenhall and
Riley, "Uncertainty of stability variances based on finite differences", 2003, who do this for
power laws and m = n.)
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.compile import kernel
from schuler.kernels.structure_fields import Vector
from schuler.kernels.structures import structure
from schuler.kernels.types import FloatArray


@structure
class NoiseElements:
    """What a process is made of, in units of samples; see `schuler.noise.Process.elements`."""

    white: float
    quantization: float
    walk: float
    flicker: float
    gm_variance: Vector
    gm_time: Vector


@kernel(inline=True)
def _ramped_exponential(x: float) -> float:
    """exp(-x) - 1 + x, by its series where that cancels."""
    if x > 0.2:
        return math.exp(-x) - 1.0 + x
    series = 1.0 / 40320.0
    for divisor in (5040.0, 720.0, 120.0, 24.0, 6.0, 2.0):
        series = 1.0 / divisor - x * series
    return x * x * series


@kernel(inline=True)
def _exponential_difference(y: float, m: float) -> float:
    """Second difference over m of exp(-|y|) + |y|, less a constant where |y| >= m."""
    if y < m:
        return (
            _ramped_exponential(m - y) + _ramped_exponential(m + y) - 2.0 * _ramped_exponential(y)
        )
    if m < 0.5:
        half = math.sinh(0.5 * m)
        return 4.0 * half * half * math.exp(-y)
    return math.exp(m - y) + math.exp(-m - y) - 2.0 * math.exp(-y)


@kernel(inline=True)
def _log_square(y: float) -> float:
    """y² ln|y|, zero at zero."""
    return y * y * math.log(abs(y)) if y != 0.0 else 0.0


@kernel()
def _difference(y: float, m: float, noise: NoiseElements) -> float:
    """Second difference of K over m at y; constants (which the second one removes) may differ."""
    walk, flicker, gm_time = noise.walk, noise.flicker, noise.gm_time
    y = abs(y)
    total = 0.0
    if y < m:
        # K = -white |u|/2 + walk |u|³/12
        total -= noise.white * (m - y)
        total += walk / 12.0 * ((m - y) ** 3 + (m + y) ** 3 - 2.0 * y**3)
    else:
        total += 0.5 * walk * m * m * y
    if flicker > 0.0:  # K = flicker u² ln|u| / 2
        if y < 40.0 * m:
            both = _log_square(y - m) + _log_square(y + m) - 2.0 * _log_square(y)
            total += 0.5 * flicker * both
        else:
            ratio = (m / y) ** 2
            total += flicker * m * m * (math.log(y) + 1.5 - ratio / 12.0 - ratio * ratio / 60.0)
    for k in range(gm_time.size):  # K = -variance Tc² (exp(-|u|/Tc) + |u|/Tc)
        t = gm_time[k]
        total -= noise.gm_variance[k] * t * t * _exponential_difference(y / t, m / t)
    return total


@kernel()
def _lag_covariance(s: float, m: float, n: float, noise: NoiseElements) -> float:
    """C(s) for second differences over m <= n, all but quantisation."""
    before = _difference(s - n, m, noise)
    at = _difference(s, m, noise)
    after = _difference(s + n, m, noise)
    return before - 2.0 * at + after


@kernel()
def _sort(values: FloatArray, count: int) -> None:
    """Sort the first few values by insertion; `np.sort` takes seconds to compile."""
    for k in range(1, count):
        value, place = values[k], k
        while place > 0 and values[place - 1] > value:
            values[place] = values[place - 1]
            place -= 1
        values[place] = value


@kernel()
def _panels(
    m: float, n: float, end: float, rough: bool, gm_time: FloatArray, edges: FloatArray
) -> int:
    """Fill `edges` with increasing lags between which C is smooth; return how many."""
    count = 0
    for kink in (0.0, m, n - m, n, n + m):
        edges[count] = kink
        count += 1
        for k in range(-1 if rough else 0, gm_time.size):
            width = m if k < 0 else gm_time[k]
            for step in (1.0, 6.0):
                edges[count] = kink - step * width
                edges[count + 1] = kink + step * width
                count += 2
    # a process with memory reaches beyond the overlap of the two
    last = end if rough or gm_time.size > 0 else min(end, n + m)
    kept = 0
    _sort(edges, count)
    for k in range(count):
        edge = edges[k]
        inside = 0.0 <= edge < last
        if inside and (kept == 0 or edge > edges[kept - 1] * (1.0 + 1e-12)):
            edges[kept] = edge
            kept += 1
    edges[kept] = last
    return kept + 1


@kernel()
def _sum_of_squares(
    m: float,
    n: float,
    terms: float,
    noise: NoiseElements,
    edges: FloatArray,
) -> float:
    """Sum over all integer lags of w(s) C(s)²."""
    white, quantization = noise.white, noise.quantization
    rough = noise.flicker > 0.0 or noise.gm_time.size > 0
    end = terms + n - m  # where no pair of terms is left
    count = _panels(m, n, end, rough, noise.gm_time, edges)
    total = 0.0
    # four-point Gauss-Legendre: exact for the piecewise polynomials of white noise and walks
    inner, outer = 0.33998104358485626, 0.86113631159405258
    inner_weight, outer_weight = 0.65214515486254614, 0.34785484513745386
    for k in range(count - 1):
        centre, half = 0.5 * (edges[k] + edges[k + 1]), 0.5 * (edges[k + 1] - edges[k])
        for sign in (-1.0, 1.0):
            for node, weight in ((inner, inner_weight), (outer, outer_weight)):
                s = centre + sign * node * half
                c = _lag_covariance(s, m, n, noise)
                pairs = terms - max(0.0, s - (n - m))
                total += 2.0 * half * weight * pairs * c * c
    # The sum over integers against the integral (Euler-Maclaurin at the kinks of w and of white
    # noise), and quantisation, which lives at single lags.
    c = _lag_covariance(n - m, m, n, noise)
    total += c * c / 6.0
    c = _lag_covariance(end, m, n, noise)
    total -= c * c / 6.0
    for a in range(-1, 2):
        for b in range(-1, 2):
            s = b * n - a * m
            pairs = max(0.0, terms - max(0.0, abs(s) - (n - m)))
            weight = (1.0 if a != 0 else -2.0) * (1.0 if b != 0 else -2.0)
            c = _lag_covariance(s, m, n, noise)
            total += pairs * weight * c * (white / 6.0 + 2.0 * quantization)
            for p in range(-1, 2):
                for q in range(-1, 2):
                    if q * n - p * m == s:
                        other = (1.0 if p != 0 else -2.0) * (1.0 if q != 0 else -2.0)
                        total += pairs * weight * other * quantization * quantization
    return total


@kernel()
def relative_covariance(
    factors: NDArray[np.int64],
    size: int,
    noise: NoiseElements,
    diagonal_only: bool,
    out: FloatArray,
) -> None:
    """Covariance of overlapping Allan variances over the product of their expectations."""
    edges = np.empty(5 * (1 + 4 * (1 + noise.gm_time.size)) + 1)
    expected = np.empty(factors.size)
    for i in range(factors.size):
        m = float(factors[i])
        c = _lag_covariance(0.0, m, m, noise)
        expected[i] = c + 6.0 * noise.quantization
    for j in range(factors.size):
        n = float(factors[j])
        terms = size - 2.0 * n
        for i in range(j if diagonal_only else 0, j + 1):
            m = float(factors[i])
            squares = _sum_of_squares(m, n, terms, noise, edges)
            pairs = terms * (size - 2.0 * m)
            out[i, j] = 2.0 * squares / (pairs * expected[i] * expected[j])
            out[j, i] = out[i, j]
