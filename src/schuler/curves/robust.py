"""Scale and location that outliers cannot move: Tukey's biweight with consistency at the normal.

The variance v of residuals e solves sum w(r) (r² - kappa) = 0 with r = e/sqrt(v),
w(r) = (1 - (r/c)²)² within c and zero beyond. psi = w (r² - kappa) is bounded and returns to
zero: a gross outlier counts for nothing at all. kappa makes v consistent for normal residuals, c
follows from the efficiency wanted there. (Huber and Ronchetti, Robust Statistics, 2009, ch. 5;
Guerrier and Molinari use a bounded psi of this kind for the wavelet variance.)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from schuler.errors import EstimationError, InputError
from schuler.types import FloatArray

_MAD = 1.482602218505602
_LARGEST_SAMPLE = 200_000


@dataclass(frozen=True, slots=True)
class BiweightTuning:
    """Constants of the biweight for one efficiency."""

    cut: float  # c in units of the scale
    consistency: float  # kappa = E w r²/E w at the normal
    efficiency: float  # of the variance at the normal, against the mean square


def _tuning(cut: float) -> BiweightTuning:
    node, weight = np.polynomial.legendre.leggauss(200)
    r = 0.5 * cut * (node + 1.0)
    density = weight * np.exp(-0.5 * r * r) * (cut / math.sqrt(2.0 * math.pi))
    w = (1.0 - (r / cut) ** 2) ** 2
    consistency = float(density @ (w * r * r) / (density @ w))
    psi = w * (r * r - consistency)
    efficiency = float(density @ (psi * (r * r - 1.0))) ** 2 / (2.0 * float(density @ psi**2))
    return BiweightTuning(cut, consistency, efficiency)


@lru_cache(maxsize=32)
def biweight_tuning(efficiency: float) -> BiweightTuning:
    """Find the cut that gives an efficiency at the normal."""
    from scipy.optimize import brentq

    if not 0.1 <= efficiency <= 0.99:
        raise InputError(f"efficiency {efficiency:g}", expected="a number from 0.1 to 0.99")
    cut = brentq(lambda c: _tuning(c).efficiency - efficiency, 1.2, 15.0, xtol=1e-10)
    return _tuning(float(cut))


def median_scale(residual: FloatArray) -> float:
    """Return 1.4826 times the median absolute residual, a standard deviation at the normal."""
    return _MAD * float(np.median(np.abs(residual[:: max(1, residual.size // _LARGEST_SAMPLE)])))


def robust_variance(residual: FloatArray, tuning: BiweightTuning) -> tuple[float, float]:
    """Estimate a variance with bounded influence."""
    from schuler.kernels.noise.wavelet_variance import biweight_moments, biweight_spread

    variance = median_scale(residual) ** 2
    if variance <= 0.0:
        raise EstimationError(
            "more than half of the samples do not differ from their neighbours",
            expected="noise that is larger than the step of quantisation",
            cure="use robust=False",
        )
    for _ in range(100):
        total, squares = biweight_moments(residual, tuning.cut * math.sqrt(variance))
        # the plain fixed point creeps; twice its step in the logarithm still converges
        ratio = squares / (total * tuning.consistency * variance)
        variance *= ratio**1.5
        if abs(ratio - 1.0) < 1e-10:
            break
    scale = math.sqrt(variance)
    squares, slope = biweight_spread(residual, scale, tuning.cut * scale, tuning.consistency)
    return variance, variance * math.sqrt(squares) / max(abs(slope), 1e-300)
