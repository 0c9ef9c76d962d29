"""A simulated drive: where it went, how it moved, and what was put into the recordings."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from schuler.report.blocks import Facts, FigureGrid, Finding, Findings, LegendItem, Section, Table
from schuler.report.figures import axis, line, marks
from schuler.report.makers import plot
from schuler.report.numbers import duration, number
from schuler.report.sections.navigation.run import local_track, motion_figures, near_track
from schuler.report.sections.registry import register
from schuler.simulation.scenario import SimulatedDrive


@dataclass(frozen=True, slots=True, eq=False)
class SimulationResults:
    """A simulated drive and its description."""

    drive: SimulatedDrive  # recordings and truth
    told: dict[str, Any]  # plain values: what was asked for


@register
def simulation_sections(results: SimulationResults) -> tuple[Section, ...]:
    """Show a simulated drive."""
    drive, told = results.drive, results.told
    log = drive.log
    facts = Facts(
        (
            ("Duration", duration(float(log["duration_s"]))),
            ("Distance", f"{number(log['distance_m'] / 1000.0)} km"),
            ("Highest speed", f"{number(log['highest_speed_m_s'])} m/s"),
            ("IMUs", str(len(drive.imus))),
            ("GNSS fixes", str(drive.gnss.size)),
            ("Seed", str(told["seed"])),
        )
    )
    sentence = (
        f"A {told['motion']} of {duration(float(log['duration_s']))} over "
        f"{number(log['distance_m'] / 1000.0)} km, simulated from the seed {told['seed']}."
    )
    motion = Section("Motion", (facts, _track(drive), motion_figures(drive.truth, ())), (sentence,))
    return motion, _sensors(told, log)


def _track(drive: SimulatedDrive) -> FigureGrid:
    origin = drive.truth.position[0]
    east, north = local_track(drive.truth.position, origin)
    seen = near_track(drive.gnss.position, drive.truth.position)
    seen_east, seen_north = local_track(seen, origin)
    figure = plot(
        "Track in local coordinates",
        "East against north from the first position, both axes to the same scale.",
        (
            marks(seen_east, seen_north, "@gnss", "GNSS", size=4),
            line(east, north, "@model", "truth", width=1.5, points=4000),
        ),
        axis("east in m"),
        axis("north in m", equal_to="x"),
        height=560,
    )
    legend = (LegendItem("GNSS", "@gnss", "point"), LegendItem("truth", "@model"))
    return FigureGrid((figure,), legend, columns=1)


def _sensors(told: Mapping[str, Any], log: Mapping[str, Any]) -> Section:
    rows = [
        (group, name.replace("_", " "), _said(value))
        for group, title in (("IMU", "imu"), ("GNSS", "gnss"))
        for name, value in told[title].items()
    ]
    shown = [
        (group if k == 0 or rows[k - 1][0] != group else "", name, value)
        for k, (group, name, value) in enumerate(rows)
    ]
    table = Table("What was asked for", ("", "option", "value"), tuple(shown), words=(0, 1, 2))
    noise = told["noise_model"] or "none: ideal sensors"
    items = [Finding("info", f"Noise of the IMU: {noise}.")]
    items += [Finding("warning", f"{text}.") for text in log["faults"]]
    count = len(log["faults"])
    sentence = f"{count} fault{'' if count == 1 else 's'} {'was' if count == 1 else 'were'} put in."
    return Section("Sensors and faults", (table, Findings(tuple(items))), (sentence,))


def _said(value: Any) -> str:
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return number(value, 4)
    if isinstance(value, (list, tuple)):
        return ", ".join(str(v) for v in value) or "–"
    return "–" if value is None else str(value)
