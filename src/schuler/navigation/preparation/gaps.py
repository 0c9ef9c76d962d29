"""Motion that an IMU did not see: gaps, and axes that stood still while the vehicle did not.

What is missing is interpolated between what was felt just before and just after. How wrong that
is, the rest of the recording tells: the same interpolation is tried over stretches of the same
length where the motion was seen. The filter gets its variance as noise of that time, so that its
covariance opens up by what can have happened, and closes again with the aiding after it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from schuler.data import ImuRecording
from schuler.types import FloatArray

SHORTEST_GAP = 0.1
"""Seconds; a few lost samples are no missing motion."""
SHORTEST_GAP_STEPS = 5.0
"""Steps."""
EDGE = 0.1
"""Seconds before and after, the means of which are interpolated."""
MOST_TRIALS = 400
FEWEST_TRIALS = 8
# what may have happened where the recording is too short to tell: rad/s and m/s² of an agile car
ROUGH_RATE = 0.3
ROUGH_FORCE = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class DataGap:
    """A stretch in which some or all axes saw nothing.

    Parameters
    ----------
    start, stop : float
        Last time before and first time after at which everything was seen, s.
    channels : (6,) ndarray of bool
        Which axes, accelerometers first.
    variance : (6,) ndarray
        Of the interpolated increment over the whole stretch, (m/s)² and rad², in IMU axes; zero
        for the others.
    gap : bool
        Whether the samples are missing altogether.
    """

    start: float
    stop: float
    channels: NDArray[np.bool_]
    variance: FloatArray
    gap: bool

    @property
    def seconds(self) -> float:
        """How long it lasts."""
        return self.stop - self.start

    @property
    def attitude_sd(self) -> float:
        """Root of the sum of the three variances of the turn, rad."""
        return float(np.sqrt(self.variance[3:].sum()))


def find_gaps(imu: ImuRecording) -> list[tuple[float, float]]:
    """Return times of the last sample before and the first after each gap that matters."""
    step = np.diff(imu.time)
    usual = float(np.median(step))
    gaps = np.flatnonzero(step > max(SHORTEST_GAP, SHORTEST_GAP_STEPS * usual))
    return [(float(imu.time[k]), float(imu.time[k + 1])) for k in gaps]


def interpolation_variance(
    imu: ImuRecording, seconds: float, gaps: Sequence[tuple[float, float]]
) -> FloatArray:
    """Mean square of what an interpolation over a time misses, tried where the motion was seen."""
    time = imu.time
    values = np.concatenate([imu.accel, imu.gyro], axis=1)
    step = np.diff(time)[:, None]
    areas = 0.5 * (values[1:] + values[:-1]) * step
    total = np.concatenate([np.zeros((1, 6)), np.cumsum(areas, axis=0)])

    def at(t: FloatArray) -> FloatArray:
        k = np.clip(np.searchsorted(time, t, side="right") - 1, 0, time.size - 2)
        share = ((t - time[k]) / (time[k + 1] - time[k]))[:, None]
        return np.asarray(total[k] + share * (total[k + 1] - total[k]))

    length = seconds
    while True:
        room = imu.duration - length - 2.0 * EDGE
        if room > 0.0:
            count = int(min(MOST_TRIALS, max(4.0 * room / length, FEWEST_TRIALS)))
            begin = time[0] + EDGE + np.linspace(0.0, room, count)
            clear = np.ones(count, dtype=bool)
            for a, b in gaps:
                clear &= (begin - EDGE > b) | (begin + length + EDGE < a)
            begin = begin[clear]
            if begin.size >= FEWEST_TRIALS:
                break
        length *= 0.5
        if length < 2.0 * EDGE:
            rough = np.repeat([ROUGH_FORCE, ROUGH_RATE], 3) * seconds
            return np.asarray(rough**2)
    first, last = at(begin), at(begin + length)
    before = (first - at(begin - EDGE)) / EDGE
    after = (at(begin + length + EDGE) - last) / EDGE
    missed = last - first - 0.5 * length * (before + after)
    return np.asarray(np.mean(missed**2, axis=0) * (seconds / length) ** 2)


def bridged(imu: ImuRecording, gaps: Sequence[DataGap]) -> ImuRecording:
    """Return a recording whose gaps are bridged by straight lines."""
    if not gaps:
        return imu
    accel, gyro = imu.accel.copy(), imu.gyro.copy()
    time = imu.time
    added: list[FloatArray] = []
    values: list[FloatArray] = []
    step = 1.0 / imu.rate
    for part in gaps:
        a = int(np.searchsorted(time, part.start, side="right"))
        b = int(np.searchsorted(time, part.stop, side="left"))
        width = max(round(EDGE * imu.rate), 1)
        whole = np.concatenate([imu.accel, imu.gyro], axis=1)
        before, after = whole[max(a - width, 0) : a].mean(axis=0), whole[b : b + width].mean(axis=0)
        count = max(round(part.seconds / step) - 1, 1) if part.gap else b - a
        if part.gap:
            stamps = part.start + part.seconds * np.arange(1, count + 1) / (count + 1)
        else:
            stamps = time[a:b]
        share = ((stamps - part.start) / part.seconds)[:, None]
        line = before + share * (after - before)
        if part.gap:
            added.append(stamps)
            values.append(line)
        else:
            for c in np.flatnonzero(part.channels):
                (accel if c < 3 else gyro)[a:b, c % 3] = line[:, c]
    history = (*imu.history, *(_said(p) for p in gaps))
    if not added:
        return replace(imu, accel=accel, gyro=gyro, history=history)
    stamps = np.concatenate([time, *added])
    order = np.argsort(stamps, kind="stable")
    rows = np.concatenate([np.concatenate([accel, gyro], axis=1), *values])[order]
    return replace(
        imu,
        time=stamps[order],
        accel=rows[:, :3],
        gyro=rows[:, 3:],
        temperature=None,
        history=history,
    )


def _said(part: DataGap) -> str:
    what = "gap" if part.gap else "stuck axes"
    return f"{what} from {part.start:.3f} to {part.stop:.3f} s bridged by straight lines"


def gap_noise_density(time: FloatArray, gaps: Sequence[DataGap]) -> FloatArray | None:
    """Squared noise densities that gaps add, sample by sample."""
    if not gaps:
        return None
    added = np.zeros((time.size, 6))
    begin = np.concatenate([[2.0 * time[0] - time[1]], time[:-1]])
    for part in gaps:
        a = int(np.searchsorted(time, part.start, side="right"))
        b = int(np.searchsorted(begin, part.stop, side="left"))
        rows = slice(a, b)
        covered = np.minimum(time[rows], part.stop) - np.maximum(begin[rows], part.start)
        share = covered / (time[rows] - begin[rows])
        added[rows] += share[:, None] * part.variance / part.seconds
    return added
