"""Delays between IMUs that share their stamps, found from the rates that all of them feel."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.arrays.calibration.gauge import start_rotations, to_mean
from schuler.arrays.calibration.rotation import align_rates
from schuler.arrays.clocks.resampling import low_pass, rate_of_change, resample
from schuler.data import ImuArray
from schuler.errors import EstimationError
from schuler.rotations import dcm_from_rotation_vector, skew
from schuler.types import FloatArray

ROUNDS = 4
"""Rounds of shifting and measuring again: each leaves about a tenth of the error before."""
WINDOW = 2.0
"""Seconds in which a delay is measured once."""
BLOCK = 0.25
"""Seconds over which the residuals of neighbouring samples are taken as one."""


@dataclass(frozen=True, slots=True, eq=False)
class DelayEstimate:
    """Delays of the IMUs of an array against their mean."""

    # (k,): seconds by which the values of an IMU lag behind its stamps, minus the mean over the
    # IMUs
    delay: FloatArray
    standard_deviation: FloatArray  # (k,): of these, s, from how the windows scatter
    window_time: FloatArray  # (w,): middle of each window, s
    # (w, k): delay in each window, s; NaN where there is too little motion.
    window_delay: FloatArray
    window_sd: FloatArray  # (w, k): standard deviations of these, s
    rotation: FloatArray  # (k, 3, 3): takes the rates of an IMU into the mean axes


def estimate_delays(
    array: ImuArray, *, window: float = WINDOW, bandwidth: float | None = None
) -> DelayEstimate:
    """Estimate a constant delay of every IMU, and how it moves."""
    require_several(array)
    rates = array.gyro if bandwidth is None else _filtered(array, bandwidth)
    delay = np.zeros(array.count)
    start = start_rotations(rates, array.mounting.rotation)
    rotation = mean_rotations(rates, start)
    for _ in range(ROUNDS):
        turned = np.einsum("kij,nkj->nki", rotation, shift(array.time, rates, delay))
        times, found, deviation, turn = window_delays(array.time, turned, window)
        rotation = to_mean(dcm_from_rotation_vector(turn) @ rotation, start)
        good = np.isfinite(found).all(axis=1)
        if not good.any():
            raise EstimationError(
                "there is too little rotation to find a delay between the IMUs",
                expected="some seconds in which the rate changes by much more than its noise",
                cure="record some motion, or give the delays",
            )
        step = np.array([weighted_median(f, 1.0 / s) for f, s in zip(
            found[good].T, deviation[good].T, strict=True)])  # fmt: skip
        delay = delay + step - step.mean()
    scatter = found[good] - step
    weight = 1.0 / deviation[good] ** 2
    # the windows' own errors, enlarged where they scatter by more
    excess = np.sqrt(np.maximum(np.median(weight * scatter**2, axis=0) / 0.4549, 1.0))
    spread = 1.2533 * excess / np.sqrt(weight.sum(axis=0))
    return DelayEstimate(delay, spread, times, found + delay - step, deviation, rotation)


def require_several(array: ImuArray) -> None:
    """Raise when there are no two IMUs to compare."""
    with_gyros = int(np.count_nonzero(~np.isnan(array.gyro).any(axis=2).all(axis=0)))
    if with_gyros < 2:
        raise EstimationError(
            f"{with_gyros} IMU with three gyros: there is nothing to compare it with",
            expected="at least two IMUs on one body",
            cure="name the recordings of the others too",
        )


def shift(time: FloatArray, rates: FloatArray, delay: FloatArray) -> FloatArray:
    """Return what every IMU would have shown without its delay."""
    moved = []
    for i, d in enumerate(delay):
        there = int(np.count_nonzero(np.isfinite(rates[:, i]).all(axis=1)))
        as_is = d == 0.0 or there < 2  # a sensor without values stays without
        moved.append(rates[:, i] if as_is else resample(time, rates[:, i], time + d).values)
    return np.stack(moved, axis=1)


def mean_rotations(rates: FloatArray, start: FloatArray) -> FloatArray:
    """Return the rotations of the IMUs into their mean axes."""
    rotation = start
    for _ in range(3):
        turned = np.einsum("kij,nkj->nki", rotation, rates)
        mean = np.asarray(turned.mean(axis=1))
        found = [align_rates(mean, rates[:, i]).rotation for i in range(rates.shape[1])]
        rotation = to_mean(np.array(found), start)
    return rotation


def window_delays(
    time: FloatArray, turned: FloatArray, window: float
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Measure the delay of every IMU against the mean, window by window."""
    mean = np.asarray(turned.mean(axis=1))
    slope = rate_of_change(time, mean)
    rest = turned - mean[:, None]
    usable = np.isfinite(rest).all(axis=(1, 2)) & np.isfinite(slope).all(axis=1)
    index = np.floor((time - time[0]) / window).astype(np.int64)
    block = np.floor((time - time[0]) / BLOCK).astype(np.int64)
    count, imus = int(index[-1]) + 1, turned.shape[1]
    parts: list[tuple[int, FloatArray, FloatArray, FloatArray, NDArray[np.int64], float]] = []
    normal, right = np.zeros((3, 3)), np.zeros((imus, 3))
    for w in range(count):
        rows = np.flatnonzero(usable & (index == w))
        if rows.size < 8:
            continue
        s = slope[rows] - slope[rows].mean(axis=0)
        r = rest[rows] - rest[rows].mean(axis=0)
        design = skew(mean[rows])
        design = design - design.mean(axis=0)
        energy = float(np.sum(s**2))
        if energy <= 0.0:
            continue
        parts.append((w, s, r, design, block[rows] - block[rows[0]], energy))
        shared = np.einsum("nij,ni->j", design, s)
        normal += np.einsum("nij,nik->jk", design, design) - np.outer(shared, shared) / energy
        along = np.einsum("ni,nki->k", s, r)
        right += np.einsum("nij,nki->kj", design, r) - np.outer(along, shared) / energy
    turn = solve_seen(normal, right)
    found, deviation = np.full((count, imus), np.nan), np.full((count, imus), np.nan)
    for w, s, r, design, blocks, energy in parts:
        left = r - np.einsum("nij,kj->nki", design, turn)
        found[w] = -np.einsum("nj,nkj->k", s, left) / energy
        score = np.einsum("nj,nkj->nk", s, left + found[w][:, None] * s[:, None])
        sums = np.zeros((int(blocks[-1]) + 1, imus))
        np.add.at(sums, blocks, score)
        deviation[w] = np.sqrt(np.sum(sums**2, axis=0)) / energy
    step = float(np.median(np.diff(time)))
    # where the motion does not stand out, the derivative is noise and so is what it measures
    weak = ~(deviation < 0.25 * step).all(axis=1)
    found[weak], deviation[weak] = np.nan, np.nan
    return time[0] + window * (np.arange(count) + 0.5), found, deviation, turn


def solve_seen(normal: FloatArray, right: FloatArray) -> FloatArray:
    """Solve normal equations for turns, leaving alone what nothing moves around."""
    values, axes = np.linalg.eigh(normal)
    weak = values < 1e-6 * max(float(values[-1]), 1e-300)
    scaled = np.where(weak, 0.0, (right @ axes) / np.where(weak, 1.0, values))
    return np.asarray(scaled @ axes.T)


def weighted_median(values: FloatArray, weights: FloatArray) -> float:
    """Return the value with half of the weight on each side."""
    order = np.argsort(values)
    total = np.cumsum(weights[order])
    return float(values[order[np.searchsorted(total, 0.5 * total[-1])]])


def _filtered(array: ImuArray, bandwidth: float) -> FloatArray:
    flat = array.gyro.reshape(array.size, -1)
    return low_pass(array.time, flat, bandwidth).reshape(array.gyro.shape)
