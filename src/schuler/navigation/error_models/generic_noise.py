"""A sensor of which nobody says anything: consumer MEMS, for the start and to be tuned."""

from __future__ import annotations

import numpy as np

from schuler.noise.noise_model import NoiseModel

# switch-on constants of consumer MEMS: 30 mg, 0.5 deg/s
TURN_ON_ACCEL = 0.3
TURN_ON_GYRO = float(np.radians(0.5))


def generic_noise_model() -> NoiseModel:
    """Where tuning starts when nobody says anything about the sensor: a consumer MEMS in a car."""
    from schuler.noise import RandomWalk, WhiteNoise

    accel = WhiteNoise(5e-3) + RandomWalk(5e-4)
    gyro = WhiteNoise(1e-3) + RandomWalk(2e-5)
    processes = {f"{s}_{a}": p for s, p in (("gyro", gyro), ("accel", accel)) for a in "xyz"}
    return NoiseModel(processes=processes, source="generic consumer MEMS, to be tuned")
