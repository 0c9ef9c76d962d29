"""Generalised method of wavelet moments: the fit of processes to one or several curves.

Minimises sum over curves of (nu_hat - nu(theta))' Omega (nu_hat - nu(theta)) over the logarithms
of the parameters, Omega the inverse covariance of nu_hat under the model itself, computed again
at the estimate until it stands (Guerrier, Skaloud, Stebler, Victoria-Feser 2013, JASA 108:1021;
spec 10).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from schuler.curves.wavelet_variance import WaveletVarianceCurve
from schuler.estimation.curve_fit import FREE, free_parameters
from schuler.estimation.gmwm.scatter import misfit, relative_covariance
from schuler.noise import Process, ProcessSum
from schuler.types import FloatArray

Names = tuple[tuple[int, str], ...]

_STEP = 1e-4
_NOTHING = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class MomentFit:
    """The parameters of one structure by wavelet moments.

    Parameters
    ----------
    parts : tuple of Process
        Fitted.
    names : tuple of (int, str)
        Part and field of every free parameter.
    log_covariance : (p, p) ndarray
        Sandwich covariance of the logarithms of the parameters.
    chi_square : float
        J, the whitened misfit, of cube roots (nearly normal at every scale).
    degrees_of_freedom : int
        Scales of all curves less parameters.
    wvic : float
        J plus twice the optimism tr(Omega cov(nu_hat, nu(theta_hat))): 2 p where Omega is the
        inverse covariance.
    converged : bool
        Every minimisation ended by itself and the weights stood.
    """

    parts: tuple[Process, ...]
    names: Names
    log_covariance: FloatArray
    chi_square: float
    degrees_of_freedom: int
    wvic: float
    converged: bool

    @property
    def process(self) -> ProcessSum:
        """The fitted sum."""
        return ProcessSum(self.parts)

    @property
    def logs(self) -> FloatArray:
        """Logarithms of the free parameters."""
        return _logs(self.parts, self.names)


def _logs(parts: Sequence[Process], names: Names) -> FloatArray:
    return np.array([math.log(max(abs(getattr(parts[k], n)), 1e-300)) for k, n in names])


def with_logs(parts: Sequence[Process], names: Names, logs: FloatArray) -> tuple[Process, ...]:
    """Return the parts with other values of their free parameters."""
    values: list[dict[str, float]] = [{} for _ in parts]
    for (k, name), log in zip(names, logs, strict=True):
        values[k][name] = math.exp(log)
    return tuple(
        replace(p, **v) if v else p  # type: ignore[type-var]
        for p, v in zip(parts, values, strict=True)
    )


def _moments(
    parts: Sequence[Process], names: Names, logs: FloatArray, scale: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Wavelet variance (t,) of the model and its derivatives (t, p) by the logarithms."""
    now = with_logs(parts, names, logs)
    components = [p.wavelet_variance(scale) for p in now]
    jacobian = np.empty((scale.size, len(names)))
    for j, (k, name) in enumerate(names):
        if name == FREE[now[k].kind][0]:
            jacobian[:, j] = 2.0 * components[k]
        else:
            moved = replace(now[k], **{name: math.exp(logs[j] + _STEP)})  # type: ignore[type-var]
            jacobian[:, j] = (moved.wavelet_variance(scale) - components[k]) / _STEP
    return np.asarray(np.sum(components, axis=0)), jacobian


def _weights(
    curves: Sequence[WaveletVarianceCurve], process: Process, discrepancy: float
) -> list[_Weighted]:
    """Weights of all curves; plain curves of one length share theirs."""
    known: dict[tuple[int, int, float, str], _Weighted] = {}
    out = []
    for curve in curves:
        key = (curve.samples, curve.scale.size, float(curve.scale[0]), curve.robust)
        if key in known and curve.robust != "samples":
            out.append(replace(known[key], variance=curve.variance))
            continue
        known[key] = _Weighted.of(curve, process, discrepancy)
        out.append(known[key])
    return out


