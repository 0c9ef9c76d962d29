"""Arrays by name, and tables that are in memory already: pandas, polars, xarray, dictionaries."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from schuler.errors import InputError
from schuler.io.columns import bare, split_unit
from schuler.io.source import Columns, MemorySource
from schuler.io.tables.numbers import RATE_NAMES, positive_rate, seconds_of_nanoseconds


def source_of_table(table: Any) -> MemorySource:
    """Return the columns of a data frame, a dataset, or a mapping from names to arrays."""
    kind = type(table).__name__
    arrays: dict[str, Any]
    if hasattr(table, "collect"):  # a lazy frame of polars
        table = table.collect()
    if hasattr(table, "get_columns"):  # polars
        arrays = {series.name: series.to_numpy() for series in table.get_columns()}
    elif hasattr(table, "iloc"):  # pandas: the index is a column too, unless it only counts rows
        if type(table.index).__name__ != "RangeIndex":
            index = table.index.to_series().set_axis(table.index)
            arrays = {str(table.index.name or "time"): _array(index)}
        else:
            arrays = {}
        arrays |= {str(name): _array(table[name]) for name in table.columns}
    elif hasattr(table, "data_vars"):  # xarray
        arrays = {str(n): np.asarray(v) for n, v in {**table.coords, **table.data_vars}.items()}
    elif isinstance(table, Mapping):
        arrays = {str(name): np.asarray(values) for name, values in table.items()}
    else:
        raise InputError(
            f"a {kind} is no recording",
            expected="the name of a file, a DataFrame of pandas or polars, a Dataset of xarray, "
            "or a mapping from names to arrays",
        )
    return source_of_arrays(Path(kind), {name: _plain(name, a) for name, a in arrays.items()})


def _array(series: Any) -> Any:
    """Return a column of pandas; stamps with a time zone become those of UTC."""
    if getattr(series.dtype, "tz", None) is not None:
        series = series.dt.tz_convert("UTC").dt.tz_localize(None)
    return series.to_numpy()


def _plain(name: str, array: Any) -> Any:
    """Return numbers or text in place of objects and of lengths of time."""
    if array.dtype.kind == "m":
        return seconds_of_nanoseconds(array.astype("timedelta64[ns]").astype(np.int64))
    if array.dtype.kind != "O":
        return array
    try:
        return array.astype(np.float64)
    except (TypeError, ValueError):
        return array.astype(str)


def source_of_arrays(path: Path, arrays: Mapping[str, Any]) -> MemorySource:
    """Return columns out of arrays; three columns side by side are a vector."""
    columns: Columns = {}
    rate = None
    for name, array in arrays.items():
        if array.ndim == 0 and bare(name) in RATE_NAMES:
            rate = positive_rate(array)
        elif array.ndim == 1:
            columns[name] = _numbers(array)
        elif array.ndim == 2:
            columns |= _three(name, _numbers(array))
    lengths = {n: c.size for n, c in columns.items()}
    if len(set(lengths.values())) > 1:
        text = ", ".join(f"{n} {k}" for n, k in list(lengths.items())[:8])
        raise InputError(f"the arrays differ in length ({text})", where=str(path))
    return MemorySource(path, columns, rate=rate)


def _numbers(array: Any) -> Any:
    return (
        seconds_of_nanoseconds(array.astype("datetime64[ns]").astype(np.int64))
        if array.dtype.kind == "M"
        else array
    )


def _three(name: str, array: Any) -> Columns:
    if array.shape[1] != 3:
        return {f"{name}_{k}": array[:, k] for k in range(array.shape[1])}
    stem, unit = split_unit(name)
    tail = f"_{unit}" if unit else ""
    axes = ["x", "y", "z"]
    if bare(stem) in {
        "velocity",
        "vel",
        "velocityned",
        "positionsd",
        "velocitysd",
        "posstd",
        "velstd",
    }:
        axes = ["north", "east", "down"]
        stem = stem.removesuffix("_ned")
    elif bare(stem) in {"position", "pos", "lla", "llh"}:
        names = ("latitude", "longitude", "height")
        angle = f"_{unit}" if unit in {"deg", "rad"} else ""
        return {f"{n}{angle if k < 2 else ''}": array[:, k] for k, n in enumerate(names)}
    return {f"{stem}_{axis}{tail}": array[:, k] for k, axis in enumerate(axes)}
