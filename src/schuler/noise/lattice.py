"""Autoregressive polynomials, reflection coefficients and autocovariances: one from another.

The recursions of Levinson and Durbin (S003 (9b)-(9g)), forwards and backwards. Polynomials are
those of A(z) = 1 + a_1 z^-1 + ... (spec 0), without the leading one.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from schuler.types import FloatArray


def step_up(reflection: FloatArray) -> FloatArray:
    """Polynomials of all orders from reflection coefficients."""
    size = reflection.size
    rows = np.zeros((size, size))
    for k in range(size):
        if k:
            before = rows[k - 1, :k]
            rows[k, :k] = before + reflection[k] * before[::-1]
        rows[k, k] = reflection[k]
    return rows


def step_down(coefficients: FloatArray) -> FloatArray:
    """Reflection coefficients of a polynomial."""
    row = np.array(coefficients, dtype=np.float64)
    reflection = np.empty(row.size)
    for k in range(row.size - 1, -1, -1):
        gamma = row[k]
        if abs(gamma) == 1.0:
            gamma = np.copysign(np.nextafter(1.0, 2.0), gamma)
        reflection[k] = gamma
        row = (row[:k] - gamma * row[:k][::-1]) / (1.0 - gamma * gamma)
    return reflection


def levinson(autocovariance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Reflection coefficients and error variances from an autocovariance."""
    reflection: list[float] = []
    error = [float(autocovariance[0])]
    row = np.zeros(0)
    for k in range(1, autocovariance.size):
        if error[-1] <= 0.0:
            break
        gamma = -float(autocovariance[k] + row @ autocovariance[k - 1 : 0 : -1]) / error[-1]
        if not abs(gamma) < 1.0:
            break
        row = np.append(row + gamma * row[::-1], gamma)
        reflection.append(gamma)
        error.append((1.0 - gamma) * (1.0 + gamma) * error[-1])
    return np.array(reflection), np.array(error)


def autocovariance_from_reflection(
    reflection: FloatArray, innovation_variance: float
) -> tuple[FloatArray, FloatArray]:
    """Autocovariance of a stable autoregressive process: Levinson's recursion backwards."""
    shrink = (1.0 - reflection) * (1.0 + reflection)
    error = innovation_variance / np.append(np.cumprod(shrink[::-1])[::-1], 1.0)
    rows = step_up(reflection)
    out = np.zeros(reflection.size + 1)
    out[0] = error[0]
    for k in range(1, out.size):
        out[k] = -reflection[k - 1] * error[k - 1]
        if k > 1:
            out[k] -= rows[k - 2, : k - 1] @ out[k - 1 : 0 : -1]
    return out, error


def lags_alive(poles: NDArray[np.complex128], most: int) -> int:
    """How many of so many lags to work out before the slowest pole has died away to 1e-30.

    Products of numbers near the smallest there are take a hundred times as long as others.
    """
    slowest = float(np.abs(poles).max(initial=0.0))
    if slowest >= 1.0:
        return most
    lasting = math.log(1e-30) / math.log(max(slowest, 1e-30))
    return min(most, int(lasting) + 2 * poles.size + 1)
