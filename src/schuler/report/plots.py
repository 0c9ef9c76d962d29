"""The figures of a result for those who want them without the page."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, fields
from typing import Any, Literal

import numpy as np

from schuler.data.columns import Columns, index_of
from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.report.blocks import FigureGrid, Section
from schuler.report.figures import axis, limits, line
from schuler.report.makers import channel_grid
from schuler.report.makers import plot as one_plot
from schuler.report.sections import sections_of

MOST_COLUMNS = 12
"""Columns of a table that are drawn where a result has no figures of its own."""
_COLOURS = {"x": "@x", "y": "@y", "z": "@z", "north": "@x", "east": "@y", "down": "@z"}


@dataclass(frozen=True, slots=True)
class TitledGrid:
    """A grid of figures with the words that name it."""

    title: str
    grid: FigureGrid


def titled_grids(sections: Iterable[Section]) -> tuple[TitledGrid, ...]:
    """Return all figures of sections, in reading order."""
    found = []
    for section in sections:
        grids = [b for b in section.blocks if isinstance(b, FigureGrid) and b.figures]
        for grid in grids:
            alone = len(grids) == 1
            found.append(
                TitledGrid(
                    section.title if alone else f"{section.title}: {grid.figures[0].title}", grid
                )
            )
    return tuple(found)


def summary(result: Any) -> tuple[str, ...]:
    """Return what the report says of a result at its head; nothing where it shows none."""
    return tuple(sentence for section in _sections(result) for sentence in section.summary)


def plot(
    result: Any, figure: str = "", *, backend: Literal["plotly", "matplotlib"] = "plotly"
) -> Any:
    """Return one of the plots of a result; see `Exportable.plot`."""
    if backend not in ("plotly", "matplotlib"):
        raise InputError(f"backend '{backend}'", expected="'plotly' or 'matplotlib'")
    grid = _wanted(result, figure)
    if backend == "plotly":
        from schuler.report.drawing.plotly import plotly_figure

        return plotly_figure(grid)
    from schuler.report.drawing.matplotlib import matplotlib_figure

    return matplotlib_figure(grid)


def _wanted(result: Any, figure: str) -> FigureGrid:
    grids = titled_grids(_sections(result)) or _of_fields(result)
    for one in grids:
        if figure.lower() in one.title.lower():
            return one.grid
    if not grids:
        raise InputError(f"a {type(result).__name__} has no series to plot")
    raise InputError(
        f"no figure '{figure}'", expected=f"part of one of: {'; '.join(g.title for g in grids)}"
    )


def _sections(result: Any) -> tuple[Section, ...]:
    try:
        return sections_of(result)
    except InputError:  # not every result has a place on the page
        return ()


def _of_fields(result: Any) -> tuple[TitledGrid, ...]:
    """Return the columns of a result as plots, or what its first part shows that has any."""
    found = _of_columns(result.to_columns())
    parts = (getattr(result, f.name) for f in fields(result))
    return found or next(
        filter(None, (_of_fields(p) for p in parts if isinstance(p, Exportable))), ()
    )


def _of_columns(columns: Columns) -> tuple[TitledGrid, ...]:
    """Return one plot for each column of numbers over the first."""
    index = index_of(columns)
    drawn = [n for n, c in columns.items() if n != index and c.dtype.kind in "fiu"]
    if not index or not drawn:
        return ()
    x = np.asarray(columns[index], dtype=np.float64)
    log = bool(x[0] > 0.0 and x[-1] / x[0] > 100.0 and x.size < 1000)  # a curve over decades
    figures = []
    for name in drawn[:MOST_COLUMNS]:
        y = np.asarray(columns[name], dtype=np.float64)
        both = log and bool((y > 0).all())
        colour = _COLOURS.get(name.rpartition("_")[2], "@x")
        figures.append(
            one_plot(
                name,
                f"{name} over {index}.",
                (line(x, y, colour, name),),
                axis(index, log=log, limits=limits(x, log=log) if log else None),
                axis("", log=both, limits=limits(y, log=both)),
                height=240,
            )
        )
    return (TitledGrid(", ".join(drawn[:MOST_COLUMNS]), channel_grid(figures, (), "")),)
