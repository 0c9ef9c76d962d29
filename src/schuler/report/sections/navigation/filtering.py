"""What the filter saw and claims: innovations, NIS, sensor errors, uncertainty against truth."""

from __future__ import annotations

from typing import Any

import numpy as np

from schuler.data.trajectory import Innovations, NavigationSolution, Trajectory
from schuler.earth import metres_per_radian
from schuler.report.blocks import Block, Figure, FigureGrid, LegendItem, Prose, Section, Table
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
            f"Of {fixes.nis.size} updates by GNSS {int(np.count_nonzero(~fixes.accepted))} were "
            "kept out; the others differ from what the filter expected, squared and over what it "
            f"claimed (NIS), by {number(fixes.mean_nis)} on average: 1 is honest.",
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


Answers = tuple[tuple[str, str, NavigationSolution], ...]
WITHIN_2_SIGMA = 0.954


def uncertainty_section(answers: Answers, truth: Trajectory | None, spans: Spans) -> Section:
    """Show claimed standard deviations, with real errors where there is a truth."""
    if truth is None:
        return Section("Claimed uncertainty", (_claimed(answers, spans),), (_claims(answers),))
    blocks: list[Block] = []
    rows = []
    sentences = []
    for name, colour, solution in answers:
        errors = errors_against(truth, solution)
        blocks.append(_errors(name, colour, solution, errors, spans))
        rows += _rows(name, solution, errors)
        horizontal = float(np.sqrt(np.mean(np.sum(errors["position"][:, :2] ** 2, axis=1))))
        sentences.append(
            f"Against the truth, the {name} position is good to {number(horizontal)} m "
            f"(horizontal rms)."
        )
    table = Table(
        "Errors against the truth",
        ("answer", "quantity", "rms north", "rms east", "rms down", "inside 2 sigma"),
        tuple(rows),
        words=(0, 1),
        note="Inside 2 sigma: share of all samples and directions within twice the claimed "
        f"standard deviation; an honest Gaussian claim gives {percent(WITHIN_2_SIGMA)}.",
    )
    intro = Prose(
        "Lines are real errors, areas are twice the standard deviation the filter claims. "
        "An honest filter stays inside nearly always, and does not stay far inside."
    )
    return Section("Errors against the truth", (intro, table, *blocks), tuple(sentences))


def errors_against(truth: Trajectory, solution: NavigationSolution) -> dict[str, FloatArray]:
    """Return estimated minus true at the samples of the solution (spec 0, error signs)."""
    trajectory = solution.trajectory
    position = _at(truth.time, truth.position, trajectory.time)
    velocity = _at(truth.time, truth.velocity, trajectory.time)
    nearest = np.clip(np.searchsorted(truth.time, trajectory.time), 0, truth.size - 1)
    before = np.maximum(nearest - 1, 0)
    closer = np.abs(truth.time[before] - trajectory.time) < np.abs(
        truth.time[nearest] - trajectory.time
    )
    nearest = np.where(closer, before, nearest)
    north, east = metres_per_radian(position)
    difference = trajectory.position - position
    turn = np.einsum("nij,nkj->nik", trajectory.rotation, truth.rotation[nearest])
    psi = 0.5 * np.stack(
        [
            turn[:, 1, 2] - turn[:, 2, 1],
            turn[:, 2, 0] - turn[:, 0, 2],
            turn[:, 0, 1] - turn[:, 1, 0],
        ],
        axis=1,
    )
    return {
        "position": np.stack(
            [difference[:, 0] * north, difference[:, 1] * east, -difference[:, 2]], axis=1
        ),
        "velocity": trajectory.velocity - velocity,
        "attitude": psi,
    }


def _at(time: FloatArray, values: FloatArray, wanted: FloatArray) -> FloatArray:
    return np.stack([np.interp(wanted, time, column) for column in values.T], axis=1)


def _deviations(solution: NavigationSolution) -> dict[str, FloatArray]:
    return {
        "position": solution.position_sd,
        "velocity": solution.velocity_sd,
        "attitude": solution.attitude_sd,
    }


