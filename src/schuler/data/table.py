"""Tables and text on disk, written to a temporary name first and then renamed."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from schuler.errors import InputError


def write_atomically(path: str | Path, write: Callable[[Path], None]) -> None:
    """Let `write` fill a temporary file beside `path`, then rename it to `path`."""
    target = Path(path)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{target.name}.", dir=target.parent or ".")
    except OSError as error:
        raise InputError(
            f"cannot write there ({error.strerror})",
            expected="an existing folder that can be written",
            where=str(target),
        ) from None
    os.close(handle)
    temporary = Path(name)
    try:
        write(temporary)
        umask = os.umask(0)
        os.umask(umask)
        temporary.chmod(0o666 & ~umask)
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


def write_text(path: str | Path, text: str) -> None:
    """Write UTF-8 text so that the file is either old or complete."""
    write_atomically(path, lambda temporary: _write_utf8(temporary, text))


def _write_utf8(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8", newline="\n")


def write_parquet(path: str | Path, columns: Mapping[str, NDArray[np.float64]]) -> None:
    """Write named columns as Parquet (zstd)."""
    import polars

    frame = polars.DataFrame(dict(columns))
    write_atomically(path, lambda temporary: frame.write_parquet(temporary, compression="zstd"))
