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
from schuler.types import BoolArray, FloatArray, IntArray

# pieces of time whose scores are taken as independent of each other (s)
SCORE_BLOCK = 20.0
# step of the numerical derivatives, in nepers and offset units
DERIVATIVE_STEP = 1e-2
# the search ends when a step promises less than this gain of log-likelihood: a parameter one
# standard deviation off costs 0.5
TOLERANCE = 0.3
LONGEST_SEARCH = 40
# the step of Fisher scoring over the shortest
MOST_BEND = 4.0


# a step that gains less than this share of what it promised asks for new derivatives
POOR_STEP = 0.3
# gain since the derivatives were taken, below which they still hold
STILL_GOOD = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class Maximum:
    """Parameters (p,), their standard errors (p,) and covariance, and how the search went."""

    x: FloatArray
    sd: FloatArray
    covariance: FloatArray
    log_likelihood: float
    gain: float
    converged: bool


Evaluation = Callable[[FloatArray], InnovationSequence]


def maximise(
    evaluate: Evaluation,
    x: FloatArray,
    prior: FloatArray,
    floor: FloatArray,
    longest: int = LONGEST_SEARCH,
    near: Callable[[FloatArray], Evaluation] | None = None,
    apart: BoolArray | None = None,
) -> Maximum:
    """Fisher scoring with a damped step, above a floor. Harvey, section 3.4.

    Derivatives of the innovations cost an evaluation for each parameter and change slowly: they
    are kept from step to step, with the innovations of the day, and taken anew where a step is
    poor and before the search ends. `near` returns a cheaper evaluation that serves for them, but
    for parameters that stand `apart`.
    """
    exact = np.ones(x.size, dtype=np.bool_) if near is None or apart is None else apart

    def derived() -> _Derivatives:
        own = _derivatives(evaluate, x, now, exact)
        if near is None:
            return own
        linear = near(x)
        return own.with_others(_derivatives(linear, x, linear(x), ~exact))

    def value(sequence: InnovationSequence, at: FloatArray) -> float:
        return sequence.log_likelihood - 0.5 * float(at @ (prior * at))

    now = evaluate(x)
    best = first = value(now, x)
    if not np.isfinite(best):
        raise EstimationError(
            "the likelihood of the drive cannot be evaluated",
            cure="check units, axes and time of IMU and GNSS",
        )
    damping, since, converged = 0.0, 0.0, False
    # curvature over that which is expected
    bend = 1.0
    x = x.astype(np.float64)
    derivatives = derived()
    for _ in range(longest if prior.size else 0):
        slopes = derivatives.slopes(now, x, prior)
        step, promise = _step(slopes, x, floor, damping)
        if promise < TOLERANCE:
            converged = since < STILL_GOOD
            if converged:
                break
            derivatives, since = derived(), 0.0
            continue
        length = 1.0 / bend
        step = np.maximum(length * step, floor - x)
        trial = evaluate(x + step)
        gain = value(trial, x + step) - best
        good = bool(np.isfinite(gain)) and gain > 0.0
        seen = (2.0 * length - gain / promise) / length**2 if np.isfinite(gain) else MOST_BEND
        bend = float(np.clip(seen, 1.0, MOST_BEND))
        if not good:
            if since > 0.0:
                derivatives, since = derived(), 0.0
            elif length <= 1.0 / MOST_BEND:
                damping = max(4.0 * damping, 0.1)
            if damping > 1e6:
                break
            continue
        x, now, best, since = x + step, trial, best + gain, since + gain
        damping = 0.0 if damping < 0.2 else 0.25 * damping
        if gain < POOR_STEP * promise or not np.array_equal(now.key, derivatives.key):
            derivatives, since = derived(), 0.0
    slopes = derivatives.slopes(now, x, prior)
    covariance = slopes.covariance
    return Maximum(
        x,
        np.sqrt(np.diag(covariance)),
        covariance,
        best,
        best - first,
        converged or not prior.size,
    )


