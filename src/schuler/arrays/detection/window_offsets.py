"""Offsets of calibrated gyros from one another in windows of motion, and their covariance.

A lasting fault is a constant over a window of a second. In motion the samples of the window say
little about it alone: an error of timing is larger than the noise, and along the angular
acceleration only. What the angular acceleration of each sample may explain is therefore projected
out, in the measure in which it is unknown, before the window is averaged.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from schuler.arrays.calibration.judging import (
    calibrated_biases,
    level_of,
    track_phases,
    with_own_delays,
)
from schuler.arrays.calibration.result import ArrayCalibration
from schuler.arrays.calibration.rows import find_rests, low_passed, mask_saturated
from schuler.arrays.clocks.polling import own_derivative
from schuler.arrays.clocks.resampling import rate_of_change
from schuler.arrays.detection.motion_errors import mean_of_present
from schuler.data import ImuArray
from schuler.types import FloatArray

DELAY_BANDWIDTH = 8.0
"""Of the rates in which delays are looked for, Hz."""
CHUNK = 256
"""Windows that are averaged at once."""
SWEEPS = 12
"""Rounds of reweighting."""
CUT = 3.0
"""Length of a sample's residual, in medians of the window, at which it counts no more: knocks."""
LIGHTEST = 1e-4
"""Least weight of a sample."""
COVERAGE = 0.2
"""Share of the samples of a window that a sensor must have."""


@dataclass(frozen=True, slots=True, eq=False)
class CalibratedRates:
    """Gyros of an array after calibration, at one instant as far as timing is known.

    Parameters
    ----------
    time : (n,) ndarray
        s.
    residual : (n, k, 3) ndarray
        Less the mean of those that are there, rad/s; zero where missing.
    present : (n, k) ndarray of bool
        Which are there; none in a row of fewer than two.
    delay : (n, k) ndarray
        Ages less their mean over those that are there, s; zero where missing.
    unknown : (n,) ndarray
        How far the angular acceleration of a sample is unknown, 0 to 1.
    rate, slope : (n, 3) ndarray
        Mean rate and its derivative, rad/s and rad/s².
    """

    time: FloatArray
    residual: FloatArray
    present: NDArray[np.bool_]
    delay: FloatArray
    unknown: FloatArray
    rate: FloatArray
    slope: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class WindowOffsets:
    """Offsets of the gyros of an array in windows.

    Parameters
    ----------
    start, stop : (w,) ndarray
        Stamps of the first and the last sample, s.
    offset : (w, k, 3) ndarray
        From the mean of the sensors, rad/s; they sum to zero. Zero for a sensor that is absent.
    sampling : (w, k, k) ndarray
        Covariance of a component that the scatter of the samples explains, (rad/s)².
    present : (w, k) ndarray of bool
        Which sensors the window has.
    speed : (w,) ndarray
        Mean length of the rate, rad/s.
    rate, slope : (w,) ndarray
        Length of the mean rate and of its mean derivative, rad/s and rad/s².
    skipped : int
        Windows with too few samples to judge.
    """

    start: FloatArray
    stop: FloatArray
    offset: FloatArray
    sampling: FloatArray
    present: NDArray[np.bool_]
    speed: FloatArray
    rate: FloatArray
    slope: FloatArray
    skipped: int


