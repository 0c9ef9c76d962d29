"""The papers done again: printed beside ours, with the verdict in colour and words."""

from __future__ import annotations

import math
from collections import Counter
from typing import Any, Literal

import numpy as np

from schuler.report.blocks import (
    Block,
    Chip,
    Chips,
    Facts,
    Figure,
    FigureGrid,
    Finding,
    Findings,
    Judged,
    Judgement,
    LegendItem,
    Prose,
    Section,
    Table,
    Tone,
)
from schuler.report.figures import Dash, axis, band, limits, line, marks
from schuler.report.numbers import MISSING, duration, with_error
from schuler.report.page import anchor
from schuler.report.sections.registry import register
from schuler.types import FloatArray
from schuler_papers.outcome import Band, Curve, Outcome, Panel, Row
from schuler_papers.registry import PAPERS, Paper
from schuler_papers.reproduction import ItemResult, Reproduction

TONES: dict[str, Tone] = {
    "outside its band": "failed",
    "wrong in the paper": "wrong",
    "cannot be expected": "cannot",
    "reproduced in kind": "kind",
    "reproduced": "good",
    "beyond the paper": "beyond",
}
"""Verdicts, the gravest first."""
_COLOURS = {
    "printed": "@mark",
    "ours": "@data",
    "theory": "@model",
    "paper": "@walk",
    "better": "@z",
    "data": "@gnss",
    "x": "@x",
    "y": "@y",
    "z": "@z",
    "other": "@other",
}
_LegendMark = Literal["line", "dash", "dot", "band", "point", "diamond"]
_LEGEND_MARKS: dict[str, _LegendMark] = {
    "line": "line",
    "dash": "dash",
    "points": "point",
    "band": "band",
}
_SOURCES = {"spec": "specification", "theory": "theory", "frozen": "first full run"}
_SUPERSCRIPT = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


@register
def reproduction_sections(result: Reproduction) -> tuple[Section, ...]:
    """Show papers done again."""
    papers = [p for p in PAPERS.values() if any(r.paper.name == p.name for r in result.items)]
    sections = [_overview(result, papers)] if len(papers) > 1 or result.left_out else []
    return (*sections, *(_paper(result, paper) for paper in papers))


def verdict_of(row: Row) -> str:
    """Return the verdict of a row, or that it lies outside its band."""
    return row.verdict if row.holds else "outside its band"


def verdict_of_item(outcome: Outcome) -> str:
    """Return the verdict of the main claim, which stands first, unless a value is off."""
    if not outcome.holds:
        return "outside its band"
    claims = [row.verdict for row in outcome.rows if row.verdict != "beyond the paper"]
    return claims[0] if claims else "beyond the paper"


def slips_of(outcome: Outcome) -> str:
    """Return the labels of the slips that the rows of an item prove."""
    return ", ".join(sorted({row.erratum for row in outcome.rows if row.erratum}))


def printed_text(row: Row) -> str:
    """Return the printed value as a person would write it."""
    if row.printed is None:
        return MISSING
    if isinstance(row.printed, str):
        return row.printed
    return _with_unit(_short(row.printed), row.unit)


def _short(value: float, digits: int = 4) -> str:
    """A number without needless zeros, as papers print it."""
    mantissa, _, power = f"{value:.{digits}g}".partition("e")
    text = mantissa if not power else f"{mantissa}·10{str(int(power)).translate(_SUPERSCRIPT)}"
    return text.replace("-", "−")


def own_text(row: Row) -> str:
    """Return what came out, with its standard error and unit."""
    if isinstance(row.ours, str):
        return row.ours
    value, error = row.estimate
    if not error > 1e-6 * abs(value):  # nothing is random, or the same in every repetition
        return _with_unit(_short(value), row.unit)
    return _with_unit(with_error(value, error), row.unit)


