"""Rest at the beginning of a recording, and what it tells: level and the bias of the gyros."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.data import GnssRecording, ImuRecording
from schuler.earth import ned_from_geodetic
from schuler.types import FloatArray

# a vehicle at rest shows less than this in one-second means, engine running or not
REST_ACCEL = 0.15
REST_GYRO = np.radians(0.7)
REST_SPEED = 0.3
SHORTEST_REST = 2.0
# fixes that are so much further apart (standard deviations and m) and as fast (m/s) went there
WANDER, SHORTEST_WAY, CREEPING = 3.0, 1.0, 0.1
# vehicles on their way shake an IMU: one that feels less than this in a second (standard
# deviations), and less than this share of what it usually feels, stands whatever GNSS says
STILL_ACCEL = 0.1
STILL_GYRO = 0.02
STILL_SHARE = 0.25


def find_initial_rest(imu: ImuRecording, gnss: GnssRecording) -> tuple[float, float] | None:
    """Find the time at rest at the beginning of a recording."""
    block = max(round(imu.rate), 1)
    count = imu.size // block
    if count < 2:
        return None
    gyro = imu.gyro[: count * block].reshape(count, block, 3).mean(axis=1)
    accel = imu.accel[: count * block].reshape(count, block, 3).mean(axis=1)
    ends = imu.time[block - 1 : count * block : block]
    quiet = np.ones(count, dtype=bool)
    quiet &= np.abs(gyro - np.median(gyro[: min(count, 10)], axis=0)).max(axis=1) < REST_GYRO
    quiet &= np.abs(accel - np.median(accel[: min(count, 10)], axis=0)).max(axis=1) < REST_ACCEL
    if gnss.velocity is not None:
        moving = gnss.time[moves(gnss)]
        second = np.searchsorted(ends, moving)
        moving = moving[~np.append(_still(imu, count, block), False)[np.minimum(second, count)]]
        if moving.size:
            # half a second for the filters and delays of receivers
            quiet &= ends < moving[0] - 0.5
    stop = count if quiet.all() else int(np.argmin(quiet))
    begin = float(imu.time[0])
    while stop >= SHORTEST_REST and _went_away(gnss, begin, float(ends[stop - 1])):
        stop = int(0.6 * stop)
    if stop < SHORTEST_REST:
        return None
    return begin, float(ends[stop - 1])


def _went_away(gnss: GnssRecording, begin: float, end: float) -> bool:
    """Whether fixes of a time at rest end where they did not begin: slow and steady creeping."""
    inside = np.flatnonzero((gnss.time >= begin) & (gnss.time <= end))
    if inside.size < 6:
        return False
    third = inside.size // 3
    local = ned_from_geodetic(gnss.position[inside], gnss.position[inside[0]])[:, :2]
    away = np.linalg.norm(local[-third:].mean(axis=0) - local[:third].mean(axis=0))
    sd = 1.0
    if gnss.position_sd is not None:
        claimed = gnss.position_sd[inside][:, :2]
        sd = float(np.max(np.where(np.isfinite(claimed), claimed, 1.0)))
    seconds = float(gnss.time[inside[-third:]].mean() - gnss.time[inside[:third]].mean())
    return bool(away > WANDER * sd + SHORTEST_WAY and away > CREEPING * seconds)


def _still(imu: ImuRecording, count: int, block: int) -> NDArray[np.bool_]:
    """Seconds in which an IMU hardly shakes: velocities of GNSS are noise then."""
    still = np.ones(count, dtype=bool)
    for values, most in ((imu.accel, STILL_ACCEL), (imu.gyro, STILL_GYRO)):
        shaken = values[: count * block].reshape(count, block, 3).std(axis=1).max(axis=1)
        still &= shaken < min(most, STILL_SHARE * float(np.median(shaken)))
    return still


def moves(gnss: GnssRecording, least: float = REST_SPEED) -> NDArray[np.bool_]:
    """Epochs at which GNSS is sure to move: this one and the next are clear of their noise."""
    assert gnss.velocity is not None
    speed = np.linalg.norm(gnss.velocity[:, :2], axis=1)
    threshold = np.full(gnss.size, least)
    if gnss.velocity_sd is not None:
        sd = gnss.velocity_sd[:, :2].max(axis=1)
        threshold = np.maximum(threshold, np.where(np.isfinite(sd), 4.0 * sd, 0.0))
    over: NDArray[np.bool_] = np.asarray(speed > threshold)
    over[:-1] &= over[1:]
    return over


def level_from_gravity(specific_force: FloatArray) -> FloatArray:
    """Rotation into a level frame whose azimuth is arbitrary. Groves (5.101)."""
    down = -specific_force / np.linalg.norm(specific_force)
    axis = np.array([1.0, 0.0, 0.0]) if abs(down[0]) < 0.9 else np.array([0.0, 1.0, 0.0])
    first = axis - down * (axis @ down)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(down, first), down])