def calibrated_rates(calibration: ArrayCalibration, array: ImuArray) -> CalibratedRates:
    """Return the gyros of a recording calibrated, with biases and phases of its own."""
    # vibration, which sensors do not share, spoils delays: they are found below it
    slow = array if calibration.period is not None else low_passed(array, DELAY_BANDWIDTH)
    used = with_own_delays(calibrated_biases(calibration, array), slow)
    track = track_phases(used, array)
    applied = used if track is None else replace(used, delay=np.zeros(used.count))
    body = applied.apply(mask_saturated(array)[0]).gyro
    # a derivative needs neighbours: no margin for it
    bare = applied.apply(mask_saturated(array, margin=0)[0]).gyro
    slope = rate_of_change(array.time, mean_of_present(bare))
    present: NDArray[np.bool_] = np.asarray(np.isfinite(body).all(axis=2))
    present = present & np.asarray(np.isfinite(slope).all(axis=1))[:, None]
    present = present & (present.sum(axis=1) > 1)[:, None]
    rate = np.nan_to_num(mean_of_present(np.where(present[..., None], body, np.nan)))
    residual = np.where(present[..., None], body - rate[:, None], 0.0)
    delay, unknown = np.zeros(present.shape), np.zeros(array.size)
    if track is not None:
        age = track.delay(array.time)
        number = np.maximum(present.sum(axis=1, keepdims=True), 1)
        delay = np.where(present, age - (age * present).sum(axis=1, keepdims=True) / number, 0.0)
        unknown = own_derivative(residual, delay, slope, used.noise)[1]
        residual = residual + delay[..., None] * np.nan_to_num(slope)[:, None]
    rests = find_rests(array)
    if rests.count > 1:
        drift = _drift(array.time, residual, rests.pose, np.asarray(present.all(axis=1)))
        residual = np.where(present[..., None], residual - drift, 0.0)
    elif rests.count == 0:
        level = level_of(np.where(present[..., None], residual, np.nan))
        residual = np.where(present[..., None], residual - (level - level.mean(axis=0)), 0.0)
    return CalibratedRates(
        array.time, residual, present, delay, unknown, rate, np.nan_to_num(slope)
    )


def _drift(
    time: FloatArray, residual: FloatArray, pose: NDArray[np.int64], rows: NDArray[np.bool_]
) -> FloatArray:
    """Line through the rests, (n, k, 3): the median of slopes between them (Theil and Sen)."""
    poses = [p for p in np.unique(pose[rows]) if p >= 0]
    if len(poses) < 2:
        return np.zeros_like(residual)
    inside = [(pose == p) & rows for p in poses]
    moment = np.array([time[r].mean() for r in inside])
    level = np.array([residual[r].mean(axis=0) for r in inside])
    first, second = np.triu_indices(len(poses), 1)
    slope = np.median(
        (level[second] - level[first]) / (moment[second] - moment[first])[:, None, None], axis=0
    )
    middle = np.median(level - slope * moment[:, None, None], axis=0)
    line = middle + slope * time[:, None, None]
    return np.asarray(line - line.mean(axis=1, keepdims=True))


def window_offsets(rates: CalibratedRates, window: float, step: float) -> WindowOffsets:
    """Average the residuals of every window robustly, with angular acceleration projected out."""
    interval = float(np.median(np.diff(rates.time)))
    length = max(round(window / interval), 2)
    first = np.arange(0, rates.time.size - length + 1, max(round(step / interval), 1))
    # a gap in the stamps is no window
    whole = rates.time[first + length - 1] - rates.time[first] < 1.5 * window
    enough = [_judged(rates.present[f : f + length])[1].sum() >= COVERAGE * length for f in first]
    chosen = first[whole & np.array(enough, dtype=bool)]
    parts = [
        _average(rates, chosen[i : i + CHUNK, None] + np.arange(length))
        for i in range(0, chosen.size, CHUNK)
    ] or [_average(rates, np.zeros((0, length), dtype=np.int64))]
    joined = [np.concatenate(column) for column in zip(*parts, strict=True)]
    offset, sampling, present, speed, rate, slope = joined
    return WindowOffsets(
        rates.time[chosen], rates.time[chosen + length - 1], offset, sampling, present, speed,
        rate, slope, int(first.size - chosen.size),
    )  # fmt: skip


def join_offsets(parts: Sequence[WindowOffsets]) -> WindowOffsets:
    """Join the windows of several recordings of the same array."""
    names = [f.name for f in fields(WindowOffsets) if f.name != "skipped"]
    joined = {n: np.concatenate([getattr(p, n) for p in parts]) for n in names}
    return WindowOffsets(**joined, skipped=sum(p.skipped for p in parts))


