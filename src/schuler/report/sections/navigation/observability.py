"""Observability of a filter along a run: ranks, singular values, what was learnt, in words."""

from __future__ import annotations

import numpy as np

from schuler.navigation.observability_run import RunObservability, observed_states
from schuler.report.blocks import Facts, FigureGrid, Finding, Findings, LegendItem, Section, Table
from schuler.report.figures import axis, limits, line, marks
from schuler.report.makers import plot
from schuler.report.numbers import number
from schuler.report.sections.registry import register

GROUPS = (("position", 0, "@x"), ("velocity", 3, "@y"), ("attitude", 6, "@z"))


@register
def observability_sections(result: RunObservability) -> tuple[Section, ...]:
    """Show what a run tells of the state of its filter."""
    matrix = result.matrix
    facts = Facts(
        (
            ("States", str(len(matrix.names))),
            ("Seen", str(matrix.rank)),
            ("Seen well", str(matrix.practical_rank)),
            ("Learnt beyond the prior", str(result.information.learnt)),
        )
    )
    sentences = result.sentences()
    findings = Findings(
        tuple(Finding("warning" if "not seen" in s else "info", s) for s in sentences[1:])
    )
    rows = tuple(
        (name, f"{100.0 * (1.0 - unseen):.0f} %", f"{number(100.0 * final)} %")
        for name, unseen, final in observed_states(result)
    )
    table = Table(
        "Every state",
        ("state", "seen", "standard deviation at the end, of the start"),
        rows,
        folded=True,
    )
    title = f"Observability: {result.title}"
    return (Section(title, (facts, findings, _figures(result), table), sentences[:3]),)


def _figures(result: RunObservability) -> FigureGrid:
    relative = np.maximum(result.matrix.relative, 1e-18)
    count = np.arange(1.0, relative.size + 1.0)
    singular = plot(
        "Singular values",
        "Of the total observability matrix, as shares of the largest.",
        (marks(count, relative, "@causal", "singular values", size=5),),
        axis("direction"),
        axis("share of the largest", log=True, limits=limits(relative, log=True)),
        height=280,
    )
    information = np.maximum(result.information.information, 1e-12)
    learnt = plot(
        "Information against the prior",
        "Above one the measurements of the run outweigh what was known before.",
        (
            marks(count, information, "@smoothed", "information", size=5),
            line([1.0, float(relative.size)], [1.0, 1.0], "@model", "prior", dash="dash"),
        ),
        axis("direction"),
        axis("times the prior", log=True, limits=limits(information, [1.0], log=True)),
        height=280,
    )
    step = max(result.time.size // 400, 1)
    traces, legend = [], []
    for name, first, colour in GROUPS:
        value = np.sqrt(np.mean(result.decay[::step, first : first + 3] ** 2, axis=1))
        traces.append(line(result.time[::step], np.maximum(value, 1e-6), colour, name, width=1.5))
        legend.append(LegendItem(name, colour))
    sensors = result.decay[::step, 9:]
    if sensors.size:
        value = np.sqrt(np.mean(sensors**2, axis=1))
        traces.append(
            line(result.time[::step], value, "@gnss", "sensor errors", width=1.5, dash="dash")
        )
        legend.append(LegendItem("sensor errors", "@gnss", "dash"))
    decay = plot(
        "Standard deviations as shares of the start",
        "What the filter has learnt, group by group.",
        traces,
        axis("time in s"),
        axis("share of the start", log=True),
        height=280,
    )
    return FigureGrid((singular, learnt, decay), tuple(legend), columns=3)
