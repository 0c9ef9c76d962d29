"""Least squares of redundant axes with constant weights (spec 6.2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.arrays.geometry import check_rank
from schuler.errors import InputError
from schuler.types import FloatArray

PASS = 4096
"""Samples fused in one go: what is taken from them stays in the cache."""


@dataclass(frozen=True, slots=True, eq=False)
class LeastSquares:
    """How M axes become one vector."""

    axes: FloatArray  # (M, 3): A
    # (3, M): (A' P A)^-1 A' P with P the inverse of the covariance of the measurements: a left
    # inverse of A, not a projector (E-002-2)
    pi: FloatArray
    covariance: FloatArray  # (3, 3): (A' P A)^-1, of the fused vector

    @property
    def residual(self) -> FloatArray:
        """I - A pi, (M, M): takes measurements to least-squares residuals."""
        return np.eye(self.axes.shape[0]) - self.axes @ self.pi


def least_squares(axes: ArrayLike, covariance: ArrayLike | None = None) -> LeastSquares:
    """Return the least squares of redundant axes."""
    a = np.asarray(axes, dtype=np.float64)
    check_rank(a)
    count = a.shape[0]
    c = np.ones(count) if covariance is None else np.asarray(covariance, dtype=np.float64)
    if c.shape not in ((count,), (count, count)):
        raise InputError(
            f"a covariance of shape {c.shape} for {count} axes",
            expected=f"({count},) or ({count}, {count})",
        )
    if c.ndim == 1:
        if not (np.isfinite(c).all() and c.min() > 0.0):
            raise InputError("variances that are not positive", expected="finite, above zero")
        # scaled by the median so that no unit is extreme
        root = np.sqrt(c)
        whitened, unwhiten = a / root[:, None], np.diag(1.0 / root)
    else:
        try:
            lower = np.linalg.cholesky(c)
        except np.linalg.LinAlgError:
            lower = np.full_like(c, np.nan)
        if not np.isfinite(lower).all() or np.linalg.cond(c) > 1e13:
            raise InputError(
                "a covariance of the measurements that is singular or not positive definite",
                expected="independent noise on every axis, at least a little",
                cure="leave out a sensor that is a copy of others",
            )
        from scipy.linalg import solve_triangular

        whitened = solve_triangular(lower, a, lower=True)
        unwhiten = solve_triangular(lower, np.eye(count), lower=True)
    q, r = np.linalg.qr(whitened)
    pi = np.linalg.solve(r, q.T @ unwhiten)
    inverse = np.linalg.inv(r)
    return LeastSquares(a, pi, inverse @ inverse.T)


def fuse_constant(
    measurements: FloatArray,
    axes: FloatArray,
    covariance: FloatArray,
    *,
    bias: FloatArray | None = None,
    tensor: FloatArray | None = None,
    arm: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray, NDArray[np.int64]]:
    """Fuse all samples with one covariance; where axes are missing, those that are there."""
    whole = least_squares(axes, covariance)
    fused = _fuse(measurements, whole.pi, bias, tensor, arm)
    which = np.zeros(measurements.shape[0], dtype=np.int64)
    solutions = [whole.pi]
    rows = np.zeros(0, dtype=np.int64)
    if np.isnan(fused.sum()):
        rows = np.flatnonzero(np.isnan(fused[:, 0] + fused[:, 1] + fused[:, 2]))
    if rows.size:
        there = np.isfinite(measurements[rows])
        sets, index = np.unique(there, axis=0, return_inverse=True)
        for s, use in enumerate(sets):
            mine = rows[index.ravel() == s]
            which[mine] = len(solutions)
            part = covariance[use] if covariance.ndim == 1 else covariance[np.ix_(use, use)]
            pi = np.full((3, axes.shape[0]), np.nan)
            try:
                fit = least_squares(axes[use], part)
            except InputError:
                fused[mine] = np.nan
            else:
                pi[:] = 0.0
                pi[:, use] = fit.pi
                filled = np.where(use, measurements[mine], 0.0)
                fused[mine] = _fuse(filled, pi, bias, None if tensor is None else tensor[mine], arm)
            solutions.append(pi)
    return fused, np.stack(solutions), which


def _fuse(
    measurements: FloatArray,
    pi: FloatArray,
    bias: FloatArray | None,
    tensor: FloatArray | None,
    arm: FloatArray | None,
) -> FloatArray:
    fused = np.empty((measurements.shape[0], 3))
    by = np.ascontiguousarray(pi.T)
    shift = None if bias is None else pi @ bias
    # the arm of the fused sensor: nothing when it is the mean and the origin is the centre
    turning = None if tensor is None or arm is None else arm @ by
    for start in range(0, fused.shape[0], PASS):
        part = slice(start, start + PASS)
        out = np.matmul(measurements[part], by, out=fused[part])
        if shift is not None:
            out -= shift
        if tensor is not None and turning is not None:
            out -= tensor[part] @ turning
    return fused


def residuals(measurements: FloatArray, axes: FloatArray) -> FloatArray:
    """Return residuals against the least squares with equal weights."""
    fused, _, _ = fuse_constant(measurements, axes, np.ones(axes.shape[0]))
    return measurements - fused @ axes.T
