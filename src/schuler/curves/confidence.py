"""How sure an Allan variance is: degrees of freedom and chi-square intervals at every tau."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.noise import Process
from schuler.types import FloatArray

# Slope of log variance against log tau, and the unit process that has it: white noise,
# quantisation, random walk, flicker. White noise holds down to -1.7: at long tau quantisation
# would have hundreds of times more degrees of freedom, and a slope that is steep by chance must
# not claim them.
_POWER_LAWS: tuple[tuple[float, tuple[float, float, float, float]], ...] = (
    (-2.0, (0.0, 1.0, 0.0, 0.0)),
    (-1.7, (1.0, 0.0, 0.0, 0.0)),
    (-1.0, (1.0, 0.0, 0.0, 0.0)),
    (0.0, (0.0, 0.0, 0.0, 1.0)),
    (1.0, (0.0, 0.0, 1.0, 0.0)),
)


def allan_covariance(
    process: Process, factors: NDArray[np.int64], samples: int, dt: float
) -> FloatArray:
    """Covariance of the logarithms of overlapping Allan variances, to first order."""
    from schuler.kernels.noise.allan_covariance import NoiseElements, relative_covariance

    seen = process.elements(dt, samples * dt)
    out = np.zeros((factors.size, factors.size))
    noise = NoiseElements(
        seen.white,
        seen.quantization,
        seen.walk,
        seen.flicker,
        np.array([variance for variance, _ in seen.gauss_markovs]),
        np.array([time / dt for _, time in seen.gauss_markovs]),
    )
    relative_covariance(np.asarray(factors, dtype=np.int64), samples + 1, noise, False, out)
    return out


_FEW_CLUSTERS = 50.0
_QUANTISED = -1.8


def power_law_degrees_of_freedom(
    slope: ArrayLike, factors: NDArray[np.int64], samples: int
) -> FloatArray:
    """Equivalent degrees of freedom of overlapping Allan variances of power-law noise."""
    from schuler.kernels.noise.allan_covariance import NoiseElements, relative_covariance

    none = np.zeros(0)
    logs = []
    for _, densities in _POWER_LAWS:
        out = np.zeros((factors.size, factors.size))
        noise = NoiseElements(*densities, none, none)
        relative_covariance(np.asarray(factors, dtype=np.int64), samples + 1, noise, True, out)
        logs.append(np.log(2.0 / np.diag(out)))
    laws = np.array([law for law, _ in _POWER_LAWS])
    wanted = np.asarray(slope, dtype=np.float64)
    found = [np.interp(w, laws, column) for w, column in zip(wanted, np.array(logs).T, strict=True)]
    return np.asarray(np.exp(found), dtype=np.float64)


def local_slope(tau: FloatArray, variance: FloatArray, decades: float = 0.5) -> FloatArray:
    """Slope of log variance against log tau, smoothed over a window about every tau."""
    slope = np.full(tau.size, -1.0)
    near: NDArray[np.bool_] | NDArray[np.intp]
    good = variance > 0.0
    x, y = np.log10(tau[good]), np.log10(variance[good])
    for k, centre in enumerate(np.log10(tau)):
        distance = np.abs(x - centre)
        near = distance <= decades
        if np.count_nonzero(near) < 3:  # sparse cluster times: the three nearest
            near = np.argsort(distance)[:3]
        if x[near].size < 2:
            continue
        weight = 10.0 ** -(x[near] - centre)
        dx = x[near] - np.average(x[near], weights=weight)
        spread = float(np.sum(weight * dx * dx))
        if spread > 0.0:
            slope[k] = float(np.sum(weight * dx * y[near])) / spread
    return slope


def not_by_chance(slope: FloatArray, factors: NDArray[np.int64], samples: int) -> FloatArray:
    """Slopes with those of long clusters held at that of white noise or above.

    Few clusters scatter so much that the slope is steep by chance; quantisation, whose slope that
    would be, has many times their degrees of freedom. Only where it rules right up to the long
    clusters may it go on to rule them.
    """
    few = factors > samples / _FEW_CLUSTERS
    many = np.flatnonzero(~few)
    if many.size == 0:
        return np.maximum(slope, -1.0)
    rules = slope[many[-1]] < _QUANTISED
    floor = np.where(rules, -2.0, -1.0)
    held = few[:, None] if slope.ndim == 2 else few
    return np.where(held, np.maximum(slope, floor), slope)


def chi_square_bounds(
    degrees_of_freedom: FloatArray, confidence: float = 0.95
) -> tuple[FloatArray, FloatArray]:
    """Factors from a deviation to the ends of its confidence interval."""
    from scipy.special import gammaincinv

    tail = 0.5 * (1.0 - confidence)
    half = 0.5 * degrees_of_freedom
    lower = np.sqrt(half / gammaincinv(half, 1.0 - tail))
    upper = np.sqrt(half / gammaincinv(half, tail))
    return np.asarray(lower), np.asarray(upper)
