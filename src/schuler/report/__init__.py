"""The HTML page: knows every result; no other room knows it."""

from schuler.report.blocks import (
    Facts,
    Figure,
    FigureGrid,
    Finding,
    Findings,
    LegendItem,
    Prose,
    Section,
    Table,
)
from schuler.report.page import render_page
from schuler.report.provenance import InputFile, Provenance, record_provenance
from schuler.report.sections.navigation.run import NavigationResults
from schuler.report.write import render_report, write_report

__all__ = [
    "Facts",
    "Figure",
    "FigureGrid",
    "Finding",
    "Findings",
    "InputFile",
    "LegendItem",
    "NavigationResults",
    "Prose",
    "Provenance",
    "Section",
    "Table",
    "record_provenance",
    "render_page",
    "render_report",
    "write_report",
]
