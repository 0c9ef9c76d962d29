"""A multirotor: take-off, hover, zig-zag with turns of the nose, landing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import InputError
from schuler.simulation.motions.drives import STANDARD_GRAVITY
from schuler.simulation.motions.paths import STEP, STEP_CURVATURE, STRONGEST, Waves, soft_step
from schuler.simulation.motions.profile import Profile, fit_local_profile
from schuler.types import FloatArray

KNOT_SPACING = 0.05
"""Seconds between knots: a thirtieth of the quickest move."""
AGILITY = 6.0
"""Largest horizontal acceleration, m/s²: a tilt of 31 degrees."""
TAKE_OFF = 6.0
"""Seconds to climb to the height of the flight, and to come down again."""
HOVER = 10.0
"""Seconds of hovering after take-off and before landing."""


@dataclass(frozen=True, slots=True)
class Leg:
    """A move from one hover point to the next, with a turn of the nose."""

    # start, duration: seconds
    start: float
    duration: float
    move: tuple[float, float, float]  # north, east, up, m
    turn: float = 0.0  # change of yaw, rad


def _zig_zag(start: float, stop: float, rng: np.random.Generator) -> list[Leg]:
    """Moves of 6 to 20 m to and fro across a line, that overlap by a third of their time."""
    legs: list[Leg] = []
    place = np.zeros(3)
    now, side = start, 1.0
    heading = rng.uniform(-np.pi, np.pi)
    while True:
        # back towards the start whenever 40 m away
        if np.hypot(place[0], place[1]) > 40.0:
            heading = np.arctan2(-place[1], -place[0])
        direction = heading + side * rng.uniform(0.6, 1.3)
        reach = rng.uniform(6.0, 20.0)
        seconds = float(np.sqrt(STRONGEST * reach / (rng.uniform(0.6, 1.0) * AGILITY)))
        if now + seconds > stop:
            return legs
        climb = float(np.clip(rng.uniform(-3.0, 3.0), -8.0 - place[2], 8.0 - place[2]))
        move = (reach * float(np.cos(direction)), reach * float(np.sin(direction)), climb)
        turn = float(rng.choice([0.0, 1.0]) * rng.uniform(-1.0, 1.0) * 0.6 * seconds)
        legs.append(Leg(now, seconds, move, turn))
        place, side = place + move, -side
        pause = rng.uniform(1.0, 3.0) if rng.random() < 0.15 else -seconds / 3.0
        now += seconds + pause


def _flown(legs: Sequence[Leg], time: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Position and acceleration north, east, up, and yaw."""
    place, push, yaw = np.zeros((time.size, 3)), np.zeros((time.size, 3)), np.zeros(time.size)
    for leg in legs:
        first, last = np.searchsorted(time, [leg.start, leg.start + leg.duration])
        u = (time[first:last] - leg.start) / leg.duration
        move = np.asarray(leg.move)
        place[first:last] += STEP(u)[:, None] * move
        place[last:] += move
        push[first:last] += STEP_CURVATURE(u)[:, None] * move / leg.duration**2
        yaw[first:last] += STEP(u) * leg.turn
        yaw[last:] += leg.turn
    return place, push, yaw


def thrust_attitude(acceleration: FloatArray, yaw: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the tilt at which thrust alone gives an acceleration."""
    cosine, sine = np.cos(yaw), np.sin(yaw)
    forward = cosine * acceleration[:, 0] + sine * acceleration[:, 1]
    right = cosine * acceleration[:, 1] - sine * acceleration[:, 0]
    up = STANDARD_GRAVITY + acceleration[:, 2]
    pitch = np.arctan2(-forward, up)
    return np.arctan2(right, np.hypot(forward, up)), pitch


def drone(
    duration: float = 300.0,
    rng: np.random.Generator | int = 0,
    *,
    standstill: float = 20.0,
    height: float = 20.0,
    origin: ArrayLike = (np.pi / 4, 0.13, 250.0),
) -> Profile:
    """Return a flight of a multirotor."""
    rest_at_end = 5.0
    start = standstill + TAKE_OFF + HOVER
    stop = duration - rest_at_end - TAKE_OFF - HOVER
    if not (stop - start >= 15.0 and height >= 10.0 and standstill >= 0.0):
        raise InputError(
            f"a flight of {duration:g} s at {height:g} m with {standstill:g} s of standstill",
            expected=f"{duration - stop + start + 15.0:.0f} s or more, at 10 m or higher",
        )
    legs_rng, wander_rng, yaw_rng = np.random.default_rng(rng).spawn(3)
    legs = [
        Leg(standstill, TAKE_OFF, (0.0, 0.0, height)),
        *_zig_zag(start, stop, legs_rng),
    ]
    legs.append(Leg(duration - rest_at_end - TAKE_OFF, TAKE_OFF, (0.0, 0.0, -_height(legs))))
    knots = np.linspace(0.0, duration, int(np.ceil(duration / KNOT_SPACING)) + 1)
    place, push, turned = _flown(legs, knots)
    airborne = soft_step(knots, standstill, TAKE_OFF)
    airborne = airborne - soft_step(knots, duration - rest_at_end - TAKE_OFF, TAKE_OFF)
    waves = [Waves.random(child, 0.05, 0.1, 0.5) for child in wander_rng.spawn(3)]
    wander = airborne[:, None] * np.stack([w.at(knots) for w in waves], axis=-1)
    place = place + wander
    push = push + np.gradient(np.gradient(wander, knots, axis=0), knots, axis=0)
    yaw = yaw_rng.uniform(-np.pi, np.pi) + turned
    yaw = yaw + airborne * Waves.random(yaw_rng, 0.03, 0.1, 0.5).at(knots)
    roll, pitch = thrust_attitude(push, yaw)
    euler = np.stack([roll, pitch, yaw], axis=-1)
    return fit_local_profile(knots, place, euler, np.asarray(origin, dtype=np.float64))


def _height(legs: Sequence[Leg]) -> float:
    return float(sum(leg.move[2] for leg in legs))
