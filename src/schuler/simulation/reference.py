"""The reference instrument of the field tests: a tactical-grade IMU (spec 1.5)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from schuler.noise import NoiseModel

ANGLE_RANDOM_WALK = np.radians(0.07) / 60.0
"""0.07 deg/sqrt(h) in rad/s/sqrt(Hz)."""
GYRO_BIAS_INSTABILITY = np.radians(1.0) / 3600.0
"""1 deg/h in rad/s."""
VELOCITY_RANDOM_WALK = 0.03 / 60.0
"""0.03 m/s/sqrt(h) in m/s²/sqrt(Hz)."""
ACCEL_BIAS_INSTABILITY = 0.3e-3 * 9.80665
"""0.3 mg in m/s²."""


def tactical_grade_noise() -> NoiseModel:
    """Return the noise of a tactical-grade IMU, of the class of the LN200."""
    from schuler.data import CHANNELS
    from schuler.noise import BiasInstability, NoiseModel, WhiteNoise

    gyro = WhiteNoise(ANGLE_RANDOM_WALK) + BiasInstability(GYRO_BIAS_INSTABILITY, 1.0, 1e4)
    accel = WhiteNoise(VELOCITY_RANDOM_WALK) + BiasInstability(ACCEL_BIAS_INSTABILITY, 1.0, 1e4)
    return NoiseModel(
        {c: gyro if c.startswith("gyro") else accel for c in CHANNELS},
        source="tactical grade, typical values of the class",
    )
