"""Error models through the same outages: tracks, errors, tables and pairs, as S004 shows them."""

from __future__ import annotations

import numpy as np

from schuler.evaluation.error_model_comparison import METRICS, ErrorModelComparison, Metric
from schuler.evaluation.paired import PERCENTAGES, PairedStatistics
from schuler.report.blocks import Block, FigureGrid, Finding, Findings, LegendItem, Section, Table
from schuler.report.figures import Dash, axis, line, marks
from schuler.report.makers import plot
from schuler.report.numbers import number, percent, with_error
from schuler.report.sections.registry import register

STYLES: tuple[tuple[str, Dash], ...] = (
    ("@x", "solid"),
    ("@z", "solid"),
    ("@y", "solid"),
    ("@markov", "solid"),
    ("@white", "solid"),
    ("@walk", "dash"),
    ("@other", "dash"),
    ("@model", "dash"),
)
"""Colour and dash of each model, in order."""
MOST_TRACKS = 9
"""Windows that are drawn one by one."""
FOLD_ABOVE = 12


def _style(k: int) -> tuple[str, Dash]:
    return STYLES[k % len(STYLES)]


@register
def error_model_sections(comparison: ErrorModelComparison) -> tuple[Section, ...]:
    """Show a comparison of error models."""
    blocks: list[Block] = [_accuracy(comparison), _honesty(comparison), _bars(comparison)]
    if comparison.tracks:
        blocks += [_tracks(comparison), _growth(comparison)]
    if len(comparison.results[0].causal) == 1:
        blocks += [_windows(comparison, "max_m"), _windows(comparison, "mean_m")]
    blocks.append(_pairs(comparison))
    notes = _notes(comparison)
    if notes:
        blocks.append(notes)
    return (Section("Error models compared", tuple(blocks), (_sentence(comparison),)),)


def _sentence(c: ErrorModelComparison) -> str:
    best = min(c.results, key=lambda r: float(r.values("max_m").mean()))
    worst = max(c.results, key=lambda r: float(r.values("max_m").mean()))
    count, draws = best.values().shape[1], best.values().shape[0]
    how = f"{count} outages" + (f" of {draws} draws" if draws > 1 else "")
    first = (
        f"Of {len(c.results)} error models on the same {how}, {best.model.name} has the smallest "
        f"mean of the largest horizontal errors, {number(best.all_causal.mean_of_max_m)} m, and "
        f"{worst.model.name} the largest, {number(worst.all_causal.mean_of_max_m)} m."
    )
    if best.model.name == worst.model.name:
        return first.split(",")[0] + "."
    pair = c.paired(best.model.name, worst.model.name)
    return f"{first} {_verdict(pair)}"


def _verdict(pair: PairedStatistics) -> str:
    if not np.isfinite(pair.standard_errors_apart):
        return "One case says nothing about chance."
    apart = abs(pair.standard_errors_apart)
    if apart >= 2.0:
        return f"The two are {number(apart)} standard errors apart."
    return f"The two are {number(apart)} standard errors apart, which may be chance."


def _accuracy(c: ErrorModelComparison) -> Table:
    smoothed = any(r.smoothed for r in c.results)
    rows = []
    for r in c.results:
        s = r.all_causal
        row = [
            r.model.name,
            number(s.mean_of_max_m),
            number(s.mean_m),
            number(s.rms_m),
            number(s.circular_error_m(0.5)),
            number(s.circular_error_m(0.95)),
            number(s.end_rms_m),
        ]
        if smoothed:
            row.append(number(float(np.mean([w.max_m for q in r.smoothed for w in q.windows]))))
        rows.append(tuple(row))
    columns = (
        "error model",
        "mean of maxima",
        "mean",
        "rms",
        "CEP 50 %",
        "CEP 95 %",
        "rms at the end",
        *(("smoothed: mean of maxima",) if smoothed else ()),
    )
    return Table("Horizontal error over all outages, in m", columns, tuple(rows))


def _honesty(c: ErrorModelComparison) -> Table:
    rows = []
    for r in c.results:
        s = r.all_causal
        floor = s.floor_m
        rows.append(
            (
                r.model.name,
                str(r.model.states),
                number(s.claimed_over_real),
                percent(s.within_2_sigma),
                number(float(np.mean(r.nis))) if r.nis else "",
                number(s.end_rms_m),
                "" if floor is None else number(floor),
            )
        )
    return Table(
        "What the filter claims of itself",
        (
            "error model",
            "states",
            "claimed / real",
            "inside claimed 2 sigma",
            "NIS / degrees",
            "rms at the end in m",
            "white-noise floor in m",
        ),
        tuple(rows),
        note="Claimed / real: claimed standard deviation over real error at all epochs of the "
        "outages, both as root mean squares; below one the filter is overconfident. Floor: what "
        "white noise alone does from a perfect start, without constraints of the vehicle; an rms "
        "below it is a bug or luck.",
    )


def _legend(c: ErrorModelComparison) -> tuple[LegendItem, ...]:
    items = []
    for k, name in enumerate(c.names):
        colour, dash = _style(k)
        items.append(LegendItem(name, colour, "line" if dash == "solid" else "dash"))
    return tuple(items)


def _bars(c: ErrorModelComparison) -> FigureGrid:
    figures = []
    metrics: tuple[Metric, ...] = ("max_m", "mean_m")
    for metric in metrics:
        traces = []
        height = 0.0
        for k, r in enumerate(c.results):
            mean = r.values(metric).mean(axis=0)
            place = np.arange(1, mean.size + 1) + 0.6 * (k + 0.5) / len(c.results) - 0.3
            colour, dash = _style(k)
            hollow = "circle" if dash == "solid" else "circle-open"
            traces.append(marks(place, mean, colour, r.model.name, size=7, symbol=hollow))
            height = max(height, float(mean.max()))
        many = c.results[0].values().shape[1]
        figures.append(
            plot(
                f"Horizontal {METRICS[metric]} of every outage",
                f"{many} outages side by side, one mark for each of {len(c.results)} models.",
                traces,
                axis("outage", limits=(0.5, many + 0.5)),
                axis("m", limits=(0.0, 1.08 * height)),
            )
        )
    return FigureGrid(tuple(figures), _legend(c), columns=2, caption="As S004 figure 26.")


