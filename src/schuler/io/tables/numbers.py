"""Numbers that stand beside a table: rates, and time as counts of nanoseconds."""

from __future__ import annotations

from typing import Any

import numpy as np

RATE_NAMES = {"rate", "fs", "freq", "frequency", "samplerate", "samplingrate", "samplefrequency"}
"""Names of a sampling rate, letters and digits only."""


def positive_rate(text: Any) -> float | None:
    """Return a sampling rate; None when it is no positive number."""
    try:
        value = float(text)
    except (TypeError, ValueError):
        return None
    return value if np.isfinite(value) and value > 0 else None


def seconds_of_nanoseconds(nanoseconds: Any) -> Any:
    """Return seconds without losing digits of integers."""
    if nanoseconds.dtype.kind == "f":  # missing values turn integers into floats
        return nanoseconds * 1e-9
    return nanoseconds // 10**9 + (nanoseconds % 10**9) * 1e-9
