"""Maxima of the GARCH likelihood of scaled noise, free or with the variance tied (spec 5.2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from schuler.estimation.garch.search import (
    SMALLEST_CONSTANT,
    Answer,
    Problem,
    Summit,
    climb,
    inverse,
    observed_information,
)
from schuler.estimation.products import gram
from schuler.types import FloatArray

STARTS = ((0.05, 0.90), (0.02, 0.975), (0.01, 0.988), (0.1, 0.8), (0.2, 0.4))
"""Sums of the weights of past squares and of past variances from which the search starts."""
NEAR = 1e-4
"""Squared distance to a maximum, in standard errors, at which a start counts as arrived."""
_NO_WEIGHT = 1e-9
SEGMENT = 40_000
"""Samples of a longer record on which starts are compared."""


@dataclass(frozen=True, slots=True)
class StartEnd:
    """Sums of the weights at a start; value and squared distance to the maximum at its end."""

    alpha: float
    beta: float
    value: float
    distance: float


@dataclass(frozen=True, slots=True, eq=False)
class GarchSolution:
    """The highest maximum found, in units of the scaled noise."""

    parameters: FloatArray  # (p + q + 1,): alpha0, alpha, beta
    covariance: FloatArray  # (p + q + 1, p + q + 1): QMLE sandwich
    # (p + q + 1, p + q + 1): inverse of the observed information, right where Z is as assumed; None
    # where tied.
    hessian: FloatArray | None
    value: float  # -1/2 sum (ln s + e²/s)
    distance: float  # squared distance to the maximum in standard errors
    singular: bool  # some combination of the parameters is not determined
    constant: bool  # the weights of all past squares are zero
    targeted: bool  # alpha0 was tied to the sample variance
    before: float  # variance before the first sample
    starts: tuple[StartEnd, ...]  # all starts

    @property
    def persistence(self) -> float:
        """Sum of all weights."""
        return float(self.parameters[1:].sum())


def garch_slopes(
    unit: FloatArray, p: int, q: int, before: float
) -> Callable[[FloatArray, FloatArray], Answer]:
    """Bind noise and orders to the likelihood kernel."""
    from schuler.kernels.noise.garch import arma_garch_slopes, garch11_slopes

    squares = unit**2
    k = p + q + 1
    short = (p, q) == (1, 1)
    past = np.empty((2, 0 if short else unit.size))

    def evaluate(u: FloatArray, outer: FloatArray) -> Answer:
        score, information = np.empty(k), np.empty((k, k))
        if short:
            a0, a1, b1 = u.tolist()
            value = garch11_slopes(squares, a0, a1, b1, before, score, information, outer)
        else:
            orders = (-1, 0, p, q)
            value = arma_garch_slopes(unit, u, orders, before, score, information, outer, past)
        return value, score, information

    return evaluate


_NO_OUTER = np.zeros((0, 0))


def solve(unit: FloatArray, p: int, q: int, before: float) -> GarchSolution:
    """Find the maximum over alpha0, alpha and beta from all starts."""
    k = p + q + 1
    evaluate = garch_slopes(unit, p, q, before)
    problem = Problem(
        evaluate=lambda u: evaluate(u, _NO_OUTER),
        lower=np.concatenate([[SMALLEST_CONSTANT], np.zeros(p + q)]),
        positive=np.arange(k) == 0,
        weights=np.arange(k) > 0,
        allowed=lambda u: True,
    )
    of_part = garch_slopes(_part(unit), p, q, before)
    rough = replace(problem, evaluate=lambda u: of_part(u, _NO_OUTER))
    variance = float(np.mean(unit**2))
    begins = [
        np.concatenate([[variance * (1.0 - a - b)], np.full(p, a / p), np.full(q, b / max(q, 1))])
        for a, b in _starts(q)
    ]
    best, starts = _best(problem, rough if unit.size > SEGMENT else None, begins, q)
    if not (best.parameters[1 : p + 1] > _NO_WEIGHT).any():
        return _at_constant(evaluate, variance, p, q, before, starts)
    outer = np.zeros((k, k))
    evaluate(best.parameters, outer)
    bread, _ = inverse(observed_information(problem, best))
    _, singular = inverse(best.information[np.ix_(best.free, best.free)])
    sandwich = bread @ outer @ bread
    return GarchSolution(
        best.parameters,
        sandwich,
        bread,
        best.value,
        best.distance,
        singular,
        False,
        False,
        before,
        starts,
    )


def _starts(q: int) -> tuple[tuple[float, float], ...]:
    return STARTS if q else ((0.3, 0.0), (0.8, 0.0), (0.05, 0.0))


def _part(unit: FloatArray) -> FloatArray:
    """The middle of a long record, on which starts are compared."""
    first = max(unit.size - SEGMENT, 0) // 2
    return unit[first : first + SEGMENT]


def _best(
    problem: Problem, rough: Problem | None, begins: list[FloatArray], q: int
) -> tuple[Summit, tuple[StartEnd, ...]]:
    """Climb from all starts, on a part of a long record first; the best goes on on all of it."""
    summits = [climb(rough or problem, start, close=NEAR) for start in begins]
    values = [problem.evaluate(s.parameters)[0] if rough else s.value for s in summits]
    ends = tuple(
        StartEnd(a, b, value, s.distance)
        for (a, b), value, s in zip(_starts(q), values, summits, strict=True)
    )
    order = sorted(range(len(summits)), key=lambda k: -values[k])
    best = climb(problem, summits[order[0]].parameters)
    if rough:
        # another hill of the part may be the highest of all
        other = next((k for k in order if _apart(summits[k], summits[order[0]])), None)
        if other is not None:
            best = max(best, climb(problem, summits[other].parameters), key=lambda s: s.value)
    return best, ends


def _apart(a: Summit, b: Summit) -> bool:
    return bool(abs(a.value - b.value) > 0.05)


def _at_constant(
    evaluate: Callable[[FloatArray, FloatArray], Answer],
    variance: float,
    p: int,
    q: int,
    before: float,
    starts: tuple[StartEnd, ...],
) -> GarchSolution:
    """Return the maximum with all weights zero, where the likelihood is that of white noise."""
    parameters = np.zeros(p + q + 1)
    parameters[0] = variance
    outer = np.zeros((p + q + 1, p + q + 1))
    value, score, information = evaluate(parameters, outer)
    covariance = np.zeros_like(outer)
    covariance[0, 0] = outer[0, 0] / information[0, 0] ** 2
    distance = float(score[0] ** 2 / information[0, 0])
    return GarchSolution(
        parameters, covariance, None, value, distance, False, True, False, before, starts
    )


def solve_targeted(unit: FloatArray, p: int, q: int, before: float) -> GarchSolution:
    """Find the maximum over alpha and beta, alpha0 being s² (1 - persistence)."""
    variance = float(np.mean(unit**2))
    evaluate = garch_slopes(unit, p, q, before)
    weights = np.vstack([np.full(p + q, -variance), np.eye(p + q)])

    def full(w: FloatArray) -> FloatArray:
        return np.concatenate([[variance * (1.0 - float(w.sum()))], w])

    def tied(w: FloatArray) -> Answer:
        value, score, information = evaluate(full(w), _NO_OUTER)
        return value, weights.T @ score, weights.T @ information @ weights

    problem = Problem(
        evaluate=tied,
        lower=np.zeros(p + q),
        positive=np.zeros(p + q, dtype=np.bool_),
        weights=np.ones(p + q, dtype=np.bool_),
        allowed=lambda w: True,
    )
    begins = [np.concatenate([np.full(p, a / p), np.full(q, b / max(q, 1))]) for a, b in _starts(q)]
    of_part = garch_slopes(_part(unit), p, q, before)

    def tied_part(w: FloatArray) -> Answer:
        value, score, information = of_part(full(w), _NO_OUTER)
        return value, weights.T @ score, weights.T @ information @ weights

    rough = replace(problem, evaluate=tied_part) if unit.size > SEGMENT else None
    best, starts = _best(problem, rough, begins, q)
    if not (best.parameters[:p] > _NO_WEIGHT).any():
        return _at_constant(evaluate, variance, p, q, before, starts)
    parameters = full(best.parameters)
    _, singular = inverse(best.information[np.ix_(best.free, best.free)])
    information = evaluate(parameters, _NO_OUTER)[2]
    covariance = _targeted_covariance(unit, parameters, p, before, information, weights)
    return GarchSolution(
        parameters,
        covariance,
        None,
        best.value,
        best.distance,
        singular,
        False,
        True,
        before,
        starts,
    )


def _targeted_covariance(
    unit: FloatArray,
    parameters: FloatArray,
    p: int,
    before: float,
    information: FloatArray,
    weights: FloatArray,
) -> FloatArray:
    """Sandwich of the scores of the weights and of the sample variance together."""
    from scipy.signal import lfilter

    from schuler.estimation.garch.conditional_variance import garch_conditional_variance

    n, alpha, beta = unit.size, parameters[1 : p + 1], parameters[p + 1 :]
    variances = garch_conditional_variance(unit, parameters[0], alpha, beta, before=before)
    squares = unit**2

    def lagged(values: FloatArray, lag: int) -> FloatArray:
        return np.concatenate([np.full(lag, before), values[:-lag]])

    inputs = [np.ones(n)]
    inputs += [lagged(squares, i) for i in range(1, alpha.size + 1)]
    inputs += [lagged(variances, j) for j in range(1, beta.size + 1)]
    slopes = lfilter([1.0], np.concatenate([[1.0], -beta]), np.stack(inputs))
    surprise = squares - variances
    samples = np.vstack([slopes * (0.5 * surprise / variances**2), surprise])
    loss = 1.0 - float(parameters[1:].sum())
    samples[-1] *= (1.0 - float(beta.sum())) / (loss * n)
    along = np.zeros(parameters.size)
    along[0] = loss
    solved, _ = inverse(weights.T @ information @ weights)
    of_scores = weights @ solved @ weights.T
    of_variance = along - of_scores @ information @ along
    influence = np.column_stack([of_scores, of_variance])
    return np.asarray(influence @ gram(samples) @ influence.T)
