"""The HTML page: knows every result; no other room knows it.

A section for the results of another package is a function that `register` takes, in a module that
an entry point of the group ``schuler.report_sections`` names; it returns `Section` s made of the
blocks below. Such a package may use what stands here, and nothing else of this one.
"""

from schuler.report.blocks import (
    Block,
    Chip,
    Chips,
    Facts,
    Figure,
    FigureGrid,
    Finding,
    Findings,
    Judged,
    Judgement,
    LegendItem,
    Prose,
    Section,
    Table,
    Tone,
)
from schuler.report.figures import Dash, axis, band, limits, line, marks
from schuler.report.numbers import MISSING, duration, number, with_error
from schuler.report.page import (
    InputFile,
    Provenance,
    anchor,
    record_provenance,
    render_page,
    render_report,
    write_report,
)
from schuler.report.sections.navigation.run import NavigationResults
from schuler.report.sections.registry import register

__all__ = [
    "MISSING",
    "Block",
    "Chip",
    "Chips",
    "Dash",
    "Facts",
    "Figure",
    "FigureGrid",
    "Finding",
    "Findings",
    "InputFile",
    "Judged",
    "Judgement",
    "LegendItem",
    "NavigationResults",
    "Prose",
    "Provenance",
    "Section",
    "Table",
    "Tone",
    "anchor",
    "axis",
    "band",
    "duration",
    "limits",
    "line",
    "marks",
    "number",
    "record_provenance",
    "register",
    "render_page",
    "render_report",
    "with_error",
    "write_report",
]
