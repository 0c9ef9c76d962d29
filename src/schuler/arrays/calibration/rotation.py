"""How one triad is turned against another, from the rates that both feel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import EstimationError, InputError
from schuler.rotations import skew, wahba
from schuler.types import FloatArray

TUKEY = 4.685
"""Cut of the biweight, in standard deviations: 95 % efficient with normal errors."""
MAD = 1.4826
"""From the median absolute deviation to the standard deviation of normal errors."""
SWEEPS = 12
"""Rounds of reweighting."""
UNSEEN = np.radians(3.0)
"""Standard deviation of a rotation above which its direction counts as not seen."""
STANDS_OUT = 0.05
"""Of the variance of the noise: motion about an axis with less than this is none."""
MIRRORED = 0.25
"""Share of the squares that a reflection must leave of what a rotation leaves, to be believed."""


@dataclass(frozen=True, slots=True, eq=False)
class RelativeRotation:
    """Rotation of one triad against another."""

    # (3, 3): takes vectors from the axes of the second into those of the first
    rotation: FloatArray
    covariance: FloatArray  # (3, 3): of the small rotation about the axes of the first, rad²
    # (3,): constant difference first minus turned second, rad/s: the difference of the biases
    offset: FloatArray
    deviation: float  # robust standard deviation of a component of the residuals, rad/s

    @property
    def standard_deviation(self) -> FloatArray:
        """Of the rotation about each axis of the first, rad."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance)))

    @property
    def unseen(self) -> FloatArray:
        """Axes, (m, 3), about which the rotation is not known to 3 deg; empty when all is well."""
        variance, axes = np.linalg.eigh(self.covariance)
        return np.asarray(axes[:, variance > UNSEEN**2].T)


def align_rates(first: ArrayLike, second: ArrayLike) -> RelativeRotation:
    """Find the rotation between two triads of gyros on one body."""
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    if a.ndim != 2 or a.shape != b.shape or a.shape[1] != 3:
        raise InputError(f"rates of shapes {a.shape} and {b.shape}", expected="(n, 3) both")
    whole = np.isfinite(a).all(axis=1) & np.isfinite(b).all(axis=1)
    a, b = a[whole], b[whole]
    if a.shape[0] < 10:
        raise EstimationError(
            f"{a.shape[0]} rows in which both triads have rates", expected="at least 10"
        )
    weight = np.ones(a.shape[0])
    rotation, offset, deviation = np.eye(3), np.zeros(3), 0.0
    for _ in range(SWEEPS):
        total = weight.sum()
        mean_a, mean_b = weight @ a / total, weight @ b / total
        rotation = wahba(a - mean_a, b - mean_b, weight)
        offset = mean_a - rotation @ mean_b
        residual = a - offset - b @ rotation.T
        length = np.linalg.norm(residual, axis=1)
        # the median of the length of three normal numbers is 1.5382 standard deviations
        deviation = float(np.median(length)) / 1.5382
        if deviation <= 1e-14 * float(np.abs(a).max() + 1e-300):
            break  # nothing is left to reweight by
        limit = TUKEY * deviation * np.sqrt(3.0)
        weight = np.where(length < limit, (1.0 - (length / limit) ** 2) ** 2, 0.0)
    _check_handed(a, b, weight, residual)
    centred = (b - weight @ b / weight.sum()) @ rotation.T
    information = np.einsum("n,nij,nkj->ik", weight, skew(centred), skew(centred))
    values, axes = np.linalg.eigh(information)
    # Noise of the second triad looks like motion about every axis: taken off, as if both were
    # equally noisy, and what is left counts only where it stands out.
    floor = max(deviation, 1e-12)
    noise = floor**2 * float(weight.sum())
    seen = np.where(values > (1.0 + STANDS_OUT) * noise, values - noise, 0.0)
    variance = floor**2 / np.maximum(seen, floor**2 / np.pi**2)
    return RelativeRotation(rotation, (axes * variance) @ axes.T, offset, deviation)


def _check_handed(a: FloatArray, b: FloatArray, weight: FloatArray, residual: FloatArray) -> None:
    """Raise when a mirror image of the second triad fits the first, and a rotation does not."""
    left = a - weight @ a / weight.sum()
    right = b - weight @ b / weight.sum()
    moment = np.einsum("n,ni,nj->ij", weight, left, right)
    u, _, vt = np.linalg.svd(moment)
    if np.linalg.det(u) * np.linalg.det(vt) > 0.0:
        return  # a rotation is the best orthogonal matrix
    mirrored = float(np.sum((left - right @ (u @ vt).T) ** 2))
    if mirrored < MIRRORED * float(np.sum(residual**2)):
        raise InputError(
            "the axes of the second triad are left-handed: with one of them reversed its rates "
            "agree with the first, by turning alone they do not",
            expected="right-handed axes",
            cure="one axis has the wrong sign, or two are swapped: check the columns",
        )
