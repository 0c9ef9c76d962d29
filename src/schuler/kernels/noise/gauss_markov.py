"""Allan variance of unit Gauss-Markov noise: asked for thousands of times in every joint fit."""

from __future__ import annotations

import math

import numpy as np

from schuler.kernels.compile import kernel
from schuler.kernels.types import FloatArray

_SMALL = 0.1
# -(-1)^k (2^k - 4)/k! for k = 13 .. 3: minus the bracket 3 - 4 exp(-x) + exp(-2x) less its 2x
_SERIES = tuple(-((-1.0) ** k) * (2.0**k - 4.0) / math.factorial(k) for k in range(13, 2, -1))


@kernel(inline=True)
def _shape(x: float) -> float:
    """(2/x) [1 - (3 - 4 exp(-x) + exp(-2x))/(2x)], by its series where the bracket cancels."""
    if x < _SMALL:
        series = 0.0
        for k in range(len(_SERIES)):
            series = series * x + _SERIES[k]
        return series * x
    rise = -math.expm1(-x)
    return (2.0 / x) * (1.0 - (rise + 0.5 * rise * rise) / x)


@kernel()
def averaged_shape(ratio: FloatArray) -> FloatArray:
    """Of averages over clusters, at tau/Tc (n,)."""
    out = np.empty(ratio.size)
    for k in range(ratio.size):
        out[k] = _shape(ratio[k])
    return out


@kernel()
def sampled_shape(m: FloatArray, step: float) -> FloatArray:
    """Of samples in clusters of m (n,), dt/Tc = step.

    [x² s(x) + 2 m (sinh a - a)]/(2 m sinh(a/2))², x = m a, a = step: the averages' shape s and
    what the motion within a sample interval adds.
    """
    out = np.empty(m.size)
    if step > 500.0:
        for k in range(m.size):
            out[k] = 1.0 / m[k]
        return out
    series = step**3 / 6.0 * (1.0 + step * step / 20.0)
    within = series if step < 0.01 else math.sinh(step) - step
    half = math.sinh(0.5 * step)
    for k in range(m.size):
        x = m[k] * step
        bottom = 2.0 * m[k] * half
        out[k] = (x * x * _shape(x) + 2.0 * m[k] * within) / (bottom * bottom)
    return out
