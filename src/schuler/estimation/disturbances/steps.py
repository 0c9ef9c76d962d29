"""A column that is printed in coarse steps, rebuilt between them.

What is printed lags its truth by up to half a step, and a slope on it comes out too small. The
mean of the truth given all that was printed has errors that do not depend on it, and the slope
on that mean is true (Berkson); what lies between the steps stays in the signal as noise.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from schuler.types import FloatArray

_PER_STEP = 8
_PARTS = 5
_NOISES = (0.04, 0.15, 0.4)
_MOTIONS = (0.03, 0.06, 0.12, 0.25, 0.5)
_LESS_MOTION = (0.5, 0.6, 0.72, 0.85, 1.0, 1.2)
_MOST_STATES = 4000


@dataclass(frozen=True, slots=True, eq=False)
class Rebuilt:
    """A column between its steps, how far the truth is off, and what share a slope is unsure by."""

    values: FloatArray
    error: float
    doubt: float = 0.0


def step_of(values: FloatArray) -> float:
    """Step of a column that moves in steps, zero if it does not."""
    span = float(np.ptp(values))
    if span == 0.0 or np.count_nonzero(np.diff(values)) > 0.5 * values.size:
        return 0.0
    levels, counts = np.unique(np.round((values - values.min()) / span, 9), return_counts=True)
    # what is seen once or twice may be a hole that was filled
    gaps = span * np.diff(levels[counts > 2])
    if gaps.size < 1:
        return 0.0
    step = float(np.median(gaps))
    return step if np.mean(np.abs(gaps / step - np.round(gaps / step)) < 0.05) > 0.9 else 0.0


def rebuilt(values: FloatArray, step: float, block: int) -> list[Rebuilt]:
    """Means of the truth given the column: a random walk seen through steps, on a grid.

    Noise and motion are the likeliest; motion that returns is rather less than that of a random
    walk, and what follows the column tells by how much: hence several. None where the column
    moves by a step within a block: means of blocks then know it well.
    """
    part = max(block // _PARTS, 1)
    count = values.size // part
    lowest = float(values.min())
    shown = values[: count * part].reshape(count, part).mean(axis=1) - lowest
    span = float(np.ptp(values))
    moves = np.median(np.abs(shown[_PARTS:] - shown[:-_PARTS])) >= step
    if moves or (span / step + 4.0) * _PER_STEP > _MOST_STATES:
        return []
    grid = np.arange(-2.0 * step, span + 2.0 * step, step / _PER_STEP)
    seen = {r: _seen(shown, grid, step, r) for r in _NOISES}
    tries = [(_forward(seen[r], q)[1], r, q) for r in _NOISES for q in _MOTIONS]
    _, noise, motion = max(tries)
    middle = (np.arange(count) + 0.5) * part - 0.5
    found = []
    for share in _LESS_MOTION:
        ahead = _forward(seen[noise], share * motion)[0]
        behind = _forward(seen[noise][::-1], share * motion)[0][::-1]
        # what is shown in a row is in both: once is enough
        weight = ahead * behind / np.maximum(seen[noise], 1e-30)
        weight /= np.maximum(weight.sum(axis=1, keepdims=True), 1e-300)
        mean = weight @ grid
        variance = np.maximum(weight @ grid**2 - mean**2, 0.0)
        full = np.interp(np.arange(values.size), middle, lowest + mean)
        found.append(Rebuilt(full, math.sqrt(float(variance.mean()))))
    return found


def _seen(shown: FloatArray, grid: FloatArray, step: float, noise: float) -> FloatArray:
    """Likelihood of what a part shows in the mean, for every truth of the grid."""
    from scipy.special import ndtr

    level = np.floor(grid / step + 0.5)
    expected = level.copy()
    # rounding under noise: a soft staircase
    beyond = grid / step - level
    for k in (-2, -1, 0, 1):
        edge = k + 0.5
        up = ndtr((beyond - edge) / noise)
        expected += up if k >= 0 else up - 1.0
    width = 0.08
    z = (shown[:, None] - step * expected[None, :]) / (width * step)
    return np.asarray(np.exp(-0.5 * np.minimum(z**2, 60.0)))


def _forward(seen: FloatArray, motion: float) -> tuple[FloatArray, float]:
    """Chances of the truth in every part given what was shown up to it, and the likelihood."""
    states = seen.shape[1]
    reach = min(math.ceil(4.0 * motion * _PER_STEP) + 1, (states - 1) // 2)
    away = np.arange(-reach, reach + 1) / (motion * _PER_STEP)
    kernel = np.exp(-0.5 * away**2)
    kernel /= kernel.sum()
    out = np.empty_like(seen)
    now = np.full(states, 1.0 / states)
    total = 0.0
    for k, likelihood in enumerate(seen):
        # a leap is rare, not impossible
        now = (np.convolve(now, kernel, mode="same") + 1e-9) * likelihood
        size = float(now.sum())
        total += math.log(size)
        now = now / size
        out[k] = now
    return out, total
