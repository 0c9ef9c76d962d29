"""Several IMUs made one, and watched: noise, weights, geometry, the log of faults."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from schuler.arrays.detection.fault_log import told_records
from schuler.arrays.detection.faults import FaultDetection, SensorFaults
from schuler.arrays.detection.operating import OperatingCurve
from schuler.arrays.geometry import Geometry
from schuler.arrays.merit import FiguresOfMerit, figures_of_merit
from schuler.arrays.synthesis.fused_sensor import FusedSensor
from schuler.arrays.synthesis.synthetic import SyntheticImu
from schuler.report.blocks import (
    Block,
    Facts,
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
from schuler.report.makers import log_blocks, plot, remarks
from schuler.report.numbers import MISSING, duration, number, percent
from schuler.report.sections.registry import register
from schuler.units import scale

COLOURS = ("@x", "@y", "@z", "@markov", "@white", "@walk", "@other", "@good")
"""Of IMUs, in turn."""
TITLES = {"gyro": "Gyros", "accel": "Accelerometers"}


def _unit(sensor: str) -> tuple[str, float]:
    return ("deg/s", scale("deg/s", "angular rate")) if sensor == "gyro" else ("m/s²", 1.0)


def _colour(u: int) -> str:
    return COLOURS[u % len(COLOURS)]


@register
def synthetic_sections(result: SyntheticImu) -> tuple[Section, ...]:
    """Show a synthetic IMU."""
    kinds = [f for f in (result.gyro, result.accel) if f is not None]
    sentences = tuple(_gain_sentence(f) for f in kinds)
    blocks: list[Block] = [
        Facts(
            (
                ("IMUs", str(kinds[0].sensors.units)),
                ("Length", duration(result.imu.duration)),
                ("Weights", result.weights.replace("_", " ")),
                ("Samples left out", str(int(result.rows[-1]) + 1 - result.rows.size)),
            )
        ),
        _noise_table(kinds),
        FigureGrid(
            tuple(figure for f in kinds for figure in (_weight_figure(f), _noise_figure(f))),
            _legend(kinds[0].sensors.unit_names),
            columns=2,
            caption="Weights are shares of the information of all axes of an IMU. They follow what "
            "the sensors showed before each moment.",
        ),
    ]
    sensors = kinds[0].sensors
    geometry = Geometry(sensors.axes, sensors.unit, "Sensor axes", sensors.names)
    sections = [
        Section("Synthetic IMU", tuple(blocks), sentences),
        *geometry_sections(figures_of_merit(geometry), sensors.unit_names),
    ]
    if result.faults is not None:
        sections += fault_sections(result.faults)
    return tuple(sections)


def _gain_sentence(fused: FusedSensor) -> str:
    unit, size = _unit(fused.sensors.sensor)
    together = float(np.sqrt(np.mean(np.diag(fused.mean_covariance)))) / size
    mean = float(fused.mean_deviation.mean()) / size
    worth = float(fused.effective_sensors.mean())
    # no more than there are, unless some axes are far better than others
    why = ""
    if worth > 1.05 * fused.sensors.units:
        why = (
            ": more than there are, as some axes disagree far more than others; on a moving body "
            "that is often how they sit, which calibrating the array finds"
        )
    return (
        f"{TITLES[fused.sensors.sensor]}: {number(together)} {unit} a sample together, "
        f"{number(mean)} {unit} on average alone: {percent(fused.reduction)} less "
        f"(reduction; as a gain {percent(fused.gain)}), as good as "
        f"{number(worth)} equal, average IMUs{why}."
    )


def _noise_table(kinds: list[FusedSensor]) -> Table:
    rows: list[tuple[str, ...]] = []
    for fused in kinds:
        sensors = fused.sensors
        unit, size = _unit(sensors.sensor)
        share = fused.weight.mean(axis=0)
        for u, name in enumerate(sensors.unit_names):
            mine = np.flatnonzero(sensors.unit == u)
            noise = [number(v / size) for v in fused.mean_deviation[mine]]
            noise += ["–"] * (3 - len(noise))
            title = f"{TITLES[sensors.sensor]}, {unit}" if u == 0 else ""
            rows.append((title, name, *noise[:3], percent(float(share[mine].sum()))))
        both = [number(float(np.sqrt(v)) / size) for v in np.diag(fused.mean_covariance)]
        rows.append(("", "together, body x y z", *both, percent(1.0)))
    return Table(
        "Noise of a sample of each sensor, and of all together",
        ("Sensor", "IMU", "x", "y", "z", "Weight"),
        tuple(rows),
        words=(0, 1),
        note="Standard deviations from the disagreement of the sensors. What all of them share, "
        "a common bias or vibration, does not show in it.",
    )


def _legend(names: tuple[str, ...]) -> tuple[LegendItem, ...]:
    items = tuple(LegendItem(name, _colour(u)) for u, name in enumerate(names))
    return (*items, LegendItem("together", "@model"))


def _weight_figure(fused: FusedSensor) -> Figure:
    sensors, time = fused.sensors, fused.weight_time
    traces = [
        line(time, fused.weight[:, sensors.unit == u].sum(axis=1), _colour(u), name)
        for u, name in enumerate(sensors.unit_names)
    ]
    largest = float(
        max(np.nanmax(fused.weight[:, sensors.unit == u].sum(axis=1)) for u in range(sensors.units))
    )
    return plot(
        f"{TITLES[sensors.sensor]}: weights",
        "Share of each IMU in the information through time",
        traces,
        axis("time in s"),
        axis("Weight", limits=(0.0, 1.08 * largest)),
    )


def _noise_figure(fused: FusedSensor) -> Figure:
    sensors, time = fused.sensors, fused.weight_time
    unit, size = _unit(sensors.sensor)
    levels = [
        np.sqrt((fused.deviation[:, sensors.unit == u] ** 2).mean(axis=1)) / size
        for u in range(sensors.units)
    ]
    traces = [
        line(time, level, _colour(u), sensors.unit_names[u]) for u, level in enumerate(levels)
    ]
    first = np.unique(fused.which, return_index=True)[1]
    together = np.sqrt(np.einsum("nii->n", fused.covariance[fused.which[first]]) / 3.0) / size
    moments, lines = sensors.time[first], together
    if first.size == 1:
        moments, lines = sensors.time[[0, -1]], np.repeat(together, 2)
    traces.append(line(moments, lines, "@model", "together", width=2.0))
    return plot(
        f"{TITLES[sensors.sensor]}: noise",
        "Standard deviation of a sample of each IMU and of all together through time",
        traces,
        axis("time in s"),
        axis(f"deviation in {unit}", log=True, limits=limits(*levels, lines, log=True)),
    )


@register
def geometry_report(result: Geometry) -> tuple[Section, ...]:
    """Show a geometry with sensors of equal noise."""
    return geometry_sections(figures_of_merit(result))


@register
def merit_report(result: FiguresOfMerit) -> tuple[Section, ...]:
    """Show what a geometry can do."""
    return geometry_sections(result)


GEOMETRY_COLUMNS = ("geometry", "axes", "GDOP", "anisotropy", "smallest fault", "apart", "found",
                    "right")  # fmt: skip


def geometry_rows(
    found: Sequence[FiguresOfMerit], trials: Sequence[OperatingCurve | None]
) -> tuple[tuple[str, ...], ...]:
    """Return a row for each geometry."""
    rows = []
    for one, trial in zip(found, trials, strict=True):
        seen = one.minimal_detectable_bias[np.isfinite(one.minimal_detectable_bias)]
        rows.append(
            (
                one.geometry.title,
                f"{one.geometry.count} (+{one.geometry.redundancy})",
                number(one.gdop, 4),
                number(one.anisotropy, 3),
                number(float(seen.max())) if seen.size else MISSING,
                f"{np.degrees(one.smallest_isolation_angle):.1f} deg",
                MISSING if trial is None else percent(float(trial.likelihood_power[0])),
                MISSING if trial is None else percent(float(trial.right_axis[0])),
            )
        )
    return tuple(rows)


def compared_geometries(
    found: Sequence[FiguresOfMerit], trials: Sequence[OperatingCurve | None]
) -> Section:
    """Put geometries beside each other, and say which is best in what."""
    size = next((t.size for t in trials if t is not None), None)
    note = (
        "GDOP: noise of the vector of three, root of the sum of squares, over that of one axis; "
        "1.732 for three at right angles. Smallest fault: found in one sample with "
        f"{percent(found[0].power)}. Apart: smallest angle between the traces of two faults."
    )
    if size is not None:
        note += f" Found, right: of steps of {number(size)} deviations on the first axis."
    quiet = min(found, key=lambda one: one.gdop)
    said = [f"Least noise: {quiet.geometry.title}, {number(quiet.gdop, 3)} times that of an axis."]
    watched = [o for o in found if np.isfinite(o.minimal_detectable_bias).all()]
    if watched:
        keen = min(watched, key=lambda one: one.minimal_detectable_bias.max())
        said.append(
            f"Smallest fault: {keen.geometry.title}, a step of "
            f"{number(float(keen.minimal_detectable_bias.max()))} deviations on any axis."
        )
    blind = [o.geometry.title for o in found if o not in watched]
    if blind:
        said.append(f"Faults that nobody sees: {', '.join(blind)}.")
    table = Table("Beside each other", GEOMETRY_COLUMNS, geometry_rows(found, trials), note=note)
    return Section("Comparison", (table,), tuple(said))


def geometry_sections(figures: FiguresOfMerit, names: tuple[str, ...] = ()) -> tuple[Section, ...]:
    """Return the section of a geometry."""
    geometry = figures.geometry
    units = int(geometry.units.max()) + 1
    titles = names or tuple(f"unit {u + 1}" for u in range(units))
    bias = figures.minimal_detectable_bias
    seen = bias[np.isfinite(bias)]
    angle = float(np.degrees(figures.smallest_isolation_angle))
    facts = Facts(
        (
            ("Axes", f"{geometry.count}, {geometry.redundancy} more than needed"),
            ("GDOP", number(figures.gdop, 4)),
            ("Anisotropy", number(figures.anisotropy, 4)),
            (
                "Smallest step found in one sample",
                f"{number(float(seen.min()))} to {number(float(seen.max()))} sigma"
                if seen.size
                else "none",
            ),
            ("Smallest angle between faults", f"{number(angle)} deg"),
        )
    )
    found: tuple[Block, ...] = ()
    if figures.statements:
        found = (Findings(tuple(Finding("warning", s) for s in figures.statements)),)
    drawings = tuple(
        _drawing(geometry, title, right, up)
        for title, right, up in (
            ("In space, from front right above", (-0.5, 0.866, 0.0), (-0.43, -0.25, -0.866)),
            ("From above", (0.0, 1.0, 0.0), (1.0, 0.0, 0.0)),
            ("From the side", (1.0, 0.0, 0.0), (0.0, 0.0, -1.0)),
        )
    )
    legend = tuple(LegendItem(titles[u], _colour(u)) for u in range(units))
    grid = FigureGrid(
        drawings,
        legend if units <= 16 else (),
        columns=3,
        caption="Sensitive axes as unit vectors in the body (x forward, y right, z down).",
    )
    note = Prose(
        f"A step on one axis is found with a probability of {percent(figures.power)} at a false-"
        f"alarm rate of {number(100.0 * figures.false_alarm_rate)} % a sample."
    )
    step = (
        "no fault can be seen"
        if not seen.size
        else (f"a step of {number(float(seen.max()))} sigma on any axis is seen in one sample")
    )
    sentence = (
        f"{geometry.title}: {geometry.count} axes, {geometry.redundancy} more than needed, GDOP "
        f"{number(figures.gdop, 4)}; {step}."
    )
    return (Section(geometry.title, (facts, *found, grid, note), (sentence,)),)


def _drawing(
    geometry: Geometry, title: str, right: tuple[float, ...], up: tuple[float, ...]
) -> Figure:
    flat = geometry.axes @ np.column_stack([right, up])
    round_ = np.linspace(0.0, 2.0 * np.pi, 121)
    traces: list[dict[str, Any]] = [
        line(np.cos(round_), np.sin(round_), "@line", "unit sphere", width=1.0, points=200)
    ]
    for letter, direction in zip("xyz", np.eye(3) @ np.column_stack([right, up]), strict=True):
        reach = 1.25 * direction
        traces.append(line([0.0, reach[0]], [0.0, reach[1]], "@soft", f"body {letter}", dash="dot"))
        if np.hypot(*direction) > 0.1:
            traces.append(
                {
                    **marks(reach[:1], reach[1:], "@soft", f"body {letter}", size=1.0),
                    "mode": "text",
                    "text": [letter],
                }
            )
    for m, (x, y) in enumerate(flat):
        colour = _colour(int(geometry.units[m]))
        traces.append(line([0.0, x], [0.0, y], colour, geometry.names[m], width=2.0))
        traces.append(
            marks([x], [y], colour, geometry.names[m], size=6.0, text=(geometry.names[m],))
        )
    plain = {"showgrid": False, "zeroline": False, "showticklabels": False, "ticks": ""}
    return plot(
        title,
        f"Sensor axes seen {title.lower()}",
        traces,
        axis("", limits=(-1.4, 1.4)) | plain,
        axis("", limits=(-1.4, 1.4), equal_to="x") | plain,
    )


@register
def fault_sections(result: FaultDetection) -> tuple[Section, ...]:
    """Show what the tests said of an array."""
    records = result.records
    lines = [Finding(severity, text) for severity, text in told_records(records)]
    blocks = [*log_blocks(remarks(result.limits), lines, "No sensor was taken out.")]
    blocks.append(_statistics(result))
    blocks += [_fault_figures(sensor) for sensor in result.sensors]
    out = [r for r in records if r.kind in ("axis", "unit")]
    sentence = (
        "No sensor of the array failed its tests."
        if result.healthy
        else f"{len(out)} time{'' if len(out) == 1 else 's'} a sensor was taken out"
        + (f", first {out[0].name} at {out[0].start:.1f} s." if out else ".")
    )
    return (Section("Faults", tuple(blocks), (sentence,)),)


def _statistics(result: FaultDetection) -> Table:
    rows = []
    for s in result.sensors:
        rate = s.settings.false_alarm_rate
        rows.append(
            (
                TITLES[s.sensor],
                f"{number(100.0 * s.exceedance(0.05))} %",
                f"{number(100.0 * s.exceedance(0.01))} %",
                f"{number(100.0 * s.exceedance())} % (of {number(100.0 * rate)} %)",
                str(sum(s.spikes.values())),
                percent(min(s.used_share.values())),
            )
        )
    return Table(
        "How often samples contradict the noise",
        ("Sensor", "5 % test", "1 % test", "Chosen test", "Single spikes", "Least used axis"),
        tuple(rows),
        note="Without faults the shares are those of the tests: more means errors that the noise "
        "does not explain, as of scale factors or delays in motion.",
    )


def _fault_figures(s: SensorFaults) -> FigureGrid:
    followed = s.followed
    time = followed.sensors.time
    spans = tuple(
        (r.start, float(time[-1]) if r.stop is None else r.stop)
        for r in s.records
        if r.kind != "missing"
    )
    names = [f"{t:g} s" for t in s.settings.time_constants]
    watch = s.settings.watch(followed.sensors)
    d = plot(
        f"{TITLES[s.sensor]}: every sample",
        "Chi-square statistic of every sample over its threshold",
        (
            line(time, followed.statistic, "@data", "D", width=0.8),
            line(time, s.thresholds, "@error", "threshold", dash="dash"),
        ),
        axis("time in s"),
        axis("D", log=True, limits=limits(followed.statistic, s.thresholds, log=True)),
        spans=spans,
    )
    levels = [
        np.maximum(followed.smoothed[:, j] / watch.axis_threshold[j], 1e-4)
        for j in range(len(names))
    ]
    highest = max(3.0, 1.5 * float(np.nanmax(levels)))
    moments = followed.block_time
    smooth = plot(
        f"{TITLES[s.sensor]}: lasting faults",
        "Largest likelihood statistic of an axis in smoothed residuals over its threshold",
        (
            *(line(moments, v, _colour(j), names[j]) for j, v in enumerate(levels)),
            line(moments[[0, -1]], [1.0, 1.0], "@error", "threshold", dash="dash"),
        ),
        axis("time in s"),
        axis("F / threshold", log=True, limits=(1e-2, highest)),
        spans=spans,
    )
    legend = (
        LegendItem("statistic of a sample", "@data"),
        *(LegendItem(f"{n} means", _colour(j)) for j, n in enumerate(names)),
        LegendItem("threshold", "@error", "dash"),
        LegendItem("a sensor is out", "@outage/0.3", "band"),
    )
    return FigureGrid((d, smooth), legend, columns=2)
