"""Figures of the page drawn by matplotlib, in the sizes and with the fonts that journals want."""

from __future__ import annotations

from math import ceil
from pathlib import Path
from typing import Any

import numpy as np

from schuler.data.exportable import optional
from schuler.report.blocks import Figure, FigureGrid
from schuler.report.drawing.palette import colour_of, key_of, numbers, palette, words

COLUMN, PAGE = 88.0 / 25.4, 180.0 / 25.4
"""Inches: width of one column of text and of a page in most journals."""
PIXELS = 150.0
"""Pixels of the page that make an inch of height on paper."""
STYLE = {
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.labelsize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "axes.linewidth": 0.6,
    "axes.grid": True,
    "grid.linewidth": 0.4,
    "axes.axisbelow": True,
    "pdf.fonttype": 42,  # whole letters, which publishers ask for
    "ps.fonttype": 42,
    "svg.fonttype": "path",
    "svg.hashsalt": "schuler",
}
_DASHES = {"dot": ":", "dash": "--", "dashdot": "-."}
_SYMBOLS = {"diamond": "D", "x": "x", "cross": "+", "square": "s", "triangle-up": "^"}


def matplotlib_figure(grid: FigureGrid) -> Any:
    """Return a grid of plots as one figure; it is of no window."""
    optional("matplotlib", "figures")
    import matplotlib
    from matplotlib.figure import Figure as Canvas

    count = len(grid.figures)
    columns = min(grid.columns, count)
    rows = ceil(count / columns)
    width = COLUMN if columns == 1 else PAGE
    tallest = [max(f.height for f in grid.figures[r * columns :][:columns]) for r in range(rows)]
    key = key_of(grid.legend)
    with matplotlib.rc_context(STYLE):
        canvas = Canvas(figsize=(width, sum(tallest) / PIXELS + 0.3 * rows + 0.2 * bool(key)))
        canvas.set_layout_engine("constrained")
        places = np.ravel(canvas.subplots(rows, columns, squeeze=False))
        for axes, one in zip(places, grid.figures, strict=False):
            _draw(axes, one)
        for axes in places[count:]:
            axes.set_visible(False)
        if key:
            across = min(len(key), 2 if columns == 1 else 5)
            handles = [_handle(*item) for item in key]
            canvas.legend(handles=handles, loc="outside lower center", ncols=across, frameon=False)
    return canvas


def save_figure(grid: FigureGrid, path: Path, form: str) -> None:
    """Write a grid of plots as PDF, SVG or PNG."""
    import matplotlib

    canvas = matplotlib_figure(grid)
    when = {"pdf": {"CreationDate": None}, "svg": {"Date": None}}.get(form)
    with matplotlib.rc_context(STYLE):
        canvas.savefig(path, format=form, dpi=300, metadata=when)


def _draw(axes: Any, one: Figure) -> None:
    axes.set_title(one.title, loc="left")
    before: Any = None
    for trace in one.traces:
        before = _trace(axes, trace, before)
    for shape in one.layout.get("shapes", ()):
        _shape(axes, shape)
    for letter in "xy":
        _axis(axes, letter, one.layout.get(f"{letter}axis", {}))
    axes.grid(color=palette()["grid"])
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)


def _trace(axes: Any, trace: dict[str, Any], before: Any) -> Any:
    """Draw one trace over the one before it, which a band is filled down to."""
    x, y = _along(trace["x"]), numbers(trace["y"])
    mode = trace.get("mode", "lines")
    if "fill" in trace and before is not None:
        colour, opacity = colour_of(trace.get("fillcolor", "@data"))
        axes.fill_between(x, before[1], y, color=colour, alpha=opacity, linewidth=0.0)
    line = trace.get("line", {})
    if "lines" in mode and line.get("width", 1.5) > 0:
        colour, opacity = colour_of(line.get("color", "@data"))
        style = _DASHES.get(line.get("dash", "solid"), "-")
        axes.plot(x, y, style, color=colour, alpha=opacity, linewidth=0.6 * line.get("width", 1.5))
    if "markers" in mode:
        _points(axes, x, y, trace.get("marker", {}))
    if "text" in mode:
        for place, text in zip(zip(x, y, strict=True), trace.get("text", ()), strict=False):
            axes.annotate(words(text), place, fontsize=6.5, ha="center", va="center")
    _errors(axes, trace, x, y)
    return x, y


