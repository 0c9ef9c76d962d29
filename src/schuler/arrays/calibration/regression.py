"""Robust linear regression of vectors, with errors that know of correlated residuals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.types import FloatArray

CUT = 4.685 * np.sqrt(3.0)
"""Length, in standard deviations of a component, at which a residual of three counts no more."""
SWEEPS = 15
"""Rounds of reweighting at most."""
LENGTH = 1.5382
"""Median of the length of three normal numbers, in standard deviations."""
BINS = 12
"""Classes of motion in which the scale of residuals is found."""


@dataclass(frozen=True, slots=True, eq=False)
class VectorFit:
    """Result of a regression of vectors."""

    values: FloatArray  # (p,): coefficients
    # (p, p): of these: a sandwich over clusters of neighbouring samples, with the prior
    covariance: FloatArray
    residual: FloatArray  # (m, 3): target minus fit, all rows
    weight: FloatArray  # (m,): tukey's weights, 0 to 1

    @property
    def standard_deviation(self) -> FloatArray:
        """Of the coefficients."""
        return np.asarray(np.sqrt(np.diagonal(self.covariance)))


def regress_vectors(
    design: FloatArray,
    target: FloatArray,
    noise: FloatArray,
    cluster: NDArray[np.int64],
    prior_sd: FloatArray,
) -> VectorFit:
    """Fit vectors by least squares with Tukey's biweight and a weak prior around zero."""
    scaled, goal = design / noise[:, None, None], target / noise[:, None]
    prior = np.diag(1.0 / prior_sd**2)
    weight: FloatArray = np.ones(goal.shape[0])
    values: FloatArray = np.zeros(design.shape[2])
    scale = 1.0
    for sweep in range(SWEEPS):
        normal, right = _normal(scaled, goal, weight)
        before = values
        values = np.asarray(
            np.linalg.solve(normal / scale**2 + prior, right / scale**2), dtype=np.float64
        )
        residual = goal - np.einsum("mip,p->mi", scaled, values)
        length = np.linalg.norm(residual, axis=1)
        scale = max(float(np.median(length)) / LENGTH, 1e-12)
        weight = np.where(length < CUT * scale, (1.0 - (length / (CUT * scale)) ** 2) ** 2, 0.0)
        change = np.abs(values - before) / prior_sd
        if sweep > 2 and change.max() < 1e-7:
            break
    normal, _ = _normal(scaled, goal, weight)
    bread = np.linalg.inv(normal / scale**2 + prior)
    score = np.einsum("m,mip,mi->mp", weight / scale**2, scaled, residual)
    _, index = np.unique(cluster, return_inverse=True)
    sums = np.zeros((int(index.max()) + 1, values.size))
    np.add.at(sums, index, score)
    # the coefficients fit the clusters' own sums: as many of these count for nothing
    groups = sums.shape[0]
    meat = sums.T @ sums * (groups / max(groups - values.size, 1)) + prior
    covariance = bread @ meat @ bread
    return VectorFit(values, covariance, residual * noise[:, None], weight)


def _normal(
    design: FloatArray, target: FloatArray, weight: FloatArray
) -> tuple[FloatArray, FloatArray]:
    flat = (design * np.sqrt(weight)[:, None, None]).reshape(-1, design.shape[2])
    goal = (target * np.sqrt(weight)[:, None]).ravel()
    return flat.T @ flat, flat.T @ goal


def scale_by_motion(residual: FloatArray, motion: FloatArray) -> FloatArray:
    """Find how the scale of residuals follows motion."""
    length = np.median(np.linalg.norm(residual, axis=2), axis=1) / LENGTH
    order = np.argsort(motion)
    parts = np.array_split(order, min(BINS, max(1, motion.size // 20)))
    middle = np.array([np.median(motion[p]) for p in parts])
    scale = np.maximum.accumulate(np.array([np.median(length[p]) for p in parts]))
    scale = np.maximum(scale, 1e-6 * max(float(scale[-1]), 1e-300) + 1e-12)
    return np.asarray(np.interp(motion, middle, scale))
