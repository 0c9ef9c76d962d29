"""What gravity says about the mean accelerometer: scale, axes and bias from static poses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schuler.types import FloatArray

STANDARD_GRAVITY = 9.80665
"""m/s²."""
LEAST = 12
"""Poses that are needed for nine numbers and some redundancy."""
WORST = 0.05
"""Standard deviation of an element above which the poses do not determine it, and none is used."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseFit:
    """The mean accelerometer against gravity."""

    matrix: FloatArray  # (3, 3): symmetric H: the force is H (mean reading - bias)
    matrix_sd: FloatArray  # (3, 3): standard deviations
    # bias, bias_sd: (3,) in the body, m/s²
    bias: FloatArray
    bias_sd: FloatArray
    deviation: float  # standard deviation of |force| over the poses after the fit, m/s²
    before: float  # the same before, with the mean taken off
    poses: int  # how many


def fit_poses(mean_force: FloatArray, gravity: float = STANDARD_GRAVITY) -> PoseFit | None:
    """Find the linear map that makes all static readings as long as gravity."""
    f = np.asarray(mean_force, dtype=np.float64)
    if f.shape[0] < LEAST:
        return None
    matrix, bias = np.eye(3), np.zeros(3)
    pairs = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
    for _ in range(20):
        free = f - bias
        force = free @ matrix
        length = np.linalg.norm(force, axis=1)
        unit = force / length[:, None]
        jacobian = np.empty((f.shape[0], 9))
        for c, (i, j) in enumerate(pairs):
            jacobian[:, c] = unit[:, i] * free[:, j]
            if i != j:
                jacobian[:, c] += unit[:, j] * free[:, i]
        jacobian[:, 6:] = -unit @ matrix
        step, *_ = np.linalg.lstsq(jacobian, gravity - length, rcond=None)
        for c, (i, j) in enumerate(pairs):
            matrix[i, j] += step[c]
            if i != j:
                matrix[j, i] += step[c]
        bias = bias + step[6:]
        if np.abs(step).max() < 1e-12:
            break
    left = np.linalg.norm((f - bias) @ matrix, axis=1) - gravity
    variance = float(left @ left) / (f.shape[0] - 9)
    normal = jacobian.T @ jacobian
    if np.linalg.cond(normal) > 1e12:
        return None
    sd = np.sqrt(variance * np.diagonal(np.linalg.inv(normal)))
    if sd[:6].max() > WORST:
        return None
    matrix_sd = np.zeros((3, 3))
    for c, (i, j) in enumerate(pairs):
        matrix_sd[i, j] = matrix_sd[j, i] = sd[c]
    before = float(np.std(np.linalg.norm(f, axis=1)))
    return PoseFit(matrix, matrix_sd, bias, sd[6:], float(np.sqrt(variance)), before, f.shape[0])
