"""What turning from pose to pose says about the mean gyro: scale, shape and axes.

Between two static poses the rates, integrated, must take the direction of gravity in the first into
that in the second. That is the one thing in a hand-held calibration that knows the scale of all
gyros together.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schuler.arrays.calibration.rows import Rests
from schuler.rotations import dcm_from_rotation_vector
from schuler.types import FloatArray

LEAST = 8
"""Turns between poses that are needed for nine numbers, two from each."""
WORST = 0.01
"""Standard deviation of an element above which the turns do not determine it, and none is used."""
LONGEST = 30.0
"""Seconds between two poses; what drifts longer is not used."""
TUKEY = 4.685
SWEEPS = 12
STEP = 1e-6
"""Of an element, for differences."""


@dataclass(frozen=True, slots=True, eq=False)
class TurnFit:
    """The mean gyro against gravity."""

    # (3, 3): X: the rate in the axes of the accelerometers is X times the mean rate
    matrix: FloatArray
    matrix_sd: FloatArray  # (3, 3): standard deviations
    deviation: float  # robust standard deviation of a component of the direction after a turn, rad
    before: float  # the same without the matrix, rad
    turns: int  # how many turns between poses


def fit_turns(
    time: FloatArray, rate: FloatArray, rests: Rests, force: FloatArray
) -> TurnFit | None:
    """Find the linear map of the mean rate that carries gravity from pose to pose."""
    steps, first, second = _turns(time, rate, rests, force)
    if first.shape[0] < LEAST:
        return None
    matrix = np.eye(3)
    before = _scale(second - _carry(steps, matrix[None], first)[0])
    weight = np.ones(first.shape[0])
    for _ in range(SWEEPS):
        trial = np.concatenate([matrix[None], matrix + STEP * np.eye(9).reshape(9, 3, 3)])
        carried = _carry(steps, trial, first)
        residual = second - carried[0]
        jacobian = np.moveaxis((carried[1:] - carried[0]) / STEP, 0, -1)  # (t, 3, 9)
        root = np.sqrt(weight)[:, None]
        design = (root[..., None] * jacobian).reshape(-1, 9)
        change, *_ = np.linalg.lstsq(design, (root * residual).ravel(), rcond=None)
        matrix = matrix + change.reshape(3, 3)
        length = np.linalg.norm(residual, axis=1)
        limit = TUKEY * np.sqrt(2.0) * max(float(np.median(length)) / 1.1774, 1e-9)
        weight = np.where(length < limit, (1.0 - (length / limit) ** 2) ** 2, 0.0)
    residual = second - _carry(steps, matrix[None], first)[0]
    normal = np.einsum("t,tij,tik->jk", weight, jacobian, jacobian)
    if np.linalg.cond(normal) > 1e12:
        return None
    freedom = 2.0 * float(weight.sum()) - 9.0
    if freedom < 2.0:
        return None
    variance = float(np.sum(weight[:, None] * residual**2)) / freedom
    sd = np.sqrt(variance * np.diagonal(np.linalg.inv(normal))).reshape(3, 3)
    if sd.max() > WORST:
        return None
    return TurnFit(matrix, sd, _scale(residual), before, first.shape[0])


def _turns(
    time: FloatArray, rate: FloatArray, rests: Rests, force: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rotation vectors of the steps (s, t, 3), zero beyond the end, and both directions (t, 3)."""
    segments, pairs = [], []
    for p in range(rests.count - 1):
        a = int(np.flatnonzero(rests.pose == p)[-1])
        b = int(np.flatnonzero(rests.pose == p + 1)[0])
        part = rate[a : b + 1]
        known = np.isfinite(part).all() and np.isfinite(force[p : p + 2]).all()
        if not known or b <= a or time[b] - time[a] > LONGEST:
            continue
        segments.append(0.5 * (part[1:] + part[:-1]) * np.diff(time[a : b + 1])[:, None])
        pairs.append(force[p : p + 2] / np.linalg.norm(force[p : p + 2], axis=1, keepdims=True))
    if not segments:
        return np.zeros((0, 0, 3)), np.zeros((0, 3)), np.zeros((0, 3))
    steps = np.zeros((max(len(x) for x in segments), len(segments), 3))
    for t, segment in enumerate(segments):
        steps[: len(segment), t] = segment
    both = np.array(pairs)
    return steps, both[:, 0], both[:, 1]


def _carry(steps: FloatArray, matrices: FloatArray, first: FloatArray) -> FloatArray:
    """Return the directions after the turns, (m, t, 3): du/dt = -w x u in the turning body."""
    angles = np.einsum("mij,stj->smti", matrices, steps)
    direction = np.broadcast_to(first, (matrices.shape[0], *first.shape))
    for angle in angles:
        direction = np.einsum("mtij,mtj->mti", dcm_from_rotation_vector(-angle), direction)
    return np.asarray(direction)


def _scale(residual: FloatArray) -> float:
    """Robust standard deviation of a component: two of the three are free."""
    return float(np.median(np.linalg.norm(residual, axis=1))) / 1.1774
