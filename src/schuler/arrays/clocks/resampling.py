"""Values between samples and their rate of change, by local polynomials that respect gaps.

Both know what they do to noise: white noise of variance v comes out of an interpolation with the
variance v times the sum of the squared weights, which is less than one between the samples. A
recording that was resampled therefore looks better than the sensor is, and says by how much.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError
from schuler.types import FloatArray

TAPS = 6
"""Samples that an interpolation uses where all of them are there."""
LONGEST_STEP = 1.7
"""Usual steps; where two samples are further apart, one is missing between them."""
SAME_STAMP = 1e-6
"""Of a step: closer than this a sample is taken as it is."""


@dataclass(frozen=True, slots=True, eq=False)
class Resampled:
    """Values at other instants."""

    values: FloatArray  # (m, c): NaN where no interpolation is possible
    # (m,): variance of white noise after the interpolation, over that before: 1 on a sample, 0.70
    # in the middle between samples for six taps; NaN where there is no value.
    noise_gain: FloatArray


def resample(time: ArrayLike, values: ArrayLike, at: ArrayLike) -> Resampled:
    """Interpolate by the polynomial through the nearest samples on both sides."""
    stamps, instants = np.asarray(time, dtype=np.float64), np.asarray(at, dtype=np.float64)
    samples = np.asarray(values, dtype=np.float64)
    samples = samples[:, None] if samples.ndim == 1 else samples
    if stamps.ndim != 1 or samples.shape[0] != stamps.size or instants.ndim != 1:
        raise InputError(
            f"time of shape {stamps.shape}, values of shape {samples.shape}, instants of shape "
            f"{instants.shape}",
            expected="(n,), (n, c) and (m,)",
        )
    whole = np.isfinite(samples).all(axis=1)
    stamps, samples = stamps[whole], samples[whole]
    if stamps.size < 2:
        raise InputError(f"{stamps.size} samples to interpolate", expected="at least two")
    step = float(np.median(np.diff(stamps)))
    out = np.full((instants.size, samples.shape[1]), np.nan)
    gain = np.full(instants.size, np.nan)
    _take_samples(stamps, samples, instants, SAME_STAMP * step, out, gain)
    broken = np.concatenate([[0], np.cumsum(np.diff(stamps) > LONGEST_STEP * step)])
    left = np.searchsorted(stamps, instants, side="right") - 1
    for taps in range(TAPS, 0, -2):
        first = left - taps // 2 + 1
        todo = np.flatnonzero(np.isnan(gain) & (first >= 0) & (first + taps <= stamps.size))
        if todo.size == 0:
            continue
        begin = first[todo]
        todo = todo[broken[begin + taps - 1] == broken[begin]]
        _lagrange(stamps, samples, instants, first, taps, todo, out, gain)
    return Resampled(out, gain)


def _take_samples(
    stamps: FloatArray,
    samples: FloatArray,
    instants: FloatArray,
    tolerance: float,
    out: FloatArray,
    gain: FloatArray,
) -> None:
    nearest = np.searchsorted(0.5 * (stamps[1:] + stamps[:-1]), instants)
    same = np.abs(stamps[nearest] - instants) <= tolerance
    out[same], gain[same] = samples[nearest[same]], 1.0


def _lagrange(
    stamps: FloatArray,
    samples: FloatArray,
    instants: FloatArray,
    first: NDArray[np.int64],
    taps: int,
    rows: NDArray[np.int64],
    out: FloatArray,
    gain: FloatArray,
) -> None:
    nodes = [stamps[first[rows] + j] for j in range(taps)]
    x = instants[rows]
    total, squares = np.zeros((rows.size, samples.shape[1])), np.zeros(rows.size)
    for j in range(taps):
        weight = np.ones(rows.size)
        for i in range(taps):
            if i != j:
                weight *= (x - nodes[i]) / (nodes[j] - nodes[i])
        total += weight[:, None] * samples[first[rows] + j]
        squares += weight**2
    out[rows], gain[rows] = total, squares


def rate_of_change(time: ArrayLike, values: ArrayLike, reach: int = 2) -> FloatArray:
    """Differentiate evenly sampled values, using no sample that is missing."""
    stamps, samples = np.asarray(time, dtype=np.float64), np.asarray(values, dtype=np.float64)
    if stamps.ndim != 1 or samples.ndim != 2 or samples.shape[0] != stamps.size:
        raise InputError(
            f"time of shape {stamps.shape} and values of shape {samples.shape}",
            expected="(n,) and (n, c)",
        )
    n, width = stamps.size, 2 * reach + 1
    step = float(np.median(np.diff(stamps)))
    whole = np.pad(np.isfinite(samples).all(axis=1), reach)
    padded = np.pad(samples, ((reach, reach), (0, 0)))
    far = np.pad(np.cumsum(np.diff(stamps, prepend=stamps[0]) > LONGEST_STEP * step), reach, "edge")
    # which of the samples around each one are there, as the bits of a number
    code = np.zeros(n, dtype=np.int64)
    for j in range(width):
        there = whole[j : j + n] & (far[j : j + n] == far[reach : reach + n])
        code |= there.astype(np.int64) << j
    degree = min(3, 2 * reach)
    basis = np.vander(np.arange(-reach, reach + 1.0), degree + 1, increasing=True)
    slope = np.full(samples.shape, np.nan)
    for pattern in np.unique(code):
        use = [j for j in range(width) if pattern >> j & 1]
        if len(use) <= degree or min(use) >= reach or max(use) <= reach:
            continue
        weights = np.linalg.pinv(basis[use])[1] / step
        rows = np.flatnonzero(code == pattern)
        slope[rows] = sum(w * padded[rows + j] for w, j in zip(weights, use, strict=True))
    return slope


def low_pass(time: ArrayLike, values: ArrayLike, bandwidth: float) -> FloatArray:
    """Low-pass evenly sampled values without delay (Butterworth of order 4, both ways)."""
    from scipy.signal import butter, sosfiltfilt

    stamps, samples = np.asarray(time, dtype=np.float64), np.array(values, dtype=np.float64)
    rate = 1.0 / float(np.median(np.diff(stamps)))
    if not 0.0 < bandwidth < 0.5 * rate:
        raise InputError(
            f"a bandwidth of {bandwidth:g} Hz",
            expected=f"more than zero and less than half the sampling rate of {rate:.4g} Hz",
        )
    sections = butter(4, bandwidth, fs=rate, output="sos")
    if stamps.size < 40:
        raise InputError(
            f"{stamps.size} samples to low-pass", expected="at least 40", cure="record longer"
        )
    reach = int(np.ceil(0.5 * rate / bandwidth))
    for column in samples.T:
        gaps = np.isnan(column)
        if gaps.all():
            continue
        if gaps.any():
            column[gaps] = np.interp(stamps[gaps], stamps[~gaps], column[~gaps])
        column[:] = sosfiltfilt(sections, column)
        if gaps.any():
            near = np.convolve(gaps, np.ones(2 * reach + 1), mode="same") > 0.5
            column[near] = np.nan
    return samples
