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
from schuler.estimation.optimizer import Rules, Slopes, minimise
from schuler.estimation.parts import (
    FittedParts,
    Names,
    Terms,
    evaluate,
    free_parameters,
    log_bounds,
    logs_of,
    under,
    with_logs,
)
from schuler.noise import Process
from schuler.types import FloatArray

_NODES = 8
_WINDOWED_BINS = 16
_NOTHING = 1e-9
_RULES = Rules(gain=(1e-6, 1e-3), hold=False)


@dataclass(frozen=True, slots=True, eq=False)
class SpectrumPoints:
    """Points of a two-sided averaged density, ready for a fit."""

    frequency: FloatArray  # (b,): hz
    density: FloatArray  # (b,): Two-sided, (unit)²/Hz
    freedom: FloatArray  # (b,): degrees of freedom of every point
    weight: FloatArray  # (b,): the same less what neighbouring points share
    covariance: FloatArray  # (b, b): of the relative errors
    # cycles, share: (q,) frequencies in cycles a sample at which a model is evaluated, and their
    # weights
    cycles: FloatArray
    share: FloatArray
    group: NDArray[np.int64]  # (q,): to which point they belong
    dt: float  # sample interval in s
    duration: float  # length of the record in s

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
class SpectrumStructureFit(FittedParts):
    """The best parameters of one structure, correlation of points in their covariance.

    The cost is the deviance: twice the log likelihood short of that of a perfect fit.
    """

    ratio: FloatArray  # (b,): measured over modelled density


def scaled_under(part: Process, points: SpectrumPoints, share: float = 0.5) -> Process:
    """Give a part the amplitude at which it is nowhere above a share of the density."""

    # single points at low frequencies may be low by chance
    def smooth(values: FloatArray) -> FloatArray:
        logs = np.log(np.maximum(values, 1e-300))
        return np.convolve(np.pad(logs, 2, mode="edge"), np.full(5, 0.2), mode="valid")

    return under(
        part,
        np.exp(smooth(points.density)),
        lambda unit: np.exp(smooth(points.expected(unit))),
        share,
    )


def checked_structure(parts: Sequence[Process]) -> Names:
    """Return the free parameters of a structure that a spectrum can show."""
    for part in parts:
        if not part.random:
            raise ModelError(
                f"a spectrum does not show '{part.kind}'",
                expected="noise",
                cure="identify with method='allan', or take it off the signal first",
            )
    names = free_parameters(parts)
    if not names:
        raise ModelError("the model has no parameter that a spectrum shows")
    return names


def fit_spectrum_structure(
    parts: Sequence[Process], points: SpectrumPoints, iterations: int = 60
) -> SpectrumStructureFit:
    """Maximise the likelihood over the logarithms of the parameters by Fisher scoring."""
    names = checked_structure(parts)
    terms = Terms.of(parts, names, points.expected)

    def slopes(logs: FloatArray) -> Slopes[tuple[FloatArray, FloatArray]]:
        model, jacobian = terms.at(logs)
        model = np.maximum(model, 1e-300)
        jacobian = jacobian / model[:, None]
        ratio = points.density / model
        deviance = float(points.weight @ (ratio - 1.0 - np.log(ratio)))
        weighted = points.weight[:, None] * jacobian
        return Slopes(
            deviance, weighted.T @ (ratio - 1.0), weighted.T @ jacobian, (ratio, jacobian)
        )

    bounds = log_bounds(parts, names, points.dt, points.duration)
    rules = replace(_RULES, iterations=iterations)
    found = minimise(slopes, logs_of(parts, names), bounds, rules)
    ratio, jacobian = found.slopes.state
    half = 0.5 * points.weight[:, None] * jacobian
    information = half.T @ jacobian + np.diag(np.full(len(names), _NOTHING))
    inverse = np.linalg.inv(information)
    covariance = inverse @ (half.T @ points.covariance @ half) @ inverse
    # what the spectrum says nothing about keeps a very large variance
    covariance += _NOTHING * inverse @ inverse
    return SpectrumStructureFit(
        parts=with_logs(parts, names, found.at),
        names=names,
        log_covariance=np.asarray(covariance, dtype=np.float64),
        cost=found.value,
        converged=found.converged,
        ratio=ratio,
    )


def smallest_seen(fit: SpectrumStructureFit, index: int, points: SpectrumPoints) -> float:
    """Return the amplitude at which a term would just begin to show."""
    k, _ = fit.names[index]
    unit = fit.parts[k].with_size(1.0)
    model, jacobian = evaluate(fit.parts, fit.names, fit.logs, points.expected)
    jacobian = jacobian / model[:, None]
    root = np.sqrt(0.5 * points.weight)
    column = root * points.expected(unit) / model
    size = float(np.linalg.norm(column))
    others = [j for j, (part, _) in enumerate(fit.names) if part != k]
    known = root[:, None] * jacobian[:, others]
    left = column / size
    left = left - known @ np.linalg.lstsq(known, left, rcond=1e-10)[0]
    return 1.0 / math.sqrt(size * max(float(np.linalg.norm(left)), 1e-6))
