"""Text with one row a sensor: a column says which, three others hold its axes."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from schuler.errors import InputError
from schuler.io.columns import bare, find_columns
from schuler.io.format import Format, Start, What
from schuler.io.source import Columns, MemorySource
from schuler.io.tables.fields import split
from schuler.io.tables.text import open_text

if TYPE_CHECKING:
    from schuler.io.options import ReadOptions
    from schuler.io.tables.text import TextSource

_LABELS = {
    "gyro": re.compile(r"(?:uncal\w*|cal\w*|tk_|type_)?(?:gyro\w*|gyr|angular\w*|rotation_?rate)"
                       r"(?:uncal\w*)?$", re.I),
    "accel": re.compile(r"(?:uncal\w*|cal\w*|type_)?(?:acc|accel\w*|totalacceleration)"
                        r"(?:uncal\w*)?$", re.I),
}  # fmt: skip
_NAMES = re.compile(r"(?:message|sensor|data|measurement|event)?(?:type|name|sensor|id|kind)?")
_AXIS = re.compile(r"(?:measurement|value|val|data|sensor)?_?(?P<axis>[xyz012])")


def _layout(names: tuple[str, ...]) -> tuple[list[str], list[str]]:
    """Return columns that may hold the name of a sensor, and the three of its axes."""
    labels = [n for n in names if _NAMES.fullmatch(bare(n)) and bare(n)]
    axes = [n for n in names if _AXIS.fullmatch(bare(n))]
    return labels, axes[:3]


def _is_long(start: Start) -> bool:
    for k, line in enumerate(start.lines[:60]):
        for delimiter in (",", ";", "\t", " "):
            names = tuple(split(line.lstrip("#% "), delimiter))
            labels, axes = _layout(names)
            if not labels or len(axes) != 3:
                continue
            rows = [split(x, delimiter) for x in start.lines[k + 1 : k + 400]]
            place = names.index(labels[0])
            words = {r[place] for r in rows if len(r) > place}
            return all(any(p.match(w) for w in words) for p in _LABELS.values())
    return False


def open_long(path: Path, what: What, options: ReadOptions) -> MemorySource:
    """Spread the rows over the columns of a gyro and an accelerometer."""
    text = open_text(path, options.text())
    return spread_rows(text, path)


def spread_rows(text: TextSource, path: Path) -> MemorySource:
    """Return one table with the axes of each sensor in columns of their own."""
    labels, axes = _layout(text.names)
    if not labels or len(axes) != 3:
        raise InputError(
            "the columns of one row a sensor were not found",
            expected="a column with the name of the sensor, and x, y, z",
            where=str(path),
        )
    stamp = find_columns(text.names, {}, text.units).get("time")
    if stamp is None:
        raise InputError("there is no column of time", expected="one", where=str(path))
    table = text.load((stamp.name, labels[0], *axes))
    words = table[labels[0]]
    columns: Columns = {stamp.name: table[stamp.name]}
    counts = []
    for sensor, pattern in _LABELS.items():
        found = [w for w in np.unique(words) if pattern.match(str(w))]
        if not found:
            continue
        chosen = max(found, key=lambda w: int(np.sum(words == w)))
        here = words == chosen
        counts.append(f"{int(here.sum())} rows of {chosen}")
        for axis, name in zip("xyz", axes, strict=True):
            columns[f"{sensor}_{axis}"] = np.where(here, table[name], np.nan)
    keep = np.zeros(words.size, dtype=bool)
    for name, values in columns.items():
        if name != stamp.name:
            keep |= np.isfinite(values)
    columns = {n: v[keep] for n, v in columns.items()}
    android = any(str(w).lower().startswith(("uncal", "accel_", "tk_")) for w in np.unique(words))
    units = {stamp.name: stamp.unit} if stamp.unit else {}
    if android:
        units |= {f"gyro_{a}": "rad/s" for a in "xyz"} | {f"accel_{a}": "m/s^2" for a in "xyz"}
    history = (*text.history, f"one row a sensor: {', '.join(counts)}")
    return MemorySource(path, columns, units, None, history)


FORMATS = (
    Format(
        "long-rows",
        "text with one row a sensor",
        (),
        ("imu",),
        detect=_is_long,
        open=open_long,
    ),
)
