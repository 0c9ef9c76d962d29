"""Several runs of one sensor by several methods: pooled and apart."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from schuler.estimation.comparison.replicates import PooledParameter, ReplicateComparison
from schuler.report.blocks import (
    Block,
    Facts,
    Figure,
    FigureGrid,
    Finding,
    Findings,
    LegendItem,
    Section,
    Table,
)
from schuler.report.figures import axis, encode, limits, marks
from schuler.report.makers import plot
from schuler.report.numbers import MISSING, compact_with_error, number
from schuler.report.sections.noise.method_words import quantity, shown_name
from schuler.report.sections.noise.residuals import probability
from schuler.report.sections.registry import register

COLOURS = {
    "allan": "@model",
    "psd": "@z",
    "gmwm": "@markov",
    "gmwm-robust": "@white",
    "ml": "@walk",
}


@register
def replicate_sections(result: ReplicateComparison) -> tuple[Section, ...]:
    """Show the parameters of several runs, pooled and apart."""
    judged = [p for p in result.parameters if p.agree is not None]
    agreeing = sum(bool(p.agree) for p in judged)
    facts = Facts(
        (
            ("Runs", str(len(result.names))),
            ("Methods agree on", f"{agreeing} of {len(judged)} parameters"),
            (
                "Runs share one value of",
                f"{sum(p.shared for p in result.parameters)} of {len(result.parameters)}",
            ),
        )
    )
    findings = Findings(
        tuple(
            Finding("warning" if "methods differ" in text else "info", _spoken(text))
            for text in result.findings
        )
    )
    white = [p for p in result.parameters if p.parameter == "white_noise.density"]
    rest = [p for p in result.parameters if p.parameter != "white_noise.density"]
    blocks: list[Block] = [facts, _figures(white, result.names), _table(result), findings]
    if rest:
        blocks.insert(2, _figures(rest, result.names))
    short = tuple(f"{t[:1].upper()}{t[1:]}." for t in result.findings if " of " in t[-24:])
    return (Section("Runs pooled and apart", tuple(blocks), short[:2]),)


def _spoken(text: str) -> str:
    channel, colon, rest = text.partition(": ")
    return f"{shown_name(channel)}: {rest}" if colon and "_" in channel else text


def _figures(parameters: list[PooledParameter], names: tuple[str, ...]) -> FigureGrid:
    methods = list(dict.fromkeys(m for p in parameters for m in p.pooled))
    figures = [_figure(p, names, methods) for p in parameters]
    legend = [LegendItem(m, COLOURS.get(m, "@other"), "point") for m in methods]
    return FigureGrid(
        tuple(figures),
        tuple(legend),
        columns=3,
        caption="Every run with its standard error (twice, as bars; those that say next to nothing "
        "may leave the picture); the last place is the pooled value.",
    )


def _figure(p: PooledParameter, names: tuple[str, ...], methods: list[str]) -> Figure:
    words, unit, factor = quantity(p.parameter, p.channel)
    traces: list[dict[str, Any]] = []
    ends: list[float] = []
    for k, method in enumerate(m for m in methods if m in p.pooled):
        pooled = p.pooled[method]
        values = [(math.nan, 0.0) if r is None else r for r in p.runs[method]]
        values.append((pooled.value, pooled.standard_error))
        place = np.arange(1, len(values) + 1) + 0.14 * (k - 0.5 * (len(p.pooled) - 1))
        y = np.array([v for v, _ in values]) / factor
        error = np.array([e for _, e in values]) / factor
        bar = 2.0 * np.minimum(error, np.abs(y))
        colour = COLOURS.get(method, "@other")
        trace = marks(place, y, colour, method, size=5)
        trace["error_y"] = {
            "type": "data",
            "array": encode(np.nan_to_num(bar)),
            "color": colour,
            "thickness": 1.2,
            "width": 0,
        }
        traces.append(trace)
        sure = error < 0.4 * np.abs(y)
        ends += [*(y - bar)[sure], *(y + bar)[sure]]
    ticks = {"tickvals": list(range(1, len(names) + 2)), "ticktext": [*_short(names), "all"]}
    return plot(
        f"{shown_name(p.channel)}: {words}",
        f"{words} of every run by {', '.join(p.pooled)}.",
        traces,
        axis("run", limits=(0.4, len(names) + 1.6)) | ticks,
        axis(f"{words}{unit and f' in {unit}'}", limits=limits(ends or [0.0, 1.0])),
        height=230,
    )


def _short(names: tuple[str, ...]) -> list[str]:
    """Number of each run: names would not fit below a small plot."""
    return [str(k + 1) for k in range(len(names))]


def _table(result: ReplicateComparison) -> Table:
    methods = list(dict.fromkeys(m for p in result.parameters for m in p.pooled))
    rows: list[tuple[str, ...]] = []
    label = ""
    for p in result.parameters:
        words, unit, factor = quantity(p.parameter, p.channel)
        cells = []
        for method in methods:
            found = p.pooled.get(method)
            cells.append(
                MISSING
                if found is None
                else compact_with_error(found.value / factor, found.standard_error / factor)
            )
        least = min(a.p_value for a in p.pooled.values())
        between = max(a.between for a in p.pooled.values())
        verdict = MISSING if p.agree is None else ("yes" if p.agree else "no")
        new = shown_name(p.channel)
        rows.append(
            (
                new if new != label else "",
                words,
                unit,
                *cells,
                number(p.worst, 2) if p.worst_pair else MISSING,
                verdict,
                probability(least),
                f"{number(100.0 * between, 2)} %",
            )
        )
        label = new
    return Table(
        "Pooled over the runs, the standard error of the last digits in brackets",
        (
            "channel",
            "parameter",
            "unit",
            *methods,
            "apart",
            "methods agree",
            "p of one value",
            "run to run",
        ),
        tuple(rows),
        words=(0, 1, 2),
        note="Apart: largest difference of two methods in combined standard deviations, the "
        "scatter from run to run counted in. p of one value: the smallest, over the methods, of "
        "the probabilities that runs with one true value scatter so much. Run to run: how much "
        "the value moves beyond its errors (the largest over the methods).",
    )
