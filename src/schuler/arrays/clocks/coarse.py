"""The first guess of an offset between two clocks: cross-correlation of rate norms."""

from __future__ import annotations

import numpy as np

from schuler.data import ImuRecording
from schuler.errors import EstimationError
from schuler.types import FloatArray

RATE = 50.0
"""Hz at which the norms are compared; faster recordings are averaged down to it."""
SEGMENT = 60.0
"""Seconds of the livelier parts that are looked for in the other recording."""
TRIES = 5
"""Segments tried, the liveliest first."""
SURE = 0.9
"""Correlation at which no other segment is tried."""
ENOUGH = 0.6
"""Correlation below which the recordings are taken to share no motion."""
MARGIN = 0.02
"""A second lag that correlates within this of the best makes the offset ambiguous."""


def first_offset(reference: ImuRecording, other: ImuRecording) -> tuple[float, float, float]:
    """Find the offset between two clocks by the norms of the rates."""
    rate = min(RATE, reference.rate, other.rate)
    base, base_start = _norms(reference, rate)
    signal, start = _norms(other, rate)
    length = int(min(SEGMENT * rate, signal.size // 2, base.size // 2))
    if length < 20:
        raise EstimationError(
            f"'{reference.name}' and '{other.name}' are too short to compare their clocks",
            expected="some seconds of common motion",
        )
    best = (-1.0, 0, 0, 0.0)
    for first in _lively_segments(signal, length):
        correlation = _correlations(base, signal[first : first + length])
        lag = int(np.argmax(correlation))
        if correlation[lag] > best[0]:
            best = (float(correlation[lag]), first, lag, _rival(correlation, lag, signal, length))
        if best[0] > SURE:
            break
    value, first, lag, rival = best
    if value < ENOUGH:
        raise EstimationError(
            f"'{reference.name}' and '{other.name}' share no motion: their rate norms correlate "
            f"with {max(value, 0.0):.2f} at best",
            expected=f"at least {ENOUGH:g} at some offset",
            cure="check that they are of one body and overlap in time, and move it by hand",
        )
    if rival > value - MARGIN:
        raise EstimationError(
            f"the motion of '{other.name}' repeats itself: several offsets fit it equally well",
            expected="some motion that is not periodic",
            cure="set the clocks within half a period of each other, or cut the recordings",
        )
    fraction = _peak(_correlations(base, signal[first : first + length]), lag)
    offset = base_start + (lag + fraction) / rate - (start + first / rate)
    return offset, start + (first + 0.5 * length) / rate, value


def _norms(imu: ImuRecording, rate: float) -> tuple[FloatArray, float]:
    """Rate norms on an even grid, each the mean over a step of it."""
    count = int(imu.duration * rate)
    edges = imu.time[0] + np.arange(count + 1) / rate
    norm = np.linalg.norm(imu.gyro, axis=1)
    area = np.concatenate([[0.0], np.cumsum(0.5 * (norm[1:] + norm[:-1]) * np.diff(imu.time))])
    return np.diff(np.interp(edges, imu.time, area)) * rate, float(edges[0] + 0.5 / rate)


def _lively_segments(signal: FloatArray, length: int) -> list[int]:
    starts = np.arange(0, max(signal.size - length, 0) + 1, max(length // 2, 1))
    energy = [float(np.var(signal[s : s + length])) for s in starts]
    return [int(starts[k]) for k in np.argsort(energy)[::-1][:TRIES]]


def _correlations(base: FloatArray, segment: FloatArray) -> FloatArray:
    """Pearson's correlation of the segment with every segment of the base."""
    from scipy.signal import correlate

    n = segment.size
    centred = segment - segment.mean()
    product = correlate(base - base.mean(), centred, mode="valid", method="fft")
    shifted = base - base.mean()
    sums = np.concatenate([[0.0], np.cumsum(shifted)])
    squares = np.concatenate([[0.0], np.cumsum(shifted**2)])
    total = sums[n:] - sums[:-n]
    energy = squares[n:] - squares[:-n] - total**2 / n
    floor = 1e-6 * float(np.max(energy)) + 1e-300
    return np.asarray(product / np.sqrt(np.maximum(energy, floor) * np.sum(centred**2) + 1e-300))


def _rival(correlation: FloatArray, lag: int, signal: FloatArray, length: int) -> float:
    """Largest correlation outside the peak itself: beyond where it first falls to one half."""
    half = 0.5 * correlation[lag]
    a = lag
    while a > 0 and correlation[a] > half:
        a -= 1
    b = lag
    while b < correlation.size - 1 and correlation[b] > half:
        b += 1
    outside = np.concatenate([correlation[:a], correlation[b + 1 :]])
    return float(outside.max()) if outside.size else -1.0


def _peak(correlation: FloatArray, lag: int) -> float:
    """Place of the top of the parabola through three values, from the middle one."""
    if not 0 < lag < correlation.size - 1:
        return 0.0
    left, top, right = correlation[lag - 1 : lag + 2]
    bend = left - 2.0 * top + right
    return float(0.5 * (left - right) / bend) if bend < 0.0 else 0.0
