"""How the IMU sits in the vehicle, seen from the way the vehicle moves."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schuler.data import Trajectory
from schuler.rotations import euler_from_dcm
from schuler.types import FloatArray

# slower motion says too little about the direction of travel (m/s)
SLOWEST = 3.0
# faster turning shows the lever arm and side slip instead (rad/s)
FASTEST_TURN = 0.15


@dataclass(frozen=True, slots=True, eq=False)
class MountingEstimate:
    """Vehicle (forward, right, down) from IMU."""

    rotation: FloatArray  # (3, 3): takes IMU vectors into the vehicle frame
    # (3,): scatter of the mean about forward, right, down, rad. The angle about forward rests on
    # the vehicle being level on average.
    sd: FloatArray
    seconds: float  # time of straight driving it rests on

    @property
    def angles(self) -> tuple[float, float, float]:
        """Roll, pitch, yaw in rad that turn the vehicle frame into the IMU's."""
        roll, pitch, yaw = euler_from_dcm(self.rotation)
        return float(roll), float(pitch), float(yaw)


def estimate_mounting(trajectory: Trajectory) -> MountingEstimate | None:
    """Find the mounting from a solution: a wheeled vehicle moves along its forward axis.

    The mean direction of velocity in IMU axes is forward; the mean direction of down in IMU
    axes, made square to it, is down.
    """
    speed = np.linalg.norm(trajectory.velocity, axis=1)
    step = float(np.median(np.diff(trajectory.time)))
    course = np.unwrap(np.arctan2(trajectory.velocity[:, 1], trajectory.velocity[:, 0]))
    width = max(round(0.5 / step), 1)
    turn = np.zeros(trajectory.size)
    turn[width:] = np.abs(course[width:] - course[:-width]) / (width * step)
    straight = (speed > SLOWEST) & (turn < FASTEST_TURN)
    seconds = float(straight.sum() * step)
    if seconds < 10.0:
        return None
    rotation = trajectory.rotation[straight]
    ahead = np.einsum("kij,ki->kj", rotation, trajectory.velocity[straight])
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    down = rotation[:, 2, :]
    forward = ahead.mean(axis=0)
    forward /= np.linalg.norm(forward)
    below = down.mean(axis=0)
    below -= forward * (forward @ below)
    below /= np.linalg.norm(below)
    found = np.array([forward, np.cross(below, forward), below])
    # one independent sample in about ten seconds: slopes and slip are slow
    independent = np.sqrt(max(seconds / 10.0, 1.0))
    side, up = ahead @ found[1], ahead @ found[2]
    lean = down @ found[1]
    sd = np.array([lean.std(), up.std(), side.std()]) / independent
    return MountingEstimate(rotation=found, sd=sd, seconds=seconds)
