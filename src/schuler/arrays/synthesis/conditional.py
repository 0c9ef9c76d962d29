"""Conditional means and variances of every axis: ARMA and GARCH of the residuals (S000 (12))."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from schuler.arrays.lever_arms import arm_coefficients
from schuler.arrays.redundant import RedundantSensors
from schuler.arrays.synthesis.cornered_hat import check_separable
from schuler.arrays.synthesis.least_squares import least_squares
from schuler.arrays.tracking import Followed, OnlineSettings, follow_sensors
from schuler.errors import EstimationError
from schuler.types import FloatArray

if TYPE_CHECKING:
    from schuler.estimation.garch.arma_garch import ArmaGarchFit


@dataclass(frozen=True, slots=True, eq=False)
class ConditionalNoise:
    """What the past says of the next sample of every axis."""

    mean: FloatArray  # (n, M): of the residual, rad/s or m/s²; zero without an ARMA part.
    variance: FloatArray  # (n, M): of the sensor itself
    fits: tuple[ArmaGarchFit, ...]  # of each axis
    bias: FloatArray  # (M,): mean residual on the part that was learnt from

    @property
    def flags(self) -> tuple[str, ...]:
        """What the fits warn of, once each."""
        return tuple(dict.fromkeys(flag for fit in self.fits for flag in fit.flags))


def conditional_noise(
    sensors: RedundantSensors,
    learning: int,
    settings: OnlineSettings,
    *,
    arma: tuple[int, int] = (0, 0),
    tensor: FloatArray | None = None,
) -> ConditionalNoise:
    """Return one-step-ahead means and variances of every axis of redundant sensors.

    Parameters
    ----------
    sensors : RedundantSensors
        Gyros or accelerometers of an array, from `redundant_sensors`.
    learning : int
        Samples at the beginning on which ARMA and GARCH are fitted.
    settings : OnlineSettings
        How residuals are formed.
    arma : tuple of int
        Orders (p, q) of the mean; (0, 0) models the variance alone.
    tensor : (n, 3, 3) ndarray, optional
        Centripetal and angular accelerations that lever arms turn into specific force, 1/s².

    Returns
    -------
    ConditionalNoise
        Mean (n, M) and variance (n, M) given the past, in rad/s or m/s² and their squares.

    Raises
    ------
    EstimationError
        Fewer than 500 samples to learn from, or sensors that cannot be told apart.

    Notes
    -----
    S000 equations (7) to (12); residuals are unmixed as `cornered_hat` does.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> gyro = np.random.default_rng(0).normal(size=(2000, 4, 3))
    >>> array = schuler.ImuArray(
    ...     np.arange(2000) / 100.0, gyro, np.full(gyro.shape, np.nan), schuler.Mounting.aligned(4)
    ... )
    >>> sensors = schuler.redundant_sensors(array, "gyro")
    >>> schuler.conditional_noise(sensors, 1000, schuler.OnlineSettings()).variance.shape
    (2000, 12)
    """
    from schuler.estimation.garch.arma_garch import fit_arma_garch
    from schuler.estimation.garch.conditional_variance import ewma_variance

    check_separable(least_squares(sensors.axes).residual)
    if not 500 <= learning <= sensors.time.size:
        raise EstimationError(
            f"{learning} samples to fit GARCH on",
            expected=f"500 to {sensors.time.size}",
            cure="learn for longer, or weigh by 'ewma'",
        )
    followed = follow_sensors(sensors, None, settings, tensor=tensor)
    x = scaled_residuals(followed, tensor)
    known = np.isfinite(x)
    bias = np.array([x[:learning][k, m].mean() for m, k in enumerate(known[:learning].T)])
    x = np.where(known, x - bias, 0.0)
    mean, seen = np.empty_like(x), np.empty_like(x)
    fits = []
    for m in range(sensors.count):
        model = fit_arma_garch(x[:learning, m], *arma, joint=False)
        mean[:, m], seen[:, m] = model.predict(x[:, m])
        if model.garch.method == "constant":
            # calm while it was learnt from, which is no promise: follow it all the same
            residual = x[:, m] - mean[:, m]
            seen[:, m] = ewma_variance(residual, before=model.garch.unconditional_variance)
        fits.append(model)
    return ConditionalNoise(mean, seen, tuple(fits), bias)


def scaled_residuals(followed: Followed, tensor: FloatArray | None) -> FloatArray:
    """Return residuals against the weighted fused vector, with the variance of the sensors."""
    sensors = followed.sensors
    x = sensors.measurements - followed.fused @ sensors.axes.T
    if tensor is not None:
        x -= tensor @ arm_coefficients(sensors.axes, sensors.arms)
    lost = np.einsum("mi,bij,mj->bm", sensors.axes, followed.covariance, sensors.axes)
    share = np.clip(1.0 - lost / followed.variance, 0.05, 1.0)
    return np.asarray(x / np.sqrt(np.repeat(share, followed.block, axis=0)[: x.shape[0]]))
