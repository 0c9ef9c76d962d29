"""The recursion of conditional variances: likelihood, prediction, simulation (spec 5.2)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import InputError, ModelError
from schuler.estimation.signals import checked_signal
from schuler.types import FloatArray

BACKCAST_DECAY = 0.94
BACKCAST_SAMPLES = 75
EWMA_DECAY = 0.98
_LONGEST_BURN_IN = 200_000


def weights(values: ArrayLike, what: str) -> FloatArray:
    """Return one or more finite weights, zero or above."""
    array = np.atleast_1d(np.asarray(values, dtype=np.float64))
    if array.ndim != 1 or not np.isfinite(array).all() or (array < 0.0).any():
        raise ModelError(f"{what} is {array.tolist()}", expected="finite numbers, zero or above")
    return array


def backcast(residuals: FloatArray) -> float:
    """Variance before the first sample: weighted squares of the first 75 samples."""
    first = residuals[:BACKCAST_SAMPLES] ** 2
    weight = BACKCAST_DECAY ** np.arange(first.size)
    return float(first @ weight / weight.sum())


def garch_conditional_variance(
    residuals: ArrayLike, alpha0: float, alpha: ArrayLike, beta: ArrayLike, *, before: float
) -> FloatArray:
    """One-step-ahead variances; each depends on the samples before it alone."""
    from schuler.kernels.noise.garch import garch_variances

    values = checked_signal(residuals, 0, varying=False)
    constant = float(weights(alpha0, "alpha0")[0])
    variances = np.empty(values.size)
    start = float(weights(before, "variance before the start")[0])
    garch_variances(
        values**2, constant, weights(alpha, "alpha"), weights(beta, "beta"), start, variances
    )
    return variances


def garch_log_likelihood(
    residuals: ArrayLike,
    alpha0: float,
    alpha: ArrayLike,
    beta: ArrayLike,
    *,
    before: float | None = None,
) -> float:
    """Return the Gaussian log likelihood of GARCH(p, q) at given parameters.

    Parameters
    ----------
    residuals : (n,) array_like
        Zero-mean noise, in u.
    alpha0 : float
        Constant of the variance, u².
    alpha, beta : float or array_like
        Weights of past squares and of past variances.
    before : float, optional
        Variance before the first sample, u²; the sample's own if not given.

    Returns
    -------
    float
        Without the constant -n/2 ln 2 pi if that is how `fit_garch` counts it.

    Raises
    ------
    InputError
        Negative parameters.

    Notes
    -----
    S000 (7); Bollerslev 1986.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> e = np.random.default_rng(0).normal(size=1000)
    >>> flat = schuler.garch_log_likelihood(e, 1.0, 0.0, 0.0)
    >>> flat > schuler.garch_log_likelihood(e, 4.0, 0.0, 0.0)
    True
    """
    values = checked_signal(residuals, 1, varying=False)
    start = backcast(values) if before is None else before
    variances = garch_conditional_variance(values, alpha0, alpha, beta, before=start)
    if not (variances > 0.0).all():
        raise ModelError("the conditional variance becomes zero", expected="alpha0 above zero")
    terms = math.log(2.0 * math.pi) + np.log(variances) + values**2 / variances
    return -0.5 * float(terms.sum())


def ewma_variance(
    residuals: ArrayLike, decay: float = EWMA_DECAY, *, before: float | None = None
) -> FloatArray:
    """Exponentially weighted variance of the past: GARCH without parameters to fit.

    Parameters
    ----------
    residuals : (n,) array_like
        Zero-mean noise, in u.
    decay : float
        Weight of the last variance, 0 to 1.
    before : float, optional
        Variance before the first sample, u²; the sample's own if not given.

    Returns
    -------
    (n,) ndarray
        Variance of every sample given those before it, u².

    Raises
    ------
    InputError
        A decay outside 0 to 1.

    Notes
    -----
    RiskMetrics 1996: GARCH(1,1) with alpha0 = 0 and alpha + beta = 1.

    Examples
    --------
    >>> import schuler
    >>> schuler.ewma_variance([1.0, 1.0, 1.0], 0.5, before=1.0)
    array([1., 1., 1.])
    """
    if not 0.0 < decay < 1.0:
        raise InputError(f"decay {decay:g}", expected="a number between 0 and 1")
    values = checked_signal(residuals, 1, varying=False)
    start = float(values[0] ** 2) if before is None else before
    return garch_conditional_variance(values, 0.0, 1.0 - decay, decay, before=start)


def simulate_garch(
    samples: int, alpha0: float, alpha: ArrayLike, beta: ArrayLike, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Draw GARCH noise with Gaussian Z, after a start that has been forgotten.

    Parameters
    ----------
    samples : int
        How many.
    alpha0 : float
        Constant of the variance, u².
    alpha, beta : float or array_like
        Weights of past squares and of past variances; their sum below one.
    rng : numpy.random.Generator
        Source of randomness.

    Returns
    -------
    noise : (samples,) ndarray
        In u.
    variance : (samples,) ndarray
        True conditional variance, u².

    Raises
    ------
    InputError
        Parameters without a stationary variance.

    Notes
    -----
    S000 (7).

    Examples
    --------
    >>> import numpy as np, schuler
    >>> noise, variance = schuler.simulate_garch(100, 1e-7, 0.02, 0.97, np.random.default_rng(0))
    >>> noise.shape
    (100,)
    """
    from schuler.kernels.noise.garch import garch_noise

    if samples < 0:
        raise ModelError(f"{samples} samples were asked for", expected="zero or more")
    past, memory = weights(alpha, "alpha"), weights(beta, "beta")
    constant = float(weights(alpha0, "alpha0")[0])
    persistence = float(past.sum() + memory.sum())
    if persistence >= 1.0:
        raise ModelError(
            f"GARCH weights sum to {persistence:.9g}", expected="less than one (finite variance)"
        )
    half_life = -math.log(2.0) / math.log(max(persistence, 1e-3))
    burn_in = int(min(10.0 * half_life, _LONGEST_BURN_IN)) + past.size + memory.size
    noise = rng.standard_normal(burn_in + samples)
    variance = np.empty(noise.size)
    garch_noise(noise, constant, past, memory, constant / (1.0 - persistence), variance)
    return noise[burn_in:].copy(), variance[burn_in:].copy()
