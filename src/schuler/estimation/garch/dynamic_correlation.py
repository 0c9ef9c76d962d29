"""Several noises at once: a whole covariance that changes with its own past (DCC, Engle 2002)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from schuler.data._checks import check_finite
from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.estimation.garch.differences import climb_samples
from schuler.estimation.garch.fit import fit_garch
from schuler.estimation.garch.result import GarchFit
from schuler.types import FloatArray

_STARTS = ((0.97, 0.03), (0.9, 0.1), (0.995, 0.01), (0.6, 0.2))
"""Persistence a + b of the correlations, and the share a has of it."""
_CHANCE = 1e-3
_EDGE = 16.0


@dataclass(frozen=True, slots=True, eq=False)
class DccFit(Exportable):
    """Q(t) = (1 - a - b) C + a z(t-1) z(t-1)' + b Q(t-1), correlations being Q with unit diagonal.

    Parameters
    ----------
    garches : tuple of GarchFit
        Variance of every noise.
    a, b : float
        Weight of the last products of standardised noises, and of the last Q.
    correlation : (k, k) ndarray
        C, of the standardised noises on average.
    standard_errors : dict of str to float
        Of "a", "b" and "persistence" = a + b, whatever the law of z; the variances being given.
    log_likelihood : float
        Gaussian, of all noises together.
    constant_log_likelihood : float
        The same with correlations that do not change.
    samples : int
        Length.
    converged : bool
        All parts.
    flags : tuple of str
        What to know before use.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import fit_dcc
    >>> fit_dcc(np.random.default_rng(1).standard_normal((2_000, 3))).covariances(
    ...     np.zeros((10, 3))).shape
    (10, 3, 3)
    """

    JSON = (
        "a b correlation standard_errors log_likelihood constant_log_likelihood samples converged "
        "flags garches"
    )

    garches: tuple[GarchFit, ...]
    a: float
    b: float
    correlation: FloatArray
    standard_errors: dict[str, float]
    log_likelihood: float
    constant_log_likelihood: float
    samples: int
    converged: bool
    flags: tuple[str, ...]

    def correlations(self, signals: ArrayLike) -> FloatArray:
        """Correlations of every sample given the samples before it, (n, k, k)."""
        values = _checked(signals, len(self.garches))
        return _full(_correlations(_standardised(values, self.garches), self.correlation, self.a,
                                   self.b), values.shape[1])  # fmt: skip

    def covariances(self, signals: ArrayLike) -> FloatArray:
        """Covariances of every sample given the samples before it, (n, k, k), in u²."""
        values = _checked(signals, len(self.garches))
        deviation = _deviations(values, self.garches)
        return self.correlations(values) * deviation[:, :, None] * deviation[:, None, :]

    def weights(self, signals: ArrayLike) -> FloatArray:
        """Weights (n, k) that sum to one and give the mean with the least variance."""
        covariance = self.covariances(signals)
        solved = np.linalg.solve(covariance, np.ones((*covariance.shape[:2], 1)))[:, :, 0]
        return np.asarray(solved / solved.sum(axis=1, keepdims=True))


def fit_dcc(signals: ArrayLike, *, rate: float = 1.0, robust: bool = False) -> DccFit:
    """Fit GARCH(1,1) to every noise and DCC(1,1) to their correlations, one after the other.

    Parameters
    ----------
    signals : (n, k) array_like
        Two or more noises, such as the residuals of the sensors of an array, uncorrelated in time.
    rate : float
        Samples a second.
    robust : bool
        As for `fit_garch`; products are then those of noises so held back.

    Returns
    -------
    DccFit
        Read its flags.

    Raises
    ------
    InputError
        Not (n, k) with k of two or more, not finite.

    Notes
    -----
    S000 section 6 wishes it; Engle 2002, Journal of Business and Economic Statistics 20:339, with
    correlation targeting.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import fit_dcc
    >>> rng = np.random.default_rng(1)
    >>> common = rng.standard_normal((3_000, 1))
    >>> fit = fit_dcc(common + rng.standard_normal((3_000, 2)))
    >>> round(float(fit.correlation[0, 1]), 1)
    0.5
    """
    values = _checked(signals, None)
    garches = tuple(fit_garch(column, rate=rate, robust=robust) for column in values.T)
    z = _standardised(values, garches)
    second = z.T @ z / len(z)
    root = np.sqrt(np.diag(second))
    correlation = second / np.outer(root, root)
    own = math.fsum(g.log_likelihood for g in garches)
    constant = float(_gains(z, correlation, 0.0, 0.0).sum())

    def samples(at: FloatArray) -> FloatArray:
        return _gains(z, correlation, *_weights_at(at))

    starts = [np.log([p / (1.0 - p), s / (1.0 - s)]) for p, s in _STARTS]
    start = max(starts, key=lambda s: float(samples(s).sum()))
    top = climb_samples(samples, start, (np.full(2, -_EDGE), np.full(2, _EDGE)))
    a, b = _weights_at(top.at)
    flags = [f"noise {k + 1}: {flag}" for k, g in enumerate(garches) for flag in g.flags]
    # two weights more than none; at the edge of their range the test is a little too strict
    if 2.0 * (top.value - constant) < -2.0 * math.log(_CHANCE):
        flags.append("no changing correlation found: constant correlations describe the noises")
        a, b, errors = 0.0, 0.0, {}
        value, converged = constant, True
    else:
        value, converged, errors = top.value, top.converged, _errors(top.at, top.sandwich)
    if not converged:
        flags.append("the search for the correlations did not converge")
    return DccFit(
        garches,
        a,
        b,
        correlation,
        errors,
        own + value,
        own + constant,
        len(values),
        converged and all(g.converged or g.method == "constant" for g in garches),
        tuple(flags),
    )


def _checked(signals: ArrayLike, count: int | None) -> FloatArray:
    values = np.asarray(signals, dtype=np.float64)
    fits = values.ndim == 2 and values.shape[1] >= 2 and count in (None, values.shape[1])
    if not fits:
        wanted = "(n, k), k two or more" if count is None else f"(n, {count})"
        raise InputError(f"signals of shape {values.shape}", expected=wanted)
    check_finite(values, "signals")
    return values


def _deviations(values: FloatArray, garches: tuple[GarchFit, ...]) -> FloatArray:
    columns = [
        g.volatility(x, before=g.start_variance) for x, g in zip(values.T, garches, strict=True)
    ]
    return np.column_stack(columns)


def _standardised(values: FloatArray, garches: tuple[GarchFit, ...]) -> FloatArray:
    z = (values - np.array([g.mean for g in garches])) / _deviations(values, garches)
    limits = np.array([g.held or math.inf for g in garches])
    return np.asarray(np.clip(z, -limits, limits))


def _weights_at(at: FloatArray) -> tuple[float, float]:
    """Weights a and b from the logits of persistence and share."""
    persistence, share = (1.0 / (1.0 + np.exp(-at))).tolist()
    return persistence * share, persistence * (1.0 - share)


def _errors(at: FloatArray, covariance: FloatArray) -> dict[str, float]:
    p, s = (1.0 / (1.0 + np.exp(-at))).tolist()
    dp, ds = p * (1.0 - p), s * (1.0 - s)
    slopes = {"a": (dp * s, p * ds), "b": (dp * (1.0 - s), -p * ds), "persistence": (dp, 0.0)}
    return {k: math.sqrt(max(float(np.array(v) @ covariance @ np.array(v)), 0.0))
            for k, v in slopes.items()}  # fmt: skip


def _correlations(z: FloatArray, mean: FloatArray, a: float, b: float) -> list[list[FloatArray]]:
    """Lower triangle of the correlations, every entry through time."""
    from scipy.signal import lfilter

    k = z.shape[1]
    q = [
        [mean[i, j] + lfilter([0.0, a], [1.0, -b], z[:, i] * z[:, j] - mean[i, j])
         for j in range(i + 1)]
        for i in range(k)
    ]  # fmt: skip
    root = [np.sqrt(q[i][i]) for i in range(k)]
    return [[q[i][j] / (root[i] * root[j]) for j in range(i + 1)] for i in range(k)]


def _full(lower: list[list[FloatArray]], k: int) -> FloatArray:
    out = np.empty((lower[0][0].size, k, k))
    for i in range(k):
        for j in range(i + 1):
            out[:, i, j] = out[:, j, i] = lower[i][j]
    return out


def _gains(z: FloatArray, mean: FloatArray, a: float, b: float) -> FloatArray:
    """What correlations add to the log likelihood of every sample, by Cholesky through time."""
    r = _correlations(z, mean, a, b)
    k = z.shape[1]
    factor: list[list[FloatArray]] = []
    white: list[FloatArray] = []
    logs, squares = np.zeros(len(z)), np.zeros(len(z))
    for i in range(k):
        row: list[FloatArray] = []
        for j in range(i):
            rest = r[i][j] - sum((row[m] * factor[j][m] for m in range(j)), np.zeros(1))
            row.append(rest / factor[j][j])
        own = r[i][i] - sum((part * part for part in row), np.zeros(1))
        row.append(np.sqrt(np.maximum(own, 1e-12)))
        ahead = z[:, i] - sum((row[m] * white[m] for m in range(i)), np.zeros(1))
        white.append(ahead / row[i])
        logs += np.log(row[i])
        squares += white[i] ** 2 - z[:, i] ** 2
        factor.append(row)
    return np.asarray(-logs - 0.5 * squares)
