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
    """What a problem answers at one place.

    Parameters
    ----------
    value : float
        To be made small.
    pull : (p,) ndarray
        Minus half its gradient.
    curvature : (p, p) ndarray
        Half its second derivatives, or what stands for them.
    state : State
        Whatever the caller wants to have back at the end.
    """

    value: float
    pull: FloatArray
    curvature: FloatArray
    state: State


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
    """How a climb steps and when it ends.

    Parameters
    ----------
    iterations : int
        Steps and failed steps.
    damping, least, most : float
        First damping; it falls tenfold with every success down to `least`, and grows tenfold with
        every failure up to `most`, beyond which nothing can be gained.
    longest : float
        Largest change of one parameter in one step.
    floor, ridge : float
        Least diagonal of the curvature, and a damping that is always there.
    gain : tuple of (float, float)
        The climb ends when a step gains less than gain[0] (1 + gain[1] value).
    close : float
        It also ends when the pull promises less than this; 0: not looked at.
    rounding : float
        A step may lose so much of the value to rounding.
    hold : bool
        Parameters at a bound that pull beyond it are held there.
    """

    iterations: int = 60
    damping: float = 1e-2
    least: float = 1e-9
    most: float = 1e10
    longest: float = 1.5
    floor: float = 1e-8
    ridge: float = 0.0
    gain: tuple[float, float] = (0.0, 0.0)
    close: float = 0.0
    rounding: float = 0.0
    hold: bool = True


def minimise(
    evaluate: Callable[[FloatArray], Slopes[State]],
    start: FloatArray,
    bounds: tuple[FloatArray | float, FloatArray | float],
    rules: Rules,
) -> Minimum[State]:
    """Follow damped steps downhill within bounds."""
    low, high = bounds
    here, at = start, evaluate(start)
    damping = rules.damping
    for _ in range(rules.iterations):
        free = np.ones(here.size, dtype=bool)
        if rules.hold:
            free = ~(((here <= low) & (at.pull < 0.0)) | ((here >= high) & (at.pull > 0.0)))
        normal, pull = at.curvature[np.ix_(free, free)], at.pull[free]
        scale = np.maximum(np.diag(normal), rules.floor)
        if rules.ridge:
            normal = normal + rules.ridge * np.diag(scale)
        if pull.size == 0 or (
            rules.close and float(pull @ np.linalg.solve(normal, pull)) < rules.close
        ):
            return Minimum(here, at, True)
        step = np.linalg.solve(normal + damping * np.diag(scale), pull)
        trial = here.copy()
        trial[free] += np.clip(step, -rules.longest, rules.longest)
        trial = np.clip(trial, low, high)
        there = evaluate(trial)
        if math.isfinite(there.value) and (
            there.value <= at.value + rules.rounding * abs(at.value)
        ):
            gained = at.value - there.value
            here, at = trial, there
            damping = max(0.1 * damping, rules.least)
            if not rules.close and gained < rules.gain[0] * (1.0 + rules.gain[1] * at.value):
                return Minimum(here, at, True)
        else:
            damping *= 10.0
            if damping > rules.most:
                return Minimum(here, at, not rules.close)
    return Minimum(here, at, False)


def damped_step(
    pull: FloatArray, curvature: FloatArray, damping: float, free: NDArray[np.bool_] | None = None
) -> FloatArray:
    """One damped step of some parameters, in units of the diagonal of the curvature."""
    step = np.zeros(pull.size)
    rows = np.arange(pull.size) if free is None else np.flatnonzero(free)
    inner = curvature[np.ix_(rows, rows)]
    if not (np.isfinite(inner).all() and np.isfinite(pull).all()):
        return step
    scale = 1.0 / np.sqrt(np.maximum(np.diag(inner), 1e-300))
    unit = inner * np.outer(scale, scale) + (damping + 1e-13) * np.eye(scale.size)
    step[rows] = scale * np.linalg.lstsq(unit, scale * pull[rows], rcond=1e-15)[0]
    return step
