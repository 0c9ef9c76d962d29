"""Recordings larger than memory, piece by piece: Parquet, or files that follow each other."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

from schuler.data import ImuRecording
from schuler.errors import InputError
from schuler.io.imu import imu_recordings
from schuler.io.options import ReadOptions
from schuler.io.registry import format_of, open_with, suffixes
from schuler.io.tables.parquet import ParquetSource
from schuler.io.tables.parquet_file import parquet_rows

PIECE = 1 << 19
"""Rows read at once."""


def read_imu_pieces(
    path: str | Path | Sequence[str | Path], rows: int = PIECE, **how: Any
) -> Iterator[ImuRecording]:
    """Read the recording of one IMU piece by piece.

    Parameters
    ----------
    path : str, Path or sequence
        A Parquet file, read so many rows at a time; or files (or a folder of files, by name) that
        follow each other in time, of any format, each read as a whole.
    rows : int
        Rows of a piece.
    **how
        As for `read_imu`.

    Yields
    ------
    ImuRecording
        In the order of time.

    Raises
    ------
    InputError
        As for `read_imu`; pieces that go back in time; no files.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np, polars
    >>> from schuler.io.pieces import read_imu_pieces
    >>> columns = {"time_s": np.arange(1000) / 100.0}
    >>> columns |= {f"gyro_{a}_rad_s": np.sin(np.arange(1000.0)) for a in "xyz"}
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     polars.DataFrame(columns).write_parquet(Path(folder) / "imu.parquet")
    ...     [piece.size for piece in read_imu_pieces(Path(folder) / "imu.parquet", rows=400)]
    [333, 333, 334]
    """
    options = ReadOptions(**how)
    end = float("-inf")
    for file in _files(path):
        for piece in _pieces(file, rows, options):
            if piece.time[0] <= end:
                raise InputError(
                    f"the piece from {piece.time[0]:.3f} s begins before the one before it ends "
                    f"({end:.3f} s)",
                    expected="files and rows in the order of time",
                    where=str(file),
                )
            end = float(piece.time[-1])
            yield piece


def size_of_table(path: Path) -> int:
    """Return the bytes that a recording would take in memory where that is known, else 0."""
    if path.is_dir():
        return sum(size_of_table(p) for p in path.iterdir() if p.is_file())
    if path.suffix.lower() != ".parquet" or not path.is_file():
        return 0
    source = open_with(format_of(path), path, "imu", ReadOptions())
    return parquet_rows(path) * 8 * len(source.names)


def _files(path: str | Path | Sequence[str | Path]) -> list[Path]:
    if not isinstance(path, (str, Path)):
        files = [Path(p) for p in path]
    elif Path(path).is_dir():
        known = suffixes()
        files = sorted(p for p in Path(path).iterdir() if p.suffix.lower() in known)
    else:
        files = [Path(path)]
    if not files:
        raise InputError("there are no recordings", expected="at least one", where=str(path))
    return files


def _pieces(file: Path, rows: int, options: ReadOptions) -> Iterator[ImuRecording]:
    source = open_with(format_of(file), file, "imu", options)
    if not isinstance(source, ParquetSource):
        yield imu_recordings(source, options, only_first=True)[0]
        return
    total = parquet_rows(file)
    count = max(1, -(-total // rows))
    edges = [total * k // count for k in range(count + 1)]
    for start, stop in pairwise(edges):
        part = replace(source, part=(start, stop - start))
        yield imu_recordings(part, options, only_first=True)[0]
