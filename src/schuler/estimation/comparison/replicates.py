"""Several runs of one sensor by several methods: pooled, apart, and whether they share a value."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from schuler.data.to_dict import ToDict
from schuler.errors import EstimationError
from schuler.estimation.comparison.agreement import Agreement, compare_runs
from schuler.estimation.comparison.methods import ImuMethodComparison
from schuler.estimation.comparison.parameters import (
    AGREE,
    READINGS,
    combined_difference,
    comparable,
)
from schuler.noise.parameter_names import spoken_name

_SURE = 0.01


@dataclass(frozen=True, slots=True)
class _Run:
    """One run of one method, with the names that methods share."""

    parameters: dict[str, float]
    standard_errors: dict[str, float]


@dataclass(frozen=True, slots=True)
class PooledParameter(ToDict):
    """One parameter of one channel over all runs, by several methods."""

    JSON = "channel parameter pooled runs worst worst_pair agree"

    # channel, parameter: which
    channel: str
    parameter: str
    # by method: weighted mean over the runs, its error, and whether the runs share one value
    pooled: dict[str, Agreement]
    # by method: value and standard error of every run, None where a run has none
    runs: dict[str, tuple[tuple[float, float] | None, ...]]
    # largest difference of the pooled values of any two methods in combined standard deviations;
    # where runs differ beyond their errors, their scatter is in the errors.
    worst: float
    worst_pair: tuple[str, ...]  # which two methods; empty if fewer than two have it.

    @property
    def agree(self) -> bool | None:
        """True where the methods agree; None where fewer than two have the parameter."""
        return self.worst <= AGREE if self.worst_pair else None

    @property
    def shared(self) -> bool:
        """True where by every method the runs may share one value."""
        return all(a.p_value > _SURE for a in self.pooled.values())


@dataclass(frozen=True, slots=True, eq=False)
class ReplicateComparison(ToDict):
    """All parameters of all channels over several runs of one sensor."""

    JSON = "runs=names parameters findings"

    names: tuple[str, ...]  # of the runs
    parameters: tuple[PooledParameter, ...]  # by channel and parameter
    findings: tuple[str, ...]  # what is worth knowing, in plain language


def compare_replicates(
    runs: Sequence[ImuMethodComparison], names: Sequence[str] | None = None
) -> ReplicateComparison:
    """Pool the parameters of several runs by every method, and compare methods and runs."""
    if len(runs) < 2:
        raise EstimationError(f"{len(runs)} run", expected="at least two")
    channels = [c for c in runs[0].channels if all(c in r.channels for r in runs)]
    parameters = tuple(p for channel in channels for p in _channel(runs, channel))
    return ReplicateComparison(
        names=tuple(names or (r.recording_name for r in runs)),
        parameters=parameters,
        findings=_findings(parameters),
    )


def _channel(runs: Sequence[ImuMethodComparison], channel: str) -> list[PooledParameter]:
    methods = [m for m in runs[0].methods if m not in READINGS]
    table: dict[str, list[dict[str, tuple[float, float]]]] = {
        method: [
            comparable(run.channels[channel].results[method])
            if method in run.channels[channel].results
            else {}
            for run in runs
        ]
        for method in methods
    }
    keys = list(dict.fromkeys(k for found in table.values() for named in found for k in named))
    out = []
    for key in keys:
        pooled: dict[str, Agreement] = {}
        each: dict[str, tuple[tuple[float, float] | None, ...]] = {}
        for method, found in table.items():
            having = [n for n in found if key in n]
            if len(having) < 2:
                continue
            named = [_Run({key: n[key][0]}, {key: n[key][1]}) for n in having]
            pooled[method] = compare_runs(named, key)  # type: ignore[arg-type]
            each[method] = tuple(n.get(key) for n in found)
        if pooled:
            worst, pair = _worst(pooled)
            out.append(PooledParameter(channel, key, pooled, each, worst, pair))
    return out


def _worst(pooled: dict[str, Agreement]) -> tuple[float, tuple[str, ...]]:
    """Largest difference between methods; runs that scatter more than their errors widen it."""
    widened = {
        m: (a.value, a.standard_error * math.sqrt(max(a.chi_square / a.degrees_of_freedom, 1.0)))
        for m, a in pooled.items()
    }
    methods = list(widened)
    pairs = [
        (abs(combined_difference(widened[a], widened[b])), (a, b))
        for k, a in enumerate(methods)
        for b in methods[k + 1 :]
    ]
    return max(pairs, default=(0.0, ()))


def _findings(parameters: Sequence[PooledParameter]) -> tuple[str, ...]:
    judged = [p for p in parameters if p.agree is not None]
    apart = [p for p in judged if not p.agree]
    lines = []
    if judged:
        lines.append(
            f"the pooled values of the methods agree within {AGREE:g} combined standard deviations "
            f"on {len(judged) - len(apart)} of {len(judged)} parameters"
        )
    lines += _by_channel(
        "the methods differ, in combined standard deviations",
        apart,
        lambda p: f"{p.worst:.1f} ({' and '.join(p.worst_pair)}, {_size(p)})",
    )
    shared = [p for p in parameters if p.shared]
    lines.append(
        f"the runs may share one value, by every method, for {len(shared)} of {len(parameters)} "
        "parameters"
    )
    lines += _by_channel(
        "from run to run, beyond the errors, moves",
        [p for p in parameters if not p.shared],
        lambda p: f"by {100.0 * max(a.between for a in p.pooled.values()):.2g} %",
    )
    return tuple(lines)


def _by_channel(
    what: str, parameters: Sequence[PooledParameter], tell: Callable[[PooledParameter], str]
) -> list[str]:
    """One sentence a channel."""
    grouped: dict[str, list[str]] = {}
    for p in parameters:
        grouped.setdefault(p.channel, []).append(f"{spoken_name(p.parameter)} {tell(p)}")
    return [f"{channel}: {what}: {'; '.join(texts)}" for channel, texts in grouped.items()]


def _size(p: PooledParameter) -> str:
    low, high = sorted(p.pooled[m].value for m in p.worst_pair)
    ratio = high / low
    return f"{100.0 * (ratio - 1.0):.2g} %" if ratio < 2.0 else f"{ratio:.2g} times"
