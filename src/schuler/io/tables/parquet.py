"""Parquet: columns in a binary file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from schuler.errors import InputError
from schuler.io.columns import bare
from schuler.io.format import Format, What
from schuler.io.source import Columns, even_parts
from schuler.io.tables.numbers import RATE_NAMES, positive_rate, seconds_of_nanoseconds
from schuler.io.tables.parquet_file import parquet_frame, parquet_rows, parquet_schema
from schuler.io.trajectories.table import recording_parquet, write_parquet

if TYPE_CHECKING:
    from schuler.io.options import ReadOptions


@dataclass(frozen=True, slots=True, eq=False)
class ParquetSource:
    """A Parquet file."""

    path: Path  # the file
    names: tuple[str, ...]  # names of its columns
    kinds: dict[str, str]  # "number", "text", "moment" (date and time) or "other", by name
    rate: float | None = None  # sampling rate in Hz, from the file's key-value metadata
    units: dict[str, str] = field(default_factory=dict)
    history: tuple[str, ...] = ()
    assumptions: tuple[str, ...] = ()
    part: tuple[int, int] | None = None  # first row and number of rows, where not all are wanted

    @property
    def first_row(self) -> int | None:
        """Row of the file with which a part begins."""
        return None if self.part is None else self.part[0]

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
        frame = parquet_frame(self.path, tuple(dict.fromkeys(names)), self.part)
        columns: Columns = {}
        for name in names:
            series = frame[name]
            if self.kinds[name] == "moment":
                series = series.cast(polars.Datetime("ns")).cast(polars.Int64)
                columns[name] = seconds_of_nanoseconds(series.to_numpy())
            elif self.kinds[name] == "text":
                columns[name] = series.fill_null("").to_numpy().astype(str)
            else:
                series = series if series.dtype.is_float() else series.cast(polars.Float64)
                series = series.fill_null(float("nan")) if series.null_count() else series
                columns[name] = series.to_numpy()
        return columns

    def place(self, row: int, name: str = "") -> str:
        """Return file, row (counted from 0) and column."""
        column = f", column '{name}'" if name else ""
        return f"{self.path}, row {row + (self.first_row or 0)}{column}"


def open_parquet(path: Path, what: What, options: ReadOptions) -> ParquetSource:
    """Open a Parquet file."""
    import polars

    schema, metadata = parquet_schema(path)
    kinds = {}
    for name, dtype in schema.items():
        if dtype.is_numeric() or dtype == polars.Boolean:
            kinds[name] = "number"
        elif dtype == polars.String:
            kinds[name] = "text"
        else:
            kinds[name] = "moment" if isinstance(dtype, polars.Datetime) else "other"
    rates = [v for k, v in metadata.items() if bare(k) in RATE_NAMES]
    return ParquetSource(path, tuple(schema), kinds, positive_rate(rates[0]) if rates else None)


def parquet_parts(
    path: Path, what: What, options: ReadOptions, rows: int
) -> Iterator[ParquetSource]:
    """Yield a Parquet file in parts of one size."""
    source = open_parquet(path, what, options)
    for start, stop in even_parts(parquet_rows(path), rows):
        yield replace(source, part=(start, stop - start))


FORMATS = (
    Format(
        "parquet",
        "a Parquet file",
        (".parquet",),
        ("imu", "gnss", "sensor"),
        magic=(b"PAR1",),
        open=open_parquet,
        parts=parquet_parts,
        write_trajectory=write_parquet,
        write_recording=recording_parquet,
    ),
)
