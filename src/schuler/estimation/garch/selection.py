"""Orders of a GARCH model by AIC or BIC."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

from numpy.typing import ArrayLike

from schuler.errors import InputError
from schuler.estimation.garch.fit import fit_garch
from schuler.estimation.garch.result import GarchCandidate, GarchFit


def select_garch(
    signal: ArrayLike,
    max_p: int = 2,
    max_q: int = 2,
    *,
    criterion: Literal["aic", "bic"] = "bic",
    rate: float = 1.0,
    mean: Literal["sample", "zero"] = "sample",
) -> GarchFit:
    """Choose the orders of a GARCH model on the same samples.

    Parameters
    ----------
    signal : (n,) array_like
        Uncorrelated noise in any unit u.
    max_p, max_q : int
        The grid is 1 .. max_p squares by 0 .. max_q variances.
    criterion : {"aic", "bic"}
        Smaller is better.
    rate : float
        Samples a second.
    mean : {"sample", "zero"}
        What is taken off first.

    Returns
    -------
    GarchFit
        The best among the converged fits without a weight at its bound, the smallest order if
        there is none; `candidates` has all of them with the reason of rejection.

    Raises
    ------
    InputError
        Not one-dimensional, not finite, impossible orders or criterion.

    Notes
    -----
    Spec 5.2. Mean and variance of Z say nothing about the order (E-000-8): look at the tests
    `after` the fit.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import select_garch, simulate_garch
    >>> noise, _ = simulate_garch(3_000, 0.1, 0.2, 0.7, np.random.default_rng(1))
    >>> select_garch(noise, 1, 1).alpha.size
    1
    """
    if criterion not in ("aic", "bic"):
        raise InputError(f"criterion '{criterion}'", expected="'aic' or 'bic'")
    if int(max_p) != max_p or int(max_q) != max_q or max_p < 1 or max_q < 0:
        raise InputError(
            f"largest GARCH orders ({max_p}, {max_q})", expected="p at least 1, q at least 0"
        )
    fits = [
        fit_garch(signal, p, q, rate=rate, mean=mean)
        for p in range(1, max_p + 1)
        for q in range(max_q + 1)
    ]
    candidates = tuple(_candidate(fit) for fit in fits)
    scores = [
        fit.aic if criterion == "aic" else fit.bic
        for fit, c in zip(fits, candidates, strict=True)
        if not c.rejected
    ]
    if not scores:
        return replace(fits[0], candidates=candidates)
    best = min(scores)
    for fit, candidate in zip(fits, candidates, strict=True):
        if not candidate.rejected and (fit.aic if criterion == "aic" else fit.bic) == best:
            return replace(fit, candidates=candidates)
    return fits[0]


def _candidate(fit: GarchFit) -> GarchCandidate:
    rejected = ""
    weights = [v for k, v in fit.values.items() if k.startswith(("alpha_", "beta_"))]
    if not fit.converged:
        rejected = "not converged"
    elif any(w <= 0.0 for w in weights) and any(w > 0.0 for w in weights):
        rejected = "a weight is zero: a smaller order says the same"
    elif fit.method not in ("maximum likelihood", "constant"):
        rejected = f"fitted by {fit.method}"
    p, q = fit.order
    return GarchCandidate(p, q, fit.log_likelihood, fit.aic, fit.bic, rejected)
