"""What the filter saw: innovations with their claims, NIS, and the sensor errors it found."""

from __future__ import annotations

import numpy as np

from schuler.data.trajectory import Innovations, NavigationSolution
from schuler.report.blocks import Figure, FigureGrid, LegendItem, Section, Table
from schuler.report.figures import axis, band, broken_at_gaps, limits, line, marks
from schuler.report.makers import plot
from schuler.report.numbers import number, percent
from schuler.types import FloatArray

Spans = tuple[tuple[float, float], ...]
DIRECTIONS = ("north", "east", "down")
VEHICLE_DIRECTIONS = ("forward", "right", "down")
BODY_DIRECTIONS = ("x", "y", "z")


def chi_square_quantile(probability: float, degrees: float) -> float:
    """Return the quantile of the chi-square law."""
    from scipy.special import gammaincinv

    return float(2.0 * gammaincinv(0.5 * degrees, probability))


def innovation_section(solution: NavigationSolution, spans: Spans) -> Section:
    """Show every update against what the filter claimed before it."""
    innovations = solution.innovations
    kinds = innovations.kinds
    parts = {kind: innovations.of_kind(kind) for kind in kinds}
    start = float(solution.trajectory.time[0])
    table = Table(
        "Updates of each kind",
        ("measurement", "updates", "kept out by the gate", "mean NIS a degree", "NIS inside 95 %"),
        tuple(_row(kind, part) for kind, part in parts.items()),
        note="NIS: normalised innovation squared. An honest filter has a mean of 1 a degree of "
        "freedom; above 1 it is too sure of itself, below 1 not sure enough.",
    )
    grids = tuple(_innovations(kind, part, start, spans) for kind, part in parts.items())
    sentences: tuple[str, ...] = ()
    fixes = innovations.gnss
    if fixes.nis.size:
        sentences = (
            f"The filter's {fixes.nis.size} updates by GNSS have a mean NIS of "
            f"{number(fixes.mean_nis)} a degree of freedom (1 is honest); "
            f"{int(np.count_nonzero(~fixes.accepted))} were kept out by the gate.",
        )
    return Section("Innovations", (table, *grids), sentences)


def _row(kind: str, part: Innovations) -> tuple[str, ...]:
    kept = part.accepted
    bounds = {int(d): chi_square_quantile(0.95, int(d)) for d in np.unique(part.degrees)}
    inside = np.mean([n <= bounds[int(d)] for n, d in zip(part.nis, part.degrees, strict=True)])
    return (
        kind,
        str(part.nis.size),
        str(int(np.count_nonzero(~kept))),
        number(part.mean_nis),
        percent(float(inside)),
    )


def _innovations(kind: str, part: Innovations, start: float, spans: Spans) -> FigureGrid:
    time = part.time - start
    unit = "m/s" if "velocity" in kind else "m" if "position" in kind else "rad/s"
    figures = []
    directions = VEHICLE_DIRECTIONS if "vehicle" in kind else DIRECTIONS
    directions = BODY_DIRECTIONS if "rate" in kind else directions
    for k, direction in enumerate(directions):
        value, bound = part.value[:, k], 2.0 * part.sd[:, k]
        seen = np.isfinite(value)
        if not seen.any():
            continue
        time_k, value, bound = time[seen], value[seen], bound[seen]
        out = ~part.accepted[seen]
        # One prior of hundreds of metres must not flatten all the rest.
        reach = float(np.quantile(np.abs(value), 0.995) + np.quantile(bound, 0.98))
        shown, value_b, bound_b = broken_at_gaps(time_k, value, bound)
        traces = [
            *band(shown, -bound_b, bound_b, "@band/0.18", "2 sigma"),
            line(shown, value_b, "@data", "innovation", width=0.8),
        ]
        if out.any():
            traces.append(marks(time_k[out], value[out], "@error", "kept out", size=6, symbol="x"))
        figures.append(
            plot(
                f"{kind[:1].upper()}{kind[1:]}, {direction}",
                f"{value.size} updates, rms {number(float(np.sqrt(np.mean(value**2))))} {unit}, "
                f"{percent(float(np.mean(np.abs(value) <= bound)))} within 2 sigma.",
                traces,
                axis("time in s"),
                axis(unit, limits=(-reach, reach)),
                height=220,
                spans=spans,
            )
        )
    figures.append(_nis(kind, part, time, spans))
    legend = (
        LegendItem("innovation", "@data"),
        LegendItem("claimed 2 sigma", "@band/0.18", "band"),
        LegendItem("kept out", "@error", "point"),
        LegendItem("95 % of an honest NIS", "@mark", "dash"),
    )
    return FigureGrid(tuple(figures), legend, columns=2)


