"""Solutions of several IMUs brought to one point and one set of axes: the origin of the body."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from schuler import earth
from schuler.data import NavigationSolution, Trajectory
from schuler.rotations import dcm_from_rotation_vector, rotation_vector_from_dcm
from schuler.types import FloatArray

# arms shorter than this (m) are none
NO_ARM = 1e-9


def at_lever_arm(
    trajectory: Trajectory, arm: ArrayLike, rotation: FloatArray | None = None
) -> Trajectory:
    """Return the trajectory of another point of the body, in other axes."""
    lever = np.asarray(arm, dtype=np.float64)
    c_nb = trajectory.rotation
    turned = c_nb if rotation is None else c_nb @ rotation
    if np.abs(lever).max() < NO_ARM:
        return replace(trajectory, rotation=turned)
    step = np.diff(trajectory.time)[:, None]
    rate = rotation_vector_from_dcm(c_nb[:-1].transpose(0, 2, 1) @ c_nb[1:]) / step
    rate = np.concatenate([rate[:1], rate])
    return Trajectory(
        time=trajectory.time,
        position=offset_position(trajectory.position, c_nb @ lever),
        velocity=trajectory.velocity + np.einsum("kij,kj->ki", c_nb, np.cross(rate, lever)),
        rotation=turned,
    )


def offset_position(position: FloatArray, metres: FloatArray) -> FloatArray:
    """Return positions moved by a few metres north, east, down."""
    north, east = earth.metres_per_radian(position)
    moved_by = np.stack([metres[:, 0] / north, metres[:, 1] / east, -metres[:, 2]], axis=-1)
    result: FloatArray = position + moved_by
    return result


def solution_at_lever_arm(solution: NavigationSolution, arm: ArrayLike) -> NavigationSolution:
    """Return a solution for another point of the body.

    The standard deviations stay: an arm of decimetres turns an attitude error into millimetres.
    """
    return replace(solution, trajectory=at_lever_arm(solution.trajectory, arm))


def mean_trajectory(trajectories: Sequence[Trajectory], weight: FloatArray) -> Trajectory:
    """Return the weighted mean of trajectories that differ little."""
    base = trajectories[0]
    share = np.broadcast_to(weight, (base.size, len(trajectories)))
    north, east = earth.metres_per_radian(base.position)
    scale = np.stack([north, east, -np.ones(north.size)], axis=-1)
    shift, velocity, turn = (np.zeros((base.size, 3)) for _ in range(3))
    for i, other in enumerate(trajectories):
        w = share[:, i, None]
        difference = other.position - base.position
        difference[:, 1] -= 2.0 * np.pi * np.round(difference[:, 1] / (2.0 * np.pi))
        shift += w * difference * scale
        velocity += w * other.velocity
        turn += w * rotation_vector_from_dcm(other.rotation @ base.rotation.transpose(0, 2, 1))
    return Trajectory(
        time=base.time,
        position=base.position + shift / scale,
        velocity=velocity,
        rotation=dcm_from_rotation_vector(turn) @ base.rotation,
    )
