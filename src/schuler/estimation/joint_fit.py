"""From a signal to its processes: the joint fit of the Allan curve (spec 2.4 b)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from schuler.curves.allan_curve import AllanCurve, default_factors
from schuler.errors import EstimationError
from schuler.estimation.curve_fit import (
    CurvePoints,
    Scatter,
    StructureFit,
    fit_structure,
    limits_of,
    scatter_of,
    scattering,
    thin,
)
from schuler.estimation.identification import FitDiagnostics, Identification
from schuler.estimation.parts import estimates_of, is_structure, parts_of_model
from schuler.estimation.record import judge_record
from schuler.estimation.selection import from_several_starts, rough_process, select_structure
from schuler.estimation.slopes import slope_method
from schuler.noise import Process

_POINTS_PER_DECADE = 5.0
LONGEST_FRACTION = 3
_SHORTEST_RECORD = 100
_BAND_EDGES = (10, 30, 100, 300)
_AT_THE_EDGE = 3.0
_HOPELESS = 0.03
_FEWEST_POINTS = 12


def fit_factors(samples: int) -> NDArray[np.int64]:
    """Cluster lengths of the curve that is fitted: the default ones and a few up to a third."""
    usual = default_factors(samples)
    longest = max(samples // LONGEST_FRACTION, 1)
    more = np.round(np.geomspace(usual[-1], longest, 8)).astype(np.int64)
    return np.unique(np.concatenate([usual, more]))


def _check_length(samples: int) -> None:
    if samples < _SHORTEST_RECORD:
        raise EstimationError(
            f"signal has {samples} samples",
            expected=f"at least {_SHORTEST_RECORD}",
            cure="record longer",
        )


def identify_curve(curve: AllanCurve, model: str | Process = "auto") -> Identification:
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
    found = estimates_of(fit.parts, fit.names, fit.log_covariance)
    return Identification(
        process=fit.process,
        standard_errors=found.errors,
        intervals=found.intervals,
        limits={**limits_of(fit, points, scatter), **found.limits},
        curve=usual_part(curve),
        diagnostics=FitDiagnostics(
            chi_square=fit.cost,
            degrees_of_freedom=points.tau.size - len(fit.names),
            discrepancy=0.5 * scatter.discrepancy,
            tau=points.tau,
            residuals=0.5 * fit.residuals,
            candidates=candidates,
            converged=fit.converged,
        ),
        slopes=slope_method(usual_part(curve)),
        verdict=judge_record(fit.process, found.errors, curve.duration),
    )


def _start(model: str | Process, points: CurvePoints) -> tuple[Process, ...] | None:
    """Return the parts of a fixed structure with sensible start values; None for a choice."""
    if model == "auto":
        return None
    parts = parts_of_model(model, points.dt, points.duration, "an Allan curve")
    if is_structure(model):
        scatter = scatter_of(rough_process(points), points)
        return from_several_starts(parts, points, scatter).parts
    return tuple(points.under(part) for part in parts)


def _fit(
    points: CurvePoints, parts: tuple[Process, ...] | None
) -> tuple[CurvePoints, StructureFit, Scatter, dict[str, float]]:
    """Fit; where that fails, leave out the fastest points, then grant a discrepancy.

    What a filter in the sensor takes from a cluster falls with its length: at the first edge at
    which nothing of it is seen it may still be as large as the errors, at the next one it is not.
    """
    edges = [1, *(e for e in _BAND_EDGES if points.slower_than(e).tau.size >= _FEWEST_POINTS)]
    first: tuple[CurvePoints, StructureFit, Scatter, dict[str, float]] | None = None
    good = None
    for edge in edges:
        slow = points.slower_than(edge)
        may_retreat = edge == 1 and len(edges) > 1
        scatter, granted = _probe(slow, parts)
        if granted > (_HOPELESS if may_retreat else 0.0) and (may_retreat or first is not None):
            continue
        granted = 0.0 if may_retreat else granted
        fit, scatter, candidates = _settle(slow, parts, scatter.with_discrepancy(granted))
        found = slow, fit, scatter, candidates
        if scatter.discrepancy == 0.0 and (edge == 1 or not _at_the_edge(fit, slow)):
            if edge == 1 or good is not None:
                return found
            good = found
        first = found if first is None and not may_retreat else first
    done = good or first
    assert done is not None
    return done


def _at_the_edge(fit: StructureFit, points: CurvePoints) -> bool:
    """Whether a correlated noise only makes good what a low-pass filter does to short clusters."""
    times = (getattr(p, "correlation_time", np.inf) for p in fit.process.parts)
    return any(time < _AT_THE_EDGE * points.tau[0] for time in times)


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
        scatter = scatter_of(scattering(fit.process), points, granted)
        fit = fit_structure(fit.parts, points, scatter)
    # the many terms of the probe need not have converged: what the chosen ones need counts
    exact = scatter.with_discrepancy(0.0)
    strict = fit_structure(fit.parts, points, exact)
    needed = _discrepancy(replace(strict, parts=fit.parts), points, exact)
    if needed != granted:
        scatter = scatter.with_discrepancy(needed)
        fit = fit_structure(fit.parts, points, scatter)
    return fit, scatter, candidates


def _discrepancy(fit: StructureFit, points: CurvePoints, scatter: Scatter) -> float:
    """Standard deviation to grant to every log variance so that chi-square is as expected."""
    from scipy.special import chdtri

    freedom = max(points.tau.size - len(fit.names), 1)
    if fit.cost <= float(chdtri(freedom, 1e-3)):
        return scatter.discrepancy
    low, high = 1e-5, 3.0
    for _ in range(12):
        middle = math.sqrt(low * high)
        again = fit_structure(fit.parts, points, scatter.with_discrepancy(middle), iterations=25)
        low, high = (middle, high) if again.cost > freedom else (low, middle)
    return math.sqrt(low * high)


def usual_part(curve: AllanCurve) -> AllanCurve:
    """The curve up to a ninth of the record, beyond which it is too ragged to show."""
    keep = curve.factors <= max(1, curve.samples // 9)
    if keep.all():
        return curve
    return replace(
        curve,
        tau=curve.tau[keep],
        deviation=curve.deviation[keep],
        lower=curve.lower[keep],
        upper=curve.upper[keep],
        degrees_of_freedom=curve.degrees_of_freedom[keep],
    )
