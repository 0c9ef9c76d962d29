"""Car drives composed of manoeuvres: changes of speed and of heading that begin and end softly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import InputError
from schuler.simulation.motions.paths import (
    STEP,
    STEP_INTEGRAL,
    STEP_SLOPE,
    integrate_velocity,
)
from schuler.simulation.motions.profile import Profile, fit_local_profile
from schuler.types import FloatArray

KNOT_SPACING = 0.25
"""Seconds between the knots of a drive: a fraction of its shortest manoeuvre."""
STANDARD_GRAVITY = 9.80665
"""m/s²."""


@dataclass(frozen=True, slots=True)
class Manoeuvre:
    """A stretch of driving in which speed and heading go softly to new values."""

    duration: float  # seconds; at least one where speed or heading changes.
    speed: float  # at the end, m/s along the road
    turn: float = 0.0  # change of heading, rad, positive to the right


@dataclass(frozen=True, slots=True, eq=False)
class Road:
    """Slope and bank of a road: sums of waves along the way, flat without any."""

    # grade, bank: (k, 3) amplitude rad, wavelength m, phase rad of each wave of the climb angle (up
    # positive) and of the roll angle (right side down positive)
    grade: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    bank: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))

    @staticmethod
    def random(rng: np.random.Generator) -> Road:
        """Draw a road with slopes of a few per cent and heights of some metres."""

        def waves(count: int, amplitude: float, shortest: float, longest: float) -> FloatArray:
            return np.column_stack(
                [
                    amplitude * rng.uniform(0.5, 1.0, count),
                    np.exp(rng.uniform(np.log(shortest), np.log(longest), count)),
                    rng.uniform(0.0, 2.0 * np.pi, count),
                ]
            )

        return Road(waves(3, 0.015, 200.0, 900.0), waves(2, 0.01, 150.0, 400.0))

    def angles(self, distance: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return climb angle and bank angle along the way."""
        grade, bank = (
            np.sum(w[:, 0] * np.sin(2.0 * np.pi * distance[:, None] / w[:, 1] + w[:, 2]), axis=1)
            for w in (self.grade, self.bank)
        )
        return grade, bank


@dataclass(frozen=True, slots=True)
class Suspension:
    """How far a car leans under acceleration."""

    # nose up under forward acceleration, rad per m/s² (0.005: three degrees a g)
    pitch_gradient: float = 0.005
    # lean to the outside of a curve, rad per m/s² (0.009: five degrees a g)
    roll_gradient: float = 0.009

    def lean(self, forward: FloatArray, to_the_right: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how the body leans against the road."""
        return -self.roll_gradient * to_the_right, self.pitch_gradient * forward


@dataclass(frozen=True, slots=True)
class Balance:
    """How far a motorcycle leans: as far into the curve as keeps it from falling."""

    # nose up under forward acceleration, rad per m/s² (a soft fork: six degrees a g)
    pitch_gradient: float = 0.01

    def lean(self, forward: FloatArray, to_the_right: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how the body leans against the road."""
        return np.arctan2(to_the_right, STANDARD_GRAVITY), self.pitch_gradient * forward


@dataclass(frozen=True, slots=True, eq=False)
class Course:
    """Speed and heading along a plan at some times."""

    # speed, acceleration: (n,) along the road, m/s and m/s²
    speed: FloatArray
    acceleration: FloatArray
    # heading, heading_rate: (n,) rad and rad/s
    heading: FloatArray
    heading_rate: FloatArray
    distance: FloatArray  # (n,): metres gone


def course_along(manoeuvres: Sequence[Manoeuvre], heading: float, time: FloatArray) -> Course:
    """Evaluate a plan that starts at rest at time zero."""
    duration = np.array([m.duration for m in manoeuvres])
    ends = np.cumsum(duration)
    k = np.clip(np.searchsorted(ends, time, side="right"), 0, len(manoeuvres) - 1)
    after = np.array([m.speed for m in manoeuvres])
    before = np.concatenate([[0.0], after[:-1]])
    turn = np.array([m.turn for m in manoeuvres])
    heading_before = heading + np.concatenate([[0.0], np.cumsum(turn)[:-1]])
    way = duration * 0.5 * (before + after)  # the integral of the step is a half
    way_before = np.concatenate([[0.0], np.cumsum(way)[:-1]])
    u = np.clip((time - (ends - duration)[k]) / duration[k], 0.0, 1.0)
    step, slope = STEP(u), STEP_SLOPE(u) / duration[k]
    change = (after - before)[k]
    return Course(
        speed=before[k] + change * step,
        acceleration=change * slope,
        heading=heading_before[k] + turn[k] * step,
        heading_rate=turn[k] * slope,
        distance=way_before[k] + duration[k] * (before[k] * u + change * STEP_INTEGRAL(u)),
    )


def _check_plan(manoeuvres: Sequence[Manoeuvre]) -> None:
    speed = 0.0
    for k, m in enumerate(manoeuvres):
        changes = m.speed != speed or m.turn != 0.0
        if not (m.duration >= (1.0 if changes else 0.0) and m.duration > 0.0 and m.speed >= 0.0):
            raise InputError(
                f"{m} as number {k + 1}",
                expected="a speed of zero or more, and a second or more for any change",
            )
        if m.turn != 0.0 and m.speed == 0.0 and speed == 0.0:
            raise InputError(f"{m} as number {k + 1} turns on the spot", expected="a moving car")
        speed = m.speed
    if sum(m.duration for m in manoeuvres) < 2.0:
        raise InputError("a drive of less than two seconds", expected="more manoeuvres")


def course_velocity(course: Course, grade: FloatArray) -> FloatArray:
    """Return the velocity of a course on a slope."""
    level = course.speed * np.cos(grade)
    return np.stack(
        [
            level * np.cos(course.heading),
            level * np.sin(course.heading),
            course.speed * np.sin(grade),
        ],
        axis=-1,
    )


def drive(
    manoeuvres: Sequence[Manoeuvre],
    *,
    origin: ArrayLike = (np.pi / 4, 0.13, 250.0),
    heading: float = 0.0,
    road: Road | None = None,
    suspension: Suspension | Balance | None = None,
) -> Profile:
    """Return the motion of a car that goes through manoeuvres one after the other.

    The body points along the velocity over the ground (a point of no side slip, above the rear
    axle), pitches with the road's slope and with acceleration, and leans out of curves.
    """
    _check_plan(manoeuvres)
    way = Road() if road is None else road
    springs = Suspension() if suspension is None else suspension
    start = np.asarray(origin, dtype=np.float64)
    duration = float(sum(m.duration for m in manoeuvres))
    knots = np.linspace(0.0, duration, int(np.ceil(duration / KNOT_SPACING)) + 1)

    def velocity(time: FloatArray) -> FloatArray:
        there = course_along(manoeuvres, heading, time)
        return course_velocity(there, way.angles(there.distance)[0])

    local = integrate_velocity(velocity, start, knots)
    course = course_along(manoeuvres, heading, knots)
    grade, bank = way.angles(course.distance)
    roll, pitch = springs.lean(course.acceleration, course.speed * course.heading_rate)
    euler = np.stack([bank + roll, grade + pitch, course.heading], axis=-1)
    return fit_local_profile(knots, local, euler, start)
