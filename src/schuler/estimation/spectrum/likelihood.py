"""Fit a sum of processes to an averaged power spectral density by the gamma likelihood.

Every averaged point is chi-square about the spectrum of the samples as Welch's method sees it
(aliasing included, the Hann window included where the spectrum is steep): Whittle's likelihood
for averaged periodograms.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from schuler.curves.spectrum import SpectrumCurve, group_covariance
from schuler.errors import ModelError
from schuler.estimation.curve_fit import FREE, free_parameters
from schuler.noise import Process, ProcessSum
from schuler.types import FloatArray

_LINES = ("rate_ramp", "sinusoid", "turn_on_bias")
_NODES = 8
_WINDOWED_BINS = 16
_STEP = 1e-4
_NOTHING = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class SpectrumPoints:
    """Points of a two-sided averaged density, ready for a fit.

    Parameters
    ----------
    frequency : (b,) ndarray
        Hz.
    density : (b,) ndarray
        Two-sided, (unit)²/Hz.
    freedom : (b,) ndarray
        Degrees of freedom of every point.
    weight : (b,) ndarray
        The same less what neighbouring points share.
    covariance : (b, b) ndarray
        Of the relative errors.
    cycles, share : (q,) ndarray
        Frequencies in cycles a sample at which a model is evaluated, and their weights.
    group : (q,) ndarray of int
        To which point they belong.
    dt : float
        Sample interval in s.
    duration : float
        Length of the record in s.
    """

    frequency: FloatArray
    density: FloatArray
    freedom: FloatArray
    weight: FloatArray
    covariance: FloatArray
    cycles: FloatArray
    share: FloatArray
    group: NDArray[np.int64]
    dt: float
    duration: float

    def below(self, highest: float) -> SpectrumPoints:
        """Return the points below a frequency in Hz."""
        keep = self.frequency <= highest
        nodes = keep[self.group]
        place = np.cumsum(keep) - 1
        covariance = self.covariance[np.ix_(keep, keep)]
        return replace(
            self,
            frequency=self.frequency[keep],
            density=self.density[keep],
            freedom=self.freedom[keep],
            weight=_weights(covariance),
            covariance=covariance,
            cycles=self.cycles[nodes],
            share=self.share[nodes],
            group=place[self.group[nodes]],
        )

    def with_discrepancy(self, discrepancy: float) -> SpectrumPoints:
        """Return the same points, none of them surer than a relative standard deviation."""
        covariance = self.covariance + discrepancy**2 * np.eye(self.frequency.size)
        return replace(
            self,
            freedom=2.0 / np.diag(covariance),
            weight=_weights(covariance),
            covariance=covariance,
        )

    def expected(self, part: Process) -> FloatArray:
        """Return what a process puts into every point on average."""
        values = part.sampled_psd(self.cycles, self.dt) * self.dt
        size = self.frequency.size
        return np.asarray(np.bincount(self.group, self.share * values, minlength=size))


def _weights(covariance: FloatArray) -> FloatArray:
    """Degrees of freedom of every point less what it shares with its neighbours."""
    return np.asarray(2.0 / np.sum(covariance, axis=1))


def spectrum_points(
    curve: SpectrumCurve, band: tuple[float, float] | None = None
) -> SpectrumPoints:
    """Prepare an averaged density for a fit."""
    low, high = band if band is not None else (0.0, math.inf)
    keep = (curve.frequency >= low) & (curve.frequency <= high) & (curve.density > 0.0)
    cycles: list[FloatArray] = []
    share: list[FloatArray] = []
    group: list[NDArray[np.int64]] = []
    for k, index in enumerate(np.flatnonzero(keep)):
        first, count = int(curve.first[index]), int(curve.count[index])
        bins = first + (np.arange(min(count, _NODES)) + 0.5) * (count / min(count, _NODES)) - 0.5
        weight = np.full(bins.size, 1.0 / bins.size)
        if first < _WINDOWED_BINS:
            # the Hann window spreads a bin over its neighbours: 1/6, 2/3, 1/6
            bins = np.concatenate([bins - 1.0, bins, bins + 1.0])
            weight = np.concatenate([weight / 6.0, weight / 1.5, weight / 6.0])
        cycles.append(np.minimum(bins / curve.segment, 0.5))
        share.append(weight)
        group.append(np.full(bins.size, k))
    covariance = group_covariance(curve)[np.ix_(keep, keep)]
    return SpectrumPoints(
        frequency=curve.frequency[keep],
        density=curve.two_sided[keep],
        freedom=curve.degrees_of_freedom[keep],
        weight=_weights(covariance),
        covariance=covariance,
        cycles=np.concatenate([np.zeros(0), *cycles]),
        share=np.concatenate([np.zeros(0), *share]),
        group=np.concatenate([np.zeros(0, dtype=np.int64), *group]),
        dt=1.0 / curve.rate,
        duration=curve.duration,
    )


@dataclass(frozen=True, slots=True, eq=False)
class SpectrumStructureFit:
    """The best parameters of one structure.

    Parameters
    ----------
    parts : tuple of Process
        Fitted.
    names : tuple of (int, str)
        Part and field of every free parameter.
    log_covariance : (p, p) ndarray
        Covariance of the logarithms of the free parameters, correlation of points included.
    deviance : float
        Twice the log likelihood short of that of a perfect fit.
    ratio : (b,) ndarray
        Measured over modelled density.
    converged : bool
        The iteration ended by itself.
    """

    parts: tuple[Process, ...]
    names: tuple[tuple[int, str], ...]
    log_covariance: FloatArray
    deviance: float
    ratio: FloatArray
    converged: bool

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of the parts."""
        return tuple(p.kind for p in self.parts)

    @property
    def process(self) -> ProcessSum:
        """The fitted sum."""
        return ProcessSum(self.parts)


