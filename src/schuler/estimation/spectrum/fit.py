"""From a power spectral density to processes, with standard errors; beside the slope method."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from schuler.curves.spectrum import SpectrumCurve, power_spectral_density
from schuler.data.to_dict import ToDict, plain
from schuler.errors import EstimationError, InputError
from schuler.estimation.parts import parts_of_model
from schuler.estimation.record import RecordVerdict, judge_record
from schuler.estimation.result import fitted_to_dict
from schuler.estimation.selection import Choice
from schuler.estimation.spectrum.likelihood import (
    SpectrumPoints,
    SpectrumStructureFit,
    checked_structure,
    fit_spectrum_structure,
    scaled_under,
    smallest_seen,
    spectrum_points,
)
from schuler.estimation.spectrum.slopes import SpectrumReadings, spectrum_slopes
from schuler.noise import Process, ProcessSum, Quantization, RandomWalk, WhiteNoise
from schuler.types import FloatArray

_FEWEST_POINTS = 8
_SUSPICIOUS = 3.0
_BAND_EDGE = 0.05
_VANISHED = 1.5


@dataclass(frozen=True, slots=True, eq=False)
class SpectrumFit(ToDict):
    """The processes behind a power spectral density."""

    JSON = "slope_method=slopes record=verdict converged flags"

    process: ProcessSum  # in the unit of the signal
    standard_errors: dict[str, float]  # by parameter, e.g. "gauss_markov.sigma".
    # 95 % intervals, symmetric in the logarithm; from zero for an amplitude that vanished.
    intervals: dict[str, tuple[float, float]]
    curve: SpectrumCurve  # the density that was fitted
    ratio: FloatArray  # (b,): measured over modelled density at `frequency`
    frequency: FloatArray  # (b,): hz
    dispersion: float  # misfit over what chance and the discrepancy explain
    # relative standard deviation that had to be granted to every point because no sum of these
    # processes fits better; 0 when the misfit is pure chance. Errors include it.
    discrepancy: float
    # criterion (smaller is better) of the structures that were compared
    candidates: Mapping[str, float]
    slopes: SpectrumReadings  # the slope method on the same curve
    verdict: RecordVerdict  # record length against need
    converged: bool  # the fit ended by itself
    # "trend"; "fast part left out": the fit ends at a twentieth of the rate, because faster points
    # do not follow the model (a sensor's own low-pass does that); "misfit": a discrepancy was
    # granted; "not converged".
    flags: tuple[str, ...]

    @property
    def parameters(self) -> dict[str, float]:
        """Fitted values by parameter, SI."""
        values = self.process.parameters
        return {key: values[key] for key in self.standard_errors}

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, in SI."""
        names = ("dispersion", "discrepancy", "candidates")
        misfit = {"misfit": {name: plain(getattr(self, name)) for name in names}}
        named = fitted_to_dict(self.process, self.parameters, self.standard_errors, self.intervals)
        return ToDict.to_dict(self) | named | misfit


def identify_spectrum(
    signal: ArrayLike,
    rate: float,
    model: str | Process = "auto",
    *,
    segment: int | None = None,
    band: tuple[float, float] | None = None,
) -> SpectrumFit:
    """Find the processes of a signal from its power spectral density.

    Parameters
    ----------
    signal : (n,) array_like
        Samples at a constant rate, in u.
    rate : float
        Samples a second, Hz.
    model : {"auto", "classical"} or Process
        Structure that is fitted, or how it is chosen.
    segment : int, optional
        Samples of a segment of Welch's average.
    band : (low, high), optional
        Frequencies that are used, Hz.

    Returns
    -------
    SpectrumFit
        Parameters in SI with standard errors, and the process.

    Raises
    ------
    InputError
        Too short, or a band without frequencies.

    Notes
    -----
    S004 (12) and section 5.3, fitted by Whittle's likelihood instead of by eye.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> noise = schuler.WhiteNoise(0.1).simulate(50_000, 0.01, np.random.default_rng(0))
    >>> fit = schuler.identify_spectrum(noise, 100.0, schuler.WhiteNoise(1.0))
    >>> round(fit.parameters["white_noise.density"], 2)
    0.1
    """
    return fit_spectrum(
        power_spectral_density(signal, rate, onesided=False, segment=segment), model, band=band
    )


