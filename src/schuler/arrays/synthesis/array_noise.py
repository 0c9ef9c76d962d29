"""Noise and bias differences of an array, found on one recording and used on another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schuler.arrays.redundant import RedundantSensors, redundant_sensors
from schuler.arrays.tracking import AxisNoise, start_values
from schuler.data import ImuArray
from schuler.errors import InputError
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class ArrayNoise:
    """Standard deviations of a sample and bias differences of every axis of an array."""

    gyro_deviation: FloatArray  # (k, 3): rad/s; NaN where not known.
    accel_deviation: FloatArray  # (k, 3): m/s²
    # (k, 3): differences in the gauge of the mean of the sensors, in each sensor's axes, rad/s
    gyro_bias: FloatArray
    accel_bias: FloatArray  # (k, 3): m/s²
    rate: float  # samples a second that the deviations belong to

    def of(self, sensors: RedundantSensors) -> AxisNoise:
        """Return the part for one kind of sensor of an array of the same IMUs."""
        gyros = sensors.sensor == "gyro"
        deviation = (self.gyro_deviation if gyros else self.accel_deviation).ravel()
        bias = (self.gyro_bias if gyros else self.accel_bias).ravel()
        if deviation.size != sensors.count:
            raise InputError(
                f"noise of {deviation.size} axes for an array of {sensors.count}",
                expected="noise found on the same IMUs, in the same order",
            )
        if not (np.isfinite(deviation).all() and deviation.min() > 0.0):
            raise InputError(
                f"noise of the {sensors.sensor} axes that is not known or not positive",
                expected="a positive deviation for every axis",
            )
        ratio = 1.0 / (sensors.step * self.rate)
        return AxisNoise(np.nan_to_num(bias), deviation**2 * ratio)


def array_noise(
    array: ImuArray, start: float | None = None, stop: float | None = None
) -> ArrayNoise:
    """Return noise and bias differences of an array from its redundancy."""
    if start is not None or stop is not None:
        array = array.between(-np.inf if start is None else start, np.inf if stop is None else stop)
    deviations, biases = [], []
    for kind in ("gyro", "accel"):
        values = array.gyro if kind == "gyro" else array.accel
        deviation, bias = np.full(3 * array.count, np.nan), np.zeros(3 * array.count)
        if np.isfinite(values).any():
            sensors = redundant_sensors(array, "gyro" if kind == "gyro" else "accel")
            found = start_values(sensors, array.size)
            recorded = ~np.isnan(values.reshape(array.size, -1)).all(axis=0)
            deviation[recorded] = np.sqrt(found.variance)
            bias[recorded] = found.bias
        deviations.append(deviation.reshape(-1, 3))
        biases.append(bias.reshape(-1, 3))
    return ArrayNoise(deviations[0], deviations[1], biases[0], biases[1], array.rate)
