"""Gyros of an array against their mean: axes, scale, misalignment, delays, biases."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from schuler.arrays.calibration.gauge import start_rotations
from schuler.arrays.calibration.regression import regress_vectors, scale_by_motion
from schuler.arrays.calibration.rows import Rests
from schuler.arrays.clocks.delays import shift
from schuler.arrays.clocks.polling import PollingTrack, track_polling
from schuler.arrays.clocks.resampling import rate_of_change
from schuler.errors import EstimationError
from schuler.rotations import orthonormalize, skew
from schuler.types import FloatArray

GyroModel = Literal["matrix", "rotation"]
Timing = Literal["auto", "none", "constant", "polled"]

ELEMENT_PRIOR = 0.1
"""Standard deviation beforehand of an element of a sensitivity, and of a small turn in rad."""
BIAS_PRIOR = 1.0
"""Of a bias, rad/s."""
SLOW = 3.0
"""Deviations of the noise below which a mean rate is no motion."""
FAINT = 4.0
"""Deviations of the noise of the mean; motion about an axis below this is none."""
CLUSTER = 1.0
"""Seconds over which residuals may be correlated."""
ROUNDS = 4
"""Of fitting sensitivities and delays in turn."""
NO_DELAY = 1e-7
"""Seconds below which nothing is shifted."""
LEAST = 100
"""Rows of motion that are needed."""


@dataclass(frozen=True, slots=True, eq=False)
class GyroFit:
    """Gyros of an array against their mean."""

    start: FloatArray  # (k, 3, 3): C_bs to which everything is a small correction
    # (k, 3, 3): G: what a gyro triad shows of the body's rate, in its own axes; the mean of C_bs G
    # over the IMUs is one.
    sensor: FloatArray
    deviation: FloatArray  # (k, 3, 3): C_bs G - I
    deviation_sd: FloatArray  # (k, 3, 3): standard deviations of these
    # bias, bias_sd: (k, 3) in the axes of the sensor, rad/s
    bias: FloatArray
    bias_sd: FloatArray
    bias_from_rest: bool  # True: whole biases, seen at rest. False: differences from the mean only.
    # delay, delay_sd: (k,) constant delays against the mean, s; zero where chips are polled.
    delay: FloatArray
    delay_sd: FloatArray
    track: PollingTrack | None  # sampling phases in this recording
    unseen: FloatArray  # (m, 3): axes of the body about which there was no motion
    rows: int  # rows that the fit rests on
    # standard deviation of a component at rest, or in the calmest class of motion, rad/s
    noise: float

    @property
    def correction(self) -> FloatArray:
        """(k, 3, 3) matrices that take a reading less its bias into the body."""
        return np.asarray(np.linalg.inv(self.sensor))


def rest_biases(values: FloatArray, rests: Rests) -> tuple[FloatArray, FloatArray]:
    """Return the mean reading at rest, from the medians of the rests."""
    means = np.array(
        [np.nanmean(values[rests.pose == p], axis=0) for p in range(rests.count)
         if np.isfinite(values[rests.pose == p]).any(axis=0).all()]
    )  # fmt: skip
    if means.shape[0] == 0:
        raise EstimationError(
            "an IMU is missing in all rests", expected="rests in which every IMU recorded"
        )
    spread = np.zeros(means.shape[1:])
    if means.shape[0] > 1:
        around = np.median(np.abs(means - np.median(means, axis=0)), axis=0)
        # few rests make a poor deviation: none is believed below the usual one of the array
        around = np.maximum(around, np.median(around))
        spread = 1.4826 * 1.2533 * around / np.sqrt(means.shape[0])
    return np.median(means, axis=0), spread


def fit_gyros(
    time: FloatArray,
    gyro: FloatArray,
    declared: FloatArray,
    rests: Rests,
    *,
    model: GyroModel = "matrix",
    timing: Timing = "auto",
    period: float | None = None,
) -> GyroFit:
    """Fit what every gyro triad shows of the mean rate of all."""
    k = gyro.shape[1]
    from_rest = rests.count > 0
    start = start_rotations(gyro, declared)
    bias, bias_sd = np.zeros((k, 3)), np.zeros((k, 3))
    if from_rest:
        bias, bias_sd = rest_biases(gyro, rests)
    turned = np.einsum("kij,nkj->nki", start, gyro - bias)
    noise = _calm_noise(turned, rests)
    cluster = np.floor((time - time[0]) / CLUSTER).astype(np.int64)
    relative = np.eye(3)[None].repeat(k, axis=0)  # C_bs G
    delay, delay_sd = np.zeros(k), np.zeros(k)
    deviation_sd, offset, offset_sd = np.zeros((k, 3, 3)), np.zeros((k, 3)), np.zeros((k, 3))
    track: PollingTrack | None = None
    moved = np.zeros((time.size, k))
    unseen, rows = np.zeros((0, 3)), 0
    recorded = turned
    for turn in range(ROUNDS):
        if track is None and np.abs(delay).max() > NO_DELAY:
            turned = shift(time, recorded, delay)
        common = np.einsum("kij,nkj->nki", np.linalg.inv(relative), turned - offset)
        mean = np.asarray(common.mean(axis=1))
        slope = rate_of_change(time, mean)
        usable = np.isfinite(mean).all(axis=1) & np.isfinite(slope).all(axis=1)
        # without rests there are biases in the mean: only what varies is motion
        level = np.zeros(3) if from_rest else np.median(mean[usable], axis=0)
        lively = usable & (np.linalg.norm(np.nan_to_num(mean - level), axis=1) > SLOW * noise)
        lively &= ~rests.rows
        rows = int(np.count_nonzero(lively))
        if rows < LEAST:
            raise EstimationError(
                f"{rows} rows in which all gyros are there and turn",
                expected=f"at least {LEAST}, about all three axes",
                cure="record the array being turned by hand about all axes",
            )
        if turn > 0 and timing in ("auto", "polled"):
            rest = turned - offset - np.einsum("kij,nj->nki", relative, mean)
            if turn == 1 or track is not None:
                track = track_polling(time, rest, slope, noise, period=period, before=track)
            if track is not None:
                moved, delay, turned = track.relative_delay(time), np.zeros(k), recorded
        w, s = mean[lively], slope[lively]
        target = turned[lively] - w[:, None] + moved[lively][..., None] * s[:, None]
        scale = scale_by_motion(
            target - np.einsum("kij,nj->nki", relative - np.eye(3), w) - offset,
            np.linalg.norm(s, axis=1),
        )  # fmt: skip
        axes = _moved_axes(w - level, noise / np.sqrt(k))
        unseen = axes[0]
        fits = [
            regress_vectors(*_design(w, s, axes[1], model, target[:, i]), scale, cluster[lively],
                            _priors(model, time, track is None and timing != "none"))
            for i in range(k)
        ]  # fmt: skip
        values = np.array([f.values for f in fits])
        sds = np.array([f.standard_deviation for f in fits])
        if model == "matrix":
            elements, element_sd = values[:, :9].reshape(k, 3, 3), sds[:, :9].reshape(k, 3, 3)
        else:
            elements, element_sd = skew(values[:, :3]), np.abs(skew(sds[:, :3]))
        count = 9 if model == "matrix" else 3
        relative = np.eye(3) + elements
        if model == "rotation":
            relative = orthonormalize(relative)
        relative = relative @ np.linalg.inv(relative.mean(axis=0))
        if model == "rotation":
            relative = orthonormalize(relative)
        deviation_sd = element_sd
        offset, offset_sd = values[:, count : count + 3], sds[:, count : count + 3]
        delay = delay + values[:, -1] - values[:, -1].mean()
        delay_sd = sds[:, -1]
    if not from_rest:
        offset = offset - offset.mean(axis=0)
    back = np.swapaxes(start, 1, 2)
    if from_rest:
        # with rests the intercept is what is left in motion, no bias: the rests count
        whole, whole_sd = bias, bias_sd
    else:
        whole, whole_sd = np.einsum("kij,kj->ki", back, offset), offset_sd
    return GyroFit(
        start, back @ relative, relative - np.eye(3), deviation_sd, whole, whole_sd, from_rest,
        delay, delay_sd, track, unseen, rows, noise,
    )  # fmt: skip


def _calm_noise(turned: FloatArray, rests: Rests) -> float:
    """Standard deviation of a component against the mean, at rest or from sample to sample."""
    rest = turned - turned.mean(axis=1, keepdims=True)
    share = np.sqrt(1.0 - 1.0 / turned.shape[1])
    if rests.count:
        calm = rest[rests.rows]
        spread = np.nanmedian(np.abs(calm - np.nanmedian(calm, axis=0)))
    else:
        spread = np.nanmedian(np.abs(np.diff(rest, axis=0))) / np.sqrt(2.0)
    return 1.4826 * float(spread) / float(share)


def _moved_axes(rates: FloatArray, noise: float) -> tuple[FloatArray, FloatArray]:
    """Split the axes of the body into those without motion and a projector on the others."""
    moment = rates.T @ rates / rates.shape[0]
    values, axes = np.linalg.eigh(moment)
    still = values < (FAINT * noise) ** 2
    seen = axes[:, ~still]
    return np.asarray(axes[:, still].T), np.asarray(seen @ seen.T)


def _design(
    rates: FloatArray,
    slope: FloatArray,
    projector: FloatArray,
    model: GyroModel,
    target: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Columns: elements of E (by rows) or a turn, biases, delay."""
    seen = rates @ projector
    m = rates.shape[0]
    count = 9 if model == "matrix" else 3
    design = np.zeros((m, 3, count + 4))
    if model == "matrix":
        for i in range(3):
            design[:, i, 3 * i : 3 * i + 3] = seen
    else:
        design[:, :, :3] = -skew(seen)
    design[:, :, count : count + 3] = np.eye(3)
    design[:, :, -1] = -slope
    return design, target


def _priors(model: GyroModel, time: FloatArray, with_delay: bool) -> FloatArray:
    count = 9 if model == "matrix" else 3
    step = float(np.median(np.diff(time)))
    delay = 3.0 * step if with_delay else 1e-9
    return np.concatenate([np.full(count, ELEMENT_PRIOR), np.full(3, BIAS_PRIOR), [delay]])
