"""A calibration looked at: disagreement against rate, sampling phases, other recordings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from schuler.arrays.calibration.disagreement import MOVING, Disagreement
from schuler.arrays.calibration.judging import (
    calibrated_biases,
    disagreement_after,
    level_of,
    mean_slope,
    nominal_disagreement,
    residuals_after,
    track_phases,
    with_own_delays,
)
from schuler.arrays.calibration.result import ArrayCalibration
from schuler.arrays.calibration.rows import find_rests, low_passed, mask_saturated
from schuler.arrays.clocks.polling import PollingTrack
from schuler.data import ImuArray
from schuler.types import FloatArray

CLASSES = 24
"""Classes of rate in which disagreement is drawn."""
FEWEST = 20
"""Rows that a class needs."""
SHOWN = 4.0
"""Seconds of sampling phases that are drawn."""


@dataclass(frozen=True, slots=True, eq=False)
class RateCurve:
    """Disagreement against the mean rate."""

    quantity: str  # which sensors
    name: str  # what was corrected
    rate: FloatArray  # (b,): middle of each class, rad/s
    rms: FloatArray  # (b,): rad/s or m/s²


@dataclass(frozen=True, slots=True, eq=False)
class PhaseView:
    """Sampling phases over some lively seconds."""

    time: FloatArray  # (m,): stamps, s
    delay: FloatArray  # (m, k): age less the mean age, as tracked, s
    seen: FloatArray  # (m, k): the same as single samples show it, s; NaN with too little motion.


@dataclass(frozen=True, slots=True, eq=False)
class Judgement:
    """Disagreement of one recording."""

    name: str  # of the recording
    # nominal, calibrated, sharpened: by the nominal mounting; calibrated; and with the derivative
    # that polled chips show themselves (empty where they are not polled).
    nominal: tuple[Disagreement, ...]
    calibrated: tuple[Disagreement, ...]
    sharpened: tuple[Disagreement, ...]
    estimated: str  # what was estimated on this very recording


@dataclass(frozen=True, slots=True, eq=False)
class CalibrationReview:
    """A calibration with what is to be seen of it."""

    calibration: ArrayCalibration  # what was found
    curves: tuple[RateCurve, ...]  # on the recording that was fitted
    phases: PhaseView | None  # of polled chips
    judgements: tuple[Judgement, ...]  # the recording that was fitted, then others


def review_calibration(
    calibration: ArrayCalibration,
    array: ImuArray,
    name: str,
    others: Sequence[tuple[str, ImuArray]] = (),
    *,
    bandwidth: float | None = None,
) -> CalibrationReview:
    """Look at a calibration on the recording it was fitted to, and on others."""
    if bandwidth is not None:
        array = low_passed(array, bandwidth)
        others = [(title, low_passed(other, bandwidth)) for title, other in others]
    judged = [_judge(calibration, array, name, own=True)]
    curves, phases = _views(calibration, array)
    for title, other in others:
        here = with_own_delays(calibrated_biases(calibration, other), other)
        judged.append(
            _judge(
                here,
                other,
                title,
                own=False,
                delays=not np.array_equal(here.delay, calibration.delay),
            )
        )
    return CalibrationReview(calibration, curves, phases, tuple(judged))


def _judge(
    calibration: ArrayCalibration, array: ImuArray, name: str, *, own: bool, delays: bool = False
) -> Judgement:
    masked, _ = mask_saturated(array)
    rests = find_rests(masked)
    track = track_phases(calibration, array)
    slope = _slope(calibration, array, track)
    sharpened: tuple[Disagreement, ...] = ()
    if track is not None:
        sharpened = disagreement_after(calibration, masked, track, rests, slope, sharpen=True)
    estimated = [] if rests.count == 0 else ["biases at rest"]
    if track is not None:
        estimated.append("sampling phases")
    if delays:
        estimated.append("delays")
    text = "everything" if own else " and ".join(estimated) or "nothing"
    return Judgement(
        name,
        nominal_disagreement(calibration, masked, rests),
        disagreement_after(calibration, masked, track, rests, slope),
        sharpened,
        text,
    )


def _slope(
    calibration: ArrayCalibration, array: ImuArray, track: PollingTrack | None
) -> FloatArray | None:
    if track is None:
        return None
    return mean_slope(array, calibration.gyro_correction, calibration.gyro_bias)


def _views(
    calibration: ArrayCalibration, array: ImuArray
) -> tuple[tuple[RateCurve, ...], PhaseView | None]:
    masked, _ = mask_saturated(array)
    track = track_phases(calibration, array)
    slope = _slope(calibration, array, track)
    rests = find_rests(masked)
    turned = [
        np.einsum("kij,nkj->nki", calibration.nominal, values)
        for values in (masked.gyro, masked.accel)
    ]
    nominal = []
    for values in turned:
        apart = values - values.mean(axis=1, keepdims=True)
        rows = rests.rows if rests.count else np.ones(array.size, dtype=bool)
        nominal.append(apart - level_of(apart[rows]))
    plain = residuals_after(calibration, masked, None, slope)
    rate = plain[2]
    sets: list[tuple[str, FloatArray, FloatArray]] = [
        ("nominal mounting", nominal[0], nominal[1]),
        ("calibrated", plain[0], plain[1]),
    ]
    if track is not None:
        tracked = residuals_after(calibration, masked, track, slope)
        sets.append(("and phases tracked", tracked[0], tracked[1]))
        sharp = residuals_after(calibration, masked, track, slope, sharpen=True)
        sets.append(("and the chips' own derivative", sharp[0], sharp[1]))
    speed = np.linalg.norm(rate, axis=1)
    edges = _edges(speed)
    curves = [
        _curve(quantity, name, residual, speed, edges)
        for name, *both in sets
        for quantity, residual in zip(("gyro", "accel"), both, strict=True)
        if not np.isnan(residual).all() and not (quantity == "accel" and "derivative" in name)
    ]
    if track is None:
        return tuple(curves), None
    return tuple(curves), _phases(track, array.time, plain[0], slope, calibration.noise)


def _edges(speed: FloatArray) -> FloatArray:
    top = float(np.nanpercentile(speed, 99.8))
    return np.geomspace(MOVING, max(top, 2.0 * MOVING), CLASSES + 1)


def _curve(
    quantity: str, name: str, residual: FloatArray, speed: FloatArray, edges: FloatArray
) -> RateCurve:
    good = np.isfinite(residual).all(axis=(1, 2)) & np.isfinite(speed)
    square = np.mean(residual[good] ** 2, axis=(1, 2))
    index = np.digitize(speed[good], edges) - 1
    inside = (index >= 0) & (index < edges.size - 1)
    count = np.bincount(index[inside], minlength=edges.size - 1)
    total = np.bincount(index[inside], weights=square[inside], minlength=edges.size - 1)
    rms = np.sqrt(total / np.maximum(count, 1))
    rms[count < FEWEST] = np.nan
    return RateCurve(quantity, name, np.sqrt(edges[1:] * edges[:-1]), rms)


def _phases(
    track: PollingTrack,
    time: FloatArray,
    residual: FloatArray,
    slope: FloatArray | None,
    noise: float,
) -> PhaseView | None:
    """Tracked delays over the seconds in which single samples show them best."""
    if slope is None:
        return None
    size = np.linalg.norm(slope, axis=1)
    good = np.isfinite(residual).all(axis=(1, 2)) & np.isfinite(size)
    # a single sample is worth showing where it knows the delay to a quarter of a period
    good &= np.nan_to_num(size) > 4.0 * noise / track.period
    seconds = np.floor(time[good] / SHOWN)
    if seconds.size == 0:
        return None
    values, counts = np.unique(seconds, return_counts=True)
    start = values[np.argmax(counts)] * SHOWN
    rows = np.flatnonzero((time >= start) & (time < start + SHOWN))
    seen = -np.einsum("nki,ni->nk", residual[rows], slope[rows]) / (size[rows] ** 2)[:, None]
    seen[~good[rows]] = np.nan
    return PhaseView(time[rows], track.relative_delay(time[rows]), seen)
