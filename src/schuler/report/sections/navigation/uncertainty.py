"""Claimed uncertainty over time, and real errors against it where truth is known."""

from __future__ import annotations

from typing import Any

import numpy as np

from schuler.data.trajectory import NavigationSolution, Trajectory
from schuler.earth import metres_per_radian
from schuler.report.blocks import Block, FigureGrid, LegendItem, Prose, Section, Table
from schuler.report.figures import axis, band, limits, line
from schuler.report.makers import plot
from schuler.report.numbers import number, percent
from schuler.types import FloatArray

Spans = tuple[tuple[float, float], ...]
Answers = tuple[tuple[str, str, NavigationSolution], ...]
DIRECTIONS = ("north", "east", "down")
WITHIN_2_SIGMA = 0.954


def uncertainty_section(answers: Answers, truth: Trajectory | None, spans: Spans) -> Section:
    """Show claimed standard deviations, with real errors where there is a truth."""
    if truth is None:
        return Section("Claimed uncertainty", (_claimed(answers, spans),))
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
