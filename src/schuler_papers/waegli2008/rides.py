"""The two rides of Waegli 2008 with known truth: two IMUs on skis, four on a motorcycle.

Every IMU is of the kind that the paper had: white noise of 0.0194 rad/s a sample at 100 Hz, one
Gauss-Markov bias an axis (its equation (5)), the same law for all, a draw of its own for each.
"""

from __future__ import annotations

from copy import copy
from dataclasses import replace
from typing import Literal

import numpy as np

from schuler import (
    GaussMarkov,
    GnssGrade,
    GnssRecording,
    ImuArray,
    Mounting,
    NoiseModel,
    Trajectory,
    WhiteNoise,
    euler_from_dcm,
    motorcycle,
    simulate_array,
    simulate_receiver,
    ski,
    tetrahedron_mounting,
)
from schuler_papers.experiment import FloatArray, generator

PAPER = "waegli2008"
RATE = 100.0
GYRO_SD = 0.0194
"""rad/s a sample: the mean of the paper's four MTi."""
GYRO_BIAS, ACCEL_BIAS = float(np.radians(1.0)), 0.04
"""Gauss-Markov, rad/s and m/s²: 1 deg/s and 4 mg."""
GYRO_TIME, ACCEL_TIME = 3000.0, 1000.0
"""Correlation times, s."""
SKI_GYRO_TIME = 10_000.0
"""Of the gyros on skis, s: a bias that wanders while the skier waits turns the heading."""
ACCEL_SD = 0.02
"""m/s² a sample."""
COMPASS = np.radians(2.0)
"""Of the heading at the start: an MTi has magnetometers, rad."""
RADIUS = 0.04
"""Of the tetrahedron, m."""

Receiver = Literal["L1", "L1/L2"]
GRADES: dict[Receiver, GnssGrade] = {
    "L1": GnssGrade("L1 code", 5, (0.6, 0.6, 0.9), (1.9, 1.9, 2.85), 60.0, (0.05, 0.05, 0.08)),
    "L1/L2": GnssGrade(
        "RTK fixed", 1, (0.015, 0.015, 0.03), (0.02, 0.02, 0.04), 60.0, (0.03, 0.03, 0.05)
    ),
}
CHANNELS = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")


def mti(bias: float = 1.0, gyro_time: float = GYRO_TIME) -> NoiseModel:
    """Return the noise of one of the paper's MTi."""
    gyro = WhiteNoise(GYRO_SD / np.sqrt(RATE)) + GaussMarkov(bias * GYRO_BIAS, gyro_time)
    accel = WhiteNoise(ACCEL_SD / np.sqrt(RATE)) + GaussMarkov(bias * ACCEL_BIAS, ACCEL_TIME)
    processes = {c: gyro if c.startswith("gyro") else accel for c in CHANNELS}
    return NoiseModel(processes, rate=RATE, source="MTi as in Waegli 2008")


class Ride:
    """Recordings of one draw of a ride, and its truth; a factor on the biases for each IMU."""

    def __init__(
        self,
        kind: Literal["ski", "motorcycle"],
        seed: int,
        biases: tuple[float, ...],
    ) -> None:
        rng = generator(seed, PAPER, kind)
        gyro_time = SKI_GYRO_TIME if kind == "ski" else GYRO_TIME
        self.models = tuple(mti(b, gyro_time) for b in biases)
        mounting: Mounting
        if kind == "ski":
            standstill, moving = 60.0, 60.0
            self.profile = ski(standstill, moving, rng.spawn(1)[0])
            mounting = Mounting(
                Mounting.aligned(len(biases)).rotation,
                np.array([[0.03 * (-1.0) ** i, 0.0, 0.0] for i in range(len(biases))]),
            )
        else:
            standstill, moving = 40.0, 80.0
            self.profile = motorcycle(standstill + moving, rng.spawn(1)[0], standstill=standstill)
            mounting = tetrahedron_mounting(RADIUS)
        self.mounting = mounting
        # errors count once the ride is on its way
        self.judged = (standstill + (10.0 if kind == "ski" else 25.0), standstill + moving)
        noise, compass, *receivers = rng.spawn(2 + len(GRADES))
        yaw = euler_from_dcm(self.profile.trajectory(np.zeros(1)).rotation[0])[2]
        self.heading = float(yaw + COMPASS * compass.standard_normal())
        self._receivers = dict(zip(GRADES, receivers, strict=True))
        ideal = simulate_array(
            self.profile, mounting.rotation, mounting.position, None, RATE, noise
        )
        clean = ImuArray.from_recordings(ideal, mounting)
        self.biases, white = self._errors(clean.size, noise)
        self.array = replace(
            clean,
            gyro=clean.gyro + self.biases[:, :, :3] + white[:, :, :3],
            accel=clean.accel + self.biases[:, :, 3:] + white[:, :, 3:],
        )

    def _errors(self, size: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
        """Biases and white noise (n, k, 6) by IMU and channel, gyros first."""
        shape = (size, len(self.models), len(CHANNELS))
        bias, white = np.empty(shape), np.empty(shape)
        for i, model in enumerate(self.models):
            for c, channel in enumerate(CHANNELS):
                noise, markov = model.process(channel).components
                white[:, i, c] = noise.simulate(size, 1.0 / RATE, rng)
                bias[:, i, c] = markov.simulate(size, 1.0 / RATE, rng)
        return bias, white

    def first(self, count: int) -> Ride:
        """Return the same ride with the first IMUs alone."""
        fewer = copy(self)
        fewer.array, fewer.models = self.array.select(np.arange(count)), self.models[:count]
        return fewer

    def gnss(self, receiver: Receiver) -> GnssRecording:
        """Return what a receiver of a grade records once a second."""
        return simulate_receiver(self.profile, GRADES[receiver], 1.0, rng=self._receivers[receiver])

    @property
    def truth(self) -> Trajectory:
        """Of the origin of the body, ten times a second."""
        start, stop = self.judged
        return self.profile.trajectory(np.arange(start, stop, 0.1))
