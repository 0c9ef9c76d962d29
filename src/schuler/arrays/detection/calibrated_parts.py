"""Sensors that break do not make an array one that was never calibrated.

What an array lacks in calibration it lacks all the time; what is wrong in some part of a recording
and right in another, in motion as lively, is a fault.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from schuler.arrays.calibration.result import ArrayCalibration
from schuler.arrays.calibration.rows import low_passed
from schuler.arrays.detection.fault_settings import FaultSettings
from schuler.arrays.detection.motion_errors import mean_of_present
from schuler.arrays.detection.preparation import (
    BANDWIDTH,
    PreparedDetection,
    _ruled_by_motion,
    _vibrates,
    prepare_detection,
)
from schuler.data import ImuArray
from schuler.errors import InputError

PARTS = 4
"""Of a recording, each looked at by itself."""
SHORTEST = 20.0
"""Seconds that tell motion from noise."""
AS_LIVELY = 0.8
"""Of the rate of the whole, that of a part which can tell."""


def prepare_by_parts(
    array: ImuArray,
    settings: FaultSettings | None = None,
    *,
    calibration: ArrayCalibration | None = None,
) -> PreparedDetection:
    """As `prepare_detection`, but what a lively part shows to be calibrated is so throughout."""
    part = None if calibration is not None else _calibrated_part(array)
    if part is None:
        return prepare_detection(array, settings, calibration=calibration)
    ready = prepare_detection(part, settings)
    whole = array if ready.array is part else low_passed(array, BANDWIDTH)
    note = (
        f"the array is calibrated, as it shows from {part.time[0]:.0f} to {part.time[-1]:.0f} s: "
        "what sensors differ by at other times is taken for faults"
    )
    return replace(ready, array=whole, notes=(note, *ready.notes))


def _calibrated_part(array: ImuArray) -> ImuArray | None:
    """The liveliest part that motion does not rule, of an array that it rules as a whole."""
    if array.duration < PARTS * SHORTEST or not _ruled(array):
        return None
    speed = np.linalg.norm(mean_of_present(array.in_body().gyro), axis=1)
    needed = AS_LIVELY * float(np.nanquantile(speed, 0.9))
    edges = np.linspace(0, array.size, PARTS + 1).astype(int)
    lively = [float(np.nanquantile(speed[a:b], 0.9)) for a, b in pairwise(edges)]
    for place in np.argsort(lively)[::-1]:
        if lively[place] < needed:
            break
        first, stop = edges[place], edges[place + 1]
        part = array.between(float(array.time[first]), float(array.time[stop - 1]))
        if not _ruled(part):
            return part
    return None


def _ruled(array: ImuArray) -> bool:
    try:
        return _ruled_by_motion(low_passed(array, BANDWIDTH) if _vibrates(array) else array)
    except InputError:
        return True
