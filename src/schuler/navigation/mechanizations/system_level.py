"""Redundancy at system level: several finished solutions, their average and their vote.

S002, Fig 2: every IMU is integrated with GNSS by itself, and faults show in the solutions. Their
errors are not independent, as they share the receiver and the alignment; the covariance of the
average comes from the stacked filter, which keeps the covariance between the solutions.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler import earth
from schuler.data import Trajectory
from schuler.rotations import rotation_vector_from_dcm
from schuler.types import FloatArray

# a solution is outvoted when it is so many of its own standard deviations from the median of all,
# and heard again below the second number
OUTVOTED = 5.0
HEARD_AGAIN = 3.0


@dataclass(frozen=True, slots=True, eq=False)
class Vote:
    """Which solutions are averaged when.

    Parameters
    ----------
    heard : (n, k) ndarray of bool
        False where a solution is outvoted.
    distance : (n, k) ndarray
        Largest distance of any component from the median of all, in its standard deviations.
    """

    heard: NDArray[np.bool_]
    distance: FloatArray

    @property
    def share_outvoted(self) -> FloatArray:
        """Share of the time at which each solution is outvoted, (k,)."""
        share: FloatArray = 1.0 - self.heard.mean(axis=0)
        return share

    def weight(self, base: FloatArray) -> FloatArray:
        """Return weights of those that are heard."""
        weight = self.heard * base
        whole: FloatArray = weight / weight.sum(axis=1, keepdims=True)
        return whole


def vote(trajectories: Sequence[Trajectory], sd: FloatArray) -> Vote:
    """Let three solutions or more vote: who is far from the median is not heard."""
    k, n = len(trajectories), trajectories[0].size
    base = trajectories[0]
    north, east = earth.metres_per_radian(base.position)
    scale = np.stack([north, east, -np.ones(north.size)], axis=-1)
    value = np.empty((n, k, 9))
    for i, other in enumerate(trajectories):
        value[:, i, :3] = (other.position - base.position) * scale
        value[:, i, 3:6] = other.velocity
        value[:, i, 6:] = -rotation_vector_from_dcm(
            other.rotation @ base.rotation.transpose(0, 2, 1)
        )
    away = np.abs(value - np.median(value, axis=1, keepdims=True)) / np.maximum(sd, 1e-12)
    distance = away.max(axis=2)
    heard = np.ones((n, k), dtype=bool)
    if k < 3:
        return Vote(heard, distance)
    for i in range(k):
        decided = np.where(
            distance[:, i] > OUTVOTED, 0, np.where(distance[:, i] < HEARD_AGAIN, 1, -1)
        )
        last = np.maximum.accumulate(np.where(decided >= 0, np.arange(n), -1))
        heard[:, i] = np.where(last >= 0, decided[np.maximum(last, 0)] == 1, True)
    # never fewer than half: keep the nearest
    rank = distance.argsort(axis=1).argsort(axis=1)
    few = heard.sum(axis=1) < (k + 1) // 2
    heard[few] = rank[few] < (k + 1) // 2
    return Vote(heard, distance)
