"""A vehicle that stands: no velocity and no rate while the IMU feels no motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.data import ImuRecording
from schuler.navigation.aiding.schedule import (
    ZERO_RATE,
    ZERO_VELOCITY,
    AidingSchedule,
    merge_schedules,
    schedule_rows,
)
from schuler.types import FloatArray

# one-second means of a vehicle at rest change by less from one second to the next
STEADY_ACCEL = 0.08
STEADY_GYRO = np.radians(0.35)
# what may be left of velocity (m/s) and rate (rad/s) in a vehicle at rest
REST_VELOCITY_SD = 0.05
REST_RATE_SD = 5e-4
# seconds between zero velocities
REST_INTERVAL = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class StandingJudgement:
    """At which moments without felt motion a vehicle stands, and at which it creeps."""

    time: FloatArray  # (k,): of the moments, s
    standing: NDArray[np.bool_]  # (k,): whether it stands
    limit: float  # of the shaking below which it does, for moments to come; see `shake_level`.

    def holds(self, time: FloatArray) -> NDArray[np.bool_]:
        """Whether the vehicle stands at these times, by the nearest moments."""
        after = np.clip(np.searchsorted(self.time, time), 1, max(self.time.size - 1, 1))
        before_is_nearer = time - self.time[after - 1] < self.time[after % self.time.size] - time
        return self.standing[np.where(before_is_nearer, after - 1, after % self.time.size)]


@dataclass(frozen=True, slots=True, eq=False)
class Standstill:
    """No velocity and no rate at moments without motion."""

    imu: ImuRecording  # in which they are looked for
    gyro_density: FloatArray  # (3,): white noise of the gyros, rad/s/sqrt(Hz)
    judgement: StandingJudgement | None = None  # leaves out moments at which the vehicle creeps

    def rows(self) -> AidingSchedule:
        """Return a zero velocity at every such moment, and a zero rate once a second."""
        rest = detect_standstill(self.imu)
        if self.judgement is not None:
            rest = rest.select(self.judgement.holds(rest.time))
        none = np.zeros((rest.time.size, 3))
        velocity = schedule_rows(rest.time, ZERO_VELOCITY, none, REST_VELOCITY_SD**2)
        # means of whole seconds must not overlap, or their noise would be counted twice
        once = _apart(rest.time, 1.0 - 1e-6)
        variance = np.full((once.size, 3), np.inf)
        variance[:, 2] = rest.down[once] ** 2 @ self.gyro_density**2 + REST_RATE_SD**2
        rate = schedule_rows(rest.time[once], ZERO_RATE, rest.gyro[once], variance)
        return merge_schedules([velocity, rate], -np.inf, np.inf)


@dataclass(frozen=True, slots=True, eq=False)
class StandingMoments:
    """Moments at which an IMU feels no motion, and the mean of its gyros up to them."""

    time: FloatArray  # (k,): seconds
    gyro: FloatArray  # (k, 3): mean over the second before, rad/s, as measured
    # (k, 3): direction of gravity in IMU axes, by the mean force over the second before
    down: FloatArray

    def select(self, keep: NDArray[np.bool_]) -> StandingMoments:
        """Return some of them."""
        return StandingMoments(self.time[keep], self.gyro[keep], self.down[keep])


def shake_level(gyro: FloatArray, accel: FloatArray) -> float:
    """How much a second of samples (n, 3) shakes: logarithm of the variances' product."""
    floor = 1e-300
    return float(np.log(gyro.var(axis=0).sum() + floor) + np.log(accel.var(axis=0).sum() + floor))


def shaking(imu: ImuRecording, time: FloatArray) -> FloatArray:
    """Return the shake level of the second before each of some times."""
    block = max(round(imu.rate), 2)
    stops = np.searchsorted(imu.time, time + 1e-9)
    parts = [slice(max(s - block, 0), s) for s in stops.tolist()]
    return np.array([shake_level(imu.gyro[p], imu.accel[p]) for p in parts])


def detect_standstill(imu: ImuRecording) -> StandingMoments:
    """Find moments at which force and rate have not changed for two seconds."""
    n, block = imu.size, max(round(imu.rate), 2)
    ends = np.arange(2 * block, n, max(round(REST_INTERVAL * imu.rate), 1))
    # no second across a gap
    span = imu.time[ends] - imu.time[ends - 2 * block]
    ends = ends[span < 2.2 * block / imu.rate]

    def means(values: FloatArray) -> tuple[FloatArray, FloatArray]:
        total = np.concatenate([np.zeros((1, 3)), np.cumsum(values, axis=0)])
        last = (total[ends + 1] - total[ends + 1 - block]) / block
        before = (total[ends + 1 - block] - total[ends + 1 - 2 * block]) / block
        return last, np.abs(last - before).max(axis=1)

    gyro, turn = means(imu.gyro)
    force, push = means(imu.accel)
    steady = (turn < STEADY_GYRO) & (push < STEADY_ACCEL)
    down = -force[steady] / np.linalg.norm(force[steady], axis=1, keepdims=True)
    return StandingMoments(time=imu.time[ends[steady]], gyro=gyro[steady], down=down)


def _apart(time: FloatArray, least: float) -> NDArray[np.int64]:
    """Indices of moments at least so far apart."""
    kept: list[int] = []
    for k, t in enumerate(time):
        if not kept or t - time[kept[-1]] >= least:
            kept.append(k)
    return np.array(kept, dtype=np.int64)