def scaled_under(part: Process, points: SpectrumPoints, share: float = 0.5) -> Process:
    """Give a part the amplitude at which it is nowhere above a share of the density."""
    amplitude = FREE[part.kind][0]
    unit = replace(part, **{amplitude: 1.0})  # type: ignore[type-var]
    shape = np.maximum(points.expected(unit), 1e-300)
    # single points at low frequencies may be low by chance
    logs = np.log(points.density / shape)
    smooth = np.convolve(np.pad(logs, 2, mode="edge"), np.full(5, 0.2), mode="valid")
    size = math.sqrt(share) * math.exp(0.5 * float(np.min(smooth)))
    return replace(part, **{amplitude: size})  # type: ignore[type-var]


def checked_structure(parts: Sequence[Process]) -> tuple[tuple[int, str], ...]:
    """Return the free parameters of a structure that a spectrum can show."""
    for part in parts:
        if part.kind in _LINES:
            raise ModelError(
                f"a spectrum does not show '{part.kind}'",
                expected="noise",
                cure="identify with method='allan', or take it off the signal first",
            )
        if part.kind not in FREE:
            raise ModelError(f"'{part.kind}' is not fitted to a spectrum", expected=", ".join(FREE))
    names = free_parameters(parts)
    if not names:
        raise ModelError("the model has no parameter that a spectrum shows")
    return names


def _with(
    parts: Sequence[Process], names: Sequence[tuple[int, str]], logs: FloatArray
) -> list[Process]:
    out = list(parts)
    for (k, name), log in zip(names, logs, strict=True):
        out[k] = replace(out[k], **{name: math.exp(log)})  # type: ignore[type-var]
    return out


