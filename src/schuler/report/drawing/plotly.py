"""Figures of the page as one figure of Plotly in Python."""

from __future__ import annotations

from math import ceil
from typing import Any

from schuler.report.blocks import FigureGrid
from schuler.report.drawing.palette import dressed, key_of, palette, rgba

_DASHES = {"dash": "dash", "dot": "dot"}


def plotly_figure(grid: FigureGrid) -> Any:
    """Return a grid of plots as one figure with subplots."""
    from plotly.subplots import make_subplots

    count = len(grid.figures)
    columns = min(grid.columns, count)
    rows = ceil(count / columns)
    figure = make_subplots(rows, columns, subplot_titles=[f.title for f in grid.figures])
    for k, one in enumerate(grid.figures):
        row, column = k // columns + 1, k % columns + 1
        for trace in one.traces:
            figure.add_trace({**dressed(trace), "showlegend": False}, row=row, col=column)
        _arrange(figure, dressed(one.layout), "" if k == 0 else str(k + 1))
    for label, colour, mark in key_of(grid.legend):
        figure.add_trace(_key(label, rgba(colour), mark))
    tallest = [max(f.height for f in grid.figures[r * columns :][:columns]) for r in range(rows)]
    figure.update_layout(
        height=sum(tallest) + 60 * rows,
        template="plotly_white",
        font_color=palette()["ink"],
        legend={"orientation": "h", "y": -0.12},
        margin={"l": 60, "r": 20, "t": 40, "b": 50},
    )
    return figure


def _arrange(figure: Any, layout: dict[str, Any], number: str) -> None:
    """Put axes and shapes of one plot into their subplot."""
    for letter in "xy":
        axis = dict(layout.get(f"{letter}axis", {}))
        if "scaleanchor" in axis:
            axis["scaleanchor"] += number
        figure.layout[f"{letter}axis{number}"].update(axis)
    for kind in ("shapes", "annotations"):
        for item in layout.get(kind, ()):
            figure["layout"][kind] += (dict(item) | _references(item, number),)


def _references(item: dict[str, Any], number: str) -> dict[str, str]:
    found = {}
    for letter in "xy":
        what = item.get(f"{letter}ref", letter)
        found[f"{letter}ref"] = f"{letter}{number} domain" if what == "paper" else letter + number
    return found


def _key(label: str, colour: str, mark: str) -> dict[str, Any]:
    """Return a trace of nothing that makes a line of the legend."""
    trace: dict[str, Any] = {"type": "scatter", "x": [None], "y": [None], "name": label}
    if mark in ("point", "diamond"):
        symbol = "diamond" if mark == "diamond" else "circle"
        return trace | {"mode": "markers", "marker": {"color": colour, "symbol": symbol}}
    width = 10 if mark == "band" else 2
    style = {"color": colour, "width": width, "dash": _DASHES.get(mark, "solid")}
    return trace | {"mode": "lines", "line": style}
