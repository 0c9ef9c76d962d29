"""What many sections make alike: plots, lists of findings, logs, grids of one plot a channel."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from schuler.report.blocks import (
    Block,
    Figure,
    FigureGrid,
    Finding,
    Findings,
    LegendItem,
    Severity,
    Table,
)
from schuler.report.figures import shaded

MOST_LINES = 12
"""Lines of a log that are shown unfolded."""
MOST_INTERVALS = 4


def plot(
    title: str,
    description: str,
    traces: Iterable[dict[str, Any]],
    x: dict[str, Any],
    y: dict[str, Any],
    *,
    height: int = 320,
    spans: tuple[tuple[float, float], ...] | None = None,
) -> Figure:
    """Return a plot of traces over two axes; `spans` are shaded."""
    layout = {"xaxis": x, "yaxis": y}
    if spans is not None:
        layout["shapes"] = shaded(spans)  # type: ignore[assignment]
    return Figure(title, description, tuple(traces), layout, height=height)


def channel_grid(
    figures: Sequence[Figure], legend: tuple[LegendItem, ...], caption: str
) -> FigureGrid:
    """Return one plot a channel, three side by side, or one alone."""
    return FigureGrid(tuple(figures), legend, 3 if len(figures) > 1 else 1, caption)


def remarks(texts: Iterable[str], severity: Severity = "info") -> tuple[Finding, ...]:
    """Return findings that matter alike."""
    return tuple(Finding(severity, text) for text in texts)


def spoken(text: str) -> str:
    """Return a finding as a sentence."""
    return f"{text[:1].upper()}{text[1:]}."


def log_blocks(
    limits: Iterable[Finding], lines: Sequence[Finding], nothing: str
) -> tuple[Block, ...]:
    """Return a log: its first lines as findings, the rest folded."""
    items = (*limits, *lines[:MOST_LINES]) if lines else (*limits, Finding("good", nothing))
    blocks: tuple[Block, ...] = (Findings(items),)
    rest = tuple((line.text,) for line in lines[MOST_LINES:])
    if rest:
        blocks += (Table(f"{len(rest)} more lines of the log", ("Event",), rest, folded=True),)
    return blocks


def moments(spans: Sequence[tuple[float, float]], severity: str) -> str:
    """Return when something was seen; what is only to know needs no time."""
    if severity == "info" or not spans:
        return ""
    shown = [
        f"{a:.8g} s" if b - a < 0.1 else f"{a:.8g} to {b:.8g} s" for a, b in spans[:MOST_INTERVALS]
    ]
    more = len(spans) - len(shown)
    return "At " + ", ".join(shown) + (f" and {more} more." if more > 0 else ".")


def things(count: int) -> str:
    """Return how many things are to watch, in words."""
    return f"{count} thing{'' if count == 1 else 's'} to watch"
