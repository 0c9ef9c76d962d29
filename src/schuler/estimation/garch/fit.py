"""GARCH models of a noise whose variance changes with its own past."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import InputError
from schuler.estimation.garch.conditional_variance import EWMA_DECAY, backcast
from schuler.estimation.garch.likelihood import NEAR, GarchSolution, solve, solve_targeted
from schuler.estimation.garch.result import GarchFit, GarchStart
from schuler.estimation.garch.student import with_student
from schuler.estimation.residuals.tests import ResidualTests, residual_tests
from schuler.estimation.signals import checked_signal, outlier_flag, varies
from schuler.types import FloatArray

__all__ = ["GarchFit", "fit_garch"]


FEWEST = 500
"""Samples below which only a constant variance is estimated (spec 5.2)."""
CONVERGED = 1e-6
HELD = 4.0
"""Conditional deviations beyond which a robust fit holds a sample back."""
_NEARLY_INTEGRATED = 1e-5


def fit_garch(
    signal: ArrayLike,
    p: int = 1,
    q: int = 1,
    *,
    rate: float = 1.0,
    mean: Literal["sample", "zero"] = "sample",
    variance_targeting: bool | None = None,
    start: Literal["backcast", "sample"] | float = "backcast",
    distribution: Literal["normal", "student"] = "normal",
    robust: bool = False,
) -> GarchFit:
    """Fit a GARCH(p, q) by maximum likelihood from several starts.

    Parameters
    ----------
    signal : (n,) array_like
        Uncorrelated noise in any unit u, such as the residuals of an ARMA fit; scaled inside.
    p : int
        Number of past squares, at least 1 (the order of S000 (7); Bollerslev swaps p and q).
    q : int
        Number of past variances.
    rate : float
        Samples a second; only `process` depends on it.
    mean : {"sample", "zero"}
        What is taken off first.
    variance_targeting : bool, optional
        Tie alpha0 to the sample variance, alpha0 = s² (1 - persistence). By default the full
        likelihood decides, and targeting is the fallback where it has no inner maximum, its
        weights summing up to one. Full likelihood stays efficient and its errors valid where
        targeting needs a finite fourth moment, which nearly integrated noise is about to lose.
    start : {"backcast", "sample"} or float
        Variance before the first sample: weighted squares of the first 75 samples, the mean
        square of all (as in the published benchmark of Fiorentini, Calzolari and Panattoni 1996),
        or a number in u².
    distribution : {"normal", "student"}
        Law of Z. Gaussian quasi likelihood is right on average for any law; "student" fits the
        degrees of freedom too, holds single wild samples back, and is flagged where Z is normal.
    robust : bool
        Samples beyond four of their own conditional deviations count as four, in the fit and in
        every variance that is computed from it: a knock moves neither.

    Returns
    -------
    GarchFit
        Read its flags. Signals that do not vary and records below 500 samples give a constant
        variance, flagged; where nothing converges, an exponentially weighted variance, flagged.

    Raises
    ------
    InputError
        Not one-dimensional, not finite, impossible orders.

    Notes
    -----
    Spec 5.2, S000 (7) and (8); the parameter vector has p + q + 1 entries.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import fit_garch
    >>> rng = np.random.default_rng(1)
    >>> signal, variance = np.zeros(20_000), 1.0
    >>> for k in range(signal.size):
    ...     signal[k] = variance**0.5 * rng.standard_normal()
    ...     variance = 0.1 + 0.1 * signal[k] ** 2 + 0.8 * variance
    >>> fit = fit_garch(signal)
    >>> round(float(fit.alpha[0]), 1), round(float(fit.beta[0]), 1)
    (0.1, 0.8)
    """
    if int(p) != p or int(q) != q or p < 1 or q < 0:
        raise InputError(f"GARCH orders ({p}, {q})", expected="p at least 1, q at least 0")
    if mean not in ("sample", "zero"):
        raise InputError(f"mean '{mean}'", expected="'sample' or 'zero'")
    if distribution not in ("normal", "student"):
        raise InputError(f"distribution '{distribution}'", expected="'normal' or 'student'")
    if distribution == "student" and variance_targeting:
        raise InputError("variance targeting with Student's law", expected="one of the two")
    values = checked_signal(signal, 1, varying=False)
    centre = float(values.mean()) if mean == "sample" else 0.0
    if robust:

        def plain(x: FloatArray) -> GarchFit:
            return fit_garch(
                x,
                p,
                q,
                rate=rate,
                mean="zero",
                variance_targeting=variance_targeting,
                start=start,
                distribution=distribution,
            )

        return _held_back(values, float(np.median(values)) if mean == "sample" else 0.0, plain)
    residual = values - centre
    if not varies(values) or not residual.any():
        return _constant(residual, p, q, centre, rate, "constant signal: no variance to model")
    if values.size < max(FEWEST, 20 * (p + q + 1)):
        text = f"short record: {values.size} samples, GARCH needs {FEWEST}; variance kept constant"
        return _constant(residual, p, q, centre, rate, text)
    outlier = outlier_flag(residual)
    scale = float(np.std(residual))
    if outlier:
        # one wild sample must not push all others to the bottom of the scale
        middle = 1.4826 * float(np.median(np.abs(residual)))
        scale = middle if middle > 0.0 else scale
    unit = residual / scale
    before = residual_tests(unit)
    first = _before(start, unit, scale)
    find = solve_targeted if variance_targeting else solve
    solution = find(unit, p, q, first)
    flags: list[str] = []
    if variance_targeting is None and not _inner(solution):
        targeted = solve_targeted(unit, p, q, first)
        if _inner(targeted):
            flags.append(
                "nearly integrated: the likelihood has no inner maximum, alpha0 is tied to the "
                "sample variance (variance targeting)"
            )
            solution = targeted
    if not _inner(solution) and not solution.constant:
        flags.append(
            f"not converged: no inner maximum from any start (persistence "
            f"{solution.persistence:.7f}); exponentially weighted variance instead"
        )
        fit = _ewma(unit, scale, p, q, centre, rate, solution)
    else:
        fit = _estimates(unit, scale, p, q, centre, rate, solution)
    if distribution == "student" and fit.method == "maximum likelihood":
        fit, said = with_student(fit, residual)
        flags += said
    deviation = np.sqrt(fit.conditional_variance(values, before=fit.start_variance))
    after = residual_tests(residual / deviation)
    flags += _flags(fit, solution, before, after, residual, centre, outlier)
    return replace(fit, before=before, after=after, flags=tuple(flags))


def _held_back(
    values: FloatArray, centre: float, fit: Callable[[FloatArray], GarchFit]
) -> GarchFit:
    """Fit again and again to what the last fit lets stand."""
    residual = values - centre
    spread = 1.4826 * float(np.median(np.abs(residual)))
    limit = 2.0 * HELD * spread if spread > 0.0 else math.inf
    kept = np.clip(residual, -limit, limit)
    for _ in range(6):
        found = replace(fit(kept), held=HELD)
        before, kept = kept, found.held_back(residual, before=found.start_variance)
        if np.array_equal(before, kept):
            break
    count = int(np.count_nonzero(kept != residual))
    said = f"{count} samples beyond {HELD:g} conditional deviations were held back"
    return replace(found, mean=centre, flags=(*found.flags, said) if count else found.flags)


def _before(start: object, unit: FloatArray, scale: float) -> float:
    """Variance before the first sample, in units of the scaled noise."""
    if start == "backcast":
        return backcast(unit)
    if start == "sample":
        return float(np.mean(unit**2))
    if isinstance(start, int | float) and math.isfinite(start) and start > 0.0:
        return float(start) / scale**2
    raise InputError(f"start {start!r}", expected="'backcast', 'sample' or a variance above zero")


def _inner(solution: GarchSolution) -> bool:
    """An inner, determined maximum."""
    return (
        solution.distance < CONVERGED
        and not solution.singular
        and not solution.constant
        and 1.0 - solution.persistence > _NEARLY_INTEGRATED
    )


def _estimates(
    unit: FloatArray,
    scale: float,
    p: int,
    q: int,
    centre: float,
    rate: float,
    solution: GarchSolution,
) -> GarchFit:
    """Estimates and errors in the unit of the signal."""
    back = np.ones(p + q + 1)
    back[0] = scale**2
    covariance = solution.covariance * np.outer(back, back)
    parameters = solution.parameters * back
    value = solution.value - 0.5 * unit.size * math.log(2.0 * math.pi) - unit.size * math.log(scale)
    count = p + q + 1
    errors = _named(solution.covariance, back, p, q)
    fit = GarchFit(
        alpha0=float(parameters[0]),
        alpha=parameters[1 : p + 1],
        beta=parameters[p + 1 :],
        mean=centre,
        covariance=covariance,
        standard_errors=errors,
        hessian_standard_errors=_named(solution.hessian, back, p, q),
        t_values={},
        p_values={},
        log_likelihood=value,
        aic=2.0 * count - 2.0 * value,
        bic=math.log(unit.size) * count - 2.0 * value,
        start_variance=solution.before * scale**2,
        samples=unit.size,
        rate=rate,
        method="variance targeting" if solution.targeted else "maximum likelihood",
        converged=_inner(solution) or (solution.constant and solution.distance < CONVERGED),
        flags=(),
        before=None,
        after=None,
        starts=tuple(
            GarchStart(
                s.alpha,
                s.beta,
                s.value - 0.5 * unit.size * math.log(2.0 * math.pi) - unit.size * math.log(scale),
                s.distance < NEAR,
            )
            for s in solution.starts
        ),
    )
    for key, estimate in fit.values.items():
        if errors[key] > 0.0:
            fit.t_values[key] = estimate / errors[key]
            fit.p_values[key] = math.erfc(abs(fit.t_values[key]) / math.sqrt(2.0))
    return fit


def _named(covariance: FloatArray | None, back: FloatArray, p: int, q: int) -> dict[str, float]:
    """Standard errors by name, in the unit of the signal."""
    if covariance is None:
        return {}
    covariance = covariance * np.outer(back, back)
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return {
        "alpha0": float(spread[0]),
        **{f"alpha_{i}": float(spread[i]) for i in range(1, p + 1)},
        **{f"beta_{j}": float(spread[p + j]) for j in range(1, q + 1)},
        "persistence": math.sqrt(max(float(covariance[1:, 1:].sum()), 0.0)),
    }


def _ewma(
    unit: FloatArray,
    scale: float,
    p: int,
    q: int,
    centre: float,
    rate: float,
    solution: GarchSolution,
) -> GarchFit:
    """Return the parameter-free fallback; it has no standard errors."""
    from schuler.estimation.garch.conditional_variance import garch_log_likelihood

    alpha, beta = np.array([1.0 - EWMA_DECAY]), np.array([EWMA_DECAY])
    start = max(solution.before, 1e-300)
    value = garch_log_likelihood(unit * scale, 0.0, alpha, beta, before=start * scale**2)
    blank = _estimates(unit, scale, p, q, centre, rate, solution)
    return replace(
        blank,
        alpha0=0.0,
        alpha=alpha,
        beta=beta,
        covariance=np.zeros((3, 3)),
        standard_errors={},
        t_values={},
        p_values={},
        log_likelihood=value,
        aic=-2.0 * value,
        bic=-2.0 * value,
        start_variance=start * scale**2,
        method="ewma",
        converged=False,
    )


def _constant(
    residual: FloatArray, p: int, q: int, centre: float, rate: float, flag: str
) -> GarchFit:
    """Return a constant variance, flagged."""
    n = residual.size
    variance = float(np.mean(residual**2))
    if varies(residual + centre):
        value = -0.5 * n * (math.log(2.0 * math.pi * variance) + 1.0)
    else:
        variance, value = 0.0, math.inf
    error = variance * math.sqrt(2.0 / n)
    covariance = np.zeros((p + q + 1, p + q + 1))
    covariance[0, 0] = error**2
    return GarchFit(
        alpha0=variance,
        alpha=np.zeros(p),
        beta=np.zeros(q),
        mean=centre,
        covariance=covariance,
        standard_errors={"alpha0": error},
        t_values={},
        p_values={},
        log_likelihood=value,
        aic=2.0 - 2.0 * value,
        bic=math.log(n) - 2.0 * value,
        start_variance=variance,
        samples=n,
        rate=rate,
        method="constant",
        converged=False,
        flags=(flag,),
        before=None,
        after=None,
    )


def _flags(
    fit: GarchFit,
    solution: GarchSolution,
    before: ResidualTests | None,
    after: ResidualTests | None,
    residual: FloatArray,
    centre: float,
    outlier: str,
) -> list[str]:
    flags = [outlier] if outlier else []
    if solution.constant:
        flags.append("no changing variance found: the likelihood is highest at a constant variance")
    elif before and before.arch_lm.p_value > 0.01:
        flags.append(
            f"no changing variance: ARCH-LM p = {before.arch_lm.p_value:.2g} before the fit; "
            "a constant variance describes the signal"
        )
    if before and before.ljung_box_robust.p_value < 1e-3:
        flags.append(
            "correlated: the signal is not white (robust Ljung-Box "
            f"p = {before.ljung_box_robust.p_value:.1g}); fit an ARMA model first"
        )
    if after and fit.method != "ewma" and after.arch_lm.p_value < 1e-3:
        flags.append(
            f"changing variance left: ARCH-LM p = {after.arch_lm.p_value:.1g} after the fit; "
            "try higher orders"
        )
    bounded = [k for k, v in fit.values.items() if v <= 0.0 and k != "persistence"]
    if bounded and not solution.constant and fit.method != "ewma":
        flags.append(
            f"at the bound: {', '.join(bounded)} is zero, its standard error does not hold"
        )
    if fit.method != "ewma" and not solution.constant and 1.0 - fit.persistence < 1e-3:
        flags.append(
            f"nearly integrated: persistence {fit.persistence:.5f}, half-life "
            f"{fit.half_life:.0f} samples; the unconditional variance is hardly known"
        )
    mean = float(residual.mean())
    if centre == 0.0 and abs(mean) > 5.0 * float(np.std(residual)) / math.sqrt(residual.size):
        flags.append(f"mean {mean:.3g} is not zero; take it off (mean='sample')")
    return flags
