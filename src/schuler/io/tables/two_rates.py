"""Gyro and accelerometer on rows of their own in one table, brought onto one time axis."""

from __future__ import annotations

import numpy as np

from schuler.data._checks import all_finite
from schuler.io.source import Notes
from schuler.types import BoolArray, FloatArray

_SPARSE = 0.3  # share of rows without a sensor from which it has rows of its own


def on_one_axis(
    time: FloatArray, gyro: FloatArray, accel: FloatArray, notes: Notes
) -> tuple[FloatArray, FloatArray, BoolArray] | None:
    """Return gyro and accelerometer and which rows to keep; None where every row has both.

    Of two sensors at one rate, each row of the gyro gets the nearest row of the accelerometer,
    so that the noise of both stays what it was; of two rates, the slower is interpolated.
    """
    if all_finite(gyro) and all_finite(accel):
        return None
    has = {"gyro": _there(gyro), "accel": _there(accel)}
    if any(h is None for h in has.values()):
        return None
    rows = {k: np.flatnonzero(h) for k, h in has.items() if h is not None}
    count = {k: r.size for k, r in rows.items()}
    fewest = min(count.values())
    if fewest > (1.0 - _SPARSE) * time.size or fewest < 3 or not np.isfinite(time).all():
        return None
    if not all(np.all(np.diff(time[r]) > 0.0) for r in rows.values()):
        return None
    base, other = ("gyro", "accel") if count["gyro"] >= count["accel"] else ("accel", "gyro")
    stamps, known = time[rows[base]], time[rows[other]]
    values = (accel if other == "accel" else gyro)[rows[other]]
    signals = {"gyro": gyro.copy(), "accel": accel.copy()}
    if abs(count[base] - count[other]) <= max(2, 0.02 * count[base]):
        after = np.clip(np.searchsorted(known, stamps), 1, known.size - 1)
        nearest = after - (stamps - known[after - 1] < known[after] - stamps)
        apart = float(np.median(np.abs(known[nearest] - stamps)))
        signals[other][rows[base]] = values[nearest]
        notes.assumed(
            f"{base} and {other} stand on rows of their own: each row of the {base} got the "
            f"nearest of the {other}, {apart * 1e3:.3g} ms apart"
        )
    else:
        for k in range(3):
            signals[other][rows[base], k] = np.interp(stamps, known, values[:, k])
        notes.assumed(
            f"{other} is slower than {base} ({count[other]} rows to {count[base]}): interpolated, "
            "so its noise is not what the sensor has"
        )
    keep = np.zeros(time.size, dtype=bool)
    inside = (stamps >= known[0] - 0.1) & (stamps <= known[-1] + 0.1)
    keep[rows[base][inside]] = True
    return signals["gyro"], signals["accel"], keep


def _there(values: FloatArray) -> BoolArray | None:
    """Return in which rows a sensor stands; None when its axes are not there together."""
    x, y, z = np.isfinite(values).T  # three columns at once are ten times as fast as row by row
    any_, all_ = x | y | z, x & y & z
    if not any_.any() or (any_ != all_).mean() > 0.01:
        return None
    return np.asarray(all_)
