"""The floor of an outage: what white noise alone does to position, and nobody can go below.

Spec 10: g N_g t^(5/2)/sqrt(20) from angle random walk, N_a t^(3/2)/sqrt(3) from velocity random
walk, from a start without error and with perfect biases. A mean error below it is a bug or luck.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from schuler.earth import gravity
from schuler.types import FloatArray


def white_noise_floor(
    white_density: ArrayLike, rotation: ArrayLike, time: ArrayLike, *, latitude: float = math.pi / 4
) -> FloatArray:
    """Horizontal position error of white noise alone, after a time without aiding."""
    n = np.asarray(white_density, dtype=np.float64)
    c = np.asarray(rotation, dtype=np.float64)
    t = np.maximum(np.asarray(time, dtype=np.float64), 0.0)  # rounding of the first epoch
    # a rotation about north moves it east, one about east north: the sum needs no pairing
    accel = (c[:2] ** 2 @ n[:3] ** 2).sum()
    gyro = (c[:2] ** 2 @ n[3:] ** 2).sum()
    g = float(gravity(latitude, 0.0))
    return np.asarray(np.sqrt(gyro * g**2 * t**5 / 20.0 + accel * t**3 / 3.0))
