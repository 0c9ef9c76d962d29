"""One IMU calibrated by hand: static poses for the accelerometers, turns between them for gyros.

No turntable: gravity has one length in every pose, which shows bias, scale and misalignment of the
accelerometers, and gravity carried from pose to pose by the rates shows those of the gyros. What
the gyros show in the poses, where nothing turns, is their bias and what they feel of the force.
"""

from __future__ import annotations

import numpy as np

from schuler.arrays.calibration.poses import LEAST, STANDARD_GRAVITY, PoseFit, fit_poses
from schuler.arrays.calibration.rows import Rests, find_rests
from schuler.arrays.calibration.turns import TurnFit, fit_turns
from schuler.data import ImuArray, ImuRecording
from schuler.data.imu_calibration import ImuCalibration
from schuler.errors import EstimationError, InputError
from schuler.types import FloatArray

FELT = 4.0
"""Standard deviations at which a gyro is believed to feel the force."""


def calibrate_imu(imu: ImuRecording, *, gravity: float = STANDARD_GRAVITY) -> ImuCalibration:
    """Calibrate one IMU that was laid down in several poses and turned by hand between them.

    Parameters
    ----------
    imu : ImuRecording
        At rest for two seconds or more in each of 12 or more poses, spread over all directions;
        poses are found by themselves. Turning about all axes between them shows the gyros.
    gravity : float
        Local gravity, m/s².

    Returns
    -------
    ImuCalibration
        With standard errors. What cannot be told is left as it is, and said.

    Raises
    ------
    InputError
        A recording without gyros or accelerometers.
    EstimationError
        Too few poses, or poses that leave a direction unseen.

    Examples
    --------
    >>> import numpy as np
    >>> import schuler
    >>> rng, turn = np.random.default_rng(1), np.sin(np.pi * (np.arange(100) + 0.5) / 100)
    >>> up, attitude, gyro, accel = np.array([0.0, 0.0, 9.80665]), np.eye(3), [], []
    >>> for vector in rng.normal(0.0, 1.0, (18, 3)):
    ...     for share in (*np.zeros(300), *np.pi / 200 * turn):
    ...         gyro.append(50.0 * share * vector)
    ...         accel.append(attitude.T @ up)
    ...         attitude = attitude @ schuler.dcm_from_rotation_vector(share * vector)
    >>> shape = (len(gyro), 3)
    >>> gyro = np.array(gyro) + 0.01 + rng.normal(0.0, 0.002, shape)
    >>> accel = np.array(accel) + 0.1 + rng.normal(0.0, 0.02, shape)
    >>> imu = schuler.ImuRecording(np.arange(shape[0]) / 50.0, gyro, accel)
    >>> found = schuler.calibrate_imu(imu)
    >>> found.poses, np.round(found.accel_bias, 2)
    (18, array([0.1, 0.1, 0.1]))
    """
    if np.isnan(imu.accel).any() or np.isnan(imu.gyro).any():
        raise InputError(
            "channels that are missing or have gaps", expected="three gyros and accelerometers"
        )
    rests = find_rests(ImuArray.from_recordings([imu]))
    force, rate = _pose_means(imu.accel, rests), _pose_means(imu.gyro, rests)
    fit = fit_poses(force, gravity)
    if fit is None:
        raise EstimationError(
            f"{rests.count} static poses that do not tell bias, scale and misalignment",
            expected=f"at least {LEAST} poses in all directions, two seconds or more each",
            cure="lay the IMU on each face, edge and corner and leave it alone there",
        )
    felt = (force - fit.bias) @ fit.matrix
    bias, bias_sd, feeling, feeling_sd, said = _gyro_at_rest(rate, felt)
    free = imu.gyro - bias - ((imu.accel - fit.bias) @ fit.matrix) @ feeling.T
    turns = fit_turns(imu.time, free, rests, felt)
    return ImuCalibration(
        imu.name,
        fit.matrix,
        fit.matrix_sd,
        fit.bias,
        fit.bias_sd,
        np.eye(3) if turns is None else turns.matrix,
        np.zeros((3, 3)) if turns is None else turns.matrix_sd,
        bias,
        bias_sd,
        feeling,
        feeling_sd,
        fit.poses,
        0 if turns is None else turns.turns,
        fit.before,
        fit.deviation,
        (*_findings(fit, turns), *said),
    )


def calibrate_magnetometer(field: FloatArray, strength: float | None = None) -> PoseFit:
    """Find hard and soft iron from readings in many directions, (n, 3), any unit.

    The field is matrix (reading - bias): the bias is the hard iron, the matrix takes soft iron
    away. Without a known strength the mean of the centred readings stands in for it.
    """
    readings = np.asarray(field, dtype=np.float64)
    middle = 0.5 * (readings.max(axis=0) + readings.min(axis=0))
    length = np.linalg.norm(readings - middle, axis=1)
    wanted = float(np.mean(length)) if strength is None else strength
    fit = fit_poses(readings - middle, wanted)
    if fit is None:
        raise EstimationError(
            "readings of the magnetometer that do not tell hard and soft iron",
            expected=f"at least {LEAST} readings in all directions",
            cure="turn it about all axes, away from iron",
        )
    return PoseFit(
        fit.matrix, fit.matrix_sd, fit.bias + middle, fit.bias_sd, fit.deviation, fit.before,
        fit.poses,
    )  # fmt: skip


def _pose_means(values: FloatArray, rests: Rests) -> FloatArray:
    means = [values[rests.pose == p].mean(axis=0) for p in range(rests.count)]
    return np.array(means).reshape(-1, 3)


def _gyro_at_rest(
    rate: FloatArray, force: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, list[str]]:
    """Bias and what the gyros feel of the force, from their means in the poses."""
    design = np.column_stack([np.ones(force.shape[0]), force])
    values = np.asarray(np.linalg.lstsq(design, rate, rcond=None)[0], dtype=np.float64)
    left = rate - design @ values
    variance = np.sum(left**2, axis=0) / max(force.shape[0] - 4, 1)
    sd = np.sqrt(np.diagonal(np.linalg.inv(design.T @ design))[:, None] * variance)
    if (np.abs(values[1:]) > FELT * sd[1:]).any():
        largest = np.degrees(np.abs(values[1:]).max()) * STANDARD_GRAVITY
        said = [f"the gyros feel the force by up to {largest:.3g} deg/s per g: taken off"]
        return values[0], sd[0], values[1:].T, sd[1:].T, said
    spread = rate.std(axis=0, ddof=1) / np.sqrt(rate.shape[0])
    none = np.zeros((3, 3))
    return rate.mean(axis=0), np.asarray(spread), none, sd[1:].T, []


def _findings(fit: PoseFit, turns: TurnFit | None) -> list[str]:
    said = [
        f"{fit.poses} static poses: the length of the force scattered by {fit.before:.3g} m/s² "
        f"before and {fit.deviation:.2g} m/s² after"
    ]
    if turns is None:
        said.append(
            "too few turns between poses, or about too few axes, for scale and axes of the gyros: "
            "they were left as they are"
        )
    else:
        said.append(
            f"gravity carried through {turns.turns} turns: {np.degrees(turns.before):.2g} deg off "
            f"before and {np.degrees(turns.deviation):.2g} deg after"
        )
    return said
