"""Robust pieces of the Haar wavelet variance: running medians, bounded influence.

The weight of a residual r (in units of its scale) is Tukey's biweight w(r) = (1 - (r/c)²)² within
c and zero beyond.
"""

from __future__ import annotations

import numpy as np

from schuler.kernels.compile import kernel
from schuler.kernels.types import FloatArray


@kernel()
def medians_at_nodes(signal: FloatArray, window: int, step: int, medians: FloatArray) -> None:
    """Write the median of `window` samples about every `step`-th sample.

    signal (n,): samples, n >= window; window: samples under the median; at the ends of the record
    the window is moved inwards; step: samples from node to node; node k is sample k * step; medians
    (m,): filled in place.
    """
    n = signal.size
    for k in range(medians.size):
        start = min(max(k * step - window // 2, 0), n - window)
        medians[k] = np.median(signal[start : start + window])


@kernel(reduction=True)
def biweight_moments(residual: FloatArray, reach: float) -> tuple[float, float]:
    """Return the sums of w and of w r² with weights that vanish beyond `reach`.

    residual (n,): residuals; reach: c times the scale, in the unit of the residuals.
    """
    total, squares = 0.0, 0.0
    inverse = 1.0 / (reach * reach)
    for k in range(residual.size):
        square = residual[k] * residual[k]
        rest = max(1.0 - square * inverse, 0.0)
        weight = rest * rest
        total += weight
        squares += weight * square
    return total, squares


@kernel(reduction=True)
def biweight_spread(
    residual: FloatArray, scale: float, reach: float, consistency: float
) -> tuple[float, float]:
    """Return what the sandwich of the M-estimate of variance needs.

    residual (n,): residuals; scale: the estimate of their scale; reach: c times the scale;
    consistency: kappa = E w r²/E w of a standard normal r.
    """
    squares, slope = 0.0, 0.0
    inverse, unit = 1.0 / (reach * reach), 1.0 / (scale * scale)
    for k in range(residual.size):
        square = residual[k] * residual[k]
        rest = max(1.0 - square * inverse, 0.0)
        excess = square * unit - consistency
        psi = rest * rest * excess
        squares += psi * psi
        # r² falls as the variance rises: d r²/d ln v = -r²
        slope += 2.0 * rest * square * inverse * excess - rest * rest * square * unit
    return squares, slope


@kernel(reduction=True)
def biweight_influence(residual: FloatArray, reach: float, influence: FloatArray) -> float:
    """Write w r for every residual, and return the sum of its slopes d(w r)/dr.

    residual (n,): residuals; reach: c times the scale, in the unit of the residuals; influence
    (n,): filled in place; may be `residual` itself. Returns sum of (1 - u)(1 - 5 u), u = (r/c)²,
    over the residuals within reach.
    """
    slope = 0.0
    inverse = 1.0 / (reach * reach)
    for k in range(residual.size):
        ratio = residual[k] * residual[k] * inverse
        rest = max(1.0 - ratio, 0.0)
        slope += rest * (1.0 - 5.0 * ratio)
        influence[k] = residual[k] * rest * rest
    return slope


@kernel()
def haar_coefficients(
    theta: FloatArray, factor: int, stride: int, coefficients: FloatArray
) -> None:
    """Write interior Haar coefficients: half the difference of two neighbouring means.

    theta (n + 1,): running sum of the samples, theta[0] = 0; factor: samples under either mean;
    stride: every how many-th coefficient; coefficients (k,): filled in place; (k - 1) * stride + 2
    * factor <= n.
    """
    scale = 0.5 / factor
    for k in range(coefficients.size):
        t = k * stride
        coefficients[k] = scale * (theta[t + 2 * factor] - 2.0 * theta[t + factor] + theta[t])
