"""Angular rate beyond the range of the gyros, from accelerometers at known places on the body.

A turning body pushes accelerometers apart: w x (w x r) + w' x r. With four or more of them that
tells the rate but for its sign, which saturated gyros still show. Gyros that are in range and
accelerometers are joined by maximum likelihood, sample by sample, with the Cramér-Rao bound.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from schuler.arrays.calibration.rows import NEAR
from schuler.arrays.redundant import RedundantSensors, redundant_sensors
from schuler.arrays.synthesis.fused_sensor import FusedSensor
from schuler.arrays.tracking import OnlineSettings, start_values
from schuler.data import ImuArray
from schuler.data.to_dict import ToDict
from schuler.errors import InputError
from schuler.rotations import skew
from schuler.screening.values import saturation_limits
from schuler.types import BoolArray, FloatArray

STEPS = 12
"""Gauss-Newton steps; the cost is a polynomial of fourth degree and a few are enough."""
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""Products of two components of the rate."""


@dataclass(frozen=True, slots=True, eq=False)
class ArrayRate:
    """Angular rate of an array by all of its sensors."""

    rate: FloatArray  # (n, 3): in the body, rad/s
    # (n, 3, 3): cramér-Rao bound: no unbiased estimate has a smaller covariance, (rad/s)²
    bound: FloatArray
    saturated: BoolArray  # (n,): samples in which some gyro was out of range


def rate_from_array(
    gyros: RedundantSensors,
    accels: RedundantSensors,
    gyro_variance: FloatArray,
    accel_variance: FloatArray,
    *,
    gyro_range: float,
    accel_bias: FloatArray | None = None,
) -> ArrayRate:
    """Return the angular rate of a body from gyros and accelerometers of an array.

    Parameters
    ----------
    gyros, accels : RedundantSensors
        Of one array, from `redundant_sensors`.
    gyro_variance, accel_variance : (M,) ndarray
        Of a sample of every axis, (rad/s)² and (m/s²)².
    gyro_range : float
        Full scale of the gyros, rad/s: samples next to it are out of range.
    accel_bias : (M,) ndarray, optional
        Differences between the accelerometers' biases, m/s².

    Returns
    -------
    ArrayRate
        With the Cramér-Rao bound of every sample.

    Raises
    ------
    InputError
        Fewer than four IMUs at different places, or a range that is not positive.

    Notes
    -----
    Skog, Nilsson, Händel and Nehorai, Inertial sensor arrays, maximum likelihood, and Cramér-Rao
    bound, IEEE Trans. Signal Processing 64 (2016): specific force and angular acceleration are
    linear and eliminated, the rate is found by Gauss-Newton.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> rng, place = np.random.default_rng(0), schuler.tetrahedron_mounting(0.1)
    >>> w = np.array([0.0, 0.0, 50.0])
    >>> turn = schuler.rotations.skew(w) @ schuler.rotations.skew(w)
    >>> gyro = np.clip(place.rotation.transpose(0, 2, 1) @ w, -35.0, 35.0)
    >>> accel = np.einsum("kba,kb->ka", place.rotation, place.position @ turn.T)
    >>> array = schuler.ImuArray(
    ...     np.arange(9) / 100.0,
    ...     gyro + 0.01 * rng.standard_normal((9, 4, 3)),
    ...     accel + 0.01 * rng.standard_normal((9, 4, 3)),
    ...     place,
    ... )
    >>> found = schuler.rate_from_array(
    ...     schuler.redundant_sensors(array, "gyro"),
    ...     schuler.redundant_sensors(array, "accel"),
    ...     np.full(12, 1e-4),
    ...     np.full(12, 1e-4),
    ...     gyro_range=35.0,
    ... )
    >>> bool(np.allclose(found.rate, w, atol=0.1))
    True
    """
    if not gyro_range > 0.0:
        raise InputError(f"a range of {gyro_range:g} rad/s", expected="a positive number")
    quadratic, by = _eliminated(accels, accel_variance)
    shown = gyros.measurements
    within = np.abs(shown) < (1.0 - NEAR) * gyro_range
    weight = np.where(within, 1.0 / gyro_variance, 0.0)
    information = np.einsum("nm,ma,mb->nab", weight, gyros.axes, gyros.axes)
    pull = (weight * np.nan_to_num(shown)) @ gyros.axes
    force = accels.measurements - (0.0 if accel_bias is None else accel_bias)
    linear = force @ by
    rate, bound = _maximum_likelihood(_start(gyros), information, pull, quadratic, linear)
    missing = ~np.isfinite(force).all(axis=1)
    rate[missing], bound[missing] = np.nan, np.nan
    return ArrayRate(rate, bound, np.any(~within & np.isfinite(shown), axis=1))


