"""A person on foot: steps, sway, turns and stops."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import InputError
from schuler.simulation.motions.drives import Manoeuvre, course_along, course_velocity
from schuler.simulation.motions.paths import integrate_velocity
from schuler.simulation.motions.profile import Profile, fit_local_profile
from schuler.types import FloatArray

KNOT_SPACING = 0.03
"""Seconds between knots: an eighteenth of a step."""
REST_AT_END = 5.0
"""Seconds of standing after a walk."""


@dataclass(frozen=True, slots=True)
class Gait:
    """How the body moves at each step, at full speed.

    Bounce and surge repeat with every step, sway and the swing of the angles with every second
    one. They grow with the square of the speed and vanish in standing.
    """

    speed: float = 1.4  # m/s
    step_length: float = 0.75  # metres; the step frequency is speed over step length.
    # bounce, surge, sway: amplitudes up, forward and to the right, m
    bounce: float = 0.022
    surge: float = 0.012
    sway: float = 0.02
    # roll, pitch, yaw: amplitudes of the trunk's angles, rad
    roll: float = 0.04
    pitch: float = 0.03
    yaw: float = 0.07


def _plan(
    duration: float, standstill: float, speed: float, rng: np.random.Generator
) -> list[Manoeuvre]:
    """Stretches of 8 to 25 s with turns between them, and a stop now and then."""
    start = 2.5
    plan = [Manoeuvre(standstill, 0.0)] if standstill > 0.0 else []
    plan.append(Manoeuvre(start, speed))
    left = duration - standstill - 2.0 * start - REST_AT_END
    if left < 10.0:
        raise InputError(
            f"a walk of {duration:g} s with {standstill:g} s of standstill before it",
            expected=f"{duration - left + 10.0:.0f} s or more",
        )
    stops = 0
    while True:
        sign = 1.0 if rng.random() < 0.5 else -1.0
        part = [
            Manoeuvre(rng.uniform(8.0, 25.0), speed),
            Manoeuvre(rng.uniform(3.0, 5.0), speed, sign * np.radians(rng.uniform(30.0, 120.0))),
        ]
        stops += 1
        if stops % 3 == 0:
            part += [
                Manoeuvre(start, 0.0),
                Manoeuvre(rng.uniform(4.0, 15.0), 0.0),
                Manoeuvre(start, speed),
            ]
        seconds = sum(m.duration for m in part)
        if seconds > left - 1.0:
            break
        plan += part
        left -= seconds
    return [*plan, Manoeuvre(left, speed), Manoeuvre(start, 0.0), Manoeuvre(REST_AT_END, 0.0)]


def walk(
    duration: float = 600.0,
    rng: np.random.Generator | int = 0,
    *,
    standstill: float = 20.0,
    gait: Gait | None = None,
    origin: ArrayLike = (np.pi / 4, 0.13, 250.0),
) -> Profile:
    """Return a walk with an IMU on the trunk.

    Stretches of 8 to 25 s, turns of 30 to 120 degrees, stops of 4 to 15 s; standing before and
    after.
    """
    steps = Gait() if gait is None else gait
    if not (steps.speed > 0.0 and steps.step_length > 0.0):
        raise InputError(
            f"a gait of {steps.speed:g} m/s in steps of {steps.step_length:g} m",
            expected="positive numbers",
        )
    plan_rng, heading_rng = np.random.default_rng(rng).spawn(2)
    plan = _plan(duration, standstill, steps.speed, plan_rng)
    heading = heading_rng.uniform(-np.pi, np.pi)
    start = np.asarray(origin, dtype=np.float64)
    knots = np.linspace(0.0, duration, int(np.ceil(duration / KNOT_SPACING)) + 1)

    def velocity(time: FloatArray) -> FloatArray:
        return course_velocity(course_along(plan, heading, time), np.zeros(time.size))

    local = integrate_velocity(velocity, start, knots)
    course = course_along(plan, heading, knots)
    strength = (course.speed / steps.speed) ** 2
    step = 2.0 * np.pi * course.distance / steps.step_length
    stride = 0.5 * step
    forward = np.stack([np.cos(course.heading), np.sin(course.heading)], axis=-1)
    right = np.stack([-forward[:, 1], forward[:, 0]], axis=-1)
    # lowest when both feet are on the ground, and furthest to a side when standing on that foot
    local[:, :2] += (strength * steps.surge * np.sin(step))[:, None] * forward
    local[:, :2] += (strength * steps.sway * np.sin(stride))[:, None] * right
    local[:, 2] -= strength * steps.bounce * np.cos(step)
    euler = np.stack(
        [
            strength * steps.roll * np.sin(stride + 0.4),
            strength * steps.pitch * np.sin(step + 1.0),
            course.heading + strength * steps.yaw * np.cos(stride),
        ],
        axis=-1,
    )
    return fit_local_profile(knots, local, euler, start)
