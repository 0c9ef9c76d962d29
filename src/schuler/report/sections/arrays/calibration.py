"""Calibration between the IMUs of an array: before and after, phases, places, parameters."""

from __future__ import annotations

from typing import Any

import numpy as np

from schuler.arrays.calibration.disagreement import Disagreement
from schuler.arrays.calibration.result import ArrayCalibration
from schuler.arrays.calibration.review import CalibrationReview, Judgement, PhaseView, RateCurve
from schuler.report.blocks import Block, Facts, FigureGrid, Findings, LegendItem, Section, Table
from schuler.report.figures import axis, encode, limits, line, marks
from schuler.report.makers import plot, remarks, spoken
from schuler.report.numbers import MISSING, compact_with_error, number
from schuler.report.sections.registry import register

CURVES = {
    "nominal mounting": "@walk",
    "calibrated": "@other",
    "and phases tracked": "@data",
    "and the chips' own derivative": "@z",
}
IMU_COLOURS = ("@x", "@y", "@z", "@markov", "@white", "@walk", "@other", "@mark")
MOST_PHASES = 4
NO_ERROR = 1e-6
"""Below this a parameter was held, not estimated."""


@register
def calibration_sections(result: CalibrationReview) -> tuple[Section, ...]:
    """Show a calibration."""
    one = result.calibration
    summary = _summary(result)
    apart: list[Block] = [_facts(result), _curves(result.curves)]
    apart += [_judgement(j) for j in result.judgements]
    if result.phases is not None:
        apart.append(_phases(result.phases, one))
    apart.append(Findings(remarks(map(spoken, one.findings))))
    return (
        Section("Sensors against their mean", tuple(apart), summary),
        Section("What was found", (_places(one), _table(one), *_matrices(one))),
    )


def _summary(result: CalibrationReview) -> tuple[str, ...]:
    sentences = []
    for judged in result.judgements:
        pair = _fastest(judged)
        if pair is None:
            continue
        before, after = pair
        sentences.append(
            f"{judged.name}: gyros {after.condition} disagree by "
            f"{_value(after)[0]} deg/s rms, {_value(before)[0]} with the nominal mounting."
        )
    return tuple(sentences[:3])


def _fastest(judged: Judgement) -> tuple[Disagreement, Disagreement] | None:
    after = [d for d in judged.calibrated if d.quantity == "gyro" and d.limit > 0.0]
    before = {d.condition: d for d in judged.nominal if d.quantity == "gyro"}
    if not after or after[0].condition not in before:
        return None
    return before[after[0].condition], after[0]


def _value(d: Disagreement) -> tuple[str, str]:
    values = np.array([d.rms, d.robust])
    values = np.degrees(values) if d.quantity == "gyro" else values
    return number(float(values[0])), number(float(values[1]))


def _facts(result: CalibrationReview) -> Facts:
    one = result.calibration
    largest = float(np.degrees(np.linalg.norm(one.turn, axis=1).max()))
    items = [
        ("IMUs", str(one.count)),
        ("Static poses", str(one.rests)),
        ("Largest turn from nominal", f"{number(largest)} deg"),
    ]
    if float(one.gyro_scale_sd.max()) > 0.01 * NO_ERROR:
        scale = 100.0 * float(np.abs(one.gyro_scale).max())
        items.append(("Gyro scale, largest", f"{number(scale)} %"))
    if one.period is not None:
        items.append(("Chips sample every", f"{1e3 * one.period:.3f} ms"))
    elif np.ptp(one.delay) > 1e-6:
        items.append(("Delays between IMUs", f"{number(1e3 * float(np.ptp(one.delay)))} ms"))
    if one.gravity_fit is not None:
        before, after = one.gravity_fit
        items.append(("|force| over poses, sd", f"{number(before, 2)} → {number(after, 2)} m/s²"))
    return Facts(tuple(items))