@dataclass(frozen=True, slots=True, eq=False)
class _Weighted:
    """One curve with the weights of one step."""

    scale: FloatArray
    variance: FloatArray
    reference: FloatArray
    whitener: FloatArray

    @classmethod
    def of(cls, curve: WaveletVarianceCurve, process: Process, discrepancy: float) -> _Weighted:
        from scipy.linalg import solve_triangular

        total = relative_covariance(process, curve)
        total += discrepancy**2 * np.eye(len(total))
        lower = np.linalg.cholesky(total)
        whitener = np.asarray(solve_triangular(lower, np.eye(len(total)), lower=True))
        reference = process.wavelet_variance(curve.scale)
        return cls(curve.scale, curve.variance, reference, whitener)

    def misfit(self) -> float:
        """Misfit of the curve from the reference."""
        covariance = np.linalg.inv(self.whitener.T @ self.whitener)
        return misfit(self.variance, self.reference, np.asarray(covariance, dtype=np.float64))

    def residual(
        self, parts: Sequence[Process], names: Names, logs: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Whitened misfit (t,) and derivatives of the whitened model (t, p)."""
        model, jacobian = _moments(parts, names, logs, self.scale)
        relative = (self.variance - model) / self.reference
        return self.whitener @ relative, self.whitener @ (jacobian / self.reference[:, None])


def _stacked(
    weighted: Sequence[_Weighted], parts: Sequence[Process], names: Names, logs: FloatArray
) -> tuple[FloatArray, FloatArray]:
    pairs = [w.residual(parts, names, logs) for w in weighted]
    return np.concatenate([r for r, _ in pairs]), np.concatenate([j for _, j in pairs])


def _minimise(
    parts: Sequence[Process],
    names: Names,
    logs: FloatArray,
    weighted: Sequence[_Weighted],
    bounds: tuple[float, float],
) -> tuple[FloatArray, bool]:
    """Levenberg-Marquardt with fixed weights; correlation times stay within bounds."""
    times = np.array([n == "correlation_time" for _, n in names], dtype=bool)
    residual, slopes = _stacked(weighted, parts, names, logs)
    cost, damping = float(residual @ residual), 1e-3
    for _ in range(60):
        gradient = slopes.T @ residual
        # a time that stands at its bound and wants beyond it is held there
        held = times & (
            ((logs <= bounds[0]) & (gradient < 0.0)) | ((logs >= bounds[1]) & (gradient > 0.0))
        )
        active = slopes[:, ~held]
        normal = active.T @ active
        scale = np.diag(np.maximum(np.diag(normal), 1e-8))
        trial = logs.copy()
        step = np.linalg.solve(normal + damping * scale, gradient[~held])
        trial[~held] += np.clip(step, -1.0, 1.0)
        trial[times] = np.clip(trial[times], *bounds)
        residual_there, slopes_there = _stacked(weighted, parts, names, trial)
        cost_there = float(residual_there @ residual_there)
        if cost_there <= cost:
            gained = cost - cost_there
            logs, residual, slopes, cost = trial, residual_there, slopes_there, cost_there
            damping = max(0.1 * damping, 1e-9)
            if gained < 1e-7 * (1.0 + cost):
                return logs, True
        else:
            damping *= 10.0
            if damping > 1e10:
                return logs, True
    return logs, False


def _bounds(curves: Sequence[WaveletVarianceCurve]) -> tuple[float, float]:
    """Logarithms between which correlation times stay."""
    return (
        math.log(min(c.scale[0] for c in curves)),
        math.log(20.0 * max(c.duration for c in curves)),
    )


def heterogeneity(
    fit: MomentFit, curves: Sequence[WaveletVarianceCurve], discrepancy: float = 0.0
) -> tuple[float, int]:
    """Test what the common parameters of several records cost beside separate ones."""
    weighted = _weights(curves, fit.process, discrepancy)
    bounds = _bounds(curves)
    common, _ = _minimise(fit.parts, fit.names, fit.logs, weighted, bounds)
    residual, slopes = _stacked(weighted, fit.parts, fit.names, common)
    apart = 0.0
    for one in weighted:
        logs, _ = _minimise(fit.parts, fit.names, common, [one], bounds)
        own = one.residual(fit.parts, fit.names, logs)[0]
        apart += float(own @ own)
    seen = int(np.count_nonzero(np.sum(slopes**2, axis=0) > 1e-2))
    return max(float(residual @ residual) - apart, 0.0), (len(curves) - 1) * seen


def fit_moments(
    parts: Sequence[Process],
    curves: Sequence[WaveletVarianceCurve],
    discrepancy: float = 0.0,
    steps: int = 15,
) -> MomentFit:
    """Fit a structure to the wavelet variances of one or several records."""
    names = free_parameters(parts)
    logs, standing = _logs(parts, names), False
    bounds = _bounds(curves)
    ended, reference = True, logs
    for step in range(steps):
        # half way once the weights should stand: they may swing about where they belong
        reference = logs if step < 3 else 0.5 * (reference + logs)
        fitted = with_logs(parts, names, reference)
        weighted = _weights(curves, ProcessSum(fitted), discrepancy)
        before = logs
        logs, ended = _minimise(parts, names, logs, weighted, bounds)
        # a parameter that has vanished may go on sinking
        seen = np.sum(_stacked(weighted, parts, names, logs)[1] ** 2, axis=0) > 1e-2
        moved = np.abs(logs - before)[seen]
        standing = step > 0 and (moved.size == 0 or float(np.max(moved)) < 1e-3)
        if standing:
            break
    fitted = with_logs(parts, names, logs)
    slopes = _stacked(weighted, parts, names, logs)[1]
    final = _weights(curves, ProcessSum(fitted), discrepancy)
    bread = np.linalg.inv(slopes.T @ slopes + np.diag(np.full(len(names), _NOTHING)))
    meat, optimism, row = np.zeros((len(names), len(names))), 0.0, 0
    for used, now in zip(weighted, final, strict=True):
        part = slopes[row : row + used.scale.size]
        row += used.scale.size
        # covariance under the final model, seen through the weights that were used
        ratio = (now.reference / used.reference)[:, None] * np.linalg.inv(now.whitener)
        root = part.T @ (used.whitener @ ratio)
        meat += root @ root.T
    sandwich = bread @ meat @ bread
    optimism = float(np.trace(bread @ meat))
    chi_square = math.fsum(w.misfit() for w in final)
    return MomentFit(
        parts=fitted,
        names=names,
        # what the curve says nothing about keeps a very large variance
        log_covariance=sandwich + np.diag(np.where(np.diag(bread) > 1e6, 1e6, 0.0)),
        chi_square=chi_square,
        degrees_of_freedom=row - len(names),
        wvic=chi_square + 2.0 * optimism,
        converged=ended and standing,
    )
