"""What models leave of a signal: correlation, shape, and the tests of both."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from schuler.estimation.comparison.methods import MethodComparison
from schuler.estimation.residuals.diagnostics import ResidualDiagnostics
from schuler.report.blocks import Block, FigureGrid, LegendItem, Prose, Section, Table
from schuler.report.figures import axis, band, limits, line, marks
from schuler.report.makers import channel_grid, plot
from schuler.report.numbers import MISSING, number
from schuler.report.sections.noise.method_words import shown_name, unit_of

Channels = dict[str, MethodComparison]

_STRUCTURES = ("ml", "gmwm", "allan", "psd", "gmwm-robust", "autocorrelation", "slope")
_PREDICTORS = ("garch", "arma", "ar", "ar-covariance", "fos", "ar-yule-walker")


def residual_section(channels: Channels) -> Section:
    """Show the one-step errors of the methods."""
    if not any(c.residuals for c in channels.values()):
        return Section("What the models leave", ())
    drawn = {name: _drawn(c) for name, c in channels.items()}
    blocks: tuple[Block, ...] = (
        Prose(
            "Every model predicts each sample from those before it. What is left should be white; "
            "the tests say whether it is. In long records the smallest blemish is significant, so "
            "look at the size of the correlation beside its p-value."
        ),
        _correlations(channels, drawn),
        _quantiles(channels, drawn),
        _tests(channels),
        _floor(channels),
    )
    return Section("What the models leave", blocks)


def _drawn(comparison: MethodComparison) -> list[str]:
    """The best method that fits a structure and the best that predicts samples."""
    shown = []
    for group in (_STRUCTURES, _PREDICTORS):
        shown += [m for m in group if m in comparison.residuals][:1]
    return shown


_MOST_ROWS = 45
_COLOURS = ("@data", "@mark")


def _legend(drawn: dict[str, list[str]], more: tuple[LegendItem, ...]) -> tuple[LegendItem, ...]:
    names: dict[tuple[int, str], None] = {}
    for methods in drawn.values():
        for method in methods:
            names[0 if method in _STRUCTURES else 1, method] = None
    items = [LegendItem(m, _COLOURS[k], "point") for k, m in sorted(names)]
    return (*items, *more)


def _colour(method: str) -> str:
    return _COLOURS[0 if method in _STRUCTURES else 1]


def _correlations(channels: Channels, drawn: dict[str, list[str]]) -> FigureGrid:
    figures = []
    for name, c in channels.items():
        traces: list[dict[str, Any]] = []
        values = []
        for method in drawn[name]:
            left = c.residuals[method]
            lags = np.arange(1, left.correlation.size + 1)
            shade = f"{_colour(method)}/0.18"
            traces += band(lags, -left.robust_band, left.robust_band, shade, f"95 %, {method}")
            values.append(left.robust_band)
            shift = 0.0 if method in _STRUCTURES else 0.25
            traces.append(marks(lags + shift, left.correlation, _colour(method), method, size=4.5))
            values.append(left.correlation)
        figures.append(
            plot(
                shown_name(name),
                f"Autocorrelation of the one-step errors of {', '.join(drawn[name])}.",
                traces,
                axis("lag in steps", limits=(0.0, 41.0)),
                axis("autocorrelation", limits=limits(*values, *(-v for v in values), margin=0.1)),
                height=250,
            )
        )
    band_item = LegendItem("95 % of white noise whose variance may change", "@data/0.22", "band")
    return channel_grid(
        figures, _legend(drawn, (band_item,)), "Autocorrelation of the one-step errors."
    )


def _quantiles(channels: Channels, drawn: dict[str, list[str]]) -> FigureGrid:
    figures = []
    for name, c in channels.items():
        traces: list[dict[str, Any]] = [
            line([-4.0, 4.0], [-4.0, 4.0], "@other", "Gaussian", dash="dash")
        ]
        values = []
        for method in drawn[name]:
            left = c.residuals[method]
            traces.append(
                marks(left.normal_quantiles, left.quantiles, _colour(method), method, size=4)
            )
            values.append(left.quantiles)
        figures.append(
            plot(
                shown_name(name),
                "Quantiles of the one-step errors against those of Gaussian noise.",
                traces,
                axis("Gaussian quantile", limits=(-3.2, 3.2)),
                axis("quantile over sd", limits=limits(*values, [-3.2, 3.2])),
                height=250,
            )
        )
    return channel_grid(
        figures,
        _legend(drawn, (LegendItem("Gaussian", "@other", "dash"),)),
        "Quantiles of the one-step errors over their standard deviation: steps are the "
        "grid on which the sensor writes its values, ends that bend away are heavy tails.",
    )


def _tests(channels: Channels) -> Table:
    rows: list[tuple[str, ...]] = []
    for name, c in channels.items():
        label = shown_name(name)
        for method, left in c.residuals.items():
            step = f"{number(left.block / c.rate, 2)} s" if left.block > 1 else "sample"
            rows.append((label, method, step, *_row(left)))
            label = ""
    return Table(
        "Tests of the one-step errors: p-values, small where chance does not explain it",
        (
            "channel",
            "method",
            "step",
            "Ljung-Box",
            "robust",
            "ARCH-LM",
            "Jarque-Bera",
            "kurtosis",
            "in words",
        ),
        tuple(rows),
        words=(0, 1, 2, 8),
        folded=len(rows) > _MOST_ROWS,
        note="Step: what is predicted, the next sample or the next mean, where fast times were "
        "left out of the fit. Ljung-Box: 20 lags beyond the fitted ones; robust: whatever the "
        "variance does; "
        "ARCH-LM: 10 past squares; Jarque-Bera: skewness and kurtosis.",
    )


def _row(left: ResidualDiagnostics) -> tuple[str, ...]:
    tests = left.tests
    if tests is None:
        return (*[MISSING] * 4, number(left.kurtosis), left.verdict)
    values = (tests.ljung_box, tests.ljung_box_robust, tests.arch_lm, tests.jarque_bera)
    return (*(probability(t.p_value) for t in values), number(left.kurtosis), left.verdict)


def probability(p_value: float) -> str:
    """Return a p-value for people."""
    if not math.isfinite(p_value):
        return MISSING
    if p_value < 1e-6:
        return "< 10⁻⁶"
    return f"{p_value:.3f}" if p_value >= 1e-3 else number(p_value, 1)


def _floor(channels: Channels) -> Table:
    methods = list(dict.fromkeys(m for c in channels.values() for m in c.residuals))
    rows = []
    for name, c in channels.items():
        if c.floor is None:
            continue
        unit, factor = unit_of(name)
        ratios = [
            f"{c.residuals[m].variance / c.floor:.4f}"
            if m in c.residuals and c.residuals[m].block == 1
            else MISSING
            for m in methods
        ]
        root = f"{number(math.sqrt(c.floor) / factor, 4)} {unit}".strip()
        rows.append((shown_name(name), root, *ratios))
    return Table(
        "One-step error variance over the smallest that the spectrum of the signal allows",
        ("channel", "root of the floor", *methods),
        tuple(rows),
        note="Kolmogorov and Szegő: no predictor is below one, but for the error of the floor "
        "itself (about √(3/n)) and for fits that follow their own data.",
        folded=True,
    )
