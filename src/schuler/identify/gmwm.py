"""Processes from wavelet variances, plain or robust, from one record or several of one sensor."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.characterize.robust import biweight_tuning, median_scale, robust_variance
from schuler.characterize.wavelet_variance import WaveletVarianceCurve, wavelet_variance
from schuler.errors import EstimationError, InputError, ModelError
from schuler.identify.curve_fit import FREE, CurvePoints, fit_structure, free_parameters
from schuler.identify.identification import FitDiagnostics, Identification
from schuler.identify.record import judge_record
from schuler.identify.replicates import Agreement, compare_runs
from schuler.identify.selection import rough_process, select_structure
from schuler.identify.slopes import slope_method
from schuler.identify.wavelet_moments import (
    MomentFit,
    fit_moments,
    heterogeneity,
    pooled_points,
    pooled_scatter,
)
from schuler.processes import (
    BiasInstability,
    GaussMarkov,
    Process,
    ProcessSum,
    RandomWalk,
    WhiteNoise,
)

FloatArray = NDArray[np.float64]
Model = Literal["auto", "classical"] | Process
Robust = bool | Literal["samples", "coefficients"]

_SHORTEST_RECORD = 100
_BAND_EDGES = (10, 50)
_FASTEST = 3.0
_FEWEST_SCALES = 8
_MISFIT = 1e-3
_SHARED = 0.01
_HEAVY_TAILS = 1.3


@dataclass(frozen=True, slots=True, eq=False)
class GmwmIdentification(Identification):
    """What the generalised method of wavelet moments found.

    Parameters
    ----------
    wavelet : WaveletVarianceCurve
        The curve that was fitted (the longest record's where several were pooled).
    p_value : float
        Of the J test: probability of a larger misfit if the model is true.
    wvic : float
        Wavelet variance information criterion; smaller is better among models of one curve.
    flags : tuple of str
        What a reader should know, in plain words; empty when all is well.

    Notes
    -----
    All else as in `Identification`.
    """

    wavelet: WaveletVarianceCurve
    p_value: float
    wvic: float
    flags: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain Python for JSON, in SI."""
        return {
            **Identification.to_dict(self),
            "method": "gmwm",
            "wavelet_variance": self.wavelet.to_dict(),
            "p_value": self.p_value,
            "wvic": self.wvic,
            "converged": self.diagnostics.converged,
            "flags": list(self.flags),
        }


@dataclass(frozen=True, slots=True, eq=False)
class PooledIdentification:
    """Several records of one sensor, together and apart.

    Parameters
    ----------
    pooled : GmwmIdentification
        One model for all records.
    runs : tuple of GmwmIdentification
        The same structure, each record alone.
    chi_square : float
        Heterogeneity: what the common parameters cost in misfit beside separate ones.
    degrees_of_freedom : int
        (records - 1) times parameters.
    p_value : float
        Probability of a larger chi-square if the records share one model.
    agreements : tuple of Agreement
        The same question for every parameter.
    """

    pooled: GmwmIdentification
    runs: tuple[GmwmIdentification, ...]
    chi_square: float
    degrees_of_freedom: int
    p_value: float
    agreements: tuple[Agreement, ...]

    @property
    def shared(self) -> bool:
        """True where the records may share one model, at the 1 % level."""
        return self.p_value > _SHARED

    def to_dict(self) -> dict[str, Any]:
        """Return everything as plain Python for JSON, in SI."""
        from dataclasses import asdict

        return {
            "pooled": self.pooled.to_dict(),
            "runs": [r.to_dict() for r in self.runs],
            "heterogeneity": {
                "chi_square": self.chi_square,
                "degrees_of_freedom": self.degrees_of_freedom,
                "p_value": self.p_value,
                "shared": self.shared,
                "parameters": [{**asdict(a), "shared": a.shared} for a in self.agreements],
            },
        }


def fit_gmwm(
    signal: ArrayLike,
    rate: float,
    model: Model = "auto",
    robust: Robust = False,
    efficiency: float = 0.6,
) -> GmwmIdentification:
    """Find the sum of processes of a signal by the generalised method of wavelet moments.

    Parameters
    ----------
    signal : (n,) array_like
        Samples at rest, in rad/s or m/s² (or any unit; the result is in the same).
    rate : float
        Samples a second.
    model : {"auto", "classical"} or Process
        "auto" chooses among white noise, quantisation, up to three Gauss-Markov noises, random
        walk and ramp; "classical" is white noise, bias instability and random walk; a process
        (sum) fixes the structure.
    robust : bool or {"samples", "coefficients"}
        As for `wavelet_variance`: hold outliers back.
    efficiency : float
        Of the robust estimate.

    Returns
    -------
    GmwmIdentification
        Process, sandwich standard errors, J test, flags.

    Raises
    ------
    InputError
        Not one-dimensional, not finite, an impossible rate, an unknown model.
    EstimationError
        Fewer than 100 samples, or a signal that does not vary.
    ModelError
        A model without a parameter that a wavelet variance shows.
    """
    values = _values(signal)
    curve = wavelet_variance(values, rate, robust, efficiency)
    return fit_gmwm_curves([curve], model, tail_ratio(values) if not robust else 1.0)


def fit_gmwm_replicates(
    signals: Sequence[ArrayLike],
    rate: float,
    model: Model = "auto",
    robust: Robust = False,
    efficiency: float = 0.6,
) -> PooledIdentification:
    """Fit one model to several records of one sensor, and test whether they share it.

    Parameters
    ----------
    signals : sequence of (n,) array_like
        Records of one channel, at least two; lengths may differ.
    rate : float
        Samples a second of all.
    model, robust, efficiency
        As for `fit_gmwm`.

    Returns
    -------
    PooledIdentification
        Together, apart, and the heterogeneity chi-square (spec 10, multi-signal GMWM).

    Raises
    ------
    InputError, EstimationError, ModelError
        As `fit_gmwm`; fewer than two records.
    """
    from scipy.special import chdtrc

    if len(signals) < 2:
        raise EstimationError(f"{len(signals)} record", expected="at least two")
    curves, tails = [], 1.0
    for k, signal in enumerate(signals):
        try:
            values = _values(signal)
            curves.append(wavelet_variance(values, rate, robust, efficiency))
        except (InputError, EstimationError) as error:
            raise error.at(f"record {k}") from None
        tails = max(tails, 1.0 if robust else tail_ratio(values))
    pooled = fit_gmwm_curves(curves, model, tails)
    used = [_from(c, float(pooled.diagnostics.tau[0])) for c in curves]
    granted = 2.0 * pooled.diagnostics.discrepancy
    together = fit_moments(pooled.process.parts, used, granted)
    chi_square, freedom = heterogeneity(together, used, granted)
    runs = tuple(
        _result(fit_moments(together.parts, [c], granted), [c], granted, {}, 1.0) for c in used
    )
    p_value = float(chdtrc(max(freedom, 1), chi_square))
    if p_value <= _SHARED:
        pooled = _widened(pooled, math.sqrt(max(chi_square / max(freedom, 1), 1.0)))
    return PooledIdentification(
        pooled=pooled,
        runs=runs,
        chi_square=chi_square,
        degrees_of_freedom=freedom,
        p_value=p_value,
        agreements=tuple(compare_runs(runs, key) for key in pooled.standard_errors),
    )


def fit_gmwm_curves(
    curves: Sequence[WaveletVarianceCurve], model: Model = "auto", tails: float = 1.0
) -> GmwmIdentification:
    """Fit one model to wavelet variance curves of one sensor.

    Parameters
    ----------
    curves : sequence of WaveletVarianceCurve
        At one rate.
    model : {"auto", "classical"} or Process
        As for `fit_gmwm`.
    tails : float
        Variance at the finest scale over its robust value, for the flag; 1 if unknown.

    Returns
    -------
    GmwmIdentification
        As from `fit_gmwm`.

    Raises
    ------
    EstimationError
        A signal that does not vary or is too short.
    InputError
        Curves at different rates.
    """
    if any(c.rate != curves[0].rate for c in curves):
        raise InputError("records at different rates", expected="one rate")
    for curve in curves:
        if curve.scale.size < 4 or not (curve.variance > 0.0).all():
            raise EstimationError(
                "signal does not vary at every scale",
                expected="noise",
                cure="check that the channel was recorded and is not stuck",
            )
    start = _start(model, curves[0])
    kept, fit = list(curves), None
    candidates: dict[str, float] = {}
    for edge in (1, *_BAND_EDGES):
        slow = [_from(c, (edge - 0.5) / c.rate) for c in curves]
        if edge > 1 and min(c.scale.size for c in slow) < _FEWEST_SCALES:
            break
        kept = slow
        fit, candidates = _fit(start, kept, 0.0)
        if _fits(fit, kept, 0.0) and (start is not None or not _filter_of_the_sensor(fit, kept)):
            break
    assert fit is not None
    granted = 0.0
    if not _fits(fit, kept, 0.0):
        granted = _discrepancy(fit, kept, 0.0)
        fit, candidates = _fit(start, kept, granted)
        more = _discrepancy(fit, kept, granted)
        if more != granted:
            granted = more
            fit = fit_moments(fit.parts, kept, granted)
    return _result(fit, kept, granted, candidates, tails)


def _fit(
    start: tuple[Process, ...] | None,
    curves: Sequence[WaveletVarianceCurve],
    granted: float,
) -> tuple[MomentFit, dict[str, float]]:
    """Choose the structure where it is not given, and fit it."""
    points = pooled_points(curves)
    if start is None:
        scatter = pooled_scatter(rough_process(points), curves, points)
        chosen, candidates = select_structure(points, scatter.with_discrepancy(granted))
        return fit_moments(chosen.parts, curves, granted), candidates
    return fit_moments(_log_fit(start, curves, points), curves, granted), {}


def _filter_of_the_sensor(fit: MomentFit, curves: Sequence[WaveletVarianceCurve]) -> bool:
    """Whether a Gauss-Markov noise describes only the fastest scales.

    A sensor's own low-pass filter correlates neighbouring samples, which none of the processes
    describes and no navigation filter feels.
    """
    edge = _FASTEST * curves[0].scale[0]
    return any(isinstance(p, GaussMarkov) and p.correlation_time < edge for p in fit.parts)


def _misfit(
    fit: MomentFit, curves: Sequence[WaveletVarianceCurve], granted: float
) -> tuple[float, int]:
    """Misfit within records and its degrees of freedom: what records do not share is left out."""
    if len(curves) == 1:
        return fit.chi_square, max(fit.degrees_of_freedom, 1)
    between, freedom = heterogeneity(fit, curves, granted)
    return fit.chi_square - between, max(fit.degrees_of_freedom - freedom, 1)


def _fits(fit: MomentFit, curves: Sequence[WaveletVarianceCurve], granted: float) -> bool:
    """Whether the misfit may be chance."""
    from scipy.special import chdtri

    chi_square, freedom = _misfit(fit, curves, granted)
    return chi_square <= float(chdtri(freedom, _MISFIT))


def _values(signal: ArrayLike) -> NDArray[Any]:
    values = np.asarray(signal)
    if values.ndim != 1:
        raise InputError(f"signal has shape {values.shape}", expected="(n,), one channel at a time")
    if values.size < _SHORTEST_RECORD:
        raise EstimationError(
            f"signal has {values.size} samples",
            expected=f"at least {_SHORTEST_RECORD}",
            cure="record longer",
        )
    return values


def tail_ratio(values: NDArray[Any]) -> float:
    """Compare the variance at the finest scale with what it is without outliers.

    Parameters
    ----------
    values : (n,) ndarray
        Signal.

    Returns
    -------
    float
        Variance of the differences over its robust value; 1 where most of them are zero.
    """
    step = np.diff(values.astype(np.float64))
    plain = float(step @ step) / step.size
    if plain == 0.0 or median_scale(step) == 0.0:
        return 1.0
    return plain / robust_variance(step, biweight_tuning(0.5))[0]


def _from(curve: WaveletVarianceCurve, shortest: float) -> WaveletVarianceCurve:
    """The curve at scales from `shortest` s on."""
    keep = curve.scale >= shortest * (1.0 - 1e-9)
    return replace(
        curve,
        scale=curve.scale[keep],
        variance=curve.variance[keep],
        lower=curve.lower[keep],
        upper=curve.upper[keep],
        degrees_of_freedom=curve.degrees_of_freedom[keep],
    )


def _start(model: Model, curve: WaveletVarianceCurve) -> tuple[Process, ...] | None:
    if isinstance(model, str) and model == "auto":
        return None
    if isinstance(model, str) and model == "classical":
        shortest, longest = 2.0 / curve.rate, 10.0 * curve.duration
        classical = WhiteNoise(1.0) + BiasInstability(1.0, shortest, longest) + RandomWalk(1.0)
        parts: tuple[Process, ...] = classical.components
    elif isinstance(model, Process):
        parts = model.components
    else:
        raise InputError(f"model '{model}'", expected="'auto', 'classical' or a process")
    if not free_parameters(parts):
        raise ModelError("the model has no parameter that a wavelet variance shows")
    return parts


def _log_fit(
    parts: Sequence[Process], curves: Sequence[WaveletVarianceCurve], points: CurvePoints
) -> tuple[Process, ...]:
    """Start values: the joint fit of the log curve, correlation times from where they are given.

    Times that were given as mere placeholders are tried along the curve too.
    """
    scatter = pooled_scatter(rough_process(points), curves, points)
    starts = [list(parts)]
    times = [k for k, p in enumerate(parts) if isinstance(p, GaussMarkov)]
    if times:
        count = max(4, 2 * len(times))
        grid = np.geomspace(2.0 * points.tau[0], points.tau[-1], count)
        for first in range(count - len(times) + 1):
            moved = list(parts)
            picked = np.linspace(first, count - 1, len(times)).astype(int) if first else None
            for j, k in enumerate(sorted(times, key=lambda k: parts[k].parameters[_TIME])):
                at = first + j if picked is None else int(picked[j])
                moved[k] = replace(parts[k], correlation_time=float(grid[at]))  # type: ignore[type-var]
            starts.append(moved)
    fits = [
        fit_structure([_scaled(p, points) for p in start], points, scatter, 30) for start in starts
    ]
    best = min(fits, key=lambda f: f.chi_square)
    return fit_structure(best.parts, points, scatter).parts


_TIME = "correlation_time"


def _scaled(part: Process, points: CurvePoints) -> Process:
    """Give a part an amplitude below the curve, whatever its start value."""
    if not FREE[part.kind]:
        return part
    name = FREE[part.kind][0]
    unit = replace(part, **{name: 1.0})  # type: ignore[type-var]
    shape = np.maximum(unit.allan_variance(points.tau), 1e-300)
    amplitude = math.sqrt(0.5 * float(np.min(points.variance / shape)))
    return replace(unit, **{name: amplitude})  # type: ignore[type-var]


def _discrepancy(fit: MomentFit, curves: Sequence[WaveletVarianceCurve], granted: float) -> float:
    """Relative sd to grant to every wavelet variance so that the misfit is as expected."""
    if _fits(fit, curves, granted):
        return granted
    low, high = 1e-5, 3.0
    for _ in range(12):
        middle = math.sqrt(low * high)
        again = fit_moments(fit.parts, curves, middle, steps=1)
        chi_square, freedom = _misfit(again, curves, middle)
        low, high = (middle, high) if chi_square > freedom else (low, middle)
    return math.sqrt(low * high)


def _widened(found: GmwmIdentification, factor: float) -> GmwmIdentification:
    """The same with standard errors larger by a factor, and a flag that says so."""
    return replace(
        found,
        standard_errors={k: factor * e for k, e in found.standard_errors.items()},
        intervals={
            k: (v * (low / v) ** factor, v * (high / v) ** factor)
            for (k, (low, high)), v in zip(
                found.intervals.items(), found.parameters.values(), strict=True
            )
        },
        flags=(
            *found.flags,
            "the records do not share one model: errors of the common one were widened "
            f"{factor:.2g} times",
        ),
    )


def _result(
    fit: MomentFit,
    curves: Sequence[WaveletVarianceCurve],
    granted: float,
    candidates: dict[str, float],
    tails: float,
) -> GmwmIdentification:
    from scipy.special import chdtrc

    process = fit.process
    errors: dict[str, float] = {}
    intervals: dict[str, tuple[float, float]] = {}
    limits: dict[str, float] = {}
    for j, (k, name) in enumerate(fit.names):
        key = f"{process.names[k]}.{name}"
        value = abs(float(getattr(fit.parts[k], name)))
        spread = min(math.sqrt(float(fit.log_covariance[j, j])), 50.0)
        errors[key] = min(value * spread, 1e3 * value)
        intervals[key] = (value * math.exp(-1.959964 * spread), value * math.exp(1.959964 * spread))
        if spread > 2.0:
            limits[key] = value * math.exp(min(1.645 * spread, 20.0))
    longest = max(curves, key=lambda c: c.samples)
    points = pooled_points(curves)
    shown = longest.allan
    p_value = float(chdtrc(max(fit.degrees_of_freedom, 1), fit.chi_square))
    model = process.wavelet_variance(points.tau)
    return GmwmIdentification(
        process=process,
        standard_errors=errors,
        intervals=intervals,
        limits=limits,
        curve=shown,
        diagnostics=FitDiagnostics(
            chi_square=fit.chi_square,
            degrees_of_freedom=fit.degrees_of_freedom,
            discrepancy=0.5 * granted,
            tau=points.tau,
            residuals=0.5 * np.log(0.5 * points.variance / model),
            candidates=candidates,
            converged=fit.converged,
        ),
        slopes=slope_method(shown),
        verdict=judge_record(process, errors, math.fsum(c.duration for c in curves)),
        wavelet=longest,
        p_value=p_value,
        wvic=fit.wvic,
        flags=_flags(fit, process, longest, granted, tails),
    )


def _flags(
    fit: MomentFit,
    process: ProcessSum,
    curve: WaveletVarianceCurve,
    granted: float,
    tails: float,
) -> tuple[str, ...]:
    flags = []
    if not fit.converged:
        flags.append("the fit did not converge")
    if granted > 0.0:
        flags.append(
            f"no sum of these processes fits better than {50.0 * granted:.1f} % in deviation: "
            "errors were widened to match"
        )
    if tails > _HEAVY_TAILS:
        flags.append(
            f"heavy tails or outliers: the finest scale holds {tails:.3g} times its robust "
            "variance; robust=True holds them back"
        )
    times = [p.correlation_time for p in process.parts if isinstance(p, GaussMarkov)]
    flags += [
        f"a correlation time of {t:.3g} s cannot be told from a random walk in "
        f"{curve.duration:.3g} s"
        for t in times
        if t > 0.5 * curve.duration
    ]
    flags += [
        f"a correlation time of {t:.3g} s stands at the shortest scale: it may be shorter"
        for t in times
        if t <= 1.001 * curve.scale[0]
    ]
    if curve.robust == "samples" and curve.outliers > 0.1:
        flags.append(f"{100.0 * curve.outliers:.0f} % of the samples were held back as outliers")
    return tuple(flags)
