"""How far the sensors of an array are apart: each component minus the mean of all sensors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from schuler.arrays.calibration.rows import Rests
from schuler.types import FloatArray

Quantity = Literal["gyro", "accel"]

LIMITS = (np.radians(500.0), np.radians(1500.0))
"""Mean rates up to which disagreement is told apart, rad/s."""
MOVING = np.radians(5.0)
"""Mean rate from which an array counts as moving, rad/s."""


@dataclass(frozen=True, slots=True)
class Disagreement:
    """Disagreement in one class of motion."""

    quantity: Quantity  # which sensors
    condition: str  # class of motion, in words
    limit: float  # upper end of the mean rate, rad/s; 0 at rest, infinite without a limit.
    rms: float  # root mean square over all rows, sensors and axes, rad/s or m/s²
    robust: float  # 1.4826 times the median absolute deviation of the same, rad/s or m/s²
    values: int  # how many they are


def measure_disagreement(
    residual: FloatArray,
    rate: FloatArray,
    rests: Rests,
    quantity: Quantity,
    *,
    moving: float = MOVING,
    limits: tuple[float, ...] = LIMITS,
) -> tuple[Disagreement, ...]:
    """Measure disagreement at rest and in classes of motion."""
    whole = np.isfinite(residual).all(axis=(1, 2))
    speed = np.linalg.norm(rate, axis=1)
    found = []
    rows = whole & rests.rows
    if rows.any():
        found.append(_one(residual[rows], quantity, "at rest", 0.0))
    last = 0
    for limit in (*limits, np.inf):
        with np.errstate(invalid="ignore"):
            rows = whole & (speed > moving) & (speed < limit) & ~rests.rows
        count = int(np.count_nonzero(rows))
        if count <= last:
            continue
        last = count
        words = "moving" if np.isinf(limit) else f"below {np.degrees(limit):.0f} deg/s"
        found.append(_one(residual[rows], quantity, words, limit))
    return tuple(found)


def _one(residual: FloatArray, quantity: Quantity, words: str, limit: float) -> Disagreement:
    flat = residual.ravel()
    around = np.abs(flat - np.median(flat))
    return Disagreement(
        quantity,
        words,
        float(limit),
        float(np.sqrt(np.mean(flat**2))),
        1.4826 * float(np.median(around)),
        flat.size,
    )