def saturated_samples(gyros: RedundantSensors, gyro_range: float) -> BoolArray:
    """Samples in which some gyro is out of range."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.any(np.abs(gyros.measurements) >= (1.0 - NEAR) * gyro_range, axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class BeyondRange(ToDict):
    """Samples of an array in which gyros were out of range."""

    JSON = "gyro_range_rad_s=gyro_range samples found bound_rad_s=bound"

    gyro_range: float  # full scale of the gyros, rad/s
    samples: int  # how many had a gyro out of range
    found: int  # in how many of them the accelerometers told the rate
    # (3,): root mean square of the Cramér-Rao bound of these, along the axes of the body, rad/s
    bound: FloatArray


def gyro_range_of(gyros: RedundantSensors) -> float | None:
    """Full scale of gyros that saturate; None where they do not."""
    values = np.abs(gyros.measurements[np.isfinite(gyros.measurements)])
    limit = saturation_limits(values)[1] if values.size else np.inf
    return float(limit) if np.isfinite(limit) else None


def fuse_beyond_range(
    array: ImuArray, fused: FusedSensor, gyro_range: float, settings: OnlineSettings
) -> tuple[FusedSensor, BeyondRange | None]:
    """Fuse gyros and accelerometers where gyros are out of range.

    `fused`: the gyros, with values out of range missing.
    """
    gyros = redundant_sensors(array, "gyro")
    rows = np.flatnonzero(saturated_samples(gyros, gyro_range))
    if not rows.size:
        return fused, None
    accels = redundant_sensors(array, "accel")
    begin = start_values(accels, max(round(settings.learning * array.rate), 20))
    there = replace(gyros, time=gyros.time[rows], measurements=gyros.measurements[rows])
    force = replace(accels, time=accels.time[rows], measurements=accels.measurements[rows])
    found = rate_from_array(
        there,
        force,
        np.median(fused.deviation, axis=0) ** 2,
        begin.variance,
        gyro_range=gyro_range,
        accel_bias=begin.bias,
    )
    told = np.isfinite(found.rate).all(axis=1)
    vectors, which = fused.vectors.copy(), fused.which.copy()
    vectors[rows[told]] = found.rate[told]
    which[rows[told]] = len(fused.covariance) + np.arange(np.count_nonzero(told))
    covariance = np.concatenate([fused.covariance, found.bound[told]])
    bound = np.sqrt(np.einsum("nii->ni", found.bound[told]).mean(axis=0))
    said = BeyondRange(gyro_range, rows.size, int(np.count_nonzero(told)), bound)
    return replace(fused, vectors=vectors, covariance=covariance, which=which), said


def masked_beyond_range(array: ImuArray, gyro_range: float) -> ImuArray:
    """Return an array without the values of gyros that are out of range."""
    with np.errstate(invalid="ignore"):
        out = np.abs(array.gyro) >= (1.0 - NEAR) * gyro_range
    return replace(array, gyro=np.where(out, np.nan, array.gyro))


def _start(gyros: RedundantSensors) -> FloatArray:
    """What all gyros show, those out of range as well: their signs are right."""
    pi = np.linalg.pinv(gyros.axes)
    return np.asarray(np.nan_to_num(gyros.measurements) @ pi.T)


def _eliminated(accels: RedundantSensors, variance: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Information on the products of the rate, (6, 6), and what gives its vector, (M, 6)."""
    axes, arms = accels.axes, accels.arms
    # w x (w x r) = (w w' - |w|² 1) r, along each axis
    products = np.empty((accels.count, 6))
    for c, (i, j) in enumerate(PAIRS):
        square = np.zeros((3, 3))
        square[i, j] = square[j, i] = 1.0
        products[:, c] = np.einsum("ma,ab,mb->m", axes, square, arms)
        if i == j:
            products[:, c] -= np.sum(axes * arms, axis=1)
    # w' x r = -[r x] w', along each axis
    turned = -np.einsum("ma,mab->mb", axes, np.stack([skew(r) for r in arms]))
    nuisance = np.hstack([axes, turned])
    whiten = 1.0 / np.sqrt(variance)
    basis, size, _ = np.linalg.svd(nuisance * whiten[:, None], full_matrices=False)
    basis = basis[:, size > 1e-9 * size[0]]
    left = products * whiten[:, None]
    left = left - basis @ (basis.T @ left)
    quadratic = left.T @ left
    if np.linalg.matrix_rank(quadratic, tol=1e-9 * max(np.trace(quadratic), 1e-300)) < 3:
        raise InputError(
            f"accelerometers of {accels.units} IMUs that do not tell the rate by their places",
            expected="four or more IMUs, apart from each other, not all on one line",
            cure="give the places of the IMUs (a calibration, or a mounting with positions)",
        )
    return quadratic, left * whiten[:, None]


def _maximum_likelihood(
    start: FloatArray,
    information: FloatArray,
    pull: FloatArray,
    quadratic: FloatArray,
    linear: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Rates and bounds: the least of the gyros' squares plus q'Sq - 2 b'q of the products q."""
    rate = start.copy()
    for _ in range(STEPS):
        products, slope = _products(rate)
        gradient = np.einsum("nab,nb->na", information, rate) - pull
        gradient += np.einsum("nca,nc->na", slope, products @ quadratic - linear)
        curvature = information + np.einsum("nca,cd,ndb->nab", slope, quadratic, slope)
        rate -= np.einsum("nab,nb->na", np.linalg.pinv(curvature), gradient)
    _, slope = _products(rate)
    curvature = information + np.einsum("nca,cd,ndb->nab", slope, quadratic, slope)
    return rate, np.linalg.pinv(curvature)


def _products(rate: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Products of components, (n, 6), and their derivatives, (n, 6, 3)."""
    products = np.stack([rate[:, i] * rate[:, j] for i, j in PAIRS], axis=1)
    slope = np.zeros((len(rate), 6, 3))
    for c, (i, j) in enumerate(PAIRS):
        slope[:, c, i] += rate[:, j]
        slope[:, c, j] += rate[:, i]
    return products, slope