def _curves(curves: tuple[RateCurve, ...]) -> FigureGrid:
    figures = []
    for quantity, words, unit in (("gyro", "Gyros", "deg/s"), ("accel", "Accelerometers", "m/s²")):
        chosen = [c for c in curves if c.quantity == quantity]
        if not chosen:
            continue
        factor = np.degrees(1.0) if quantity == "gyro" else 1.0
        traces = [
            line(np.degrees(c.rate), factor * c.rms, CURVES[c.name], c.name, width=2)
            for c in chosen
        ]
        ends = np.concatenate([factor * c.rms for c in chosen])
        rates = np.concatenate([np.degrees(c.rate[np.isfinite(c.rms)]) for c in chosen])
        x = axis("mean rate in deg/s", log=True, limits=limits(rates, log=True))
        y = axis(f"rms from the mean in {unit}", log=True, limits=limits(ends, log=True))
        text = f"Rms of every {words.lower()[:-1]} minus the mean of all, by the mean rate, "
        text += "before and after."
        figures.append(plot(f"{words} against the rate", text, traces, x, y, height=340))
    names = list(dict.fromkeys(c.name for c in curves))
    legend = tuple(LegendItem(n, CURVES[n]) for n in names)
    return FigureGrid(
        tuple(figures),
        legend,
        columns=2,
        caption="Every component minus the mean of all sensors, rms over the rows of a class of "
        "rates, the sensors and the axes; accelerometers with lever arms taken off except "
        "with the nominal mounting.",
    )


def _judgement(judged: Judgement) -> Table:
    nominal: dict[tuple[str, str], Disagreement] = {
        (d.quantity, d.condition): d for d in judged.nominal
    }
    sharp: dict[tuple[str, str], Disagreement] = {
        (d.quantity, d.condition): d for d in judged.sharpened if d.quantity == "gyro"
    }
    rows = []
    for d in judged.calibrated:
        key = (d.quantity, d.condition)
        words = "gyros, deg/s" if d.quantity == "gyro" else "accelerometers, m/s²"
        cells = [
            f"{_value(x)[0]} / {_value(x)[1]}" if x is not None else MISSING
            for x in (nominal.get(key), d, sharp.get(key))
        ]
        rows.append((words, d.condition, *(cells if sharp else cells[:2]), f"{d.values:,}"))
    headings = ["sensors", "condition", "nominal mounting", "calibrated"]
    headings += ["chips' own derivative"] if sharp else []
    return Table(
        f"{judged.name}: rms / 1.48 MAD of sensor minus mean",
        (*headings, "values"),
        tuple(rows),
        words=(0, 1),
        note=f"Estimated on this recording itself: {judged.estimated}. Rows around saturated "
        "samples are not judged.",
    )


def _phases(view: PhaseView, one: ArrayCalibration) -> FigureGrid:
    order = np.argsort(-np.abs(one.beat))
    picked = order[np.linspace(0, order.size - 1, min(MOST_PHASES, order.size)).astype(int)]
    figures = []
    period = 1e3 * (one.period or 1e-3)
    for i in dict.fromkeys(int(p) for p in picked):
        colour = IMU_COLOURS[i % len(IMU_COLOURS)]
        seen = 1e3 * view.seen[:, i]
        figures.append(
            plot(
                f"{one.names[i]}: {one.beat[i]:+.2f} Hz",
                f"Age of the samples of {one.names[i]} against the mean age: as single samples "
                "show it (points) and as tracked (line).",
                (
                    marks(view.time, seen, f"{colour}/0.55", "single samples", size=4),
                    line(view.time, 1e3 * view.delay[:, i], "@model", "tracked", width=1.2),
                ),
                axis("time in s"),
                axis("age less the mean, ms", limits=(-1.1 * period, 1.1 * period)),
                height=240,
            )
        )
    return FigureGrid(
        tuple(figures),
        (LegendItem("single samples", "@x", "point"), LegendItem("tracked", "@model")),
        columns=2,
        caption="Chips that run free and are polled: the age of a sample is a sawtooth of one "
        "internal period, here less the mean age of all.",
    )


