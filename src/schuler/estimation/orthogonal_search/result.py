"""What a Fast Orthogonal Search has found, and how it predicts."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.estimation.autoregressive.result import Caution
from schuler.types import FloatArray

Term = tuple[int, ...]

_RUNAWAY = 1e6


@dataclass(frozen=True, slots=True)
class RankedTerm:
    """One step of the search, as its recursion saw it."""

    term: str  # the chosen term, e.g. "y(n-1) y(n-3)".
    error_reduction: float  # Q over the variance of the signal
    # mean squared error over the variance by the recursion (28) of S003. It ranks; it is a
    # difference of nearly equal numbers and no measure of the error (spec 4.3).
    remaining: float
    # N Q over the error before: chi-square with one degree of freedom for a needless term
    strength: float


@dataclass(frozen=True, slots=True, eq=False)
class FosFit(Exportable):
    """A model y(n) = intercept + sum of coefficient times term, found by forward selection.

    Parameters
    ----------
    terms : tuple of tuple of int
        Lags of each term: (3,) is y(n-3), (1, 3) is y(n-1) y(n-3), in the order chosen.
    sources : tuple of tuple of int
        Which signal each lag belongs to: 0 the signal itself, 1 .. the inputs.
    coefficients : (m,) ndarray
        One a term; units of the signal over those of the term.
    standard_errors : (m,) ndarray
        By least squares theory with the terms given; the choice among them is not counted.
    intercept : float
        Constant term, in u.
    training_mean_square_error : float
        Explicit mean squared one-step residual on the data of the fit, in u².
    held_out_mean_square_error : float or None
        The same on data that the fit has not seen.
    ranking : tuple of RankedTerm
        The steps of the search, with terms that were taken out again (`pruned`).
    stopped : str
        Why the search ended.
    candidates : int
        Number of terms it could choose from.
    samples : int
        Samples predicted in training.
    mean, deviation : float
        Of the signal, in u.
    cautions : tuple of Caution
        What to know before use.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import fast_orthogonal_search
    >>> fast_orthogonal_search(np.random.default_rng(1).standard_normal(2_000), 3).candidates
    3
    """

    JSON = (
        "terms sources names coefficients standard_errors intercept mean_square_error "
        "training_mean_square_error held_out_mean_square_error ranking pruned stopped "
        "candidates samples flags notes"
    )

    terms: tuple[Term, ...]
    sources: tuple[Term, ...]
    coefficients: FloatArray
    standard_errors: FloatArray
    intercept: float
    training_mean_square_error: float
    held_out_mean_square_error: float | None
    ranking: tuple[RankedTerm, ...]
    stopped: str
    candidates: int
    samples: int
    mean: float
    deviation: float
    cautions: tuple[Caution, ...]

    @property
    def mean_square_error(self) -> float:
        """Explicit one-step error: held out if held-out data were given, else of training."""
        held_out = self.held_out_mean_square_error
        return self.training_mean_square_error if held_out is None else held_out

    @property
    def names(self) -> tuple[str, ...]:
        """Terms in words."""
        return tuple(term_name(t, s) for t, s in zip(self.terms, self.sources, strict=True))

    @property
    def pruned(self) -> tuple[str, ...]:
        """Terms that the search chose and took out again once others had made them needless."""
        return tuple(r.term for r in self.ranking if r.term not in self.names)

    @property
    def memory(self) -> int:
        """Largest lag of any term."""
        return max((max(t) for t in self.terms), default=0)

    @property
    def flags(self) -> tuple[str, ...]:
        """Kinds of the cautions."""
        return tuple(c.kind for c in self.cautions)

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences of the cautions."""
        return tuple(c.text for c in self.cautions)

    def residuals(self, signal: ArrayLike, inputs: Sequence[ArrayLike] = ()) -> FloatArray:
        """Measured less predicted one step ahead, from sample `memory` (counted from zero) on.

        Parameters
        ----------
        signal : (n,) array_like
            In u.
        inputs : sequence of (n,) array_like
            As in the fit.

        Returns
        -------
        (n - memory,) ndarray
            In u.
        """
        data, known = self._checked(signal, inputs)
        first = np.arange(self.memory, data.size)
        return data[first] - self.predict(data, (1,), inputs=known, origins=first - 1)[:, 0]

    def predict(
        self,
        signal: ArrayLike,
        steps: Sequence[int] = (1,),
        *,
        inputs: Sequence[ArrayLike] = (),
        origins: ArrayLike | None = None,
    ) -> FloatArray:
        """Predict y(origin + h) from the signal up to the origin, by running the model on.

        Parameters
        ----------
        signal : (n,) array_like
            In u.
        steps : sequence of int
            Horizons h, 1 or more.
        inputs : sequence of (n,) array_like
            Inputs are taken as known, also between origin and horizon.
        origins : (o,) array_like of int, optional
            Last sample known (from zero); default all that have enough past.

        Returns
        -------
        (o, len(steps)) ndarray
            In u. Predictions that run away are held at a million standard deviations.

        Notes
        -----
        Beyond one step a model with products gives the path without noise, not the mean path.
        """
        data, known = self._checked(signal, inputs)
        longest = max(steps, default=0)
        if min(steps, default=0) < 1:
            raise InputError(f"prediction steps {tuple(steps)}", expected="1 or more")
        low, high = self.memory - 1, data.size - 1 - (longest if known else 0)
        base = np.arange(max(low, 0), high + 1) if origins is None else np.asarray(origins)
        if base.size and (base.min() < low or base.max() > high):
            raise InputError(
                f"prediction origins from {base.min()} to {base.max()}", expected=f"{low} to {high}"
            )
        out = np.empty((base.size, len(steps)))
        depth = max(self.memory, 1)
        recent = np.empty((depth, base.size))
        for lag in range(min(depth, self.memory)):
            recent[-lag % depth] = data[base - lag]
        bound = _RUNAWAY * self.deviation
        for step in range(1, longest + 1):
            value = self._next(recent, known, base, step)
            np.clip(value, self.mean - bound, self.mean + bound, out=value)
            recent[step % depth] = value
            for column in np.flatnonzero(np.asarray(steps) == step):
                out[:, column] = value
        return out

    def _next(
        self, recent: FloatArray, known: list[FloatArray], base: NDArray[np.int64], step: int
    ) -> FloatArray:
        """The model at origin + step; `recent` holds the path so far as a ring by sample."""
        value = np.full(base.size, self.intercept)
        for weight, lags, sources in zip(self.coefficients, self.terms, self.sources, strict=True):
            term = np.full(base.size, weight)
            for lag, source in zip(lags, sources, strict=True):
                if source == 0:
                    term *= recent[(step - lag) % len(recent)]
                else:
                    term *= known[source - 1][base + step - lag]
            value += term
        return value

    def _checked(
        self, signal: ArrayLike, inputs: Sequence[ArrayLike]
    ) -> tuple[FloatArray, list[FloatArray]]:
        arrays = [np.asarray(a, dtype=np.float64) for a in (signal, *inputs)]
        needed = max((max(s) for s in self.sources), default=0)
        if len(inputs) < needed:
            raise InputError(f"{len(inputs)} inputs", expected=f"{needed}, as in the fit")
        for array in arrays:
            if array.ndim != 1 or array.size != arrays[0].size or array.size <= self.memory:
                raise InputError(
                    f"signals of shape {array.shape} to predict",
                    expected=f"more than {self.memory} samples each, all of one length",
                )
            if not np.isfinite(array).all():
                raise InputError("a signal to predict is not finite", expected="finite numbers")
        return arrays[0], arrays[1:]


def term_name(lags: Term, sources: Term) -> str:
    """Write a term as people do."""
    factors = []
    for lag, source in zip(lags, sources, strict=True):
        signal = "y" if source == 0 else f"x{source}"
        factors.append(f"{signal}(n-{lag})" if lag else f"{signal}(n)")
    return " ".join(factors)
