"""A run on skis with the IMU on the skier's body, as in S002 (spec 1.2, 8.2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import InputError
from schuler.simulation.motions.paths import integrate_velocity, soft_step
from schuler.simulation.motions.profile import Profile, fit_local_profile
from schuler.types import FloatArray

KNOT_SPACING = 0.1
"""Seconds between knots: a twentieth of the quickest movement."""
SPEED = 12.0
"""On the slope, m/s."""
SLOPE = np.radians(14.0)
"""Of the piste."""
SOFT = 6.0
"""Seconds in which the skier gets going, and in which he stops."""


def ski(
    standstill: float = 150.0,
    run: float = 60.0,
    rng: np.random.Generator | int = 0,
    *,
    origin: ArrayLike = (0.8, 0.13, 2500.0),
) -> Profile:
    """Return a slalom on skis after a wait at the start.

    Parameters
    ----------
    standstill, run : float
        Seconds at rest, and of the run.
    rng : numpy.random.Generator or int
        Source of randomness, or its seed.
    origin : (3,) array_like
        Latitude rad, longitude rad, height m.

    Returns
    -------
    Profile
        True motion.

    Notes
    -----
    The run of S002 Table 1.

    Examples
    --------
    >>> import schuler
    >>> schuler.ski(60.0, 30.0).duration >= 90.0
    True
    """
    if not (run >= 20.0 and standstill >= 0.0):
        raise InputError(
            f"a run of {run:g} s after {standstill:g} s", expected="20 s or more, after 0 or more"
        )
    draw = np.random.default_rng(rng)
    swing, tilt, crouch = np.radians(draw.uniform([50, 40, 20], [60, 50, 30]))
    quicken = draw.uniform(0.0, 2.0 * np.pi)
    fall_line = draw.uniform(-np.pi, np.pi)
    look_back = standstill + run * draw.uniform(0.4, 0.6)

    def going(time: FloatArray) -> FloatArray:
        start = soft_step(time, standstill, SOFT)
        return start - soft_step(time, standstill + run - SOFT - 1.0, SOFT)

    def phase(time: FloatArray) -> FloatArray:
        # turns of 2.5 s that grow quicker and slower: 2.1 to 2.9 s, a period being two turns
        t = time - standstill
        slow = 2.0 * np.pi / 23.0
        return 2.0 * np.pi / 5.0 * (t + 0.16 / slow * (np.sin(slow * t + quicken)))

    def course(time: FloatArray) -> FloatArray:
        return np.asarray(fall_line + going(time) * swing * np.sin(phase(time)))

    def velocity(time: FloatArray) -> FloatArray:
        speed, heading = SPEED * going(time), course(time)
        level = speed * np.cos(SLOPE)
        return np.stack(
            [level * np.cos(heading), level * np.sin(heading), -speed * np.sin(SLOPE)], axis=-1
        )

    start = np.asarray(origin, dtype=np.float64)
    stop = standstill + run
    knots = np.linspace(0.0, stop, int(np.ceil(stop / KNOT_SPACING)) + 1)
    local = integrate_velocity(velocity, start, knots)
    active, angle = going(knots), phase(knots)
    # the body leads the skis: it tilts where the heading changes most, and rises between turns
    roll = active * tilt * np.cos(angle)
    pitch = active * (-SLOPE + crouch * np.cos(2.0 * angle))
    glance = soft_step(knots, look_back, 2.0) - soft_step(knots, look_back + 2.5, 2.0)
    yaw = course(knots) + 0.3 * active * swing * np.sin(angle) + glance * np.radians(110.0)
    return fit_local_profile(knots, local, np.stack([roll, pitch, yaw], axis=-1), start)
