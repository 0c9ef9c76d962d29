"""Sums of processes as the parameters of a fit: logarithms in, model and derivatives out."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from schuler.errors import InputError, ModelError
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

Names = tuple[tuple[int, str], ...]
"""Part and field of every free parameter."""
Shape = Callable[[Process], FloatArray]
"""What a process puts into every point of a curve."""

_STEP = 1e-4
_NEXT = math.exp(_STEP)
_TIMES_BEYOND = 20.0
_NORMAL = 1.959964
_ONE_SIDED = 1.645
_VANISHED = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class FittedParts:
    """The best parameters of one structure."""

    parts: tuple[Process, ...]  # fitted
    names: Names  # part and field of every free parameter
    log_covariance: FloatArray  # (p, p): covariance of the logarithms of the free parameters
    cost: float  # what was made small: misfit or deviance
    converged: bool  # the iteration ended by itself

    @property
    def process(self) -> ProcessSum:
        """The fitted sum."""
        return ProcessSum(self.parts)

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kinds of the parts."""
        return tuple(p.kind for p in self.parts)

    @property
    def logs(self) -> FloatArray:
        """Logarithms of the free parameters."""
        return logs_of(self.parts, self.names)


def free_parameters(parts: Sequence[Process]) -> Names:
    """List part and field of everything a fit finds."""
    return tuple((k, name) for k, part in enumerate(parts) for name in part.free)


def logs_of(parts: Sequence[Process], names: Names) -> FloatArray:
    """Logarithms of the free parameters."""
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


def log_bounds(
    parts: Sequence[Process], names: Names, shortest: float, duration: float
) -> tuple[FloatArray, FloatArray]:
    """Bounds of the logarithms: times stay between `shortest` and twenty times the record."""
    timed = np.array([parts[k].described(n).role == "time" for k, n in names], dtype=bool)
    low = np.where(timed, math.log(shortest), -np.inf)
    high = np.where(timed, math.log(_TIMES_BEYOND * duration), np.inf)
    return low, high


@dataclass(frozen=True, slots=True, eq=False)
class Terms:
    """A structure over the points of a curve; what only grows with its size is drawn up once."""

    parts: tuple[Process, ...]  # the structure
    names: Names  # part and field of every free parameter
    shape: Shape  # what a process puts into every point
    # that of the parts of which nothing but the size is free, at size one; None for others.
    known: tuple[FloatArray | None, ...]
    sizes: tuple[str, ...]  # name of the size of every part

    @classmethod
    def of(cls, parts: Sequence[Process], names: Names, shape: Shape) -> Terms:
        """Draw up the parts that do not change but in size."""
        sizes = tuple(p.size_name() for p in parts)
        known = tuple(
            shape(p.with_size(1.0)) if [n for j, n in names if j == k] == [size] else None
            for k, (p, size) in enumerate(zip(parts, sizes, strict=True))
        )
        return cls(tuple(parts), names, shape, known, sizes)

    def at(self, logs: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the model (t,) and its derivatives (t, p) by the logarithms of the parameters."""
        values: list[dict[str, float]] = [{} for _ in self.parts]
        for (k, name), log in zip(self.names, logs.tolist(), strict=True):
            values[k][name] = math.exp(log)
        rows: list[FloatArray] = []
        total: FloatArray | float = 0.0
        for part, unit, size, new in zip(self.parts, self.known, self.sizes, values, strict=True):
            if unit is not None:
                now, component = part, new[size] ** part.growth * unit
            else:
                now = replace(part, **new) if new else part  # type: ignore[type-var]
                component = self.shape(now)
            total = total + component
            for name, value in new.items():
                if name == size:
                    rows.append(part.growth * component)
                    continue
                moved = replace(now, **{name: value * _NEXT})  # type: ignore[type-var]
                rows.append((self.shape(moved) - component) / _STEP)
        return np.asarray(total), np.array(rows).T


def evaluate(
    parts: Sequence[Process], names: Names, logs: FloatArray, shape: Shape
) -> tuple[FloatArray, FloatArray]:
    """The same of a structure that is looked at once."""
    return Terms.of(parts, names, shape).at(logs)


def under(part: Process, values: FloatArray, shape: Shape, share: float) -> Process:
    """Give a part the size at which it nowhere passes a share of a curve."""
    if not part.size_name() or part.size_name() not in part.free:
        return part
    unit = part.with_size(1.0)
    level = float(np.min(values / np.maximum(shape(unit), 1e-300)))
    return unit.with_size((share * level) ** (1.0 / part.growth))


LETTERS = {"W": "white noise", "Q": "quantisation", "B": "bias instability (flicker)",
           "G": "Gauss-Markov noise", "K": "random walk", "R": "ramp"}  # fmt: skip
"""How a structure is spelled, such as W+B+K."""


def is_structure(model: object) -> bool:
    """Whether a model is spelled by its letters, which say nothing of times."""
    return isinstance(model, str) and model != "auto"


def checked_model(model: object) -> str | Process:
    """Return a model that a method can understand."""
    if isinstance(model, Process) or model in ("auto", "classical"):
        return model
    letters = model.upper().replace(" ", "").split("+") if isinstance(model, str) else []
    once = all(letters.count(a) == 1 for a in letters if a != "G") and letters.count("G") <= 3
    if letters and once and all(a in LETTERS for a in letters):
        return "+".join(letters)
    raise InputError(
        f"model '{model}'",
        expected="'auto', 'classical', a process, or letters such as W+B+K out of "
        + ", ".join(f"{a} ({words})" for a, words in LETTERS.items()),
        cure="G may occur up to three times, the others once",
    )


def parts_of_model(model: object, dt: float, duration: float, shown_by: str) -> tuple[Process, ...]:
    """Parts of a structure that was asked for, with at least one parameter to fit."""
    model = checked_model(model)
    if isinstance(model, str):
        letters = "WBK" if model == "classical" else model.replace("+", "")
        times = iter(np.geomspace(3.0 * dt, duration / 5.0, letters.count("G") + 2)[1:-1])
        units: dict[str, Callable[[], Process]] = {
            "W": lambda: WhiteNoise(1.0),
            "Q": lambda: Quantization(1.0),
            "B": lambda: BiasInstability.of_samples(1.0, dt, duration),
            "G": lambda: GaussMarkov(1.0, float(next(times))),
            "K": lambda: RandomWalk(1.0),
            "R": lambda: RateRamp(1.0),
        }
        return tuple(units[a]() for a in letters)
    if not free_parameters(model.components):
        raise ModelError(f"the model has no parameter that {shown_by} shows")
    return model.components


@dataclass(frozen=True, slots=True, eq=False)
class Estimates:
    """Fitted numbers by name: standard errors, 95 % intervals, limits of what has vanished."""

    errors: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    limits: dict[str, float]


def estimates_of(parts: Sequence[Process], names: Names, log_covariance: FloatArray) -> Estimates:
    """Put the covariance of the logarithms into words."""
    keys = ProcessSum(tuple(parts)).names
    found = Estimates({}, {}, {})
    for j, (k, name) in enumerate(names):
        key = f"{keys[k]}.{name}"
        value = abs(float(getattr(parts[k], name)))
        spread = min(math.sqrt(max(float(log_covariance[j, j]), 0.0)), 50.0)
        found.errors[key] = min(value * spread, 1e3 * value)
        reach = math.exp(_NORMAL * spread)
        found.intervals[key] = (value / reach, value * reach)
        if spread > _VANISHED:
            found.limits[key] = value * math.exp(min(_ONE_SIDED * spread, 20.0))
    return found
