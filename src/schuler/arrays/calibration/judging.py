"""What a calibration does on a recording: its biases, sampling phases, and disagreement."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from schuler.arrays.calibration.accelerometers import arm_matrix
from schuler.arrays.calibration.disagreement import Disagreement, measure_disagreement
from schuler.arrays.calibration.gyros import rest_biases
from schuler.arrays.calibration.result import ArrayCalibration
from schuler.arrays.calibration.rows import MARGIN, Rests, find_rests, mask_saturated
from schuler.arrays.clocks.delays import estimate_delays
from schuler.arrays.clocks.polling import PollingTrack, sharpened_slope, track_polling
from schuler.arrays.clocks.resampling import rate_of_change
from schuler.data import ImuArray, Mounting
from schuler.errors import EstimationError
from schuler.types import FloatArray


def mean_slope(array: ImuArray, correction: FloatArray, bias: FloatArray) -> FloatArray:
    """Return the derivative of the mean rate, from samples that are not saturated themselves."""
    masked, _ = mask_saturated(array, margin=0)
    body = np.einsum("kij,nkj->nki", correction, masked.gyro - bias)
    return rate_of_change(array.time, np.asarray(body.mean(axis=1)))


def track_phases(
    calibration: ArrayCalibration, array: ImuArray, *, margin: int = MARGIN
) -> PollingTrack | None:
    """Track the sampling phases of polled chips in a recording."""
    if calibration.period is None:
        return None
    body = replace(calibration, delay=np.zeros(calibration.count)).apply(
        mask_saturated(array, margin)[0]
    )
    mean = np.asarray(body.gyro.mean(axis=1))
    slope = rate_of_change(array.time, mean)
    residual = body.gyro - mean[:, None]
    return track_polling(array.time, residual, slope, calibration.noise, period=calibration.period)


def with_biases_at_rest(calibration: ArrayCalibration, array: ImuArray) -> ArrayCalibration:
    """Return the calibration with the biases that a recording shows at rest."""
    rests = find_rests(array)
    if rests.count == 0:
        raise EstimationError(
            "the array is nowhere at rest",
            expected="at least two seconds of rest",
            cure="keep the biases of the calibration",
        )
    gyro, gyro_sd = rest_biases(array.gyro, rests)
    still = np.where(rests.rows[:, None, None], array.accel, np.nan)
    body = np.einsum("kij,nkj->nki", calibration.accel_correction, still - calibration.accel_bias)
    apart = body - body.mean(axis=1, keepdims=True)
    change, change_sd = rest_biases(apart, rests)
    change = np.einsum("kij,kj->ki", calibration.accel_sensor, change)
    return replace(
        calibration,
        gyro_bias=gyro,
        gyro_bias_sd=gyro_sd,
        accel_bias=calibration.accel_bias + change,
        accel_bias_sd=np.hypot(calibration.accel_bias_sd, change_sd),
    )


def calibrated_biases(calibration: ArrayCalibration, array: ImuArray) -> ArrayCalibration:
    """Return the calibration with a recording's own biases, where it has rests to show them."""
    calibration.check_fits(array)
    if find_rests(array).count == 0:
        return calibration
    return with_biases_at_rest(calibration, array)


def with_own_delays(calibration: ArrayCalibration, array: ImuArray) -> ArrayCalibration:
    """Return the calibration with the constant delays of a recording itself."""
    calibration.check_fits(array)
    if calibration.period is not None or not np.any(calibration.delay):
        return calibration
    mounted = replace(array, mounting=Mounting(calibration.nominal, calibration.position))
    try:
        found = estimate_delays(mounted)
    except EstimationError:
        return calibration
    return replace(calibration, delay=found.delay, delay_sd=found.standard_deviation)


def disagreement_after(
    calibration: ArrayCalibration,
    array: ImuArray,
    track: PollingTrack | None,
    rests: Rests | None = None,
    slope: FloatArray | None = None,
    *,
    sharpen: bool = False,
) -> tuple[Disagreement, ...]:
    """Measure how far the calibrated sensors of a recording are apart."""
    rests = find_rests(array) if rests is None else rests
    gyro, accel, rate = residuals_after(calibration, array, track, slope, sharpen=sharpen)
    found = measure_disagreement(gyro, rate, rests, "gyro")
    if not np.isnan(accel).all():
        found = (*found, *measure_disagreement(accel, rate, rests, "accel"))
    return found


def residuals_after(
    calibration: ArrayCalibration,
    array: ImuArray,
    track: PollingTrack | None,
    slope: FloatArray | None = None,
    *,
    sharpen: bool = False,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return every calibrated sensor minus the mean of all, and the mean rate."""
    body = calibration.apply(array) if track is None else replace(
        calibration, delay=np.zeros(calibration.count)
    ).apply(array)  # fmt: skip
    rate = np.asarray(body.gyro.mean(axis=1))
    gyro = body.gyro - rate[:, None]
    slope = rate_of_change(array.time, rate) if slope is None else slope
    acceleration = slope
    if track is not None:
        moved = track.relative_delay(array.time)
        acceleration = sharpened_slope(gyro, moved, slope, calibration.noise)
        gyro = gyro + moved[..., None] * (acceleration if sharpen else slope)[:, None]
    arms = calibration.position - calibration.position.mean(axis=0)
    accel = body.accel - np.einsum("nij,kj->nki", arm_matrix(rate, acceleration), arms)
    if track is not None:
        force_slope = rate_of_change(array.time, np.asarray(accel.mean(axis=1)))
        accel = accel + moved[..., None] * np.nan_to_num(force_slope)[:, None]
    return gyro, np.asarray(accel - accel.mean(axis=1, keepdims=True)), rate


def nominal_disagreement(
    calibration: ArrayCalibration, array: ImuArray, rests: Rests | None = None
) -> tuple[Disagreement, ...]:
    """Measure how far the sensors are apart by their nominal mounting alone."""
    rests = find_rests(array) if rests is None else rests
    values = []
    for sensors in (array.gyro, array.accel):
        turned = np.einsum("kij,nkj->nki", calibration.nominal, sensors)
        apart = turned - turned.mean(axis=1, keepdims=True)
        rows: NDArray[np.bool_] = rests.rows if rests.count else np.ones(array.size, dtype=bool)
        values.append(apart - level_of(apart[rows]))
    rate = np.einsum(
        "kij,nkj->nki", calibration.gyro_correction, array.gyro - calibration.gyro_bias
    ).mean(axis=1)
    found = measure_disagreement(values[0], rate, rests, "gyro")
    if not np.isnan(values[1]).all():
        found = (*found, *measure_disagreement(values[1], rate, rests, "accel"))
    return found


def level_of(residual: FloatArray) -> FloatArray:
    """Return the median of each sensor over the rows, (k, 3); zero where it has no values."""
    level = np.zeros(residual.shape[1:])
    known = np.isfinite(residual).any(axis=0)
    level[known] = np.nanmedian(residual[:, known], axis=0)
    return level
