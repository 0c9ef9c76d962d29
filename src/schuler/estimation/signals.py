"""Checks of a signal before anything is fitted to it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from schuler.data._checks import check_finite
from schuler.errors import EstimationError, InputError
from schuler.types import FloatArray

_LARGEST = 1e100
_OUTLIER_SHARE = 0.05
_OUTLIER_SIGMAS = 10.0


def checked_signal(signal: ArrayLike, fewest: int, *, varying: bool = True) -> FloatArray:
    """Return a signal as a float64 array that can be fitted."""
    values = np.ascontiguousarray(signal, dtype=np.float64)
    if values.ndim != 1:
        raise InputError(f"signal has shape {values.shape}", expected="(n,), one channel at a time")
    check_finite(values, "signal")
    if values.size < fewest:
        raise EstimationError(
            f"signal has {values.size} samples",
            expected=f"at least {fewest}",
            cure="record longer or choose a smaller order",
        )
    largest = float(np.abs(values).max(initial=0.0))
    if largest > _LARGEST or 0.0 < largest < 1.0 / _LARGEST:
        raise InputError(
            f"signal with values up to {largest:.3g}",
            expected=f"between {1.0 / _LARGEST:g} and {_LARGEST:g}",
            cure="check its unit",
        )
    if varying and not varies(values):
        raise EstimationError(
            "signal does not vary",
            expected="noise",
            cure="check that the channel was recorded and is not stuck",
        )
    return values


def varies(values: FloatArray) -> bool:
    """Tell whether a signal varies by more than the rounding of its numbers."""
    largest = float(np.abs(values).max(initial=0.0))
    return largest > 0.0 and float(np.std(values / largest)) > 1e-13


def outlier_flag(residual: FloatArray) -> str:
    """Say so if one sample carries much of the variance."""
    squares = residual**2
    row = int(np.argmax(squares))
    share = float(squares[row] / max(float(squares.sum()), 1e-300))
    rest = (float(squares.sum()) - float(squares[row])) / max(residual.size - 1, 1)
    if share < _OUTLIER_SHARE or squares[row] < _OUTLIER_SIGMAS**2 * rest:
        return ""
    return (
        f"outlier: row {row} alone carries {100.0 * share:.0f} % of the variance of the "
        "innovations; repair it (screening does) and fit again"
    )