def promised_gain(
    evaluate: Evaluation,
    x: FloatArray,
    prior: FloatArray,
    last: int,
) -> float:
    """Gain of log-likelihood that the last parameters promise over the best of the others."""
    now = evaluate(x)
    every = np.ones(x.size, dtype=np.bool_)
    slopes = _derivatives(evaluate, x, now, every).slopes(now, x, prior)
    gradient, information = slopes.gradient, slopes.information
    rest = x.size - last
    whole = gradient @ np.linalg.solve(information, gradient)
    part = gradient[:rest] @ np.linalg.solve(information[:rest, :rest], gradient[:rest])
    return 0.5 * float(whole - part)


def _step(
    slopes: _Slopes, x: FloatArray, floor: FloatArray, damping: float
) -> tuple[FloatArray, float]:
    """The next step, and the gain that it promises."""
    gradient, information = slopes.gradient, slopes.information
    # what would leave through the floor stays out of this step
    free = (x > floor) | (gradient > 0.0)
    damped = information + damping * np.diag(np.diag(information) + 1e-12)
    step = np.zeros(x.size)
    step[free] = np.linalg.solve(damped[np.ix_(free, free)], gradient[free])
    step = np.maximum(np.clip(step, -2.0, 2.0), floor - x)
    return step, 0.5 * float(gradient @ step)


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
    def covariance(self) -> FloatArray:
        """H^-1 J H^-1, and never surer in any direction than H^-1."""
        values, axes = np.linalg.eigh(self.information)
        root = (axes / np.sqrt(np.maximum(values, 1e-12))) @ axes.T
        share, turn = np.linalg.eigh(root @ self.scatter @ root)
        half = root @ turn
        return np.asarray((half * np.maximum(share, 1.0)) @ half.T)


@dataclass(frozen=True, slots=True, eq=False)
class _Derivatives:
    """Of innovations (n, p), and of the logarithms of their variances (n, p); keys (n,)."""

    value: FloatArray
    spread: FloatArray
    key: IntArray

    def with_others(self, more: _Derivatives) -> _Derivatives:
        """Add those by other parameters."""
        _, here, there = np.intersect1d(self.key, more.key, return_indices=True)
        value, spread = self.value.copy(), self.spread.copy()
        value[here] += more.value[there]
        spread[here] += more.spread[there]
        return _Derivatives(value, spread, self.key)

    def slopes(self, now: InnovationSequence, x: FloatArray, prior: FloatArray) -> _Slopes:
        """What follows from them with innovations that may be those of a step later."""
        root = np.sqrt(now.variance)
        z, weight = now.value / root, now.weight
        shift, spread = self.value / root[:, None], self.spread
        score = -(shift * (weight * z)[:, None] + 0.5 * spread * (1.0 - weight * z**2)[:, None])
        information = shift.T @ shift + 0.5 * spread.T @ spread + np.diag(prior)
        piece = ((now.time - now.time.min()) / SCORE_BLOCK).astype(np.int64)
        pieces = np.zeros((int(piece.max()) + 1, x.size))
        np.add.at(pieces, piece, score)
        pieces -= pieces.mean(axis=0)
        # the parameters have been fitted to these scores
        scatter = pieces.T @ pieces * (len(pieces) / max(len(pieces) - x.size, 1))
        return _Slopes(score.sum(axis=0) - prior * x, information, scatter)


def _derivatives(
    evaluate: Evaluation, x: FloatArray, now: InnovationSequence, wanted: BoolArray
) -> _Derivatives:
    """Numerical derivatives, one evaluation for each parameter, two where it turns an order.

    Innovations of measurements at nearly one time depend on which comes first: a time offset is
    moved to the side that leaves their order as it is.
    """
    value, spread = np.zeros((2, now.value.size, x.size))
    for k in np.flatnonzero(wanted):
        for step in (DERIVATIVE_STEP, -DERIVATIVE_STEP):
            moved = x.copy()
            moved[k] += step
            there = evaluate(moved)
            # measurements of one of them only say nothing
            _, here, same = np.intersect1d(now.key, there.key, return_indices=True)
            if np.array_equal(now.select(here).order, there.select(same).order):
                break
        value[here, k] = (there.value[same] - now.value[here]) / step
        spread[here, k] = np.log(there.variance[same] / now.variance[here]) / step
    return _Derivatives(value, spread, now.key)
