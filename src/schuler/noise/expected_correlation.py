"""What the autocovariance estimated from a record is on average, walks and ramps included."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from schuler.noise._checks import positive
from schuler.noise.base import Process
from schuler.noise.drifts import RandomWalk, RateRamp, TurnOnBias
from schuler.noise.white import Quantization, WhiteNoise
from schuler.types import FloatArray


def variogram(process: Process, lag: ArrayLike, dt: float) -> FloatArray:
    """Half the mean squared difference of samples a lag apart."""
    steps = np.asarray(lag, dtype=np.float64)
    total = np.zeros(steps.shape)
    for part in process.components:
        total = total + _part(part, steps, positive(dt, "dt"))
    return total


def _part(part: Process, steps: FloatArray, dt: float) -> FloatArray:
    if isinstance(part, WhiteNoise):
        return np.where(steps > 0.0, part.density**2 / dt, 0.0)
    if isinstance(part, Quantization):
        # samples are differences of neighbouring errors of the increments, over dt
        power = (part.step_density / dt) ** 2
        return np.where(steps == 0.0, 0.0, np.where(steps == 1.0, 3.0, 2.0)) * power
    if isinstance(part, RandomWalk):
        return np.asarray(0.5 * part.density**2 * steps * dt)
    if isinstance(part, RateRamp):
        return np.asarray(0.5 * (part.slope * steps * dt) ** 2)
    if isinstance(part, TurnOnBias):
        return np.zeros(steps.shape)
    covariance = part.autocovariance(np.concatenate([[0.0], steps * dt]))
    return np.asarray(covariance[0] - covariance[1:])


def expected_autocovariance(
    process: Process, samples: int, dt: float, lag: ArrayLike
) -> FloatArray:
    """Mean of the biased autocovariance of a record whose mean was removed."""
    shape = variogram(process, np.arange(samples), dt)
    running = np.cumsum(shape)
    index = np.arange(samples)
    means = (running[index] + running[samples - 1 - index] - shape[0]) / samples
    whole = float(means.mean())
    sums = np.concatenate([[0.0], np.cumsum(means - whole)])
    k = np.asarray(lag, dtype=np.int64)
    pairs = samples - k
    # sum over i = 0 .. n-1-k of g_i + g_(i+k) - 2 g, then what is constant
    centred = sums[pairs] + sums[samples] - sums[k]
    return np.asarray((centred + pairs * (whole - shape[k])) / samples)
