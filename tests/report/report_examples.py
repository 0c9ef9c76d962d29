"""Small made-up results, built straight from the nouns."""

from __future__ import annotations

import numpy as np

from schuler.data.gnss import GnssRecording
from schuler.data.trajectory import Innovations, NavigationSolution, Trajectory
from schuler.earth import geodetic_from_ned
from schuler.rotations import dcm_from_euler

ORIGIN = np.array([0.8, 0.2, 300.0])


def circle(n: int, rate: float, radius: float = 200.0, speed: float = 10.0) -> Trajectory:
    time = 1000.0 + np.arange(n) / rate
    angle = speed / radius * (time - time[0])
    ned = np.stack([radius * np.sin(angle), radius * (1 - np.cos(angle)), 0 * angle], axis=1)
    velocity = speed * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    zero = np.zeros(n)
    return Trajectory(
        time, geodetic_from_ned(ned, ORIGIN), velocity, dcm_from_euler(zero, zero, angle)
    )


def solution(
    truth: Trajectory,
    rng: np.random.Generator,
    *,
    sd: float = 0.5,
    smoothed: bool = False,
    name: str = "accel_x random walk",
) -> NavigationSolution:
    """Position errors that are exactly as large as claimed: white, `sd` m a direction."""
    n = truth.size
    ned = geodetic_from_ned(np.zeros(3), ORIGIN)
    assert np.allclose(ned, ORIGIN)
    errors = sd * rng.standard_normal((n, 3))
    position = np.array(truth.position)
    position[:, 0] += errors[:, 0] / 6.37e6
    position[:, 1] += errors[:, 1] / (6.39e6 * np.cos(ORIGIN[0]))
    position[:, 2] -= errors[:, 2]
    updates = 200
    time = np.linspace(truth.time[0], truth.time[-1], 2 * updates)
    value = rng.standard_normal((2 * updates, 3))
    return NavigationSolution(
        trajectory=Trajectory(truth.time, position, truth.velocity, truth.rotation),
        position_covariance=np.tile(np.eye(3) * sd**2, (n, 1, 1)),
        velocity_sd=np.full((n, 3), 0.05),
        attitude_sd=np.full((n, 3), 2e-3),
        sensor_error_time=truth.time[::10],
        sensor_errors=0.01 * rng.standard_normal((truth.time[::10].size, 2)).cumsum(axis=0) / 30,
        sensor_errors_sd=np.full((truth.time[::10].size, 2), 0.01),
        sensor_error_names=(name, "gyro_z Gauss-Markov"),
        innovations=Innovations(
            time=time,
            kind=("gnss position", "gnss velocity") * updates,
            value=value,
            sd=np.ones_like(value),
            nis=np.sum(value**2, axis=1),
            degrees=np.full(2 * updates, 3),
            accepted=np.sum(value**2, axis=1) < 14.0,
        ),
        settings={"lever_arm": [0.0, 0.0, 0.0]},
        smoothed=smoothed,
    )


def gnss(truth: Trajectory, every: int) -> GnssRecording:
    n = truth.time[::every].size
    return GnssRecording(
        truth.time[::every],
        truth.position[::every],
        np.full((n, 3), 1.0),
        truth.velocity[::every],
        np.full((n, 3), 0.1),
    )
