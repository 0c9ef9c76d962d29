"""Variance of every sensor from what redundant sensors say about one another (spec 5.4)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.arrays.synthesis.least_squares import least_squares
from schuler.errors import EstimationError, InputError
from schuler.types import FloatArray

Method = Literal["nnls", "clip"]

FLOOR = 0.1
"""Smallest variance, as a share of the median, that the differences are trusted to show."""


@dataclass(frozen=True, slots=True, eq=False)
class CorneredHat:
    """Variances of redundant sensors, and whether they may be believed."""

    variances: FloatArray  # (M,): of each axis, square of the unit of the residuals
    standard_errors: FloatArray  # (M,): of the variances, for Gaussian noise
    # (M,): what the residuals themselves show: shrunk towards one another
    residual_variances: FloatArray
    floored: NDArray[np.bool_]  # (M,): variances that came out below the floor and were put there
    samples: float  # number of independent samples that the residuals are worth
    correlation: FloatArray  # (M, M): of the residuals
    # (M, M): that independent sensors with these variances would show
    expected_correlation: FloatArray
    # of the largest departure from it over all pairs: small means that sensors share errors
    p_value: float
    pair: tuple[int, int]  # the two axes concerned

    @property
    def deviations(self) -> FloatArray:
        """Standard deviation of each axis."""
        return np.sqrt(self.variances)

    @property
    def independent(self) -> bool:
        """True when the correlations of the residuals are those of independent sensors (1 %)."""
        return self.p_value > 0.01


def cornered_hat(
    residuals: ArrayLike, axes: ArrayLike | None = None, *, method: Method = "nnls"
) -> CorneredHat:
    """Return the variance of each of three or more redundant sensors, without a reference.

    Parameters
    ----------
    residuals : (n, M) array_like
        Measurements of M sensors, or their residuals; rows with NaN are left out.
    axes : (M, 3) array_like, optional
        Sensitive axes; all along one line if not given.
    method : {"nnls", "clip"}
        Least squares without negative variances, or the plain solution with a floor.

    Returns
    -------
    CorneredHat
        Variances (M,) in the square of the unit of `residuals`, their standard errors, and the
        probability of correlations as large as those found if the sensors were independent.

    Raises
    ------
    InputError
        Not two-dimensional, or fewer than two rows without gaps.
    EstimationError
        Sensors that cannot be told apart (fewer than three on one line), or no noise at all.

    Notes
    -----
    Residuals against the mean of n sensors show (1 - 2/n) I + 11'/n² times the variances
    (erratum E-000-11 of S000); this turns them back. Gray and Allan 1974, Proc. 28th FCS.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> noise = np.random.default_rng(0).normal(size=(20_000, 3)) * [1.0, 1.0, 3.0]
    >>> schuler.cornered_hat(noise).deviations.round(1)
    array([1., 1., 3.])
    """
    x = np.asarray(residuals, dtype=np.float64)
    if x.ndim != 2:
        raise InputError(f"residuals of shape {x.shape}", expected="(n, M)")
    count = x.shape[1]
    spread = _residual_matrix(count, axes)
    check_separable(spread)
    x = x[np.isfinite(x).all(axis=1)]
    if x.shape[0] < 2:
        raise InputError(f"{x.shape[0]} rows without gaps", expected="at least two")
    x = (x - x.mean(axis=0)) @ spread.T
    moments = x.T @ x / (x.shape[0] - 1)
    observed = np.diag(moments).copy()
    if not observed.max() > 0.0:
        raise EstimationError("residuals that are all zero", expected="sensors with noise")
    square = spread**2
    if method == "clip":
        variances = np.asarray(np.linalg.solve(square, observed), dtype=np.float64)
    else:
        from scipy.optimize import nnls

        scale = float(observed.max())
        variances = nnls(square, observed / scale)[0] * scale
    least = FLOOR * float(np.median(variances[variances > 0.0]))
    floored = variances < least
    variances = np.asarray(np.where(floored, least, variances), dtype=np.float64)
    worth = x.shape[0] / _variance_inflation(x)
    expected = spread @ (variances[:, None] * spread.T)
    inverse = np.linalg.inv(square)
    scatter = 2.0 * expected**2 / worth
    errors = np.sqrt(np.diag(inverse @ scatter @ inverse.T))
    p_value, pair = _independence(moments, expected, worth)
    return CorneredHat(
        variances,
        errors,
        observed,
        floored,
        worth,
        _correlation(moments),
        _correlation(expected),
        p_value,
        pair,
    )


def check_separable(spread: FloatArray) -> None:
    """Raise when residuals cannot tell the sensors apart."""
    if np.linalg.cond(spread**2) < 1e8:
        return
    if np.abs(spread).max() < 1e-9:
        raise EstimationError(
            "sensors without redundancy have no residuals",
            expected="three or more sensors along every direction",
        )
    raise EstimationError(
        "two sensors cannot be told apart: their difference shows the sum of their variances, "
        "and any share of it may belong to either",
        expected="three or more sensors along every direction",
        cure="give their noise, or take them as equal",
    )


def _residual_matrix(count: int, axes: ArrayLike | None) -> FloatArray:
    if axes is None:
        return np.asarray(np.eye(count) - 1.0 / count)
    a = np.asarray(axes, dtype=np.float64)
    if a.shape != (count, 3):
        raise InputError(f"axes of shape {a.shape}", expected=f"({count}, 3)")
    return least_squares(a).residual


def _variance_inflation(x: FloatArray) -> float:
    """How many samples are worth one, for second moments: 1 + 2 sum of squared correlations."""
    n = x.shape[0]
    lags = min(200, n // 10)
    scale = np.sqrt((x**2).mean(axis=0))
    z = x / np.where(scale > 0.0, scale, 1.0)
    total = 1.0
    for lag in range(1, lags + 1):
        r = (z[lag:] * z[:-lag]).sum(axis=0) / n
        # what chance alone would give is left out
        share = float(np.mean(r**2)) - 1.0 / n
        if share < 2.0 / n:
            break
        total += 2.0 * share
    return total


def _correlation(moments: FloatArray) -> FloatArray:
    scale = np.sqrt(np.clip(np.diag(moments), 1e-300, None))
    return np.asarray(moments / np.outer(scale, scale))


def _independence(
    moments: FloatArray, expected: FloatArray, worth: float
) -> tuple[float, tuple[int, int]]:
    """p-value of the largest departure of a cross moment, and the pair."""
    from scipy.stats import norm

    variance = (np.outer(np.diag(expected), np.diag(expected)) + expected**2) / worth
    score = np.abs(moments - expected) / np.sqrt(variance)
    rows, columns = np.triu_indices(score.shape[0], 1)
    worst = int(np.argmax(score[rows, columns]))
    p = 2.0 * float(norm.sf(score[rows[worst], columns[worst]])) * rows.size
    return min(p, 1.0), (int(rows[worst]), int(columns[worst]))
