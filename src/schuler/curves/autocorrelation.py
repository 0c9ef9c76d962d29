"""Autocovariance and autocorrelation by FFT, with bands for white noise of any kind."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.curves.finite_signal import checked_rate, finite_samples
from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.types import FloatArray

_BAND_95 = 1.959963984540054
_DEFAULT_FRACTION = 10


@dataclass(frozen=True, slots=True, eq=False)
class AutocorrelationCurve(Exportable):
    """Autocovariance of a signal, mean removed, against lag.

    Parameters
    ----------
    lag : (k,) ndarray
        Lags in s, from zero.
    autocovariance : (k,) ndarray
        In the square of the unit of the signal.
    correlation : (k,) ndarray
        Autocovariance over its value at lag 0; NaN where the signal is constant (see `flags`).
    band : (k,) ndarray
        Half width of the 95 % band about zero for white noise of constant variance: 1.96/sqrt(n).
    robust_band : (k,) ndarray
        The same where the variance changes with time (heteroskedastic, GARCH): the products
        x(t) x(t + k) scatter as they do, not as those of constant variance would.
    rate : float
        Samples a second.
    samples : int
        Length of the signal.
    kind : {"biased", "unbiased"}
        Divisor n or n - k.
    flags : tuple of str
        "constant" for a signal that does not vary.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import autocorrelation
    >>> autocorrelation(np.random.default_rng(1).standard_normal(500), 100.0, max_lag=0.05).lag
    array([0.  , 0.01, 0.02, 0.03, 0.04, 0.05])
    """

    JSON = (
        "lag_s=lag autocovariance correlation band_95=band robust_band_95=robust_band "
        "rate_hz=rate samples kind flags"
    )

    lag: FloatArray
    autocovariance: FloatArray
    correlation: FloatArray
    band: FloatArray
    robust_band: FloatArray
    rate: float
    samples: int
    kind: str
    flags: tuple[str, ...] = ()

    @property
    def duration(self) -> float:
        """Length of the record in s."""
        return self.samples / self.rate

    @property
    def white(self) -> bool:
        """True where no more than one lag in ten is outside the robust band."""
        outside = np.abs(self.correlation[1:]) > self.robust_band[1:]
        return bool(outside.size and np.mean(outside) <= 0.1)


def autocorrelation(
    signal: ArrayLike,
    rate: float,
    max_lag: float | None = None,
    kind: Literal["biased", "unbiased"] = "biased",
) -> AutocorrelationCurve:
    """Return autocovariance and autocorrelation up to a lag, with bands for whiteness.

    Parameters
    ----------
    signal : (n,) array_like
        Samples in any unit; the mean is removed.
    rate : float
        Samples a second.
    max_lag : float, optional
        Longest lag in s; default a tenth of the record, and never more than all of it.
    kind : {"biased", "unbiased"}
        Divisor n (positive semidefinite, the default) or n - k (not so: never solve
        Yule-Walker equations with it).

    Returns
    -------
    AutocorrelationCurve
        Lags from zero.

    Raises
    ------
    InputError
        Not (n,) or not finite, fewer than 2 samples, an impossible rate or lag.

    Notes
    -----
    Spec 2.1; FFT with zeros to at least 2n, O(n log n). Robust band: sqrt(sum x²(t) x²(t+k)) over
    sum x², the standard deviation of the correlation of an uncorrelated series of any variance
    (compare S000, figures 9 to 11).

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import autocorrelation
    >>> signal = np.random.default_rng(1).standard_normal(10_000)
    >>> curve = autocorrelation(signal, 100.0, max_lag=0.05)
    >>> float(curve.correlation[0]), bool(abs(curve.correlation[1]) < curve.band[1])
    (1.0, True)
    """
    if kind not in ("biased", "unbiased"):
        raise InputError(f"autocorrelation of kind '{kind}'", expected="'biased' or 'unbiased'")
    values, rate = finite_samples(signal, shortest=2), checked_rate(rate)
    n = values.size
    lags = _lags(max_lag, n, rate)
    lag = lags / rate
    band = np.full(lags.size, _BAND_95 / np.sqrt(n))
    scale = float(np.abs(values).max())
    if values.min() == values.max() or scale == 0.0:
        nothing = np.full(lags.size, np.nan)
        zero = np.zeros(lags.size)
        return AutocorrelationCurve(lag, zero, nothing, band, nothing, rate, n, kind, ("constant",))
    # squares of squares of 1e-100 would leave the range of numbers
    centred = values / scale
    centred -= centred.mean()
    size = float(np.abs(centred).max())
    centred /= size
    sums = _lagged_products(centred, lags.size)
    divisor = np.full(lags.size, float(n)) if kind == "biased" else (n - lags).astype(np.float64)
    correlation = sums / sums[0] * (n / divisor)
    square = centred * centred
    spread = np.sqrt(np.maximum(_lagged_products(square, lags.size), 0.0)) / sums[0]
    return AutocorrelationCurve(
        lag=lag,
        autocovariance=sums / divisor * (scale * size) ** 2,
        correlation=correlation,
        band=band * (n / divisor),
        robust_band=_BAND_95 * spread * (n / divisor),
        rate=rate,
        samples=n,
        kind=kind,
    )


def _lags(max_lag: float | None, n: int, rate: float) -> NDArray[np.int64]:
    if max_lag is None:
        last = max(n // _DEFAULT_FRACTION, 1)
    elif np.isfinite(max_lag) and max_lag > 0.0:
        last = round(max_lag * rate)
    else:
        raise InputError(f"longest lag is {max_lag:g} s", expected="a finite time above zero")
    return np.arange(min(last, n - 1) + 1)


def _lagged_products(values: FloatArray, count: int) -> FloatArray:
    """Sums of x(t) x(t + k) for k = 0 .. count - 1."""
    from scipy import fft

    size = fft.next_fast_len(values.size + count, real=True)
    spectrum = fft.rfft(values, size)
    power = spectrum.real**2 + spectrum.imag**2
    return np.asarray(fft.irfft(power, size)[:count], dtype=np.float64)
