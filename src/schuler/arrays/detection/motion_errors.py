"""What calibration leaves in motion: scale, timing and lever-arm errors, seen between the sensors.

A fault is an offset that motion does not explain. How much motion explains is read from the
recording itself: squares of the differences of all pairs of sensors over half seconds, of which
one faulty unit spoils some and never most, as a sum of a floor and terms that grow with motion.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schuler.arrays.calibration.accelerometers import arm_matrix
from schuler.arrays.clocks.resampling import rate_of_change
from schuler.data import ImuArray
from schuler.types import FloatArray

WINDOW = 0.5
"""Seconds of a mean."""
SWEEPS = 50
"""Rounds of fitting variances."""
CLIP = 9.0
"""A square counts at most as so many times what is expected of it."""
CALM, LIVELY = 0.25, 0.95
"""Share of the windows that are calm, and beyond which they are lively."""
LEAST = 8
"""Windows that are needed."""
PARTS = 3
"""Of a recording, in which an error of scale must show alike."""
SURE = 4.0
"""Standard deviations of a share of the rate that it must exceed."""


@dataclass(frozen=True, slots=True)
class MotionErrors:
    """Standard deviation of what is left in half-second means of one kind of sensor.

    Parameters
    ----------
    floor : float
        Without motion, rad/s or m/s².
    scale : float
        As a share of the rate, or of the change of the force.
    timing : float
        Of the derivative, s.
    arm : float
        Of lever arms, m: of |w|² + |dw/dt|; zero for gyros.
    """

    floor: float
    scale: float
    timing: float
    arm: float


def motion_errors(array: ImuArray) -> dict[str, MotionErrors]:
    """Read what motion leaves between the sensors of an array in common axes, by kind."""
    body = array.in_body()
    rate = mean_of_present(body.gyro)
    slope = rate_of_change(body.time, rate)
    turning = arm_matrix(rate, slope)
    found = {}
    for kind, values in (("gyro", body.gyro), ("accel", body.accel)):
        if np.isnan(values).all():
            continue
        used = values
        if kind == "accel":
            used = values - np.einsum("nij,kj->nki", turning, body.mounting.position)
        moved = mean_of_present(used)
        means = _window_means(used, body.rate)
        if means.shape[0] < LEAST:
            continue
        square = _pair_squares(means - np.nanmedian(means, axis=0))
        mean = _window_means(moved, body.rate)
        level = np.zeros(3) if kind == "gyro" else np.nanmedian(mean, axis=0)
        change = _window_means(rate_of_change(body.time, moved), body.rate)
        columns = [
            np.ones(square.size),
            np.sum((mean - level) ** 2, axis=1),
            np.sum(change**2, axis=1),
        ]
        if kind == "accel":
            turned = np.sum(rate**2, axis=1) + np.linalg.norm(slope, axis=1)
            columns.append(_window_means(turned**2, body.rate))
        terms = np.stack(columns, axis=1)
        rows = np.isfinite(square) & np.isfinite(terms).all(axis=1)
        if np.count_nonzero(rows) < LEAST:
            continue
        variance = fit_variances(terms[rows], square[rows], clip=CLIP)
        # terms of motion must not explain what the calmest windows show
        moving = terms[rows, 1:] @ variance[1:]
        calm = moving <= np.quantile(moving, CALM)
        variance[0] = max(float(variance[0]), float(np.median(square[rows][calm])))
        # nor may a term that is below the floor in lively windows be taken for an error of motion
        lively = np.quantile(terms[rows], LIVELY, axis=0)
        variance[1:] = np.where(variance[1:] * lively[1:] > variance[0], variance[1:], 0.0)
        deviation = np.sqrt(np.append(variance, np.zeros(4 - variance.size)))
        found[kind] = MotionErrors(*(float(v) for v in deviation))
    return found


def proportional_errors(array: ImuArray) -> FloatArray:
    """Return what each gyro axis differs from the others by as a share of the rate, (k, 3).

    Of the changes from one half second to the next, which a lasting offset does not touch; and the
    smallest of what three parts of the motion say, as long as they agree in sign: an axis that
    breaks is not out of scale before.
    """
    body = array.in_body()
    values = body.gyro
    if np.isnan(values).all():
        return np.zeros((array.count, 3))
    means = _window_means(values, body.rate)
    rate = np.nanmedian(means, axis=1)
    steps, moved = np.diff(means - rate[:, None], axis=0), np.diff(rate, axis=0)
    known = np.isfinite(moved).all(axis=1)
    steps, moved = steps[known], moved[known]
    energy = np.cumsum(np.sum(moved**2, axis=1))
    if energy.size < PARTS * LEAST or not energy[-1] > 0.0:
        return np.zeros((array.count, 3))
    part = np.minimum((PARTS * energy / energy[-1]).astype(int), PARTS - 1)
    found = np.zeros((PARTS, array.count, 3))
    for p in range(PARTS):
        for i in range(array.count):
            for axis in range(3):
                found[p, i, axis] = _share(steps[part == p, i, axis], moved[part == p])
    same = np.abs(np.sign(found).sum(axis=0)) == PARTS
    return np.asarray(np.where(same, np.abs(found).min(axis=0), 0.0))


def _share(steps: FloatArray, moved: FloatArray) -> float:
    """Largest share of a rate in the steps of one axis that is sure; single large steps apart."""
    rows = np.isfinite(steps)
    for _ in range(2):
        if np.count_nonzero(rows) < LEAST:
            return 0.0
        x, y = moved[rows], steps[rows]
        gram = x.T @ x + 1e-12 * np.trace(x.T @ x) * np.eye(3)
        share = np.linalg.solve(gram, x.T @ y)
        left = steps - moved @ share
        spread = 1.4826 * float(np.median(np.abs(left[rows])))
        rows = np.isfinite(left) & (np.abs(left) <= 4.0 * spread)
    sd = spread * np.sqrt(np.diag(np.linalg.inv(gram)))
    sure = np.where(np.abs(share) > SURE * sd, share, 0.0)
    return float(sure[np.argmax(np.abs(sure))])


def mean_of_present(vectors: FloatArray) -> FloatArray:
    """Return the mean over the sensors that are whole, (n, 3); NaN without any."""
    whole = np.asarray(np.isfinite(vectors).all(axis=2))
    total = np.where(whole[..., None], vectors, 0.0).sum(axis=1)
    number = whole.sum(axis=1)[:, None]
    return np.asarray(np.where(number > 0, total / np.maximum(number, 1), np.nan))


def fit_variances(
    columns: FloatArray,
    square: FloatArray,
    share: FloatArray | float = 1.0,
    *,
    clip: float = np.inf,
) -> FloatArray:
    """Fit squares by a sum of terms, none negative, relative to what they explain."""
    from scipy.optimize import nnls

    size = np.maximum(columns.mean(axis=0), 1e-300)
    middle = float(np.median(square))
    explained = np.maximum(square, middle) if np.isinf(clip) else np.full(square.size, middle)
    values = np.zeros(columns.shape[1])
    for _ in range(SWEEPS):
        weight = share / np.maximum(explained, 1e-300)
        goal = np.minimum(square, clip * explained)
        values = nnls(columns / size * weight[:, None], goal * weight)[0] / size
        explained = np.maximum(columns @ values, 1e-3 * middle + 1e-300)
    return np.asarray(values)


def _window_means(values: FloatArray, rate: float) -> FloatArray:
    """Means over half seconds of what is there; NaN where less than half is."""
    length = max(round(WINDOW * rate), 1)
    count = values.shape[0] // length
    parts = values[: count * length].reshape(count, length, *values.shape[1:])
    there = np.isfinite(parts)
    number = there.sum(axis=1)
    total = np.where(there, parts, 0.0).sum(axis=1)
    return np.where(2 * number >= length, total / np.maximum(number, 1), np.nan)


def _pair_squares(means: FloatArray) -> FloatArray:
    """Variance of a component of one sensor in each window, which one bad unit does not spoil."""
    from scipy.stats import chi2

    k = means.shape[1]
    first, second = np.triu_indices(k, 1)
    square = np.sum((means[:, first] - means[:, second]) ** 2, axis=2)
    # pairs without the bad unit are (k - 2) / k of all: the middle of these
    part = 0.5 if k == 2 else 0.5 * (k - 2) / k
    known = np.isfinite(square).all(axis=1)
    found = np.full(square.shape[0], np.nan)
    found[known] = np.quantile(square[known], part, axis=1)
    return found / (2.0 * float(chi2.ppf(part, 3)))
