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

from schuler.curves.allan import AllanCurve
from schuler.curves.confidence import allan_covariance
from schuler.noise import Process, ProcessSum
from schuler.types import FloatArray

FREE: dict[str, tuple[str, ...]] = {
    "white_noise": ("density",),
    "quantization": ("step_density",),
    "gauss_markov": ("sigma", "correlation_time"),
    "random_walk": ("density",),
    "bias_instability": ("level",),
    "rate_ramp": ("slope",),
    "sinusoid": ("amplitude",),
    "turn_on_bias": (),
}
"""What a fit finds, by kind; the first is the amplitude. The rest of a process stays as given."""

_LOADING = 0.01
_STEP = 1e-4
_NOTHING = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class CurvePoints:
    """Some points of an Allan curve, ready for a fit.

    Parameters
    ----------
    tau : (t,) ndarray
        Cluster times in s.
    variance : (t,) ndarray
        Allan variances.
    factors : (t,) ndarray of int
        Samples in a cluster.
    samples : int
        Length of the record.
    dt : float
        Sample interval in s.
    degrees_of_freedom : (t,) ndarray
        Of the curve, as first weights.
    """

    tau: FloatArray
    variance: FloatArray
    factors: NDArray[np.int64]
    samples: int
    dt: float
    degrees_of_freedom: FloatArray

    @property
    def duration(self) -> float:
        """Length of the record in s."""
        return self.samples * self.dt

    def slower_than(self, factor: int) -> CurvePoints:
        """Return the points with clusters of at least `factor` samples."""
        keep = self.factors >= factor
        return CurvePoints(
            self.tau[keep],
            self.variance[keep],
            self.factors[keep],
            self.samples,
            self.dt,
            self.degrees_of_freedom[keep],
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


@dataclass(frozen=True, slots=True, eq=False)
class Scatter:
    """How the points of a curve scatter about the truth, in the logarithm of the variance.

    Parameters
    ----------
    sampling : (t, t) ndarray
        Covariance that comes from the finite record.
    bias : (t,) ndarray
        Mean of the logarithm of a chi-square over its degrees of freedom.
    discrepancy : float
        Standard deviation by which no model of this family can be better.
    whitener : (t, t) ndarray
        Lower triangular W with W (sampling + discrepancy² I) W' = I.
    """

    sampling: FloatArray
    bias: FloatArray
    discrepancy: float
    whitener: FloatArray

    @classmethod
    def of(cls, sampling: FloatArray, bias: FloatArray, discrepancy: float = 0.0) -> Scatter:
        """Make one from its covariance; parameters as above."""
        from scipy.linalg import solve_triangular

        total = sampling + discrepancy**2 * np.eye(len(sampling))
        whitener = solve_triangular(np.linalg.cholesky(total), np.eye(len(total)), lower=True)
        return cls(sampling, bias, discrepancy, np.asarray(whitener))

    def with_discrepancy(self, discrepancy: float) -> Scatter:
        """Return the same scatter with another discrepancy."""
        return Scatter.of(self.sampling, self.bias, discrepancy)


def scatter_of(process: Process, points: CurvePoints, discrepancy: float = 0.0) -> Scatter:
    """Return the scatter of the points if the signal is `process`."""
    from scipy.special import digamma, polygamma

    relative = allan_covariance(process, points.factors, points.samples, points.dt)
    half = 1.0 / np.diag(relative)
    # a chi-square with few degrees of freedom scatters more in its logarithm than 2/nu
    stretch = np.sqrt(polygamma(1, half) * half)
    sampling = relative * np.outer(stretch, stretch)
    # a little independent scatter keeps nearly equal neighbours from voting against each other
    sampling += np.diag(_LOADING * np.diag(sampling))
    return Scatter.of(sampling, np.asarray(digamma(half) - np.log(half)), discrepancy)


@dataclass(frozen=True, slots=True, eq=False)
class StructureFit:
    """The best parameters of one structure.

    Parameters
    ----------
    parts : tuple of Process
        Fitted.
    names : tuple of (int, str)
        Part and field of every free parameter.
    log_covariance : (p, p) ndarray
        Covariance of the logarithms of the free parameters.
    chi_square : float
        Whitened misfit.
    residuals : (t,) ndarray
        Logarithm of measured over modelled variance, bias of the logarithm taken off.
    converged : bool
        The iteration ended by itself.
    """

    parts: tuple[Process, ...]
    names: tuple[tuple[int, str], ...]
    log_covariance: FloatArray
    chi_square: float
    residuals: FloatArray
    converged: bool

    @property
    def process(self) -> ProcessSum:
        """The fitted sum."""
        return ProcessSum(self.parts)

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of the parts."""
        return tuple(p.kind for p in self.parts)


def free_parameters(parts: Sequence[Process]) -> tuple[tuple[int, str], ...]:
    """List part and field of everything a fit finds."""
    return tuple((k, name) for k, part in enumerate(parts) for name in FREE[part.kind])


def _with(
    parts: Sequence[Process], names: Sequence[tuple[int, str]], logs: FloatArray
) -> list[Process]:
    values: list[dict[str, float]] = [{} for _ in parts]
    for (k, name), log in zip(names, logs, strict=True):
        values[k][name] = math.exp(log)
    return [replace(p, **v) if v else p for p, v in zip(parts, values, strict=True)]  # type: ignore[type-var]


def _evaluate(
    parts: Sequence[Process], names: Sequence[tuple[int, str]], logs: FloatArray, tau: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the log model (t,) and its Jacobian (t, p)."""
    now = _with(parts, names, logs)
    components = [p.allan_variance(tau) for p in now]
    total = np.sum(components, axis=0)
    jacobian = np.empty((tau.size, len(names)))
    for j, (k, name) in enumerate(names):
        if name == FREE[now[k].kind][0]:
            jacobian[:, j] = 2.0 * components[k] / total
        else:
            moved = replace(now[k], **{name: math.exp(logs[j] + _STEP)})  # type: ignore[type-var]
            jacobian[:, j] = (moved.allan_variance(tau) - components[k]) / (_STEP * total)
    return np.log(total), jacobian


def log_jacobian(fit: StructureFit, tau: FloatArray) -> FloatArray:
    """Derivatives of the log model by the logarithms of the parameters."""
    logs = np.array([math.log(max(abs(getattr(fit.parts[k], n)), 1e-300)) for k, n in fit.names])
    return _evaluate(fit.parts, fit.names, logs, tau)[1]


def fit_structure(
    parts: Sequence[Process], points: CurvePoints, scatter: Scatter, iterations: int = 60
) -> StructureFit:
    """Minimise the whitened misfit of the log curve over the logarithms of the parameters."""
    names = free_parameters(parts)
    logs = np.array([math.log(max(abs(getattr(parts[k], n)), 1e-300)) for k, n in names])
    times = np.array([n == "correlation_time" for _, n in names], dtype=bool)
    low, high = math.log(points.tau[0]), math.log(20.0 * points.duration)
    target = np.log(points.variance) - scatter.bias
    model, jacobian = _evaluate(parts, names, logs, points.tau)
    residual = scatter.whitener @ (target - model)
    cost, damping, converged = float(residual @ residual), 1e-2, False
    for _ in range(iterations):
        slopes = scatter.whitener @ jacobian
        normal, gradient = slopes.T @ slopes, slopes.T @ residual
        scale = np.diag(np.maximum(np.diag(normal), 1e-8))
        step = np.linalg.solve(normal + damping * scale, gradient)
        trial = logs + np.clip(step, -1.5, 1.5)
        trial[times] = np.clip(trial[times], low, high)
        model_there, jacobian_there = _evaluate(parts, names, trial, points.tau)
        residual_there = scatter.whitener @ (target - model_there)
        cost_there = float(residual_there @ residual_there)
        if cost_there <= cost:
            gained = cost - cost_there
            logs, residual, cost = trial, residual_there, cost_there
            model, jacobian = model_there, jacobian_there
            damping = max(0.1 * damping, 1e-9)
            if gained < 1e-5 * (1.0 + 1e-3 * cost):
                converged = True
                break
        else:
            damping *= 10.0
            if damping > 1e10:
                converged = True
                break
    slopes = scatter.whitener @ jacobian
    information = slopes.T @ slopes
    # what the curve says nothing about keeps a finite, very large variance
    information += np.diag(np.full(len(names), _NOTHING))
    return StructureFit(
        parts=tuple(_with(parts, names, logs)),
        names=names,
        log_covariance=np.asarray(np.linalg.inv(information), dtype=np.float64),
        chi_square=cost,
        residuals=target - model,
        converged=converged,
    )
