"""What of a signal follows a column beside it, such as temperature, estimated with its noise.

Means of some 240 blocks are regressed on terms of the columns by generalised least squares under
white noise, flicker and random walk whose sizes are found by likelihood in the same fit. A term
is taken only when the likelihood and its own error both call for it; nothing is made up where a
column does not matter.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import InputError
from schuler.estimation.disturbances.steps import Rebuilt, rebuilt, step_of
from schuler.estimation.optimizer import Rules, Slopes, minimise
from schuler.noise.effects import Effect, term_of
from schuler.types import FloatArray

_BLOCKS = 240
_FEWEST_BLOCKS = 40
_CHANCE = 1e-3
_LEAST_Z = 3.3
_MOST_TERMS = 3
_POORLY_KNOWN = 0.3
_SMALLEST = 1e-12
_RULES = Rules(damping=1e-3, longest=2.0, ridge=1e-9, gain=(1e-4, 1e-3), iterations=30)


@dataclass(frozen=True, slots=True, eq=False)
class Regression:
    """A signal less what follows its columns."""

    signal: FloatArray  # (n,): what is left
    effects: tuple[Effect, ...]  # what was taken, in u per unit of the column
    flags: tuple[str, ...]  # columns that could not be used, and why

    def to_dict(self) -> list[dict[str, Any]]:
        """Return plain Python for JSON, SI."""
        return [e.to_dict() for e in self.effects]


def without_covariates(
    signal: FloatArray, rate: float, columns: Mapping[str, ArrayLike]
) -> Regression:
    """Find which columns the signal follows, and take that out."""
    usable, flags = _usable(signal, columns)
    block = signal.size // _BLOCKS
    if not usable or block < 1 or signal.size // max(block, 1) < _FEWEST_BLOCKS:
        return Regression(signal, (), tuple(flags))
    means = _means(signal, block)
    means = means - means.mean()
    steps = {name: step_of(values) for name, values in usable.items()}
    between = {name: rebuilt(usable[name], step, block) for name, step in steps.items() if step}
    known = {name: _followed(means, several, block) for name, several in between.items() if several}
    smooth = {
        name: known[name].values if name in known else _smoothed(values, _width(values, block))
        for name, values in usable.items()
    }
    # a derivative has more noise of the column than what it is taken of
    slow = {
        name: _smoothed(smooth[name] if name in known else values, block)
        for name, values in usable.items()
    }
    reference = {name: float(values.mean()) for name, values in smooth.items()}
    terms = {
        (name, power): term_of(power, source[name] - reference[name], rate)
        for name in smooth
        for power, source in (("linear", smooth), ("square", smooth), ("rate", slow))
    }
    design = {key: _means(x, block) for key, x in terms.items()}
    scale = float(np.std(means)) or 1.0
    chosen, fit = _chosen(means / scale, design)
    left = signal
    effects = []
    for (name, power), value, error in zip(chosen, fit.size, fit.errors, strict=True):
        unit = float(np.std(design[name, power])) or 1.0
        size = scale / unit
        doubt = known[name].doubt * float(value) if name in known else 0.0
        wide = math.hypot(float(error), doubt) * size
        effect = Effect(name, power, float(value) * size, wide, reference[name])
        effects.append(effect)
        left = left - effect.coefficient * terms[name, power]
    for name, seen in known.items():
        taken = any(e.column == name for e in effects)
        flags += _steps_said(name, steps[name], seen, taken, float(np.std(smooth[name])))
    return Regression(left, tuple(effects), tuple(flags))


def _followed(means: FloatArray, several: list[Rebuilt], block: int) -> Rebuilt:
    """Of several ways to rebuild a column the one that the signal follows best.

    How far the slopes of others that fit nearly as well are from its own is part of its error.
    """
    kernels = _kernels(means.size)
    scale = float(np.std(means)) or 1.0
    start = np.log(np.array([0.3, 0.3, 0.1]))
    fits = []
    unit = float(np.std(several[0].values)) or 1.0
    for one in several:
        x = _means(one.values, block)
        x = (x - x.mean()) / unit
        fits.append(_fitted(means / scale, [x, x**2], kernels, start))
    likelihood = np.array([f.likelihood for f in fits])
    slope = np.array([f.size[0] for f in fits])
    best = int(likelihood.argmax())
    # what is left is not quite the noise of the model: half of the difference is believed
    weight = np.exp(0.5 * (likelihood - likelihood[best]))
    apart = math.sqrt(float(np.sum(weight * (slope - slope[best]) ** 2) / np.sum(weight)))
    # nor is the best of a few sure by more than its neighbours are away
    beside = np.abs(slope[max(best - 1, 0) : best + 2] - slope[best])
    apart = max(apart, float(beside.max()))
    return replace(several[best], doubt=min(apart / max(abs(float(slope[best])), 1e-300), 1.0))


def _steps_said(
    name: str, step: float, seen: Rebuilt, taken: bool, spread: float
) -> tuple[str, ...]:
    """Say that a column was rebuilt where it matters, and where its steps are too coarse."""
    said = f"{name}: it moves in steps of {step:.3g} and was rebuilt between them"
    if seen.error > _POORLY_KNOWN * spread:
        return (f"{said}; the steps are too coarse to tell well what follows it",)
    if not taken:
        return ()
    return (f"{said}, to {seen.error:.2g}: what follows less than that stays as noise",)


def _usable(
    signal: FloatArray, columns: Mapping[str, ArrayLike]
) -> tuple[dict[str, FloatArray], list[str]]:
    usable, flags = {}, []
    for name, column in columns.items():
        values = np.asarray(column, dtype=np.float64)
        if values.shape != signal.shape:
            raise InputError(
                f"column '{name}' has the shape {values.shape}", expected=f"{signal.shape}"
            )
        holes = ~np.isfinite(values)
        if holes.mean() > 0.5:
            flags.append(f"{name}: more than half of the column is missing, it was not used")
            continue
        if holes.any():
            at = np.arange(values.size)
            values = np.interp(at, at[~holes], values[~holes])
            flags.append(
                f"{name}: {int(holes.sum())} missing values of the column were interpolated"
            )
        if float(np.ptp(values)) <= 1e-9 * max(float(np.abs(values).max()), 1.0):
            flags.append(f"{name}: the column is constant and says nothing")
            continue
        usable[name] = values
    return usable, flags


def _width(values: FloatArray, most: int) -> int:
    """Samples whose mean has least error: noise of the column against its own motion.

    Differences grow with their lag as a random walk does, and start with the noise; what is
    printed in steps has at least their noise.
    """
    steps = np.diff(values)
    near, far = float(np.mean(steps**2)), float(np.mean((values[most:] - values[:-most]) ** 2))
    motion = max((far - near) / max(most - 1, 1), 1e-300)
    noise = max(0.5 * (near - motion), 0.0)
    moved = np.abs(steps[steps != 0.0])
    if 2 * moved.size < steps.size and moved.size:
        noise = max(noise, float(np.median(moved)) ** 2 / 12.0)
    return int(np.clip(math.sqrt(12.0 * noise / motion), 1, most))


def _smoothed(values: FloatArray, width: int) -> FloatArray:
    """Mean over a block about every sample, mirrored at the ends: the column has its own noise."""
    if width < 2:
        return values
    half = width // 2
    padded = np.pad(values, (half + 1, half), mode="reflect", reflect_type="odd")
    running = np.cumsum(padded)
    return np.asarray((running[2 * half + 1 :] - running[: -2 * half - 1]) / (2 * half + 1))


def _means(values: FloatArray, block: int) -> FloatArray:
    whole = values.size // block * block
    return np.asarray(values[:whole].reshape(-1, block).mean(axis=1))


@dataclass(frozen=True, slots=True, eq=False)
class _Fit:
    """Sizes of noises and terms, in the scaled unit."""

    logs: FloatArray
    likelihood: float
    size: FloatArray
    errors: FloatArray


def _chosen(
    means: FloatArray, design: Mapping[tuple[str, str], FloatArray]
) -> tuple[list[tuple[str, str]], _Fit]:
    """Take the term that helps most, as long as likelihood and error both call for it."""
    from scipy.stats import chi2

    kernels = _kernels(means.size)
    units = {k: (x - x.mean()) / (float(np.std(x)) or 1.0) for k, x in design.items()}
    chosen: list[tuple[str, str]] = []
    start = np.log(np.array([0.3, 0.3, 0.1]))
    best = _fitted(means, [], kernels, start)
    limit = float(chi2.isf(_CHANCE / max(len(units), 1), 1))
    while len(chosen) < min(_MOST_TERMS, len(units)):
        tries = []
        for key in units:
            # a square or a rate alone is not how a sensor follows a temperature
            if key in chosen or (key[1] == "square" and (key[0], "linear") not in chosen):
                continue
            columns = [units[c] for c in (*chosen, key)]
            tries.append((_fitted(means, columns, kernels, best.logs), key))
        if not tries:
            break
        richer, key = max(tries, key=lambda t: t[0].likelihood)
        # the base once more from where the richer ended: it must not lose by a bad start
        base = _fitted(means, [units[c] for c in chosen], kernels, richer.logs)
        base = max(base, best, key=lambda f: f.likelihood)
        z = abs(float(richer.size[-1])) / max(float(richer.errors[-1]), 1e-300)
        if 2.0 * (richer.likelihood - base.likelihood) < limit or z < _LEAST_Z:
            break
        chosen.append(key)
        best = richer
    return chosen, best


def _kernels(count: int) -> list[FloatArray]:
    """Unit covariances of block means: white noise, flicker, random walk."""
    from scipy.linalg import toeplitz

    lag = np.arange(count, dtype=np.float64)
    times = np.geomspace(1.0, 10.0 * count, round(2 * math.log10(10.0 * count)) + 1)
    flicker = np.exp(-lag[:, None] / times).sum(axis=1)
    walk = np.minimum(lag[:, None], lag[None, :]) + 1.0
    flicker_matrix = toeplitz(flicker) / flicker[0]
    return [np.eye(count), flicker_matrix, walk / count]


def _fitted(
    means: FloatArray, columns: list[FloatArray], kernels: list[FloatArray], start: FloatArray
) -> _Fit:
    """Maximum likelihood of the sizes of the noises by Fisher scoring, terms by least squares."""
    from scipy.linalg import cho_factor, cho_solve

    x = np.column_stack([np.ones(means.size), *columns])

    def slopes(logs: FloatArray) -> Slopes[tuple[FloatArray, FloatArray]]:
        sizes = np.exp(logs)
        covariance = np.tensordot(sizes, np.array(kernels), axes=1)
        covariance[np.diag_indices_from(covariance)] += _SMALLEST
        factor = cho_factor(covariance, lower=True)
        inverse = cho_solve(factor, np.eye(means.size))
        information = x.T @ inverse @ x
        beta = np.linalg.solve(information, x.T @ (inverse @ means))
        residual = inverse @ (means - x @ beta)
        value = 2.0 * float(np.log(np.diag(factor[0])).sum())
        value += float(residual @ (means - x @ beta))
        own = [inverse @ k for k in kernels]
        pull = [
            0.5 * s * (float(residual @ k @ residual) - float(np.trace(o)))
            for s, k, o in zip(sizes, kernels, own, strict=True)
        ]
        curvature = [
            [0.5 * sizes[i] * sizes[j] * float(np.sum(own[i] * own[j].T)) for j in range(3)]
            for i in range(3)
        ]
        state = (np.asarray(beta), np.asarray(np.linalg.inv(information)))
        return Slopes(value, np.array(pull), np.array(curvature), state)

    found = minimise(slopes, start, (np.full(3, -25.0), np.full(3, 8.0)), _RULES)
    beta, covariance = found.slopes.state
    errors = np.sqrt(np.diag(covariance))
    return _Fit(found.at, -0.5 * found.value, beta[1:], errors[1:])
