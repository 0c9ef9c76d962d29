"""The exact Gaussian likelihood of an ARMA process, its scores and its information (spec 5.1)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from schuler.estimation.products import by_rows, dot, gram
from schuler.noise.arma import harvey_form, stationary_covariance, within
from schuler.types import FloatArray

EDGE = 1e-7
"""Roots are kept this far inside the unit circle."""
_NONE = np.zeros(0)
_UNTOLD = np.zeros((3, 0))


@dataclass(frozen=True, slots=True, eq=False)
class Likelihood:
    """The likelihood at given coefficients, highest over mean and innovation variance."""

    value: float  # logarithm of the likelihood
    mean: float  # mean by generalised least squares
    variance: float  # innovation variance
    known_mean: bool = False  # the mean is zero and was not estimated


@dataclass(frozen=True, slots=True, eq=False)
class Innovations:
    """The standardised innovations u(t) of a signal, o(t) of a constant 1, and ln f(t)."""

    residual: FloatArray
    response: FloatArray
    log_variance: FloatArray


def split(coefficients: FloatArray, p: int) -> tuple[FloatArray, FloatArray]:
    """Part (phi, theta) into phi and theta."""
    return coefficients[:p], coefficients[p:]


def admissible(coefficients: FloatArray, p: int) -> bool:
    """Tell whether the coefficients are finite, stationary and invertible."""
    if not np.isfinite(coefficients).all():
        return False
    phi, theta = split(coefficients, p)
    return within(phi, 1.0 - EDGE) and within(-theta, 1.0 - EDGE)


def likelihood(
    signal: FloatArray, coefficients: FloatArray, p: int, known_mean: bool = False
) -> Likelihood:
    """Evaluate the exact likelihood; innovation variance, and mean unless known, the best ones."""
    from schuler.kernels.noise.arma import exact_innovations

    padded, gain = harvey_form(*split(coefficients, p))
    covariance = stationary_covariance(padded, gain)
    uu, uo, oo, logs = exact_innovations(signal, padded, gain, covariance, _UNTOLD)
    mean = 0.0 if known_mean else uo / oo
    variance = max(uu - uo * mean, 1e-300) / signal.size
    value = -0.5 * (signal.size * (math.log(2.0 * math.pi * variance) + 1.0) + logs)
    return Likelihood(value, mean, variance, known_mean)


def innovations(signal: FloatArray, coefficients: FloatArray, p: int) -> Innovations:
    """Return the standardised innovations sample by sample."""
    from schuler.kernels.noise.arma import exact_innovations

    padded, gain = harvey_form(*split(coefficients, p))
    out = np.empty((3, signal.size))
    exact_innovations(signal, padded, gain, stationary_covariance(padded, gain), out)
    return Innovations(*out)


def approximate_slope(
    signal: FloatArray, coefficients: FloatArray, p: int, at: Likelihood
) -> tuple[FloatArray, FloatArray]:
    """Gradient and information from the derivatives of the residuals, as two filters give them.

    de/dphi_i = -w(t-i) with w = x/theta(B); de/dtheta_j = -z(t-j) with z = e/theta(B). The start
    of the record is treated as if nothing had been before.
    """
    from scipy.signal import lfilter

    phi, theta = split(coefficients, p)
    q, n = theta.size, signal.size
    one = np.ones(1)
    centred = signal - at.mean
    back = np.concatenate([one, theta])
    w = lfilter(one, back, centred)
    residual = lfilter(np.concatenate([one, -phi]), one, w)
    z = lfilter(one, back, residual) if q else _NONE

    def product(a: FloatArray, i: int, b: FloatArray, j: int) -> float:
        """Sum of a(t-i) b(t-j)."""
        low = max(i, j)
        return dot(a[low - i : n - i], b[low - j : n - j])

    gradient = np.empty(p + q)
    information = np.empty((p + q, p + q))
    gradient[:p] = [product(w, i, residual, 0) for i in range(1, p + 1)]
    gradient[p:] = [product(z, j, residual, 0) for j in range(1, q + 1)]
    # sums of products depend, but for the ends of the record, on the difference of the lags only
    own = [product(w, k, w, 0) for k in range(p)]
    other = [product(z, k, z, 0) for k in range(q)]
    cross = {k: product(w, max(k, 0), z, max(-k, 0)) for k in range(1 - q, p)} if p and q else {}
    for i in range(p):
        information[i, :p] = [own[abs(i - k)] for k in range(p)]
        information[i, p:] = information[p:, i] = [cross[i - j] for j in range(q)]
    for j in range(q):
        information[p + j, p:] = [other[abs(j - k)] for k in range(q)]
    return gradient / at.variance, information / at.variance


def exact_slope(
    signal: FloatArray, coefficients: FloatArray, p: int, at: Likelihood
) -> tuple[FloatArray, FloatArray]:
    """Gradient and information of the exact likelihood, mean and variance being the best ones."""
    centred = signal - at.mean
    here = innovations(centred, coefficients, p)
    slopes, jumps = _derivatives(centred, coefficients, p, here)
    drift = jumps.sum(axis=1)[1:]
    gradient = -by_rows(slopes[1:], here.residual) / at.variance - 0.5 * drift
    products = gram(slopes) / at.variance + 0.5 * gram(jumps)
    # what the mean and the variance can explain does not count
    by_mean = 0.0 if at.known_mean else np.outer(products[0, 1:], products[0, 1:]) / products[0, 0]
    by_variance = np.outer(drift, drift) * (0.5 / signal.size)
    return gradient, products[1:, 1:] - by_mean - by_variance


def _beside(
    coefficients: FloatArray, p: int, k: int, width: float
) -> tuple[FloatArray, FloatArray]:
    """Coefficients with the k-th moved down and up, by less near the edge."""
    for _ in range(30):
        low, high = coefficients.copy(), coefficients.copy()
        low[k] -= width
        high[k] += width
        if admissible(low, p) and admissible(high, p):
            break
        width *= 0.25
    return low, high


def scores(
    signal: FloatArray, coefficients: FloatArray, p: int, at: Likelihood
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Exact derivatives of the log likelihood of every sample, summed up in two ways."""
    n, k = signal.size, coefficients.size
    centred = signal - at.mean
    here = innovations(centred, coefficients, p)
    slopes, jumps = _derivatives(centred, coefficients, p, here)
    settling = jumps.shape[1]
    sample = np.empty((k + 2, n))
    np.multiply(slopes, here.residual * (-1.0 / at.variance), out=sample[:-1])
    sample[:-1, :settling] -= 0.5 * jumps
    np.multiply(here.residual, here.residual, out=sample[-1])
    sample[-1] *= 0.5 / at.variance**2
    sample[-1] -= 0.5 / at.variance
    information = np.zeros((k + 2, k + 2))
    information[:-1, :-1] = gram(slopes) / at.variance + 0.5 * gram(jumps)
    information[-1, -1] = 0.5 * n / at.variance**2
    information[-1, :-1] = information[:-1, -1] = 0.5 * jumps.sum(axis=1) / at.variance
    return sample.sum(axis=1), information, gram(sample)


