"""By how much a drive inflates the noise of a static log."""

from __future__ import annotations

import numpy as np

from schuler.navigation.tuning.inflation import NoiseInflation, NoiseTuning
from schuler.report.blocks import Figure, FigureGrid, LegendItem, Section, Table
from schuler.report.figures import axis, line, marks
from schuler.report.makers import plot
from schuler.report.numbers import number
from schuler.report.sections.recording import pretty
from schuler.report.sections.registry import register
from schuler.units import kind_of, scale

# a factor that costs more than this is as good as refused, and the figures end there
HIGHEST_LOSS = 60.0


def inflation_rows(found: NoiseTuning) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return the columns and rows of the factors."""
    rows: list[tuple[str, ...]] = []
    for i in found.inflations:
        kind = f"{i.sensor} {'random walk' if i.kind == 'bias walk' else i.kind}"
        unit = kind_of(kind).datasheet
        size = scale(unit, kind)
        rows.append(
            (
                f"{i.sensor} {i.kind}",
                pretty(unit),
                _three(i.static / size),
                f"×{number(i.factor)}",
                f"{number(i.lower)} to {number(i.upper)}",
                _three(i.tuned / size),
            )
        )
    for name, (factor, lower, upper) in found.receiver.items():
        rows.append(
            (
                f"GNSS {name} sd",
                "",
                "",
                f"×{number(factor)}",
                f"{number(lower)} to {number(upper)}",
                "",
            )
        )
    return ("noise", "unit", "static x, y, z", "factor", "95 % interval", "on this drive"), rows


def loss_rows(found: NoiseTuning) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Return the columns and rows of the likelihood over common factors."""
    tried = found.inflations[0].profile_factors if found.inflations else np.empty(0)
    rows = [
        (f"{i.sensor} {i.kind}", *(number(float(loss)) for loss in i.profile_loss))
        for i in found.inflations
    ]
    return ("noise", *(f"×{f:g}" for f in tried)), rows


@register
def tuning_sections(found: NoiseTuning) -> tuple[Section, ...]:
    """Show what a drive says of a noise model."""
    columns, rows = inflation_rows(found)
    factors = Table(
        "Static numbers and what the drive needs",
        columns,
        tuple(rows),
        words=(0, 1),
        note="Most likely factors of the innovations of GNSS, at its full rate and thinned, all "
        "factors together. Intervals from the scatter of the score over pieces of 20 s.",
    )
    columns, rows = loss_rows(found)
    losses = Table(
        "Log-likelihood lost by common factors",
        columns,
        tuple(rows),
        note="With the factor held and everything else at its best. Two is the end of a 95 % "
        "interval where innovations are independent; they are used in several thinnings here, so "
        "the intervals above are the ones to trust.",
    )
    figures = FigureGrid(
        tuple(_profile(i) for i in found.inflations),
        (
            LegendItem("log-likelihood lost", "@model"),
            LegendItem("most likely, with 95 % interval", "@causal", "point"),
        ),
        columns=2,
    )
    return (Section("Tuning", (factors, losses, figures), _sentences(found)),)


def _profile(i: NoiseInflation) -> Figure:
    order = np.argsort(np.append(i.profile_factors, i.factor))
    factors = np.append(i.profile_factors, i.factor)[order]
    loss = np.append(i.profile_loss, 0.0)[order]
    top = float(np.clip(1.1 * loss.max(initial=1.0), 4.0, HIGHEST_LOSS))
    ends = (0.8 * min(factors.min(), i.lower), 1.25 * max(factors.max(), i.upper))
    return plot(
        f"{i.sensor}, {i.kind}".capitalize(),
        f"Most likely ×{number(i.factor)}, 95 % interval {number(i.lower)} to {number(i.upper)}.",
        (
            line(factors, np.minimum(loss, 3.0 * top), "@model", "log-likelihood lost"),
            marks(factors, np.minimum(loss, 3.0 * top), "@model", "tried", size=6),
            line([i.lower, i.upper], [0.0, 0.0], "@causal", "95 % interval", width=4),
            marks([i.factor], [0.0], "@causal", "most likely", size=9),
        ),
        axis("factor on the static number", log=True, limits=ends),
        axis("log-likelihood lost", limits=(-0.06 * top, top)),
        height=260,
    )


def _sentences(found: NoiseTuning) -> tuple[str, ...]:
    told = [i for i in found.inflations if not i.lower <= 1.0 <= i.upper]
    as_it_is = [f"{i.kind} of the {i.sensor}" for i in found.inflations if i not in told]
    said = [
        f"On this drive the {i.kind} of the {i.sensor} is {number(i.factor)} times that of the "
        f"static log (95 % interval {number(i.lower)} to {number(i.upper)})."
        for i in told
    ]
    if as_it_is:
        said.append(f"Nothing speaks against the static log in {', '.join(as_it_is)} (95 %).")
    said.append(
        f"The innovations of GNSS, squared and over their claimed variance, average "
        f"{number(found.nis_before)} with the static numbers and {number(found.nis_after)} with "
        "the tuned ones; one is honest."
    )
    if not found.converged:
        said.append("The search did not end by itself: take the factors with care.")
    return tuple(said)


def _three(values: np.ndarray) -> str:
    return ", ".join(number(float(v)) for v in values)
