"""Which processes a signal is made of: terms are added, exchanged and removed one at a time."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from schuler.estimation.curve_fit import CurvePoints, Scatter, StructureFit, fit_structure
from schuler.noise import (
    GaussMarkov,
    Process,
    ProcessSum,
    Quantization,
    RandomWalk,
    RateRamp,
    WhiteNoise,
)
from schuler.noise.gauss_markov import gauss_markov_allan_shape
from schuler.types import FloatArray

PENALTY = {
    "white_noise": 4.0,
    "random_walk": 8.0,
    "quantization": 10.0,
    "rate_ramp": 12.0,
    "gauss_markov": 16.0,
}
"""What a term must take off the misfit to be believed.

For one parameter chi-square 8 is exceeded by chance once in 200 (400 at the boundary of zero);
a Gauss-Markov noise has two parameters and may be put anywhere along the curve. Ramps and
quantisation are rarer in sensors and must prove more.
"""
_MOST_GAUSS_MARKOVS = 3
_VISIBLE = 0.02
_GAUSS_MARKOVS_PER_DECADE = 1.0


def criterion(fit: StructureFit) -> float:
    """Misfit plus the penalties of all terms: the smaller, the better."""
    return fit.chi_square + math.fsum(PENALTY[kind] for kind in fit.kinds)


def rough_process(points: CurvePoints) -> ProcessSum:
    """Describe a curve by many terms at once, only to learn how its points scatter."""
    tau = points.tau
    decades = math.log10(tau[-1] / tau[0])
    times = np.geomspace(2.0 * tau[0], max(tau[-1], 2.0 * tau[0]), max(2, round(decades) + 1))
    parts: list[Process] = [WhiteNoise(1.0), Quantization(1.0), RandomWalk(1.0)]
    parts += [GaussMarkov(1.0, float(t)) for t in times]
    weight = np.sqrt(points.degrees_of_freedom)
    shapes = np.array([p.allan_variance(tau) for p in parts]).T
    design = shapes / points.variance[:, None] * weight[:, None]
    norms = np.linalg.norm(design, axis=0)
    design /= norms
    wanted, normal = design.T @ weight, design.T @ design
    size = np.full(len(parts), wanted.max() / len(parts))
    for _ in range(400):
        size *= wanted / (normal @ size)
    amplitude = np.sqrt(size / norms)
    scaled: list[Process] = [
        WhiteNoise(amplitude[0]),
        Quantization(amplitude[1]),
        RandomWalk(amplitude[2]),
    ]
    scaled += [GaussMarkov(a, float(t)) for a, t in zip(amplitude[3:], times, strict=True)]
    shares = shapes * (size / norms) / (shapes @ (size / norms))[:, None]
    return ProcessSum(
        tuple(p for p, share in zip(scaled, shares.T, strict=True) if share.max() > _VISIBLE)
    )


def _under(points: CurvePoints, shape: FloatArray) -> float:
    """Amplitude at which a term reaches, somewhere, 70 % of the variance but nowhere more."""
    return math.sqrt(0.7 * float(np.min(points.variance / shape)))


def _single_starts(kind: str, points: CurvePoints) -> Process:
    tau = points.tau
    if kind == "random_walk":
        return RandomWalk(_under(points, tau / 3.0))
    if kind == "quantization":
        return Quantization(_under(points, 3.0 / tau**2))
    if kind == "rate_ramp":
        return RateRamp(_under(points, 0.5 * tau**2))
    return WhiteNoise(_under(points, 1.0 / tau))


def _gauss_markov_starts(points: CurvePoints) -> list[GaussMarkov]:
    tau = points.tau
    first, last = math.log10(3.0 * tau[0]), math.log10(max(tau[-1], 3.1 * tau[0]))
    count = max(2, round((last - first) * _GAUSS_MARKOVS_PER_DECADE) + 1)
    return [
        GaussMarkov(_under(points, gauss_markov_allan_shape(tau / t)), float(t))
        for t in np.logspace(first, last, count)
    ]


def _best(fits: Sequence[StructureFit]) -> StructureFit:
    return min(fits, key=criterion)


def _best_with_gauss_markov(
    parts: Sequence[Process], points: CurvePoints, scatter: Scatter
) -> StructureFit:
    """Fit `parts` and one more Gauss-Markov noise, from the two best of a few starts."""
    tries = [
        fit_structure([*parts, start], points, scatter, iterations=4)
        for start in _gauss_markov_starts(points)
    ]
    tries.sort(key=lambda f: f.chi_square)
    return _best([fit_structure(f.parts, points, scatter) for f in tries[:2]])


def _additions(best: StructureFit, points: CurvePoints, scatter: Scatter) -> list[StructureFit]:
    fits = [
        fit_structure([*best.parts, _single_starts(kind, points)], points, scatter)
        for kind in ("random_walk", "quantization", "rate_ramp", "white_noise")
        if kind not in best.kinds
    ]
    if best.kinds.count("gauss_markov") < _MOST_GAUSS_MARKOVS:
        fits.append(_best_with_gauss_markov(best.parts, points, scatter))
    return fits


def _exchanges(best: StructureFit, points: CurvePoints, scatter: Scatter) -> list[StructureFit]:
    """Every simpler structure, and every slow term exchanged for another kind of slow term."""
    fits = []
    for k, kind in enumerate(best.kinds):
        rest = [*best.parts[:k], *best.parts[k + 1 :]]
        if rest:
            fits.append(fit_structure(rest, points, scatter))
        if kind in ("gauss_markov", "rate_ramp") and "random_walk" not in best.kinds:
            walk = _single_starts("random_walk", points)
            fits.append(fit_structure([*rest, walk], points, scatter))
        if kind in ("random_walk", "rate_ramp") and (
            best.kinds.count("gauss_markov") < _MOST_GAUSS_MARKOVS
        ):
            fits.append(_best_with_gauss_markov(rest, points, scatter))
    return fits


def select_structure(
    points: CurvePoints, scatter: Scatter
) -> tuple[StructureFit, dict[str, float]]:
    """Find the sum of processes with the smallest criterion."""
    best = fit_structure([_single_starts("white_noise", points)], points, scatter)
    tried = {_name(best): criterion(best)}
    for _ in range(8):
        grown = _best(_additions(best, points, scatter))
        tried[_name(grown)] = criterion(grown)
        if criterion(grown) < criterion(best):
            best = grown
            continue
        changed = _exchanges(best, points, scatter)
        if not changed:
            break
        other = _best(changed)
        tried[_name(other)] = criterion(other)
        if criterion(other) >= criterion(best) - 1e-3:
            break
        best = other
    return fit_structure(sorted(best.parts, key=_order), points, scatter), tried


_ORDER = ("white_noise", "quantization", "gauss_markov", "random_walk", "rate_ramp")


def _order(part: Process) -> tuple[int, float]:
    time = part.correlation_time if isinstance(part, GaussMarkov) else 0.0
    return _ORDER.index(part.kind), time


def _name(fit: StructureFit) -> str:
    return " + ".join(p.kind for p in sorted(fit.parts, key=_order))