def _derivatives(
    centred: FloatArray, coefficients: FloatArray, p: int, here: Innovations
) -> tuple[FloatArray, FloatArray]:
    """Derivatives of u(t) by mean, phi and theta, and of ln f(t) while it is not zero.

    Central differences while the filter settles; from then on the recursion of the derivative,
    d(t) = -input(t-lag) - sum theta_j d(t-j), goes on from there.
    """
    from scipy.signal import lfilter, lfiltic

    n, k = centred.size, coefficients.size
    back = np.concatenate([[1.0], coefficients[p:]])
    moving = np.flatnonzero(here.log_variance)
    settling = min(n, (int(moving[-1]) + 1 if moving.size else 0) + 2 * (k + 1))
    slopes, jumps = np.empty((k + 1, n)), np.zeros((k + 1, settling))
    slopes[0] = -here.response
    for i in range(k):
        low, high = _beside(coefficients, p, i, 1e-6)
        below, above = (innovations(centred[:settling], c, p) for c in (low, high))
        width = high[i] - low[i]
        row = slopes[i + 1]
        row[:settling] = (above.residual - below.residual) / width
        jumps[i + 1] = (above.log_variance - below.log_variance) / width
        if settling < n:
            source, lag = (centred, i + 1) if i < p else (here.residual, i - p + 1)
            memory = row[settling - 1 : settling - back.size : -1] if back.size > 1 else []
            start = lfiltic([-1.0], back, memory)
            row[settling:] = lfilter([-1.0], back, source[settling - lag : n - lag], zi=start)[0]
    return slopes, jumps
