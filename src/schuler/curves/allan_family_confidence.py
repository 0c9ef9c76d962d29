"""Degrees of freedom and bias of the relatives of the Allan variance, for power-law noise.

The estimators without reflection are quadratic forms of differences whose covariance C(s) at lag
s follows from the generalised covariance K of theta (see `schuler.kernels.noise.allan_covariance`):
degrees of freedom = terms² C(0)² / sum over s of (terms - |s|) C(s)² (Greenhall and Riley 2003).
The total kinds take the fits of NIST SP 1065, tables 7 to 9.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from schuler.types import FloatArray

Kind = Literal[
    "nonoverlapping", "modified", "hadamard", "total", "modified total", "hadamard total"
]

_LAWS = ("quantization", "white", "flicker", "walk")
# Slope of log variance against log tau for quantisation, white (twice), flicker and walk. White
# noise holds to the left of -1 for a while: a slope that is steep by chance must not claim the
# many degrees of freedom of quantisation.
_SLOPES = {False: (-2.0, -1.7, -1.0, 0.0, 1.0), True: (-3.0, -2.4, -1.0, 0.0, 1.0)}
_NODES = (0, 1, 1, 2, 3)
_EXACT = 16
_REACH = 40
_PANELS = 32

# b, c of degrees of freedom = b T/tau - c: SP 1065 tables 7 and 8 (white, flicker, walk; the
# modified total variance also quantisation), and b0, b1 of T/tau/(b0 + b1 tau/T): table 9
_TOTAL = {"white": (1.50, 0.0), "flicker": (1.17, 0.22), "walk": (0.93, 0.36)}
_MODIFIED_TOTAL = {
    "quantization": (1.90, 2.1),
    "white": (1.10, 1.2),
    "flicker": (0.85, 0.50),
    "walk": (0.75, 0.31),
}
_HADAMARD_TOTAL = {"white": (0.559, 1.004), "flicker": (0.868, 1.140), "walk": (0.938, 1.696)}
# Expectation of a total variance over that of the same variance without "total". "total" loses
# this times tau/T (white, flicker, walk: SP 1065, 5.2.11; quantisation: the mirrored ends double
# its noise). The others by 1/m, from the exact expectation of a window; for long clusters the
# Hadamard values are those of SP 1065, 5.2.14, the modified ones replace its 0.94 0.73 0.70 0.69,
# which simulation does not bear out.
_TOTAL_BIAS = (-4.0 / 3.0, 0.0, 0.481, 0.750)
_INVERSE_FACTORS = (0.0, 0.125, 0.25, 0.5, 1.0)
_WINDOW_BIAS = {
    "modified total": (
        (0.9953, 0.9955, 0.9960, 0.9979, 0.5),
        (0.7705, 0.7740, 0.7837, 0.8144, 0.5),
        (0.7171, 0.7178, 0.7199, 0.7266, 0.5),
        (0.6787, 0.6789, 0.6792, 0.6750, 0.5),
    ),
    "hadamard total": (
        (1.3835, 1.3485, 1.3138, 1.2469, 1.0),
        (0.9953, 0.9955, 0.9960, 0.9979, 1.0),
        (0.8511, 0.8512, 0.8519, 0.8558, 1.0),
        (0.7705, 0.7705, 0.7704, 0.7685, 1.0),
    ),
}


def _shape(law: str, averaged: bool, u: FloatArray) -> FloatArray:
    """K(u), or twice integrated where the differences are averaged over a cluster."""
    size = np.abs(u)
    log = np.log(np.where(size > 0.0, size, 1.0))
    if law == "quantization":
        return 0.5 * size if averaged else (size == 0.0).astype(np.float64)
    if law == "white":
        return -(size**3) / 12.0 if averaged else -0.5 * size
    if law == "flicker":
        return size**4 * log / 24.0 if averaged else 0.5 * size**2 * log
    return size**5 / 240.0 if averaged else size**3 / 12.0


def _covariance(law: str, order: int, modified: bool, m: float, lags: FloatArray) -> FloatArray:
    """Covariance of differences of an order over clusters of m, `lags` apart."""
    weights = np.array([(-1.0) ** a for a in range(order + 1)])
    weights *= np.array([[1.0, 2.0, 1.0, 0.0], [1.0, 3.0, 3.0, 1.0]])[order - 2, : order + 1]
    pairs = np.convolve(weights, weights[::-1])
    exact = modified and m <= _EXACT
    if modified and not exact:
        pairs = np.convolve(pairs, [1.0, -2.0, 1.0])
    reach = pairs.size // 2

    def at(lag: FloatArray) -> FloatArray:
        # in clusters where the averaging is an integral, so that powers stay small
        scale = m if modified and not exact else 1.0
        terms = [
            w * _shape(law, modified and not exact, (lag + k * m) / scale)
            for k, w in zip(range(-reach, reach + 1), pairs, strict=True)
        ]
        return np.asarray(np.sum(terms, axis=0))

    if not exact:
        return at(lags)
    width = int(m)
    shifts = np.arange(1 - width, width)
    triangle = (width - np.abs(shifts)) / width**2
    return np.asarray(triangle @ at(lags[None, :] + shifts[:, None]))


@lru_cache(maxsize=4096)
def difference_degrees_of_freedom(
    law: str, order: int, modified: bool, stride: int, factor: int, terms: int
) -> float:
    """Equivalent degrees of freedom of a mean square of differences of power-law noise."""
    m, count = float(factor), float(terms)
    lags: FloatArray
    if stride == factor:
        lags = np.arange(min(terms, _REACH), dtype=np.float64) * factor
    elif law == "quantization" and not modified:
        lags = np.arange(min((terms - 1) // factor, order) + 1, dtype=np.float64) * factor
    elif factor <= _EXACT:
        lags = np.arange(min(terms, _REACH * factor), dtype=np.float64)
    else:
        # smooth between multiples of a cluster: the sum is an integral
        last = min(count, _REACH * m)
        lags = np.append(np.arange(0.0, last, min(m, count) / _PANELS), last)
        squares = _covariance(law, order, modified, m, lags) ** 2
        integral = 2.0 * float(np.trapezoid((count - lags) * squares, lags))
        return count**2 * float(squares[0]) / integral
    squares = _covariance(law, order, modified, m, lags) ** 2
    pairs = np.where(lags == 0.0, 1.0, 2.0) * (count - lags / stride)
    return count**2 * float(squares[0]) / float(pairs @ squares)


def _small_cluster(law: str, order: int, modified: bool, m: int) -> float:
    """How few degrees of freedom clusters of few samples have, against long ones."""
    if m > _EXACT:
        return 1.0
    here = difference_degrees_of_freedom(law, order, modified, 1, m, 64 * m)
    return here / difference_degrees_of_freedom(law, order, modified, 1, 64, 4096)


def _with_common_ends(freedom: float, weight: float, clusters: float) -> float:
    """Quantisation of the end values is common to all reflected terms; weights by simulation."""
    return 1.0 / (1.0 / freedom + weight / clusters**2)


def _law_freedom(kind: Kind, law: str, m: int, samples: int) -> float:
    clusters = samples / m
    if kind == "nonoverlapping":
        return difference_degrees_of_freedom(law, 2, False, m, m, samples // m - 1)
    if kind == "modified":
        return difference_degrees_of_freedom(law, 2, True, 1, m, samples + 2 - 3 * m)
    if kind == "hadamard":
        return difference_degrees_of_freedom(law, 3, False, 1, m, samples + 1 - 3 * m)
    if kind == "total":
        if law not in _TOTAL:
            over = difference_degrees_of_freedom(law, 2, False, 1, m, samples + 1 - 2 * m)
            return _with_common_ends(over, 1.3, clusters)
        slope, less = _TOTAL[law]
        return (slope * clusters - less) * _small_cluster(law, 2, False, m)
    if kind == "modified total":
        slope, less = _MODIFIED_TOTAL[law]
        return (slope * clusters - less) * _small_cluster(law, 2, True, m)
    if law not in _HADAMARD_TOTAL:
        over = difference_degrees_of_freedom(law, 3, False, 1, m, samples + 1 - 3 * m)
        return _with_common_ends(over, 0.3, clusters)
    first, second = _HADAMARD_TOTAL[law]
    return clusters / (first + second / clusters) * _small_cluster(law, 3, False, m)


def family_degrees_of_freedom(
    kind: Kind, slope: FloatArray, factors: NDArray[np.int64], samples: int
) -> FloatArray:
    """Equivalent degrees of freedom at every cluster length, by the local slope of the curve."""
    rows = np.array([[_law_freedom(kind, law, int(m), samples) for law in _LAWS] for m in factors])
    laws = _SLOPES["modified" in kind]
    logs = np.log(np.maximum(rows, 1.0))[:, list(_NODES)]
    found = [np.interp(s, laws, row) for s, row in zip(slope, logs, strict=True)]
    return np.asarray(np.exp(found), dtype=np.float64)


def variance_bias(
    kind: Kind, slope: FloatArray, factors: NDArray[np.int64], samples: int
) -> FloatArray:
    """Expectation of a total variance over that of the same variance without "total"."""
    out = np.ones_like(slope)
    if "total" not in kind:
        return out
    laws = _SLOPES["modified" in kind]
    for row, m in enumerate(factors):
        if kind == "total":
            nodes = [1.0 - _TOTAL_BIAS[k] * m / samples for k in _NODES]
        else:
            table = _WINDOW_BIAS[kind]
            nodes = [float(np.interp(1.0 / m, _INVERSE_FACTORS, table[k])) for k in _NODES]
        out[row] = np.interp(slope[row], laws, nodes)
    return out
