"""Accelerometers of an array: lever arms, axes, scale and biases against their mean."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from schuler.arrays.calibration.regression import regress_vectors, scale_by_motion
from schuler.arrays.calibration.rows import Rests
from schuler.errors import EstimationError
from schuler.rotations import skew
from schuler.types import FloatArray

ELEMENT_PRIOR = 0.1
"""Standard deviation beforehand of an element of a sensitivity."""
BIAS_PRIOR = 5.0
"""Of a bias, m/s²."""
ARM_PRIOR = 0.3
"""Of a lever arm, m."""
STILL = 0.5
"""Seconds of rest that are averaged into one row."""
CLUSTER = 1.0
"""Seconds over which residuals may be correlated."""
ROUNDS = 4
"""Of fitting everything against the mean of what is fitted."""
FAINT_FORCE = 0.3
"""m/s²: forces that vary by less along an axis do not separate scale from bias there."""


class BodyMotion(Protocol):
    """Rate and angular acceleration of the body (n, 3), and relative delays of the IMUs (n, k)."""

    rate: FloatArray
    acceleration: FloatArray
    moved: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class AccelerometerFit:
    """Accelerometers of an array against their mean."""

    # (k, 3, 3): what an accelerometer triad shows of the force in the body, in its own axes; the
    # mean of C_bs times it over the IMUs is one, or what was given for it.
    sensor: FloatArray
    deviation: FloatArray  # (k, 3, 3): C_bs sensor - I
    deviation_sd: FloatArray  # (k, 3, 3): standard deviations of these
    # bias, bias_sd: (k, 3) differences from the mean, in the axes of the sensor, m/s²
    bias: FloatArray
    bias_sd: FloatArray
    # position, position_sd: (k, 3) lever arms from the mean position, in the body, m
    position: FloatArray
    position_sd: FloatArray
    unseen: FloatArray  # (m, 3): axes of the body along which the force hardly varied
    arms_seen: bool  # whether there was rotation enough for lever arms
    rows: int  # rows that the fit rests on


def arm_matrix(rate: FloatArray, angular_acceleration: FloatArray) -> FloatArray:
    """Return what turns a lever arm into the specific force that rotation adds at its end."""
    cross = skew(rate)
    return np.asarray(skew(angular_acceleration) + cross @ cross)


def fit_accelerometers(
    time: FloatArray,
    accel: FloatArray,
    start: FloatArray,
    motion: BodyMotion,
    position: FloatArray,
    rests: Rests,
    *,
    model: str = "matrix",
    mean_sensor: FloatArray | None = None,
) -> AccelerometerFit:
    """Fit what every accelerometer triad shows of the mean force of all, and where it sits."""
    k = accel.shape[1]
    turned = np.einsum("kij,nkj->nki", start, accel)
    arms = position - position.mean(axis=0)
    tensor, delay = arm_matrix(motion.rate, motion.acceleration), motion.moved
    good = np.isfinite(turned).all(axis=(1, 2)) & np.isfinite(tensor).all(axis=(1, 2))
    rows = _still_rows(time, turned, tensor, good & rests.rows, rests)
    lively = np.flatnonzero(good & ~rests.rows & np.isfinite(delay).all(axis=1))
    slope = _slope(time, turned.mean(axis=1))
    lively = lively[np.isfinite(slope[lively]).all(axis=1)]
    if rows.turned.shape[0] + lively.size < 50:
        raise EstimationError(
            f"{rows.turned.shape[0] + lively.size} rows in which all accelerometers are there",
            expected="at least 50",
        )
    shown = np.concatenate([rows.turned, turned[lively]])
    shown[rows.turned.shape[0] :] += delay[lively][..., None] * slope[lively][:, None]
    arm = np.concatenate([rows.tensor, tensor[lively]])
    when = np.concatenate([rows.time, time[lively]])
    cluster = np.floor((when - time[0]) / CLUSTER).astype(np.int64)
    turning = np.concatenate(
        [np.zeros(rows.turned.shape[0]), np.linalg.norm(tensor[lively], axis=(1, 2))]
    )
    common = np.eye(3) if mean_sensor is None else mean_sensor
    relative, offset = common[None].repeat(k, axis=0), np.zeros((k, 3))
    force = np.asarray(np.mean(shown - np.einsum("mij,kj->mki", arm, arms), axis=1))
    projector, unseen = _varied(force)
    priors = np.concatenate(
        [np.full(9, ELEMENT_PRIOR if model == "matrix" else 1e-9), np.full(3, BIAS_PRIOR),
         np.full(3, ARM_PRIOR)]
    )  # fmt: skip
    for turn in range(ROUNDS):
        free = shown - np.einsum("kij,mjl,kl->mki", relative, arm, arms) - offset
        force = np.asarray(np.einsum("kij,mkj->mki", np.linalg.inv(relative), free).mean(axis=1))
        scale = _scales(free - np.einsum("kij,mj->mki", relative, force), turning)
        values, sds = np.empty((k, 15)), np.empty((k, 15))
        for i in range(k):
            # a sensor with deviations shows its own place with them
            place = force + arm @ arms[i]
            design = _design(place, relative[i] @ arm, projector)
            target = shown[:, i] - place
            # lever arms first: they are held while the rest settles, and fitted positions last
            prior = (
                priors if turn >= ROUNDS - 2 else np.concatenate([priors[:12], np.full(3, 1e-9)])
            )
            if turn == 0 and not arms.any():
                prior = priors
            fit = regress_vectors(design, target, scale, cluster, prior)
            values[i], sds[i] = fit.values, fit.standard_deviation
        relative = np.eye(3) + values[:, :9].reshape(k, 3, 3)
        relative = relative @ np.linalg.inv(relative.mean(axis=0)) @ common
        offset = values[:, 9:12] - values[:, 9:12].mean(axis=0)
        arms = arms + values[:, 12:] - values[:, 12:].mean(axis=0)
    back = np.swapaxes(start, 1, 2)
    seen_arms = bool((sds[:, 12:] < 0.2 * ARM_PRIOR).all())
    return AccelerometerFit(
        back @ relative, relative - np.eye(3), sds[:, :9].reshape(k, 3, 3),
        np.einsum("kij,kj->ki", back, offset), sds[:, 9:12],
        position.mean(axis=0) + (arms if seen_arms else position - position.mean(axis=0)),
        sds[:, 12:], unseen, seen_arms, int(shown.shape[0]),
    )  # fmt: skip


@dataclass(slots=True)
class _Still:
    time: FloatArray
    turned: FloatArray
    tensor: FloatArray


def _still_rows(
    time: FloatArray, turned: FloatArray, tensor: FloatArray, rows: NDArray[np.bool_], rests: Rests
) -> _Still:
    """Means over half seconds of rest."""
    index = np.flatnonzero(rows)
    if index.size == 0:
        empty = np.zeros((0, 3, 3))
        return _Still(np.zeros(0), np.zeros((0, *turned.shape[1:])), empty)
    label = rests.pose[index] * 1_000_000 + ((time[index] - time[0]) / STILL).astype(np.int64)
    _, first, counts = np.unique(label, return_index=True, return_counts=True)
    share = counts[:, None, None]
    return _Still(
        time[index[first]],
        np.add.reduceat(turned[index], first, axis=0) / share,
        np.add.reduceat(tensor[index], first, axis=0) / share,
    )


def _slope(time: FloatArray, values: FloatArray) -> FloatArray:
    from schuler.arrays.clocks.resampling import rate_of_change

    return rate_of_change(time, np.asarray(values))


def _scales(residual: FloatArray, motion: FloatArray) -> FloatArray:
    """Noise of the averaged rests and of motion, each by its class."""
    scale = np.empty(motion.size)
    still = motion == 0.0
    for rows in (still, ~still):
        if np.count_nonzero(rows) > 0:
            scale[rows] = scale_by_motion(residual[rows], motion[rows])
    return scale


def _varied(force: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Projector on the axes along which the force varied, and the others."""
    around = force - np.median(force, axis=0)
    values, axes = np.linalg.eigh(around.T @ around / force.shape[0])
    still = values < FAINT_FORCE**2
    seen = axes[:, ~still]
    return np.asarray(seen @ seen.T), np.asarray(axes[:, still].T)


def _design(force: FloatArray, arm: FloatArray, projector: FloatArray) -> FloatArray:
    """Columns: elements of E (by rows), bias, lever arm."""
    seen = force @ projector
    design = np.zeros((force.shape[0], 3, 15))
    for i in range(3):
        design[:, i, 3 * i : 3 * i + 3] = seen
    design[:, :, 9:12] = np.eye(3)
    design[:, :, 12:] = arm
    return design
