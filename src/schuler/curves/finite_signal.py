"""What every estimator asks of a signal before it starts: numbers, enough of them, all finite."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from schuler.data._checks import numbers
from schuler.errors import InputError
from schuler.types import FloatArray

LARGEST = 1e120
"""Beyond this squares of squares, or sums of many squares, leave the range of numbers."""


def finite_samples(signal: ArrayLike, *, shortest: int, columns: bool = False) -> FloatArray:
    """Return a signal as float64, or say what is wrong with it."""
    values = numbers(signal, "signal")
    if values.ndim not in ((1, 2) if columns else (1,)):
        raise InputError(
            f"signal has shape {values.shape}",
            expected="numbers (n,) or (n, m)" if columns else "numbers (n,), one channel at a time",
        )
    if len(values) < shortest or values.size == 0:
        raise InputError(f"signal has {len(values)} samples", expected=f"at least {shortest}")
    if not (math.isfinite(float(values.max())) and math.isfinite(float(values.min()))):
        bad = np.flatnonzero(~np.isfinite(values.reshape(len(values), -1)).all(axis=1))
        raise InputError(
            f"signal holds {bad.size} samples that are not finite, the first at row {bad[0]}",
            expected="finite numbers",
            cure="remove or repair these rows first",
        )
    out = np.asarray(values, dtype=np.float64)
    if max(float(out.max()), -float(out.min())) > LARGEST:
        raise too_large()
    return out


def too_large() -> InputError:
    """Return the error for numbers whose squares no number can hold."""
    return InputError(
        "signal holds numbers beyond 1e120",
        expected="SI units",
        cure="check the unit or the reading of the file",
    )


def checked_rate(rate: float) -> float:
    """Return a sample rate in Hz that can be one."""
    if not (np.isfinite(rate) and rate > 0.0):
        raise InputError(f"rate is {rate:g} Hz", expected="a finite number above zero")
    return float(rate)
