"""Climbing the exact likelihood of an ARMA process from several starts (spec 5.1)."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from schuler.estimation.arma.likelihood import (
    EDGE,
    Likelihood,
    admissible,
    approximate_slope,
    exact_slope,
    likelihood,
)
from schuler.estimation.optimizer import LADDER, damped_step
from schuler.estimation.products import by_rows, dot, gram
from schuler.noise.arma import poles_of, within
from schuler.types import FloatArray

SEGMENT = 16_000
"""Samples on which the starts are compared."""
CLOSE_ENOUGH = 1e-8
"""Squared distance to the maximum, in standard errors, at which the climb ends."""
_ROUGH = 1e-2
_APPROXIMATE_LIMIT = 1e-2
_PAIRS = ((0.995, 0.97), (-0.95, -0.98), (-0.98, -0.95), (0.97, 0.99))
"""Poles beside zeros that a regression on the recent past does not see."""


@dataclass(frozen=True, slots=True, eq=False)
class Climb:
    """Where a climb ended."""

    coefficients: FloatArray  # (p + q,): phi, theta
    at: Likelihood  # there
    # squared distance to the maximum in standard errors, by the slope that is left (Newton's
    # decrement); twice the gain in likelihood that one more step promises.
    distance: float
    steps: int  # steps taken


def climb(
    signal: FloatArray,
    start: FloatArray,
    p: int,
    *,
    rough: bool = False,
    steps: int = 60,
    known_mean: bool = False,
) -> Climb:
    """Follow damped Gauss-Newton steps uphill; every step is judged by the exact likelihood."""
    coefficients, at = start, likelihood(signal, start, p, known_mean)
    distance, taken, exact = np.inf, 0, False
    if coefficients.size == 0:
        return Climb(coefficients, at, 0.0, 0)
    enough = _ROUGH if rough else CLOSE_ENOUGH
    while taken < steps:
        slope = exact_slope if exact else approximate_slope
        gradient, information = slope(signal, coefficients, p, at)
        full = damped_step(gradient, information, 0.0)
        distance = float(gradient @ full) if np.any(full != 0.0) else np.inf
        if exact and distance < enough:
            break
        if not exact and distance < _APPROXIMATE_LIMIT:
            exact = True
            continue
        better = _best_along(signal, coefficients, p, at, gradient, information, full)
        if better is None:
            if exact:
                break
            exact = True
            continue
        gain = better[1].value - at.value
        coefficients, at = better
        taken += 1
        # a parabola gains half the distance; where it does not, the cheap slope misleads
        exact = exact or not 0.25 * distance < gain < 0.75 * distance
    return Climb(coefficients, at, distance if exact else np.inf, taken)


def _best_along(
    signal: FloatArray,
    coefficients: FloatArray,
    p: int,
    at: Likelihood,
    gradient: FloatArray,
    information: FloatArray,
    full: FloatArray,
) -> tuple[FloatArray, Likelihood] | None:
    """First damped step that raises the likelihood; None if none does."""
    for damping in LADDER:
        step = full if damping == 0.0 else damped_step(gradient, information, damping)
        if not np.any(np.abs(step) > 1e-15 * (1.0 + np.abs(coefficients))):
            return None
        for shortened in (1.0, 0.3):
            tried = _mirrored(coefficients + shortened * step, p)
            if not admissible(tried, p):
                continue
            there = likelihood(signal, tried, p, at.known_mean)
            if there.value > at.value:
                return _farther(signal, coefficients, p, at, gradient, (tried, there))
    return None


def _mirrored(coefficients: FloatArray, p: int) -> FloatArray:
    """Turn zeros outside the unit circle inside: the likelihood is the same there."""
    if coefficients.size == p or not np.isfinite(coefficients).all():
        return coefficients
    theta = -_turned_inside(-coefficients[p:], 1.0 - 2.0 * EDGE)
    return np.concatenate([coefficients[:p], theta])


def _farther(
    signal: FloatArray,
    coefficients: FloatArray,
    p: int,
    at: Likelihood,
    gradient: FloatArray,
    reached: tuple[FloatArray, Likelihood],
) -> tuple[FloatArray, Likelihood]:
    """Double a step as long as the likelihood rises almost in a straight line.

    Near the unit circle the residuals alone make the likelihood look far more curved than it is.
    """
    tried, there = reached
    for _ in range(20):
        step = tried - coefficients
        # a parabola whose curvature is as expected gains half of what its slope promises
        if there.value - at.value < 0.7 * float(gradient @ step):
            break
        double = coefficients + 2.0 * step
        if not admissible(double, p):
            break
        beyond = likelihood(signal, double, p, at.known_mean)
        if beyond.value <= there.value:
            break
        tried, there = double, beyond
    return tried, there


def search(
    signal: FloatArray,
    p: int,
    q: int,
    hints: Iterable[FloatArray] = (),
    *,
    rough: bool = False,
    known_mean: bool = False,
) -> Climb:
    """Find the maximum of the likelihood: many starts on a segment, the best ones on all of it."""
    if p + q == 0:
        return climb(signal, np.zeros(0), 0, known_mean=known_mean)
    segment = signal[:SEGMENT]
    begun = [s for s in (*starts(segment, p, q), *hints) if admissible(s, p)]
    first = [climb(segment, s, p, rough=True, steps=5, known_mean=known_mean) for s in begun]
    first.sort(key=lambda c: -c.at.value)
    rough_climbs = [
        climb(segment, c.coefficients, p, rough=True, steps=20, known_mean=known_mean)
        for c in first[:4]
    ]
    rough_climbs.sort(key=lambda c: -c.at.value)
    chosen: list[Climb] = []
    for c in rough_climbs:
        # a start that is worse by far, or ends where another ended, is not worth the full record
        same = any(abs(c.at.value - d.at.value) < 0.1 for d in chosen)
        if len(chosen) < 2 and not same and rough_climbs[0].at.value - c.at.value < 20.0:
            chosen.append(c)
    ends = [climb(signal, c.coefficients, p, rough=rough, known_mean=known_mean) for c in chosen]
    return max(ends, key=lambda c: c.at.value)


def starts(signal: FloatArray, p: int, q: int) -> list[FloatArray]:
    """Coefficients to start from: Hannan-Rissanen, autoregressive, and poles beside zeros."""
    found = [_hannan_rissanen(signal, p, q)]
    if q:
        found.append(np.concatenate([_hannan_rissanen(signal, p, 0), np.zeros(q)]))
    if p and q:
        fast = _hannan_rissanen(signal, p - 1, q - 1)
        for pole, zero in _PAIRS:
            phi = np.convolve([1.0, -pole], np.concatenate([[1.0], -fast[: p - 1]]))
            theta = np.convolve([1.0, -zero], np.concatenate([[1.0], fast[p - 1 :]]))
            found.append(np.concatenate([-phi[1:], theta[1:]]))
    return found


def _hannan_rissanen(signal: FloatArray, p: int, q: int) -> FloatArray:
    """Regress on the past and on the residuals of a long autoregression; roots turned inside."""
    from scipy.linalg import solve_toeplitz
    from scipy.signal import lfilter

    n = signal.size
    if p + q == 0:
        return np.zeros(0)
    order = 0 if q == 0 else int(min(max(10.0 * np.log10(n), 2 * (p + q)), n // 4))
    residual = signal
    if order:
        sums = [dot(signal[k:], signal[: n - k]) for k in range(order + 1)]
        column = np.array(sums[:-1])
        column[0] *= 1.0 + 1e-9
        long = solve_toeplitz(column, np.array(sums[1:]))
        residual = lfilter(np.concatenate([[1.0], -long]), [1.0], signal)
    first = order + max(p, q)
    lags = [signal[first - i : n - i] for i in range(1, p + 1)]
    lags += [residual[first - j : n - j] for j in range(1, q + 1)]
    design = np.stack(lags)
    products = gram(design)
    products[np.diag_indices_from(products)] *= 1.0 + 1e-10
    solved = np.linalg.lstsq(products, by_rows(design, signal[first:]), rcond=1e-14)[0]
    found = np.asarray(solved, dtype=np.float64)
    return np.concatenate([_turned_inside(found[:p]), -_turned_inside(-found[p:])])


def _turned_inside(phi: Sequence[float] | FloatArray, limit: float = 1.0 - 1e-4) -> FloatArray:
    """Mirror poles outside the unit circle to its inside."""
    if within(phi, limit):
        return np.asarray(phi, dtype=np.float64)
    poles = poles_of(phi)
    modulus = np.abs(poles)
    poles = np.where(modulus > 1.0, 1.0 / np.conj(poles), poles)
    poles = poles * np.minimum(1.0, limit / np.maximum(np.abs(poles), 1e-300))
    return np.asarray(-np.poly(poles)[1:].real, dtype=np.float64)
