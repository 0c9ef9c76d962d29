"""Checks shared by the nouns: shapes, finiteness, time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError

FloatArray = NDArray[np.float64]


def frozen(values: ArrayLike, what: str, shape: tuple[int | None, ...]) -> FloatArray:
    """Return a read-only float64 array of the given shape (None: any length)."""
    array = np.ascontiguousarray(values, dtype=np.float64)
    fits = array.ndim == len(shape) and all(
        want is None or have == want for have, want in zip(array.shape, shape, strict=True)
    )
    if not fits:
        text = ", ".join("n" if s is None else str(s) for s in shape)
        raise InputError(f"{what} has shape {array.shape}", expected=f"({text})")
    if array is values or (isinstance(values, np.ndarray) and np.shares_memory(array, values)):
        array = array.view()
    array.flags.writeable = False
    return array


def check_finite(array: NDArray[Any], what: str) -> None:
    """Raise when an array holds NaN or infinity, naming the first row."""
    if np.isfinite(array).all():
        return
    bad = ~np.isfinite(array)
    rows = np.flatnonzero(bad.any(axis=tuple(range(1, array.ndim))) if array.ndim > 1 else bad)
    raise InputError(
        f"{what} holds {rows.size} rows that are not finite, the first at row {rows[0]}",
        expected="finite numbers",
        cure="remove or repair these rows first",
    )


def check_time(time: FloatArray, what: str) -> None:
    """Raise when time is not finite and strictly increasing."""
    check_finite(time, f"{what} time")
    step = np.diff(time)
    if step.size and step.min() <= 0.0:
        k = int(np.argmax(step <= 0.0))
        kind = "repeats" if step[k] == 0.0 else "goes backwards"
        raise InputError(
            f"{what} time {kind} at row {k + 1} ({time[k]:.6f} s, then {time[k + 1]:.6f} s)",
            expected="strictly increasing time",
            cure="sort or drop these rows (reading with repair does)",
        )
