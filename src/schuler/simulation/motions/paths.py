"""What paths are made of: soft steps, slow wander, and velocities integrated over the earth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from schuler import earth
from schuler.types import FloatArray

# The step 126 u^5 - 420 u^6 + 540 u^7 - 315 u^8 + 70 u^9: four derivatives vanish at both ends.
STEP = np.polynomial.Polynomial([0, 0, 0, 0, 0, 126, -420, 540, -315, 70])
STEP_SLOPE = STEP.deriv()
STEP_CURVATURE = STEP.deriv(2)
STEP_INTEGRAL = STEP.integ()
STEEPEST = 315.0 / 128.0
"""Largest slope of the step: a manoeuvre's peak rate over its mean rate."""
STRONGEST = 9.372
"""Largest curvature of the step: peak acceleration of a move times duration² over distance."""


def soft_step(time: FloatArray, start: float, duration: float) -> FloatArray:
    """Return a step from zero to one that begins and ends softly."""
    return np.asarray(STEP(np.clip((time - start) / duration, 0.0, 1.0)), dtype=np.float64)


@dataclass(frozen=True, slots=True, eq=False)
class Waves:
    """A sum of sinusoids: wander without steps in any derivative."""

    # amplitude, frequency, phase: (k,) in the unit of what wanders, Hz, rad
    amplitude: FloatArray
    frequency: FloatArray
    phase: FloatArray

    @staticmethod
    def random(
        rng: np.random.Generator, deviation: float, slowest: float, fastest: float, count: int = 4
    ) -> Waves:
        """Draw waves of equal strength, their frequencies even on a logarithmic scale."""
        amplitude = np.full(count, deviation * np.sqrt(2.0 / count))
        frequency = np.exp(rng.uniform(np.log(slowest), np.log(fastest), count))
        return Waves(amplitude, frequency, rng.uniform(0.0, 2.0 * np.pi, count))

    def at(self, time: FloatArray) -> FloatArray:
        """Return the sum."""
        angle = 2.0 * np.pi * self.frequency * time[:, None] + self.phase
        return np.asarray(np.sum(self.amplitude * np.sin(angle), axis=1), dtype=np.float64)


def integrate_velocity(
    velocity: Callable[[FloatArray], FloatArray], origin: FloatArray, knots: FloatArray
) -> FloatArray:
    """Integrate a velocity over the earth."""
    node, weight = np.polynomial.legendre.leggauss(5)
    step = np.diff(knots)
    time = (knots[:-1, None] + step[:, None] * 0.5 * (1.0 + node)).ravel()
    moving = velocity(time)

    def integral(values: FloatArray) -> FloatArray:
        cells = (values.reshape(step.size, node.size) @ weight) * 0.5 * step
        return np.concatenate([[0.0], np.cumsum(cells)])

    up = integral(moving[:, 2])
    scale = np.array(earth.metres_per_radian(origin))
    local = np.stack([np.zeros(knots.size), np.zeros(knots.size), up], axis=-1)
    # The metres of a radian depend on where the path is, a thousandth in some kilometres: each
    # round of this fixed-point iteration brings three more digits.
    for _ in range(6):
        place = np.zeros((time.size, 3))
        place[:, 0] = origin[0] + np.interp(time, knots, local[:, 0]) / scale[0]
        place[:, 2] = origin[2] + np.interp(time, knots, up)
        there = np.stack(earth.metres_per_radian(place), axis=-1)
        for j in range(2):
            local[:, j] = integral(moving[:, j] * scale[j] / there[:, j])
    return local
