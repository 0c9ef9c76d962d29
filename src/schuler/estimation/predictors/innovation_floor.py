"""The floor under all predictors, from a spectrum or from data (Kolmogorov-Szego, spec 3)."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import EstimationError, InputError
from schuler.estimation.signals import prepare
from schuler.types import FloatArray

__all__ = ["check_prediction_floor", "innovation_variance", "innovation_variance_of_signal"]


_ALLOWED = 0.9
_SEGMENTS = 32
_FEWEST = 1024


def innovation_variance(
    frequency: ArrayLike,
    density: ArrayLike,
    rate: float,
    *,
    onesided: bool,
    degrees_of_freedom: ArrayLike | None = None,
) -> float:
    """Smallest one-step error variance that a spectrum allows to any linear predictor.

    exp of the mean of ln(rate S(f)) over all frequencies, S two-sided; for Gaussian signals no
    other predictor does better either.
    """
    f = np.asarray(frequency, dtype=np.float64)
    s = np.asarray(density, dtype=np.float64) * (0.5 if onesided else 1.0)
    if f.ndim != 1 or f.shape != s.shape or f.size < 2 or not (np.diff(f) > 0.0).all():
        raise InputError(
            f"frequencies of shape {f.shape} and densities of shape {s.shape}",
            expected="two arrays (f,), frequencies increasing",
        )
    if not (f[0] >= 0.0 and f[-1] <= 0.5 * rate * (1.0 + 1e-9)):
        raise InputError(
            f"frequencies from {f[0]:g} to {f[-1]:g} Hz", expected=f"0 to {0.5 * rate:g} Hz"
        )
    if not (np.isfinite(s).all() and (s > 0.0).all()):
        raise InputError("a spectral density is not above zero", expected="finite, > 0")
    level = np.log(s * rate)
    if degrees_of_freedom is not None:
        level = level - _logarithmic_bias(degrees_of_freedom)
    inside = float(np.sum(0.5 * (level[1:] + level[:-1]) * np.diff(f)))
    ends = float(level[0] * f[0] + level[-1] * (0.5 * rate - f[-1]))
    return math.exp((inside + ends) / (0.5 * rate))


def _logarithmic_bias(degrees_of_freedom: ArrayLike) -> FloatArray:
    from scipy.special import psi

    half = 0.5 * np.asarray(degrees_of_freedom, dtype=np.float64)
    return np.asarray(psi(half) - np.log(half))


def innovation_variance_of_signal(signal: ArrayLike) -> float:
    """Estimate the innovation variance of a record from its own averaged spectrum.

    Parameters
    ----------
    signal : (n,) array_like
        Samples at a constant rate, in u.

    Returns
    -------
    float
        u²: no predictor has a smaller one-step error on such data.

    Raises
    ------
    InputError
        Too short, or not finite.

    Notes
    -----
    exp of the mean log spectrum, freed of the bias of the logarithm (Kolmogorov, Szegő; Davis and
    Jones 1968).

    Examples
    --------
    >>> import numpy as np, schuler
    >>> x = np.random.default_rng(0).normal(size=20_000)
    >>> 0.95 < schuler.innovation_variance_of_signal(x) < 1.05
    True
    """
    from scipy.signal import welch

    series = prepare(signal, fewest=_FEWEST)
    length = 2 ** int(math.log2(2 * series.values.size / _SEGMENTS))
    count = (series.values.size - length) // (length // 2) + 1
    f, s = welch(series.values, fs=1.0, window="blackmanharris", nperseg=length)
    # the first bins have lost the mean and the main lobe's share of it
    kept = slice(3, -1)
    floor = innovation_variance(
        f[kept], s[kept], 1.0, onesided=True, degrees_of_freedom=2.0 * count
    )
    return floor * series.scale**2


def check_prediction_floor(
    mean_square_error: float, floor: float, *, samples: int | None = None, what: str = "predictor"
) -> float:
    """Refuse a held-out error that no predictor can have."""
    if not (math.isfinite(floor) and floor > 0.0):
        raise InputError(f"an innovation variance of {floor:g}", expected="above zero")
    ratio = mean_square_error / floor
    chance = 5.0 * math.sqrt(2.0 / samples) if samples else 0.0
    if not ratio >= min(_ALLOWED, 1.0 - chance):
        raise EstimationError(
            f"the {what} claims a one-step error of {mean_square_error:.4g}, {ratio:.3g} of the "
            f"innovation variance {floor:.4g} of the data",
            expected="no less than 0.9 of it",
            cure="measure the error on held-out raw data without a look ahead",
        )
    return ratio
