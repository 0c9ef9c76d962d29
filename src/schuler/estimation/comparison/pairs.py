"""The same parameters from two methods, side by side: Table 3 against Table 4 of S004."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Protocol

from schuler.data.to_dict import ToDict
from schuler.errors import InputError


class Fitted(Protocol):
    """Anything with parameters and standard errors by the same keys."""

    @property
    def parameters(self) -> Mapping[str, float]:
        """Values, SI."""
        ...

    @property
    def standard_errors(self) -> Mapping[str, float]:
        """Standard errors, SI."""
        ...


@dataclass(frozen=True, slots=True)
class ComparedParameter:
    """One parameter by two methods."""

    parameter: str  # such as "white_noise.density"
    # first, second: values, SI
    first: float
    second: float
    # first_error, second_error: standard errors
    first_error: float
    second_error: float
    difference: float  # (first - second) over the root of the sum of the squared errors
    relative: float  # first/second - 1


@dataclass(frozen=True, slots=True)
class ParameterComparison(ToDict):
    """What two methods say about the same signal."""

    JSON = "methods rows only_first only_second outside_2_sd=outside findings"

    methods: tuple[str, str]  # their names
    rows: tuple[ComparedParameter, ...]  # parameters that both have
    # only_first, only_second: parameters of one alone
    only_first: tuple[str, ...]
    only_second: tuple[str, ...]

    def outside(self, deviations: float = 2.0) -> tuple[str, ...]:
        """Return the parameters that differ by more than this many combined standard deviations."""
        return tuple(r.parameter for r in self.rows if not abs(r.difference) <= deviations)

    def findings(self) -> tuple[str, ...]:
        """Return what the comparison means, one plain sentence a parameter that differs."""
        first, second = self.methods
        sentences = [
            f"{row.parameter}: {first} says {100.0 * abs(row.relative):.3g} % "
            f"{'more' if row.relative > 0.0 else 'less'} than {second}, "
            f"{abs(row.difference):.1f} combined standard deviations"
            for row in self.rows
            if abs(row.difference) > 2.0
        ]
        lone = [(first, key) for key in self.only_first]
        lone += [(second, key) for key in self.only_second]
        sentences += [f"{key}: found by {method} alone" for method, key in lone]
        return tuple(sentences)


def compare_parameters(
    first: Fitted, second: Fitted, methods: tuple[str, str] = ("spectrum", "Allan")
) -> ParameterComparison:
    """Compare the parameters of two identifications in units of their combined errors."""
    ours, theirs = first.parameters, second.parameters
    common = [key for key in ours if key in theirs]
    if not common:
        raise InputError(
            "two identifications without a common parameter",
            expected="the same model in both",
            cure="fix the structure with model=...",
        )
    rows = []
    for key in common:
        a, b = float(ours[key]), float(theirs[key])
        sa, sb = float(first.standard_errors[key]), float(second.standard_errors[key])
        combined = math.hypot(sa, sb)
        apart = 0.0 if a == b else math.inf if combined == 0.0 else (a - b) / combined
        relative = a / b - 1.0 if b != 0.0 else (0.0 if a == 0.0 else math.inf)
        rows.append(ComparedParameter(key, a, b, sa, sb, apart, relative))
    return ParameterComparison(
        methods=methods,
        rows=tuple(rows),
        only_first=tuple(key for key in ours if key not in theirs),
        only_second=tuple(key for key in theirs if key not in ours),
    )
