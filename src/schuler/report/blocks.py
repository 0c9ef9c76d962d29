"""The blocks a section is made of: words, facts, tables, findings and figures.

A section is a list of these, so that a new result needs a new maker of sections and nothing else.
Everything textual is plain text; the page escapes it.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Literal

Severity = Literal["good", "info", "warning", "error"]


@dataclass(frozen=True, slots=True)
class Prose:
    """One paragraph of plain words."""

    text: str  # the paragraph
    kind: str = field(default="prose", init=False)


@dataclass(frozen=True, slots=True)
class Facts:
    """Names with values, the few numbers a reader looks for first."""

    items: tuple[tuple[str, str], ...]  # name and value, both ready to be read
    kind: str = field(default="facts", init=False)


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was found, with how much it matters."""

    severity: Severity  # how much it matters
    text: str  # what was found, in plain words
    detail: str = ""  # where, or what to do


@dataclass(frozen=True, slots=True)
class Findings:
    """A list of findings."""

    items: tuple[Finding, ...]  # in the order to be read
    kind: str = field(default="findings", init=False)


@dataclass(frozen=True, slots=True)
class Table:
    """A table of text that is ready to be read."""

    caption: str  # what it shows
    columns: tuple[str, ...]  # headings
    rows: tuple[tuple[str, ...], ...]  # cells; an empty first cell continues the row above.
    # columns that hold words (set flush left); all others are numbers.
    words: tuple[int, ...] = (0,)
    note: str = ""  # line below the table
    folded: bool = False  # show it only when asked
    kind: str = field(default="table", init=False)


@dataclass(frozen=True, slots=True)
class Figure:
    """One plot."""

    title: str  # shown above the plot
    description: str  # what is to be seen, for readers who cannot see it
    # traces of plotly.js; colours are names of the page's palette (see `figures`).
    traces: tuple[dict[str, Any], ...]
    # layout of plotly.js without fonts and colours, which belong to the page
    layout: dict[str, Any]
    height: int = 320  # pixels


@dataclass(frozen=True, slots=True)
class LegendItem:
    """One entry of the legend that the plots of a grid share."""

    label: str  # text
    colour: str  # name in the palette
    mark: Literal["line", "dash", "dot", "band", "point", "diamond"] = "line"  # how it is drawn


@dataclass(frozen=True, slots=True)
class FigureGrid:
    """Plots side by side that share one legend."""

    figures: tuple[Figure, ...]  # in reading order
    legend: tuple[LegendItem, ...] = ()  # what the colours mean
    columns: Literal[1, 2, 3] = 3  # how many stand side by side on a wide page
    caption: str = ""  # one sentence below
    kind: str = field(default="figures", init=False)


Tone = Literal["good", "kind", "cannot", "wrong", "beyond", "failed", "plain"]
"""How a printed result fares when it is done again; it chooses the colour."""


@dataclass(frozen=True, slots=True)
class Judged:
    """One printed value beside what came out."""

    quantity: str  # what it is
    # printed, ours, band: values with their unit, ready to be read
    printed: str
    ours: str
    band: str
    verdict: str  # in words
    tone: Tone  # colour of the verdict
    detail: str = ""  # why; shown below the quantity.
    source: str = ""  # who says where the value has to lie; shown below the band.


@dataclass(frozen=True, slots=True)
class Judgement:
    """A table, figure or equation of a paper, done again."""

    label: str  # as the paper has it
    title: str  # what it is about
    claim: str  # what the paper says
    anchor: str  # for links within the page
    rows: tuple[Judged, ...]  # printed beside ours
    notes: tuple[str, ...] = ()  # what to take away
    kind: str = field(default="judgement", init=False)


@dataclass(frozen=True, slots=True)
class Chip:
    """A short link with a colour."""

    label: str  # text
    anchor: str  # where it leads
    tone: Tone  # colour
    verdict: str  # the colour in words


@dataclass(frozen=True, slots=True)
class Chips:
    """Many short links, so that a reader finds his table at once."""

    items: tuple[Chip, ...]  # in reading order
    legend: tuple[tuple[Tone, str], ...] = ()  # tone and words of the colours
    kind: str = field(default="chips", init=False)


Block = Prose | Facts | Findings | Table | FigureGrid | Judgement | Chips


@dataclass(frozen=True, slots=True)
class Section:
    """A part of the page that shows one result."""

    title: str  # heading
    blocks: tuple[Block, ...]  # content in reading order
    summary: tuple[str, ...] = ()  # sentences for the head of the page
