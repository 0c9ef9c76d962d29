"""Fit a sum of processes to the logarithm of an Allan variance curve, by generalised least squares.

Spec 2.4 (b), with the whole covariance of the points instead of weights alone: neighbouring
cluster times share their data, and standard errors that forget it are several times too small.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from schuler.curves.allan_curve import AllanCurve
from schuler.curves.confidence import allan_covariance
from schuler.estimation.optimizer import Rules, Slopes, minimise
from schuler.estimation.parts import (
    FittedParts,
    Terms,
    evaluate,
    free_parameters,
    log_bounds,
    logs_of,
    under,
    with_logs,
)
from schuler.noise import (
    BiasInstability,
    Process,
    ProcessSum,
    Quantization,
    RandomWalk,
    RateRamp,
    WhiteNoise,
)
from schuler.types import FloatArray

_LOADING = 0.01
_NOTHING = 1e-9
_ONE_SIDED = 1.645
_RULES = Rules(gain=(1e-5, 1e-3), hold=False)


@dataclass(frozen=True, slots=True, eq=False)
class CurvePoints:
    """Some points of an Allan curve, ready for a fit."""

    tau: FloatArray  # (t,): cluster times in s
    variance: FloatArray  # (t,): Allan variances
    factors: NDArray[np.int64]  # (t,): samples in a cluster
    samples: int  # length of the record
    dt: float  # sample interval in s
    degrees_of_freedom: FloatArray  # (t,): of the curve, as first weights

    @property
    def duration(self) -> float:
        """Length of the record in s."""
        return self.samples * self.dt

    def of(self, process: Process) -> FloatArray:
        """Allan variance of a process at the points."""
        return process.sampled_allan_variance(self.factors, self.dt)

    def under(self, part: Process, share: float = 0.5) -> Process:
        """Give a part a size at which it is nowhere above a share of the variance."""
        return under(part, self.variance, self.of, share)

    def slower_than(self, factor: int) -> CurvePoints:
        """Return the points with clusters of at least `factor` samples."""
        keep = self.factors >= factor
        return replace(
            self,
            tau=self.tau[keep],
            variance=self.variance[keep],
            factors=self.factors[keep],
            degrees_of_freedom=self.degrees_of_freedom[keep],
        )


def thin(curve: AllanCurve, per_decade: float) -> CurvePoints:
    """Take about `per_decade` points a decade; more of them would say the same again."""
    grid = np.round(np.log10(curve.tau / curve.tau[0]) * per_decade)
    keep = np.flatnonzero(np.diff(grid, prepend=-1.0) > 0.0)
    keep = keep[curve.deviation[keep] > 0.0]
    return CurvePoints(
        tau=curve.tau[keep],
        variance=curve.deviation[keep] ** 2,
        factors=curve.factors[keep],
        samples=curve.samples,
        dt=1.0 / curve.rate,
        degrees_of_freedom=curve.degrees_of_freedom[keep],
    )


def scattering(process: Process) -> Process:
    """What of a process scatters; white noise stands in where nothing does."""
    parts = tuple(p for p in process.components if p.random)
    return ProcessSum(parts) if parts else WhiteNoise(1.0)


@dataclass(frozen=True, slots=True, eq=False)
class Scatter:
    """How the points of a curve scatter about the truth, in the logarithm of the variance."""

    sampling: FloatArray  # (t, t): covariance that comes from the finite record
    bias: FloatArray  # (t,): mean of the logarithm of a chi-square over its degrees of freedom
    discrepancy: float  # standard deviation by which no model of this family can be better
    whitener: FloatArray  # (t, t): lower triangular W with W (sampling + discrepancy² I) W' = I

    @classmethod
    def of(cls, relative: FloatArray, loading: float = 0.0, discrepancy: float = 0.0) -> Scatter:
        """Make one from the covariance of relative errors of the variances."""
        from scipy.special import digamma, polygamma

        half = 1.0 / np.diag(relative)
        stretch = np.sqrt(polygamma(1, half) * half)
        sampling = relative * np.outer(stretch, stretch)
        sampling += np.diag(loading * np.diag(sampling))
        bias = np.asarray(digamma(half) - np.log(half))
        return cls(sampling, bias, 0.0, sampling).with_discrepancy(discrepancy)

    def with_discrepancy(self, discrepancy: float) -> Scatter:
        """Return the same scatter with another discrepancy."""
        from scipy.linalg import solve_triangular

        total = self.sampling + discrepancy**2 * np.eye(len(self.sampling))
        whitener = solve_triangular(np.linalg.cholesky(total), np.eye(len(total)), lower=True)
        return Scatter(self.sampling, self.bias, discrepancy, np.asarray(whitener))


def scatter_of(process: Process, points: CurvePoints, discrepancy: float = 0.0) -> Scatter:
    """Return the scatter of the points if the signal is `process`."""
    relative = allan_covariance(process, points.factors, points.samples, points.dt)
    return Scatter.of(relative, _LOADING, discrepancy)


@dataclass(frozen=True, slots=True, eq=False)
class StructureFit(FittedParts):
    """The best parameters of one structure, the cost being the whitened misfit."""

    # (t,): logarithm of measured over modelled variance, bias of the logarithm taken off
    residuals: FloatArray


def fit_structure(
    parts: Sequence[Process],
    points: CurvePoints,
    scatter: Scatter,
    iterations: int = 60,
    beside: FloatArray | float = 0.0,
) -> StructureFit:
    """Minimise the whitened misfit of the log curve over the logarithms of the parameters.

    `beside` is a variance at every point that is there as well and is not fitted.
    """
    names = free_parameters(parts)
    terms = Terms.of(parts, names, points.of)
    target = np.log(points.variance) - scatter.bias

    def slopes(logs: FloatArray) -> Slopes[FloatArray]:
        total, jacobian = terms.at(logs)
        total = total + beside
        residual = target - np.log(total)
        white = scatter.whitener @ residual
        columns = scatter.whitener @ (jacobian / total[:, None])
        return Slopes(float(white @ white), columns.T @ white, columns.T @ columns, residual)

    bounds = log_bounds(parts, names, float(points.tau[0]), points.duration)
    rules = replace(_RULES, iterations=iterations)
    found = minimise(slopes, logs_of(parts, names), bounds, rules)
    # what the curve says nothing about keeps a finite, very large variance
    information = found.slopes.curvature + np.diag(np.full(len(names), _NOTHING))
    return StructureFit(
        parts=with_logs(parts, names, found.at),
        names=names,
        log_covariance=np.asarray(np.linalg.inv(information), dtype=np.float64),
        cost=found.value,
        converged=found.converged,
        residuals=found.slopes.state,
    )


def limits_of(fit: FittedParts, points: CurvePoints, scatter: Scatter) -> dict[str, float]:
    """95 % upper limits of the terms that are not in a model, all others being free."""
    model, jacobian = evaluate(fit.parts, fit.names, fit.logs, points.of)
    known = scatter.whitener @ (jacobian / model[:, None])
    residual = scatter.whitener @ (np.log(points.variance) - scatter.bias - np.log(model))
    limits: dict[str, float] = {}
    flicker = BiasInstability.of_samples(1.0, points.dt, points.duration)
    for term in (RandomWalk(1.0), Quantization(1.0), RateRamp(1.0), flicker):
        if term.kind in fit.kinds:
            continue
        # linear in the square of the amplitude, which may come out on either side of zero
        column = scatter.whitener @ (points.of(term) / model)
        free = column - known @ np.linalg.lstsq(known, column, rcond=1e-10)[0]
        information = float(free @ free)
        if information <= 0.0:
            continue
        square = max(float(free @ residual) / information, 0.0)
        limit = math.sqrt(square + _ONE_SIDED / math.sqrt(information))
        if "gauss_markov" in fit.kinds and term.kind in ("random_walk", flicker.kind):
            limit = _profiled(fit, points, scatter, points.of(term), limit)
        limits[f"{term.kind}.{term.size_name()}"] = limit
    return limits


def _profiled(
    fit: FittedParts, points: CurvePoints, scatter: Scatter, unit: FloatArray, first: float
) -> float:
    """Size from `first` on at which the misfit has risen by 95 %, all other parameters following.

    A Gauss-Markov noise gives way to a walk further than its slopes at the best fit let one see.
    """
    best = fit_structure(fit.parts, points, scatter, 30)

    def refused(size: float) -> bool:
        again = fit_structure(best.parts, points, scatter, 30, size**2 * unit)
        return again.cost - best.cost > _ONE_SIDED**2

    low = high = first
    for _ in range(10):
        if refused(high):
            break
        low, high = high, 1.5 * high
    if low == high:
        return first
    for _ in range(4):
        middle = math.sqrt(low * high)
        low, high = (low, middle) if refused(middle) else (middle, high)
    return high
