"""The fused vector of one kind of sensor, with its covariance and weights through time."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.arrays.lever_arms import acceleration_covariance, arm_coefficients
from schuler.arrays.redundant import RedundantSensors
from schuler.arrays.synthesis.conditional import conditional_noise
from schuler.arrays.synthesis.least_squares import fuse_constant, least_squares
from schuler.arrays.synthesis.volatility import AveragedVolatility, residual_volatility
from schuler.arrays.tracking import (
    AxisNoise,
    Followed,
    OnlineSettings,
    follow_sensors,
    start_values,
)
from schuler.types import FloatArray

FEW = 4000
"""Samples, evenly spread, from which constant variances are taken."""


@dataclass(frozen=True, slots=True, eq=False)
class FusedSensor:
    """The fused rate or specific force of an array."""

    sensors: RedundantSensors  # what it was made of
    vectors: FloatArray  # (n, 3): in the body, rad/s or m/s²; NaN where too few axes were there.
    covariance: FloatArray  # (p, 3, 3): of a sample, of each block or each set of axes
    which: NDArray[np.int64]  # (n,): which of them belongs to each sample
    weight_time: FloatArray  # (b,): stamps of the weights, s
    weight: FloatArray  # (b, M): share of each axis in the information
    # (b, M): standard deviation of a sample of each axis as it was used, rad/s or m/s²
    deviation: FloatArray
    followed: Followed | None = None  # statistics of the on-line run

    @classmethod
    def from_followed(cls, followed: Followed) -> FusedSensor:
        """Return what an on-line run fused."""
        return cls(
            followed.sensors,
            followed.fused,
            followed.covariance,
            np.arange(followed.fused.shape[0]) // followed.block,
            followed.block_time,
            followed.weight,
            np.sqrt(followed.variance),
            followed,
        )

    def covariances(self) -> FloatArray:
        """Covariance of the fused vector at every sample, (n, 3, 3)."""
        return np.asarray(self.covariance[self.which])

    @property
    def mean_covariance(self) -> FloatArray:
        """Mean over the samples, (3, 3)."""
        if self.covariance.shape[0] == 1:
            return np.asarray(self.covariance[0])
        number = np.bincount(self.which, minlength=self.covariance.shape[0])
        good = np.isfinite(self.covariance[:, 0, 0]) & (number > 0)
        mean = np.einsum("p,pij->ij", number[good], self.covariance[good]) / number[good].sum()
        return np.asarray(mean)

    @property
    def mean_pi(self) -> FloatArray:
        """The least-squares solution of the mean weights, (3, M)."""
        share = self.weight.mean(axis=0)
        return least_squares(self.sensors.axes, 1.0 / np.maximum(share, 1e-9 * share.max())).pi

    @property
    def mean_deviation(self) -> FloatArray:
        """Root mean square of the deviations of each axis through time, (M,)."""
        return np.asarray(np.sqrt((self.deviation**2).mean(axis=0)))

    @property
    def effective_sensors(self) -> FloatArray:
        """How many equal, average IMUs would be as good, for each axis of the body, (3,)."""
        single = float(np.mean(self.mean_deviation**2))
        return np.asarray(single / np.diag(self.mean_covariance))

    @property
    def reduction(self) -> float:
        """1 - deviation of the fused sensor / mean deviation of the sensors (spec 6.3)."""
        fused = float(np.sqrt(np.mean(np.diag(self.mean_covariance))))
        return 1.0 - fused / float(np.mean(self.mean_deviation))

    @property
    def gain(self) -> float:
        """Mean deviation of the sensors / deviation of the fused sensor - 1 (spec 6.3)."""
        return self.reduction / (1.0 - self.reduction)

    def to_dict(self) -> dict[str, Any]:
        """Return plain Python for JSON, SI."""
        names = self.sensors.names
        return {
            "deviation": dict(zip(names, self.mean_deviation.tolist(), strict=True)),
            "weight": dict(zip(names, self.weight.mean(axis=0).tolist(), strict=True)),
            "fused_deviation": np.sqrt(np.diag(self.mean_covariance)).tolist(),
            "effective_sensors": self.effective_sensors.tolist(),
            "reduction": self.reduction,
            "gain": self.gain,
        }


def fuse_weighted(
    sensors: RedundantSensors,
    covariance: FloatArray | None,
    known: AxisNoise | None,
    settings: OnlineSettings,
    tensor: FloatArray | None,
    *,
    equal: bool = False,
    rate_covariance: FloatArray | None = None,
    causal: bool = True,
) -> FusedSensor:
    """Fuse with constant weights."""
    noise = known
    if noise is None:
        stride = max(1, sensors.time.size // FEW)
        few = replace(
            sensors,
            time=sensors.time[::stride],
            measurements=np.ascontiguousarray(sensors.measurements[::stride]),
        )
        noise = start_values(few, few.time.size)
    sample = np.diag(noise.variance)
    if tensor is not None and rate_covariance is not None:
        sample = sample + acceleration_covariance(
            sensors.axes, sensors.arms, rate_covariance, sensors.step, causal=causal
        )
    if equal:
        by = np.ones(sensors.count)
    elif covariance is None:
        by = noise.variance if tensor is None else sample
    else:
        by = covariance
    vectors, solutions, which = fuse_constant(
        sensors.measurements,
        sensors.axes,
        by,
        bias=None if settings.keep_biases else noise.bias,
        tensor=tensor,
        arm=None if tensor is None else arm_coefficients(sensors.axes, sensors.arms),
    )
    # what each axis adds to the fused vector: the trace of pi A is three
    share = np.einsum("im,mi->m", solutions[0], sensors.axes) / 3.0
    return FusedSensor(
        sensors,
        vectors,
        solutions @ sample @ np.swapaxes(solutions, 1, 2),
        which,
        sensors.time[[0, -1]],
        np.stack([share, share]),
        np.sqrt(np.stack([noise.variance, noise.variance])),
    )


def fuse_followed(
    sensors: RedundantSensors,
    weights: str,
    known: AxisNoise | None,
    settings: OnlineSettings,
    tensor: FloatArray | None,
    arma: tuple[int, int],
) -> FusedSensor:
    """Fuse with weights or variances that follow the past."""
    given: FloatArray | None = None
    how = settings
    if weights == "averaged_volatility":
        # 2T + 1 samples are as much memory as the time constant of the EWMA
        half = max(1, round(settings.time_constant / sensors.step))
        given = _before(residual_volatility(sensors.measurements, sensors.axes, half))
    elif weights == "garch":
        learning = round(settings.learning / sensors.step)
        noise = conditional_noise(sensors, learning, settings, arma=arma, tensor=tensor)
        given = noise.variance
        if arma != (0, 0):
            sensors = replace(sensors, measurements=sensors.measurements - noise.mean)
        how = replace(settings, block=sensors.step)
    followed = follow_sensors(sensors, known, how, given=given, tensor=tensor)
    return FusedSensor.from_followed(followed)


def _before(volatility: AveragedVolatility) -> FloatArray:
    """Variance of every sample from the samples before it, (n, 1)."""
    variance = volatility.variance
    shifted = np.concatenate([variance[:1], variance[:-1]])
    known = np.isfinite(shifted) & (shifted > 0.0)
    steps = np.arange(shifted.size)
    return np.asarray(np.interp(steps, steps[known], shifted[known])[:, None])
