"""Checks shared by the processes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import ModelError
from schuler.types import FloatArray


def not_negative(value: float, what: str) -> float:
    """Return a finite number >= 0 as a float."""
    number = float(value)
    if not (math.isfinite(number) and number >= 0.0):
        raise ModelError(f"{what} is {number:g}", expected="a finite number, zero or above")
    return number


def positive(value: float, what: str) -> float:
    """Return a finite number > 0 as a float."""
    number = float(value)
    if not (math.isfinite(number) and number > 0.0):
        raise ModelError(f"{what} is {number:g}", expected="a finite number above zero")
    return number


def finite(value: float, what: str) -> float:
    """Return a finite number as a float."""
    number = float(value)
    if not math.isfinite(number):
        raise ModelError(f"{what} is {number:g}", expected="a finite number")
    return number


def samples(n: int, dt: float) -> int:
    """Check a wish for `n` samples `dt` seconds apart."""
    positive(dt, "sample interval dt")
    if n < 0:
        raise ModelError(f"{n} samples were asked for", expected="zero or more")
    return int(n)


def positive_array(values: ArrayLike, what: str) -> FloatArray:
    """Return an array of finite numbers > 0."""
    array = np.asarray(values, dtype=np.float64)
    if not (np.isfinite(array).all() and (array > 0.0).all()):
        raise ModelError(f"{what} has values that are not above zero", expected="finite, > 0")
    return array