def _shown(c: ErrorModelComparison) -> range:
    return range(min(len(c.tracks), MOST_TRACKS))


def _title(c: ErrorModelComparison, k: int) -> str:
    window = c.results[0].causal[0].windows[k]
    return f"Outage {k + 1}: {number(window.duration_s)} s from {number(window.start_s, 4)} s"


def _tracks(c: ErrorModelComparison) -> FigureGrid:
    figures = []
    for k in _shown(c):
        track = c.tracks[k]
        traces = [
            line(track["reference"][:, 0], track["reference"][:, 1], "@gnss", "reference", width=4)
        ]
        for j, name in enumerate(c.names):
            colour, dash = _style(j)
            traces.append(line(track[name][:, 0], track[name][:, 1], colour, name, dash=dash))
        traces.append(marks([0.0], [0.0], "@model", "GNSS is lost", size=8, symbol="diamond"))
        figures.append(
            plot(
                _title(c, k),
                "East against north, both axes to the same scale; the models part from the grey "
                "reference.",
                traces,
                axis("east in m"),
                axis("north in m", equal_to="x"),
                height=360,
            )
        )
    legend = (
        LegendItem("reference", "@gnss"),
        *_legend(c),
        LegendItem("GNSS is lost", "@model", "diamond"),
    )
    more = len(c.tracks) - len(figures)
    caption = "Tracks through the outages, as S004 figures 21 to 25." + (
        f" {more} more windows are in the tables." if more else ""
    )
    return FigureGrid(tuple(figures), legend, caption=caption)


def _growth(c: ErrorModelComparison) -> FigureGrid:
    figures = []
    for k in _shown(c):
        traces = []
        height = 0.0
        for j, r in enumerate(c.results):
            window = r.causal[0].windows[k]
            colour, dash = _style(j)
            since = window.time - window.start_s
            traces.append(line(since, window.horizontal_m, colour, r.model.name, dash=dash))
            height = max(height, window.max_m)
        floor = c.results[0].causal[0].windows[k].floor
        if floor is not None:
            traces.append(line(since, floor, "@model", "white-noise floor", width=1, dash="dot"))
        figures.append(
            plot(
                _title(c, k),
                f"Horizontal error against time; the highest reaches {number(height)} m.",
                traces,
                axis("time since GNSS was lost in s"),
                axis("horizontal error in m", limits=(0.0, 1.06 * height)),
                height=260,
            )
        )
    legend = (*_legend(c), LegendItem("white-noise floor", "@model", "dot"))
    return FigureGrid(tuple(figures), legend, caption="Error while GNSS is gone.")


def _windows(c: ErrorModelComparison, metric: Metric) -> Table:
    values = [r.values(metric)[0] for r in c.results]
    windows = c.results[0].causal[0].windows
    rows = tuple(
        (
            str(k + 1),
            number(w.start_s, 4),
            number(w.duration_s),
            *(number(float(v[k])) for v in values),
            "" if w.floor_m is None else number(w.floor_m),
        )
        for k, w in enumerate(windows)
    )
    return Table(
        f"Horizontal {METRICS[metric]} of every outage, in m",
        ("outage", "start in s", "length in s", *c.names, "floor at the end"),
        rows,
        words=(),
        note="As S004 tables 9 and 10.",
        folded=len(rows) > FOLD_ABOVE,
    )


def _pairs(c: ErrorModelComparison) -> Table:
    rows = []
    for metric in ("max_m", "mean_m"):
        for i, a in enumerate(c.names):
            for b in c.names[i + 1 :]:
                p = c.paired(a, b, metric)
                error = p.standard_error
                difference = (
                    with_error(p.difference, error)
                    if np.isfinite(error) and error > 0.0
                    else number(p.difference)
                )
                rows.append(
                    (
                        f"{a} against {b}",
                        METRICS[metric],
                        difference,
                        f"{p.wins} of {p.cases}",
                        _chance(p.sign_p),
                        _chance(p.wilcoxon_p),
                        percent(p.mean_of_ratios) if np.isfinite(p.mean_of_ratios) else "",
                        percent(p.ratio_of_sums) if np.isfinite(p.ratio_of_sums) else "",
                    )
                )
    return Table(
        "Model against model on the same cases",
        (
            "pair",
            "figure",
            "first minus second, m",
            "first is better",
            "sign test p",
            "Wilcoxon p",
            "gain, mean of ratios",
            "gain, ratio of sums",
        ),
        tuple(rows),
        words=(0, 1),
        note=f"{PERCENTAGES}. Cases: "
        + (
            "draws of the noise, each by its mean over the outages."
            if len(c.results[0].causal) > 1
            else "the outages of one drive, which are few and share one sensor."
        ),
        folded=len(rows) > FOLD_ABOVE,
    )


def _chance(p: float) -> str:
    return number(p, 2) if np.isfinite(p) else ""


def _notes(c: ErrorModelComparison) -> Findings | None:
    by_note: dict[str, list[str]] = {}
    for r in c.results:
        for note in r.model.notes:
            by_note.setdefault(note, []).append(r.model.name)
    if not by_note:
        return None
    return Findings(
        tuple(Finding("info", note, ", ".join(names)) for note, names in by_note.items())
    )
