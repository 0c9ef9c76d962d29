"""A result as one table of named columns, found from the fields of its dataclass."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.data.to_dict import plain

Columns = dict[str, NDArray[Any]]


def columns_of(result: Any, table: str = "", axes: str = "x y z") -> Columns:
    """Return a series by its samples, else a row for each part, else the one row of numbers.

    `table` names the field that holds the parts; `axes` are the names of three columns.
    """
    values = {f.name: getattr(result, f.name) for f in fields(result)}
    if table:
        return table_of(_rows(values[table]))
    if _fitted(result):
        return table_of(_parameters(result))
    series = _series(values, axes.split())
    if series:
        return series
    parts = next((v for v in values.values() if _parts(v)), None)
    return table_of([_flat(plain(result))] if parts is None else _rows(parts))


def index_of(columns: Columns) -> str:
    """Return the first column where it counts the rows of a series, else nothing."""
    name = next(iter(columns), "")
    first = columns.get(name)
    if first is None or first.dtype.kind not in "iuf" or first.size < 2:
        return ""
    return name if bool(np.all(np.diff(first) > 0)) else ""


def _series(values: Mapping[str, Any], axes: Sequence[str]) -> Columns:
    """Return all arrays that are as long as the first array of numbers."""
    arrays = {n: v for n, v in values.items() if isinstance(v, np.ndarray) and v.ndim}
    counting = [v for v in arrays.values() if v.ndim == 1 and v.dtype.kind in "iuf"]
    leading = next(iter([*counting, *(v for v in arrays.values() if v.dtype.kind in "iuf")]), None)
    if leading is None or len(leading) < 2:
        return {}
    found: Columns = {}
    for name, value in values.items():
        if isinstance(value, np.ndarray) and value.ndim and len(value) == len(leading):
            found |= _split(name, value, axes)
        elif isinstance(value, tuple) and len(value) == len(leading) and _scalars(value):
            found[name] = np.array(value)
    first = next(n for n, v in values.items() if v is leading)
    return {first: found.pop(first), **found} if first in found else found


def _split(name: str, value: NDArray[Any], axes: Sequence[str]) -> Columns:
    if value.ndim == 1:
        return {name: value}
    width = value.shape[1]
    words = axes if width == len(axes) else [str(k) for k in range(width)]
    found: Columns = {}
    for k, word in enumerate(words):
        found |= _split(f"{name}_{word}", value[:, k], axes)
    return found


def _scalars(value: Sequence[Any]) -> bool:
    return all(isinstance(v, str | float | int) for v in value)


def _parts(value: Any) -> bool:
    each = list(value.values()) if isinstance(value, Mapping) else value
    return isinstance(each, list | tuple) and len(each) > 0 and all(map(is_dataclass, each))


def _rows(value: Any) -> list[dict[str, Any]]:
    """Return one row for each part, or one for each of its parameters where it was fitted."""
    named = value.items() if isinstance(value, Mapping) else ((None, part) for part in value)
    rows: list[dict[str, Any]] = []
    for name, part in named:
        of_part = _parameters(part) if _fitted(part) else [_flat(plain(part))]
        rows += of_part if name is None else [{"name": str(name)} | row for row in of_part]
    return rows


def _fitted(result: Any) -> bool:
    return isinstance(getattr(result, "parameters", None), Mapping) and not _parts(
        result.parameters
    )


def _parameters(result: Any) -> list[dict[str, Any]]:
    """Return one row for each parameter: its value, its error, its interval where there is one."""
    errors = getattr(result, "standard_errors", {})
    intervals = getattr(result, "intervals", {})
    return [
        {"parameter": key, "value": value}
        | ({"standard_error": errors.get(key)} if errors else {})
        | (dict(zip(("lower", "upper"), intervals[key], strict=True)) if key in intervals else {})
        for key, value in result.parameters.items()
    ]


def _flat(value: Any, before: str = "") -> dict[str, Any]:
    """Return the numbers and texts of nested dictionaries; lists are left out, save triples."""
    if isinstance(value, dict):
        found: dict[str, Any] = {}
        for key, inner in value.items():
            found |= _flat(inner, f"{before}_{key}" if before else str(key))
        return found
    if isinstance(value, list):
        short = len(value) == 3 and _scalars(value)
        return {f"{before}_{k}": v for k, v in zip("xyz", value, strict=True)} if short else {}
    return {before: value}


def table_of(rows: Sequence[Mapping[str, Any]]) -> Columns:
    """Return rows as columns; what a row lacks is NaN or empty."""
    names = list(dict.fromkeys(name for row in rows for name in row))
    return {name: _column([row.get(name) for row in rows]) for name in names}


def _column(values: Sequence[Any]) -> NDArray[Any]:
    """Return numbers as numbers, with NaN for none, and everything else as text."""
    there = [v for v in values if v is not None]
    if there and all(isinstance(v, bool) for v in values):
        return np.array(values, dtype=bool)
    if all(isinstance(v, int | float) for v in there):
        whole = len(there) == len(values) and all(isinstance(v, int) for v in there)
        return np.array(values, dtype=np.int64 if whole else np.float64)
    return np.array(["" if v is None else str(v) for v in values])
