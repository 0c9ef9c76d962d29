"""Experiments: one unit of work, how often it is repeated, and what its results are for."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler import ModelError
from schuler_papers.outcome import Estimate, Outcome

FloatArray = NDArray[np.float64]

Size = Literal["quick", "full"]
Numbers = dict[str, FloatArray]
"""What one run returns: arrays by name, small enough to be kept."""
Results = Sequence[Numbers]
"""One entry for each repetition, in the order of the seeds."""


@dataclass(frozen=True, slots=True)
class Repetitions:
    """Number of seeds for each size; no quick one for what takes long."""

    quick: int = 1
    full: int = 1

    def of(self, size: Size) -> int:
        """Return the number of seeds for a size."""
        return self.quick if size == "quick" else self.full


@dataclass(frozen=True, slots=True)
class Item:
    """A table, figure, equation or slip of a paper: label as printed, claim, how it is judged.

    `slips` are the labels of further slips that its rows are about, so that they can be asked for.
    """

    label: str
    title: str
    claim: str
    judge: Callable[[Results, Size], Outcome]
    slips: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Experiment:
    """One unit of work that is repeated, and the items it serves."""

    paper: str  # name in `registry.PAPERS`
    name: str  # letters, digits and hyphens; names the files that are kept.
    title: str  # what is done
    # ``(seed, size) -> Numbers``; ``(seed, size, folder)`` if it needs recordings.
    run: Callable[..., Numbers]
    items: tuple[Item, ...]  # what the results are for
    repetitions: Repetitions = Repetitions()  # how often
    recordings: tuple[str, ...] = ()  # folders of measured data it needs

    def __post_init__(self) -> None:
        if not all(c.isascii() and (c.isalnum() or c == "-") for c in self.name) or not self.name:
            raise ModelError(
                f"an experiment named '{self.name}'", expected="letters, digits, hyphens"
            )
        if not self.items:
            raise ModelError(f"experiment '{self.name}' serves no item")


def generator(seed: int, *names: str) -> np.random.Generator:
    """Return the generator of one repetition of one experiment."""
    return np.random.default_rng([seed, *(zlib.crc32(name.encode()) for name in names)])


def numbers(**values: ArrayLike) -> Numbers:
    """Return results as float64 arrays by name."""
    return {name: np.asarray(value, dtype=np.float64) for name, value in values.items()}


def stacked(results: Results, name: str) -> FloatArray:
    """Return one result of all repetitions."""
    return np.stack([result[name] for result in results])


def estimate(values: ArrayLike) -> Estimate:
    """Return the mean over repetitions with its standard error."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 1:
        raise ModelError(f"an estimate from an array of shape {array.shape}", expected="(k,)")
    error = array.std(ddof=1) / np.sqrt(array.size) if array.size > 1 else np.nan
    return Estimate(float(array.mean()), float(error))
