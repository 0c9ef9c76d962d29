"""A fleet: pooled values, sensors that stand out, trends, drives, failures."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from schuler.estimation.ieee952 import KEYS
from schuler.fleet.database import Measurement
from schuler.fleet.summary import FleetSummary
from schuler.noise.parameter_names import parameter_kind
from schuler.report.blocks import Block, Facts, FigureGrid, Finding, Findings, Section, Table
from schuler.report.figures import axis, marks
from schuler.report.makers import plot
from schuler.report.numbers import MISSING, compact_with_error, number, percent
from schuler.report.sections.recording import pretty
from schuler.report.sections.registry import register
from schuler.units import kind_of, scale

Rows = tuple[tuple[str, ...], tuple[tuple[str, ...], ...]]
"""Column headings and rows."""
DRIVE_FIGURES = ("causal mean of maxima", "causal inside 2 sigma", "smoothed mean of maxima",
                 "smoothed inside 2 sigma")  # fmt: skip
MOST_UNITS = 60
"""Sensors of a picture; the best of more are left out."""


@register
def fleet_sections(result: FleetSummary) -> tuple[Section, ...]:
    """Show what a database says of a fleet."""
    units = {(p.sensor, p.axis): p.units for p in result.parameters if p.name == "N"}
    facts = Facts(
        (
            ("Logs", str(result.logs)),
            ("Sensors", str(max(units.values(), default=0))),
            ("Drives", str(len(result.drives))),
            ("Failed", str(len(result.failures))),
            ("Sensors that stand out", str(len({o.serial for o in result.outliers}))),
        )
    )
    blocks: list[Block] = [facts, Findings(_findings(result))]
    if len(result.worst) > 1:
        blocks.append(_ranking(result))
    for title, (columns, rows) in (
        ("Pooled coefficients", parameter_rows(result)),
        ("Sensors that stand out", outlier_rows(result)),
        ("Trends", trend_rows(result)),
        ("Drives, the worst first", drive_rows(result)),
        ("Logs that failed", failure_rows(result)),
    ):
        if rows:
            words = (0, 1) if columns[-1] == "why" else (0,)
            blocks.append(Table(title, columns, tuple(rows), words, folded=len(rows) > 40))
    return (Section("The fleet", tuple(blocks), _short(result)),)


def _short(result: FleetSummary) -> tuple[str, ...]:
    white = [p for p in result.parameters if p.name == "N" and p.units > 1]
    apart = sum(not p.shared for p in white)
    lines = [_done(result)]
    if white:
        lines.append(
            f"White noise differs from sensor to sensor beyond its errors on {apart} of "
            f"{len(white)} axes."
            if apart
            else "One white noise an axis describes all sensors."
        )
    standing = sorted({o.serial for o in result.outliers})
    ageing = sorted({t.serial for t in result.trends if t.serial})
    for verb, who in (("Standing out", standing), ("Changing with time", ageing)):
        if who:
            more = f" and {len(who) - 6} more" if len(who) > 6 else ""
            lines.append(f"{verb}: {', '.join(who[:6])}{more}.")
    errors = [float(e) for d in result.drives if (e := d.get(DRIVE_FIGURES[0])) is not None]
    if errors:
        spread = " to ".join(dict.fromkeys(number(e) for e in (min(errors), max(errors))))
        lines.append(
            f"In outages of GNSS the drives were off by {spread} m at most (causal, mean over the "
            "outages of a drive)."
        )
    return tuple(lines)


def _done(result: FleetSummary) -> str:
    """Tell how many logs of what kind were measured."""
    drives, failed = len(result.drives), len(result.failures)
    static = result.logs - drives - failed
    kinds = [
        f"{n} {what}{'s' if n > 1 else ''}"
        for n, what in ((static, "static log"), (drives, "drive"))
        if n
    ]
    lost = f"; {failed} could not be used" if failed else ""
    return f"Of {result.logs} logs {' and '.join(kinds) or 'none'} were measured{lost}."


def _findings(result: FleetSummary) -> tuple[Finding, ...]:
    found: dict[str, list[str]] = defaultdict(list)
    for one in result.outliers:
        found[one.serial].append(f"{one.name} of {one.axis} is {one.ratio:.3g} times the fleet's")
    items = [Finding("warning", f"{serial}: {'; '.join(t[:4])}.") for serial, t in found.items()]
    if items:
        return tuple(items)
    several = any(p.units > 1 for p in result.parameters)
    fine = Finding("good", "No sensor stands out.")
    return (fine if several else Finding("info", "No two sensors at rest to compare."),)


def _ranking(result: FleetSummary) -> FigureGrid:
    figures = []
    for kind in dict.fromkeys(sensor for sensor, _, _ in result.worst):
        ranked = [(u, r) for s, u, r in result.worst if s == kind][:MOST_UNITS]
        place = np.arange(1, len(ranked) + 1)
        trace = marks(place, [r for _, r in ranked], "@white", "white noise", size=7)
        trace |= {"text": [u for u, _ in ranked], "hovertemplate": "%{text}: %{y:.3g}"}
        title = f"White noise of {kind}" if kind else "White noise by sensor"
        figures.append(
            plot(
                title,
                "White noise of the loudest axis over the median of the fleet, the worst first.",
                [trace],
                axis("sensor, the worst first")
                | {"tickvals": place.tolist(), "ticktext": [u for u, _ in ranked]},
                axis("times the fleet's median"),
            )
        )
    return FigureGrid(tuple(figures), (), 1, "The loudest axis of every sensor.")


def _scaled(channel: str, name: str) -> tuple[str, float]:
    kind = parameter_kind(channel, KEYS[name]) or ""
    unit = kind_of(kind).datasheet
    return pretty(unit), scale(unit, kind)


def parameter_rows(fleet: FleetSummary) -> Rows:
    """Return the pooled coefficients, each with how far the sensors differ."""
    rows = []
    for p in fleet.parameters:
        unit, size = _scaled(p.axis, p.name)
        spread = MISSING if p.units < 2 else percent(p.spread)
        shared = MISSING if math.isnan(p.p_value) else ("yes" if p.shared else "no")
        value = compact_with_error(p.value / size, p.standard_error / size)
        count = f"{p.logs}" + (f" (+{p.unseen} below)" if p.unseen else "")
        rows.append((p.sensor, p.axis, p.name, value, unit, spread, shared, str(p.units), count))
    columns = ("kind", "axis", "figure", "pooled", "unit", "spread", "one value", "sensors", "logs")
    return columns, tuple(rows)


def history_rows(history: Sequence[Measurement]) -> Rows:
    """Return what was measured of a sensor, by coefficient and then by date."""
    rows = []
    names = [n for n in KEYS if any(m.name == n for m in history)]
    order = sorted(history, key=lambda m: (m.axis, names.index(m.name) if m.name in names else -1))
    for m in order:
        warm = MISSING if m.temperature is None else f"{m.temperature:g}"
        unit, size = _scaled(m.axis, m.name) if m.name in KEYS else ("", 1.0)
        if m.value is not None and m.standard_error is not None:
            value = compact_with_error(m.value / size, m.standard_error / size)
        elif m.value is not None:
            value = number(m.value / size)
        else:
            value = MISSING if m.upper_limit is None else f"< {number(m.upper_limit / size)}"
        rows.append((m.axis, m.name, m.date or MISSING, warm, value, unit))
    return ("axis", "figure", "date", "°C", "value", "unit"), tuple(rows)


def outlier_rows(fleet: FleetSummary) -> Rows:
    """Return the sensors that stand out."""
    return ("sensor that stands out", "axis", "figure", "times the fleet's", "p"), tuple(
        (o.serial, o.axis, o.name, number(o.ratio), number(o.p_value, 1)) for o in fleet.outliers
    )


def trend_rows(fleet: FleetSummary) -> Rows:
    """Return what changes with time or temperature."""
    return ("trend", "axis", "figure", "change", "p"), tuple(
        (
            t.serial or f"all {t.sensor}".strip(),
            t.axis,
            t.name,
            f"{100 * t.slope:+.3g} ± {100 * t.standard_error:.2g} % a {t.per}",
            number(t.p_value, 1),
        )
        for t in fleet.trends
    )


def drive_rows(fleet: FleetSummary) -> Rows:
    """Return the drives."""
    files = [Path(str(d["file"])) for d in fleet.drives]
    alike = len({f.name for f in files}) < len(files)
    rows = []
    for file, drive in zip(files, fleet.drives, strict=True):
        cells = [drive.get(n) for n in DRIVE_FIGURES]
        shown = [
            MISSING if c is None else percent(c) if "inside" in n else f"{number(c)} m"
            for n, c in zip(DRIVE_FIGURES, cells, strict=True)
        ]
        name = f"{file.parent.name}/{file.name}" if alike else file.name
        rows.append((name, str(drive["serial"]), *shown))
    columns = ("causal error", "inside 2 sigma", "smoothed error", "inside 2 sigma")
    return ("drive", "serial", *columns), tuple(rows)


def failure_rows(fleet: FleetSummary) -> Rows:
    """Return why logs failed; those of one reason stand together."""
    logs: dict[str, list[str]] = defaultdict(list)
    for file, why in fleet.failures:
        name = Path(file).name
        logs[why.removeprefix(f"{file}: ").removeprefix(f"{name}: ")].append(name)
    return ("log", "why"), tuple((", ".join(names), why) for why, names in logs.items())