def _along(values: Any) -> Any:
    """Return places along an axis: numbers, or names of categories."""
    named = isinstance(values, list | tuple) and any(isinstance(v, str) for v in values)
    return [words(v) for v in values] if named else numbers(values)


def _points(axes: Any, x: Any, y: Any, marker: dict[str, Any]) -> None:
    colour, opacity = colour_of(marker.get("color", "@data"))
    name, is_open = str(marker.get("symbol", "circle")), "open" in str(marker.get("symbol"))
    symbol = _SYMBOLS.get(name.partition("-")[0], "o")
    face = "none" if is_open and symbol not in "x+" else colour
    axes.plot(
        x, y, symbol, color=colour, alpha=opacity, markersize=0.6 * marker.get("size", 6),
        markerfacecolor=face, markeredgewidth=0.6 if is_open or symbol in "x+" else 0.0,
    )  # fmt: skip


def _errors(axes: Any, trace: dict[str, Any], x: Any, y: Any) -> None:
    for letter in "xy":
        error = trace.get(f"error_{letter}")
        if error is None:
            continue
        above = numbers(error["array"])
        below = numbers(error["arrayminus"]) if "arrayminus" in error else above
        colour, _ = colour_of(error.get("color", "@data"))
        bars = {f"{letter}err": np.abs([below, above])}
        axes.errorbar(x, y, fmt="none", ecolor=colour, elinewidth=0.6, capsize=1.5, **bars)


def _shape(axes: Any, shape: dict[str, Any]) -> None:
    """Draw a stripe or a line across the plot."""
    colour, opacity = colour_of(shape.get("fillcolor") or shape.get("line", {}).get("color", ""))
    x, y = (shape["x0"], shape["x1"]), (shape["y0"], shape["y1"])
    if shape["type"] == "rect" and shape.get("yref") == "paper":
        axes.axvspan(*x, color=colour, alpha=opacity, linewidth=0.0, zorder=0)
    elif shape["type"] == "rect":
        axes.axhspan(*y, color=colour, alpha=opacity, linewidth=0.0, zorder=0)
    elif x[0] == x[1]:
        axes.axvline(x[0], color=colour or palette()["soft"], linewidth=0.8)
    elif y[0] == y[1]:
        axes.axhline(y[0], color=colour or palette()["soft"], linewidth=0.8)


def _axis(axes: Any, letter: str, how: dict[str, Any]) -> None:
    """Put title, scale and limits of an axis where they belong."""
    title = how.get("title", {})
    text = words(title.get("text", "") if isinstance(title, dict) else title)
    getattr(axes, f"set_{letter}label")(text)
    log = how.get("type") == "log"
    if log:
        getattr(axes, f"set_{letter}scale")("log")
    if "range" in how:
        ends = [10.0**v for v in how["range"]] if log else how["range"]
        getattr(axes, f"set_{letter}lim")(*ends)
    if "tickvals" in how:
        labels = [words(t) for t in how.get("ticktext", how["tickvals"])]
        getattr(axes, f"set_{letter}ticks")(numbers(how["tickvals"]), labels)
    if how.get("showticklabels") is False:
        axes.axis("off")
    if "scaleanchor" in how:
        axes.set_aspect("equal", adjustable="datalim" if "range" not in how else "box")


def _handle(label: str, name: str, mark: str) -> Any:
    """Return what stands beside a label in the legend."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    colour, opacity = colour_of(name)
    if mark == "band":
        return Patch(color=colour, alpha=opacity, label=label, linewidth=0.0)
    if mark in ("point", "diamond"):
        symbol = "D" if mark == "diamond" else "o"
        return Line2D([], [], color=colour, marker=symbol, linestyle="", markersize=3, label=label)
    return Line2D([], [], color=colour, linestyle=_DASHES.get(mark, "-"), label=label)
