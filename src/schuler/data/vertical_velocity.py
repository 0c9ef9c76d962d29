"""Vertical velocity of GNSS held against the change of height: not measured, or the wrong sign."""

from __future__ import annotations

from typing import Literal

import numpy as np

from schuler.types import FloatArray

FEWEST_EPOCHS = 20
MOVES = 1.0
"""Horizontal speed, m/s, at which no receiver measures exactly nothing of the vertical."""
SPANS = (4.0, 15.0, 60.0)
"""Seconds over which heights are differenced: their errors hide what is slow at short ones."""
LEAST_RATE = 0.05
"""Root mean square of the vertical velocity over a span that tells a sign, m/s."""
AGAINST, DEVIATIONS = -0.5, 4.0
"""Correlation that contradicts, and how sure it has to be (Fisher's z)."""

Trouble = Literal["not measured", "points up"]


def trouble_of_vertical_velocity(
    time: FloatArray, height: FloatArray, velocity: FloatArray
) -> Trouble | None:
    """Tell whether velocity down (n, 3) is always zero, or goes against the change of height."""
    down = velocity[:, 2]
    if time.size < FEWEST_EPOCHS:
        return None
    if not down.any():
        return "not measured" if np.hypot(*velocity[:, :2].T).max() > MOVES else None
    step = np.diff(time)
    usual = float(np.median(step))
    sunk = np.concatenate([[0.0], np.cumsum(0.5 * (down[1:] + down[:-1]) * step)])
    for span in SPANS:
        n = max(1, round(span / usual))
        if time.size < 5 * n:
            continue
        even = time[n:] - time[:-n] < 1.5 * n * usual
        driven = (sunk[n:] - sunk[:-n])[even]
        moved = (height[:-n] - height[n:])[even]
        if driven.size < FEWEST_EPOCHS or driven.std() < LEAST_RATE * n * usual or not moved.any():
            continue
        correlation = float(np.corrcoef(driven, moved)[0, 1])
        independent = even.sum() / n - 3.0
        sure = np.arctanh(np.clip(correlation, -0.999, 0.999)) * np.sqrt(max(independent, 0.0))
        if correlation < AGAINST and sure < -DEVIATIONS:
            return "points up"
    return None
