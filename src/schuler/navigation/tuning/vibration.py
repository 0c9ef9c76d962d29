"""Noise that follows vibration: engines, roads and propellers shake a MEMS sensor louder at times.

Vibration above half the sampling rate is folded into the record and cannot be told from noise,
but its strength can: by the mean square of the differences of neighbouring samples over the last
second. The white noise of the filter follows it with an exponent that the drive decides (0: not
at all, 1: in proportion). The strength itself looks at the past only; what is called typical, one
number a channel, comes from the whole record and is absorbed by the tuned density. Spec 10,
"vibration, dynamics".
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schuler.data import ImuRecording
from schuler.types import FloatArray

# seconds over which the strength is measured
MEMORY = 1.0
# the strength of a second against the typical one is believed within this factor
LARGEST_RATIO = 100.0


@dataclass(frozen=True, slots=True)
class VibrationResponse:
    """Exponents with which the squared white-noise densities follow the strength of vibration."""

    accel: float = 0.0
    gyro: float = 0.0

    @property
    def active(self) -> bool:
        """Whether the noise changes at all."""
        return self.accel != 0.0 or self.gyro != 0.0

    def white_scale(self, level: FloatArray) -> FloatArray:
        """Return what multiplies the squared densities sample by sample."""
        exponents = np.repeat([self.accel, self.gyro], 3)
        scale: FloatArray = np.exp(level * exponents)
        return scale


def vibration_level(imu: ImuRecording) -> FloatArray:
    """Strength of vibration at every sample against the typical one of the recording."""
    mean, _ = mean_squares(imu)
    typical = np.maximum(np.median(mean, axis=0), 1e-300)
    limit = np.log(LARGEST_RATIO)
    level = np.clip(np.log(np.maximum(mean / typical, 1e-300)), -limit, limit)
    centred: FloatArray = level - level.mean(axis=0)
    return centred


def mean_squares(imu: ImuRecording) -> tuple[FloatArray, int]:
    """Return the mean square difference of neighbouring samples over the last second."""
    values = np.concatenate([imu.accel, imu.gyro], axis=1)
    square = np.diff(values, axis=0, prepend=values[:1]) ** 2
    total = np.concatenate([np.zeros((1, 6)), np.cumsum(square, axis=0)])
    stop = np.arange(1, imu.size + 1)
    places = max(round(MEMORY * imu.rate), 2)
    start = np.maximum(stop - places, 0)
    return (total[stop] - total[start]) / (stop - start)[:, None], places


def level_at(time: FloatArray, imu: ImuRecording, level: FloatArray) -> FloatArray:
    """Pick the level of a full-rate recording at the stamps of a slower one."""
    last = np.searchsorted(imu.time, time, side="right") - 1
    return np.ascontiguousarray(level[np.clip(last, 0, imu.size - 1)])