def band_text(limits_: Band | None) -> str:
    """Return a band in words."""
    if limits_ is None:
        return MISSING
    low, high = limits_.low, limits_.high
    if low == high:
        return f"exactly {_short(low)}"
    if math.isinf(high):
        return f"above {_short(low)}" if low > 5e-324 else "above 0"
    if math.isinf(low):
        return f"below {_short(high)}"
    if _short(low) == _short(high):
        return f"{_short(0.5 * (low + high))} ± {_short(0.5 * (high - low), 1)}"
    return f"{_short(low)} to {_short(high)}"


def _with_unit(text: str, unit: str) -> str:
    return f"{text} {unit}" if unit else text


def _judged(row: Row) -> Judged:
    verdict = verdict_of(row)
    detail = f"{row.reason} ({row.erratum})" if row.erratum and row.reason else row.reason
    source = ""
    if row.band is not None:
        source = _SOURCES[row.band.source]
        source += f": {row.band.note}" if row.band.note else ""
        if row.band.standard_errors:
            source += f", ± {row.band.standard_errors:g} standard errors"
    return Judged(
        row.quantity,
        printed_text(row),
        own_text(row),
        band_text(row.band),
        verdict,
        TONES[verdict],
        detail or row.erratum,
        source,
    )


def _anchor(result: ItemResult) -> str:
    return f"{result.paper.name}-{anchor(result.item.label)}"


def _chips(items: list[ItemResult], legend: bool) -> Chips:
    chips = []
    for result in items:
        verdict = verdict_of_item(result.outcome)
        chips.append(Chip(result.item.label, _anchor(result), TONES[verdict], verdict))
    used = {chip.tone for chip in chips}
    words = tuple((tone, verdict) for verdict, tone in TONES.items() if tone in used)
    return Chips(tuple(chips), words if legend else ())


def _counts(items: list[ItemResult]) -> Counter[str]:
    return Counter(verdict_of(row) for result in items for row in result.outcome.rows)


def _overview(result: Reproduction, papers: list[Paper]) -> Section:
    everything = _counts(list(result.items))
    by_paper = [_counts([r for r in result.items if r.paper.name == p.name]) for p in papers]
    rows = [
        (verdict, *(str(c[verdict]) if c[verdict] else MISSING for c in by_paper))
        for verdict in reversed(TONES)
        if everything[verdict]
    ]
    costs = [
        sum(e.cpu_seconds for (name, _), e in result.efforts.items() if name == paper.name)
        for paper in papers
    ]
    rows.append(("CPU time", *map(duration, costs)))
    total, failed = sum(everything.values()), everything["outside its band"]
    blocks: list[Block] = [
        Prose(
            "Each experiment of the papers is built out of this library and run on simulated data "
            "with known truth, because the recordings of the papers are private. What came out "
            "stands beside what is printed, with the band in which it has to lie."
        ),
        Table(
            f"{total} values, by verdict",
            ("", *(f"{paper.name} ({paper.label})" for paper in papers)),
            tuple(rows),
        ),
    ]
    if result.left_out:
        blocks.append(
            Findings(tuple(Finding("info", f"Left out: {text}") for text in result.left_out))
        )
    sentence = f"{total} values of {len(papers)} papers were computed again; "
    sentence += f"{failed} lie outside their bands." if failed else "all lie in their bands."
    return Section("Overview", tuple(blocks), (sentence,))


