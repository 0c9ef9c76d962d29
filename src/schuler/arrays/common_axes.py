"""Whether the IMUs of an array have been turned into one set of axes: all must feel one gravity.

What is compared in wrong axes looks like faults of all sensors at once. Where gravity points tells
before anything is compared; turns about gravity itself stay hidden.
"""

from __future__ import annotations

import numpy as np

from schuler.data import ImuArray
from schuler.errors import InputError
from schuler.types import FloatArray

# means of so many seconds are compared
BLOCK = 1.0
# nobody mounts two IMUs further apart than this by accident (rad)
LARGEST_ANGLE = float(np.radians(20.0))


def gravity_angles(array: ImuArray) -> FloatArray:
    """Angles between what the accelerometers of any two IMUs feel, medians over the recording."""
    force = array.in_body().accel
    block = max(round(BLOCK * array.rate), 1)
    count = max(force.shape[0] // block, 1)
    whole = force[: count * block].reshape(count, -1, *force.shape[1:])
    mean = whole.mean(axis=1)
    length = np.linalg.norm(mean, axis=2, keepdims=True)
    felt = np.where(length > 1.0, mean / np.where(length > 1.0, length, 1.0), np.nan)
    angles = np.full((array.count, array.count), np.nan)
    for i in range(array.count):
        for j in range(array.count):
            across = np.linalg.norm(np.cross(felt[:, i], felt[:, j]), axis=1)
            angle = np.arctan2(across, np.sum(felt[:, i] * felt[:, j], axis=1))
            angle = angle[np.isfinite(angle)]
            if angle.size:
                angles[i, j] = np.median(angle)
    return angles


def require_common_axes(array: ImuArray) -> None:
    """Refuse an array in which IMUs feel gravity in different directions.

    One IMU alone that differs from several others may be broken, which is for fault detection to
    say; so it passes here.
    """
    angles = gravity_angles(array)
    apart = angles > LARGEST_ANGLE
    agreeing = (~apart & np.isfinite(angles)).sum(axis=1)
    reference = int(np.argmax(agreeing))
    strangers = np.flatnonzero(apart[reference])
    if strangers.size == 0 or (strangers.size == 1 and array.count > 2):
        return
    worst = int(strangers[np.argmax(angles[reference, strangers])])
    away = float(np.degrees(angles[reference, worst]))
    raise InputError(
        f"{strangers.size} of {array.count} IMUs feel gravity in another direction than "
        f"{array.names[reference]}; {array.names[worst]} is {away:.0f} deg away",
        expected="IMUs turned into the axes of one body",
        cure="find how they are turned with schuler calibrate, and give its file as --calibration",
    )
