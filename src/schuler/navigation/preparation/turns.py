"""Turns of an IMU about the vertical against turns of the course that GNSS sees.

A vehicle on wheels turns with its course. Where it does, the two show whether the axes of the IMU
are what they claim to be (gravity points up and gyros turn the right way round), how far the two
clocks are apart, and whether one of them jumped. No attitude is needed: down is where the mean
force points from.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from schuler.data import GnssRecording, ImuRecording
from schuler.types import FloatArray

BLOCK_RATE = 10.0
"""Blocks a second into which the IMU is averaged."""
DOWN_MEMORY = 4.0
"""Seconds over which the direction of down is averaged."""
SLOWEST = 4.0
"""Below this speed a course is mostly noise and lever arm, m/s."""
SPAN = 1.0
"""Turns are compared over about this time, s."""
REACH = 3.0
LAG_STEP = 0.1
"""Lags that are tried, s."""
LEAST_TURN = np.radians(180.0)
"""Sum of the turns of the course that tells anything."""
RELATED = 0.8
"""Correlation at which IMU and course are taken to turn together."""
FEWEST = 20
"""Turns."""
CONVINCING = 30.0
"""Gain of log-likelihood at which two lags are believed instead of one."""
LARGEST_TURN = 0.3
"""Misfit of a turn beyond which it counts no more, rad."""
LEAST_JUMP = 0.4
"""Seconds: antennas ahead of the rear axle make the course early by up to this."""


@dataclass(frozen=True, slots=True)
class LagChange:
    """One lag before, another one after.

    Parameters
    ----------
    time : float
        IMU time at which it changed, about, s.
    before, after : float
        Seconds that the IMU's stamps are late against GNSS.
    """

    time: float
    before: float
    after: float


@dataclass(frozen=True, slots=True)
class TurnComparison:
    """Turns of the IMU about the vertical against turns of the course.

    Parameters
    ----------
    correlation : float
        At the best lag; negative where they turn against each other; NaN where too little turns.
    slope : float
        Turn of the course for one of the IMU.
    lag : float
        Seconds that the IMU's stamps are late against GNSS.
    seconds : float
        Time that was compared.
    change : LagChange or None
        Where two lags fit much better than one.
    log_likelihood : float
        Of the turns at the best single lag, wild ones clipped; for comparing stamps.
    """

    correlation: float
    slope: float
    lag: float
    seconds: float
    change: LagChange | None = None
    log_likelihood: float = float("nan")

    @property
    def together(self) -> bool:
        """Whether the IMU turns as the course does, or exactly against it."""
        return bool(abs(self.correlation) > RELATED and 0.6 < abs(self.slope) < 1.6)


NOTHING_TOLD = TurnComparison(float("nan"), float("nan"), float("nan"), 0.0)


def compare_turns(imu: ImuRecording, gnss: GnssRecording) -> TurnComparison:
    """Compare turns over a second each, for every lag within three seconds."""
    if gnss.velocity is None or imu.duration < 4.0 * REACH:
        return NOTHING_TOLD
    time, angle = turned_about_down(imu)
    first, second, course = _turns_of_course(gnss)
    room = gnss.time[first] > time[0] + REACH
    room &= gnss.time[second] < time[-1] - REACH
    first, second, course = first[room], second[room], course[room]
    if first.size < FEWEST or np.abs(course).sum() < LEAST_TURN:
        return NOTHING_TOLD
    span = gnss.time[second] - gnss.time[first]
    lags = np.arange(-REACH, REACH + 0.5 * LAG_STEP, LAG_STEP)
    felt = np.stack(
        [
            np.interp(gnss.time[second] + lag, time, angle)
            - np.interp(gnss.time[first] + lag, time, angle)
            for lag in lags
        ]
    )
    # course = slope felt + bias span, for every lag
    along = felt - (felt @ span / (span @ span))[:, None] * span
    seen = course - (course @ span / (span @ span)) * span
    power, total = np.einsum("li,li->l", along, along), float(seen @ seen)
    if total <= 0.0 or power.min() <= 0.0:
        return NOTHING_TOLD
    product = along @ seen
    relation = product / np.sqrt(power * total)
    best = int(np.argmax(np.abs(relation)))
    found = TurnComparison(
        correlation=float(relation[best]),
        slope=float(product[best] / power[best]),
        lag=float(lags[best]),
        seconds=float(span.sum()),
    )
    left = (seen - np.sign(found.slope) * along) ** 2
    change = _change_of_lag(left, lags, gnss.time[first])
    spread = float(np.mean(np.minimum(left[best], LARGEST_TURN**2)))
    return replace(found, change=change, log_likelihood=-0.5 * first.size * np.log(spread))


def turned_about_down(imu: ImuRecording) -> tuple[FloatArray, FloatArray]:
    """Angle that an IMU has turned about the vertical, by its own gravity."""
    group = max(int(imu.rate / BLOCK_RATE), 1)
    count = (imu.size - 1) // group
    stop = count * group + 1
    step = np.diff(imu.time[:stop])
    time = imu.time[:stop:group]
    force = imu.accel[1:stop].reshape(count, group, 3).mean(axis=1)
    turn = (imu.gyro[1:stop] * step[:, None]).reshape(count, group, 3).sum(axis=1)
    half = max(round(0.5 * DOWN_MEMORY * imu.rate / group), 1)
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(force, axis=0)])
    rows = np.arange(count)
    mean = total[np.minimum(rows + half, count)] - total[np.maximum(rows - half, 0)]
    down = -mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-12)
    angle = np.concatenate([[0.0], np.cumsum(np.einsum("ij,ij->i", turn, down))])
    return time, angle


def _turns_of_course(
    gnss: GnssRecording,
) -> tuple[NDArray[np.int64], NDArray[np.int64], FloatArray]:
    """Pairs of epochs about a second apart, and by how much the course turned between them."""
    assert gnss.velocity is not None
    step = max(1, round(SPAN / float(np.median(np.diff(gnss.time))))) if gnss.size > 1 else 1
    first = np.arange(0, gnss.size - step, step)
    second = first + step
    fast = np.linalg.norm(gnss.velocity[:, :2], axis=1) > SLOWEST
    span = gnss.time[second] - gnss.time[first]
    good = fast[first] & fast[second] & (span < 3.0 * SPAN)
    first, second = first[good], second[good]
    course = gnss.velocity[:, 0] + 1j * gnss.velocity[:, 1]
    return first, second, np.angle(course[second] * np.conj(course[first]))


def _change_of_lag(left: FloatArray, lags: FloatArray, time: FloatArray) -> LagChange | None:
    """Best split of the turns into two stretches with a lag each. `left` (lags, turns): squares."""
    count = time.size
    # one wild turn is no proof
    limit = 9.0 * float(np.median(left[int(np.argmin(left.sum(axis=1)))])) / 0.455
    total = np.cumsum(np.minimum(left, max(limit, 1e-12)), axis=1)
    whole = total[:, -1].min()
    before = total.min(axis=0)
    after = (total[:, -1:] - total).min(axis=0)
    margin = FEWEST // 2
    if count < 4 * margin:
        return None
    both = (before + after)[margin - 1 : count - margin]
    k = int(np.argmin(both)) + margin - 1
    gain = 0.5 * count * np.log(whole / max(before[k] + after[k], 1e-300))
    one = lags[int(np.argmin(total[:, k]))]
    two = lags[int(np.argmin(total[:, -1] - total[:, k]))]
    if gain < CONVINCING or abs(two - one) < LEAST_JUMP:
        return None
    return LagChange(float(time[k + 1]), float(one), float(two))
