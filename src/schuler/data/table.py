"""Tables and text on disk, written to a temporary name first and then renamed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from schuler.output_file import OutputFile, is_temporary


def write_atomically(path: str | Path, write: Callable[[Path], None]) -> None:
    """Let `write` fill a temporary file beside `path`, then rename it to `path`."""
    if is_temporary(Path(path)):  # of somebody who will rename it
        write(Path(path))
        return
    output = OutputFile(path)
    try:
        output.fill(write)
        output.publish()
    finally:
        output.release()


def write_text(path: str | Path, text: str) -> None:
    """Write UTF-8 text so that the file is either old or complete."""
    write_atomically(path, lambda temporary: _write_utf8(temporary, text))


def _write_utf8(path: Path, text: str) -> None:
    # Names of files that are no Unicode stand in texts too.
    path.write_text(text, encoding="utf-8", errors="backslashreplace", newline="\n")


def write_parquet(path: str | Path, columns: Mapping[str, NDArray[np.float64]]) -> None:
    """Write named columns as Parquet (zstd)."""
    import polars

    frame = polars.DataFrame(dict(columns))
    write_atomically(path, lambda temporary: frame.write_parquet(temporary, compression="zstd"))
