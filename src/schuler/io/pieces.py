"""Recordings larger than memory, piece by piece: parts of a file, or files in a row."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from schuler.data import ImuRecording
from schuler.errors import InputError
from schuler.io.imu import imu_recordings
from schuler.io.options import ReadOptions
from schuler.io.registry import format_of, is_recording, open_with, parts_with, suffixes
from schuler.io.tables.parquet_file import parquet_rows
from schuler.io.time_repair import next_round

PIECE = 1 << 19
"""Rows read at once."""


def read_imu_pieces(
    path: str | Path | Sequence[str | Path], rows: int = PIECE, **how: Any
) -> Iterator[ImuRecording]:
    """Read the recording of one IMU piece by piece.

    Parameters
    ----------
    path : str, Path or sequence
        A file; or files that follow each other in time; or a folder of them (a dataset in
        partitions, such as ``day=2026-01-01/part-0.parquet``), in the order of their names.
        Parquet, CSV and other text, NPY, NPZ and bags are read so many rows at a time, other
        files as a whole.
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
    end, added = float("-inf"), 0.0
    for file in _files(path):
        for part in parts_with(format_of(file), file, "imu", options, rows):
            piece = imu_recordings(part, options, only_first=True)[0]
            begin = float(piece.time[0]) + added
            if begin <= end and (turn := next_round(begin, end, 1.0 / piece.rate)):
                added += turn[0]
                said = f"time wraps round at {turn[1]} before this piece: undone"
                piece = replace(piece, assumptions=(*piece.assumptions, said))
            piece = replace(piece, time=piece.time + added) if added else piece
            if piece.time[0] <= end:
                raise InputError(
                    f"the piece from {piece.time[0]:.3f} s begins before the one before it ends "
                    f"({end:.3f} s)",
                    expected="files and rows in the order of time, and a clock that does not start "
                    "again",
                    where=str(file),
                )
            end = float(piece.time[-1])
            yield piece


def size_of_table(path: Path) -> int:
    """Return the bytes that a recording would take in memory where that is known, else 0."""
    if path.is_dir():
        return 0 if is_recording(path) else sum(map(size_of_table, _in_folder(path)))
    if not path.is_file():
        return 0
    if path.suffix.lower() != ".parquet":
        return path.stat().st_size
    source = open_with(format_of(path), path, "imu", ReadOptions())
    return parquet_rows(path) * 8 * len(source.names)


def is_partitioned(path: Path) -> bool:
    """Whether a folder holds one recording in parts: names that differ in their numbers only."""
    if not path.is_dir() or is_recording(path):
        return False
    names = [re.sub(r"\d+", "0", str(p.relative_to(path))) for p in _in_folder(path)]
    return len(names) > 1 and len(set(names)) == 1


def _in_folder(folder: Path) -> list[Path]:
    known = suffixes()
    inside = sorted(folder.rglob("*"))
    return [
        p for p in inside
        if p.is_file() and p.suffix.lower() in known and not p.name.startswith((".", "_"))
    ]  # fmt: skip


def _files(path: str | Path | Sequence[str | Path]) -> list[Path]:
    if not isinstance(path, (str, Path)):
        files = [Path(p) for p in path]
    elif Path(path).is_dir() and not is_recording(Path(path)):
        files = _in_folder(Path(path))
    else:
        files = [Path(path)]
    if not files:
        raise InputError("there are no recordings", expected="at least one", where=str(path))
    return files
