"""The papers done again: printed beside ours, with the verdict in colour and words."""

from __future__ import annotations

import math
from typing import Any, Literal

import numpy as np

from schuler.report import (
    MISSING,
    Block,
    Chip,
    Chips,
    Dash,
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
    anchor,
    axis,
    band,
    duration,
    limits,
    line,
    marks,
    register,
)
from schuler_papers.experiment import FloatArray
from schuler_papers.outcome import VERDICTS, Curve, Panel, Row
from schuler_papers.registry import PAPERS, Paper
from schuler_papers.reproduction import ItemResult, Reproduction
from schuler_papers.wording import (
    SIGNS,
    band_text,
    counts_of,
    detail_text,
    own_text,
    printed_text,
    sheet_lines,
    source_text,
    verdict_of_item,
)

TONES: dict[str, Tone] = {
    "outside its band": "failed",
    "wrong in the paper": "wrong",
    "not met": "cannot",
    "reproduced in kind": "kind",
    "reproduced": "good",
    "beyond the paper": "beyond",
    "shown": "plain",
    "setting": "plain",
}
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


@register
def reproduction_sections(result: Reproduction) -> tuple[Section, ...]:
    """Show papers done again."""
    papers = [p for p in PAPERS.values() if any(r.paper.name == p.name for r in result.items)]
    sections = [_overview(result, papers)] if len(papers) > 1 or result.left_out else []
    return (*sections, *(_paper(result, paper) for paper in papers))


def _judged(row: Row) -> Judged:
    return Judged(
        row.quantity,
        printed_text(row),
        own_text(row),
        band_text(row.band),
        row.verdict,
        TONES[row.verdict],
        detail_text(row),
        source_text(row),
    )


def _anchor(result: ItemResult) -> str:
    return f"{result.paper.name}-{anchor(result.item.label)}"


def _chips(items: list[ItemResult]) -> Chips:
    chips = []
    for result in items:
        verdict = verdict_of_item(result.outcome)
        chips.append(Chip(result.item.label, _anchor(result), TONES[verdict], verdict))
    used = {chip.verdict for chip in chips}
    return Chips(tuple(chips), tuple((TONES[v], v) for v in TONES if v in used))


def _overview(result: Reproduction, papers: list[Paper]) -> Section:
    everything = counts_of(result.items)
    by_paper = [counts_of([r for r in result.items if r.paper.name == p.name]) for p in papers]
    rows: list[tuple[str, ...]] = [
        (verdict, *(str(c.verdicts[verdict] or MISSING) for c in by_paper), meaning)
        for verdict, meaning in VERDICTS.items()
        if everything.verdicts[verdict]
    ]
    counted = (
        ("values inside their band", [f"{c.inside} of {c.banded}" for c in by_paper], ""),
        ("printed numbers met", [f"{c.met} of {c.printed}" for c in by_paper], ""),
        (
            "of these narrow ones",
            [f"{c.close} of {c.narrow}" for c in by_paper],
            "compared within a quarter, or within their own printed error",
        ),
        ("arithmetic", [str(c.kinds["arithmetic"]) for c in by_paper], "on printed numbers"),
    )
    rows += [(name, *cells, meaning) for name, cells, meaning in counted]
    costs = [
        sum(e.cpu_seconds for (name, _), e in result.efforts.items() if name == paper.name)
        for paper in papers
    ]
    rows.append(("CPU time", *map(duration, costs), ""))
    blocks: list[Block] = [
        Prose(
            "Each experiment of the papers is built out of this library and run on simulated data "
            "with known truth (a twin of each sensor), because the recordings of the papers are "
            "private. What came out stands beside what is printed. Verdicts are computed from "
            "both, the standard error and a band in which ours has to lie, whose origin is named; "
            "nobody writes them. Labels such as E-000-9 count what looked like a slip in a paper."
        ),
        Table(
            f"{everything.values} values, by verdict",
            ("", *(paper.short for paper in papers), "meaning"),
            tuple(rows),
            words=(0, 1 + len(papers)),
        ),
    ]
    if result.left_out:
        blocks.append(
            Findings(tuple(Finding("info", f"Left out: {text}") for text in result.left_out))
        )
    return Section("Overview", tuple(blocks), (everything.sentence,))


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
        _chips(items),
    ]
    for r in items:
        blocks += _item(r)
    said = counts_of(items).sentence
    return Section(paper.authors, tuple(blocks), (f"{paper.authors}: {said}",))


def _item(result: ItemResult) -> list[Block]:
    """One item: rows that stand in no table of the paper, the tables, the figures."""
    outcome = result.outcome
    inside = {id(cell) for s in outcome.sheets for cells in s.cells for cell in cells}
    rows = tuple(_judged(row) for row in outcome.rows if id(row) not in inside)
    item = result.item
    blocks: list[Block] = [
        Judgement(item.label, item.title, item.claim, _anchor(result), rows, outcome.notes)
    ]
    blocks += [
        Table(
            sheet.title,
            (sheet.corner, "", *sheet.columns),
            tuple(sheet_lines(sheet)),
            words=(0, 1),
            note=SIGNS,
        )
        for sheet in outcome.sheets
    ]
    if outcome.panels:
        blocks.append(_figures(outcome.panels))
    return blocks


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
        x |= {"ticklabeloverflow": "allow"}  # a narrow page hides the last name else
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
