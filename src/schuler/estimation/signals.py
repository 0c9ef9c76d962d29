"""Checks of a signal before anything is fitted to it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from schuler.data._checks import check_finite, numbers
from schuler.errors import EstimationError, InputError
from schuler.estimation.products import dot
from schuler.types import FloatArray

_LARGEST = 1e100
_OUTLIER_SHARE = 0.05
_OUTLIER_SIGMAS = 10.0
_LOOKED_AT = 262_144


def checked_signal(signal: ArrayLike, fewest: int, *, varying: bool = True) -> FloatArray:
    """Return a signal as a float64 array that can be fitted."""
    values = np.ascontiguousarray(numbers(signal, "signal"), dtype=np.float64)
    if values.ndim != 1:
        raise InputError(f"signal has shape {values.shape}", expected="(n,), one channel at a time")
    check_finite(values, "signal")
    if values.size < fewest:
        raise EstimationError(
            f"signal has {values.size} samples",
            expected=f"at least {fewest}",
            cure="record longer or choose a smaller order",
        )
    largest = largest_of(values)
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


def largest_of(values: FloatArray) -> float:
    """Largest magnitude, without a copy."""
    return max(float(values.max()), -float(values.min())) if values.size else 0.0


def varies(values: FloatArray) -> bool:
    """Tell whether a signal varies by more than the rounding of its numbers."""
    largest = largest_of(values)
    if largest == 0.0:
        return False
    # most signals show it in a few samples; the others are looked at in full
    some = values[:: max(1, values.size // _LOOKED_AT)] / largest
    return float(np.std(some)) > 1e-13 or float(np.std(values / largest)) > 1e-13


def outlier_flag(residual: FloatArray, centre: float = 0.0) -> str:
    """Say so if one sample carries much of the variance about a centre."""
    row, highest, total = 0, 0.0, 0.0
    for start in range(0, residual.size, _LOOKED_AT):
        squares = (residual[start : start + _LOOKED_AT] - centre) ** 2
        total += float(squares.sum())
        k = int(np.argmax(squares))
        if squares[k] > highest:
            row, highest = start + k, float(squares[k])
    share = highest / max(total, 1e-300)
    rest = (total - highest) / max(residual.size - 1, 1)
    if share < _OUTLIER_SHARE or highest < _OUTLIER_SIGMAS**2 * rest:
        return ""
    return (
        f"outlier: row {row} alone carries {100.0 * share:.0f} % of the variance of the "
        "innovations; repair it (screening does) and fit again"
    )


_EPS = float(np.finfo(np.float64).eps)
_NARROWEST, _WIDEST = 1e-140, 1e140


@dataclass(frozen=True, slots=True, eq=False)
class Series:
    """A centred signal in a unit near its own standard deviation."""

    values: FloatArray  # (n,): (signal - offset)/scale, contiguous
    offset: float  # what was taken off: the mean, or zero
    # a power of two, so that scaling rounds nothing and results do not depend on the unit
    scale: float
    mean: float  # mean of the signal
    # mean squared rounding of the samples in units of scale²: less cannot be resolved
    rounding: float


def prepare(signal: ArrayLike, *, fewest: int, remove_mean: bool = True) -> Series:
    """Check a signal, take its mean off and scale it."""
    data = numbers(signal, "signal")
    if data.ndim != 1:
        raise InputError(f"signal has shape {data.shape}", expected="numbers (n,)")
    if data.size < fewest:
        raise InputError(f"signal has {data.size} samples", expected=f"at least {fewest}")
    data = data.astype(np.float64, copy=False)
    low, high = float(data.min()), float(data.max())
    if not math.isfinite(high - low):
        bad = np.flatnonzero(~np.isfinite(data))
        if bad.size == 0:
            raise InputError(f"signal spans from {low:g} to {high:g}", cure="use another unit")
        raise InputError(
            f"signal holds {bad.size} samples that are not finite, the first at row {bad[0]}",
            expected="finite numbers",
            cure="remove or repair these rows first",
        )
    largest = max(abs(low), abs(high))
    if high - low <= 4.0 * _EPS * largest:
        raise EstimationError(
            f"the signal does not vary: every sample is {low:g}",
            expected="noise",
            cure="look at the recording: a channel may be dead",
        )
    if not _NARROWEST < high - low < _WIDEST:
        raise InputError(
            f"signal spans {high - low:.3g}, whose square no number can hold",
            cure="use another unit",
        )
    # offset first: the mean of a nearly constant signal is exact only about one of its values
    mean = low + float(np.mean(data - low))
    offset = mean if remove_mean else 0.0
    values = data - offset
    spread = math.sqrt(dot(values, values) / values.size)
    scale = 2.0 ** round(math.log2(spread))
    values /= scale
    return Series(values, offset, scale, mean, (_EPS * largest / scale) ** 2 / 12.0)
