"""What wavelet de-noising does: the Allan curve before and after, and the thresholds."""

from __future__ import annotations

import numpy as np

from schuler.denoising import AllanEffect, Denoised
from schuler.report.blocks import Block, FigureGrid, Findings, LegendItem, Section, Table
from schuler.report.figures import axis, limits, line, marks
from schuler.report.makers import plot, remarks, spoken
from schuler.report.numbers import number, percent
from schuler.report.sections.noise.method_words import shown_name, unit_of
from schuler.report.sections.registry import register

_KEEP_N = (
    "A low-pass of unit gain removes no white noise from the position: keep the white noise "
    "density N in the filter after de-noising."
)


@register
def allan_effect_sections(result: AllanEffect) -> tuple[Section, ...]:
    """Show the Allan curve before and after de-noising."""
    return (denoising_section(result),)


@register
def denoised_sections(result: Denoised) -> tuple[Section, ...]:
    """Show how a record was de-noised."""
    return (Section("Levels of de-noising", _levels(result)),)


def denoising_section(
    effect: AllanEffect, denoised: Denoised | None = None, name: str = ""
) -> Section:
    """Show what de-noising did to a signal."""
    blocks: list[Block] = [_curves(effect, name), Findings(remarks(map(spoken, effect.findings())))]
    if denoised is not None:
        blocks += _levels(denoised, name)
    return Section("De-noising", tuple(blocks), (_KEEP_N,))


def in_short(effects: dict[str, AllanEffect]) -> tuple[str, ...]:
    """Return what became of all channels, for the head of the page."""
    left = {
        shown_name(c): float(np.nanmin(e.ratio[e.raw.tau < e.attenuated_below], initial=1.0))
        for c, e in effects.items()
    }
    below, above = (
        max(getattr(e, name) for e in effects.values())
        for name in ("attenuated_below", "equal_above")
    )
    least = ", ".join(f"{name} {percent(share)}" for name, share in left.items())
    return (
        f"Noise shorter than {below:g} s was taken off; of the Allan deviation there are "
        f"left, at the least: {least}.",
        f"What lasts longer than {above:g} s is as it was.",
        _KEEP_N,
    )


def _curves(effect: AllanEffect, name: str) -> FigureGrid:
    unit, factor = unit_of(name)
    tau = effect.raw.tau
    before, after = effect.raw.deviation / factor, effect.denoised.deviation / factor
    known = np.isfinite(effect.ratio)
    x_axis = axis("cluster time in s", log=True, limits=limits(tau, log=True, margin=0.03))
    curves = plot(
        f"{shown_name(name)}: Allan deviation",
        "Allan deviation before and after de-noising.",
        (
            marks(tau, before, "@data", "before", size=4),
            line(tau, after, "@mark", "after", width=1.8),
        ),
        x_axis,
        axis(
            f"Allan deviation{unit and f' in {unit}'}",
            log=True,
            limits=limits(before, after, log=True),
        ),
    )
    ratio = plot(
        "After over before",
        "Ratio of the two; one where de-noising changes nothing.",
        (
            line(tau[[0, -1]], [1.0, 1.0], "@other", "unchanged", dash="dash"),
            line(tau[known], effect.ratio[known], "@mark", "after over before", width=1.8),
        ),
        x_axis,
        axis("after over before", limits=(0.0, 1.15)),
    )
    legend = (LegendItem("before", "@data", "point"), LegendItem("after", "@mark"))
    return FigureGrid(
        (curves, ratio),
        legend,
        columns=2,
        caption=f"Below {number(effect.attenuated_below)} s the deviation falls; above "
        f"{number(effect.equal_above)} s it stays as it was.",
    )


def _levels(found: Denoised, name: str = "") -> tuple[Block, ...]:
    rate, (unit, size) = found.rate, unit_of(name)
    rows = []
    for k in range(found.level):
        high, low = 0.5 ** (k + 1), 0.5 ** (k + 2)
        band = f"{number(low * (rate or 1.0))} to {number(high * (rate or 1.0))}"
        limit = float(found.thresholds[k])
        rows.append(
            (
                str(k + 1),
                band,
                number(float(found.noise_scales[k]) / size),
                "all removed" if np.isinf(limit) else number(limit / size),
                percent(float(found.kept[k])),
            )
        )
    table = Table(
        f"Details by level: {found.wavelet}, {found.mode} threshold '{found.threshold}', noise "
        f"scale '{found.scale}'",
        (
            "level",
            f"band in {'Hz' if rate else 'cycles a sample'}",
            f"noise scale{unit and f', {unit}'}",
            f"threshold{unit and f', {unit}'}",
            "kept",
        ),
        tuple(rows),
        note=f"Not causal: a sample depends on up to {found.reach} samples of the future."
        + (f" Flags: {', '.join(found.flags)}." if found.flags else ""),
    )
    return (table,)
