"""Colours and numbers of the page's figures for those who draw them elsewhere."""

from __future__ import annotations

import base64
import re
from functools import cache
from html import unescape
from importlib.resources import files
from typing import Any

import numpy as np

from schuler.report.blocks import LegendItem
from schuler.types import FloatArray

_NAMED = re.compile(r"@([a-z]+)(?:/([\d.]+))?")


@cache
def palette() -> dict[str, str]:
    """Return the colours of the light page: they stand once, in its style sheet."""
    style = (files("schuler.report") / "assets" / "style.css").read_text(encoding="utf-8")
    light = style.partition("}")[0]
    return dict(re.findall(r"--(\w+): (#[0-9a-f]{6})", light))


def colour_of(name: str) -> tuple[str, float]:
    """Return the colour and the opacity of a name such as "@x/0.2"."""
    found = _NAMED.fullmatch(name)
    if found is None:
        return name, 1.0
    return palette().get(found[1], "#888888"), float(found[2] or 1.0)


def rgba(name: str) -> str:
    """Return a colour as Plotly takes it."""
    colour, opacity = colour_of(name)
    if opacity == 1.0:
        return colour
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},{opacity:g})"


def dressed(value: Any) -> Any:
    """Return traces or a layout with real colours and arrays."""
    if isinstance(value, str):
        return rgba(value) if _NAMED.fullmatch(value) else value
    if isinstance(value, dict):
        if "bdata" in value:
            return numbers(value)
        return {k: dressed(v) for k, v in value.items()}
    return [dressed(v) for v in value] if isinstance(value, list | tuple) else value


def numbers(values: Any) -> FloatArray:
    """Return the numbers of a trace; they may travel as base64."""
    if isinstance(values, dict):
        raw = np.frombuffer(base64.b64decode(values["bdata"]), dtype="<f4")
        return raw.astype(np.float64)
    return np.array([np.nan if v is None else v for v in values], dtype=np.float64)


def words(text: Any) -> str:
    """Return text without what is only for HTML."""
    return unescape(re.sub(r"<br ?/?>", "\n", str(text or "")))


def key_of(items: tuple[LegendItem, ...]) -> list[tuple[str, str, str]]:
    """Return label, colour and mark of a legend, each label once."""
    return [(i.label, i.colour, i.mark) for i in {i.label: i for i in items}.values()]
