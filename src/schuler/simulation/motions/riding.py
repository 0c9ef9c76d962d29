"""A motorcycle on a winding road, as the four IMUs of S002 rode on (spec 1.2, 8.2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from schuler.simulation.motions.cars import KILOMETRES_PER_HOUR, Block, compose, side, to_speed
from schuler.simulation.motions.drives import STANDARD_GRAVITY, Balance, Manoeuvre, Road, drive
from schuler.simulation.motions.paths import STEEPEST
from schuler.simulation.motions.profile import Profile


def _curve(speed: float, angle: float, lean: float) -> Manoeuvre:
    """A curve whose tightest point asks for this lean."""
    force = STANDARD_GRAVITY * np.tan(lean)
    return Manoeuvre(max(3.0, STEEPEST * abs(angle) * speed / force), speed, angle)


def _slalom(first: float, angles: Sequence[float], speed: float, lean: float) -> list[Manoeuvre]:
    signs = first * (-1.0) ** np.arange(len(angles))
    return [_curve(speed, s * a, lean) for s, a in zip(signs, angles, strict=True)]


def _curves(
    low: float, high: float, leans: tuple[float, float], sharp: tuple[float, float], count: int
) -> Block:
    """A new speed (km/h), then curves to either side (degrees), then a short straight."""

    def block(speed: float, rng: np.random.Generator) -> list[Manoeuvre]:
        after = rng.uniform(low, high) * KILOMETRES_PER_HOUR
        lean = np.radians(rng.uniform(*leans))
        angles = [float(np.radians(a)) for a in rng.uniform(*sharp, count)]
        return [
            to_speed(speed, after),
            *_slalom(side(rng), angles, after, lean),
            Manoeuvre(rng.uniform(1.0, 5.0), after),
        ]

    return block


WINDING: tuple[Block, ...] = (
    _curves(38, 46, (39.5, 39.5), (70.0, 110.0), 2),
    _curves(45, 60, (30.0, 39.0), (50.0, 90.0), 4),
    _curves(40, 50, (30.0, 39.0), (90.0, 170.0), 1),
    _curves(60, 80, (20.0, 35.0), (20.0, 50.0), 3),
)


def motorcycle(
    duration: float = 600.0,
    rng: np.random.Generator | int = 0,
    *,
    standstill: float = 60.0,
    origin: ArrayLike = (np.pi / 4, 0.13, 250.0),
) -> Profile:
    """Return a ride on a winding road.

    Curves to either side in which the motorcycle leans by 20 to 40 degrees, so that the force
    stays on its down axis, and turns at 0.5 to 1 rad/s; 38 to 80 km/h; at rest before and after.

    Parameters
    ----------
    duration : float
        Seconds, standstill included.
    rng : numpy.random.Generator or int
        Source of randomness, or its seed.
    standstill : float
        At the beginning, s.
    origin : (3,) array_like
        Latitude rad, longitude rad, height m.

    Returns
    -------
    Profile
        True motion.

    Raises
    ------
    InputError
        Too short for the standstill.

    Notes
    -----
    The ride of S002 section V and S000 Figs. 1 to 3.

    Examples
    --------
    >>> import schuler
    >>> round(schuler.motorcycle(120.0).duration, 6)
    120.0
    """
    plan_rng, road_rng, heading_rng = np.random.default_rng(rng).spawn(3)
    return drive(
        compose(duration, standstill, [(1.0, WINDING)], plan_rng),
        origin=origin,
        heading=heading_rng.uniform(-np.pi, np.pi),
        road=Road.random(road_rng),
        suspension=Balance(),
    )
