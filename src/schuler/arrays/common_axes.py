"""Whether the axes of an array's IMUs are what its mounting says: rates and gravity must agree.

What is compared in wrong axes looks like faults of all sensors at once, and what is fused in them
is wrong in silence. Where the array turns, the rates of any two IMUs show how they are turned
against each other; where it rests, gravity shows it but for turns about gravity itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from schuler.data import ImuArray
from schuler.errors import EstimationError, InputError
from schuler.types import BoolArray, FloatArray

if TYPE_CHECKING:
    from schuler.arrays.calibration.rotation import RelativeRotation

RATE_BLOCK, FORCE_BLOCK = 0.25, 1.0
"""Seconds over which rates and forces are averaged: vibration and timing leave nothing then."""
SMALLEST_TURN = float(np.radians(3.0))
"""Turns between rates below this are left to calibration."""
DEVIATIONS = 4.0
"""Standard deviations of a turn that it must exceed."""
EXPLAINED = 0.7
"""Of the disagreement of two gyros, what a turn must leave at most to be its cause."""
LARGEST_ANGLE = float(np.radians(10.0))
"""Between gravity in two IMUs: biases of 0.1 g in both do not make more."""
NORM_TOLERANCE = 0.1
"""A force that is as long as that of the others to this share is not broken, but turned."""
ROTATION_FORCE = 0.5
"""Centripetal acceleration between IMUs beyond which their forces are not compared, m/s²."""
LIVELY = 0.75
"""Share of the means that is too calm to tell what turns explain."""
GRAVITY = (8.8, 10.8)
"""Median length of a specific force in which gravity can be recognised, m/s²."""
COMMON_MOTION = 0.6
"""Correlation of the rates' lengths below which two IMUs do not share a motion."""
MOVING = float(np.radians(3.0))
"""Spread of the rates' lengths from which there is a motion to share, rad/s."""
SMOOTH = 0.5
"""Correlation of neighbouring samples from which rates are those of a motion, not noise."""
MOST_ROWS = 20_000
"""Means that are enough to find how IMUs are turned."""


@dataclass(frozen=True, slots=True, eq=False)
class AxesCheck:
    """What rates and gravity say of the axes of an array."""

    reference: int  # IMU with which most others agree
    # (k, 3, 3): rotation that takes the rates of each IMU, turned by its mounting, into those of
    # the reference; NaN where the motion does not show it.
    turn: FloatArray
    # (k,): standard deviation of that rotation, about the axis that is seen worst, rad
    turn_sd: FloatArray
    turned: BoolArray  # (k,): IMUs whose axes are not where the mounting says
    broken: BoolArray  # (k,): IMUs whose accelerometer contradicts the others without being turned
    # (k,): between gravity in each IMU and in the reference, rad; NaN where it is not seen.
    gravity_angle: FloatArray
    force: FloatArray  # (k,): median length of the specific force of each, m/s²


def check_axes(array: ImuArray) -> AxesCheck:
    """Compare rates and gravity of all IMUs of an array."""
    body = array.in_body()
    rates = _means(body.gyro, body.rate, RATE_BLOCK)
    forces = _means(body.accel, body.rate, FORCE_BLOCK)
    # where rotation pushes IMUs apart they do not feel one force
    square = _means(body.gyro**2, body.rate, FORCE_BLOCK).sum(axis=2)
    spin = np.median(np.nan_to_num(square), axis=1)
    reach = float(np.ptp(array.mounting.position, axis=0).max())
    forces[spin * reach > ROTATION_FORCE] = np.nan
    force = np.array([_median(np.linalg.norm(forces[:, i], axis=1)) for i in range(array.count)])
    turn, turn_sd, known, apart = _turns(rates)
    angles = _gravity_angles(forces)
    far = np.nan_to_num(angles) > LARGEST_ANGLE
    agreeing = (~(apart | far)).sum(axis=1)
    reference = int(np.argmax(agreeing))
    seen = (force > GRAVITY[0]) & (force < GRAVITY[1])
    length = force[reference] if seen[reference] else np.nan
    with np.errstate(invalid="ignore"):
        off = np.abs(force / length - 1.0) > NORM_TOLERANCE
    stranger = far[reference]
    # rates that agree say that it is the accelerometer
    turned = apart[reference] | (stranger & ~off & ~known[reference])
    broken = (stranger | off) & ~turned
    relative = np.swapaxes(turn[reference], 0, 1) @ turn if known.any() else turn
    return AxesCheck(
        reference, relative, turn_sd[reference], turned, broken, angles[reference], force
    )


