"""What the batch filter reads off a recording, sample by sample: constraints, vibration, gaps.

The same moments and values as `VehicleConstraint.rows` and `vibration_level` give for the whole
recording; the latter needs to be told what is typical, which only a recording knows.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from schuler.data import ImuRecording
from schuler.navigation.aiding.schedule import VEHICLE_VELOCITY, ZERO_RATE, ZERO_VELOCITY
from schuler.navigation.aiding.standstill import (
    REST_INTERVAL,
    REST_RATE_SD,
    REST_VELOCITY_SD,
    STEADY_ACCEL,
    STEADY_GYRO,
    shake_level,
)
from schuler.navigation.aiding.vehicle import VehicleConstraint
from schuler.navigation.preparation.gaps import (
    SHORTEST_GAP,
    SHORTEST_GAP_STEPS,
    find_gaps,
    interpolation_variance,
)
from schuler.navigation.tuning.vibration import LARGEST_RATIO, VibrationResponse, mean_squares
from schuler.types import FloatArray

Row = tuple[float, int, FloatArray, FloatArray]
"""Time, kind, value (3,) and variance (3,) of a measurement."""


class ConstraintStream:
    """The constraints of a vehicle as its samples come in.

    Parameters
    ----------
    vehicle : VehicleConstraint
        Which constraints, and how well they hold.
    gyro_density : (3,) ndarray
        White noise of the gyros, rad/s/sqrt(Hz).
    rate : float
        Samples a second.
    """

    __slots__ = (
        "_across",
        "_begin",
        "_block",
        "_count",
        "_gyro_variance",
        "_last_rate",
        "_longest",
        "_recent",
        "_rolled",
        "_stamps",
        "_stride",
        "_totals",
        "_vehicle",
    )

    def __init__(self, vehicle: VehicleConstraint, gyro_density: FloatArray, rate: float) -> None:
        self._vehicle = vehicle
        self._gyro_variance = gyro_density**2
        self._block = max(round(rate), 2)
        # no second across a gap
        self._longest = 2.2 * self._block / rate
        self._stride = max(round(REST_INTERVAL * rate), 1)
        self._across = np.array([np.inf, vehicle.lateral_sd**2, vehicle.vertical_sd**2])
        self._begin = self._last_rate = -np.inf
        self._count = self._rolled = 0
        # sums of gyro and accelerometer before each of the last samples
        self._totals = np.zeros((2 * self._block + 2, 6))
        self._stamps = np.zeros(2 * self._block + 2)
        self._recent = np.zeros((self._block, 6))

    def rows(self, time: float, gyro: FloatArray, accel: FloatArray) -> Iterator[Row]:
        """Yield the measurements that a sample brings with it."""
        if self._count == 0:
            self._begin = time
        if "nhc" in self._vehicle.constraints:
            while (due := self._begin + 1.0 + self._rolled * self._vehicle.interval) <= time:
                self._rolled += 1
                yield due, VEHICLE_VELOCITY, np.zeros(3), self._across
        if "zupt" in self._vehicle.constraints:
            yield from self._rest(time, gyro, accel)
        self._count += 1

    def _rest(self, time: float, gyro: FloatArray, accel: FloatArray) -> Iterator[Row]:
        k, block, places = self._count, self._block, len(self._totals)
        before = self._totals[k % places]
        after = self._totals[(k + 1) % places]
        after[:3], after[3:] = before[:3] + gyro, before[3:] + accel
        self._stamps[k % places] = time
        recent = self._recent[k % block]
        recent[:3], recent[3:] = gyro, accel
        if k < 2 * block or (k - 2 * block) % self._stride:
            return
        if time - self._stamps[(k - 2 * block) % places] >= self._longest:
            return
        middle = self._totals[(k + 1 - block) % places]
        last = (after - middle) / block
        change = np.abs(last - (middle - self._totals[(k + 1 - 2 * block) % places]) / block)
        if not (change[:3].max() < STEADY_GYRO and change[3:].max() < STEADY_ACCEL):
            return
        standing, recent = self._vehicle.standing, self._recent
        if standing is not None and shake_level(recent[:, :3], recent[:, 3:]) > standing.limit:
            return
        yield time, ZERO_VELOCITY, np.zeros(3), np.full(3, REST_VELOCITY_SD**2)
        if time - self._last_rate >= 1.0 - 1e-6:
            self._last_rate = time
            down = -last[3:] / np.linalg.norm(last[3:])
            variance = float(down**2 @ self._gyro_variance) + REST_RATE_SD**2
            yield time, ZERO_RATE, last[:3].copy(), np.array([np.inf, np.inf, variance])


class VibrationStream:
    """The strength of vibration as samples come in, against what is typical.

    Parameters
    ----------
    response : VibrationResponse
        How the noise follows it.
    taught : ImuRecording
        Says what is typical of the sensor in its vehicle.
    """

    __slots__ = (
        "_before",
        "_centre",
        "_count",
        "_exponent",
        "_places",
        "_ring",
        "_total",
        "_typical",
    )

    def __init__(self, response: VibrationResponse, taught: ImuRecording) -> None:
        mean, self._places = mean_squares(taught)
        typical = np.maximum(np.median(mean, axis=0), 1e-300)
        limit = math.log(LARGEST_RATIO)
        level = np.clip(np.log(np.maximum(mean / typical, 1e-300)), -limit, limit)
        self._typical = typical
        self._centre = level.mean(axis=0)
        self._exponent = np.repeat([response.accel, response.gyro], 3)
        self._ring = np.zeros((self._places + 1, 6))
        self._total, self._before = np.zeros(6), np.zeros(6)
        self._count = 0

    def scale(self, gyro: FloatArray, accel: FloatArray) -> FloatArray:
        """Return the factors on the squared noise densities for a sample."""
        values = np.concatenate([accel, gyro])
        if self._count:
            self._total = self._total + (values - self._before) ** 2
        self._before = values
        self._count += 1
        places = len(self._ring)
        self._ring[self._count % places] = self._total
        held = min(self._count, self._places)
        mean = (self._total - self._ring[(self._count - held) % places]) / held
        limit = math.log(LARGEST_RATIO)
        level = np.log(np.maximum(mean / self._typical, 1e-300)).clip(-limit, limit)
        return np.asarray(np.exp((level - self._centre) * self._exponent))


class GapNoise:
    """What may have happened while no samples came.

    Parameters
    ----------
    white_density : (6,) ndarray
        Of the channels, accelerometers first.
    taught : ImuRecording
        Says how much motion an interpolation of some length misses, see preparation/gaps.py.
    """

    __slots__ = ("_density", "_taught", "shortest", "step")

    def __init__(self, white_density: FloatArray, taught: ImuRecording) -> None:
        self._density = np.maximum(white_density, 1e-12)
        self._taught = taught
        self.step = 1.0 / taught.rate
        self.shortest = max(SHORTEST_GAP, SHORTEST_GAP_STEPS * self.step)

    def scale(self, seconds: float) -> FloatArray:
        """Return the factors on the squared noise densities for a sample that bridges a gap."""
        missed = interpolation_variance(self._taught, seconds, find_gaps(self._taught))
        return np.asarray(1.0 + missed / seconds / self._density**2)
