"""Climbing a likelihood whose parameters have bounds, from several starts (spec 5.2)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.estimation.optimizer import Rules, Slopes, minimise, promise
from schuler.types import FloatArray

Answer = tuple[float, FloatArray, FloatArray]
"""Likelihood, gradient, information."""
PERSISTENCE_EDGE = 1e-7
"""The sum of all weights stays this far below one."""
SMALLEST_CONSTANT = 1e-14
"""Lower bound of alpha0 in units of the variance."""
CLOSE_ENOUGH = 1e-13


@dataclass(frozen=True, slots=True, eq=False)
class Problem:
    """A likelihood to climb."""

    # from parameters to value, gradient and expected information
    evaluate: Callable[[FloatArray], Answer]
    lower: FloatArray  # (k,): lower bounds, -inf for none
    # (k,): parameters that approach their lower bound but never reach it
    positive: NDArray[np.bool_]
    weights: NDArray[np.bool_]  # (k,): parameters whose sum stays below one
    allowed: Callable[[FloatArray], bool]  # any further condition on the parameters


@dataclass(frozen=True, slots=True, eq=False)
class Summit:
    """Where a climb ended."""

    parameters: FloatArray  # (k,): there
    value: float  # of the likelihood
    gradient: FloatArray  # (k,): of the likelihood
    information: FloatArray  # (k, k): expected
    free: NDArray[np.bool_]  # (k,): False for parameters held at their bound
    distance: float  # squared distance to the maximum over the free parameters in standard errors


def climb(
    problem: Problem, start: FloatArray, steps: int = 80, close: float = CLOSE_ENOUGH
) -> Summit:
    """Follow damped scoring steps uphill within the bounds."""

    def slopes(at: FloatArray) -> Slopes[None]:
        value, gradient, information = problem.evaluate(at)
        return Slopes(-value, gradient.copy(), information.copy(), None)

    rules = Rules(iterations=steps, close=close, ladder=True)
    found = minimise(
        slopes,
        start,
        (problem.lower, np.inf),
        rules,
        move=lambda here, step: _moved(problem, here, step),
    )
    pull, curvature = found.slopes.pull, found.slopes.curvature
    free = ~((found.at <= problem.lower) & (pull <= 0.0))
    distance = promise(pull, curvature, free)
    return Summit(found.at, -found.value, pull, curvature, free, distance)


def _moved(problem: Problem, here: FloatArray, step: FloatArray) -> FloatArray | None:
    """Go along a step as far as the bounds allow."""
    share = 1.0
    down = problem.positive & (step < 0.0)
    room = 0.9 * (here - problem.lower)
    if down.any():
        share = min(share, float(np.min(room[down] / -step[down])))
    slack = 1.0 - PERSISTENCE_EDGE - float(here[problem.weights].sum())
    rise = float(step[problem.weights].sum())
    if rise > 0.0:
        share = min(share, 0.9 * slack / rise)
    for _ in range(4):
        tried = np.maximum(here + share * step, problem.lower)
        inside = float(tried[problem.weights].sum()) < 1.0 - PERSISTENCE_EDGE
        if share > 0.0 and inside and np.isfinite(tried).all() and problem.allowed(tried):
            return tried
        share *= 0.3
    return None


def observed_information(problem: Problem, summit: Summit) -> FloatArray:
    """Negative second derivative of the likelihood by differences of its gradient."""
    here, k = summit.parameters, summit.parameters.size
    hessian = np.empty((k, k))
    for i in range(k):
        width = 0.03 / np.sqrt(max(summit.information[i, i], 1e-300))
        width = min(width, 0.1 * (here[i] - problem.lower[i])) if summit.free[i] else 0.0
        slack = 1.0 - float(here[problem.weights].sum())
        if problem.weights[i]:
            width = min(width, 0.1 * slack)
        if not width > 0.0:
            return summit.information
        low, high = here.copy(), here.copy()
        low[i] -= width
        high[i] += width
        if not (problem.allowed(low) and problem.allowed(high)):
            return summit.information
        below = problem.evaluate(low)[1].copy()
        hessian[i] = (below - problem.evaluate(high)[1]) / (high[i] - low[i])
    hessian = 0.5 * (hessian + hessian.T)
    scale = 1.0 / np.sqrt(np.maximum(np.diag(summit.information), 1e-300))
    lowest = float(np.linalg.eigvalsh(hessian * np.outer(scale, scale))[0])
    return hessian if lowest > 1e-8 else summit.information


def inverse(matrix: FloatArray) -> tuple[FloatArray, bool]:
    """Invert a non-negative matrix, and tell whether some direction is not determined."""
    diagonal = np.diag(matrix)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    by = np.outer(scale, scale)
    values, vectors = np.linalg.eigh(matrix * by)
    floor = 1e-10 * max(float(values[-1]), 1.0)
    singular = bool(values[0] < floor)
    return (vectors / np.maximum(values, floor)) @ vectors.T * by, singular
