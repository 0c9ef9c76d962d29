"""A navigation run: track, uncertainty, innovations, sensor errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from schuler.data.gnss import GnssRecording
from schuler.data.trajectory import NavigationSolution, Trajectory
from schuler.earth import ned_from_geodetic
from schuler.errors import InputError
from schuler.report.blocks import Facts, FigureGrid, Finding, Findings, LegendItem, Section, Table
from schuler.report.figures import axis, limits, line, marks
from schuler.report.makers import moments, plot, things
from schuler.report.numbers import duration, number
from schuler.report.sections.navigation.filtering import (
    innovation_section,
    sensor_error_section,
    uncertainty_section,
)
from schuler.report.sections.navigation.sensor_faults import sensor_fault_sections
from schuler.report.sections.registry import register
from schuler.types import FloatArray

TRACK_POINTS = 2000


@dataclass(frozen=True, slots=True)
class NavigationResults:
    """A run with all that belongs beside it on the page.

    Parameters
    ----------
    causal : NavigationSolution or None
        Solution with the data up to each moment.
    smoothed : NavigationSolution or None
        Solution with all data; one of the two must be there.
    gnss : GnssRecording or None
        What the receiver said.
    truth : Trajectory or None
        True trajectory of a simulation, or a reference.
    outages : tuple of (float, float)
        Start and end of each stretch without GNSS, seconds on the time axis of the solution.

    Raises
    ------
    InputError
        Neither solution is given.
    """

    causal: NavigationSolution | None = None
    smoothed: NavigationSolution | None = None
    gnss: GnssRecording | None = None
    truth: Trajectory | None = None
    outages: tuple[tuple[float, float], ...] = ()

    def __post_init__(self) -> None:
        if self.causal is None and self.smoothed is None:
            raise InputError("a navigation run without a solution", expected="at least one")

    @property
    def best(self) -> NavigationSolution:
        """The smoothed solution where it exists."""
        solution = self.smoothed or self.causal
        assert solution is not None
        return solution

    @property
    def solutions(self) -> tuple[tuple[str, str, NavigationSolution], ...]:
        """Name, colour and solution of each answer."""
        both = (("causal", "@causal", self.causal), ("smoothed", "@smoothed", self.smoothed))
        return tuple((name, colour, s) for name, colour, s in both if s is not None)


@register
def solution_sections(solution: NavigationSolution) -> tuple[Section, ...]:
    """Show one solution."""
    if solution.smoothed:
        return run_sections(NavigationResults(smoothed=solution))
    return run_sections(NavigationResults(causal=solution))


@register
def run_sections(run: NavigationResults) -> tuple[Section, ...]:
    """Show a navigation run."""
    origin_time = float(run.best.trajectory.time[0])
    spans = tuple((a - origin_time, b - origin_time) for a, b in run.outages)
    filtered = run.causal or run.best
    seen = filtered.settings.get("findings")
    return (
        _track_section(run, spans),
        *(() if seen is None else (condition_section(seen),)),
        *_sensors_in_use(filtered),
        uncertainty_section(run.solutions, run.truth, spans),
        innovation_section(filtered, spans),
        *sensor_error_section(filtered, run.smoothed, spans),
    )


def _sensors_in_use(solution: NavigationSolution) -> tuple[Section, ...]:
    """Of an array, who was out when."""
    told, time = solution.settings.get("sensor_faults"), solution.trajectory.time
    return () if told is None else sensor_fault_sections(told, float(time[0]), float(time[-1]))


def _track_section(run: NavigationResults, spans: tuple[tuple[float, float], ...]) -> Section:
    trajectory = run.best.trajectory
    time = trajectory.time - trajectory.time[0]
    speed = np.hypot(trajectory.velocity[:, 0], trajectory.velocity[:, 1])
    step = np.diff(time)
    # a stretch without samples tells nothing of the way
    distance = float(np.sum(speed[1:] * np.where(step < 1.0, step, 0.0)))
    facts = Facts(
        (
            ("Duration", duration(float(time[-1]))),
            ("Distance", f"{number(distance / 1000.0)} km"),
            ("Highest speed", f"{number(float(speed.max()))} m/s"),
            ("GNSS epochs", "–" if run.gnss is None else str(run.gnss.size)),
        )
    )
    sentence = (
        f"The run lasts {duration(float(time[-1]))} and covers {number(distance / 1000.0)} km at "
        f"up to {number(float(speed.max()))} m/s."
    )
    found = _found(run.best.settings)
    blocks = (
        facts,
        track_figure(run),
        motion_figures(trajectory, spans),
        *((found,) if found.rows else ()),
    )
    return Section("Track", blocks, (sentence,))


FOUND = (
    ("alignment", "alignment", ""),
    ("initial_heading_sd_deg", "standard deviation of the first heading", "deg"),
    ("time_offset_position_s", "time offset of GNSS position", "s"),
    ("time_offset_velocity_s", "time offset of GNSS velocity", "s"),
    ("lever_arm_m", "lever arm, IMU to antenna", "m"),
    ("mounting_deg", "mounting (roll, pitch, yaw of the IMU in the vehicle)", "deg"),
    ("gnss_position_sd_factor", "real over claimed sd, GNSS position", ""),
    ("gnss_errors", "errors of GNSS positions", ""),
    ("gnss_velocity_sd_factor", "real over claimed sd, GNSS velocity", ""),
)


def _found(settings: dict[str, Any]) -> Table:
    """Return what was given or found from the data before the filter ran."""
    rows = []
    for key, words, unit in FOUND:
        if key not in settings:
            continue
        value = settings[key]
        parts = value if isinstance(value, (list, tuple)) else [value]
        text = ", ".join(
            number(float(v), 4) if isinstance(v, (int, float)) else str(v) for v in parts
        )
        rows.append((words, text, unit))
    return Table(
        "What the run rests on", ("quantity", "value", "unit"), tuple(rows), words=(0, 1, 2)
    )


def local_track(
    position: FloatArray, origin: FloatArray, points: int = TRACK_POINTS
) -> tuple[FloatArray, FloatArray]:
    """Return east and north in m of a thinned track."""
    step = -(-position.shape[0] // points)
    ned = ned_from_geodetic(position[::step], origin)
    return ned[:, 1], ned[:, 0]


def near_track(position: FloatArray, track: FloatArray) -> FloatArray:
    """Return the positions near a track: a wrong fix far away would shrink it to a point."""
    low, high = track[:, :2].min(axis=0), track[:, :2].max(axis=0)
    around = 0.5 * float((high - low).max()) + 100.0 / 6.4e6
    inside = (position[:, :2] > low - around) & (position[:, :2] < high + around)
    near = position[inside.all(axis=1)]
    return near if near.size else position


def track_figure(run: NavigationResults) -> FigureGrid:
    """Return the track in local coordinates, east against north to one scale."""
    origin = run.best.trajectory.position[0]
    traces: list[dict[str, Any]] = []
    legend = []
    if run.gnss is not None:
        seen = near_track(run.gnss.position, run.best.trajectory.position)
        east, north = local_track(seen, origin)
        traces.append(marks(east, north, "@gnss", "GNSS", size=4))
        legend.append(LegendItem("GNSS", "@gnss", "point"))
    if run.truth is not None:
        east, north = local_track(run.truth.position, origin)
        traces.append(_path(east, north, "@model", "truth", 1.0))
        legend.append(LegendItem("truth", "@model"))
    for name, colour, solution in run.solutions:
        east, north = local_track(solution.trajectory.position, origin)
        traces.append(_path(east, north, colour, name, 1.8))
        legend.append(LegendItem(name, colour))
    traces += _outage_paths(run, origin)
    if run.outages:
        legend.append(LegendItem("without GNSS", "@outage/0.45", "band"))
    figure = plot(
        "Track in local coordinates",
        "East against north from the first position, both axes to the same scale.",
        traces,
        axis("east in m"),
        axis("north in m", equal_to="x"),
        height=560,
    )
    return FigureGrid((figure,), tuple(legend), columns=1)


def _path(east: FloatArray, north: FloatArray, colour: str, name: str, width: float) -> Any:
    return line(east, north, colour, name, width=width, points=2 * TRACK_POINTS)


def _outage_paths(run: NavigationResults, origin: FloatArray) -> list[dict[str, Any]]:
    """Return broad strokes under the stretches without GNSS."""
    trajectory = run.best.trajectory
    paths = []
    for start, stop in run.outages:
        inside = (trajectory.time >= start) & (trajectory.time <= stop)
        if not inside.any():
            continue
        east, north = local_track(trajectory.position[inside], origin, 300)
        since = number(start - float(trajectory.time[0]), 4)
        paths.append(_path(east, north, "@outage/0.45", f"without GNSS from {since} s", 7.0))
    return paths


def _smooth_angle(degrees: FloatArray) -> FloatArray:
    whole = np.unwrap(degrees, period=360.0)
    return np.asarray(whole - 360.0 * np.round(np.median(whole) / 360.0))


def motion_figures(trajectory: Trajectory, spans: tuple[tuple[float, float], ...]) -> FigureGrid:
    """Return height, speed and attitude over time."""
    from schuler.rotations import euler_from_dcm

    time = trajectory.time - trajectory.time[0]
    speed = np.hypot(trajectory.velocity[:, 0], trajectory.velocity[:, 1])
    roll, pitch, yaw = (np.degrees(a) for a in euler_from_dcm(trajectory.rotation))
    # A sensor mounted upside down rolls around 180 deg: no jumps there. A heading may go round
    # and round, and stays on its dial.
    roll, pitch = (_smooth_angle(a) for a in (roll, pitch))
    jumps = np.abs(np.diff(yaw, prepend=yaw[0])) > 180.0
    curves = (
        ("Height", trajectory.position[:, 2], "height in m", "@x"),
        ("Speed over ground", speed, "m/s", "@x"),
        ("Roll", roll, "deg", "@x"),
        ("Pitch", pitch, "deg", "@x"),
        ("Heading", np.where(jumps, np.nan, yaw), "deg", "@x"),
    )
    figures = tuple(
        plot(
            title,
            f"Between {number(float(np.nanmin(values)))} and {number(float(np.nanmax(values)))}.",
            (line(time, values, colour, title, width=1.2),),
            axis("time in s"),
            axis(unit, limits=limits(values)),
            height=220,
            spans=spans,
        )
        for title, values, unit, colour in curves
    )
    return FigureGrid(figures, caption="Attitude takes the axes of the IMU into north-east-down.")


def condition_section(findings: Sequence[dict[str, Any]]) -> Section:
    """Show the findings of a run."""
    order = {"error": 0, "warning": 1, "info": 2}
    items = tuple(
        Finding(
            f["severity"],
            f"{f['message']}." if not f["cure"] else f"{f['message']}: {f['cure']}.",
            moments(f["intervals_s"], f["severity"]),
        )
        for f in sorted(findings, key=lambda f: order.get(f["severity"], 3))
    )
    serious = [item.text for item in items if item.severity != "info"]
    if not items:
        items = (Finding("good", "Nothing to remark: IMU and GNSS fit each other throughout."),)
    if serious:
        first = serious[0].partition(":")[0].rstrip(".")
        sentence = f"The drive shows {things(len(serious))}: {first}."
    else:
        sentence = "The recordings of the drive are whole and fit each other."
    return Section("Condition of the drive", (Findings(items),), (sentence,))
