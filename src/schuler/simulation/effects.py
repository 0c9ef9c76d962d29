"""What motion and temperature do to a sensor: g-sensitivity, drift, noise that follows motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from schuler.data import ImuRecording
from schuler.errors import InputError
from schuler.types import FloatArray

STANDARD_GRAVITY = 9.80665
"""m/s²."""


@dataclass(frozen=True, slots=True, eq=False)
class TemperatureDrift:
    """Bias that follows temperature: linear (T - reference) + quadratic (T - reference)²."""

    reference: float = 25.0  # temperature at which there is no drift, degrees Celsius
    # gyro_linear, gyro_quadratic: (3,) rad/s per kelvin, and per kelvin squared
    gyro_linear: ArrayLike = (0.0, 0.0, 0.0)
    gyro_quadratic: ArrayLike = (0.0, 0.0, 0.0)
    # accel_linear, accel_quadratic: (3,) m/s² per kelvin, and per kelvin squared
    accel_linear: ArrayLike = (0.0, 0.0, 0.0)
    accel_quadratic: ArrayLike = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        for name in ("gyro_linear", "gyro_quadratic", "accel_linear", "accel_quadratic"):
            if np.shape(getattr(self, name)) != (3,):
                raise InputError(
                    f"{name} of shape {np.shape(getattr(self, name))}", expected="(3,)"
                )

    def biases(self, temperature: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the drift at some temperatures."""
        above = (temperature - self.reference)[:, None]
        gyro = above * np.asarray(self.gyro_linear) + above**2 * np.asarray(self.gyro_quadratic)
        accel = above * np.asarray(self.accel_linear) + above**2 * np.asarray(self.accel_quadratic)
        return gyro, accel


def warm_up(
    time: ArrayLike, *, start: float = 25.0, rise: float = 15.0, time_constant: float = 600.0
) -> FloatArray:
    """Return the temperature of a device after it was switched on."""
    if not time_constant > 0.0:
        raise InputError(f"a time constant of {time_constant:g} s", expected="a positive time")
    t = np.asarray(time, dtype=np.float64)
    return np.asarray(start - rise * np.expm1(-(t - t[0]) / time_constant))


@dataclass(frozen=True, slots=True)
class ManoeuvreNoise:
    """White noise that grows with motion, besides the white noise of the noise model.

    The density added to the gyros is sqrt((gyro_with_rate |w|)² + (gyro_with_force a)²), with the
    rate |w| and a = | |f| - g |, what the force has beyond gravity; likewise for accelerometers.
    Variances add: the sensor's total density is sqrt(N² + added²).
    """

    gyro_with_rate: float = 0.0  # rad/s/sqrt(Hz) per rad/s
    gyro_with_force: float = 0.0  # rad/s/sqrt(Hz) per m/s²
    accel_with_rate: float = 0.0  # m/s²/sqrt(Hz) per rad/s
    accel_with_force: float = 0.0  # m/s²/sqrt(Hz) per m/s²

    def __post_init__(self) -> None:
        values = (
            self.gyro_with_rate,
            self.gyro_with_force,
            self.accel_with_rate,
            self.accel_with_force,
        )
        if not all(0.0 <= v < np.inf for v in values):
            raise InputError(f"manoeuvre noise {values}", expected="numbers of zero or more")

    def densities(self, truth: ImuRecording) -> tuple[FloatArray, FloatArray]:
        """Return the densities along a motion, to draw from or to tell a filter."""
        rate = np.linalg.norm(truth.gyro, axis=1)
        force = np.abs(np.linalg.norm(truth.accel, axis=1) - STANDARD_GRAVITY)
        gyro = np.hypot(self.gyro_with_rate * rate, self.gyro_with_force * force)
        accel = np.hypot(self.accel_with_rate * rate, self.accel_with_force * force)
        return gyro, accel

    def draw(
        self, truth: ImuRecording, dt: float, rng: np.random.Generator
    ) -> tuple[FloatArray, FloatArray]:
        """Draw the added noise."""
        unit = np.stack([c.standard_normal(truth.size) for c in rng.spawn(6)], axis=-1)
        gyro, accel = self.densities(truth)
        step = np.sqrt(dt)
        return gyro[:, None] * unit[:, :3] / step, accel[:, None] * unit[:, 3:] / step