def _places(one: ArrayCalibration) -> FigureGrid:
    figures = []
    centre = one.position.mean(axis=0)
    place = 1e3 * (one.position - centre)
    error = 1e3 * one.position_sd
    for (i, j), words in (((0, 1), "from above"), ((0, 2), "from the side")):
        trace = marks(place[:, i], place[:, j], "@data", "IMU", size=9)
        trace["mode"] = "markers+text"
        trace["text"] = [str(k + 1) for k in range(one.count)]
        # neighbours (both sides of a board) do not write over each other
        trace["textposition"] = [
            "top right" if k % 2 == 0 else "bottom left" for k in range(one.count)
        ]
        trace["hovertemplate"] = "IMU %{text}: %{x:.2f}, %{y:.2f} mm"
        for key, sd in (("error_x", error[:, i]), ("error_y", error[:, j])):
            trace[key] = {
                "type": "data", "array": encode(2.0 * sd), "color": "@data", "thickness": 1.2,
                "width": 3,
            }  # fmt: skip
        traces: list[dict[str, Any]] = [
            marks(np.zeros(1), np.zeros(1), "@mark", "centre", symbol="cross-thin-open"),
            trace,
        ]
        reach = 1.25 * float(np.abs(place).max() + 1e-9)
        figures.append(
            plot(
                f"Where the accelerometers sit, {words}",
                f"Lever arms of the IMUs in the body, {words}, with twice their standard error.",
                traces,
                axis(f"{'xyz'[i]} in mm", limits=(-reach, reach)),
                axis(f"{'xyz'[j]} in mm", limits=(-reach, reach), equal_to="x"),
                height=380,
            )
        )
    return FigureGrid(
        tuple(figures),
        columns=2,
        caption="From the mean of all positions, in the axes of the body. Found from the force "
        "that rotation adds; bars are two standard errors.",
    )


def calibration_rows(one: ArrayCalibration) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return the table of a calibration: an axis of an IMU a row, standard errors in brackets."""
    polled = one.period is not None
    delay = "beat, Hz" if polled else "delay, ms"
    columns = ("IMU", "", "turn, deg", "gyro scale, %", "accel scale, %", "lever arm, mm")
    pairs = (
        (np.degrees(one.turn), np.degrees(one.turn_sd)),
        (100.0 * one.gyro_scale, 100.0 * one.gyro_scale_sd),
        (100.0 * one.accel_scale, 100.0 * one.accel_scale_sd),
        (1e3 * one.position, 1e3 * one.position_sd),
        (np.degrees(one.gyro_bias), np.degrees(one.gyro_bias_sd)),
        (one.accel_bias, one.accel_bias_sd),
    )
    rows: list[tuple[str, ...]] = []
    for i, name in enumerate(one.names):
        late = _estimate(1e3 * float(one.delay[i]), 1e3 * float(one.delay_sd[i]))
        last = f"{one.beat[i]:+.2f}" if polled else late
        for c, letter in enumerate("xyz"):
            cells = [_estimate(float(v[i, c]), float(e[i, c])) for v, e in pairs]
            rows.append((name if c == 0 else "", letter, *cells, last if c == 0 else ""))
    return (*columns, "gyro bias, deg/s", "accel bias, m/s²", delay), rows


def _estimate(value: float, error: float) -> str:
    return compact_with_error(value, error) if error > NO_ERROR else MISSING


def _table(one: ArrayCalibration) -> Table:
    columns, rows = calibration_rows(one)
    return Table(
        "Parameters, the standard error of the last digits in brackets",
        columns,
        tuple(rows),
        words=(0, 1),
        note="Turn: of the gyro triad against its nominal mounting, about the axes of the body. "
        "Scales and biases by the sensor's own axes. The gauge is the mean of all IMUs.",
    )


def _matrices(one: ArrayCalibration) -> tuple[Block, ...]:
    blocks: list[Block] = []
    for words, deviation in (
        ("Gyros", one.gyro_deviation),
        ("Accelerometers", one.accel_deviation),
    ):
        rows = [
            (name if r == 0 else "", "xyz"[r], *(f"{100.0 * v:+.3f}".replace("-", "−")
                                                 for v in deviation[i, r]))
            for i, name in enumerate(one.names)
            for r in range(3)
        ]  # fmt: skip
        blocks.append(
            Table(
                f"{words}: what they show of the body's vector beyond one to one, %",
                ("IMU", "shown", "of x", "of y", "of z"),
                tuple(rows),
                words=(0, 1),
                folded=True,
            )
        )
    return tuple(blocks)
