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
from schuler.estimation.gmwm.scatter import misfit, relative_covariance
from schuler.estimation.optimizer import Rules, Slopes, minimise
from schuler.estimation.parts import (
    FittedParts,
    Names,
    Terms,
    free_parameters,
    log_bounds,
    logs_of,
    with_logs,
)
from schuler.noise import Process, ProcessSum
from schuler.types import FloatArray

_NOTHING = 1e-9
_RULES = Rules(damping=1e-3, longest=1.0, gain=(1e-7, 1.0))


@dataclass(frozen=True, slots=True, eq=False)
class MomentFit(FittedParts):
    """The parameters of one structure by wavelet moments.

    The cost is J, the whitened misfit, of cube roots (nearly normal at every scale); the
    covariance is the sandwich; it has converged where every minimisation ended by itself and the
    weights stood.
    """

    degrees_of_freedom: int  # scales of all curves less parameters
    # J plus twice the optimism tr(Omega cov(nu_hat, nu(theta_hat))): 2 p where Omega is the inverse
    # covariance
    wvic: float


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

    curve: WaveletVarianceCurve
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
        return cls(curve, curve.variance, curve.of(process), whitener)

    def misfit(self) -> float:
        """Misfit of the curve from the reference."""
        covariance = np.linalg.inv(self.whitener.T @ self.whitener)
        return misfit(self.variance, self.reference, np.asarray(covariance, dtype=np.float64))

    def residual(self, terms: Terms, logs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Whitened misfit (t,) and derivatives of the whitened model (t, p)."""
        model, jacobian = terms.at(logs)
        relative = (self.variance - model) / self.reference
        return self.whitener @ relative, self.whitener @ (jacobian / self.reference[:, None])


def _stacked(
    weighted: Sequence[_Weighted], drawn: Sequence[Terms], logs: FloatArray
) -> tuple[FloatArray, FloatArray]:
    pairs = [w.residual(t, logs) for w, t in zip(weighted, drawn, strict=True)]
    return np.concatenate([r for r, _ in pairs]), np.concatenate([j for _, j in pairs])


def _minimise(
    drawn: Sequence[Terms],
    logs: FloatArray,
    weighted: Sequence[_Weighted],
    bounds: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, bool]:
    """Minimise with fixed weights."""

    def slopes(at: FloatArray) -> Slopes[None]:
        residual, columns = _stacked(weighted, drawn, at)
        return Slopes(float(residual @ residual), columns.T @ residual, columns.T @ columns, None)

    found = minimise(slopes, logs, bounds, _RULES)
    return found.at, found.converged


def _bounds(
    parts: Sequence[Process], names: Names, curves: Sequence[WaveletVarianceCurve]
) -> tuple[FloatArray, FloatArray]:
    """Bounds of the logarithms."""
    shortest = float(min(c.scale[0] for c in curves))
    return log_bounds(parts, names, shortest, max(c.duration for c in curves))


def heterogeneity(
    fit: MomentFit, curves: Sequence[WaveletVarianceCurve], discrepancy: float = 0.0
) -> tuple[float, int]:
    """Test what the common parameters of several records cost beside separate ones."""
    weighted = _weights(curves, fit.process, discrepancy)
    bounds = _bounds(fit.parts, fit.names, curves)
    drawn = [Terms.of(fit.parts, fit.names, w.curve.of) for w in weighted]
    common, _ = _minimise(drawn, fit.logs, weighted, bounds)
    residual, slopes = _stacked(weighted, drawn, common)
    apart = 0.0
    for one, terms in zip(weighted, drawn, strict=True):
        logs, _ = _minimise([terms], common, [one], bounds)
        own = one.residual(terms, logs)[0]
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
    logs, standing = logs_of(parts, names), False
    bounds = _bounds(parts, names, curves)
    drawn = [Terms.of(parts, names, c.of) for c in curves]
    ended, reference = True, logs
    for step in range(steps):
        # half way once the weights should stand: they may swing about where they belong
        reference = logs if step < 3 else 0.5 * (reference + logs)
        fitted = with_logs(parts, names, reference)
        weighted = _weights(curves, ProcessSum(fitted), discrepancy)
        before = logs
        logs, ended = _minimise(drawn, logs, weighted, bounds)
        # a parameter that has vanished may go on sinking
        seen = np.sum(_stacked(weighted, drawn, logs)[1] ** 2, axis=0) > 1e-2
        moved = np.abs(logs - before)[seen]
        standing = step > 0 and (moved.size == 0 or float(np.max(moved)) < 1e-3)
        if standing:
            break
    fitted = with_logs(parts, names, logs)
    slopes = _stacked(weighted, drawn, logs)[1]
    final = _weights(curves, ProcessSum(fitted), discrepancy)
    bread = np.linalg.inv(slopes.T @ slopes + np.diag(np.full(len(names), _NOTHING)))
    meat, optimism, row = np.zeros((len(names), len(names))), 0.0, 0
    for used, now in zip(weighted, final, strict=True):
        part = slopes[row : row + used.variance.size]
        row += used.variance.size
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
        cost=chi_square,
        degrees_of_freedom=row - len(names),
        wvic=chi_square + 2.0 * optimism,
        converged=ended and standing,
    )