def _evaluate(
    parts: Sequence[Process],
    names: Sequence[tuple[int, str]],
    logs: FloatArray,
    points: SpectrumPoints,
) -> tuple[FloatArray, FloatArray]:
    """Return the model (b,) and the Jacobian of its logarithm (b, p)."""
    now = _with(parts, names, logs)
    components = [points.expected(p) for p in now]
    total = np.maximum(np.sum(components, axis=0), 1e-300)
    jacobian = np.empty((total.size, len(names)))
    for j, (k, name) in enumerate(names):
        if name == FREE[now[k].kind][0]:
            jacobian[:, j] = 2.0 * components[k] / total
        else:
            moved = replace(now[k], **{name: math.exp(logs[j] + _STEP)})  # type: ignore[type-var]
            jacobian[:, j] = (points.expected(moved) - components[k]) / (_STEP * total)
    return total, jacobian


def fit_spectrum_structure(
    parts: Sequence[Process], points: SpectrumPoints, iterations: int = 60
) -> SpectrumStructureFit:
    """Maximise the likelihood over the logarithms of the parameters by Fisher scoring."""
    names = checked_structure(parts)
    logs = np.array([math.log(max(abs(getattr(parts[k], n)), 1e-300)) for k, n in names])
    times = np.array([n == "correlation_time" for _, n in names], dtype=bool)
    low, high = math.log(points.dt), math.log(20.0 * points.duration)

    def deviance(model: FloatArray) -> float:
        ratio = points.density / model
        return float(points.weight @ (ratio - 1.0 - np.log(ratio)))

    model, jacobian = _evaluate(parts, names, logs, points)
    cost, damping, converged = deviance(model), 1e-2, False
    for _ in range(iterations):
        weighted = points.weight[:, None] * jacobian
        normal = weighted.T @ jacobian
        gradient = weighted.T @ (points.density / model - 1.0)
        scale = np.diag(np.maximum(np.diag(normal), 1e-8))
        trial = logs + np.clip(np.linalg.solve(normal + damping * scale, gradient), -1.5, 1.5)
        trial[times] = np.clip(trial[times], low, high)
        model_there, jacobian_there = _evaluate(parts, names, trial, points)
        there = deviance(model_there)
        if there <= cost:
            gained, cost, logs = cost - there, there, trial
            model, jacobian = model_there, jacobian_there
            damping = max(0.1 * damping, 1e-9)
            if gained < 1e-6 * (1.0 + 1e-3 * cost):
                converged = True
                break
        else:
            damping *= 10.0
            if damping > 1e10:
                converged = True
                break
    half = 0.5 * points.weight[:, None] * jacobian
    information = half.T @ jacobian + np.diag(np.full(len(names), _NOTHING))
    inverse = np.linalg.inv(information)
    covariance = inverse @ (half.T @ points.covariance @ half) @ inverse
    # what the spectrum says nothing about keeps a very large variance
    covariance += _NOTHING * inverse @ inverse
    return SpectrumStructureFit(
        parts=tuple(_with(parts, names, logs)),
        names=names,
        log_covariance=np.asarray(covariance, dtype=np.float64),
        deviance=cost,
        ratio=points.density / model,
        converged=converged,
    )


def smallest_seen(fit: SpectrumStructureFit, index: int, points: SpectrumPoints) -> float:
    """Return the amplitude at which a term would just begin to show."""
    k, name = fit.names[index]
    unit = replace(fit.parts[k], **{name: 1.0})  # type: ignore[type-var]
    logs = np.array([math.log(max(abs(getattr(fit.parts[i], n)), 1e-300)) for i, n in fit.names])
    model, jacobian = _evaluate(fit.parts, fit.names, logs, points)
    root = np.sqrt(0.5 * points.weight)
    column = root * points.expected(unit) / model
    size = float(np.linalg.norm(column))
    others = [j for j, (part, _) in enumerate(fit.names) if part != k]
    known = root[:, None] * jacobian[:, others]
    left = column / size
    left = left - known @ np.linalg.lstsq(known, left, rcond=1e-10)[0]
    return 1.0 / math.sqrt(size * max(float(np.linalg.norm(left)), 1e-6))
