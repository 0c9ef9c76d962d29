"""Weights for long outages: the least wavelet variance at the scales that matter (spec 10)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from schuler.arrays.redundant import RedundantSensors
from schuler.errors import EstimationError, InputError
from schuler.types import FloatArray


def wavelet_covariance(sensors: RedundantSensors, scales: Sequence[float]) -> FloatArray:
    """Return how the Haar wavelet coefficients of all axes vary together."""
    x = sensors.measurements
    if not scales or not np.isfinite(x).all():
        raise InputError(
            "no scales, or a static record with gaps",
            expected="at least one scale, and a whole record",
        )
    running = np.concatenate([np.zeros((1, x.shape[1])), np.cumsum(x - x.mean(axis=0), axis=0)])
    total = np.zeros((x.shape[1], x.shape[1]))
    for scale in scales:
        m = max(1, round(scale / sensors.step))
        independent = x.shape[0] // (2 * m)
        if independent < x.shape[1] + 2:
            raise EstimationError(
                f"{independent} independent differences of {scale:g} s averages in "
                f"{x.shape[0] * sensors.step:.0f} s, for {x.shape[1]} axes",
                expected=f"at least {x.shape[1] + 2}",
                cure=f"rest for {2.0 * scale * (x.shape[1] + 2):.0f} s, or take shorter scales",
            )
        step = max(1, m // 4)
        starts = np.arange(0, x.shape[0] - 2 * m + 1, step)
        d = (running[starts + 2 * m] - 2.0 * running[starts + m] + running[starts]) / m
        covariance = d.T @ d / d.shape[0]
        chance = min(1.0, x.shape[1] / independent)
        total += scale * ((1.0 - chance) * covariance + chance * np.diag(np.diag(covariance)))
    return np.asarray(total)
