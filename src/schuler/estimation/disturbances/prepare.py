"""A signal as a fit should see it: less what follows its columns and its lines, outliers judged."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from schuler.estimation.disturbances.covariates import without_covariates
from schuler.estimation.disturbances.lines import Line, without_lines
from schuler.estimation.disturbances.outliers import Contamination, contamination
from schuler.noise import Process, ProcessSum, Quantization, Sinusoid
from schuler.noise.effects import Effect
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Prepared:
    """A signal made ready, and what to say about it."""

    raw: FloatArray  # (n,): as recorded
    followed: FloatArray  # (n,): less what follows its columns
    values: FloatArray  # (n,): less its lines too
    rate: float  # samples a second
    lines: tuple[Line, ...]  # what was taken out
    effects: tuple[Effect, ...]  # what follows a column, taken out
    contamination: Contamination  # how far outliers reach
    notes: tuple[str, ...]  # what could not be used, and why

    @property
    def robust(self) -> bool:
        """Whether a robust estimate is called for."""
        return self.contamination.serious

    @property
    def filled(self) -> bool:
        """Whether the band of a wandering line was filled with noise."""
        return any(not line.steady for line in self.lines)

    @property
    def steady(self) -> tuple[Line, ...]:
        """Lines that are one sinusoid."""
        return tuple(line for line in self.lines if line.steady)

    def flags(self, robustly: bool) -> tuple[str, ...]:
        """What was done to the signal, in plain words."""
        said = []
        if self.robust and robustly:
            said.append(
                f"outliers: {self.contamination.words}; fitted by robust wavelet moments "
                "(gmwm-robust), which hold them back"
            )
        said += [taken_out(line) for line in self.lines]
        if self.filled:
            said.append("its band was filled with noise: do not believe a quantisation term")
        said += [followed(e) for e in self.effects]
        return (*said, *self.notes)

    def believed(self, process: ProcessSum, model: str | Process) -> ProcessSum | None:
        """What of a chosen sum to fit again where quantisation must not be believed."""
        if model != "auto" or not self.filled:
            return None
        # what fills a band is not quite what was there: its edges look like quantisation
        kept = tuple(p for p in process.parts if not isinstance(p, Quantization))
        return ProcessSum(kept) if 0 < len(kept) < len(process.parts) else None

    def without_lines(self, process: Process | None) -> ProcessSum | None:
        """The structure for another method: what was taken out is not in the values."""
        if process is None:
            return None
        kept = [p for p in process.components if not (self.steady and isinstance(p, Sinusoid))]
        return ProcessSum(tuple(kept))

    def with_lines(self, process: Process) -> tuple[ProcessSum, dict[str, float], dict[str, float]]:
        """Add steady lines to a process as sinusoids: the sum, their numbers and their errors."""
        before = process.components
        sum_ = ProcessSum((*before, *(Sinusoid(a.amplitude, a.frequency) for a in self.steady)))
        numbers, errors = {}, {}
        for name, line in zip(sum_.names[len(before) :], self.steady, strict=True):
            numbers[f"{name}.amplitude"] = line.amplitude
            numbers[f"{name}.frequency"] = line.frequency
            errors[f"{name}.amplitude"] = line.amplitude_error
            errors[f"{name}.frequency"] = line.frequency_error
        return sum_, numbers, errors


def followed(effect: Effect, size: str = "") -> str:
    """Say what followed a column; in SI unless its size is given in other words."""
    size = size or f"{effect.coefficient:.4g} ± {effect.standard_error:.2g} (SI)"
    return f"it follows the {effect.words} by {size}, which was taken off before the fit"


def taken_out(line: Line, size: str = "") -> str:
    """Say that a line was taken out; in SI unless its size is given in other words."""
    error = f" ± {line.amplitude_error:.2g}" if line.steady else ""
    size = size or f"{line.amplitude:.4g}{error}"
    return f"{line.words} of amplitude {size} was taken out before the fit"


def has_lines(model: str | Process) -> bool:
    """Whether a given model has sinusoids of its own: lines are then left to it."""
    return isinstance(model, Process) and any(isinstance(p, Sinusoid) for p in model.components)


def prepared(
    signal: FloatArray,
    rate: float,
    columns: Mapping[str, ArrayLike] | None = None,
    *,
    lines: bool = True,
) -> Prepared:
    """Take off what follows the columns, then lines, and tell whether outliers decide."""
    signal = np.asarray(signal, dtype=np.float64)
    regression = without_covariates(signal, rate, columns or {})
    followed = values = regression.signal
    taken: tuple[Line, ...] = ()
    seen = contamination(followed, closely=False)
    if lines and not seen.serious:
        # outliers hide lines, and a sinusoid fitted to them would be wrong
        found = without_lines(followed, rate)
        values, taken = found.signal, found.lines
    return Prepared(
        signal, followed, values, rate, taken, regression.effects, seen, regression.flags
    )
