"""The noise of a sensor: Allan curves with the model over them, and its parameters."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from schuler.curves.allan_curve import AllanCurve
from schuler.data.imu import CHANNELS
from schuler.estimation.characterization import ImuCharacterization
from schuler.estimation.identification import Identification
from schuler.estimation.ieee952 import classical_reading
from schuler.noise.base import Process
from schuler.noise.gauss_markov import FLICKER_LEVEL
from schuler.report.blocks import Facts, Figure, FigureGrid, Findings, LegendItem, Section, Table
from schuler.report.figures import Dash, axis, band, limits, line, marks
from schuler.report.makers import plot, remarks
from schuler.report.numbers import duration, number
from schuler.report.sections.noise.ieee952 import ieee952_rows, plateau_note
from schuler.report.sections.noise.parameters import parameter_rows
from schuler.report.sections.recording import channel_title, pretty
from schuler.report.sections.registry import register
from schuler.types import FloatArray
from schuler.units import kind_of, scale

SHOWN_UNITS = {"gyro": ("gyro bias", "deg/h"), "accel": ("accel bias", "ug")}
STROKES: dict[str, tuple[str, Dash]] = {
    "white_noise": ("@white", "dot"),
    "gauss_markov": ("@markov", "dot"),
    "random_walk": ("@walk", "dot"),
    "bias_instability": ("@markov", "dash"),
    "sinusoid": ("@other", "dashdot"),
    "rate_ramp": ("@other", "dot"),
}
"""Colour and stroke where they are not those of other processes."""


def _stroke(part: Process) -> tuple[str, str, Dash]:
    """Name, colour and stroke of a process."""
    colour, dash = STROKES.get(part.kind, ("@other", "dash"))
    return part.label or part.kind.replace("_", " "), colour, dash


@register
def characterization_sections(result: ImuCharacterization) -> tuple[Section, ...]:
    """Show the noise of an IMU."""
    found = result.channels
    first = next(iter(found.values()))
    facts = Facts(
        (
            ("Length of the record", duration(first.curve.duration)),
            ("Rate", f"{first.curve.rate:.6g} Hz"),
            ("Long enough for 10 % on all", _enough(result)),
        )
    )
    columns, rows = parameter_rows(result.noise_model, "datasheet")
    table = Table(
        "The noise model, estimate ± standard error",
        columns,
        rows,
        words=(0, 1, 2),
        note="< : looked for and not found; 95 % upper limit.",
    )
    columns, rows = parameter_rows(result.noise_model, "si")
    in_si = Table("The same in SI", columns, rows, words=(0, 1, 2), folded=True)
    findings = Findings(remarks(result.findings))
    coefficients = {c: i.ieee952 for c, i in found.items()}
    columns, rows = ieee952_rows(coefficients, "datasheet")
    ieee = Table(
        "N, B, K, Q, R of IEEE Std 952, fitted",
        columns,
        rows,
        words=(0, 1, 2),
        note="< : looked for and not found; 95 % upper limit. " + plateau_note(coefficients),
    )
    blocks = (
        facts,
        _curves(found),
        ieee,
        table,
        in_si,
        findings,
        _verdicts(found),
        _readings(found),
        _slopes(found),
    )
    return (Section("Noise", blocks, (*_headlines(result), *result.findings[:1])),)


def _headlines(result: ImuCharacterization) -> tuple[str, ...]:
    """Return the white noise of each sensor in one sentence."""
    sentences = []
    for sensor, words in (("gyro", "gyros"), ("accel", "accelerometers")):
        unit = kind_of(f"{sensor} white noise").datasheet
        values = {
            c[-1]: found.parameters["white_noise.density"] / scale(unit, f"{sensor} white noise")
            for c, found in result.channels.items()
            if c.startswith(sensor) and "white_noise.density" in found.parameters
        }
        if values:
            axes = ", ".join(f"{number(v)} ({a})" for a, v in values.items())
            sentences.append(f"White noise of the {words}: {axes} {pretty(unit)}.")
    return tuple(sentences)


def _enough(result: ImuCharacterization) -> str:
    verdicts = [i.verdict for i in result.channels.values()]
    if all(v.enough for v in verdicts):
        return "yes"
    return f"no: {duration(max(v.wanted_duration for v in verdicts))} wanted"


def _curves(found: dict[str, Identification]) -> FigureGrid:
    parts = {p.kind: p for i in found.values() for p in i.process.components}
    legend = [
        LegendItem("measured", "@data", "point"),
        LegendItem("its 95 % interval", "@data/0.22", "band"),
        LegendItem("model", "@model"),
    ]
    for name, colour, dash in map(_stroke, sorted(parts.values(), key=lambda p: p.rank)):
        legend.append(LegendItem(name, colour, "dot" if dash == "dot" else "dash"))
    legend.append(LegendItem("slope method", "@mark", "diamond"))
    figures = []
    for sensor in SHOWN_UNITS:
        channels = [c for c in CHANNELS if c in found and c.startswith(sensor)]
        common = _common_limits(sensor, [found[c] for c in channels])
        figures += [_curve(c, found[c], common) for c in channels]
    return FigureGrid(
        tuple(figures),
        tuple(legend),
        caption="Overlapping Allan deviation. The dotted parts add up to the model in squares. "
        "Diamonds: what the slope method reads off the same curve (N at 1 s, the bias level, K at "
        "3 s); where white noise and random walk merely cross, it takes the crossing for bias "
        "instability.",
    )


def _common_limits(
    sensor: str, found: list[Identification]
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return limits of both axes that all axes of a sensor share."""
    factor = _factor(sensor)
    taus = [i.curve.tau for i in found]
    values = [a / factor for i in found for a in (i.curve.deviation, i.curve.upper)]
    return limits(*taus, log=True, margin=0.03), limits(*values, log=True)


