"""The one climb of this house: damped Newton, scoring and Levenberg-Marquardt steps in bounds.

All problems have the same form: a value to make small, its downhill pull (minus half the gradient
by the parameters) and a curvature (half the second derivatives, or what stands for them: J'J of
least squares, Fisher's information of a likelihood). A step solves
(curvature + damping diag) step = pull; what costs more than it gains is damped more.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from schuler.types import FloatArray

State = TypeVar("State")

LADDER = (0.0, 1e-3, 1e-2, 1e-1, 1.0, 10.0, 1e2, 1e4)
"""Dampings that are tried one after the other where every step begins undamped."""


@dataclass(frozen=True, slots=True, eq=False)
class Slopes(Generic[State]):
    """What a problem answers at one place."""

    value: float  # to be made small
    pull: FloatArray  # (p,): minus half its gradient
    curvature: FloatArray  # (p, p): half its second derivatives, or what stands for them
    state: State  # whatever the caller wants to have back at the end


@dataclass(frozen=True, slots=True, eq=False)
class Minimum(Generic[State]):
    """Where a climb ended."""

    at: FloatArray
    slopes: Slopes[State]
    converged: bool

    @property
    def value(self) -> float:
        """What was made small."""
        return self.slopes.value


@dataclass(frozen=True, slots=True)
class Rules:
    """How a climb steps and when it ends."""

    iterations: int = 60  # steps and failed steps
    # damping, least, most: first damping; it falls tenfold with every success down to `least`, and
    # grows tenfold with every failure up to `most`, beyond which nothing can be gained.
    damping: float = 1e-2
    least: float = 1e-9
    most: float = 1e10
    longest: float = 1.5  # largest change of one parameter in one step
    # floor, ridge: least diagonal of the curvature, and a damping that is always there
    floor: float = 1e-8
    ridge: float = 0.0
    # the climb ends when a step gains less than gain[0] (1 + gain[1] value)
    gain: tuple[float, float] = (0.0, 0.0)
    close: float = 0.0  # it also ends when the pull promises less than this; 0: not looked at.
    rounding: float = 0.0  # a step may lose so much of the value to rounding
    hold: bool = True  # parameters at a bound that pull beyond it are held there
    # every step begins undamped and is damped only as far as needed; strict descent.
    ladder: bool = False


Move = Callable[[FloatArray, FloatArray], FloatArray | None]
"""Where a step leads from a place; None where it leads nowhere."""


def minimise(
    evaluate: Callable[[FloatArray], Slopes[State]],
    start: FloatArray,
    bounds: tuple[FloatArray | float, FloatArray | float],
    rules: Rules,
    move: Move | None = None,
) -> Minimum[State]:
    """Follow damped steps downhill within bounds.

    Without `move` a step is cut to the longest and to the bounds.
    """
    low, high = bounds

    def cut(here: FloatArray, step: FloatArray) -> FloatArray | None:
        step = np.minimum(np.maximum(step, -rules.longest), rules.longest)
        return np.asarray(np.minimum(np.maximum(here + step, low), high))

    go, here, at = move or cut, start, evaluate(start)
    damping = rules.damping
    for _ in range(rules.iterations):
        free: NDArray[np.bool_] | None = None
        if rules.hold:
            free = ~(((here <= low) & (at.pull <= 0.0)) | ((here >= high) & (at.pull >= 0.0)))
        undamped = damped_step(at.pull, at.curvature, 0.0, free, rules) if rules.close else None
        if undamped is not None and promised_by(undamped, at.pull, at.curvature) < rules.close:
            return Minimum(here, at, True)
        there = None
        for tried in LADDER if rules.ladder else (damping,):
            step = undamped if tried == 0.0 else None
            if step is None:
                step = damped_step(at.pull, at.curvature, tried, free, rules)
            trial = go(here, step)
            there = None if trial is None else evaluate(trial)
            if there is not None and _better(there.value, at.value, rules):
                break
            there = None
        if there is not None and trial is not None:
            gained = at.value - there.value
            here, at = trial, there
            damping = max(0.1 * damping, rules.least)
            if not rules.close and gained < rules.gain[0] * (1.0 + rules.gain[1] * at.value):
                return Minimum(here, at, True)
        else:
            damping *= 10.0
            if rules.ladder or damping > rules.most:
                return Minimum(here, at, not rules.close)
    return Minimum(here, at, False)


def _better(there: float, here: float, rules: Rules) -> bool:
    if rules.ladder:
        return there < here
    return math.isfinite(there) and there <= here + rules.rounding * abs(here)


def promise(pull: FloatArray, curvature: FloatArray, free: NDArray[np.bool_]) -> float:
    """What an undamped step promises: squared distance in standard errors, Newton's decrement."""
    return promised_by(damped_step(pull, curvature, 0.0, free), pull, curvature)


def promised_by(step: FloatArray, pull: FloatArray, curvature: FloatArray) -> float:
    """The same of an undamped step that is at hand; infinite where the slopes are not finite."""
    if not (np.isfinite(pull).all() and np.isfinite(curvature).all()):
        return math.inf
    return float(pull @ step)


def damped_step(
    pull: FloatArray,
    curvature: FloatArray,
    damping: float,
    free: NDArray[np.bool_] | None = None,
    rules: Rules | None = None,
) -> FloatArray:
    """One damped step of some parameters, in units of the diagonal of the curvature.

    Without rules a direction that the curvature does not see is left alone.
    """
    if free is not None and not free.all():
        step = np.zeros(pull.size)
        rows = np.flatnonzero(free)
        step[rows] = damped_step(pull[rows], curvature[np.ix_(rows, rows)], damping, None, rules)
        return step
    if pull.size == 0 or not (np.isfinite(curvature).all() and np.isfinite(pull).all()):
        return np.zeros(pull.size)
    if rules is None or rules.ladder:
        scale = 1.0 / np.sqrt(np.maximum(np.diag(curvature), 1e-300))
        unit = curvature * np.outer(scale, scale) + (damping + 1e-13) * np.eye(scale.size)
        try:
            return np.asarray(scale * np.linalg.solve(unit, scale * pull))
        except np.linalg.LinAlgError:
            return np.asarray(scale * np.linalg.lstsq(unit, scale * pull, rcond=1e-15)[0])
    more = (rules.ridge + damping) * np.maximum(np.diag(curvature), rules.floor)
    return np.asarray(np.linalg.solve(curvature + np.diag(more), pull))