def require_common_axes(array: ImuArray, *, broken_may_pass: bool = False) -> None:
    """Raise when the axes of an array are not what its mounting says.

    An accelerometer that contradicts the others is refused too, unless `broken_may_pass`: to say
    which one it is, is what fault detection is for.
    """
    if array.count < 2:
        return
    _require_one_motion(array, one_may_differ=broken_may_pass and array.count > 2)
    found = check_axes(array)
    if found.turned.any():
        raise _turned_error(array, found)
    several = np.count_nonzero(found.broken) > 1 or array.count == 2
    if found.broken.any() and not (broken_may_pass and not several):
        raise _broken_error(array, found)


def _require_one_motion(array: ImuArray, *, one_may_differ: bool) -> None:
    """Raise where recordings are of different times, or of different bodies.

    The length of a rate knows nothing of axes. One IMU that differs may be a fault.
    """
    speed = np.linalg.norm(_means(array.gyro, array.rate, RATE_BLOCK), axis=2)
    whole = speed[np.isfinite(speed).all(axis=1)]
    if not len(whole) and np.isfinite(speed).any(axis=0).all():
        raise InputError(
            f"{array.names[0]} and the other IMUs have no moment in common",
            expected="recordings of one time",
            cure="name only files of one recording",
        )
    if len(whole) < 10:
        return
    spread = np.ptp(np.quantile(whole, [0.02, 0.98], axis=0), axis=0)
    moving = np.flatnonzero((spread > MOVING) & (_smoothness(array.gyro) > SMOOTH))
    if moving.size < 2:
        return
    alike = np.corrcoef(whole[:, moving].T) > COMMON_MOTION
    reference = int(np.argmax(alike.sum(axis=1)))
    others = [array.names[i] for i in moving[~alike[reference]]]
    if len(others) > one_may_differ:
        raise InputError(
            f"IMUs do not move as {array.names[moving[reference]]} does: {', '.join(others)}",
            expected="IMUs on one rigid body, recorded at one time",
            cure="name only files of one recording; or bring their clocks together first "
            "(schuler calibrate tells delays)",
        )


def _smoothness(rates: FloatArray) -> FloatArray:
    """Correlation of neighbouring samples of the rates of each IMU, (k,)."""
    known = np.isfinite(rates)
    mean = np.where(known, rates, 0.0).sum(axis=0) / np.maximum(known.sum(axis=0), 1)
    centred = np.where(known, rates - mean, 0.0)
    power = np.maximum(np.einsum("nkc,nkc->k", centred, centred), 1e-300)
    return np.asarray(np.einsum("nkc,nkc->k", centred[1:], centred[:-1]) / power)


