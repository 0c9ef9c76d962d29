"""A trajectory against a reference: how far off, in which direction, and whether it knew."""

from __future__ import annotations

import numpy as np

from schuler.data.trajectory import DIRECTIONS
from schuler.evaluation.accuracy import TrajectoryEvaluation
from schuler.report.blocks import (
    Block,
    Facts,
    Figure,
    FigureGrid,
    Finding,
    Findings,
    LegendItem,
    Section,
    Table,
)
from schuler.report.figures import AXIS_COLOURS, axis, band, broken_at_gaps, limits, line
from schuler.report.makers import plot, spoken
from schuler.report.numbers import MISSING, duration, number, percent
from schuler.report.sections.registry import register
from schuler.types import FloatArray


@register
def evaluation_sections(found: TrajectoryEvaluation) -> tuple[Section, ...]:
    """Show the errors of a trajectory."""
    facts = Facts(
        (
            ("Trajectory", found.name),
            ("Reference", found.truth_name),
            ("Compared", f"{found.samples} moments in {duration(found.duration_s)}"),
            ("Way", f"{number(found.distance / 1000.0)} km"),
        )
    )
    tables = (error_table(found), relative_table(found), window_table(found))
    blocks: list[Block] = [facts, *(Table(*t) for t in tables if t[2])]
    blocks.append(_figures(found))
    items = tuple(Finding("info", spoken(note)) for note in found.notes)
    items += tuple(Finding("warning", text) for text in claims_judged(found))
    blocks += [Findings(items)] if items else []
    title = f"Errors of {found.name} against the reference"
    return (Section(title, tuple(blocks), answer(found)),)


def answer(found: TrajectoryEvaluation) -> tuple[str, ...]:
    """Return how good the trajectory is, in up to three sentences."""
    flat = found.horizontal_m
    share = 100.0 * flat["rms"] / found.distance if found.distance else np.nan
    said = [
        f"{found.name} is {number(flat['rms'])} m off {found.truth_name} horizontally (rms; "
        f"95 % {number(flat['p95'])} m, largest {number(flat['max'])} m) and "
        f"{number(found.vertical_m['rms'])} m vertically, over {number(found.distance)} m of way "
        f"({number(share)} %)."
    ]
    claims = found.claims
    if claims is not None:
        inside = np.mean(list(claims["within_2_sigma"].values()))
        said.append(
            f"{percent(float(inside))} of its errors are within twice what it claims (honest is "
            f"95 %); squared errors are {number(claims['nees_per_axis'])} times the claim "
            "(honest is 1)."
        )
    return tuple(said)


def claims_judged(found: TrajectoryEvaluation) -> tuple[str, ...]:
    """Return what is wrong with clock and claimed deviations, where that is plain."""
    said, shift = [], found.time_shift
    if shift is not None:
        said.append(
            f"Another clock explains {100.0 * shift.explained:.0f} % of the squared error: with "
            f"{shift.offset_s:+.3f} s (± {shift.sd_s:.2g}) more on the time of the reference "
            f"(--truth-offset), {number(shift.remaining_m)} m RMS would remain."
        )
    claims = found.claims
    if claims is None:
        return tuple(said)
    ratio = claims["nees_per_axis"]
    real = f"real errors are {number(ratio**0.5)} times as large"
    if ratio > 4.0:
        said.append(f"Its claimed deviations are too small: {real}.")
    elif ratio < 0.1:
        said.append(f"Its claimed deviations are too large: {real}.")
    return tuple(said)


def error_table(
    found: TrajectoryEvaluation,
) -> tuple[str, tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Return caption, headings and rows of the absolute errors."""
    spreads = (("in space (ATE)", found.ate_m), ("horizontal", found.horizontal_m))
    rows = [
        (name, *(f"{number(s[k])} m" for k in ("rms", "mean", "median", "p95", "max")))
        for name, s in (*spreads, ("vertical", found.vertical_m))
    ]
    for direction, e in zip(DIRECTIONS, found.error.T, strict=True):
        a = np.abs(e)
        values = (np.sqrt(np.mean(e**2)), e.mean(), np.median(e), np.quantile(a, 0.95), a.max())
        rows.append((direction, *(f"{number(float(v))} m" for v in values)))
    for name, unit, factor, errors in (
        ("velocity", "m/s", 1.0, found.velocity_error),
        ("attitude", "deg", 180.0 / np.pi, found.attitude_error),
    ):
        if errors is not None:
            size = factor * np.linalg.norm(errors, axis=1)
            spread = (np.sqrt(np.mean(size**2)), size.mean(), np.median(size))
            ends = (np.quantile(size, 0.95), size.max())
            rows.append((name, *(f"{number(float(v))} {unit}" for v in (*spread, *ends))))
    columns = ("absolute error", "rms", "mean", "median", "95 % below", "largest")
    return "Absolute errors", columns, tuple(rows)


def relative_table(
    found: TrajectoryEvaluation,
) -> tuple[str, tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Return caption, headings and rows of the relative errors."""
    rows = tuple(
        (
            f"over {number(r.over)} {r.unit}",
            f"{number(r.rms_m)} m",
            f"{number(r.worst_m)} m",
            f"{number(100.0 * r.rms_m / r.over)} %" if r.unit == "m" else MISSING,
            MISSING if np.isnan(r.rms_rad) else f"{number(np.degrees(r.rms_rad))} deg",
            str(r.pairs),
        )
        for r in found.relative
    )
    columns = ("relative error (RPE)", "rms", "largest", "of the way", "angle, rms", "pairs")
    return "Relative errors between two moments", columns, rows


def window_table(
    found: TrajectoryEvaluation,
) -> tuple[str, tuple[str, ...], tuple[tuple[str, ...], ...]]:
    """Return caption, headings and rows of the stretches that were asked for."""
    rows = tuple(
        (
            f"{number(w.start_s, 4)} s",
            f"{number(w.duration_s)} s",
            *(f"{number(v)} m" for v in (w.max_m, w.mean_m, w.end_m)),
        )
        for w in found.windows
    )
    columns = ("window from", "length", "largest horizontal", "mean", "at its end")
    return "Windows", columns, rows


def _figures(found: TrajectoryEvaluation) -> FigureGrid:
    figures = []
    for k, direction in enumerate(DIRECTIONS):
        sd = None if found.claimed_sd is None else 2.0 * found.claimed_sd[:, k]
        figures.append(_error_figure(found, k, direction, sd))
    legend = [LegendItem("error", "@x")]
    if found.claimed_sd is not None:
        legend.append(LegendItem("twice the claimed sd", "@band/0.2", "band"))
    return FigureGrid(
        tuple(figures), tuple(legend), caption="Estimated minus reference, in metres."
    )


def _error_figure(
    found: TrajectoryEvaluation, k: int, direction: str, bound: FloatArray | None
) -> Figure:
    time, error = broken_at_gaps(found.time - found.time[0], found.error[:, k])
    traces = [line(time, error, AXIS_COLOURS[direction], direction, width=1.1)]
    reach = [error]
    if bound is not None:
        around = band(found.time - found.time[0], -bound, bound, "@band/0.2", "2 sigma")
        traces = [*around, *traces]
        top = 1.5 * float(np.nanmax(np.abs(error)))
        reach += [np.minimum(bound, top), -np.minimum(bound, top)]
    return plot(
        f"Error {direction}",
        f"Between {number(float(np.nanmin(error)))} and {number(float(np.nanmax(error)))} m.",
        traces,
        axis("time in s"),
        axis("m", limits=limits(*reach)),
        height=240,
    )
