"""What receivers of all makers have in common: kinds of fixes, and epochs without one."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from schuler.errors import InputError
from schuler.io.source import Columns, MemorySource

QUALITY_OF_FIX_TYPE = np.array([0, 0, 0, 5, 4, 2, 1])
"""RTKLIB's number of the quality by that of MAVLink and PX4 (3: 3-D, ... 6: RTK fixed)."""

QUALITY_OF_NMEA = np.array([0, 5, 4, 5, 1, 2, 0, 0, 0])
"""RTKLIB's number of the quality by that of GGA (1: single, 2: DGPS, 4: fixed, 5: float)."""


def only_fixes(path: Path, columns: Columns, said: str, rate_word: str = "epochs") -> MemorySource:
    """Return the epochs with a fix; raise when there are none."""
    fixed = columns["quality"] > 0
    if not fixed.any():
        raise InputError(
            f"none of the {fixed.size} {rate_word} has a fix",
            expected="positions",
            where=str(path),
        )
    left = int((~fixed).sum())
    notes = (f"left out {left} {rate_word} without a fix",) if left else ()
    kept = {n: c[fixed] for n, c in columns.items()}
    return MemorySource(path, kept, {}, None, (said, *notes), "epoch", notes)