def _means(vectors: FloatArray, rate: float, seconds: float) -> FloatArray:
    """Means over blocks, (m, k, 3); NaN where a value is missing."""
    n, k = vectors.shape[:2]
    block = min(max(round(seconds * rate), 1), n)
    block *= -(-n // (block * MOST_ROWS))
    whole = vectors[: n // block * block].reshape(-1, block, k, 3)
    return np.asarray(whole.mean(axis=1))


def _median(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else float("nan")


def _turns(rates: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray, BoolArray]:
    """Rotation of each IMU against a base, and which pairs are known and are turned."""
    k = rates.shape[1]
    turn, deviation = np.full((k, 3, 3), np.nan), np.full((k, k), np.inf)
    known, apart = np.zeros((k, k), dtype=bool), np.zeros((k, k), dtype=bool)
    speed = np.linalg.norm(rates, axis=2)
    whole = np.isfinite(speed).all(axis=1)
    if np.count_nonzero(whole) < 10:
        return turn, deviation, known, apart
    # the length of the rate knows nothing of axes: the base is the most ordinary gyro
    level = np.median(speed[whole], axis=1, keepdims=True)
    base = int(np.argmin(np.median(np.abs(speed[whole] - level), axis=0)))
    fits = [_aligned(rates[whole, base], rates[whole, i]) for i in range(k)]
    for i in range(k):
        for j in range(k):
            first, second = fits[i], fits[j]
            if i == j or first is None or second is None:
                continue
            variance = first.covariance * (i != base) + second.covariance * (j != base)
            deviation[i, j] = np.sqrt(np.linalg.eigvalsh(variance)[-1])
            known[i, j] = DEVIATIONS * deviation[i, j] < LARGEST_ANGLE
            between = first.rotation.T @ second.rotation
            apart[i, j] = _real(between, deviation[i, j], rates[whole, i], rates[whole, j])
    for i, fit in enumerate(fits):
        if fit is not None:
            turn[i] = fit.rotation
    return turn, deviation, known, apart


def _aligned(first: FloatArray, second: FloatArray) -> RelativeRotation | None:
    from schuler.arrays.calibration.rotation import align_rates

    try:
        found = align_rates(first, second)
    except EstimationError:
        return None
    return None if len(found.unseen) else found


def _real(turn: FloatArray, deviation: float, first: FloatArray, second: FloatArray) -> bool:
    """Whether a turn is larger than its error and explains what two gyros differ by."""
    from schuler.rotations import rotation_vector_from_dcm

    vector = rotation_vector_from_dcm(turn)
    angle = float(np.linalg.norm(vector))
    # constant differences are biases, and what is left after a turn may be scale or a fault
    a, b = first - np.median(first, axis=0), second - np.median(second, axis=0)
    length = np.linalg.norm(a, axis=1)
    rows = length >= np.quantile(length, LIVELY)
    before, after = _length(a[rows] - b[rows]), _length(a[rows] - b[rows] @ turn.T)
    return angle > max(SMALLEST_TURN, DEVIATIONS * deviation) and after < EXPLAINED * before


def _length(vectors: FloatArray) -> float:
    return float(np.median(np.linalg.norm(vectors, axis=1)))


def _gravity_angles(forces: FloatArray) -> FloatArray:
    """Median angles between what the accelerometers of any two IMUs feel, (k, k) rad."""
    length = np.linalg.norm(forces, axis=2, keepdims=True)
    felt = np.where(length > 1.0, forces / np.where(length > 1.0, length, 1.0), np.nan)
    k = forces.shape[1]
    angles = np.zeros((k, k))
    for i in range(k):
        for j in range(i):
            across = np.linalg.norm(np.cross(felt[:, i], felt[:, j]), axis=1)
            angle = np.arctan2(across, np.sum(felt[:, i] * felt[:, j], axis=1))
            angles[i, j] = angles[j, i] = _median(angle)
    return angles


def _turned_error(array: ImuArray, found: AxesCheck) -> InputError:
    said = ", ".join(_angle_said(array, found, int(i)) for i in np.flatnonzero(found.turned))
    mounting = ""
    if np.isfinite(found.turn).all():
        each = found.turn @ array.mounting.rotation
        mounting = "; the rates say --mount=" + " --mount=".join(_euler_text(c) for c in each)
    return InputError(
        f"IMUs are not turned as the mounting says, seen from {array.names[found.reference]}: "
        f"{said}",
        expected="axes in which all feel one rate and one gravity",
        cure="write a mounting.yaml beside the files, give --mount of navigate for each IMU, or "
        "let schuler calibrate find it and give its file as --calibration; axes that turn slowly "
        f"are followed by navigate --follow-axes{mounting}",
    )


def _angle_said(array: ImuArray, found: AxesCheck, imu: int) -> str:
    from schuler.rotations import rotation_vector_from_dcm

    if np.isfinite(found.turn[imu]).all():
        turn = np.degrees(np.linalg.norm(rotation_vector_from_dcm(found.turn[imu])))
        return f"rates of {array.names[imu]} by {turn:.1f} deg"
    return f"gravity in {array.names[imu]} by {np.degrees(found.gravity_angle[imu]):.0f} deg"


def _euler_text(rotation: FloatArray) -> str:
    from schuler.rotations import euler_from_dcm, orthonormalize

    angles = [float(np.degrees(a)) for a in euler_from_dcm(orthonormalize(rotation))]
    return ",".join(f"{round(a, 1) + 0.0:g}" for a in angles)


def _broken_error(array: ImuArray, found: AxesCheck) -> InputError:
    bad = ", ".join(
        f"{array.names[i]} ({found.force[i]:.2f} m/s²"
        + (
            f", {np.degrees(found.gravity_angle[i]):.0f} deg away)"
            if np.isfinite(found.gravity_angle[i])
            else ")"
        )
        for i in np.flatnonzero(found.broken)
    )
    return InputError(
        f"accelerometers contradict {array.names[found.reference]} "
        f"({found.force[found.reference]:.2f} m/s²): {bad}",
        expected="IMUs that feel the same gravity",
        cure="leave them out, or calibrate the array (schuler calibrate); schuler faults and fuse "
        "--without-faults find out which one it is",
    )
