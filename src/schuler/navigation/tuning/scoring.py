"""Fisher scoring of the likelihood of innovations, with a prior and floors.

References: Harvey, Forecasting, Structural Time Series Models and the Kalman Filter, section 3.4;
White, Estimation, Inference and Specification Analysis, section 8.3 (the sandwich).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from schuler.errors import EstimationError
from schuler.navigation.innovation_likelihood import InnovationSequence
from schuler.types import FloatArray

# pieces of time whose scores are taken as independent of each other (s)
SCORE_BLOCK = 20.0
# step of the numerical derivatives, in nepers and offset units
DERIVATIVE_STEP = 1e-2
# the search ends when a step promises less than this gain of log-likelihood: a parameter one
# standard deviation off costs 0.5
TOLERANCE = 0.2
LONGEST_SEARCH = 30


@dataclass(frozen=True, slots=True, eq=False)
class Maximum:
    """Parameters (p,), their standard errors (p,), and how the search went."""

    x: FloatArray
    sd: FloatArray
    log_likelihood: float
    gain: float
    converged: bool


def maximise(
    evaluate: Callable[[FloatArray], InnovationSequence],
    x: FloatArray,
    prior: FloatArray,
    floor: FloatArray,
    longest: int = LONGEST_SEARCH,
) -> Maximum:
    """Fisher scoring with a damped step, above a floor. Harvey, section 3.4."""
    count = prior.size

    def value(sequence: InnovationSequence, at: FloatArray) -> float:
        return sequence.log_likelihood - 0.5 * float(at @ (prior * at))

    now = evaluate(x)
    best = first = value(now, x)
    if not np.isfinite(best):
        raise EstimationError(
            "the likelihood of the drive cannot be evaluated",
            cure="check units, axes and time of IMU and GNSS",
        )
    damping, converged = 0.0, False
    slopes = _derivatives(evaluate, x, now, prior)
    for _ in range(longest if count else 0):
        # what would leave through the floor stays out of this step
        gradient, information = slopes.gradient, slopes.information
        free = (x > floor) | (gradient > 0.0)
        step, trial, there = np.zeros(count), now, -np.inf
        while damping < 1e6:
            damped = information + damping * np.diag(np.diag(information) + 1e-12)
            step = np.zeros(count)
            step[free] = np.linalg.solve(damped[np.ix_(free, free)], gradient[free])
            step = np.maximum(np.clip(step, -2.0, 2.0), floor - x)
            converged = 0.5 * float(gradient @ step) < TOLERANCE
            if converged:
                break
            trial = evaluate(x + step)
            there = value(trial, x + step)
            if np.isfinite(there) and there > best:
                break
            damping = max(4.0 * damping, 0.1)
        if converged or damping >= 1e6:
            break
        damping = 0.0 if damping < 0.2 else 0.25 * damping
        converged = there - best < TOLERANCE
        x, now, best = x + step, trial, there
        if converged:
            break
        slopes = _derivatives(evaluate, x, now, prior)
    return Maximum(x, slopes.standard_errors, best, best - first, converged or count == 0)


@dataclass(frozen=True, slots=True, eq=False)
class _Slopes:
    """First derivatives of the penalised log-likelihood.

    Gradient (p,), expected information (p, p), and the covariance (p, p) of the score over pieces
    of the drive.
    """

    gradient: FloatArray
    information: FloatArray
    scatter: FloatArray

    @property
    def standard_errors(self) -> FloatArray:
        """Square roots of the diagonal of H^-1 J H^-1; never below those of H^-1."""
        inverse = np.linalg.pinv(self.information)
        sandwich = np.diag(inverse @ self.scatter @ inverse)
        return np.asarray(np.sqrt(np.maximum(sandwich, np.diag(inverse))))


def _derivatives(
    evaluate: Callable[[FloatArray], InnovationSequence],
    x: FloatArray,
    now: InnovationSequence,
    prior: FloatArray,
) -> _Slopes:
    """First derivatives of the innovations, and what follows from them."""
    count = x.size
    root = np.sqrt(now.variance)
    z = now.value / root
    weight = now.weight
    shift = np.empty((z.size, count))
    spread = np.empty((z.size, count))
    for k in range(count):
        moved = x.copy()
        moved[k] += DERIVATIVE_STEP
        there = evaluate(moved)
        shift[:, k] = (there.value - now.value) / root / DERIVATIVE_STEP
        spread[:, k] = np.log(there.variance / now.variance) / DERIVATIVE_STEP
    score = -(shift * (weight * z)[:, None] + 0.5 * spread * (1.0 - weight * z**2)[:, None])
    information = shift.T @ shift + 0.5 * spread.T @ spread + np.diag(prior)
    piece = ((now.time - now.time.min()) / SCORE_BLOCK).astype(np.int64)
    pieces = np.zeros((int(piece.max()) + 1, count))
    np.add.at(pieces, piece, score)
    pieces -= pieces.mean(axis=0)
    # the parameters have been fitted to these scores
    scatter = pieces.T @ pieces * (len(pieces) / max(len(pieces) - count, 1))
    return _Slopes(score.sum(axis=0) - prior * x, information, scatter)
