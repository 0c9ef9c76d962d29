"""From a signal to its processes: the joint fit of the Allan curve (spec 2.4 b)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.curves.allan import AllanCurve, allan_deviation, default_factors
from schuler.errors import EstimationError, InputError, ModelError
from schuler.estimation.curve_fit import (
    CurvePoints,
    Scatter,
    StructureFit,
    fit_structure,
    free_parameters,
    scatter_of,
    thin,
)
from schuler.estimation.identification import FitDiagnostics, Identification
from schuler.estimation.record import judge_record
from schuler.estimation.selection import rough_process, select_structure
from schuler.estimation.slopes import slope_method
from schuler.noise import (
    BiasInstability,
    GaussMarkov,
    Process,
    ProcessSum,
    Quantization,
    RandomWalk,
    RateRamp,
    WhiteNoise,
)

_POINTS_PER_DECADE = 5.0
_LONGEST_FRACTION = 3
_SHORTEST_RECORD = 100
_BAND_EDGES = (10, 50)
_FASTEST = 1.5
_HOPELESS = 0.03
_FEWEST_POINTS = 12
_LOOKED_FOR: tuple[Process, ...] = (RandomWalk(1.0), Quantization(1.0), RateRamp(1.0))


def fit_factors(samples: int) -> NDArray[np.int64]:
    """Cluster lengths of the curve that is fitted: the default ones and a few up to a third."""
    usual = default_factors(samples)
    longest = max(samples // _LONGEST_FRACTION, 1)
    more = np.round(np.geomspace(usual[-1], longest, 8)).astype(np.int64)
    return np.unique(np.concatenate([usual, more]))


def identify(
    signal: ArrayLike,
    rate: float,
    model: Literal["auto", "classical"] | Process = "auto",
    method: Literal["allan"] = "allan",
) -> Identification:
    """Find the sum of processes that a signal is made of, with standard errors.

    Parameters
    ----------
    signal : (n,) array_like
        Samples at rest, in rad/s or m/s² (or any unit; the result is in the same).
    rate : float
        Samples a second.
    model : {"auto", "classical"} or Process
        "auto" chooses among white noise, quantisation, up to three Gauss-Markov noises, random
        walk and ramp; "classical" is white noise + bias instability + random walk, as datasheets
        have it; a process (sum) fixes the structure and gives start values.
    method : {"allan"}
        Generalised least squares on the logarithm of the Allan variance.

    Returns
    -------
    Identification
        Process, errors, limits, misfit, the slope method beside it, verdict on the record.

    Raises
    ------
    InputError
        Not one-dimensional, not finite, an impossible rate.
    EstimationError
        Fewer than 100 samples, or a signal that does not vary.

    Notes
    -----
    Spec 2.4 (b), with the covariance of neighbouring points from the fitted process itself.
    """
    if method != "allan":
        raise InputError(f"method '{method}'", expected="'allan'")
    values = np.asarray(signal)
    if values.ndim != 1:
        raise InputError(f"signal has shape {values.shape}", expected="(n,), one channel at a time")
    _check_length(len(values))
    return identify_curve(allan_deviation(values, rate, fit_factors(len(values)) / rate), model)


def _check_length(samples: int) -> None:
    if samples < _SHORTEST_RECORD:
        raise EstimationError(
            f"signal has {samples} samples",
            expected=f"at least {_SHORTEST_RECORD}",
            cure="record longer",
        )


def identify_curve(
    curve: AllanCurve, model: Literal["auto", "classical"] | Process = "auto"
) -> Identification:
    """Find the processes behind an Allan curve."""
    _check_length(curve.samples)
    points = thin(curve, _POINTS_PER_DECADE)
    if points.tau.size < 4:
        raise EstimationError(
            "signal does not vary",
            expected="noise",
            cure="check that the channel was recorded and is not stuck",
        )
    points, fit, scatter, candidates = _fit(points, _start(model, points))
    process, errors, intervals, vanished = _parameters(fit)
    limits = {**_limits(fit, points, scatter), **vanished}
    return Identification(
        process=process,
        standard_errors=errors,
        intervals=intervals,
        limits=limits,
        curve=_usual_part(curve),
        diagnostics=FitDiagnostics(
            chi_square=fit.chi_square,
            degrees_of_freedom=points.tau.size - len(fit.names),
            discrepancy=0.5 * scatter.discrepancy,
            tau=points.tau,
            residuals=0.5 * fit.residuals,
            candidates=candidates,
            converged=fit.converged,
        ),
        slopes=slope_method(_usual_part(curve)),
        verdict=judge_record(process, errors, curve.duration),
    )


def _start(model: str | Process, points: CurvePoints) -> tuple[Process, ...] | None:
    """Return the parts of a fixed structure with sensible start values; None for a choice."""
    if model == "auto":
        return None
    if model == "classical":
        # the flicker sum must cover the record from its samples to its length
        shortest, longest = 2.0 * points.dt, 10.0 * points.duration
        classical = WhiteNoise(1.0) + BiasInstability(1.0, shortest, longest) + RandomWalk(1.0)
        parts: tuple[Process, ...] = classical.components
    elif isinstance(model, Process):
        parts = model.components
    else:
        raise InputError(f"model '{model}'", expected="'auto', 'classical' or a process")
    if not free_parameters(parts):
        raise ModelError("the model has no parameter that an Allan curve shows")
    return tuple(_scaled(part, points) for part in parts)


def _scaled(part: Process, points: CurvePoints) -> Process:
    """Give a part an amplitude below the curve, whatever its start value."""
    from schuler.estimation.curve_fit import FREE

    if not FREE[part.kind]:
        return part
    name = FREE[part.kind][0]
    unit = replace(part, **{name: 1.0})  # type: ignore[type-var]
    shape = np.maximum(unit.allan_variance(points.tau), 1e-300)
    amplitude = math.sqrt(0.5 * float(np.min(points.variance / shape)))
    return replace(unit, **{name: amplitude})  # type: ignore[type-var]


def _fit(
    points: CurvePoints, parts: tuple[Process, ...] | None
) -> tuple[CurvePoints, StructureFit, Scatter, dict[str, float]]:
    """Fit; where that fails, leave out the fastest points, then grant a discrepancy."""
    edges = [1, *(e for e in _BAND_EDGES if points.slower_than(e).tau.size >= _FEWEST_POINTS)]
    whole = points
    for edge in edges:
        points = whole.slower_than(edge)
        last = edge == edges[-1]
        scatter, granted = _probe(points, parts)
        if edge == 1 and not last:
            if granted > _HOPELESS:
                continue
            granted = 0.0
        fit, scatter, candidates = _settle(points, parts, scatter.with_discrepancy(granted))
        if edge == 1 and not last and scatter.discrepancy > 0.0:
            continue
        if parts is not None or not _filter_of_the_sensor(fit, points):
            break
    return points, fit, scatter, candidates


def _filter_of_the_sensor(fit: StructureFit, points: CurvePoints) -> bool:
    """Whether a Gauss-Markov noise describes only the fastest points."""
    edge = _FASTEST * points.tau[0]
    return any(isinstance(p, GaussMarkov) and p.correlation_time < edge for p in fit.parts)


def _probe(points: CurvePoints, parts: tuple[Process, ...] | None) -> tuple[Scatter, float]:
    """Find out whether anything fits: the given structure, or many terms at once."""
    rough = rough_process(points)
    scatter = scatter_of(rough, points)
    rich = fit_structure(rough.parts if parts is None else parts, points, scatter, 25)
    return scatter, _discrepancy(rich, points, scatter)


def _settle(
    points: CurvePoints, parts: tuple[Process, ...] | None, scatter: Scatter
) -> tuple[StructureFit, Scatter, dict[str, float]]:
    """Choose the structure, then let the scatter follow the fitted process."""
    candidates: dict[str, float] = {}
    if parts is None:
        fit, candidates = select_structure(points, scatter)
    else:
        fit = fit_structure(parts, points, scatter)
    granted = scatter.discrepancy
    for _ in range(2):
        scatter = scatter_of(_scattering(fit.process), points, granted)
        fit = fit_structure(fit.parts, points, scatter)
    # the many terms of the probe need not have converged: what the chosen ones need counts
    exact = scatter.with_discrepancy(0.0)
    strict = fit_structure(fit.parts, points, exact)
    needed = _discrepancy(replace(strict, parts=fit.parts), points, exact)
    if needed != granted:
        scatter = scatter.with_discrepancy(needed)
        fit = fit_structure(fit.parts, points, scatter)
    return fit, scatter, candidates


def _scattering(process: ProcessSum) -> Process:
    """What of a process scatters; white noise stands in where nothing does."""
    quiet = ("rate_ramp", "turn_on_bias", "sinusoid")
    parts = tuple(p for p in process.parts if p.kind not in quiet)
    return ProcessSum(parts) if parts else WhiteNoise(1.0)


def _discrepancy(fit: StructureFit, points: CurvePoints, scatter: Scatter) -> float:
    """Standard deviation to grant to every log variance so that chi-square is as expected."""
    from scipy.special import chdtri

    freedom = max(points.tau.size - len(fit.names), 1)
    if fit.chi_square <= float(chdtri(freedom, 1e-3)):
        return scatter.discrepancy
    low, high = 1e-5, 3.0
    for _ in range(12):
        middle = math.sqrt(low * high)
        again = fit_structure(fit.parts, points, scatter.with_discrepancy(middle), iterations=25)
        low, high = (middle, high) if again.chi_square > freedom else (low, middle)
    return math.sqrt(low * high)


def _parameters(
    fit: StructureFit,
) -> tuple[ProcessSum, dict[str, float], dict[str, tuple[float, float]], dict[str, float]]:
    process = fit.process
    errors: dict[str, float] = {}
    intervals: dict[str, tuple[float, float]] = {}
    vanished: dict[str, float] = {}
    for j, (k, name) in enumerate(fit.names):
        key = f"{process.names[k]}.{name}"
        value = float(getattr(fit.parts[k], name))
        spread = min(math.sqrt(float(fit.log_covariance[j, j])), 50.0)
        errors[key] = min(value * spread, 1e3 * value)
        intervals[key] = (value * math.exp(-1.959964 * spread), value * math.exp(1.959964 * spread))
        if spread > 2.0:
            vanished[key] = value * math.exp(min(1.645 * spread, 20.0))
    return process, errors, intervals, vanished


def _limits(fit: StructureFit, points: CurvePoints, scatter: Scatter) -> dict[str, float]:
    """95 % upper limits of the terms that are not in the model, all others being free."""
    from schuler.estimation.curve_fit import log_jacobian

    model = fit.process.allan_variance(points.tau)
    known = scatter.whitener @ log_jacobian(fit, points.tau)
    residual = scatter.whitener @ fit.residuals
    limits: dict[str, float] = {}
    for term in _LOOKED_FOR:
        if term.kind in fit.kinds:
            continue
        # linear in the square of the amplitude, which may come out on either side of zero
        column = scatter.whitener @ (term.allan_variance(points.tau) / model)
        free = column - known @ np.linalg.lstsq(known, column, rcond=1e-10)[0]
        information = float(free @ free)
        if information <= 0.0:
            continue
        square = max(float(free @ residual) / information, 0.0)
        name = free_parameters([term])[0][1]
        limits[f"{term.kind}.{name}"] = math.sqrt(square + 1.645 / math.sqrt(information))
    return limits


def _usual_part(curve: AllanCurve) -> AllanCurve:
    """The curve up to a ninth of the record, beyond which it is too ragged to show."""
    keep = curve.factors <= max(1, curve.samples // 9)
    if keep.all():
        return curve
    return AllanCurve(
        curve.tau[keep],
        curve.deviation[keep],
        curve.lower[keep],
        curve.upper[keep],
        curve.degrees_of_freedom[keep],
        curve.rate,
        curve.samples,
        curve.kind,
    )
