"""What rotation adds to accelerometers away from the origin of the body (spec 1.4, 6.2)."""

from __future__ import annotations

import numpy as np

from schuler.rotations import skew
from schuler.types import FloatArray


def turning_tensor(time: FloatArray, rate: FloatArray, *, causal: bool) -> FloatArray:
    """Return what turns lever arms into specific force, from the fused angular rate."""
    w = fill_gaps(time, rate)
    slope = np.empty_like(w)
    if causal:
        slope[1:] = np.diff(w, axis=0) / np.diff(time)[:, None]
        slope[0] = 0.0
    else:
        slope[1:-1] = (w[2:] - w[:-2]) / (time[2:] - time[:-2])[:, None]
        slope[0] = (w[1] - w[0]) / (time[1] - time[0])
        slope[-1] = (w[-1] - w[-2]) / (time[-1] - time[-2])
    x, y, z = w.T
    a, b, c = slope.T
    tensor = np.empty((time.size, 9))
    tensor[:, 0] = -(y * y) - z * z
    tensor[:, 4] = -(x * x) - z * z
    tensor[:, 8] = -(x * x) - y * y
    tensor[:, 1], tensor[:, 3] = x * y - c, x * y + c
    tensor[:, 2], tensor[:, 6] = x * z + b, x * z - b
    tensor[:, 5], tensor[:, 7] = y * z - a, y * z + a
    return tensor


def fill_gaps(time: FloatArray, values: FloatArray) -> FloatArray:
    """Return vectors with gaps bridged by straight lines."""
    known = np.isfinite(values).all(axis=1)
    if known.all():
        return values
    if not known.any():
        return np.zeros_like(values)
    columns = [np.interp(time, time[known], values[known, j]) for j in range(3)]
    return np.stack(columns, axis=1)


def arm_coefficients(axes: FloatArray, arms: FloatArray) -> FloatArray:
    """Return what the tensor is multiplied with for each axis."""
    return np.ascontiguousarray(np.einsum("mb,mc->bcm", axes, arms).reshape(9, -1))


def acceleration_covariance(
    axes: FloatArray, arms: FloatArray, rate_covariance: FloatArray, step: float, *, causal: bool
) -> FloatArray:
    """Return the covariance that noise of the angular acceleration puts on accelerometers."""
    slope = rate_covariance * (2.0 / step**2 if causal else 0.5 / step**2)
    # h · (a x l) = a · (l x h)
    effect = np.einsum("mij,mj->mi", skew(arms), axes)
    return np.asarray(effect @ slope @ effect.T)
