"""What a GARCH fit gives."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from schuler.data.exportable import Exportable
from schuler.data.to_dict import named_rows, plain
from schuler.estimation.garch.conditional_variance import garch_conditional_variance, simulate_garch
from schuler.estimation.residuals.tests import ResidualTests
from schuler.estimation.signals import checked_signal
from schuler.noise import WhiteNoise
from schuler.types import FloatArray

_MOST_PASSES = 50
Method = Literal["maximum likelihood", "variance targeting", "ewma", "constant"]


@dataclass(frozen=True, slots=True)
class GarchStart:
    """Where one start of the search began and ended."""

    # alpha, beta: sums of the weights at the start
    alpha: float
    beta: float
    log_likelihood: float  # at the end
    # it ended within a hundredth of a standard error of a maximum. The best is then refined.
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
class GarchFit(Exportable):
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
    hessian_standard_errors : dict of str to float
        From the observed information alone: right where Z has the law that was assumed.
    degrees_of_freedom, degrees_of_freedom_error : float or None
        Of Student's law, where it was fitted.
    candidates : tuple of GarchCandidate
        The orders that `select_garch` compared.
    held : float or None
        Conditional deviations beyond which samples are held back, in a robust fit.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import fit_garch
    >>> fit_garch(np.random.default_rng(1).standard_normal(3_000)).samples
    3000
    """

    JSON = (
        "mean degrees_of_freedom degrees_of_freedom_error persistence unconditional_variance "
        "half_life_samples=half_life log_likelihood aic bic samples rate method converged flags "
        "before after"
    )

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
    hessian_standard_errors: dict[str, float] = field(default_factory=dict)
    degrees_of_freedom: float | None = None
    degrees_of_freedom_error: float | None = None
    candidates: tuple[GarchCandidate, ...] = ()
    held: float | None = None

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
        if self.held is not None:
            values = self.held_back(values, before=before)
        return self._variance(values, before)

    def _variance(self, values: FloatArray, before: float | None) -> FloatArray:
        return garch_conditional_variance(
            values, self.alpha0, self.alpha, self.beta, before=self._before(before)
        )

    def held_back(self, residual: FloatArray, *, before: float | None = None) -> FloatArray:
        """A signal less its mean, no sample beyond `held` of its conditional deviations."""
        if self.held is None or not residual.size:
            return residual
        kept = residual
        # a sample depends on those before it alone: right from the left end on, pass by pass
        for _ in range(_MOST_PASSES):
            limit = self.held * np.sqrt(self._variance(kept, before))
            again = np.clip(residual, -limit, limit)
            if np.array_equal(again, kept):
                break
            kept = again
        return kept

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
        """Return plain values for JSON, in SI."""
        named = {
            "value": self.values,
            "standard_error": self.standard_errors,
            "hessian_standard_error": self.hessian_standard_errors,
            "t_value": self.t_values,
            "p_value": self.p_values,
        }
        p, q = self.order
        starts = [(s.alpha, s.beta, s.log_likelihood) for s in self.starts]
        candidates = [(c.p, c.q, c.aic, c.bic) for c in self.candidates]
        return Exportable.to_dict(self) | {
            "p": p,
            "q": q,
            "parameters": {k: {n: plain(v.get(k)) for n, v in named.items()} for k in self.values},
            "starts": named_rows(("alpha", "beta", "log_likelihood"), starts),
            "candidates": named_rows(("p", "q", "aic", "bic"), candidates),
        }
