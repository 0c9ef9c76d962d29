"""Thresholds for wavelet coefficients: Stein's unbiased risk estimate, and the universal one."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from schuler.types import FloatArray

_MAD_TO_SD = 0.6744897501960817


def soft_risk(coefficients: ArrayLike, threshold: float) -> float:
    """Stein's unbiased estimate of the risk of soft thresholding, noise of variance one."""
    square = np.asarray(coefficients, dtype=np.float64) ** 2
    kept_small = np.count_nonzero(square <= threshold**2)
    total = square.size - 2.0 * kept_small + float(np.minimum(square, threshold**2).sum())
    return total / square.size


def stein_threshold(coefficients: ArrayLike) -> float:
    """Threshold with the smallest Stein risk, for noise of variance one."""
    square = np.sort(np.asarray(coefficients, dtype=np.float64) ** 2)
    n = square.size
    k = np.arange(1, n + 1)
    risk = n - 2.0 * k + np.cumsum(square) + (n - k) * square
    return math.sqrt(float(square[int(np.argmin(risk))]))


def universal_threshold(samples: int) -> float:
    """Threshold that hardly any of n noise values of variance one exceeds."""
    return math.sqrt(2.0 * math.log(max(samples, 2)))


def noise_scale(details: FloatArray) -> float:
    """Standard deviation of noise from the median of absolute coefficients."""
    return float(np.median(np.abs(details))) / _MAD_TO_SD
