"""How estimated wavelet variances scatter, and how they are averaged over records."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from schuler.curves.confidence import allan_covariance
from schuler.curves.wavelet_variance import WaveletVarianceCurve, robust_inflation
from schuler.estimation.curve_fit import CurvePoints, Scatter, scattering
from schuler.noise import Process, WhiteNoise
from schuler.types import FloatArray

_LOADING = 1e-3


def relative_covariance(process: Process, curve: WaveletVarianceCurve) -> FloatArray:
    """Covariance of an estimated wavelet variance over the product of its expectations."""
    noise = scattering(process)
    dt, factors = 1.0 / curve.rate, curve.factors
    if curve.robust == "samples":
        added = WhiteNoise(math.sqrt(max(curve.excess_variance, 0.0) * dt))
        full = noise + added
        relative = allan_covariance(full, factors, curve.samples, dt)
        share = curve.of(full) / curve.of(process)
        relative *= np.outer(share, share)
        # the sample variance of the drawn signal is replaced by the M-estimate
        white = curve.core_variance + curve.excess_variance
        own = curve.core_error**2 - 2.0 * white**2 / curve.samples
        filters = 0.5 / factors / curve.of(process)
        relative += own * np.outer(filters, filters)
        _keep_positive(relative)
    else:
        relative = allan_covariance(noise, factors, curve.samples, dt)
        if curve.robust == "coefficients":
            stretch = np.sqrt(robust_inflation(factors, curve.efficiency))
            relative *= np.outer(stretch, stretch)
    relative += np.diag(_LOADING * np.diag(relative))
    return relative


def _keep_positive(matrix: FloatArray) -> None:
    """Lift eigenvalues of the correlation matrix that came out at or below zero, in place."""
    diagonal = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    values, vectors = np.linalg.eigh(matrix / np.outer(diagonal, diagonal))
    if values[0] < 1e-6:
        lifted = (vectors * np.maximum(values, 1e-6)) @ vectors.T
        matrix[:] = lifted * np.outer(diagonal, diagonal)


def misfit(variance: FloatArray, model: FloatArray, relative: FloatArray) -> float:
    """Whitened misfit of a wavelet variance, cube roots taken.

    The cube root of a chi-square is nearly normal (Wilson and Hilferty) where the chi-square of
    the few degrees of freedom at long scales is not.
    """
    root = 3.0 * (np.cbrt(variance / model) - 1.0 + np.diag(relative) / 9.0)
    return float(root @ np.linalg.solve(relative, root))


def pooled_points(curves: Sequence[WaveletVarianceCurve]) -> CurvePoints:
    """Average curves of one sensor, each by the number of its coefficients."""
    shared = curves[0].factors
    for curve in curves[1:]:
        shared = np.intersect1d(shared, curve.factors)
    rows = [np.searchsorted(c.factors, shared) for c in curves]
    weight = np.array([c.samples + 1 - 2 * shared for c in curves], dtype=np.float64)
    weight /= weight.sum(axis=0)
    variance = np.array([c.variance[r] for c, r in zip(curves, rows, strict=True)])
    freedom = np.array([c.degrees_of_freedom[r] for c, r in zip(curves, rows, strict=True)])
    return CurvePoints(
        tau=shared / curves[0].rate,
        variance=2.0 * np.sum(weight * variance, axis=0),
        factors=shared,
        samples=max(c.samples for c in curves),
        dt=1.0 / curves[0].rate,
        degrees_of_freedom=np.sum(freedom, axis=0),
    )


def pooled_scatter(
    process: Process, curves: Sequence[WaveletVarianceCurve], points: CurvePoints
) -> Scatter:
    """Scatter of the logarithms of averaged curves, for the choice of the structure."""
    total = math.fsum(c.samples for c in curves)
    relative = np.zeros((points.tau.size, points.tau.size))
    for curve in curves:
        rows = np.searchsorted(curve.factors, points.factors)
        share = curve.samples / total
        relative += share**2 * relative_covariance(process, curve)[np.ix_(rows, rows)]
    return Scatter.of(relative)
