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
    """One paragraph of plain words.

    Parameters
    ----------
    text : str
        The paragraph.
    """

    text: str
    kind: str = field(default="prose", init=False)


@dataclass(frozen=True, slots=True)
class Facts:
    """Names with values, the few numbers a reader looks for first.

    Parameters
    ----------
    items : tuple of (str, str)
        Name and value, both ready to be read.
    """

    items: tuple[tuple[str, str], ...]
    kind: str = field(default="facts", init=False)


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing that was found, with how much it matters.

    Parameters
    ----------
    severity : {"good", "info", "warning", "error"}
        How much it matters.
    text : str
        What was found, in plain words.
    detail : str
        Where, or what to do.
    """

    severity: Severity
    text: str
    detail: str = ""


@dataclass(frozen=True, slots=True)
class Findings:
    """A list of findings.

    Parameters
    ----------
    items : tuple of Finding
        In the order to be read.
    """

    items: tuple[Finding, ...]
    kind: str = field(default="findings", init=False)


@dataclass(frozen=True, slots=True)
class Table:
    """A table of text that is ready to be read.

    Parameters
    ----------
    caption : str
        What it shows.
    columns : tuple of str
        Headings.
    rows : tuple of tuple of str
        Cells; an empty first cell continues the row above.
    words : tuple of int
        Columns that hold words (set flush left); all others are numbers.
    note : str
        Line below the table.
    folded : bool
        Show it only when asked.
    """

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: tuple[int, ...] = (0,)
    note: str = ""
    folded: bool = False
    kind: str = field(default="table", init=False)


@dataclass(frozen=True, slots=True)
class Figure:
    """One plot.

    Parameters
    ----------
    title : str
        Shown above the plot.
    description : str
        What is to be seen, for readers who cannot see it.
    traces : tuple of dict
        Traces of plotly.js; colours are names of the page's palette (see `figures`).
    layout : dict
        Layout of plotly.js without fonts and colours, which belong to the page.
    height : int
        Pixels.
    """

    title: str
    description: str
    traces: tuple[dict[str, Any], ...]
    layout: dict[str, Any]
    height: int = 320


@dataclass(frozen=True, slots=True)
class LegendItem:
    """One entry of the legend that the plots of a grid share.

    Parameters
    ----------
    label : str
        Text.
    colour : str
        Name in the palette.
    mark : {"line", "dash", "dot", "band", "point", "diamond"}
        How it is drawn.
    """

    label: str
    colour: str
    mark: Literal["line", "dash", "dot", "band", "point", "diamond"] = "line"


@dataclass(frozen=True, slots=True)
class FigureGrid:
    """Plots side by side that share one legend.

    Parameters
    ----------
    figures : tuple of Figure
        In reading order.
    legend : tuple of LegendItem
        What the colours mean.
    columns : {1, 2, 3}
        How many stand side by side on a wide page.
    caption : str
        One sentence below.
    """

    figures: tuple[Figure, ...]
    legend: tuple[LegendItem, ...] = ()
    columns: Literal[1, 2, 3] = 3
    caption: str = ""
    kind: str = field(default="figures", init=False)


Tone = Literal["good", "kind", "cannot", "wrong", "beyond", "failed", "plain"]
"""How a printed result fares when it is done again; it chooses the colour."""


@dataclass(frozen=True, slots=True)
class Judged:
    """One printed value beside what came out.

    Parameters
    ----------
    quantity : str
        What it is.
    printed, ours, band : str
        Values with their unit, ready to be read.
    verdict : str
        In words.
    tone : str
        Colour of the verdict.
    detail : str
        Why; shown below the quantity.
    source : str
        Who says where the value has to lie; shown below the band.
    """

    quantity: str
    printed: str
    ours: str
    band: str
    verdict: str
    tone: Tone
    detail: str = ""
    source: str = ""


@dataclass(frozen=True, slots=True)
class Judgement:
    """A table, figure or equation of a paper, done again.

    Parameters
    ----------
    label : str
        As the paper has it.
    title : str
        What it is about.
    claim : str
        What the paper says.
    anchor : str
        For links within the page.
    rows : tuple of Judged
        Printed beside ours.
    notes : tuple of str
        What to take away.
    """

    label: str
    title: str
    claim: str
    anchor: str
    rows: tuple[Judged, ...]
    notes: tuple[str, ...] = ()
    kind: str = field(default="judgement", init=False)


@dataclass(frozen=True, slots=True)
class Chip:
    """A short link with a colour.

    Parameters
    ----------
    label : str
        Text.
    anchor : str
        Where it leads.
    tone : str
        Colour.
    verdict : str
        The colour in words.
    """

    label: str
    anchor: str
    tone: Tone
    verdict: str


@dataclass(frozen=True, slots=True)
class Chips:
    """Many short links, so that a reader finds his table at once.

    Parameters
    ----------
    items : tuple of Chip
        In reading order.
    legend : tuple of (str, str)
        Tone and words of the colours.
    """

    items: tuple[Chip, ...]
    legend: tuple[tuple[Tone, str], ...] = ()
    kind: str = field(default="chips", init=False)


Block = Prose | Facts | Findings | Table | FigureGrid | Judgement | Chips


@dataclass(frozen=True, slots=True)
class Section:
    """A part of the page that shows one result.

    Parameters
    ----------
    title : str
        Heading.
    blocks : tuple of Block
        Content in reading order.
    summary : tuple of str
        Sentences for the head of the page.
    """

    title: str
    blocks: tuple[Block, ...]
    summary: tuple[str, ...] = ()
