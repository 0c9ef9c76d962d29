"""Traces and axes of plots as plain dictionaries, with one palette and one way to thin data.

Colours are names such as ``"@x"`` or ``"@x/0.2"`` (with opacity); the page replaces them by what
suits a light or a dark screen. Arrays travel as base64 of 32-bit floats, so that NaN is a gap and
a plot of thousands of points stays small.
"""

from __future__ import annotations

import base64
import math
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.types import FloatArray

Dash = Literal["solid", "dot", "dash", "dashdot"]

AXIS_COLOURS = {"x": "@x", "y": "@y", "z": "@z", "north": "@x", "east": "@y", "down": "@z"}
MAX_POINTS = 1000
"""Points of a line; more cannot be told apart on a screen."""


def encode(values: ArrayLike, dtype: Literal["f4", "f8"] = "f4") -> dict[str, str]:
    """Return numbers in the typed form of plotly.js."""
    array = np.ascontiguousarray(values, dtype=f"<{dtype}")
    return {"dtype": dtype, "bdata": base64.b64encode(array.tobytes()).decode("ascii")}


def thin(x: FloatArray, y: FloatArray, points: int = MAX_POINTS) -> NDArray[np.int64]:
    """Return the indices of a line that is drawn alike, with every extreme kept.

    Each of points/2 equal stretches keeps its smallest and its largest value; the first and the
    last sample and the gaps (NaN) stay.
    """
    n = y.size
    if n <= points:
        return np.arange(n)
    stretches = points // 2
    size = -(-n // stretches)
    rows = np.full((stretches, size), np.nan)
    rows.reshape(-1)[:n] = y
    there = np.flatnonzero(~np.isnan(rows).all(axis=1))
    low, high = np.nanargmin(rows[there], axis=1), np.nanargmax(rows[there], axis=1)
    gaps = np.flatnonzero(np.isnan(y))
    gaps = gaps[:: max(gaps.size // points, 1)]
    return np.unique(np.concatenate([size * there + low, size * there + high, [0, n - 1], gaps]))


def line(
    x: ArrayLike,
    y: ArrayLike,
    colour: str,
    name: str,
    *,
    width: float = 1.5,
    dash: Dash = "solid",
    points: int = MAX_POINTS,
) -> dict[str, Any]:
    """Return a line, thinned when it is long."""
    x, y = np.asarray(x, dtype=np.float64), np.asarray(y, dtype=np.float64)
    keep = thin(x, y, points)
    return {
        "type": "scatter",
        "mode": "lines",
        "x": encode(x[keep]),
        "y": encode(y[keep]),
        "name": name,
        "line": {"color": colour, "width": width, "dash": dash},
        "hovertemplate": "%{x:.4~g}, %{y:.4~g}",
    }


def marks(
    x: ArrayLike,
    y: ArrayLike,
    colour: str,
    name: str,
    *,
    size: float = 4.0,
    symbol: str = "circle",
    text: tuple[str, ...] = (),
) -> dict[str, Any]:
    """Return points."""
    trace: dict[str, Any] = {
        "type": "scatter",
        "mode": "markers",
        "x": encode(x),
        "y": encode(y),
        "name": name,
        "marker": {
            "color": colour,
            "size": size,
            "symbol": symbol,
            "line": {"width": 2 if "open" in symbol else 0, "color": colour},
        },
        "hovertemplate": "%{x:.4~g}, %{y:.4~g}",
    }
    if text:
        trace["text"] = [plain(t) for t in text]
        trace["hovertemplate"] = "%{text}"
    return trace


def band(
    x: ArrayLike,
    lower: ArrayLike,
    upper: ArrayLike,
    colour: str,
    name: str,
    *,
    points: int = MAX_POINTS // 2,
) -> list[dict[str, Any]]:
    """Return the area between two lines."""
    x = np.asarray(x, dtype=np.float64)
    low, high = np.asarray(lower, dtype=np.float64), np.asarray(upper, dtype=np.float64)
    keep = np.union1d(thin(x, low, points), thin(x, high, points))
    common = {
        "type": "scatter",
        "mode": "lines",
        "x": encode(x[keep]),
        "line": {"width": 0, "color": colour},
        "hoverinfo": "skip",
        "name": name,
    }
    return [
        {**common, "y": encode(low[keep])},
        {**common, "y": encode(high[keep]), "fill": "tonexty", "fillcolor": colour},
    ]


def envelope(
    x: FloatArray, y: FloatArray, colour: str, name: str, stretches: int = 500
) -> list[dict[str, Any]]:
    """Return a noisy line as the area between the extremes of many stretches."""
    if y.size < 4 * stretches:
        return [line(x, y, colour, name, width=0.8)]
    starts = np.linspace(0, y.size, stretches, endpoint=False).astype(np.int64)
    low, high = np.minimum.reduceat(y, starts), np.maximum.reduceat(y, starts)
    common = {"type": "scatter", "mode": "lines", "x": encode(x[starts]), "name": name}
    common |= {"line": {"color": colour, "width": 0.8}, "hovertemplate": "%{x:.4~g}, %{y:.4~g}"}
    return [
        {**common, "y": encode(low)},
        {**common, "y": encode(high), "fill": "tonexty", "fillcolor": colour},
    ]


def axis(
    title: str, *, log: bool = False, limits: tuple[float, float] | None = None, equal_to: str = ""
) -> dict[str, Any]:
    """Return an axis."""
    result: dict[str, Any] = {"title": {"text": plain(title)}}
    if log:
        result |= {"type": "log", "exponentformat": "power", "showexponent": "all"}
        low, high = limits or (1e-8, 1.0)
        result["dtick"] = max(1, math.ceil(math.log10(high / low) / 8.0))  # labels stay apart
        if low > 1e-4 and high < 1e5:
            result["tickformat"] = "~g"
        if high / low < 100.0:
            result["dtick"] = "D2"  # labels at 1, 2 and 5
    if limits is not None:
        ends = np.log10(limits) if log else np.asarray(limits)
        result["range"] = [float(ends[0]), float(ends[1])]
    if equal_to:
        result |= {"scaleanchor": equal_to, "scaleratio": 1}
    return result


def shaded(
    spans: tuple[tuple[float, float], ...], colour: str = "@outage/0.14"
) -> list[dict[str, Any]]:
    """Return vertical stripes behind a plot over time."""
    return [
        {
            "type": "rect",
            "xref": "x",
            "yref": "paper",
            "x0": start,
            "x1": stop,
            "y0": 0,
            "y1": 1,
            "fillcolor": colour,
            "line": {"width": 0},
            "layer": "below",
        }
        for start, stop in spans
    ]


def limits(*arrays: ArrayLike, log: bool = False, margin: float = 0.06) -> tuple[float, float]:
    """Return limits that hold all finite numbers of several arrays, with a margin."""
    values = np.concatenate([np.ravel(np.asarray(a, dtype=np.float64)) for a in arrays])
    values = values[np.isfinite(values) & ((values > 0) | (not log))]
    if values.size == 0:
        return (0.1, 10.0) if log else (-1.0, 1.0)
    ends = np.array([values.min(), values.max()])
    ends = np.log10(ends) if log else ends
    span = float(ends[1] - ends[0])
    if log and span < 0.3:
        ends = ends.mean() + np.array([-0.15, 0.15])
    elif span <= 1e-9 * float(np.abs(ends).max()):  # a constant: do not blow up rounding
        ends = ends.mean() + np.array([-1.0, 1.0]) * max(0.1 * abs(float(ends.mean())), 1e-3)
    span = float(ends[1] - ends[0])
    low, high = ends[0] - margin * span, ends[1] + margin * span
    return (float(10**low), float(10**high)) if log else (float(low), float(high))


def broken_at_gaps(time: FloatArray, *columns: FloatArray) -> tuple[FloatArray, ...]:
    """Return the series with a gap wherever it pauses, so that no line bridges the pause."""
    step = np.diff(time)
    if step.size == 0:
        return (time, *columns)
    pauses = np.flatnonzero(step > 5.0 * np.median(step)) + 1
    middle = 0.5 * (time[pauses] + time[pauses - 1])
    return (
        np.insert(time, pauses, middle),
        *(np.insert(column, pauses, np.nan) for column in columns),
    )


def plain(text: str) -> str:
    """Return text that plotly.js shows as it is (it understands a few HTML tags)."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
