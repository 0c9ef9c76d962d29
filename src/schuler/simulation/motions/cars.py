"""Drives as in the field tests of S004: a town, and a town with a motorway (spec 1.2)."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import InputError
from schuler.simulation.motions.drives import Manoeuvre, Road, drive
from schuler.simulation.motions.paths import STEEPEST
from schuler.simulation.motions.profile import Profile

KILOMETRES_PER_HOUR = 1.0 / 3.6
REST_AT_END = 10.0
"""Seconds of standstill after a drive."""
FORWARD_LIMIT = 2.2
"""Largest acceleration and braking of the drivers, m/s²."""
SIDE_LIMIT = 3.0
"""Largest acceleration in curves, m/s²."""

Block = Callable[[float, np.random.Generator], list[Manoeuvre]]


def to_speed(before: float, after: float) -> Manoeuvre:
    """Return the change from one speed to another (m/s) that a driver makes."""
    return Manoeuvre(max(3.0, STEEPEST * abs(after - before) / FORWARD_LIMIT), after)


def turning(speed: float, angle: float) -> Manoeuvre:
    """Return a turn by an angle (rad) at a speed (m/s), as fast as a driver makes it."""
    return Manoeuvre(max(4.0, STEEPEST * abs(angle) * speed / SIDE_LIMIT), speed, angle)


def side(rng: np.random.Generator) -> float:
    """Draw a side: 1 to the right, -1 to the left."""
    return 1.0 if rng.random() < 0.5 else -1.0


def _cruise(low: float, high: float, shortest: float, longest: float) -> Block:
    """A new speed (km/h), held for some seconds."""

    def block(speed: float, rng: np.random.Generator) -> list[Manoeuvre]:
        after = rng.uniform(low, high) * KILOMETRES_PER_HOUR
        return [to_speed(speed, after), Manoeuvre(rng.uniform(shortest, longest), after)]

    return block


def _bend(smallest: float, largest: float) -> Block:
    """A bend (degrees) at the speed of the road, and a straight after it."""

    def block(speed: float, rng: np.random.Generator) -> list[Manoeuvre]:
        angle = side(rng) * np.radians(rng.uniform(smallest, largest))
        return [turning(speed, angle), Manoeuvre(rng.uniform(3.0, 8.0), speed)]

    return block


def _corner(speed: float, rng: np.random.Generator) -> list[Manoeuvre]:
    """Slow down, turn by 90 degrees, and go on."""
    slow = rng.uniform(20.0, 24.0) * KILOMETRES_PER_HOUR
    after = rng.uniform(30.0, 45.0) * KILOMETRES_PER_HOUR
    return [
        to_speed(speed, slow),
        turning(slow, side(rng) * np.pi / 2),
        to_speed(slow, after),
        Manoeuvre(rng.uniform(3.0, 8.0), after),
    ]


def _stop(speed: float, rng: np.random.Generator) -> list[Manoeuvre]:
    """A red light: stop, wait some seconds, and go on."""
    after = rng.uniform(30.0, 50.0) * KILOMETRES_PER_HOUR
    return [
        to_speed(speed, 0.0),
        Manoeuvre(rng.uniform(5.0, 20.0), 0.0),
        to_speed(0.0, after),
        Manoeuvre(rng.uniform(3.0, 8.0), after),
    ]


TOWN: tuple[Block, ...] = (_cruise(30, 50, 5, 20), _corner, _bend(10, 40), _corner, _stop)
COUNTRY: tuple[Block, ...] = (_cruise(55, 85, 5, 20), _bend(10, 45), _corner, _bend(5, 30))
MOTORWAY: tuple[Block, ...] = (_cruise(90, 123, 10, 30), _bend(3, 15), _bend(5, 25))


def compose(
    duration: float,
    standstill: float,
    stages: Sequence[tuple[float, Sequence[Block]]],
    rng: np.random.Generator,
) -> list[Manoeuvre]:
    """Compose a drive of exactly this duration."""
    plan = [Manoeuvre(standstill, 0.0), to_speed(0.0, 40.0 * KILOMETRES_PER_HOUR)]
    elapsed, speed = sum(m.duration for m in plan), plan[-1].speed
    left = duration - elapsed - to_speed(speed, 0.0).duration - REST_AT_END
    if left < 10.0:
        raise InputError(
            f"a drive of {duration:g} s with {standstill:g} s of standstill before it",
            expected=f"{duration - left + 10.0:.0f} s or more",
        )
    for share, blocks in stages:
        stage_end = elapsed + share * duration
        while elapsed < stage_end:
            for k in rng.permutation(len(blocks)):
                part = blocks[k](speed, rng)
                after = elapsed + sum(m.duration for m in part)
                if after + to_speed(part[-1].speed, 0.0).duration + REST_AT_END > duration:
                    stage_end = elapsed
                    break
                plan, elapsed, speed = plan + part, after, part[-1].speed
    brake = to_speed(speed, 0.0)
    hold = duration - elapsed - brake.duration - REST_AT_END
    if hold > 0.0:
        plan.append(Manoeuvre(hold, speed))
    return [*plan, brake, Manoeuvre(REST_AT_END, 0.0)]


def _car(
    plan_stages: Sequence[tuple[float, Sequence[Block]]],
    duration: float,
    rng: np.random.Generator | int,
    standstill: float,
    origin: ArrayLike,
) -> Profile:
    plan_rng, road_rng, heading_rng = np.random.default_rng(rng).spawn(3)
    return drive(
        compose(duration, standstill, plan_stages, plan_rng),
        origin=origin,
        heading=heading_rng.uniform(-np.pi, np.pi),
        road=Road.random(road_rng),
    )


def car_urban(
    duration: float = 1038.0,
    rng: np.random.Generator | int = 0,
    *,
    standstill: float = 60.0,
    origin: ArrayLike = (np.pi / 4, 0.13, 250.0),
) -> Profile:
    """Return a drive through a town, as trajectory 1 of S004 (17.3 min).

    Cruises of 20 to 50 km/h, corners of 90 degrees, bends, red lights of 5 to 20 s, slopes of a
    few per cent; at rest before and after.
    """
    return _car([(1.0, TOWN)], duration, rng, standstill, origin)


def car_mixed(
    duration: float = 903.0,
    rng: np.random.Generator | int = 0,
    *,
    standstill: float = 60.0,
    origin: ArrayLike = (np.pi / 4, 0.13, 250.0),
) -> Profile:
    """Return a drive through town, motorway and country, as trajectory 2 of S004 (15.05 min).

    20 to 123 km/h, where 123 km/h is reached and held on the motorway; at rest before and after.
    """
    fastest = (_cruise(123, 123, 20, 30),)
    once = 1e-9
    stages = [(0.2, TOWN), (once, fastest), (0.35, MOTORWAY), (1.0, COUNTRY)]
    return _car(stages, duration, rng, standstill, origin)
