"""The same parameter by several methods: differences in combined standard deviations."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from schuler.data.to_dict import ToDict
from schuler.estimation.result import MethodResult
from schuler.noise import GaussMarkov, Process, ProcessSum
from schuler.noise.parameter_names import class_and_number

AGREE = 2.0
"""Largest difference in combined standard deviations that counts as agreement."""
_NOTHING = 2.0
"""An error so many times the value says that the fit put the term at zero."""
READINGS = ("slope", "autocorrelation", "gmwm-robust")
"""Methods that are shown beside the others but have no say in the verdict: two read one curve,
and the robust one asks for the bulk of the samples, which outliers set apart from all of them."""


@dataclass(frozen=True, slots=True)
class ParameterAgreement(ToDict):
    """One parameter as several methods find it."""

    JSON = (
        "parameter values standard_errors differences_in_combined_sd=differences worst "
        "worst_pair agree"
    )

    # such as "white_noise.density"; Gauss-Markov noises are numbered by correlation time where
    # there is more than one.
    parameter: str
    # values, standard_errors: by method, SI
    values: dict[str, float]
    standard_errors: dict[str, float]
    # of each method from the first, of logarithms, in combined standard deviations. The methods
    # share their data, so their errors are not independent and the true significance is higher.
    differences: dict[str, float]
    # largest difference between any two methods that have a say; 0 if there are fewer than two.
    worst: float
    worst_pair: tuple[str, ...]  # which two; empty if there are none.

    @property
    def agree(self) -> bool | None:
        """True where all that have a say agree; None where fewer than two have."""
        return self.worst <= AGREE if self.worst_pair else None


def comparable(result: MethodResult) -> dict[str, tuple[float, float]]:
    """Return the parameters of the processes of a result under names that methods share."""
    process, errors = result.process, result.standard_errors
    if not isinstance(process, ProcessSum):
        return {}
    names = dict(zip(process.names, _ranked(process), strict=True))
    out: dict[str, tuple[float, float]] = {}
    for key, value in process.parameters.items():
        name, _, field = key.partition(".")
        if key in errors and value > 0.0 and errors[key] < _NOTHING * value:
            out[f"{names[name]}.{field}"] = (value, errors[key])
    return dict(sorted(out.items(), key=lambda item: _place(item[0])))


def _ranked(process: ProcessSum) -> list[str]:
    """Names of the parts with Gauss-Markov noises numbered by their correlation time."""
    times = sorted(p.correlation_time for p in process.parts if isinstance(p, GaussMarkov))
    names = []
    for name, part in zip(process.names, process.parts, strict=True):
        if isinstance(part, GaussMarkov) and len(times) > 1:
            names.append(f"gauss_markov_{times.index(part.correlation_time) + 1}")
        else:
            names.append(name)
    return names


def _place(key: str) -> tuple[float, str, bool]:
    name, _, field = key.partition(".")
    cls, _ = class_and_number(name)
    return (math.inf if cls is None else cls.rank, name, field == "correlation_time")


def combined_difference(first: tuple[float, float], second: tuple[float, float]) -> float:
    """Difference of two logarithms in combined standard deviations."""
    spread = math.hypot(first[1] / first[0], second[1] / second[0])
    return math.log(second[0] / first[0]) / spread if spread > 0.0 else 0.0


def compare_parameters(results: Mapping[str, MethodResult]) -> tuple[ParameterAgreement, ...]:
    """Lay the parameters of several methods side by side."""
    found = {method: comparable(result) for method, result in results.items()}
    keys = sorted({key for named in found.values() for key in named}, key=_place)
    return tuple(_compared(key, {m: n[key] for m, n in found.items() if key in n}) for key in keys)


def _compared(key: str, found: dict[str, tuple[float, float]]) -> ParameterAgreement:
    first = next(iter(found.values()))
    voters = [m for m in found if m not in READINGS]
    pairs = [
        (abs(combined_difference(found[a], found[b])), (a, b))
        for k, a in enumerate(voters)
        for b in voters[k + 1 :]
    ]
    worst, pair = max(pairs, default=(0.0, ()))
    return ParameterAgreement(
        parameter=key,
        values={m: value for m, (value, _) in found.items()},
        standard_errors={m: error for m, (_, error) in found.items()},
        differences={m: combined_difference(first, pair) for m, pair in found.items()},
        worst=worst,
        worst_pair=pair,
    )


def shared_structure(process: Process | None, method: str) -> Process | None:
    """Return the parts of a structure that a method can fit."""
    if process is None:
        return None
    parts = tuple(
        p
        for p in process.components
        if (method != "psd" or p.random) and (method != "ml" or p.likelihood)
    )
    return ProcessSum(parts) if parts else None
