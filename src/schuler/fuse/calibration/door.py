"""One door: `calibrate_array`, and what a calibration does on another recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from schuler.data import ImuArray
from schuler.data._checks import FloatArray
from schuler.errors import EstimationError, InputError
from schuler.fuse.calibration.accelerometers import (
    AccelerometerFit,
    arm_matrix,
    fit_accelerometers,
)
from schuler.fuse.calibration.disagreement import Disagreement, measure_disagreement
from schuler.fuse.calibration.findings import findings_of
from schuler.fuse.calibration.gyros import GyroFit, GyroModel, Timing, fit_gyros, rest_biases
from schuler.fuse.calibration.poses import STANDARD_GRAVITY, PoseFit, fit_poses
from schuler.fuse.calibration.result import ArrayCalibration
from schuler.fuse.calibration.rows import MARGIN, Rests, find_rests, mask_saturated
from schuler.fuse.clocks.delays import require_several, shift
from schuler.fuse.clocks.polling import PollingTrack, sharpened_slope, track_polling
from schuler.fuse.clocks.resampling import low_pass, rate_of_change

ALIKE = 0.5
"""Share of exactly equal rows above which a sensor is a copy of another."""


def calibrate_array(
    array: ImuArray,
    *,
    gyro_model: GyroModel = "matrix",
    accel_model: GyroModel = "matrix",
    timing: Timing = "auto",
    period: float | None = None,
    bandwidth: float | None = None,
    gravity: float = STANDARD_GRAVITY,
    margin: int = MARGIN,
) -> ArrayCalibration:
    """Calibrate the IMUs of an array against each other.

    Parameters
    ----------
    array : ImuArray
        At least two IMUs that share a body and their stamps (`read_array`), moved by hand about
        all axes; static poses before or after give biases and what gravity tells. The declared
        mounting need not be right: where rates contradict it, it is found. Declared positions
        are the first values of the lever arms, and their mean stays.
    gyro_model, accel_model : {"matrix", "rotation"}
        All nine elements of what a triad shows of the mean, or the turn alone (the accelerometers
        then turned like the gyros): for motion that is too poor for nine.
    timing : {"auto", "none", "constant", "polled"}
        Delays between the sensors, see `schuler.fuse.calibration.gyros.fit_gyros`.
    period : float, optional
        Internal sampling period of polled chips, s; found if not given.
    bandwidth : float, optional
        Low-pass everything to this first, Hz: where the IMUs feel vibration that they do not
        share. Chips that are polled cannot be tracked through it.
    gravity : float
        Local gravity, m/s².
    margin : int
        Samples around saturated ones that are not used either.

    Returns
    -------
    ArrayCalibration
        With standard errors, and the disagreement before and after. Before: nominal mounting,
        biases taken off. What no difference shows (the turn of the whole, the scale of all gyros
        together) is left as the mean of the sensors has it.

    Raises
    ------
    EstimationError
        One IMU only, or too little motion.
    InputError
        Left-handed axes, or a sensor that is a copy of another.
    """
    require_several(array)
    _no_copies(array)
    masked, saturated = mask_saturated(array, margin)
    rests = find_rests(masked)
    used = masked if bandwidth is None else _filtered(masked, bandwidth)
    polled: Timing = "constant" if bandwidth is not None and timing == "auto" else timing
    gyros = fit_gyros(
        used.time, used.gyro, used.mounting.rotation, rests, model=gyro_model, timing=polled,
        period=period,
    )  # fmt: skip
    motion = _Motion(array, used, gyros, margin, bandwidth)
    forces = None
    if not np.isnan(used.accel).all(axis=(0, 2)).any():
        shifted = used.accel if motion.polled else shift(used.time, used.accel, gyros.delay)
        turned = gyros.start if accel_model == "matrix" else gyros.correction
        forces = fit_accelerometers(
            used.time, shifted, turned, motion.rate, motion.acceleration, motion.moved,
            used.mounting.position, rests, model=accel_model,
        )  # fmt: skip
    poses = _poses(used, forces, rests, gravity)
    if poses is not None and forces is not None:
        # once more, with what gravity says of the mean: lever arms have its scale
        forces = fit_accelerometers(
            used.time, shifted, turned, motion.rate, motion.acceleration, motion.moved,
            forces.position, rests, model=accel_model,
            mean_sensor=np.asarray(np.linalg.inv(poses.matrix), dtype=np.float64),
        )  # fmt: skip
    calibration = _assemble(array, gyros, forces, poses, rests)
    before = _nominal(used, gyros, rests)
    after = disagreement_after(calibration, used, gyros.track, rests, motion.slope)
    found = findings_of(array, gyros, forces, poses, rests, saturated, before, after)
    return replace(calibration, before=before, after=after, findings=found)


class _Motion:
    """Rate of the body with its derivative, and what polling moves."""

    def __init__(
        self, raw: ImuArray, used: ImuArray, gyros: GyroFit, margin: int, bandwidth: float | None
    ) -> None:
        self.polled = gyros.track is not None
        self.moved: FloatArray = np.zeros((used.size, used.count))
        values = used.gyro if self.polled else shift(used.time, used.gyro, gyros.delay)
        body = np.einsum("kij,nkj->nki", gyros.correction, values - gyros.bias)
        self.rate: FloatArray = np.asarray(body.mean(axis=1))
        self.slope = mean_slope(raw, gyros.correction, gyros.bias) if (
            bandwidth is None and self.polled
        ) else rate_of_change(used.time, self.rate)  # fmt: skip
        self.acceleration = self.slope
        if gyros.track is not None:
            self.moved = gyros.track.relative_delay(used.time)
            residual = body - self.rate[:, None]
            self.acceleration = sharpened_slope(residual, self.moved, self.slope, gyros.noise)


def mean_slope(array: ImuArray, correction: FloatArray, bias: FloatArray) -> FloatArray:
    """Return the derivative of the mean rate, from samples that are not saturated themselves.

    Parameters
    ----------
    array : ImuArray
        As recorded, without a margin around saturated samples.
    correction : (k, 3, 3) ndarray
        From a reading less its bias to the body.
    bias : (k, 3) ndarray
        rad/s.

    Returns
    -------
    (n, 3) ndarray
        rad/s²; NaN where too few neighbours are there.
    """
    masked, _ = mask_saturated(array, margin=0)
    body = np.einsum("kij,nkj->nki", correction, masked.gyro - bias)
    return rate_of_change(array.time, np.asarray(body.mean(axis=1)))


def track_phases(
    calibration: ArrayCalibration, array: ImuArray, *, margin: int = MARGIN
) -> PollingTrack | None:
    """Track the sampling phases of polled chips in a recording.

    Parameters
    ----------
    calibration : ArrayCalibration
        Of the same IMUs, from another or the same recording.
    array : ImuArray
        The recording.
    margin : int
        Samples around saturated ones that are not used either.

    Returns
    -------
    PollingTrack or None
        Found from this recording alone, with the period of the calibration; None where the chips
        are read in step.

    Raises
    ------
    InputError
        Another number of IMUs.
    """
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
    """Return the calibration with the biases that a recording shows at rest.

    Parameters
    ----------
    calibration : ArrayCalibration
        Of the same IMUs.
    array : ImuArray
        With rests. Biases change from switching on to switching on; axes, scale and lever arms do
        not.

    Returns
    -------
    ArrayCalibration
        Gyros: the median reading at rest. Accelerometers: the differences from the mean at rest.

    Raises
    ------
    EstimationError
        Nowhere at rest.
    """
    rests = find_rests(array)
    if rests.count == 0:
        raise EstimationError(
            "the array is nowhere at rest",
            expected="at least two seconds of rest",
            cure="keep the biases of the calibration",
        )
    gyro, gyro_sd = rest_biases(array.gyro, rests)
    still = np.where(rests.rows[:, None, None], array.accel, np.nan)
    body = np.einsum(
        "kij,nkj->nki", np.linalg.inv(calibration.accel_sensor), still - calibration.accel_bias
    )
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


def disagreement_after(
    calibration: ArrayCalibration,
    array: ImuArray,
    track: PollingTrack | None,
    rests: Rests | None = None,
    slope: FloatArray | None = None,
    *,
    sharpen: bool = False,
) -> tuple[Disagreement, ...]:
    """Measure how far the calibrated sensors of a recording are apart.

    Parameters
    ----------
    calibration : ArrayCalibration
        Of the same IMUs.
    array : ImuArray
        In the sensors' own axes, saturated samples masked with their margin.
    track : PollingTrack, optional
        Sampling phases of this recording.
    rests : Rests, optional
        Found if not given.
    slope : (n, 3) ndarray, optional
        Derivative of the mean rate (`mean_slope`); from the array itself if not given.
    sharpen : bool
        Use the derivative that the polled chips show themselves (`sharpened_slope`): it takes
        three numbers from each sample's 3 (k - 1).

    Returns
    -------
    tuple of Disagreement
        Gyros, then accelerometers (with lever arms taken off), each component minus the mean of
        all sensors, at rest and in classes of the mean rate.
    """
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
    """Return every calibrated sensor minus the mean of all, and the mean rate.

    Parameters
    ----------
    calibration, array, track, slope, sharpen
        As in `disagreement_after`.

    Returns
    -------
    gyro, accel : (n, k, 3) ndarray
        rad/s and m/s².
    rate : (n, 3) ndarray
        rad/s.
    """
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


def _no_copies(array: ImuArray) -> None:
    for i in range(array.count):
        for j in range(i):
            both = np.isfinite(array.gyro[:, i]).all(axis=1) & np.isfinite(array.gyro[:, j]).all(
                axis=1
            )
            same = (array.gyro[both, i] == array.gyro[both, j]).all(axis=1)
            moving = np.ptp(array.gyro[both, i], axis=0).max(initial=0.0) > 0.0
            if both.any() and moving and same.mean() > ALIKE:
                raise InputError(
                    f"{array.names[i]} is a copy of {array.names[j]}: their rates are equal in "
                    f"{100.0 * same.mean():.0f} % of the rows",
                    expected="sensors with noise of their own",
                    cure="leave one of them out, or check the columns",
                )


def _filtered(array: ImuArray, bandwidth: float) -> ImuArray:
    shape = array.gyro.shape
    gyro = low_pass(array.time, array.gyro.reshape(array.size, -1), bandwidth).reshape(shape)
    accel = low_pass(array.time, array.accel.reshape(array.size, -1), bandwidth).reshape(shape)
    return replace(array, gyro=gyro, accel=accel)


def _poses(
    array: ImuArray,
    forces: AccelerometerFit | None,
    rests: Rests,
    gravity: float,
) -> PoseFit | None:
    """Compare the mean accelerometer with gravity in every static pose."""
    if forces is None or rests.count == 0:
        return None
    still = np.flatnonzero(rests.rows)
    body = np.einsum(
        "kij,nkj->nki", np.linalg.inv(forces.sensor), array.accel[still] - forces.bias
    ).mean(axis=1)
    means = [np.nanmean(body[rests.pose[still] == p], axis=0) for p in range(rests.count)]
    good = np.array([m for m in means if np.isfinite(m).all()]).reshape(-1, 3)
    return fit_poses(good, gravity)


def _assemble(
    array: ImuArray,
    gyros: GyroFit,
    forces: AccelerometerFit | None,
    poses: PoseFit | None,
    rests: Rests,
) -> ArrayCalibration:
    k = array.count
    sensor, bias = np.swapaxes(gyros.start, 1, 2), np.zeros((k, 3))
    deviation_sd, bias_sd = np.zeros((k, 3, 3)), np.zeros((k, 3))
    position, position_sd = np.array(array.mounting.position), np.zeros((k, 3))
    if forces is not None:
        sensor, bias, bias_sd = forces.sensor, forces.bias, forces.bias_sd
        deviation_sd = forces.deviation_sd
        position, position_sd = forces.position, forces.position_sd
    if poses is not None:
        # f = H (m - h) for the mean reading m: h is in the mean as H h is in the force, and each
        # sensor shows that its own way
        shown = sensor @ poses.matrix
        bias = bias + np.einsum("kij,j->ki", shown, poses.bias)
        bias_sd = np.sqrt(bias_sd**2 + np.einsum("kij,j->ki", shown**2, poses.bias_sd**2))
        deviation_sd = np.hypot(deviation_sd, poses.matrix_sd)
    track = gyros.track
    return ArrayCalibration(
        array.names, gyros.start, gyros.sensor, gyros.deviation_sd, gyros.bias, gyros.bias_sd,
        sensor, deviation_sd, bias, bias_sd, position, position_sd, gyros.delay, gyros.delay_sd,
        None if track is None else track.period,
        np.zeros(k) if track is None else track.beat,
        gyros.noise, rests.count,
        None if poses is None else (poses.before, poses.deviation),
    )  # fmt: skip


def _nominal(array: ImuArray, gyros: GyroFit, rests: Rests) -> tuple[Disagreement, ...]:
    """Disagreement by the nominal mounting, biases taken off, nothing else corrected."""
    values = []
    for sensors in (array.gyro, array.accel):
        turned = np.einsum("kij,nkj->nki", gyros.start, sensors)
        apart = turned - turned.mean(axis=1, keepdims=True)
        rows: NDArray[np.bool_] = rests.rows if rests.count else np.ones(array.size, dtype=bool)
        values.append(apart - np.nanmedian(apart[rows], axis=0))
    rate = np.einsum("kij,nkj->nki", gyros.correction, array.gyro - gyros.bias).mean(axis=1)
    found = measure_disagreement(values[0], rate, rests, "gyro")
    if not np.isnan(values[1]).all():
        found = (*found, *measure_disagreement(values[1], rate, rests, "accel"))
    return found
