"""A motorcycle with four IMUs on a tetrahedron, whose noise changes and whose biases wander."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from schuler.arrays.geometry import tetrahedron_mounting
from schuler.data import CHANNELS, ImuArray
from schuler.noise import BiasInstability, NoiseModel, TurnOnBias
from schuler.simulation import motorcycle, simulate_array

DEGREE = np.pi / 180.0
GYRO, ACCEL = 0.05 * DEGREE, 0.02
"""Standard deviations of a sample at rest: 0.005 deg/s/sqrt(Hz) and 200 µg/sqrt(Hz) at 100 Hz."""

WANDER = NoiseModel(
    {
        c: TurnOnBias(0.3 * DEGREE) + BiasInstability(5.0 * DEGREE / 3600.0, 10.0, 1000.0)
        if c.startswith("gyro")
        else TurnOnBias(0.05) + BiasInstability(4e-4, 10.0, 1000.0)
        for c in CHANNELS
    }
)


def ride(seconds: float, seed: int) -> tuple[ImuArray, np.ndarray]:
    """Return the array, and the true deviation of its gyros, (n, 4, 3).

    The noise of all sensors swells and fades with the ride by a factor of three, that of each axis
    by a fifth of its own, over 20 to 60 s.
    """
    mounting = tetrahedron_mounting(0.03)
    profile = motorcycle(seconds, seed, standstill=10.0)
    made = simulate_array(
        profile, mounting.rotation, mounting.position, WANDER, 100.0, np.random.default_rng(seed)
    )
    array = ImuArray.from_recordings(made, mounting)
    rng = np.random.default_rng(seed + 1)
    swell = 2.0 + np.sin(2 * np.pi * (array.time / rng.uniform(20, 60) + rng.random()))
    out = []
    for values, base in ((array.gyro, GYRO), (array.accel, ACCEL)):
        own = np.sin(
            2
            * np.pi
            * (array.time[:, None, None] / rng.uniform(20, 60, (4, 3)) + rng.random((4, 3)))
        )
        deviation = base * swell[:, None, None] * (1.0 + 0.2 * own)
        out.append((values + deviation * rng.standard_normal(values.shape), deviation))
    return replace(array, gyro=out[0][0], accel=out[1][0]), out[0][1]
