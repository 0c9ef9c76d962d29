"""Calibration of the IMUs of an array against each other: `calibrate_array`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from schuler.arrays.calibration.accelerometers import AccelerometerFit, fit_accelerometers
from schuler.arrays.calibration.findings import findings_of
from schuler.arrays.calibration.gyros import GyroFit, GyroModel, Timing, fit_gyros
from schuler.arrays.calibration.judging import (
    disagreement_after,
    mean_slope,
    nominal_disagreement,
)
from schuler.arrays.calibration.poses import STANDARD_GRAVITY, PoseFit, fit_poses
from schuler.arrays.calibration.result import ArrayCalibration
from schuler.arrays.calibration.rows import (
    MARGIN,
    Rests,
    find_rests,
    low_passed,
    mask_saturated,
    mask_stuck,
)
from schuler.arrays.calibration.turns import fit_turns
from schuler.arrays.clocks.delays import require_several, shift
from schuler.arrays.clocks.polling import sharpened_slope
from schuler.arrays.clocks.resampling import rate_of_change
from schuler.arrays.redundant import refuse_copies
from schuler.data import ImuArray
from schuler.errors import InputError
from schuler.types import FloatArray


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
        Delays between the sensors, see `schuler.arrays.calibration.gyros.fit_gyros`.
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

    Examples
    --------
    >>> import numpy as np
    >>> import schuler
    >>> rng, time = np.random.default_rng(1), np.arange(2_000) / 50.0
    >>> rate = np.stack([np.sin(f * time) for f in (2.3, 3.1, 4.7)], axis=1)[:, None]
    >>> force = rate * 2.0 + (0.0, 0.0, 9.81)
    >>> gyro = rate + 1e-3 * rng.standard_normal((2_000, 4, 3))
    >>> accel = force + 1e-2 * rng.standard_normal((2_000, 4, 3))
    >>> array = schuler.ImuArray(time, gyro, accel, schuler.Mounting.aligned(4))
    >>> found = schuler.calibrate_array(array)
    >>> found.names
    ('imu 1', 'imu 2', 'imu 3', 'imu 4')
    """
    require_several(array)
    _all_there(array)
    refuse_copies(array)
    array, stuck = mask_stuck(array)
    masked, saturated = mask_saturated(array, margin)
    rests = find_rests(masked)
    used = masked if bandwidth is None else low_passed(masked, bandwidth)
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
            used.time, shifted, turned, motion, used.mounting.position, rests, model=accel_model
        )
    poses = _poses(used, forces, rests, gravity)
    if poses is not None and forces is not None:
        # once more, with what gravity says of the mean: lever arms have its scale
        forces = fit_accelerometers(
            used.time, shifted, turned, motion, forces.position, rests, model=accel_model,
            mean_sensor=np.asarray(np.linalg.inv(poses.matrix), dtype=np.float64),
        )  # fmt: skip
    calibration = _assemble(array, gyros, forces, poses, rests)
    turns = None
    if forces is not None and rests.count > 1:
        means = _pose_means(used, calibration.accel_correction, calibration.accel_bias, rests)
        turns = fit_turns(used.time, motion.rate, rests, means)
    before = nominal_disagreement(calibration, used, rests)
    after = disagreement_after(calibration, used, gyros.track, rests, motion.slope)
    found = findings_of(array, gyros, forces, poses, rests, turns, saturated, stuck)
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


def _all_there(array: ImuArray) -> None:
    for i, name in enumerate(array.names):
        if np.isnan(array.gyro[:, i]).any(axis=1).all():
            raise InputError(
                f"{name} has no gyros, or never all three at once",
                expected="three axes of angular rate in every IMU",
                cure="leave it out of the array",
            )


def _poses(
    array: ImuArray, forces: AccelerometerFit | None, rests: Rests, gravity: float
) -> PoseFit | None:
    """Compare the mean accelerometer with gravity in every static pose."""
    if forces is None or rests.count == 0:
        return None
    correction = np.asarray(np.linalg.inv(forces.sensor), dtype=np.float64)
    means = _pose_means(array, correction, forces.bias, rests)
    return fit_poses(means[np.isfinite(means).all(axis=1)], gravity)


def _pose_means(
    array: ImuArray, correction: FloatArray, bias: FloatArray, rests: Rests
) -> FloatArray:
    """Mean force of all sensors in every pose, (p, 3); NaN where one is missing throughout."""
    means = np.full((rests.count, 3), np.nan)
    for p in range(rests.count):
        rows = rests.pose == p
        body = np.einsum("kij,nkj->nki", correction, array.accel[rows] - bias).mean(axis=1)
        whole = np.isfinite(body).all(axis=1)
        if whole.any():
            means[p] = body[whole].mean(axis=0)
    return means


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
