"""Noise level through time from the residuals of redundant triads (S000 (2)-(3), spec 5.3)."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.arrays.redundant import Sensor, redundant_sensors
from schuler.arrays.synthesis.least_squares import residuals
from schuler.data import ImuArray
from schuler.errors import EstimationError, InputError
from schuler.types import FloatArray

Divisor = Literal["unbiased", "paper"]


@dataclass(frozen=True, slots=True, eq=False)
class AveragedVolatility:
    """One variance for all sensors, as it changes through time."""

    time: FloatArray  # (n,): s
    variance: FloatArray  # (n,): of one sample of one axis; NaN where the window holds nothing.
    # (n,): standard error of the variance over the variance, for constant Gaussian noise
    relative_error: FloatArray
    half_window: int  # T: the window has 2T + 1 samples
    causal: bool  # the window ends at the sample instead of being centred on it
    divisor: str  # "unbiased" or "paper"

    @property
    def deviation(self) -> FloatArray:
        """Standard deviation of one sample of one axis, (n,)."""
        return np.sqrt(self.variance)


def averaged_volatility(
    array: ImuArray,
    half_window: int = 50,
    *,
    sensor: Sensor = "gyro",
    divisor: Divisor = "unbiased",
    causal: bool = False,
    remove_mean: bool = False,
    robust: bool = False,
) -> AveragedVolatility:
    """Return the noise level of an array through time, taken to be the same for all its sensors.

    Parameters
    ----------
    array : ImuArray
        Of two or more IMUs; lever arms are not corrected here.
    half_window : int
        T.
    sensor : {"gyro", "accel"}
        Which.
    divisor, causal, remove_mean
        As in `window_volatility`.
    robust : bool
        Residuals beyond four deviations of their window count as four: outliers and knocks of
        single sensors do not raise the level of all.

    Returns
    -------
    AveragedVolatility
        Of the sensor, rad/s or m/s² squared.

    Raises
    ------
    InputError
        One IMU only, or a window that is no window.
    EstimationError
        As `window_volatility`.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import ImuArray, Mounting, averaged_volatility
    >>> rng = np.random.default_rng(1)
    >>> four = Mounting(np.tile(np.eye(3), (4, 1, 1)), np.zeros((4, 3)))
    >>> gyro = 1e-3 * rng.standard_normal((2_000, 4, 3))
    >>> accel = np.tile((0.0, 0.0, -9.81), (2_000, 4, 1))
    >>> array = ImuArray(np.arange(2_000) / 100.0, gyro, accel, four)
    >>> type(averaged_volatility(array)).__name__
    'AveragedVolatility'
    """
    redundant_sensors(array, sensor)
    body = array.in_body()
    vectors = body.gyro if sensor == "gyro" else body.accel
    return window_volatility(
        vectors,
        half_window,
        time=array.time,
        divisor=divisor,
        causal=causal,
        remove_mean=remove_mean,
        robust=robust,
    )


def window_volatility(
    vectors: ArrayLike,
    half_window: int,
    *,
    time: ArrayLike | None = None,
    divisor: Divisor = "unbiased",
    causal: bool = False,
    remove_mean: bool = False,
    robust: bool = False,
) -> AveragedVolatility:
    """Return the averaged volatility of vectors that redundant triads measured."""
    w = np.asarray(vectors, dtype=np.float64)
    if w.ndim != 3 or w.shape[2] != 3:
        raise InputError(f"vectors of shape {w.shape}", expected="(n, k, 3)")
    if w.shape[1] < 2:
        raise EstimationError(
            "one triad has no residuals", expected="two or more", cure="use its Allan deviation"
        )
    if half_window < 1 or divisor not in ("unbiased", "paper"):
        raise InputError(
            f"half window {half_window}, divisor '{divisor}'",
            expected="at least 1, and 'unbiased' or 'paper'",
        )
    n, count = w.shape[:2]
    there = np.asarray(np.isfinite(w).all(axis=2))
    number = there.sum(axis=1)
    filled = np.where(there[:, :, None], w, 0.0)
    mean = filled.sum(axis=1) / np.maximum(number, 1)[:, None]
    x = np.where(there[:, :, None], w - mean[:, None, :], 0.0)
    if robust:
        x = _held_back(x, there, number, half_window, causal)
    squares = (x**2).sum(axis=(1, 2))
    total = _window_sum(squares, half_window, causal)
    freedom = 3.0 * _window_sum(np.maximum(number - 1.0, 0.0), half_window, causal)
    if remove_mean:
        sums = _window_sum(x.reshape(n, -1), half_window, causal)
        seen = np.repeat(_window_sum(there.astype(float), half_window, causal), 3, axis=1)
        total = total - (sums**2 / np.maximum(seen, 1.0)).sum(axis=1)
        freedom = freedom - 3.0 * (count - 1.0)
    if divisor == "paper":
        samples = _window_sum(np.ones(n), half_window, causal)
        division = 3.0 * count * (samples - 1.0)
    else:
        division = freedom
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = np.where(division > 0.0, total / division, np.nan)
        error = np.where(freedom > 0.0, np.sqrt(2.0 / freedom), np.nan)
    stamps = np.arange(n, dtype=np.float64) if time is None else np.asarray(time, dtype=np.float64)
    return AveragedVolatility(
        stamps, np.maximum(variance, 0.0), error, half_window, causal, divisor
    )


_HELD = 4.0


def _held_back(
    x: FloatArray,
    there: NDArray[np.bool_],
    number: NDArray[np.int64],
    half_window: int,
    causal: bool,
) -> FloatArray:
    """Residuals none of which is beyond four deviations of its window.

    An outlier moves the mean of its moment too: residuals are first taken about the median.
    """
    about = np.where(there[:, :, None], x, np.nan)
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        middle = np.nan_to_num(np.nanmedian(about, axis=1))
    about = np.where(there[:, :, None], x - middle[:, None, :], 0.0)
    freedom = 3.0 * _window_sum(np.maximum(number - 1.0, 0.0), half_window, causal)
    kept = about
    for _ in range(12):
        total = _window_sum((kept**2).sum(axis=(1, 2)), half_window, causal)
        limit = _HELD * np.sqrt(np.maximum(total, 0.0) / np.maximum(freedom, 1.0))
        again = np.clip(about, -limit[:, None, None], limit[:, None, None])
        if np.allclose(again, kept, rtol=1e-3, atol=0.0):
            break
        kept = again
    mean = kept.sum(axis=1) / np.maximum(number, 1)[:, None]
    return np.where(there[:, :, None], kept - mean[:, None, :], 0.0)


def residual_volatility(
    measurements: FloatArray, axes: FloatArray, half_window: int
) -> AveragedVolatility:
    """Return the causal averaged volatility of axes in any directions."""
    x = residuals(measurements, axes)
    there = np.isfinite(x)
    x = np.where(there, x, 0.0)
    freedom = np.maximum(there.sum(axis=1) - 3.0, 0.0)
    total = _window_sum((x**2).sum(axis=1), half_window, True)
    sums = _window_sum(x, half_window, True)
    number = _window_sum(there.astype(np.float64), half_window, True)
    total -= (sums**2 / np.maximum(number, 1.0)).sum(axis=1)
    degrees = _window_sum(freedom, half_window, True) - (axes.shape[0] - 3.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        variance = np.where(degrees > 0.5, np.maximum(total, 0.0) / degrees, np.nan)
        error = np.where(degrees > 0.5, np.sqrt(2.0 / degrees), np.nan)
    steps = np.arange(measurements.shape[0], dtype=np.float64)
    return AveragedVolatility(steps, variance, error, half_window, True, "unbiased")


def _window_sum(values: FloatArray, half_window: int, causal: bool) -> FloatArray:
    """Sum over the window of every sample, along the first axis, cut at the ends."""
    n = values.shape[0]
    # centred first: sums of squares of a long record would lose the digits of a quiet part
    level = values.mean(axis=0)
    running = np.concatenate([np.zeros((1, *values.shape[1:])), np.cumsum(values - level, axis=0)])
    k = np.arange(n)
    first = np.maximum(k - (2 * half_window if causal else half_window), 0)
    last = k + 1 if causal else np.minimum(k + half_window + 1, n)
    size = (last - first).reshape((n,) + (1,) * (values.ndim - 1))
    return np.asarray(running[last] - running[first] + size * level)
