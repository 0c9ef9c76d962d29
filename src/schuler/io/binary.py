"""Parquet and NPZ: columns in binary files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from schuler.errors import InputError
from schuler.io.columns import bare
from schuler.io.source import Columns, MemorySource

_RATE_NAMES = {"rate", "fs", "freq", "frequency", "samplerate", "samplingrate", "samplefrequency"}


@dataclass(frozen=True, slots=True, eq=False)
class ParquetSource:
    """A Parquet file.

    Parameters
    ----------
    path : Path
        The file.
    names : tuple of str
        Names of its columns.
    kinds : dict of str to str
        "number", "text", "moment" (date and time) or "other", by name.
    rate : float or None
        Sampling rate in Hz, from the file's key-value metadata.
    """

    path: Path
    names: tuple[str, ...]
    kinds: dict[str, str]
    rate: float | None = None
    units: dict[str, str] = field(default_factory=dict)
    history: tuple[str, ...] = ()

    def is_text(self, name: str) -> bool:
        """Tell whether a column holds text."""
        return self.kinds[name] == "text"

    def load(self, names: Sequence[str]) -> Columns:
        """Read columns as float64 (NaN: missing), moments as seconds of the Unix epoch."""
        import polars

        other = [n for n in names if self.kinds[n] == "other"]
        if other:
            raise InputError(
                "the column holds no plain numbers",
                expected="one number a row",
                where=f"{self.path}, column '{other[0]}'",
            )
        try:
            frame = polars.read_parquet(self.path, glob=False, columns=list(dict.fromkeys(names)))
        except (polars.exceptions.PolarsError, polars.exceptions.PanicException, OSError) as error:
            raise _damaged(self.path, error) from None
        columns: Columns = {}
        for name in names:
            series = frame[name]
            if self.kinds[name] == "moment":
                series = series.cast(polars.Datetime("ns")).cast(polars.Int64)
                columns[name] = _seconds(series.to_numpy())
            elif self.kinds[name] == "text":
                columns[name] = series.fill_null("").to_numpy().astype(str)
            else:
                series = series if series.dtype.is_float() else series.cast(polars.Float64)
                columns[name] = series.fill_null(float("nan")).to_numpy()
        return columns

    def place(self, row: int, name: str = "") -> str:
        """Return file, row (counted from 0) and column."""
        column = f", column '{name}'" if name else ""
        return f"{self.path}, row {row}{column}"


def _seconds(nanoseconds: Any) -> Any:
    if nanoseconds.dtype.kind == "f":  # missing values turn integers into floats
        return nanoseconds * 1e-9
    return nanoseconds // 10**9 + (nanoseconds % 10**9) * 1e-9


def _damaged(path: Path, error: Exception) -> InputError:
    reason = str(error).splitlines()[0] if str(error) else type(error).__name__
    return InputError(
        f"the Parquet file is cut short or damaged ({reason[:80]})",
        expected="a complete Parquet file",
        cure="copy or write it again",
        where=str(path),
    )


def open_parquet(path: Path) -> ParquetSource:
    """Open a Parquet file."""
    import polars

    try:
        # Opened here: a path with brackets would be taken for a pattern.
        with path.open("rb") as file:
            schema = polars.read_parquet_schema(file)
        metadata = polars.read_parquet_metadata(path)
    except (polars.exceptions.PolarsError, polars.exceptions.PanicException, OSError) as error:
        raise _damaged(path, error) from None
    kinds = {}
    for name, dtype in schema.items():
        if dtype.is_numeric() or dtype == polars.Boolean:
            kinds[name] = "number"
        elif dtype == polars.String:
            kinds[name] = "text"
        else:
            kinds[name] = "moment" if isinstance(dtype, polars.Datetime) else "other"
    rates = [v for k, v in metadata.items() if bare(k) in _RATE_NAMES]
    return ParquetSource(path, tuple(schema), kinds, _rate(rates[0]) if rates else None)


def _rate(text: Any) -> float | None:
    try:
        value = float(text)
    except (TypeError, ValueError):
        return None
    return value if np.isfinite(value) and value > 0 else None


def open_npz(path: Path) -> MemorySource:
    """Open a NumPy archive; objects in it are refused, never unpickled."""
    columns: Columns = {}
    rate = None
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
    except ValueError as error:
        if "allow_pickle" in str(error) or "object" in str(error).lower():
            raise InputError(
                "the archive holds Python objects, which could run code when opened",
                expected="arrays of numbers",
                cure="save it again with astype(float)",
                where=str(path),
            ) from None
        raise _damaged_archive(path, error) from None
    except Exception as error:  # zipfile and zlib raise many kinds for damaged archives
        raise _damaged_archive(path, error) from None
    for name, array in arrays.items():
        if array.ndim == 0 and bare(name) in _RATE_NAMES:
            rate = _rate(array)
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
        _seconds(array.astype("datetime64[ns]").astype(np.int64))
        if array.dtype.kind == "M"
        else array
    )


def _three(name: str, array: Any) -> Columns:
    if array.shape[1] != 3:
        return {f"{name}_{k}": array[:, k] for k in range(array.shape[1])}
    from schuler.io.columns import split_unit

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


def _damaged_archive(path: Path, error: Exception) -> InputError:
    return InputError(
        f"the NPZ archive is cut short or damaged ({type(error).__name__})",
        expected="a complete archive written by numpy.savez",
        cure="copy or write it again",
        where=str(path),
    )
