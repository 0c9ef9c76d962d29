"""JSON lines: one object a line, with numbers, or lists of three, by name."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from schuler.errors import InputError
from schuler.io.format import Format, Start, What
from schuler.io.source import Columns, MemorySource

if TYPE_CHECKING:
    from schuler.io.options import ReadOptions

_AXES = {3: "xyz"}


def open_json(path: Path, what: What, options: ReadOptions) -> MemorySource:
    """Read objects of one line each, or one list of objects."""
    columns: dict[str, list[Any]] = {}
    count = 0
    for number, record in _records(path):
        if not isinstance(record, dict):
            raise InputError(
                "this is no object of names and values",
                expected='one JSON object a line, such as {"time": 0.01, "gyro": [0, 0, 0]}',
                where=f"{path}, line {number}",
            )
        for name, value in _flat("", record):
            column = columns.setdefault(name, [])
            column.extend([np.nan] * (count - len(column)))
            column.append(value)
        count += 1
    table: Columns = {}
    for name, column in columns.items():
        column.extend([np.nan] * (count - len(column)))
        if any(isinstance(v, str) for v in column):
            table[name] = np.array([v if isinstance(v, str) else "" for v in column])
        else:
            table[name] = np.array([np.nan if v is None else float(v) for v in column])
    return MemorySource(path, table, {}, None, ("JSON",), "record")


def _records(path: Path) -> list[tuple[int, Any]]:
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    if text.lstrip().startswith("["):
        try:
            return list(enumerate(json.loads(text), start=1))
        except ValueError as error:
            raise _broken(path, 1, error) from None
    found = []
    for number, line in enumerate(text.splitlines(), start=1):
        if line.strip():
            try:
                found.append((number, json.loads(line)))
            except ValueError as error:
                raise _broken(path, number, error) from None
    return found


def _broken(path: Path, number: int, error: ValueError) -> InputError:
    return InputError(
        f"this is not JSON ({str(error)[:60]})",
        expected="one JSON object a line",
        cure="copy the file again, or remove this line",
        where=f"{path}, line {number}",
    )


def _flat(prefix: str, value: Any) -> list[tuple[str, Any]]:
    """Spread objects in objects, and lists of three over x, y, z."""
    if isinstance(value, dict):
        return [p for k, v in value.items() for p in _flat(f"{prefix}.{k}" if prefix else k, v)]
    if isinstance(value, list):
        axes = _AXES.get(len(value))
        return [
            p for k, v in enumerate(value) for p in _flat(f"{prefix}_{axes[k] if axes else k}", v)
        ]
    return [(prefix, value if isinstance(value, str) or value is None else float(value))]


def _is_json(start: Start) -> bool:
    first = next((x.strip() for x in start.lines if x.strip()), "")
    return (first.startswith(("{", "[{")) and '"' in first) or first == "["


FORMATS = (
    Format(
        "json-lines",
        "JSON lines",
        (".jsonl", ".json", ".ndjson"),
        ("imu", "gnss", "sensor"),
        detect=_is_json,
        open=open_json,
    ),
)
