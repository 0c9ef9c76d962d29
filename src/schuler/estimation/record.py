"""Was the record long enough? One line for every parameter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from schuler.data.to_dict import ToDict
from schuler.noise import ProcessSum

WANTED_ERROR = 0.10
"""Relative standard error below which a parameter counts as known."""


@dataclass(frozen=True, slots=True)
class ParameterVerdict:
    """How well one parameter is known, and how long it would take to know it well."""

    parameter: str  # such as "gauss_markov.correlation_time"
    relative_error: float  # standard error over value
    # seconds of record for a relative error of 10 %, as errors shrink with the square root
    wanted_duration: float
    enough: bool  # the relative error is at most 10 %


@dataclass(frozen=True, slots=True)
class RecordVerdict(ToDict):
    """The length of the record against what its parameters need."""

    duration: float  # seconds recorded
    wanted_duration: float  # seconds for 10 % on every parameter
    parameters: tuple[ParameterVerdict, ...]  # one for every fitted parameter
    text: str  # the same for people

    @property
    def enough(self) -> bool:
        """True when every parameter is known to 10 %."""
        return all(p.enough for p in self.parameters)


def judge_record(
    process: ProcessSum, standard_errors: Mapping[str, float], duration: float
) -> RecordVerdict:
    """Compare the length of a record with the one that its parameters need."""
    values = process.parameters
    verdicts = []
    for key, error in standard_errors.items():
        relative = error / values[key] if values[key] > 0.0 else float("inf")
        relative = min(relative, 1e3)
        wanted = duration * max((relative / WANTED_ERROR) ** 2, 1e-12)
        verdicts.append(ParameterVerdict(key, relative, wanted, relative <= WANTED_ERROR))
    wanted = max((v.wanted_duration for v in verdicts), default=0.0)
    weak = [v for v in verdicts if not v.enough]
    if weak:
        parts = ", ".join(f"{v.parameter} to {100.0 * v.relative_error:.0f} %" for v in weak)
        text = (
            f"{spell_duration(duration)} recorded give {parts}; 10 % on everything takes about "
            f"{spell_duration(wanted)}"
        )
    else:
        length = spell_duration(duration)
        text = f"{length} recorded are enough: every parameter is known to 10 % or better"
    return RecordVerdict(duration, wanted, tuple(verdicts), text)


def spell_duration(seconds: float) -> str:
    """A length of time for people."""
    if seconds < 120.0:
        return f"{seconds:.0f} s"
    if seconds < 7200.0:
        return f"{seconds / 60.0:.0f} min"
    if seconds < 172800.0:
        return f"{seconds / 3600.0:.1f} h"
    if seconds < 3.2e8:
        return f"{seconds / 86400.0:.0f} days"
    return "years"
