"""Mechanizations of one array side by side: errors, claims, outages, biases of every sensor."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from schuler.data.trajectory import NavigationSolution
from schuler.evaluation.mechanizations import (
    COMPONENTS,
    MechanizationComparison,
    MechanizationResult,
)
from schuler.report.blocks import (
    Figure,
    FigureGrid,
    Finding,
    Findings,
    LegendItem,
    Prose,
    Section,
    Table,
)
from schuler.report.figures import axis, limits, line, marks
from schuler.report.makers import plot
from schuler.report.numbers import number
from schuler.report.sections.registry import register
from schuler.types import FloatArray

COLOURS = {
    "single": "@gnss",
    "synthetic": "@causal",
    "extended": "@smoothed",
    "constrained": "@model",
    "system": "@z",
}
WORDS = {
    "single": "every IMU by itself, with all of GNSS",
    "synthetic": "fused by least squares before the filter",
    "extended": "fused, with the errors of every sensor as states; parity tells them apart",
    "constrained": "a solution for each IMU in one filter, tied by the rigid body; GNSS used once",
    "system": "finished solutions averaged, after a vote",
}


@register
def mechanization_sections(comparison: MechanizationComparison) -> tuple[Section, ...]:
    """Show the comparison of mechanizations."""
    sections = [_overview(comparison)]
    if comparison.windows:
        sections.append(_outages(comparison))
    sections.append(_uncertainty(comparison))
    sections.append(_biases(comparison))
    return tuple(sections)


def comparison_rows(
    comparison: MechanizationComparison,
) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return headings and cells of the table that the terminal shows as well."""
    truth = not np.isnan(comparison.results[0].rms).all()
    columns = ["mechanization", "states", "NIS a degree", "claimed sd, m", "heading sd, deg"]
    if truth:
        columns += ["position error, m", "velocity, m/s", "tilt, deg", "heading, deg"]
    if comparison.windows:
        columns += ["outages, mean of max, m", "claimed there, m", "inside 2 sd"]
    columns.append("CPU µs a sample")
    rows = []
    for r in comparison.results:
        cells = [
            r.label,
            str(r.navigation.states),
            number(r.solution.innovations.gnss.mean_nis),
            number(float(np.hypot(r.claimed[0], r.claimed[1]))),
            number(float(np.degrees(r.claimed[8]))),
        ]
        if truth:
            cells += [
                number(float(np.linalg.norm(r.rms[:3]))),
                number(float(np.linalg.norm(r.rms[3:6]))),
                number(float(np.degrees(np.linalg.norm(r.rms[6:8])))),
                number(float(np.degrees(r.rms[8]))),
            ]
        if r.outages is not None:
            claimed = float(np.mean([w.claimed_sd_m for w in r.outages.windows]))
            share = float(np.mean([w.within_2_sigma for w in r.outages.windows]))
            cells += [number(r.outages.mean_of_max_m), number(claimed), f"{100.0 * share:.0f} %"]
        cells.append(number(1e6 * r.navigation.cpu_seconds / r.solution.trajectory.size))
        rows.append(tuple(cells))
    return tuple(columns), rows


def _overview(comparison: MechanizationComparison) -> Section:
    columns, rows = comparison_rows(comparison)
    table = Table("Mechanizations of one array, from one preparation", columns, tuple(rows))
    present = dict.fromkeys(r.mechanization for r in comparison.results)
    meaning = Table(
        "What they are",
        ("mechanization", "how the IMUs are used"),
        tuple((name, WORDS[name]) for name in present),
        words=(0, 1),
    )
    blocks: list[Any] = [table]
    truth = not np.isnan(comparison.results[0].rms).all()
    if truth and {"single", "extended"} <= set(present):
        cells = []
        for name in present:
            if name != "single":
                less = 100.0 * comparison.reduction(name)
                cells.append((name, *(f"{v:.0f} %" for v in less)))
        blocks.append(
            Table(
                "Less error (root mean square) than the average single IMU",
                ("mechanization", *COMPONENTS),
                tuple(cells),
                note="1 - error / error of one: four equal independent IMUs reach 50 % at most.",
            )
        )
    notes = [Finding("info", note) for note in comparison.prepared.notes]
    for r in comparison.results:
        if r.navigation.vote is not None:
            shares = r.navigation.vote.share_outvoted
            notes += [
                Finding("warning", f"{name} is outvoted {100.0 * share:.1f} % of the time")
                for name, share in zip(comparison.prepared.array.names, shares, strict=True)
                if share > 0.0
            ]
    if notes:
        blocks.append(Findings(tuple(notes)))
    blocks.append(meaning)
    best = min(
        comparison.results,
        key=lambda r: (
            float(np.linalg.norm(r.rms[6:]))
            if truth
            else (r.outages.mean_of_max_m if r.outages else float(np.linalg.norm(r.claimed[:2])))
        ),
    )
    what = (
        "attitude error" if truth else "outage error" if comparison.windows else "claimed position"
    )
    return Section(
        "Mechanizations", tuple(blocks), (f"The smallest {what} is that of '{best.label}'.",)
    )


def _lines(comparison: MechanizationComparison) -> list[tuple[MechanizationResult, str]]:
    """One result a mechanization, the first single IMU for all."""
    seen: dict[str, MechanizationResult] = {}
    for r in comparison.results:
        seen.setdefault(r.mechanization, r)
    return [(r, COLOURS[name]) for name, r in seen.items()]


