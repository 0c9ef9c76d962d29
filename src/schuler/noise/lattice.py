"""Autoregressive polynomials, reflection coefficients and autocovariances: one from another.

The recursions of Levinson and Durbin (S003 (9b)-(9g)), forwards and backwards. Polynomials are
those of A(z) = 1 + a_1 z^-1 + ... (spec 0), without the leading one.
"""

from __future__ import annotations

import numpy as np

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
