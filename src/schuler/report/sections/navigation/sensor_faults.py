"""Sensors of an array that the filter did without: who, when, why, until when."""

from __future__ import annotations

from typing import Any

from schuler.report.blocks import Block, Figure, FigureGrid, Finding, Findings, LegendItem, Section
from schuler.report.figures import axis, line
from schuler.report.makers import plot, remarks

TITLES = {"gyro": "gyro", "accel": "accelerometer"}


def sensor_fault_sections(told: dict[str, Any], begin: float, end: float) -> tuple[Section, ...]:
    """Show what a run says of its sensors; nothing where it says nothing."""
    out, against, silent = told["taken_out"], told["contradictions"], told["silent"]
    if not told["judged"] and not silent:
        return ()
    # faults are told with the condition of the drive
    lines = [Finding("info", f"{s['name']} was silent from {s['text']}.") for s in silent]
    good = () if out or against or silent else (Finding("good", "No sensor was taken out."),)
    said = (*remarks(told["notes"]), *lines, *good)
    blocks: tuple[Block, ...] = (Findings(said),) if said else ()
    if out or silent:
        blocks = (*blocks, _time_line(told, begin, end))
    names = list(dict.fromkeys(_who(f) for f in out))
    sentence = "All sensors of the array were used throughout."
    if names:
        sentence = f"The filter did without {', '.join(names)} while faulty."
    elif silent:
        sentence = "The filter did without IMUs that were silent."
    return (Section("Sensors in use", blocks, (sentence,)),)


def _who(fault: dict[str, Any]) -> str:
    return f"{TITLES[fault['sensor']]} {fault['name']}"


def _time_line(told: dict[str, Any], begin: float, end: float) -> FigureGrid:
    """One line for each IMU and kind of sensor that was out for a while."""
    rows: dict[str, list[tuple[float, float, str, str]]] = {}
    for fault in told["taken_out"]:
        name = _who(fault)
        stop = end if fault["stop_s"] is None else min(fault["stop_s"], end)
        bars = rows.setdefault(name, [])
        bars.append((fault["onset_s"], fault["start_s"], "@white", "not noticed yet"))
        bars.append((fault["start_s"], stop, "@error", "faulty"))
    for gap in told["silent"]:
        rows.setdefault(gap["name"], []).append((gap["start_s"], gap["stop_s"], "@soft", "silent"))
    names = sorted(rows, reverse=True)
    traces = [
        line([begin, end], [place, place], "@good", f"{name} in use", width=2.0)
        for place, name in enumerate(names)
    ]
    traces += [
        line([max(a, begin), min(b, end)], [place, place], colour, f"{name} {what}", width=12.0)
        for place, name in enumerate(names)
        for a, b, colour, what in rows[name]
    ]
    ticks = {"tickvals": list(range(len(names))), "ticktext": names}
    figure: Figure = plot(
        "Sensors that were out",
        "When each sensor was used, and when it was out",
        traces,
        axis("time in s", limits=(begin, end)),
        axis("", limits=(-0.6, len(names) - 0.4)) | ticks,
    )
    legend = (
        LegendItem("in use", "@good"),
        LegendItem("out, back to the onset", "@white"),
        LegendItem("out since it was noticed", "@error"),
        *((LegendItem("silent", "@soft"),) if told["silent"] else ()),
    )
    return FigureGrid((figure,), legend, columns=1)