UNITS = {"position": ("m", 1.0), "velocity": ("m/s", 1.0), "attitude": ("deg", 180.0 / np.pi)}


def _rows(
    name: str, solution: NavigationSolution, errors: dict[str, FloatArray]
) -> list[tuple[str, ...]]:
    rows = []
    for quantity, deviation in _deviations(solution).items():
        unit, factor = UNITS[quantity]
        rms = factor * np.sqrt(np.mean(errors[quantity] ** 2, axis=0))
        inside = float(np.mean(np.abs(errors[quantity]) <= 2.0 * deviation))
        label = name if quantity == "position" else ""
        cells = (f"{number(float(v))} {unit}" for v in rms)
        rows.append((label, quantity, *cells, percent(inside)))
    return rows


def _errors(
    name: str,
    colour: str,
    solution: NavigationSolution,
    errors: dict[str, FloatArray],
    spans: Spans,
) -> FigureGrid:
    time = solution.trajectory.time - solution.trajectory.time[0]
    figures = []
    for quantity, deviation in _deviations(solution).items():
        unit, factor = UNITS[quantity]
        bound, error = 2.0 * factor * deviation, factor * errors[quantity]
        settled = slice(time.size // 7, None)  # the first moments may leave the plot
        common = limits(bound[settled], -bound[settled], error[settled])
        for k, direction in enumerate(DIRECTIONS):
            figures.append(
                plot(
                    f"{quantity.capitalize()} error {direction}, {name}",
                    f"Largest error {number(float(np.abs(error[:, k]).max()))} {unit}.",
                    (
                        *band(time, -bound[:, k], bound[:, k], f"{colour}/0.2", "2 sigma"),
                        line(time, error[:, k], colour, "error", width=1.0),
                    ),
                    axis("time in s"),
                    axis(unit, limits=common),
                    height=210,
                    spans=spans,
                )
            )
    legend = [LegendItem("error", colour), LegendItem("claimed 2 sigma", f"{colour}/0.2", "band")]
    if spans:
        legend.append(LegendItem("without GNSS", "@outage/0.14", "band"))
    return FigureGrid(tuple(figures), tuple(legend))


def _claims(answers: Answers) -> str:
    """Tell what the last answer, the smoothed one where there is one, claims."""
    name, _, solution = answers[-1]
    position, attitude = solution.position_sd, np.degrees(solution.attitude_sd)
    values = (np.hypot(position[:, 0], position[:, 1]), position[:, 2], attitude[:, 2])
    horizontal, vertical, heading = (number(float(np.median(v)), 2) for v in values)
    return (
        f"The {name} answer claims to know the position to {horizontal} m (vertically "
        f"{vertical} m) and the heading to {heading} deg: one standard deviation, its median."
    )


def _claimed(answers: Answers, spans: Spans) -> FigureGrid:
    """Return claimed standard deviations over time, causal and smoothed together."""
    figures = []
    for quantity, (unit, factor) in UNITS.items():
        bounds = {name: factor * _deviations(s)[quantity] for name, _, s in answers}
        common = limits(*bounds.values(), log=True)
        for k, direction in enumerate(DIRECTIONS):
            traces: list[dict[str, Any]] = []
            words = []
            for name, colour, solution in answers:
                time = solution.trajectory.time - solution.trajectory.time[0]
                values = bounds[name][:, k]
                traces.append(line(time, values, colour, name, width=1.2))
                words.append(f"{name} median {number(float(np.median(values)))} {unit}")
            about = "about" if quantity == "attitude" else ""
            figures.append(
                plot(
                    f"{quantity.capitalize()} {about} {direction}".replace("  ", " "),
                    ", ".join(words) + ".",
                    traces,
                    axis("time in s"),
                    axis(f"sd in {unit}", log=True, limits=common),
                    height=220,
                    spans=spans,
                )
            )
    legend = [LegendItem(name, colour) for name, colour, _ in answers]
    if spans:
        legend.append(LegendItem("without GNSS", "@outage/0.14", "band"))
    return FigureGrid(
        tuple(figures), tuple(legend), caption="One standard deviation, as the filter claims it."
    )
