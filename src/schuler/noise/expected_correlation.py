"""What the autocovariance estimated from a record is on average, walks and ramps included."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from schuler.noise._checks import positive
from schuler.noise.base import Process
from schuler.types import FloatArray


def variogram(process: Process, lag: ArrayLike, dt: float) -> FloatArray:
    """Half the mean squared difference of samples a lag apart."""
    return process.half_mean_squared_difference(
        np.asarray(lag, dtype=np.float64), positive(dt, "dt")
    )


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