def _paper(result: Reproduction, paper: Paper) -> Section:
    items = [r for r in result.items if r.paper.name == paper.name]
    efforts = {name: e for (owner, name), e in result.efforts.items() if owner == paper.name}
    most = max(e.repetitions for e in efforts.values())
    cost = sum(e.cpu_seconds for e in efforts.values())
    blocks: list[Block] = [
        Prose(f"{paper.title}. {paper.journal}."),
        Facts(
            (
                ("size", result.size),
                ("tables, figures, equations, slips", str(len(items))),
                ("most repetitions", str(most)),
                ("CPU time", duration(cost)),
            )
        ),
        _chips(items, legend=True),
    ]
    for r in items:
        o = r.outcome
        blocks.append(
            Judgement(
                r.item.label,
                r.item.title,
                r.item.claim,
                _anchor(r),
                tuple(_judged(row) for row in o.rows),
                o.notes,
            )
        )
        if o.panels:
            blocks.append(_figures(o.panels))
    counts = _counts(items)
    said = ", ".join(f"{counts[v]} {v}" for v in reversed(TONES) if counts[v])
    return Section(f"{paper.authors}, {paper.label}", tuple(blocks), (f"{paper.authors}: {said}.",))


def _figures(panels: tuple[Panel, ...]) -> FigureGrid:
    legend: dict[tuple[str, str, _LegendMark], None] = {}
    for panel in panels:
        for curve in panel.curves:
            mark = _LEGEND_MARKS[curve.mark]
            if curve.role == "printed" and curve.mark == "points":
                mark = "diamond"
            shade = "/0.2" if curve.mark == "band" else ""
            legend[curve.name, _COLOURS[curve.role] + shade, mark] = None
    return FigureGrid(
        tuple(_figure(panel) for panel in panels),
        tuple(LegendItem(*entry) for entry in legend),
        columns=3 if len(panels) > 2 else 2,
    )


def _figure(panel: Panel) -> Figure:
    traces: list[dict[str, Any]] = []
    shown_y: list[FloatArray] = []
    shown_x: list[FloatArray] = []
    for curve in panel.curves:
        traces += _traces(curve)
        shown_x.append(np.asarray(curve.x, dtype=np.float64))
        shown_y += [
            np.asarray(v, dtype=np.float64)
            for v in (curve.y, curve.lower, curve.upper)
            if v is not None
        ]
    x = axis(panel.x, log=panel.log_x, limits=limits(*shown_x, log=panel.log_x, margin=0.03))
    if panel.categories:
        last = len(panel.categories) - 1
        x = axis(panel.x, limits=(-0.5, last + 0.5))
        x |= {"tickvals": list(range(last + 1)), "ticktext": list(panel.categories)}
    y = axis(panel.y, log=panel.log_y, limits=limits(*shown_y, log=panel.log_y))
    if panel.log_y:
        y |= _sparse_decades(*shown_y)
    height = 340 if panel.categories and max(map(len, panel.categories)) > 6 else 290
    return Figure(
        panel.title, panel.description, tuple(traces), {"xaxis": x, "yaxis": y}, height=height
    )


def _sparse_decades(*values: FloatArray) -> dict[str, Any]:
    low, high = limits(*values, log=True)
    decades = math.log10(high / low)
    return {"dtick": max(1, math.ceil(decades / 6.0))} if decades > 6.0 else {}


def _traces(curve: Curve) -> list[dict[str, Any]]:
    colour = _COLOURS[curve.role]
    if curve.mark == "band":
        assert curve.lower is not None
        assert curve.upper is not None
        return band(curve.x, curve.lower, curve.upper, f"{colour}/0.2", curve.name)
    if curve.mark == "points":
        symbol = "diamond-open" if curve.role == "printed" else "circle"
        trace = marks(curve.x, curve.y, colour, curve.name, size=8.0, symbol=symbol)
        if curve.lower is not None and curve.upper is not None:
            y = np.asarray(curve.y, dtype=np.float64)
            trace["error_y"] = {
                "type": "data",
                "symmetric": False,
                "array": (np.asarray(curve.upper) - y).tolist(),
                "arrayminus": (y - np.asarray(curve.lower)).tolist(),
                "color": colour,
                "thickness": 1.4,
                "width": 4,
            }
        return [trace]
    dash: Dash = "dash" if curve.mark == "dash" else "solid"
    return [line(curve.x, curve.y, colour, curve.name, dash=dash, width=1.8)]
