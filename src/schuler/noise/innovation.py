"""The floor of all predictors: what cannot be foreseen of the next sample."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from schuler.noise._checks import positive
from schuler.types import FloatArray

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)


def kolmogorov_szego(sampled_psd: Callable[[FloatArray, float], FloatArray], dt: float) -> float:
    """Innovation variance exp(2 int_0^(1/2) ln S(f) df) of samples `dt` seconds apart.

    The integral runs over f = exp(-y)/2 in panels of y, so that time constants from one sample
    to days are resolved alike, and the logarithmic poles of walks at f = 0 do no harm.
    """
    positive(dt, "dt")
    width = 0.5
    start = np.arange(0.0, 45.0, width)
    y = (start[:, None] + 0.5 * width * (1.0 + _NODES)).ravel()
    weight = np.tile(0.5 * width * _WEIGHTS, start.size)
    cycles = 0.5 * np.exp(-y)
    density = sampled_psd(cycles, dt)
    if not (density > 0.0).any():
        return 0.0
    # int ln S df = [f ln S] written as sum over y; total weight of f is one half
    return math.exp(2.0 * float(np.sum(weight * cycles * np.log(density))))
