"""Car drives composed of manoeuvres: changes of speed and of heading that begin and end softly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler import earth
from schuler.errors import InputError
from schuler.simulate.profile import Profile, fit_local_profile

FloatArray = NDArray[np.float64]

KNOT_SPACING = 0.25
"""Seconds between the knots of a drive: a fraction of its shortest manoeuvre."""

# The step 126 u^5 - 420 u^6 + 540 u^7 - 315 u^8 + 70 u^9: four derivatives vanish at both ends.
_STEP = np.polynomial.Polynomial([0, 0, 0, 0, 0, 126, -420, 540, -315, 70])
_STEP_SLOPE = _STEP.deriv()
_STEP_INTEGRAL = _STEP.integ()
STEEPEST = 315.0 / 128.0
"""Largest slope of the step: a manoeuvre's peak rate over its mean rate."""


@dataclass(frozen=True, slots=True)
class Manoeuvre:
    """A stretch of driving in which speed and heading go softly to new values.

    Parameters
    ----------
    duration : float
        Seconds; at least one where speed or heading changes.
    speed : float
        At the end, m/s along the road.
    turn : float
        Change of heading, rad, positive to the right.
    """

    duration: float
    speed: float
    turn: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class Road:
    """Slope and bank of a road: sums of waves along the way, flat without any.

    Parameters
    ----------
    grade, bank : (k, 3) ndarray
        Amplitude rad, wavelength m, phase rad of each wave of the climb angle (up positive) and
        of the roll angle (right side down positive).
    """

    grade: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    bank: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))

    @staticmethod
    def random(rng: np.random.Generator) -> Road:
        """Draw a road with slopes of a few per cent and heights of some metres.

        Parameters
        ----------
        rng : numpy.random.Generator
            Source of the draw.

        Returns
        -------
        Road
            Three waves of 200 to 900 m in grade, two of 150 to 400 m in bank.
        """

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
        """Return climb angle and bank angle along the way.

        Parameters
        ----------
        distance : (n,) ndarray
            Metres driven.

        Returns
        -------
        grade, bank : (n,) ndarray
            Radians.
        """
        grade, bank = (
            np.sum(w[:, 0] * np.sin(2.0 * np.pi * distance[:, None] / w[:, 1] + w[:, 2]), axis=1)
            for w in (self.grade, self.bank)
        )
        return grade, bank


@dataclass(frozen=True, slots=True)
class Suspension:
    """How far a car leans under acceleration.

    Parameters
    ----------
    pitch_gradient : float
        Nose up under forward acceleration, rad per m/s² (0.005: three degrees a g).
    roll_gradient : float
        Lean to the outside of a curve, rad per m/s² (0.009: five degrees a g).
    """

    pitch_gradient: float = 0.005
    roll_gradient: float = 0.009


@dataclass(frozen=True, slots=True, eq=False)
class _Course:
    """Speed and heading along a plan at some times."""

    speed: FloatArray
    acceleration: FloatArray
    heading: FloatArray
    heading_rate: FloatArray
    distance: FloatArray


def _course(manoeuvres: Sequence[Manoeuvre], heading: float, time: FloatArray) -> _Course:
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
    step, slope = _STEP(u), _STEP_SLOPE(u) / duration[k]
    change = (after - before)[k]
    return _Course(
        speed=before[k] + change * step,
        acceleration=change * slope,
        heading=heading_before[k] + turn[k] * step,
        heading_rate=turn[k] * slope,
        distance=way_before[k] + duration[k] * (before[k] * u + change * _STEP_INTEGRAL(u)),
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


def _integrate(
    manoeuvres: Sequence[Manoeuvre],
    heading: float,
    road: Road,
    origin: FloatArray,
    knots: FloatArray,
) -> FloatArray:
    """Integrate the velocity over the earth to metres north, east, up in the origin's scale."""
    node, weight = np.polynomial.legendre.leggauss(5)
    step = np.diff(knots)
    time = (knots[:-1, None] + step[:, None] * 0.5 * (1.0 + node)).ravel()
    course = _course(manoeuvres, heading, time)
    grade, _ = road.angles(course.distance)
    level = course.speed * np.cos(grade)
    velocity = np.stack([level * np.cos(course.heading), level * np.sin(course.heading)], axis=-1)

    def integral(values: FloatArray) -> FloatArray:
        cells = (values.reshape(step.size, node.size) @ weight) * 0.5 * step
        return np.concatenate([[0.0], np.cumsum(cells)])

    up = integral(course.speed * np.sin(grade))
    scale = np.array(earth.metres_per_radian(origin))
    local = np.stack([np.zeros(knots.size), np.zeros(knots.size), up], axis=-1)
    # The metres of a radian depend on where the car is, a thousandth in some kilometres: each
    # round of this fixed-point iteration brings three more digits.
    for _ in range(6):
        place = np.zeros((time.size, 3))
        place[:, 0] = origin[0] + np.interp(time, knots, local[:, 0]) / scale[0]
        place[:, 2] = origin[2] + np.interp(time, knots, up)
        there = np.stack(earth.metres_per_radian(place), axis=-1)
        for j in range(2):
            local[:, j] = integral(velocity[:, j] * scale[j] / there[:, j])
    return local


def drive(
    manoeuvres: Sequence[Manoeuvre],
    *,
    origin: ArrayLike = (np.pi / 4, 0.13, 250.0),
    heading: float = 0.0,
    road: Road | None = None,
    suspension: Suspension | None = None,
) -> Profile:
    """Return the motion of a car that goes through manoeuvres one after the other.

    The body points along the velocity over the ground (a point of no side slip, above the rear
    axle), pitches with the road's slope and with acceleration, and leans out of curves.

    Parameters
    ----------
    manoeuvres : sequence of Manoeuvre
        From rest at time zero.
    origin : (3,) array_like
        Where it starts: latitude rad, longitude rad, height m.
    heading : float
        At the start, rad from north, positive to the east.
    road : Road, optional
        Flat if not given.
    suspension : Suspension, optional
        That of a common car if not given.

    Returns
    -------
    Profile
        From 0 to the sum of the durations.

    Raises
    ------
    InputError
        A manoeuvre that is too short, goes backwards or turns on the spot.
    """
    _check_plan(manoeuvres)
    way = Road() if road is None else road
    springs = Suspension() if suspension is None else suspension
    start = np.asarray(origin, dtype=np.float64)
    duration = float(sum(m.duration for m in manoeuvres))
    knots = np.linspace(0.0, duration, int(np.ceil(duration / KNOT_SPACING)) + 1)
    local = _integrate(manoeuvres, heading, way, start, knots)
    course = _course(manoeuvres, heading, knots)
    grade, bank = way.angles(course.distance)
    roll = bank - springs.roll_gradient * course.speed * course.heading_rate
    pitch = grade + springs.pitch_gradient * course.acceleration
    return fit_local_profile(knots, local, np.stack([roll, pitch, course.heading], axis=-1), start)
