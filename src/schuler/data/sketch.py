"""A small picture of a series for notebooks: SVG as text, so that nothing need be installed."""

from __future__ import annotations

import numpy as np

from schuler.data.columns import Columns, index_of
from schuler.types import FloatArray

WIDTH, HEIGHT, POINTS = 420.0, 90.0, 200
COLOURS = ("#0072b2", "#c8550a", "#00805c", "#8e4fae", "#b8860b", "#5d7183")


def sketch(columns: Columns) -> str:
    """Return up to six columns over the first, each on its own scale; nothing for a table."""
    index = index_of(columns)
    drawn = [n for n, c in columns.items() if n != index and c.dtype.kind == "f"][: len(COLOURS)]
    if not index or not drawn:
        return ""
    x = np.asarray(columns[index], dtype=np.float64)
    if x[0] > 0.0 and x[-1] / x[0] > 100.0 and x.size < 1000:  # a curve over decades
        x = np.log10(x)
    lines = "".join(
        f"<polyline fill='none' stroke='{colour}' stroke-width='1' points='{_points(x, y)}'/>"
        for colour, y in zip(COLOURS, (columns[n] for n in drawn), strict=False)
    )
    names = "&ensp;".join(
        f"<span style='color:{colour}'>{name}</span>"
        for colour, name in zip(COLOURS, drawn, strict=False)
    )
    frame = f"width='{WIDTH:.0f}' height='{HEIGHT:.0f}' viewBox='0 0 {WIDTH:.0f} {HEIGHT:.0f}'"
    return f"<div><svg {frame} role='img'>{lines}</svg><br><small>{names}</small></div>"


def _points(x: FloatArray, y: FloatArray) -> str:
    y = np.asarray(y, dtype=np.float64)
    keep = np.flatnonzero(np.isfinite(y))
    keep = keep[np.linspace(0, keep.size - 1, min(keep.size, POINTS)).astype(np.int64)]
    if keep.size < 2:
        return ""
    x, y = x[keep], y[keep]
    height = float(np.ptp(y)) or 1.0
    places = np.column_stack(
        [(x - x[0]) / (x[-1] - x[0]) * WIDTH, (1.0 - (y - y.min()) / height) * (HEIGHT - 4) + 2]
    )
    return " ".join(f"{a:.1f},{b:.1f}" for a, b in places)
