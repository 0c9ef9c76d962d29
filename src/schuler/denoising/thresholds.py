"""Thresholds for wavelet coefficients: Stein's unbiased risk estimate, and the universal one."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from schuler.types import FloatArray

_MAD_TO_SD = 0.6744897501960817


def soft_risk(coefficients: ArrayLike, threshold: float) -> float:
    """Stein's unbiased estimate of the risk of soft thresholding, noise of variance one.

    Parameters
    ----------
    coefficients : (n,) array_like
        True values plus independent normal noise of variance one.
    threshold : float
        At least 0.

    Returns
    -------
    float
        Estimate of the mean squared error of the thresholded coefficients.

    Notes
    -----
    [n - 2 #(|x| <= t) + sum min(x², t²)]/n: Stein 1981; Donoho and Johnstone 1995; spec 2.5.
    """
    square = np.asarray(coefficients, dtype=np.float64) ** 2
    kept_small = np.count_nonzero(square <= threshold**2)
    total = square.size - 2.0 * kept_small + float(np.minimum(square, threshold**2).sum())
    return total / square.size


def stein_threshold(coefficients: ArrayLike) -> float:
    """Threshold with the smallest Stein risk, for noise of variance one.

    Parameters
    ----------
    coefficients : (n,) array_like
        At least one.

    Returns
    -------
    float
        The size of one of the coefficients.

    Notes
    -----
    Spec 2.5: z sorted squares, risk_k = [n - 2k + sum_{i<=k} z_i + (n - k) z_k]/n, the root of
    z at its minimum.
    """
    square = np.sort(np.asarray(coefficients, dtype=np.float64) ** 2)
    n = square.size
    k = np.arange(1, n + 1)
    risk = n - 2.0 * k + np.cumsum(square) + (n - k) * square
    return math.sqrt(float(square[int(np.argmin(risk))]))


def universal_threshold(samples: int) -> float:
    """Threshold that hardly any of n noise values of variance one exceeds.

    Parameters
    ----------
    samples : int
        Length of the signal.

    Returns
    -------
    float
        sqrt(2 ln n); Donoho and Johnstone 1994.
    """
    return math.sqrt(2.0 * math.log(max(samples, 2)))


def noise_scale(details: FloatArray) -> float:
    """Standard deviation of noise from the median of absolute coefficients.

    Parameters
    ----------
    details : (n,) ndarray
        Detail coefficients.

    Returns
    -------
    float
        Median over 0.6745: few large coefficients of the signal do not move it.
    """
    return float(np.median(np.abs(details))) / _MAD_TO_SD
