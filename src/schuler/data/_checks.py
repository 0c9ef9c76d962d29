"""Checks shared by the nouns: shapes, finiteness, time."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError
from schuler.types import FloatArray


def numbers(values: ArrayLike, what: str) -> NDArray[Any]:
    """Return real numbers as an array (columns of pandas and polars too), not copied if possible.

    A mask that hides anything is refused, for the numbers below it mean nothing; so is what holds
    no real numbers: objects, text, dates, complex numbers.
    """
    if np.ma.is_masked(values):
        hidden = int(np.sum(getattr(values, "mask", 0)))
        raise InputError(
            f"{what} is a masked array with {hidden} values hidden",
            expected="numbers throughout",
            cure="cut it where it is masked, or fill the gaps first",
        )
    convert = getattr(values, "to_numpy", None)
    try:
        array = np.asarray(values if convert is None else convert())
        if array.dtype == object and convert is not None:  # pandas columns with missing values
            array = convert(dtype="float64", na_value=np.nan)
    except (TypeError, ValueError, OverflowError) as error:
        reason = str(error).splitlines()[0][:80]
        raise InputError(f"{what} is no array of numbers ({reason})") from None
    if array.dtype.kind not in "iuf":
        raise InputError(
            f"{what} has shape {array.shape} and type {array.dtype}",
            expected="an array of real numbers",
        )
    return array


def frozen(values: ArrayLike, what: str, shape: tuple[int | None, ...]) -> FloatArray:
    """Return a read-only float64 array of the given shape (None: any length)."""
    array = np.asarray(numbers(values, what), dtype=np.float64, order="C")
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


def all_finite(array: NDArray[Any]) -> bool:
    """Return whether an array holds neither NaN nor infinity; its sum tells at a glance."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(array.sum()) or np.isfinite(array).all())


def check_finite(array: NDArray[Any], what: str) -> None:
    """Raise when an array holds NaN or infinity, naming the first row."""
    if all_finite(array):
        return
    bad = ~np.isfinite(array)
    rows = np.flatnonzero(bad.any(axis=tuple(range(1, array.ndim))) if array.ndim > 1 else bad)
    raise InputError(
        f"{what} holds {rows.size} rows that are not finite, the first at row {rows[0]}",
        expected="finite numbers",
        cure="remove or repair these rows first",
    )


PASS = 8192
"""Stamps looked at in one go: their differences stay in the cache."""
REGULAR = 1e-9
"""Relative difference of steps that is the rounding of the stamps."""


def extreme_steps(time: FloatArray) -> tuple[float, float]:
    """Return the smallest and the largest difference of stamps (two or more)."""
    small, large = np.inf, -np.inf
    for start in range(0, time.size - 1, PASS):
        step = np.diff(time[start : start + PASS + 1])
        small, large = min(small, float(step.min())), max(large, float(step.max()))
    return small, large


def median_step(time: FloatArray) -> float:
    """Return the median difference of stamps (two or more), at once where all are the same."""
    small, large = extreme_steps(time)
    if large - small <= REGULAR * large:
        return 0.5 * (small + large)
    return float(np.median(np.diff(time)))


def check_time(time: FloatArray, what: str) -> None:
    """Raise when time is not finite and strictly increasing."""
    check_finite(time, f"{what} time")
    if time.size > 1 and extreme_steps(time)[0] <= 0.0:
        step = np.diff(time)
        k = int(np.argmax(step <= 0.0))
        kind = "repeats" if step[k] == 0.0 else "goes backwards"
        raise InputError(
            f"{what} time {kind} at row {k + 1} ({time[k]:.6f} s, then {time[k + 1]:.6f} s)",
            expected="strictly increasing time",
            cure="sort or drop these rows (reading with repair does)",
        )
