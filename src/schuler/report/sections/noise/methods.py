"""Several methods side by side: theory over data, and the parameters with their differences."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from schuler.estimation.comparison.curves import Theory
from schuler.estimation.comparison.methods import ImuMethodComparison, MethodComparison
from schuler.estimation.comparison.parameters import ParameterAgreement
from schuler.estimation.identify import METHODS
from schuler.report.blocks import (
    Block,
    Facts,
    FigureGrid,
    Finding,
    Findings,
    LegendItem,
    Section,
    Table,
)
from schuler.report.figures import Dash, axis, band, limits, line, marks
from schuler.report.makers import channel_grid, plot
from schuler.report.numbers import MISSING, compact_with_error, duration, number
from schuler.report.sections.noise.estimators import estimator_sections
from schuler.report.sections.noise.method_words import quantity, shown_name, unit_of
from schuler.report.sections.noise.residuals import residual_section
from schuler.report.sections.registry import register
from schuler.types import FloatArray

Channels = dict[str, MethodComparison]

STROKES: dict[str, tuple[str, Dash, float]] = {
    "allan": ("@model", "solid", 2.0),
    "slope": ("@mark", "dash", 1.4),
    "psd": ("@z", "solid", 1.4),
    "autocorrelation": ("@other", "dash", 1.4),
    "gmwm": ("@markov", "solid", 1.4),
    "gmwm-robust": ("@markov", "dash", 1.4),
    "ml": ("@walk", "dash", 1.6),
    "ar": ("@white", "solid", 1.4),
    "ar-covariance": ("@white", "dash", 1.4),
    "ar-yule-walker": ("@white", "dot", 1.4),
    "arma": ("@causal", "dot", 1.8),
    "fos": ("@other", "dot", 1.4),
}
"""Colour, stroke and width of the theory of each method; GARCH has that of its AR part."""


@register
def imu_method_sections(result: ImuMethodComparison) -> tuple[Section, ...]:
    """Show several methods on all channels of a recording."""
    return _sections(result.channels, result.duration)


@register
def method_sections(result: MethodComparison) -> tuple[Section, ...]:
    """Show several methods on one signal."""
    return _sections({result.name: result}, result.samples / result.rate)


def _sections(channels: Channels, length: float) -> tuple[Section, ...]:
    first = next(iter(channels.values()))
    methods = [m for m in METHODS if any(m in c.results for c in channels.values())]
    verdicts = [c.agree for c in channels.values() if c.agree is not None]
    agree = f"{sum(verdicts)} of {len(verdicts)} channels" if verdicts else MISSING
    if len(channels) == 1 and verdicts:
        agree = "yes" if verdicts[0] else "no"
    facts = Facts(
        (
            ("Length of the record", duration(length)),
            ("Rate", f"{first.rate:.6g} Hz"),
            ("Methods", str(len(methods))),
            ("Methods agree on all they share", agree),
        )
    )
    blocks: list[Block] = [facts, _allan(channels, methods), parameter_table(channels)]
    blocks += [_findings(channels), _words(methods), _failures(channels)]
    theory = (_allan_ratio(channels, methods), _spectra(channels, methods))
    sections = [
        Section("Methods side by side", tuple(b for b in blocks if _filled(b)), _short(channels)),
        Section("Theory over data", (*theory, _correlations(channels, methods))),
        residual_section(channels),
        *estimator_sections(channels),
    ]
    return tuple(s for s in sections if s.blocks)


def _filled(block: Block) -> bool:
    return not (isinstance(block, Table) and not block.rows)


def _short(channels: Channels) -> tuple[str, ...]:
    """One sentence on agreement, and the first crossing that was found."""
    lines = []
    agreeing = [shown_name(k) for k, c in channels.items() if c.agree]
    apart = [shown_name(k) for k, c in channels.items() if c.agree is False]
    if apart and len(channels) > 1:
        lines.append(
            f"Methods agree within two combined standard deviations on {len(agreeing)} of "
            f"{len(agreeing) + len(apart)} channels; apart: {', '.join(apart)}."
        )
    elif agreeing and len(channels) > 1:
        lines.append("All methods agree within two combined standard deviations on every channel.")
    for name, comparison in channels.items():
        crossing = [f for f in comparison.findings if "where N and K cross" in f]
        if crossing:
            lines.append(f"{_named(name)}{crossing[0]}.")
            break
    if len(channels) == 1:
        lines += [f"{f[:1].upper()}{f[1:]}." for c in channels.values() for f in c.findings[:2]]
    return tuple(dict.fromkeys(lines))


def _named(name: str) -> str:
    return f"{shown_name(name)}: " if name else ""


def _findings(channels: Channels) -> Findings:
    grouped: dict[str, list[str]] = {}
    for name, comparison in channels.items():
        for text in comparison.findings:
            grouped.setdefault(text, []).append(_lower(shown_name(name)) if name else "")
    items = []
    for text, names in grouped.items():
        where = ", ".join(filter(None, names))
        every = len(names) == len(channels) > 1
        bad = any(words in text for words in _WATCH)
        label = "All channels" if every else where[:1].upper() + where[1:]
        items.append(Finding("warning" if bad else "info", f"{label}: {text}" if label else text))
    return Findings(tuple(items))


def _lower(title: str) -> str:
    return title[:1].lower() + title[1:]


_WATCH = ("methods differ", "no sum of", "is biased", "outliers decide", "lines stand")
"""Words of findings that call for attention."""


def _failures(channels: Channels) -> Table:
    rows = [
        (shown_name(name), method, text)
        for name, c in channels.items()
        for method, text in c.failures.items()
    ]
    return Table(
        "Methods without an answer",
        ("channel", "method", "why"),
        tuple(rows),
        words=(0, 1, 2),
        folded=True,
    )


def _words(methods: list[str]) -> Table:
    rows = tuple((m, METHODS[m]) for m in methods)
    return Table("What the methods are", ("method", "what it does"), rows, (0, 1), folded=True)


def parameter_table(channels: Channels) -> Table:
    """Return the parameters of all channels, a column for each method."""
    compared = [p for c in channels.values() for p in c.parameters]
    shown = [m for m in METHODS if any(m in p.values for p in compared)]
    rows: list[tuple[str, ...]] = []
    for name, comparison in channels.items():
        label = shown_name(name)
        for p in comparison.parameters:
            words, unit, factor = quantity(p.parameter, name)
            cells = (_cell(p, m, factor) for m in shown)
            rows.append((label, words, unit, *cells, *_verdict(p)))
            label = ""
    structures = {c.structure for c in channels.values()}
    return Table(
        "Parameters by method, the standard error of the last digits in brackets",
        ("channel", "parameter", "unit", *shown, "apart", "agree"),
        tuple(rows),
        words=(0, 1, 2),
        note="Apart: the largest difference between any two methods that fit a structure, in "
        "combined standard deviations (slope and autocorrelation are readings of one curve, "
        "gmwm-robust asks for the bulk of the samples: they have no say). The methods share their "
        "data, so that differences are more significant "
        f"than this number says. Structure: {'; '.join(sorted(structures))}.",
    )


def residual_words(channels: Channels) -> tuple[tuple[str, ...], ...]:
    """Return what each method leaves of each channel, in words."""
    rows = []
    for name, c in channels.items():
        label = shown_name(name)
        for method, left in c.residuals.items():
            rows.append((label, method, left.verdict))
            label = ""
    return tuple(rows)


def _cell(p: ParameterAgreement, method: str, factor: float) -> str:
    if method not in p.values:
        return MISSING
    return compact_with_error(p.values[method] / factor, p.standard_errors[method] / factor)


def _verdict(p: ParameterAgreement) -> tuple[str, str]:
    if p.agree is None:
        return MISSING, MISSING
    return number(p.worst, 2), "yes" if p.agree else "no"


def _lines(
    comparison: MethodComparison,
    methods: list[str],
    x: FloatArray,
    pick: Callable[[Theory], FloatArray | None],
    factor: float = 1.0,
) -> list[dict[str, Any]]:
    traces = []
    for method in methods:
        theory = comparison.theory.get(method)
        values = None if theory is None or method not in STROKES else pick(theory)
        if values is not None:
            colour, dash, width = STROKES[method]
            traces.append(line(x, values / factor, colour, method, width=width, dash=dash))
    return traces


def _legend(methods: list[str], interval: str) -> tuple[LegendItem, ...]:
    items = [LegendItem("measured", "@data", "point"), LegendItem(interval, "@data/0.22", "band")]
    for method in methods:
        if method in STROKES:
            colour, dash, _ = STROKES[method]
            mark = {"solid": "line", "dash": "dash", "dot": "dot", "dashdot": "dash"}[dash]
            items.append(LegendItem(method, colour, mark))  # type: ignore[arg-type]
    return tuple(items)


def _log_axis(title: str, values: FloatArray) -> dict[str, Any]:
    return axis(title, log=True, limits=limits(values, log=True, margin=0.03))


def _allan(channels: Channels, methods: list[str]) -> FigureGrid:
    figures = []
    for name, c in channels.items():
        unit, factor = unit_of(name)
        curve = c.allan
        traces = band(curve.tau, curve.lower / factor, curve.upper / factor, "@data/0.22", "95 %")
        traces.append(marks(curve.tau, curve.deviation / factor, "@data", "measured", size=3.5))
        traces += _lines(c, methods, curve.tau, lambda t: t.allan, factor)
        figures.append(
            plot(
                shown_name(name),
                f"Measured Allan deviation and that of {len(c.theory)} methods.",
                traces,
                axis(
                    "cluster time in s", log=True, limits=limits(curve.tau, log=True, margin=0.03)
                ),
                axis(
                    f"Allan deviation{unit and f' in {unit}'}",
                    log=True,
                    limits=limits(curve.lower / factor, curve.upper / factor, log=True),
                ),
                height=310,
            )
        )
    return channel_grid(
        figures,
        _legend(methods, "its 95 % interval"),
        "Allan deviation: points are measured, lines are what the process of each method "
        "says it is.",
    )


def _allan_ratio(channels: Channels, methods: list[str]) -> FigureGrid:
    figures = []
    for name, c in channels.items():
        curve = c.allan
        down, up = curve.lower / curve.deviation, curve.upper / curve.deviation
        traces = band(curve.tau, 100.0 * (down - 1.0), 100.0 * (up - 1.0), "@data/0.22", "95 %")
        traces += [
            t | {"hovertemplate": "%{x:.3~g} s: %{y:.2f} %"}
            for t in _lines(
                c,
                methods,
                curve.tau,
                lambda t, d=curve.deviation: (
                    None  # type: ignore[misc]
                    if t.allan is None
                    else 100.0 * (t.allan / d - 1.0)
                ),
            )
        ]
        figures.append(
            plot(
                shown_name(name),
                "Modelled over measured Allan deviation, in per cent.",
                traces,
                axis(
                    "cluster time in s", log=True, limits=limits(curve.tau, log=True, margin=0.03)
                ),
                axis("model above data in %", limits=(-40.0, 40.0)),
                height=260,
            )
        )
    return channel_grid(
        figures,
        _legend(methods, "95 % interval of the data")[1:],
        "The same as a ratio, which shows what a logarithmic axis hides. A line inside the "
        "area fits; one that leaves it misses the data there.",
    )


def _spectra(channels: Channels, methods: list[str]) -> FigureGrid:
    figures = []
    for name, c in channels.items():
        unit, factor = unit_of(name)
        curve = c.spectrum
        two = 0.5 if curve.onesided else 1.0
        low, high = (np.sqrt(two * v) / factor for v in (curve.lower, curve.upper))
        traces = band(curve.frequency, low, high, "@data/0.22", "95 %")
        root = np.sqrt(curve.two_sided) / factor
        traces.append(marks(curve.frequency, root, "@data", "measured", size=3.5))
        traces += _lines(
            c,
            methods,
            curve.frequency,
            lambda t: None if t.density is None else np.sqrt(t.density),
            factor,
        )
        figures.append(
            plot(
                shown_name(name),
                f"Measured root density and that of {len(c.theory)} methods.",
                traces,
                _log_axis("frequency in Hz", curve.frequency),
                axis(
                    f"root density{unit and f' in {unit}/√Hz'}",
                    log=True,
                    limits=limits(root, low[root > 0.0], log=True),
                ),
                height=310,
            )
        )
    return channel_grid(
        figures,
        _legend(methods, "its 95 % interval"),
        "Root of the two-sided power spectral density (white noise reads N). The theory is "
        "that of the samples, aliases included.",
    )


def _correlations(channels: Channels, methods: list[str]) -> FigureGrid:
    figures = []
    for name, c in channels.items():
        points = c.correlation
        traces = band(points.lag, -points.band, points.band, "@data/0.22", "95 % of white noise")
        traces.append(marks(points.lag, points.correlation, "@data", "measured", size=4))
        traces += _lines(c, methods, points.lag, lambda t: t.correlation)
        figures.append(
            plot(
                shown_name(name),
                "Measured autocorrelation and that of the methods.",
                traces,
                _log_axis("lag in s", points.lag),
                axis("autocorrelation", limits=limits(points.correlation, points.band, 0.0)),
                height=280,
            )
        )
    return channel_grid(
        figures,
        _legend(methods, "95 % band of white noise whose variance may change"),
        "Autocorrelation, averaged over neighbouring lags. The theory is what a record of "
        "this length shows on average: removing the mean and slow noise bend it below zero.",
    )
