"""Allan deviation, spectrum and autocorrelation of a signal, and what processes say they are."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from schuler.curves.allan_curve import AllanCurve
from schuler.curves.spectrum import SpectrumCurve
from schuler.data.to_dict import ToDict
from schuler.errors import SchulerError
from schuler.noise import Process
from schuler.noise.expected_correlation import expected_autocovariance
from schuler.types import FloatArray, IntArray

_LAGS_PER_DECADE = 12


@dataclass(frozen=True, slots=True, eq=False)
class CorrelationPoints:
    """Autocorrelation averaged over neighbouring lags, the same number of points in each decade."""

    lag: FloatArray  # (k,): mean lag of every point in s
    correlation: FloatArray  # (k,): mean of the correlations there
    band: FloatArray  # (k,): half width of the 95 % band of white noise, whatever its variance does
    # first, last: (k,) lags in samples that were averaged, both included
    first: IntArray
    last: IntArray


@dataclass(frozen=True, slots=True, eq=False)
class Theory(ToDict):
    """What a process says the curves are; None where it cannot say."""

    # (t,): Allan deviation at the cluster times of the measured curve, in u
    allan: FloatArray | None
    # (b,): Two-sided density of the samples at the frequencies of the measured curve, in u²/Hz
    density: FloatArray | None
    # (k,): mean autocorrelation of records of this length, at the lags of the measured curve
    correlation: FloatArray | None


def correlation_points(values: FloatArray, rate: float) -> CorrelationPoints:
    """Average the autocorrelation of a signal over neighbouring lags."""
    from schuler.curves.autocorrelation import autocorrelation

    curve = autocorrelation(values, rate)
    longest = curve.lag.size - 1
    count = max(int(np.ceil(np.log10(longest + 1) * _LAGS_PER_DECADE)), 1)
    edges = np.unique(np.round(np.geomspace(1, longest + 1, count + 1)).astype(np.int64))
    first, last = edges[:-1], edges[1:] - 1
    sizes = (last - first + 1).astype(np.float64)
    total = np.add.reduceat(curve.correlation[: longest + 1], edges[:-1])
    # white noise has independent correlations, so that their mean has 1/m of the variance
    band = np.sqrt(np.add.reduceat(curve.robust_band[: longest + 1] ** 2, edges[:-1])) / sizes
    return CorrelationPoints((first + last) / 2.0 / rate, total / sizes, band, first, last)


def theory_of(
    process: Process,
    allan: AllanCurve,
    spectrum: SpectrumCurve,
    correlation: CorrelationPoints,
) -> Theory:
    """Return what a process says the measured curves are."""
    dt = 1.0 / spectrum.rate
    return Theory(
        allan=_or_none(lambda: np.sqrt(process.allan_variance(allan.tau))),
        density=_or_none(lambda: process.sampled_psd(spectrum.frequency * dt, dt) * dt),
        correlation=_or_none(lambda: _correlation(process, spectrum.samples, dt, correlation)),
    )


def _correlation(
    process: Process, samples: int, dt: float, points: CorrelationPoints
) -> FloatArray:
    middle = np.round(0.5 * (points.first + points.last)).astype(np.int64)
    expected = expected_autocovariance(process, samples, dt, np.concatenate([[0], middle]))
    return np.asarray(expected[1:] / expected[0])


def _or_none(make: Any) -> FloatArray | None:
    try:
        with np.errstate(all="ignore"):
            values = np.asarray(make(), dtype=np.float64)
    except SchulerError:
        return None
    return values if np.isfinite(values).all() else None
