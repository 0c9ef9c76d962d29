"""Fast Orthogonal Search: which lags and products predict a signal (spec 4, S003 section 4).

The search is forward selection by least squares. All correlations come from one Gram matrix of
centred and scaled candidates; the orthogonal functions are never formed, their recursion is a
Cholesky factorisation that takes its rows in the order of merit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import EstimationError, InputError
from schuler.estimation.autoregressive.estimators import triangular_factor
from schuler.estimation.autoregressive.result import Caution
from schuler.estimation.orthogonal_search.candidates import (
    Candidates,
    Signals,
    centred_gram,
    gather,
)
from schuler.estimation.orthogonal_search.result import FosFit, RankedTerm, Term, term_name
from schuler.estimation.products import dot, one_blas_thread
from schuler.types import FloatArray

__all__ = ["FosFit", "RankedTerm", "Stopping", "fast_orthogonal_search"]

Stopping = Literal["family-wise", "single", "bic"]

_COLLINEAR = 1e-12
_EXHAUSTED = 1e-12
_LARGEST_CONDITION = 1e5
_UNTESTED = 1e-9


@dataclass(frozen=True, slots=True)
class _Search:
    """Order of choice and what the recursion said about it."""

    chosen: tuple[int, ...]
    reductions: tuple[float, ...]
    remaining: tuple[float, ...]
    stopped: str


def fast_orthogonal_search(
    signal: ArrayLike,
    max_lag: int,
    degree: int = 1,
    max_terms: int | None = None,
    *,
    inputs: Sequence[ArrayLike] = (),
    input_lags: int | None = None,
    stopping: Stopping | None = "family-wise",
    significance: float = 0.05,
    tolerance: float = 0.0,
    prune: bool = True,
    held_out: ArrayLike | None = None,
    held_out_inputs: Sequence[ArrayLike] = (),
) -> FosFit:
    """Choose the lags and products that predict a signal one step ahead.

    Parameters
    ----------
    signal : (n,) array_like
        Samples in u. The mean is not taken off (products would change); a constant term is
        always in the model.
    max_lag : int
        L: candidates y(n-1) .. y(n-L). Zero if only inputs predict.
    degree : int
        1 for lags alone, 2 for products of two of them as well.
    max_terms : int, optional
        Most terms to choose; default all candidates.
    inputs : sequence of (n,) array_like
        Known signals x; x(n) .. x(n-K) become candidates.
    input_lags : int, optional
        K; default `max_lag`.
    stopping : {"family-wise", "single", "bic"} or None
        A term must be stronger than the best of all candidates is by chance ("family-wise"),
        than one candidate is by chance ("single": the 4/N of the paper, which lets false terms
        in), or pay for itself in BIC. None goes on to `max_terms`.
    significance : float
        Probability of a false term under the first two.
    tolerance : float
        Stop when the error is below this part of the variance.
    prune : bool
        Take out again what is no longer stronger than the threshold once all terms are in: a
        stand-in for two terms that came later. Without stopping nothing is taken out.
    held_out : (k,) array_like, optional
        Data for an honest error, in u.
    held_out_inputs : sequence of (k,) array_like
        Their inputs.

    Returns
    -------
    FosFit
        Terms, coefficients, explicit errors; the recursion's own ranking apart.

    Raises
    ------
    InputError
        Impossible settings, bad arrays, or fewer samples than twice the terms.
    EstimationError
        A signal that does not vary.

    Notes
    -----
    Spec 4.2-4.4. With all lags of degree 1 and no stopping this is the covariance method with
    an intercept (E-003-2). All averages are over n = L+1 .. N.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import fast_orthogonal_search
    >>> rng = np.random.default_rng(1)
    >>> signal = np.zeros(5_000)
    >>> for k in range(2, signal.size):
    ...     signal[k] = 0.5 * signal[k - 2] + rng.standard_normal()
    >>> [str(term) for term in fast_orthogonal_search(signal, 5).terms]
    ['(2,)']
    """
    lags = max_lag if input_lags is None else input_lags
    _check(max_lag, degree, max_terms, len(inputs), lags, stopping, significance)
    candidates = Candidates.all_up_to(max_lag, degree, len(inputs), lags)
    most = candidates.count if max_terms is None else min(max_terms, candidates.count)
    signals = gather(signal, inputs, fewest=candidates.memory + 2 * most + 10)
    first = candidates.memory
    with one_blas_thread():
        gram, _, samples = centred_gram(signals.blocks(candidates, first), candidates.count + 1)
        if not gram[-1, -1] > 0.0:
            raise EstimationError(
                "the signal does not vary behind its first samples", expected="noise"
            )
        threshold = _threshold(stopping, significance, candidates.count, samples)
        search = _choose(gram, samples, most, threshold, tolerance)
        kept = _pruned(gram, search.chosen, samples, threshold) if prune else search.chosen
        fit = _solve(signals, candidates, search, kept, gram, samples)
    if held_out is None:
        return fit
    errors = fit.residuals(held_out, held_out_inputs)
    return replace(fit, held_out_mean_square_error=dot(errors, errors) / errors.size)


def _check(
    max_lag: int,
    degree: int,
    max_terms: int | None,
    inputs: int,
    input_lags: int,
    stopping: str | None,
    significance: float,
) -> None:
    if max_lag < 0 or input_lags < 0 or (max_lag == 0 and inputs == 0):
        raise InputError(f"lags up to {max_lag}", expected="1 or more")
    if degree not in (1, 2):
        raise InputError(f"degree {degree}", expected="1 or 2")
    if max_terms is not None and max_terms < 1:
        raise InputError(f"at most {max_terms} terms", expected="1 or more")
    if stopping is not None and stopping not in get_args(Stopping):
        raise InputError(f"stopping '{stopping}'", expected="'family-wise', 'single', 'bic', None")
    if not 0.0 < significance < 1.0:
        raise InputError(f"significance {significance:g}", expected="between 0 and 1")


def _threshold(stopping: str | None, significance: float, count: int, samples: int) -> float:
    """Least N Q/MSE of a term worth taking (spec 4.4)."""
    from scipy.special import chdtri

    if stopping is None:
        return 0.0
    if stopping == "bic":
        # N ln(1 - Q/MSE) + ln N < 0
        return samples * -math.expm1(-math.log(samples) / samples)
    share = significance if stopping == "single" else -math.expm1(math.log1p(-significance) / count)
    return float(chdtri(1.0, share))


def _choose(
    gram: FloatArray, samples: int, most: int, threshold: float, tolerance: float
) -> _Search:
    """Forward selection on a Gram matrix whose last row is the signal; spec 4.2."""
    count = len(gram) - 1
    variance = np.diag(gram)[:count].copy()
    usable = variance > _UNTESTED * _UNTESTED * variance.max(initial=0.0)
    root = np.sqrt(np.where(usable, variance, 1.0))
    scaled = gram[:count, :count] / np.outer(root, root)
    power = float(gram[-1, -1])
    merit = gram[:count, -1] / (root * math.sqrt(power))
    left = np.where(usable, 1.0, 0.0)
    factor = np.empty((count, most))
    chosen: list[int] = []
    reductions: list[float] = []
    remaining: list[float] = []
    error, stopped = 1.0, "all terms asked for are in"
    for step in range(most):
        free = left > _COLLINEAR
        if not free.any():
            stopped = "every term left is a combination of chosen ones"
            break
        gain = np.where(free, merit**2 / np.where(free, left, 1.0), -1.0)
        best = int(gain.argmax())
        if samples * gain[best] <= threshold * error:
            stopped = "no term left is stronger than chance"
            break
        pivot = math.sqrt(left[best])
        row = scaled[:, best] - factor[:, :step] @ factor[best, :step]
        factor[:, step] = row / pivot
        merit = merit - factor[:, step] * (merit[best] / pivot)
        left = left - factor[:, step] ** 2
        left[best] = 0.0
        error -= float(gain[best])
        chosen.append(best)
        reductions.append(float(gain[best]))
        remaining.append(error)
        if error <= tolerance:
            stopped = "the error is below the tolerance"
            break
        if error <= _EXHAUSTED:
            stopped = "the recursion has reached its own rounding"
            break
    return _Search(tuple(chosen), tuple(reductions), tuple(remaining), stopped)


def _pruned(
    gram: FloatArray, chosen: tuple[int, ...], samples: int, threshold: float
) -> tuple[int, ...]:
    """Drop the weakest term as long as N times its share of the error is below the threshold."""
    kept = list(chosen)
    while len(kept) > 1 and threshold > 0.0:
        index = np.array(kept)
        root = np.sqrt(np.diag(gram)[index])
        inverse = np.linalg.pinv(gram[np.ix_(index, index)] / np.outer(root, root), hermitian=True)
        merit = gram[index, -1] / root
        weights = inverse @ merit
        error = float(gram[-1, -1] - merit @ weights)
        if error <= _EXHAUSTED * gram[-1, -1]:
            break
        strength = samples * weights**2 / (np.diag(inverse) * error)
        weakest = int(strength.argmin())
        if strength[weakest] > threshold:
            break
        del kept[weakest]
    return tuple(kept)


def _solve(
    signals: Signals,
    candidates: Candidates,
    search: _Search,
    kept: tuple[int, ...],
    gram: FloatArray,
    samples: int,
) -> FosFit:
    """Coefficients, standard errors and the explicit error of the terms kept."""
    few = candidates.some(kept)
    first = candidates.memory
    weights, constant, inverse = _least_squares(signals, few, first, gram, kept)
    squares = 0.0
    full = np.concatenate([[-constant], -weights, [1.0]])
    for block in signals.blocks(few, first):
        residual = np.einsum("k,kn->n", full, block)
        squares += dot(residual, residual)
    factor = _factor_scales(signals, few)
    own = float(signals.scales[0])
    shift = _factor_constants(signals, few)
    freedom = max(samples - few.count - 1, 1)
    errors = np.sqrt(np.maximum(np.diag(inverse), 0.0) * squares / freedom)
    terms, sources = _names(few)
    ranked = [term_name(t, s) for t, s in zip(*_names(candidates.some(search.chosen)), strict=True)]
    mean_square = squares / samples * own**2
    steps = zip(search.reductions, search.remaining, strict=True)
    return FosFit(
        terms=terms,
        sources=sources,
        coefficients=weights * own / factor,
        standard_errors=errors * own / factor,
        intercept=own * (float(signals.means[0]) + constant - float(weights @ shift)),
        training_mean_square_error=mean_square,
        held_out_mean_square_error=None,
        ranking=tuple(
            RankedTerm(name, q, left, samples * q / max(left + q, 1e-300))
            for name, (q, left) in zip(ranked, steps, strict=True)
        ),
        stopped=search.stopped,
        candidates=candidates.count,
        samples=samples,
        mean=signals.series.mean,
        deviation=math.sqrt(max(float(gram[-1, -1]), 0.0) / samples) * own,
        cautions=_cautions(search, squares / samples, signals),
    )


def _least_squares(
    signals: Signals, few: Candidates, first: int, gram: FloatArray, chosen: Sequence[int]
) -> tuple[FloatArray, float, FloatArray]:
    """Weights, constant and inverse of the centred Gram matrix, in scaled units."""
    if not chosen:
        signal = signals.values[0, first:]
        return np.zeros(0), float(signal.mean()), np.zeros((0, 0))
    index = np.array(chosen)
    block = gram[np.ix_(index, index)]
    root = np.sqrt(np.diag(block))
    spread = np.linalg.eigvalsh(block / np.outer(root, root))
    if spread[0] * _LARGEST_CONDITION > spread[-1]:
        lower = np.linalg.cholesky(block)
        weights = np.linalg.solve(lower.T, np.linalg.solve(lower, gram[index, -1]))
        upper_inverse = np.linalg.inv(lower).T
        means = _means(signals, few, first)
        return weights, float(means[-1] - weights @ means[:-1]), upper_inverse @ upper_inverse.T
    rows = (part.T for part in signals.blocks(few, first))
    triangle = triangular_factor(rows, few.count + 2)
    upper = triangle[:-1, :-1]
    solution = np.asarray(np.linalg.solve(upper, triangle[:-1, -1]), dtype=np.float64)
    upper_inverse = np.asarray(np.linalg.inv(upper), dtype=np.float64)[1:, 1:]
    return solution[1:], float(solution[0]), upper_inverse @ upper_inverse.T


def _means(signals: Signals, few: Candidates, first: int) -> FloatArray:
    total = np.zeros(few.count + 1)
    for block in signals.blocks(few, first):
        total += block[1:].sum(axis=1)
    return np.asarray(total / (signals.values.shape[1] - first))


def _factor_scales(signals: Signals, few: Candidates) -> FloatArray:
    second = np.where(few.sources[:, 1] < 0, 1.0, signals.scales[few.sources[:, 1]])
    return np.asarray(signals.scales[few.sources[:, 0]] * second)


def _factor_constants(signals: Signals, few: Candidates) -> FloatArray:
    """Product of the factors' means: what the candidates are short of."""
    second = np.where(few.sources[:, 1] < 0, 1.0, signals.means[few.sources[:, 1]])
    return np.asarray(signals.means[few.sources[:, 0]] * second)