def _nis(kind: str, part: Innovations, time: FloatArray, spans: Spans) -> Figure:
    degrees = int(np.median(part.degrees))
    bound = chi_square_quantile(0.95, degrees)
    shown = np.maximum(part.nis, 1e-3)
    return plot(
        f"NIS of {kind}",
        f"{percent(float(np.mean(part.nis <= bound)))} below the 95 % bound of {number(bound)}.",
        (
            marks(time, shown, "@data", "NIS", size=3),
            line(time[[0, -1]], [bound, bound], "@mark", "95 % bound", width=1.4, dash="dash"),
        ),
        axis("time in s"),
        axis("NIS", log=True, limits=limits(shown, [bound], log=True)),
        height=220,
        spans=spans,
    )


def sensor_error_section(
    causal: NavigationSolution, smoothed: NavigationSolution | None, spans: Spans
) -> tuple[Section, ...]:
    """Show the sensor errors that the filter estimated."""
    if not causal.sensor_error_names:
        return ()
    start = float(causal.trajectory.time[0])
    later = smoothed if smoothed is not None and smoothed is not causal else None
    figures = []
    for k, name in enumerate(causal.sensor_error_names):
        unit, factor = _unit(name)
        time = causal.sensor_error_time - start
        value = factor * causal.sensor_errors[:, k]
        bound = 2.0 * factor * causal.sensor_errors_sd[:, k]
        traces = [
            *band(time, value - bound, value + bound, "@causal/0.18", "2 sigma"),
            line(time, value, "@causal", "causal", width=1.2),
        ]
        if later is not None and later.sensor_error_names == causal.sensor_error_names:
            smooth = factor * later.sensor_errors[:, k]
            when = later.sensor_error_time - start
            traces.append(line(when, smooth, "@smoothed", "smoothed", width=1.4))
        figures.append(
            plot(
                f"{name[:1].upper()}{name[1:]}".replace("_", " "),
                f"Ends at {number(float(value[-1]))} ± {number(float(bound[-1]))} {unit}.",
                traces,
                axis("time in s"),
                axis(unit, limits=_reach(value, bound)),
                height=210,
                spans=spans,
            )
        )
    legend = [
        LegendItem("causal estimate", "@causal"),
        LegendItem("its claimed 2 sigma", "@causal/0.18", "band"),
    ]
    if later is not None:
        legend.append(LegendItem("smoothed estimate", "@smoothed"))
    return (Section("Sensor errors", (FigureGrid(tuple(figures), tuple(legend)),)),)


def _reach(value: FloatArray, bound: FloatArray) -> tuple[float, float]:
    """Return limits that show the settled part; the first moments may leave the plot."""
    settled = slice(value.size // 7, None)
    return limits((value - bound)[settled], (value + bound)[settled])


def _unit(name: str) -> tuple[str, float]:
    """Return unit and factor from SI of a sensor error state."""
    from schuler.units import scale

    if name.startswith("gyro"):
        return "deg/h", 1.0 / scale("deg/h", "gyro bias")
    if name.startswith("accel"):
        return "mg", 1.0 / scale("mg", "accel bias")
    return "SI", 1.0