def _factor(sensor: str) -> float:
    kind, unit = SHOWN_UNITS[sensor]
    return scale(unit, kind)


def _curve(
    channel: str, found: Identification, common: tuple[tuple[float, float], tuple[float, float]]
) -> Figure:
    sensor = channel.split("_")[0]
    factor, unit = _factor(sensor), pretty(SHOWN_UNITS[sensor][1])
    curve = found.curve
    tau = curve.tau
    traces: list[dict[str, Any]] = [
        *band(curve.tau, curve.lower / factor, curve.upper / factor, "@data/0.22", "95 %")
    ]
    measured = marks(curve.tau, curve.deviation / factor, "@data", "measured", size=4)
    traces.append(measured | {"hovertemplate": f"%{{x:.3~g}} s: %{{y:.4~g}} {unit}"})
    for part in found.process.components:
        name, colour, dash = _stroke(part)
        traces.append(line(tau, _level(part, curve) / factor, colour, name, width=1.4, dash=dash))
    traces.append(line(tau, _level(found.process, curve) / factor, "@model", "model", width=1.5))
    traces.append(_slope_marks(found, factor))
    lowest = int(np.argmin(curve.deviation))
    return plot(
        channel_title(channel),
        f"Lowest {number(float(curve.deviation[lowest]) / factor)} {unit} at "
        f"{number(float(curve.tau[lowest]))} s; the model is the sum of "
        + ", ".join(_stroke(p)[0] for p in found.process.components)
        + ".",
        traces,
        axis("cluster time in s", log=True, limits=common[0]),
        axis(f"Allan deviation in {unit}", log=True, limits=common[1]),
        height=310,
    )


def _level(process: Process, curve: AllanCurve) -> FloatArray:
    return np.sqrt(process.sampled_allan_variance(curve.factors, 1.0 / curve.rate))


def _slope_marks(found: Identification, factor: float) -> dict[str, Any]:
    """Return what the slope method reads, where it reads it."""
    slopes = found.slopes
    points: list[tuple[float, float, str]] = []
    if slopes.white_noise is not None:
        points.append((1.0, slopes.white_noise.value, "slope method: N"))
    if slopes.bias_instability is not None:
        run = slopes.bias_instability
        middle = math.sqrt(run.start * run.stop)
        points.append((middle, FLICKER_LEVEL * run.value, "slope method: level of B"))
    if slopes.random_walk is not None:
        points.append((3.0, slopes.random_walk.value, "slope method: K"))
    return marks(
        [p[0] for p in points],
        [p[1] / factor for p in points],
        "@mark",
        "slope method",
        size=11,
        symbol="diamond-open",
        text=tuple(p[2] for p in points),
    )


def _verdicts(found: dict[str, Identification]) -> Table:
    rows = []
    for channel, identification in found.items():
        for k, verdict in enumerate(identification.verdict.parameters):
            rows.append(
                (
                    channel_title(channel) if k == 0 else "",
                    verdict.parameter.replace("_", " ").replace(".", ", "),
                    f"{number(100.0 * verdict.relative_error, 2)} %",
                    duration(verdict.wanted_duration),
                    "yes" if verdict.enough else "no",
                )
            )
    return Table(
        "Was the record long enough?",
        ("channel", "parameter", "standard error", "record for 10 %", "enough"),
        tuple(rows),
        words=(0, 1),
        folded=True,
    )


def _readings(found: dict[str, Identification]) -> Table:
    """B as it is read off a curve by hand, under that name."""
    rows = []
    for channel, one in found.items():
        kind = f"{channel.split('_')[0]} bias instability"
        unit = kind_of(kind).datasheet
        size = scale(unit, kind)
        reading = classical_reading(one.curve, one.slopes, one.process)
        rows.append(
            (
                channel_title(channel),
                pretty(unit),
                number(reading.minimum / size),
                "" if reading.flat_run is None else number(reading.flat_run / size),
                f"{100.0 * reading.flicker_share:.0f} %",
            )
        )
    return Table(
        "Classical reading of the bias instability (not the fitted B)",
        ("channel", "unit", "lowest point / 0.664", "flat run / 0.664", "flicker at the lowest"),
        tuple(rows),
        words=(0, 1),
        note="The lowest point bounds B from above even where there is no flicker at all.",
        folded=True,
    )


def _slopes(found: dict[str, Identification]) -> Table:
    rows = []
    for channel, identification in found.items():
        sensor = channel.split("_")[0]
        slopes = identification.slopes
        readings = (
            ("N", slopes.white_noise, f"{sensor} white noise"),
            ("B", slopes.bias_instability, f"{sensor} bias instability"),
            ("K", slopes.random_walk, f"{sensor} random walk"),
        )
        label = channel_title(channel)
        for symbol, reading, kind in readings:
            if reading is None:
                continue
            unit = kind_of(kind).datasheet
            rows.append(
                (
                    label,
                    symbol,
                    f"{number(reading.value / scale(unit, kind), 4)} {pretty(unit)}",
                    f"{number(reading.start)} to {number(reading.stop)} s",
                    f"{number(100.0 * reading.relative_error, 2)} %",
                )
            )
            label = ""
    return Table(
        "What the slope method reads, for comparison",
        ("channel", "parameter", "value", "read between", "error as the method states it"),
        tuple(rows),
        words=(0, 1),
        note="Lines of fixed slope through straight runs of the curve, as papers do it. The joint "
        "fit above is the one to use.",
        folded=True,
    )