def _legend(comparison: MechanizationComparison) -> tuple[LegendItem, ...]:
    return tuple(LegendItem(r.label, colour) for r, colour in _lines(comparison))


def _outages(comparison: MechanizationComparison) -> Section:
    figures = []
    for k, (start, seconds) in enumerate(comparison.windows[:6]):
        traces, values = [], []
        for r, colour in _lines(comparison):
            assert r.outages is not None
            window = r.outages.windows[k]
            since = window.time - start
            traces.append(line(since, window.horizontal_m, colour, r.label, width=1.6))
            values.append(window.horizontal_m)
        figures.append(
            plot(
                f"{seconds:g} s from {start:g} s",
                "Horizontal error against the withheld fixes.",
                traces,
                axis("s without GNSS"),
                axis("m", limits=limits(*values)),
                height=260,
            )
        )
    rows = []
    for r in comparison.results:
        assert r.outages is not None
        cells = [f"{number(w.max_m)} ({number(w.claimed_sd_m)})" for w in r.outages.windows]
        rows.append((r.label, *cells))
    heads = tuple(f"{a:g}:{b:g}" for a, b in comparison.windows)
    table = Table(
        "Largest horizontal error in m, and the claimed standard deviation there",
        ("mechanization", *heads),
        tuple(rows),
    )
    return Section(
        "Outages",
        (FigureGrid(tuple(figures), _legend(comparison), columns=3), table),
        ("Fixes were withheld from all mechanizations alike and judge them afterwards.",),
    )


def _uncertainty(comparison: MechanizationComparison) -> Section:
    quantities: tuple[tuple[str, str, Callable[[NavigationSolution], FloatArray]], ...] = (
        ("Horizontal position", "m", lambda s: np.hypot(s.position_sd[:, 0], s.position_sd[:, 1])),
        ("Tilt", "deg", lambda s: np.degrees(np.hypot(s.attitude_sd[:, 0], s.attitude_sd[:, 1]))),
        ("Heading", "deg", lambda s: np.degrees(s.attitude_sd[:, 2])),
    )
    first = comparison.results[0].solution.trajectory.time[0]
    gnss_start = float(comparison.results[0].solution.innovations.gnss.time[0] - first)
    spans = tuple((gnss_start + a, gnss_start + a + b) for a, b in comparison.windows)
    figures = []
    for title, unit, of in quantities:
        traces, values = [], []
        for r, colour in _lines(comparison):
            value = of(r.solution)
            traces.append(
                line(r.solution.trajectory.time - first, value, colour, r.label, width=1.3)
            )
            values.append(value)
        figures.append(
            plot(
                title,
                "Claimed standard deviation over time.",
                traces,
                axis("time in s"),
                axis(unit, log=True, limits=limits(*values, log=True)),
                height=280,
                spans=spans,
            )
        )
    return Section(
        "Claimed uncertainty",
        (
            FigureGrid(
                tuple(figures),
                _legend(comparison),
                columns=3,
                caption="What each filter says of itself; the shaded stretches are without GNSS.",
            ),
        ),
    )


def _biases(comparison: MechanizationComparison) -> Section:
    names, found = comparison.biases()
    array = comparison.prepared.array
    figures = []
    for sensor, unit, factor in (("gyro", "deg/s", np.degrees(1.0)), ("accel", "m/s²", 1.0)):
        own = np.array([j for j, n in enumerate(names) if f" {sensor}_" in n])
        place = np.arange(own.size, dtype=float)
        traces, values = [], []
        shift = -0.2
        for label, colour in (
            *((r.label, COLOURS["single"]) for r in comparison.of("single")),
            *((n, COLOURS[n]) for n in ("extended", "constrained", "system") if n in found),
        ):
            value, sd = (factor * v[own] for v in found[label])
            known = np.isfinite(value)
            if not known.any():
                continue
            at = place[known] + (shift if label in COLOURS else -0.3)
            shift += 0.15 if label in COLOURS else 0.0
            traces.append(marks(at, value[known], colour, label, size=6))
            for x, y, s in zip(at, value[known], sd[known], strict=True):
                traces.append(line([x, x], [y - s, y + s], colour, label, width=1.2))
            values += [value[known] - sd[known], value[known] + sd[known]]
        if not values:
            continue
        ticks = [f"{1 + j // 6} {names[j][-1]}" for j in own]
        layout = {
            "xaxis": axis("IMU and axis", limits=(-0.7, own.size - 0.3))
            | {"tickvals": place.tolist(), "ticktext": ticks},
            "yaxis": axis(unit, limits=limits(*values)),
        }
        title = "Gyro biases at the end" if sensor == "gyro" else "Accelerometer biases at the end"
        described = f"{array.count} IMUs, three axes each; bars are one standard deviation."
        figures.append(Figure(title, described, tuple(traces), layout, height=300))
    legend = tuple(
        LegendItem("by itself" if n == "single" else n, COLOURS[n], "point")
        for n in ("single", "extended", "constrained", "system")
        if any(r.mechanization == n for r in comparison.results)
    )
    text = (
        "A single IMU finds its own biases from GNSS. The extended filter without parity knows "
        "only what they add up to; with parity it knows them one by one (S002, Figs 13 and 16)."
    )
    return Section(
        "Biases of every sensor",
        (
            FigureGrid(
                tuple(figures),
                legend,
                columns=1,
                caption="Bias estimates at the end of the run, axis by axis.",
            ),
            Prose(text),
        ),
    )