def _judged(present: NDArray[np.bool_]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Sensors with enough samples in a window, and samples with more than half of the sensors.

    Where half of them are saturated the others are about to be.
    """
    enough = present.sum(axis=-2, keepdims=True) >= COVERAGE * present.shape[-2]
    seen: NDArray[np.bool_] = np.logical_and(present, enough)
    there: NDArray[np.bool_] = np.asarray(2 * seen.sum(axis=-1) > present.shape[-1])
    return np.logical_and(seen, there[..., None]), there


def _average(rates: CalibratedRates, rows: NDArray[np.int64]) -> tuple[NDArray[np.generic], ...]:
    seen, there = _judged(rates.present[rows])
    k = seen.shape[2]
    number = np.maximum(seen.sum(axis=2, keepdims=True), 1)
    share = seen / np.sqrt(number)
    delay = rates.delay[rows] * seen
    delay = (delay - delay.sum(axis=2, keepdims=True) / number) * seen
    energy = np.maximum((delay**2).sum(axis=2), 1e-300)
    along = delay * np.sqrt(rates.unknown[rows] / energy)[..., None]
    freedom = np.sqrt(np.maximum(number[..., 0] - 1, 1))
    window_has = np.asarray(seen.any(axis=1))
    raw = rates.residual[rows]
    projected = _project(raw, share, along, seen)
    weight = there.astype(np.float64)
    offset = np.zeros((rows.shape[0], k, 3))
    for _ in range(SWEEPS):
        inverse = _inverse(_information(weight, seen, share, along), window_has)
        offset = inverse @ np.einsum("wl,wlki->wki", weight, projected)
        fitted = np.broadcast_to(offset[:, None], raw.shape)
        left = projected - _project(fitted, share, along, seen)
        size = np.sqrt((left**2).sum(axis=(2, 3)) / 3.0) / freedom
        middle = np.nanmedian(np.where(there, size, np.nan), axis=1)
        ratio = size / (CUT * np.maximum(middle, 1e-300))[:, None]
        # never quite nothing: a sensor must not vanish with its last good sample
        weight = there * np.maximum(np.maximum(1.0 - ratio**2, 0.0) ** 2, LIGHTEST)
    total = weight.sum(axis=1)
    variance = np.einsum("wl,wl->w", weight, size**2) / np.maximum(total, 1e-300)
    part = weight / np.maximum(total, 1e-300)[:, None]
    whole = part[..., None] * rates.rate[rows]
    turned = part[..., None] * rates.slope[rows]
    lengths = np.linalg.norm(rates.rate[rows], axis=2) * there
    return (
        offset,
        variance[:, None, None] * inverse,
        window_has,
        lengths.sum(axis=1) / np.maximum(there.sum(axis=1), 1),
        np.linalg.norm(whole.sum(axis=1), axis=1),
        np.linalg.norm(turned.sum(axis=1), axis=1),
    )


def _project(
    vectors: FloatArray, share: FloatArray, along: FloatArray, seen: NDArray[np.bool_]
) -> FloatArray:
    """P of each sample on residuals of all sensors, (w, l, k, 3)."""
    kept = vectors * seen[..., None]
    mean = np.einsum("wlk,wlki->wli", share, kept)
    slid = np.einsum("wlk,wlki->wli", along, kept)
    return np.asarray(
        kept - share[..., None] * mean[:, :, None] - along[..., None] * slid[:, :, None]
    )


def _information(
    weight: FloatArray, seen: NDArray[np.bool_], share: FloatArray, along: FloatArray
) -> FloatArray:
    """Sum of weight times P over the samples, (w, k, k)."""
    diagonal = np.einsum("wl,wlk->wk", weight, seen)
    root = np.sqrt(weight)[..., None]
    matrix = np.zeros((weight.shape[0], seen.shape[2], seen.shape[2]))
    matrix[:, np.arange(seen.shape[2]), np.arange(seen.shape[2])] = diagonal
    for vector in (root * share, root * along):
        matrix -= np.swapaxes(vector, 1, 2) @ vector
    return matrix


def _inverse(information: FloatArray, present: NDArray[np.bool_]) -> FloatArray:
    """Inverse among offsets that sum to zero; zero for sensors that are absent."""
    k = present.shape[1]
    size = np.einsum("wii->w", information)[:, None, None] / k
    mean = present / np.sqrt(present.sum(axis=1, keepdims=True))
    common = mean[:, :, None] * mean[:, None, :]
    absent = np.where(present, 0.0, 1.0)[:, :, None] * np.eye(k)
    # sensors that no sample compares get an enormous variance instead of a failure
    ridge = 1e-9 * size * np.eye(k)
    full = np.linalg.inv(information + ridge + size * (common + absent))
    return np.asarray(full - (common + absent) / (size * (1.0 + 1e-9)))
