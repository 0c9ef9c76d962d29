"""Lasting faults of gyros in motion: the log, the windows, what could be found."""

from __future__ import annotations

import numpy as np

from schuler.arrays.detection.lasting_faults import TITLES, LastingFaults
from schuler.report.blocks import Block, Facts, FigureGrid, LegendItem, Section, Table
from schuler.report.figures import axis, limits, line
from schuler.report.makers import log_blocks, plot, remarks, spoken
from schuler.report.numbers import number
from schuler.report.sections.registry import register
from schuler.units import format_value


@register
def lasting_fault_sections(result: LastingFaults) -> tuple[Section, ...]:
    """Show what windows of motion said of the gyros of an array."""
    records = result.records
    known = remarks(map(spoken, result.limits))
    normal = result.normal
    facts = Facts(
        (
            ("Windows", f"{result.statistic.size} of {normal.settings.window:g} s"),
            ("Scale left by calibration", f"{number(100.0 * normal.scale)} %"),
            ("Timing left", f"{number(1e6 * normal.timing)} µs"),
            ("Floor", format_value(normal.floor, "angular rate", digits=2)),
        )
    )
    lines = remarks((r.text for r in records), "warning")
    nothing = "No sensor is off for a window or longer."
    blocks: list[Block] = [*log_blocks(known, lines, nothing)]
    blocks += [facts, _motions(result), _figures(result)]
    sentence = (
        "No gyro of the array went astray in motion."
        if result.healthy
        else f"{len(records)} time{'' if len(records) == 1 else 's'} a gyro was off for a window "
        f"or longer, first {records[0].name} at {records[0].start:.1f} s."
    )
    return (Section("Lasting faults in motion", tuple(blocks), (sentence,)),)


def motion_rows(result: LastingFaults) -> list[tuple[str, ...]]:
    """Return what could be found in each class of motion, the last cell for the page alone."""
    rows: list[tuple[str, ...]] = []
    for motion, title in enumerate(TITLES):
        inside = result.motion == motion
        smallest = result.smallest_fault(motion)
        if smallest is None:
            continue
        rows.append(
            (
                title,
                str(int(inside.sum())),
                f"{number(100.0 * float(result.alarm[inside].mean()))} %",
                format_value(smallest, "angular rate", digits=2),
                str(int(result.normal.windows[motion])),
            )
        )
    return rows


def _motions(result: LastingFaults) -> Table:
    rows = [(title[0].upper() + title[1:], *cells) for title, *cells in motion_rows(result)]
    rate = number(100.0 * result.normal.settings.false_alarm_rate)
    return Table(
        "What could be found in which motion",
        ("Motion", "Windows", "With an alarm", "Found 95 times in 100", "Healthy windows"),
        tuple(rows),
        words=(0,),
        note=f"Thresholds come from the healthy windows, for alarms in {rate} % of windows without "
        "fault. The fault is one of a single axis, in half of the windows or more.",
    )


def _figures(result: LastingFaults) -> FigureGrid:
    time = 0.5 * (result.offsets.start + result.offsets.stop)
    excess, one = np.maximum(result.excess, 1e-3), np.ones(time.size)
    chi = result.statistic / result.normal.thresholds[result.motion, 0]
    spans = tuple((r.start, time[-1] if r.stop is None else r.stop) for r in result.records)
    test = plot(
        "Every window",
        "Largest likelihood and chi-square of every window over their thresholds",
        (
            line(time, np.maximum(chi, 1e-3), "@other", "all axes together", width=0.8),
            line(time, excess, "@data", "one axis or unit", width=1.0),
            line(time, one, "@error", "threshold", dash="dash"),
        ),
        axis("time in s"),
        axis("Over threshold", log=True, limits=limits(excess, chi, one, log=True)),
        spans=spans,
    )
    speed = np.degrees(result.offsets.speed)
    motion = plot(
        "Motion",
        "Mean rate of every window",
        (line(time, speed, "@data", "mean rate", width=1.0),),
        axis("time in s"),
        axis("rate in deg/s", limits=limits(speed)),
    )
    return FigureGrid(
        (test, motion),
        (
            LegendItem("one axis or unit", "@data"),
            LegendItem("all axes together", "@other"),
            LegendItem("threshold", "@error"),
        ),
        columns=2,
        caption="Shaded: windows in the log.",
    )
