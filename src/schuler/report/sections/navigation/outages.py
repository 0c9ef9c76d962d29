"""What happens when GNSS is gone: real error against claimed, causal against smoothed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from schuler.data.gnss import GnssRecording
from schuler.evaluation.outage_windows import OutageStatistics, OutageWindow
from schuler.evaluation.outages import OutageEvaluation
from schuler.report.blocks import FigureGrid, LegendItem, Section, Table
from schuler.report.figures import axis, band, limits, line, marks
from schuler.report.makers import plot
from schuler.report.numbers import number, percent
from schuler.report.sections.navigation.run import NavigationResults, track_figure
from schuler.report.sections.registry import register
from schuler.types import FloatArray

FOLD_ABOVE = 12
"""Tables with more windows than this are shown on demand."""


def answers(evaluation: OutageEvaluation) -> list[tuple[str, str, OutageStatistics]]:
    """Return name, colour and statistics of the answers that exist."""
    every = [("causal", "@causal", evaluation.causal)]
    if evaluation.lagged is not None:
        every.append((f"lag of {number(evaluation.lag or 0.0)} s", "@z", evaluation.lagged))
    return [*every, ("smoothed", "@smoothed", evaluation.smoothed)]


@dataclass(frozen=True, slots=True)
class OutageResults:
    """An outage evaluation with what its map needs."""

    evaluation: OutageEvaluation  # errors with GNSS withheld
    gnss: GnssRecording  # all epochs, those withheld as well

    @property
    def first_run(self) -> NavigationResults:
        """The first run with the windows that were withheld from it."""
        causal, smoothed = self.evaluation.solutions[0]
        start = float(self.gnss.time[0])
        lost = tuple((start + a, start + a + b) for a, b in self.evaluation.runs[0]["outages"])
        return NavigationResults(causal, smoothed, self.gnss, outages=lost)


@register
def outage_results_sections(results: OutageResults) -> tuple[Section, ...]:
    """Show an outage evaluation with a map of its first run."""
    (section,) = outage_sections(results.evaluation)
    return (replace(section, blocks=(*section.blocks, track_figure(results.first_run))),)


@register
def outage_sections(evaluation: OutageEvaluation) -> tuple[Section, ...]:
    """Show an outage evaluation."""
    every = answers(evaluation)
    blocks = (
        _overall(every),
        _honesty(every),
        _growth(every),
        _claims(every),
        _windows(every),
        *((_bands(evaluation.causal),) if len(evaluation.causal.windows) <= FOLD_ABOVE else ()),
    )
    return (Section("Outages", blocks, tuple(_sentence(n, s) for n, _, s in every)),)


def _lengths(windows: tuple[OutageWindow, ...]) -> str:
    lengths = sorted({w.duration_s for w in windows})
    if len(lengths) == 1:
        return f"{number(lengths[0])} s"
    return f"{number(lengths[0])} to {number(lengths[-1])} s"


def _sentence(name: str, s: OutageStatistics) -> str:
    count = len(s.windows)
    how = {"causal": "with the data up to each moment (causal)", "smoothed": "smoothed"}.get(
        name, f"with a {name}"
    )
    return (
        f"With GNSS withheld {count} time{'' if count == 1 else 's'} for {_lengths(s.windows)}, "
        f"the largest horizontal error {how} is {number(s.mean_of_max_m)} m on average and "
        f"{number(s.worst_m)} m at worst; {percent(s.within_2_sigma)} of the errors lie inside "
        f"the claimed 95 % ellipse."
    )


def _overall(answers: list[tuple[str, str, OutageStatistics]]) -> Table:
    rows = tuple(
        (
            name,
            str(len(s.windows)),
            number(s.mean_of_max_m),
            number(s.median_of_max_m),
            number(s.worst_m),
            number(s.mean_m),
            number(s.rms_m),
            number(s.circular_error_m(0.5)),
            number(s.circular_error_m(0.95)),
        )
        for name, _, s in answers
    )
    return Table(
        "Horizontal error over all windows, in m",
        (
            "answer",
            "windows",
            "mean of maxima",
            "median of maxima",
            "worst",
            "mean",
            "rms",
            "CEP 50 %",
            "CEP 95 %",
        ),
        rows,
        note="Maximum: largest horizontal error inside a window, against the GNSS positions that "
        "were withheld. CEP: radius that holds this share of all errors.",
    )


def _honesty(answers: list[tuple[str, str, OutageStatistics]]) -> Table:
    rows = tuple(
        (
            name,
            percent(s.within_2_sigma),
            number(s.claimed_over_real),
            number(s.end_rms_m) if name == "causal" else "",
            "" if s.floor_m is None or name != "causal" else number(s.floor_m),
        )
        for name, _, s in answers
    )
    return Table(
        "What is claimed, and the floor",
        (
            "answer",
            "inside claimed 2 sigma",
            "claimed / real",
            "rms at the end in m",
            "white-noise floor in m",
        ),
        rows,
        note="Inside: share of errors within the 95.4 % ellipse that the filter claims. Claimed / "
        "real: root mean squares over all epochs of the windows; below one is overconfident. "
        "Floor: what the white noise of the sensor alone does from a perfect start, without "
        "constraints of the vehicle (g N t^5/2 / sqrt(20) and N t^3/2 / sqrt(3) an axis).",
    )


def _errors(window: OutageWindow) -> tuple[FloatArray, FloatArray]:
    """Return seconds since the start of the window and horizontal error."""
    return window.time - window.start_s, np.hypot(window.error_ned[:, 0], window.error_ned[:, 1])


def _growth(answers: list[tuple[str, str, OutageStatistics]]) -> FigureGrid:
    figures = []
    for name, colour, s in answers:
        traces = []
        heights = [1e-3]
        for window in s.windows:
            since, error = _errors(window)
            traces.append(
                line(since, error, f"{colour}/0.55", f"from {number(window.start_s, 4)} s", width=1)
            )
            heights.append(float(error.max(initial=0.0)))
        since, claimed = _typical_claim(s)
        heights.append(float(claimed.max(initial=0.0)))
        traces.append(line(since, claimed, "@model", "claimed 2 sigma", width=1.6, dash="dash"))
        floor = max(s.windows, key=lambda w: w.time.size).floor
        if floor is not None and name == "causal":
            traces.append(line(since, floor, "@model", "white-noise floor", width=1.2, dash="dot"))
        figures.append(
            plot(
                f"Error while GNSS is gone, {name}",
                f"One line for each of {len(s.windows)} windows; the highest reaches "
                f"{number(s.worst_m)} m.",
                traces,
                axis("time since GNSS was lost in s"),
                axis("horizontal error in m", limits=(0.0, 1.06 * max(heights))),
            )
        )
    legend = (
        LegendItem("one window, causal", "@causal"),
        LegendItem("one window, smoothed", "@smoothed"),
        *(
            (LegendItem("one window, fixed lag", "@z"),)
            if any(name.startswith("lag") for name, _, _ in answers)
            else ()
        ),
        LegendItem("claimed 2 sigma, median of the windows", "@model", "dash"),
        LegendItem("white-noise floor, 1 sigma", "@model", "dot"),
    )
    return FigureGrid(tuple(figures), legend, columns=3 if len(figures) > 2 else 2)


def _typical_claim(s: OutageStatistics) -> tuple[FloatArray, FloatArray]:
    """Return the median over the windows of twice the claimed horizontal deviation."""
    longest = max(s.windows, key=lambda w: w.time.size)
    since = longest.time - longest.start_s
    claims = [
        np.interp(
            since,
            w.time - w.start_s,
            2.0 * np.sqrt(np.trace(w.covariance, axis1=1, axis2=2)),
            right=np.nan,
        )
        for w in s.windows
    ]
    return since, np.nanmedian(claims, axis=0)


def _bands(s: OutageStatistics) -> FigureGrid:
    """Return north and east errors of each window inside their claimed bands."""
    figures = []
    for w in s.windows:
        since = w.time - w.start_s
        sd = np.sqrt(np.diagonal(w.covariance, axis1=1, axis2=2))
        traces = []
        for k, (direction, colour) in enumerate((("north", "@x"), ("east", "@y"))):
            bound = 2.0 * sd[:, k]
            traces += band(since, -bound, bound, f"{colour}/0.13", f"2 sigma {direction}")
            traces.append(line(since, w.error_ned[:, k], colour, direction))
        figures.append(
            plot(
                f"From {number(w.start_s, 4)} s",
                f"Largest horizontal error {number(w.max_m)} m.",
                traces,
                axis("time since GNSS was lost in s"),
                axis("error in m"),
                height=230,
            )
        )
    legend = (
        LegendItem("north", "@x"),
        LegendItem("east", "@y"),
        LegendItem("their claimed 2 sigma", "@x/0.2", "band"),
    )
    return FigureGrid(
        tuple(figures), legend, caption="Causal errors of each window with twice the claimed sd."
    )


def _claims(answers: list[tuple[str, str, OutageStatistics]]) -> FigureGrid:
    figures = []
    for name, colour, s in answers:
        claimed = np.array([w.claimed_sd_m for w in s.windows])
        real = np.array([w.max_m for w in s.windows])
        low, high = limits(claimed, real, log=True)
        ends = np.array([low, high])
        text = tuple(
            f"from {number(w.start_s, 4)} s: {number(w.max_m)} m, claimed {number(w.claimed_sd_m)}"
            for w in s.windows
        )
        figures.append(
            plot(
                f"Largest error against claimed standard deviation, {name}",
                f"{len(s.windows)} windows; points above the dashed line exceed 2 sigma.",
                (
                    line(ends, ends, "@other", "1 sigma", width=1, dash="dot"),
                    line(ends, 2 * ends, "@other", "2 sigma", width=1.2, dash="dash"),
                    marks(claimed, real, colour, name, size=8, text=text),
                ),
                axis("claimed standard deviation in m", log=True, limits=(low, high)),
                axis("largest error in m", log=True, limits=(low, high)),
            )
        )
    legend = (
        LegendItem("one window", "@causal", "point"),
        LegendItem("error = 1 sigma", "@other", "dot"),
        LegendItem("error = 2 sigma", "@other", "dash"),
    )
    return FigureGrid(tuple(figures), legend, columns=3 if len(figures) > 2 else 2)


def _windows(answers: list[tuple[str, str, OutageStatistics]]) -> Table:
    columns = ["start in s", "length in s"]
    for name, _, _ in answers:
        columns += [f"{name}: max", "mean", "claimed sd", "inside 2 sigma"]
    rows = []
    for parallel in zip(*(s.windows for _, _, s in answers), strict=True):
        row = [number(parallel[0].start_s, 4), number(parallel[0].duration_s)]
        for w in parallel:
            row += [number(w.max_m), number(w.mean_m), number(w.claimed_sd_m)]
            row.append(percent(w.within_2_sigma))
        rows.append(tuple(row))
    return Table(
        "Every window, errors in m",
        tuple(columns),
        tuple(rows),
        words=(),
        folded=len(rows) > FOLD_ABOVE,
    )