def fit_spectrum(
    curve: SpectrumCurve,
    model: str | Process = "auto",
    *,
    band: tuple[float, float] | None = None,
) -> SpectrumFit:
    """Fit a sum of processes to an averaged density by the likelihood of its points."""
    if "constant" in curve.flags:
        raise EstimationError("signal does not vary", expected="noise")
    if curve.first[0] == 0:
        raise InputError("a density of single bins", expected="bins_per_octave=8 or so")
    points = spectrum_points(curve, band)
    if points.frequency.size < _FEWEST_POINTS:
        raise EstimationError(
            f"density of {points.frequency.size} points",
            expected=f"at least {_FEWEST_POINTS}",
            cure="record longer, or widen the band",
        )
    if model != "auto":
        checked_structure(_structure(model, points))
    points, fit, candidates, granted, left_out = _fit(points, model, band is None)
    dispersion, _ = _dispersion(fit, points)
    flags = [f for f in curve.flags if f == "trend"]
    flags += ["fast part left out"] if left_out else []
    flags += ["misfit"] if granted > 0.0 else []
    flags += [] if fit.converged else ["not converged"]
    errors, intervals = _errors(fit, points)
    return SpectrumFit(
        process=fit.process,
        standard_errors=errors,
        intervals=intervals,
        curve=curve,
        ratio=fit.ratio,
        frequency=points.frequency,
        dispersion=dispersion,
        discrepancy=granted,
        candidates=candidates,
        slopes=spectrum_slopes(curve),
        verdict=judge_record(fit.process, errors, curve.duration),
        converged=fit.converged,
        flags=tuple(flags),
    )


def _fit(
    points: SpectrumPoints, model: str | Process, may_leave_out: bool
) -> tuple[SpectrumPoints, SpectrumStructureFit, dict[str, float], float, bool]:
    """Fit; where that fails leave out the fastest points, then grant a discrepancy."""

    def attempt(points: SpectrumPoints) -> tuple[SpectrumStructureFit, dict[str, float]]:
        if model == "auto":
            return _choose(points)
        parts = [scaled_under(p, points) for p in _structure(model, points)]
        return fit_spectrum_structure(parts, points), {}

    fit, candidates = attempt(points)
    if not _dispersion(fit, points)[1]:
        return points, fit, candidates, 0.0, False
    slow = points.below(_BAND_EDGE / points.dt)
    left_out = may_leave_out and slow.frequency.size >= _FEWEST_POINTS
    if left_out:
        points = slow
        fit, candidates = attempt(points)
        if not _dispersion(fit, points)[1]:
            return points, fit, candidates, 0.0, True
    low, high = 1e-4, 3.0
    for _ in range(12):
        middle = math.sqrt(low * high)
        granted = points.with_discrepancy(middle)
        again = fit_spectrum_structure(fit.parts, granted, iterations=20)
        low, high = (middle, high) if _dispersion(again, granted)[0] > 1.0 else (low, middle)
    points = points.with_discrepancy(high)
    fit, candidates = attempt(points)
    return points, fit, candidates, high, left_out


def _structure(model: str | Process, points: SpectrumPoints) -> tuple[Process, ...]:
    return parts_of_model(model, points.dt, points.duration, "a spectrum")


def _dispersion(fit: SpectrumStructureFit, points: SpectrumPoints) -> tuple[float, bool]:
    """Deviance over its expectation, and whether it is above one beyond chance."""
    from scipy.special import digamma, polygamma

    shape = 0.5 * points.freedom
    expected = float(points.weight @ (np.log(shape) - digamma(shape)))
    expected *= 1.0 - len(fit.names) / points.frequency.size
    spread = math.sqrt(float(points.weight**2 @ (polygamma(1, shape) - 1.0 / shape)))
    return fit.cost / expected, (fit.cost - expected) / spread > _SUSPICIOUS


def _errors(
    fit: SpectrumStructureFit, points: SpectrumPoints
) -> tuple[dict[str, float], dict[str, tuple[float, float]]]:
    names = fit.process.names
    errors: dict[str, float] = {}
    intervals: dict[str, tuple[float, float]] = {}
    for j, (k, name) in enumerate(fit.names):
        value = float(getattr(fit.parts[k], name))
        spread = min(math.sqrt(float(fit.log_covariance[j, j])), 50.0)
        key = f"{names[k]}.{name}"
        errors[key] = min(value * spread, 1e3 * value)
        low, high = value * math.exp(-1.959964 * spread), value * math.exp(1.959964 * spread)
        if spread > _VANISHED and name == fit.parts[k].size_name():
            # its square, in which the density is linear, is known even where it is not seen
            unseen = smallest_seen(fit, j, points)
            errors[key] = max(errors[key] if spread < 50.0 else 0.0, unseen)
            low, high = 0.0, math.sqrt(value**2 + (1.959964 * unseen) ** 2)
        intervals[key] = (low, high)
    return errors, intervals


def _choose(points: SpectrumPoints) -> tuple[SpectrumStructureFit, dict[str, float]]:
    """Choose the structure by the spectrum alone."""

    def fit(parts: Sequence[Process], iterations: int = 60) -> SpectrumStructureFit:
        return fit_spectrum_structure(parts, points, iterations)

    corners = np.geomspace(0.2 * points.frequency[-1], 2.0 * points.frequency[0], 5)
    return Choice(
        fit=fit,
        start=lambda part: scaled_under(part, points, 0.7),
        singles=(RandomWalk(1.0), Quantization(1.0), WhiteNoise(1.0)),
        times=1.0 / (2.0 * math.pi * corners),
    ).run()
