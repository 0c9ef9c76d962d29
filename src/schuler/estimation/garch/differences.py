"""Climbing a likelihood that is known sample by sample, its derivatives by differences."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from schuler.estimation.optimizer import Rules, Slopes, minimise
from schuler.estimation.products import gram
from schuler.types import FloatArray

_STEP, _WIDE = 1e-5, 1e-3
_RULES = Rules(damping=1e-3, longest=1.0, ridge=1e-10, close=1e-8, rounding=1e-14)


@dataclass(frozen=True, slots=True, eq=False)
class Top:
    """Where a climb ended."""

    at: FloatArray  # (k,): there
    value: float  # log likelihood
    # (k, k): inverse of the observed information: the covariance if the law is as assumed
    hessian: FloatArray
    sandwich: FloatArray  # (k, k): covariance whatever the law
    converged: bool  # the climb ended by itself


def climb_samples(
    samples: Callable[[FloatArray], FloatArray],
    start: FloatArray,
    bounds: tuple[FloatArray, FloatArray],
    allowed: Callable[[FloatArray], bool] = lambda at: True,
) -> Top:
    """Maximise the sum of the log likelihoods of samples by scoring with their outer product."""

    def slopes(at: FloatArray) -> Slopes[None]:
        if not allowed(at):
            return Slopes(math.inf, np.zeros(at.size), np.eye(at.size), None)
        steps = _STEP * np.eye(at.size)
        rows = np.array([(samples(at + s) - samples(at - s)) / (2.0 * _STEP) for s in steps])
        return Slopes(-float(samples(at).sum()), rows.sum(axis=1), gram(rows), None)

    found = minimise(slopes, start, bounds, _RULES)
    bread = np.linalg.pinv(_information(lambda x: float(samples(x).sum()), found.at))
    sandwich = bread @ found.slopes.curvature @ bread
    return Top(found.at, -found.value, np.asarray(bread), np.asarray(sandwich), found.converged)


def _information(value: Callable[[FloatArray], float], at: FloatArray) -> FloatArray:
    """Negative second derivative by central differences."""
    k = at.size
    out = np.empty((k, k))
    moves = _WIDE * np.eye(k)
    for i in range(k):
        for j in range(i + 1):
            a, b = moves[i], moves[j]
            both = value(at + a + b) - value(at + a - b) - value(at - a + b) + value(at - a - b)
            out[i, j] = out[j, i] = -both / (4.0 * _WIDE * _WIDE)
    return out
