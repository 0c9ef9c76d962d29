"""Which processes a signal is made of: terms are added, exchanged and removed one at a time."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Generic, Protocol, TypeVar

import numpy as np

from schuler.estimation.curve_fit import CurvePoints, Scatter, StructureFit, fit_structure
from schuler.estimation.parts import FittedParts
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
from schuler.types import FloatArray

_MOST_GAUSS_MARKOVS = 3
_VISIBLE = 0.02
_GAUSS_MARKOVS_PER_DECADE = 1.0
_SLOW = ("gauss_markov", "random_walk", "rate_ramp", "bias_instability")

Found = TypeVar("Found", bound=FittedParts)
Found_co = TypeVar("Found_co", bound=FittedParts, covariant=True)


class Fitter(Protocol[Found_co]):
    """Fits parts to a curve, in so many iterations at most."""

    def __call__(self, parts: Sequence[Process], iterations: int = 60) -> Found_co:
        """Return the best parameters."""
        ...


@dataclass(frozen=True, slots=True)
class Choice(Generic[Found]):
    """A choice among structures of one curve."""

    fit: Fitter[Found]  # fits a structure
    start: Callable[[Process], Process]  # gives a process of unit size one below the curve
    singles: tuple[Process, ...]  # terms that occur once at most, of unit size, white noise last
    times: FloatArray  # (k,): correlation times from which Gauss-Markov noises start

    def run(self) -> tuple[Found, dict[str, float]]:
        """Find the sum of processes with the smallest criterion, and what else was tried."""
        best = self.fit([self.start(self.singles[-1])])
        tried = {name_of(best): criterion(best)}
        for _ in range(8):
            grown = min(self._additions(best.parts), key=criterion)
            tried[name_of(grown)] = criterion(grown)
            if criterion(grown) < criterion(best):
                best = grown
                continue
            other = min(self._exchanges(best), key=criterion, default=best)
            tried[name_of(other)] = criterion(other)
            if criterion(other) >= criterion(best) - 1e-3:
                break
            best = other
        return self.fit(sorted(best.parts, key=_order)), tried

    def _additions(self, parts: Sequence[Process]) -> list[Found]:
        kinds = [p.kind for p in parts]
        fits = [self.fit([*parts, self.start(s)]) for s in self.singles if s.kind not in kinds]
        if kinds.count("gauss_markov") < _MOST_GAUSS_MARKOVS:
            fits.append(self._with_gauss_markov(parts))
        return fits

    def _with_gauss_markov(self, parts: Sequence[Process]) -> Found:
        """Fit `parts` and one more Gauss-Markov noise, from the two best of a few starts."""
        noises = [self.start(GaussMarkov(1.0, float(t))) for t in self.times]
        tries = [self.fit([*parts, noise], iterations=4) for noise in noises]
        tries.sort(key=lambda f: f.cost)
        return min((self.fit(f.parts) for f in tries[:2]), key=criterion)

    def _exchanges(self, best: Found) -> list[Found]:
        """Every simpler structure, and slow terms exchanged for other kinds of slow terms."""
        fits = []
        for k, kind in enumerate(best.kinds):
            rest = [*best.parts[:k], *best.parts[k + 1 :]]
            if rest:
                fits.append(self.fit(rest))
            if kind not in _SLOW:
                continue
            if kind != "random_walk" and "random_walk" not in best.kinds:
                fits.append(self.fit([*rest, self.start(RandomWalk(1.0))]))
            if kind != "gauss_markov" and best.kinds.count("gauss_markov") < _MOST_GAUSS_MARKOVS:
                fits.append(self._with_gauss_markov(rest))
        return fits + self._exchanges_of_flicker(best)

    def _exchanges_of_flicker(self, best: Found) -> list[Found]:
        """Flicker for one to three slow terms, or two slow terms for flicker."""
        flicker = next((s for s in self.singles if s.kind == "bias_instability"), None)
        if flicker is None:
            return []
        if flicker.kind not in best.kinds:
            slow = [k for k, kind in enumerate(best.kinds) if kind in _SLOW]
            return [
                self.fit([p for k, p in enumerate(best.parts) if k not in gone]
                         + [self.start(flicker)])
                for count in (1, 2, 3)
                for gone in combinations(slow, count)
            ]  # fmt: skip
        rest = [p for p in best.parts if p.kind != flicker.kind]
        if [p.kind for p in rest].count("gauss_markov") > _MOST_GAUSS_MARKOVS - 2 or not rest:
            return []
        one = self._with_gauss_markov(rest)
        fits = [one, self._with_gauss_markov(one.parts)]
        if "random_walk" not in best.kinds:
            fits.append(self.fit([*one.parts, self.start(RandomWalk(1.0))]))
        return fits


def criterion(fit: FittedParts) -> float:
    """Misfit plus the penalties of all terms: the smaller, the better."""
    return fit.cost + math.fsum(p.penalty for p in fit.parts)


def _order(part: Process) -> tuple[float, float]:
    time = part.correlation_time if isinstance(part, GaussMarkov) else 0.0
    return part.rank, time


def name_of(fit: FittedParts) -> str:
    """Name of a structure."""
    return " + ".join(p.kind for p in sorted(fit.parts, key=_order))


def rough_process(points: CurvePoints) -> ProcessSum:
    """Describe a curve by many terms at once, only to learn how its points scatter."""
    tau = points.tau
    decades = math.log10(tau[-1] / tau[0])
    times = np.geomspace(2.0 * tau[0], max(tau[-1], 2.0 * tau[0]), max(2, round(decades) + 1))
    parts: list[Process] = [WhiteNoise(1.0), Quantization(1.0), RandomWalk(1.0)]
    parts += [GaussMarkov(1.0, float(t)) for t in times]
    weight = np.sqrt(points.degrees_of_freedom)
    shapes = np.array([points.of(p) for p in parts]).T
    design = shapes / points.variance[:, None] * weight[:, None]
    norms = np.linalg.norm(design, axis=0)
    design /= norms
    wanted, normal = design.T @ weight, design.T @ design
    size = np.full(len(parts), wanted.max() / len(parts))
    for _ in range(400):
        size *= wanted / (normal @ size)
    amplitude = np.sqrt(size / norms)
    shares = shapes * (size / norms) / (shapes @ (size / norms))[:, None]
    return ProcessSum(
        tuple(
            part.with_size(float(a))
            for part, a, share in zip(parts, amplitude, shares.T, strict=True)
            if share.max() > _VISIBLE
        )
    )


def select_structure(
    points: CurvePoints, scatter: Scatter
) -> tuple[StructureFit, dict[str, float]]:
    """Find the sum of processes with the smallest criterion."""

    def fit(parts: Sequence[Process], iterations: int = 60) -> StructureFit:
        return fit_structure(parts, points, scatter, iterations)

    first, last = (
        math.log10(3.0 * points.tau[0]),
        math.log10(max(points.tau[-1], 3.1 * points.tau[0])),
    )
    count = max(2, round((last - first) * _GAUSS_MARKOVS_PER_DECADE) + 1)
    return Choice(
        fit=fit,
        start=lambda part: points.under(part, 0.7),
        singles=(
            RandomWalk(1.0),
            BiasInstability.of_samples(1.0, points.dt, points.duration),
            Quantization(1.0),
            RateRamp(1.0),
            WhiteNoise(1.0),
        ),
        times=np.logspace(first, last, count),
    ).run()


def from_several_starts(
    parts: Sequence[Process], points: CurvePoints, scatter: Scatter
) -> StructureFit:
    """The best fit of a structure, correlation times starting as given or along the curve."""
    starts = [list(parts), *_other_times(parts, points)]
    fits = [fit_structure([points.under(p) for p in s], points, scatter, 30) for s in starts]
    return fit_structure(min(fits, key=lambda f: f.cost).parts, points, scatter)


def _other_times(parts: Sequence[Process], points: CurvePoints) -> list[list[Process]]:
    """The structure with its correlation times spread over the curve in several ways.

    Given times may only say how many there are, not how long. Their order is kept.
    """
    noises = [(p.correlation_time, k) for k, p in enumerate(parts) if isinstance(p, GaussMarkov)]
    if not noises:
        return []
    count = max(4, 2 * len(noises))
    grid = np.geomspace(2.0 * points.tau[0], points.tau[-1], count)
    starts = []
    for first in range(count - len(noises) + 1):
        chosen = np.linspace(first, count - 1, len(noises)).astype(int)
        if len(noises) == 1:
            chosen = np.array([first])
        moved = list(parts)
        for (_, k), j in zip(sorted(noises), chosen, strict=True):
            moved[k] = replace(parts[k], correlation_time=float(grid[j]))  # type: ignore[type-var]
        starts.append(moved)
    return starts
