"""Which samples may be used for what: saturated ones with a margin, those at rest."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from schuler.arrays.clocks.resampling import low_pass
from schuler.data import ImuArray, ImuRecording
from schuler.screening.motion import look_at_rest
from schuler.screening.values import saturation_limits
from schuler.types import BoolArray

MARGIN = 3
"""Samples on both sides of a saturated one that are not used either."""
NEAR = 2e-3
"""Share of the range by which a value may stay below its end and still count as saturated."""
STUCK = 0.5
"""Seconds of one and the same value that no living sensor shows."""
SETTLE = 0.5
"""Seconds at both ends of a rest that are not used."""
SHORTEST = 1.0
"""Seconds of rest that are used at least."""


@dataclass(frozen=True, slots=True, eq=False)
class Rests:
    """When an array stood still."""

    rows: BoolArray  # (n,): at rest, the ends left out
    pose: NDArray[np.int64]  # (n,): number of the rest, from zero; -1 in motion.

    @property
    def count(self) -> int:
        """Number of rests."""
        return int(self.pose.max()) + 1


def mask_saturated(array: ImuArray, margin: int = MARGIN) -> tuple[ImuArray, NDArray[np.int64]]:
    """Take out saturated samples with a margin, before anything is interpolated through them."""
    arrays = [np.array(array.gyro), np.array(array.accel)]
    counts = np.zeros((array.count, 2), dtype=np.int64)
    for s, values in enumerate(arrays):
        everything = values[np.isfinite(values)]
        ends = saturation_limits(everything) if everything.size else (-np.inf, np.inf)
        for i in range(array.count):
            bad = np.zeros(array.size, dtype=bool)
            for axis in range(3):
                signal = values[:, i, axis]
                known = np.isfinite(signal)
                if not known.any():
                    continue
                low, high = saturation_limits(signal[known])
                low, high = max(low, ends[0]), min(high, ends[1])
                with np.errstate(invalid="ignore"):
                    bad |= (signal >= high - NEAR * abs(high)) | (signal <= low + NEAR * abs(low))
            if bad.any():
                wide = np.convolve(bad, np.ones(2 * margin + 1), mode="same") > 0.5
                counts[i, s] = np.count_nonzero(wide)
                values[wide, i] = np.nan
    if not counts.any():
        return array, counts
    line = f"{int(counts[:, 0].max())} rows around saturated samples taken out of some gyros"
    masked = replace(array, gyro=arrays[0], accel=arrays[1], history=(*array.history, line))
    return masked, counts


def mask_stuck(array: ImuArray) -> tuple[ImuArray, NDArray[np.int64]]:
    """Take out stretches in which a triad shows the same three values again and again."""
    arrays = [np.array(array.gyro), np.array(array.accel)]
    counts = np.zeros((array.count, 2), dtype=np.int64)
    least = max(20, round(STUCK * array.rate))
    for s, values in enumerate(arrays):
        for i in range(array.count):
            same = np.concatenate([[False], (values[1:, i] == values[:-1, i]).all(axis=1), [False]])
            starts = np.flatnonzero(same[1:] & ~same[:-1])
            stops = np.flatnonzero(~same[1:] & same[:-1]) + 1
            for a, b in zip(starts, stops, strict=True):
                if b - a >= least:
                    counts[i, s] += b - a
                    values[a:b, i] = np.nan
    if not counts.any():
        return array, counts
    line = f"{int(counts.sum())} rows of stuck values taken out"
    return replace(array, gyro=arrays[0], accel=arrays[1], history=(*array.history, line)), counts


def find_rests(array: ImuArray) -> Rests:
    """Find when the array stood still."""
    best = int(np.argmin(np.isnan(array.gyro).any(axis=2).sum(axis=0)))
    imu = _whole(array, best)
    found = look_at_rest(imu, array.rate)
    rows = np.zeros(array.size, dtype=bool)
    pose = np.full(array.size, -1, dtype=np.int64)
    number = 0
    for start, stop in found.rest:
        a, b = np.searchsorted(array.time, [start + SETTLE, stop - SETTLE])
        if array.time[min(b, array.size - 1)] - array.time[a] < SHORTEST:
            continue
        rows[a:b], pose[a:b] = True, number
        number += 1
    return Rests(rows, pose)


def _whole(array: ImuArray, imu: int) -> ImuRecording:
    """One IMU with its short gaps bridged, good enough to see whether it moves."""
    columns = []
    for values in (array.gyro[:, imu], array.accel[:, imu]):
        filled = np.array(values)
        for column in filled.T:
            gaps = np.isnan(column)
            if gaps.any() and not gaps.all():
                column[gaps] = np.interp(array.time[gaps], array.time[~gaps], column[~gaps])
        columns.append(filled)
    return ImuRecording(array.time, columns[0], columns[1], name=array.names[imu])


def low_passed(array: ImuArray, bandwidth: float) -> ImuArray:
    """Low-pass all sensors of an array without delay."""
    gyro, accel = (
        low_pass(array.time, v.reshape(array.size, -1), bandwidth).reshape(v.shape)
        for v in (array.gyro, array.accel)
    )
    line = f"low-passed to {bandwidth:g} Hz"
    return replace(array, gyro=gyro, accel=accel, history=(*array.history, line))
