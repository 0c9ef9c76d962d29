"""The time offset between IMU and GNSS by accelerations, before anything else is known.

In pieces of some seconds the gyros hold the axes of an IMU together and the mean force tells the
level. What is left of the forces is the acceleration over ground but for a turn about the
vertical, which is free in every piece: so neither heading nor mounting nor drift plays a part.
The changes of velocity that the IMU felt are held against those that GNSS saw, for every lag.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.data import GnssRecording, ImuRecording
from schuler.navigation.preparation.moving_start import attitude_history
from schuler.navigation.preparation.rest import level_from_gravity
from schuler.types import FloatArray

PIECE = 12.0
"""Seconds that gyros hold without a correction."""
SPAN = 2.0
"""Seconds over which changes of velocity are compared."""
RECORD = 20.0
"""Samples a second that are compared."""
REACH = 2.0
LAG_STEP = 0.05
LONGEST = 1200.0
"""Seconds of a drive that are looked at."""
LEAST_CHANGE = 0.7
"""Changes of velocity that tell something, m/s, and at least four standard deviations."""
FEWEST = 15
"""Changes."""
RELATED = 0.6
"""Correlation from which a lag is believed."""
CONVINCING = 6.0
"""Gain of log-likelihood over lags further away than `APART` at which it is believed, too."""
APART = 0.3


def find_felt_lag(imu: ImuRecording, gnss: GnssRecording) -> float | None:
    """Return seconds to add to GNSS time so that it fits what the IMU felt; None: not told."""
    if gnss.velocity is None or gnss.size < FEWEST:
        return None
    stop = float(imu.time[0]) + LONGEST
    lags = np.arange(-REACH, REACH + 0.5 * LAG_STEP, LAG_STEP)
    first, second = _changes(gnss)
    seen = (gnss.velocity[second, :2] - gnss.velocity[first, :2]) @ np.array([1.0, 1.0j])
    power_felt, product = np.zeros(lags.size), np.zeros(lags.size)
    power_seen, count = 0.0, 0
    bias = np.median(imu.gyro, axis=0)
    for begin in np.arange(float(imu.time[0]), min(float(imu.time[-1]), stop) - PIECE, PIECE):
        inside = (gnss.time[first] > begin + REACH) & (gnss.time[second] < begin + PIECE + REACH)
        if not inside.any():
            continue
        part = imu.between(begin, begin + PIECE + 2.0 * REACH)
        if part.size < PIECE:
            continue
        time, velocity = _felt(part, bias)
        ends = gnss.time[second[inside]], gnss.time[first[inside]]
        moved = [np.interp(t[None] + lags[:, None], time, velocity) for t in ends]
        felt, there = moved[0] - moved[1], seen[inside]
        product += np.abs(felt.conj() @ there)
        power_felt += (np.abs(felt) ** 2).sum(axis=1)
        power_seen += float((np.abs(there) ** 2).sum())
        count += int(inside.sum())
    if count < FEWEST or not power_felt.min() > 0.0:
        return None
    return _peak(lags, product, power_felt, power_seen, count)


def _peak(
    lags: FloatArray, product: FloatArray, felt: FloatArray, seen: float, count: int
) -> float | None:
    relation = product / np.sqrt(felt * seen)
    best = int(np.argmax(relation))
    if not 0 < best < lags.size - 1 or relation[best] < RELATED:
        return None
    left = 1.0 - relation**2
    others = left[np.abs(lags - lags[best]) > APART]
    if 0.5 * count * np.log(others.min() / left[best]) < CONVINCING:
        return None
    a, b, c = relation[best - 1 : best + 2]
    shift = 0.5 * (a - c) / (a - 2.0 * b + c)
    return float(lags[best] + shift * LAG_STEP)


def _changes(gnss: GnssRecording) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of epochs about `SPAN` apart between which the velocity changed for sure."""
    assert gnss.velocity is not None
    assert gnss.velocity_sd is not None
    step = max(1, round(SPAN / float(np.median(np.diff(gnss.time)))))
    # neighbours share most of their change: four in a span
    first = np.arange(0, gnss.size - step, max(step // 4, 1))
    second = first + step
    change = np.linalg.norm(gnss.velocity[second, :2] - gnss.velocity[first, :2], axis=1)
    sd = np.nan_to_num(gnss.velocity_sd[:, :2].max(axis=1), nan=0.0, posinf=1e9)
    sure = change > np.maximum(LEAST_CHANGE, 4.0 * np.hypot(sd[first], sd[second]))
    near = gnss.time[second] - gnss.time[first] < 2.0 * SPAN
    return first[sure & near], second[sure & near]


def _felt(part: ImuRecording, bias: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Times, and the horizontal velocity that a piece felt by then (complex, any azimuth)."""
    group = max(round(part.rate / RECORD), 1)
    count = (part.size - 1) // group
    stop = count * group + 1
    step = np.diff(part.time[:stop])
    time = part.time[:stop:group]
    long = np.diff(time)[:, None]
    turn = ((part.gyro[1:stop] - bias) * step[:, None]).reshape(count, group, 3).sum(axis=1)
    force = part.accel[1:stop].reshape(count, group, 3).mean(axis=1)
    flat = np.einsum("kij,kj->ki", attitude_history(turn), force)
    level = level_from_gravity((flat * long).sum(axis=0) / long.sum())
    push = (flat @ level[:2].T) @ np.array([1.0, 1.0j])
    velocity = np.concatenate([[0.0], np.cumsum(push * long[:, 0])])
    return time, velocity
