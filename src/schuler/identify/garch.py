"""GARCH models of a noise whose variance changes with its own past."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError
from schuler.identify.conditional_variance import (
    EWMA_DECAY,
    garch_conditional_variance,
    simulate_garch,
)
from schuler.identify.garch_likelihood import NEAR, GarchSolution, solve, solve_targeted
from schuler.identify.residual_tests import ResidualTests, residual_tests
from schuler.identify.signals import checked_signal, outlier_flag, varies
from schuler.processes import WhiteNoise

FloatArray = NDArray[np.float64]
Method = Literal["maximum likelihood", "variance targeting", "ewma", "constant"]

FEWEST = 500
"""Samples below which only a constant variance is estimated (spec 5.2)."""
CONVERGED = 1e-6
_NEARLY_INTEGRATED = 1e-5


@dataclass(frozen=True, slots=True)
class GarchStart:
    """Where one start of the search began and ended.

    Parameters
    ----------
    alpha, beta : float
        Sums of the weights at the start.
    log_likelihood : float
        At the end.
    converged : bool
        It ended within a hundredth of a standard error of a maximum. The best is then refined.
    """

    alpha: float
    beta: float
    log_likelihood: float
    converged: bool


@dataclass(frozen=True, slots=True)
class GarchCandidate:
    """One order of a selection; see `select_garch`."""

    p: int
    q: int
    log_likelihood: float
    aic: float
    bic: float
    rejected: str


@dataclass(frozen=True, slots=True, eq=False)
class GarchFit:
    """s(t) = alpha0 + sum alpha_i e²(t-i) + sum beta_j s(t-j), fitted.

    Parameters
    ----------
    alpha0 : float
        In u².
    alpha : (p,) ndarray
        Weights of past squares.
    beta : (q,) ndarray
        Weights of past variances.
    mean : float
        Taken off the signal first, in u.
    covariance : (p + q + 1, p + q + 1) ndarray
        Of alpha0, alpha, beta: the QMLE sandwich, right whatever the law of Z.
    standard_errors : dict of str to float
        By "alpha0", "alpha_1", ..., "beta_1", ..., "persistence".
    t_values, p_values : dict of str to float
        Value over standard error, two-sided; not valid for a parameter at its bound zero.
    log_likelihood, aic, bic : float
        Gaussian; log_likelihood is infinite for a signal that does not vary.
    start_variance : float
        Square and variance before the first sample in the fit (backcast), in u².
    samples : int
        Length of the signal.
    rate : float
        Samples a second, for `process`.
    method : {"maximum likelihood", "variance targeting", "ewma", "constant"}
        What the parameters come from.
    converged : bool
        The slope of the likelihood is zero at an inner, determined point, or the maximum is at
        a constant variance.
    flags : tuple of str
        What to know before use.
    before, after : ResidualTests or None
        Tests of the signal, and of the signal divided by its conditional deviation.
    starts : tuple of GarchStart
        All starts of the search.
    candidates : tuple of GarchCandidate
        The orders that `select_garch` compared.
    """

    alpha0: float
    alpha: FloatArray
    beta: FloatArray
    mean: float
    covariance: FloatArray
    standard_errors: dict[str, float]
    t_values: dict[str, float]
    p_values: dict[str, float]
    log_likelihood: float
    aic: float
    bic: float
    start_variance: float
    samples: int
    rate: float
    method: Method
    converged: bool
    flags: tuple[str, ...]
    before: ResidualTests | None
    after: ResidualTests | None
    starts: tuple[GarchStart, ...] = ()
    candidates: tuple[GarchCandidate, ...] = ()

    @property
    def order(self) -> tuple[int, int]:
        """Orders p (squares) and q (variances)."""
        return self.alpha.size, self.beta.size

    @property
    def persistence(self) -> float:
        """Sum of all weights; the share of a disturbance of the variance left a sample later."""
        return float(self.alpha.sum() + self.beta.sum())

    @property
    def unconditional_variance(self) -> float:
        """alpha0/(1 - persistence) in u²; infinite for EWMA."""
        loss = 1.0 - self.persistence
        return self.alpha0 / loss if loss > 1e-12 else math.inf

    @property
    def half_life(self) -> float:
        """Samples in which a disturbance of the variance falls to half."""
        persistence = self.persistence
        if persistence <= 0.0:
            return 0.0
        return math.log(0.5) / math.log(persistence) if persistence < 1.0 - 1e-12 else math.inf

    @property
    def process(self) -> WhiteNoise:
        """White noise of the unconditional variance (of the start for EWMA)."""
        variance = self.unconditional_variance
        variance = variance if math.isfinite(variance) else self.start_variance
        return WhiteNoise(math.sqrt(variance / self.rate))

    @property
    def values(self) -> dict[str, float]:
        """Estimates by the names of the standard errors."""
        return {
            "alpha0": self.alpha0,
            **{f"alpha_{i}": float(v) for i, v in enumerate(self.alpha, 1)},
            **{f"beta_{j}": float(v) for j, v in enumerate(self.beta, 1)},
            "persistence": self.persistence,
        }

    def conditional_variance(self, signal: ArrayLike, *, before: float | None = None) -> FloatArray:
        """Variance of every sample given the samples before it: no look-ahead.

        Parameters
        ----------
        signal : (n,) array_like
            In u.
        before : float, optional
            Square and variance before the first sample in u²; the unconditional variance by
            default (the start of the fit for EWMA).

        Returns
        -------
        (n,) ndarray
            In u².
        """
        values = checked_signal(signal, 0, varying=False) - self.mean
        return garch_conditional_variance(
            values, self.alpha0, self.alpha, self.beta, before=self._before(before)
        )

    def _before(self, before: float | None) -> float:
        if before is not None:
            return before
        variance = self.unconditional_variance
        return variance if math.isfinite(variance) else self.start_variance

    def volatility(self, signal: ArrayLike, *, before: float | None = None) -> FloatArray:
        """Square root of `conditional_variance`, in u."""
        return np.asarray(np.sqrt(self.conditional_variance(signal, before=before)))

    def standardized_residuals(
        self, signal: ArrayLike, *, before: float | None = None
    ) -> FloatArray:
        """Z: signal less mean over `volatility`; white with variance one if the model is right."""
        values = checked_signal(signal, 0, varying=False) - self.mean
        return np.asarray(values / self.volatility(signal, before=before))

    def forecast(self, signal: ArrayLike, steps: int) -> FloatArray:
        """Variances of the samples after the end of a signal.

        Parameters
        ----------
        signal : (n,) array_like
            In u.
        steps : int
            How many.

        Returns
        -------
        (steps,) ndarray
            In u²; the first is the one-step forecast, far ones the unconditional variance.
        """
        values = checked_signal(signal, 1, varying=False) - self.mean
        start = self._before(None)
        longest = max(self.order)
        squares = np.concatenate([np.full(longest, start), values**2])
        past = np.concatenate([np.full(longest, start), self.conditional_variance(signal)])
        out: list[float] = []
        for _ in range(steps):
            ahead = self.alpha0 + float(self.alpha @ squares[: -self.alpha.size - 1 : -1])
            if self.beta.size:
                ahead += float(self.beta @ past[: -self.beta.size - 1 : -1])
            # the square that is expected of an unknown sample is its variance
            squares, past = np.append(squares[-longest:], ahead), np.append(past[-longest:], ahead)
            out.append(ahead)
        return np.array(out)

    def simulate(self, samples: int, rng: np.random.Generator) -> FloatArray:
        """Draw noise of this model, mean included; see `simulate_garch`."""
        drawn, _ = simulate_garch(samples, self.alpha0, self.alpha, self.beta, rng)
        return np.asarray(drawn + self.mean)

    def to_dict(self) -> dict[str, Any]:
        """Return plain Python for JSON, SI; None for what is infinite."""

        def number(value: float | None) -> float | None:
            return value if value is not None and math.isfinite(value) else None

        return {
            "p": self.order[0],
            "q": self.order[1],
            "parameters": {
                key: {
                    "value": value,
                    "standard_error": number(self.standard_errors.get(key)),
                    "t_value": number(self.t_values.get(key)),
                    "p_value": number(self.p_values.get(key)),
                }
                for key, value in self.values.items()
            },
            "mean": self.mean,
            "persistence": self.persistence,
            "unconditional_variance": number(self.unconditional_variance),
            "half_life_samples": number(self.half_life),
            "log_likelihood": number(self.log_likelihood),
            "aic": number(self.aic),
            "bic": number(self.bic),
            "samples": self.samples,
            "rate": self.rate,
            "method": self.method,
            "converged": self.converged,
            "flags": list(self.flags),
            "before": self.before.to_dict() if self.before else None,
            "after": self.after.to_dict() if self.after else None,
            "starts": [
                {"alpha": s.alpha, "beta": s.beta, "log_likelihood": s.log_likelihood}
                for s in self.starts
            ],
            "candidates": [
                {"p": c.p, "q": c.q, "aic": number(c.aic), "bic": number(c.bic)}
                for c in self.candidates
            ],
        }


def fit_garch(
    signal: ArrayLike,
    p: int = 1,
    q: int = 1,
    *,
    rate: float = 1.0,
    mean: Literal["sample", "zero"] = "sample",
    variance_targeting: bool | None = None,
) -> GarchFit:
    """Fit a GARCH(p, q) by Gaussian quasi maximum likelihood from several starts.

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
    """
    if int(p) != p or int(q) != q or p < 1 or q < 0:
        raise InputError(f"GARCH orders ({p}, {q})", expected="p at least 1, q at least 0")
    if mean not in ("sample", "zero"):
        raise InputError(f"mean '{mean}'", expected="'sample' or 'zero'")
    values = checked_signal(signal, 1, varying=False)
    centre = float(values.mean()) if mean == "sample" else 0.0
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
    solution = solve_targeted(unit, p, q) if variance_targeting else solve(unit, p, q)
    flags: list[str] = []
    if variance_targeting is None and not _inner(solution):
        targeted = solve_targeted(unit, p, q)
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
    deviation = np.sqrt(fit.conditional_variance(values, before=fit.start_variance))
    after = residual_tests(residual / deviation)
    flags += _flags(fit, solution, before, after, residual, centre, outlier)
    return replace(fit, before=before, after=after, flags=tuple(flags))


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
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    errors = {
        "alpha0": float(spread[0]),
        **{f"alpha_{i}": float(spread[i]) for i in range(1, p + 1)},
        **{f"beta_{j}": float(spread[p + j]) for j in range(1, q + 1)},
        "persistence": math.sqrt(max(float(covariance[1:, 1:].sum()), 0.0)),
    }
    fit = GarchFit(
        alpha0=float(parameters[0]),
        alpha=parameters[1 : p + 1],
        beta=parameters[p + 1 :],
        mean=centre,
        covariance=covariance,
        standard_errors=errors,
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
    from schuler.identify.conditional_variance import garch_log_likelihood

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