def _names(few: Candidates) -> tuple[tuple[Term, ...], tuple[Term, ...]]:
    terms, sources = [], []
    for source, lag in zip(few.sources.tolist(), few.lags.tolist(), strict=True):
        size = 1 if source[1] < 0 else 2
        terms.append(tuple(lag[:size]))
        sources.append(tuple(source[:size]))
    return tuple(terms), tuple(sources)


def _cautions(search: _Search, mean_square: float, signals: Signals) -> tuple[Caution, ...]:
    found = []
    if search.stopped == "the recursion has reached its own rounding":
        found.append(
            Caution(
                "recursion exhausted",
                "the recursion has reached its own rounding: further terms cannot be ranked",
            )
        )
    if mean_square <= 100.0 * (signals.series.rounding + 1e-32):
        found.append(
            Caution(
                "rounding",
                "the one-step error is as small as the rounding of the samples; its size says "
                "nothing about the sensor",
            )
        )
    peak = float(np.max(signals.values[0] ** 2))
    if signals.values.shape[1] >= 200 and peak > 0.1 * dot(signals.values[0], signals.values[0]):
        found.append(
            Caution(
                "outlier",
                "one sample makes more than 10 % of the signal's variance: remove or repair it "
                "and search again",
            )
        )
    return tuple(found)
