"""NumPy archives: arrays by name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from schuler.errors import InputError
from schuler.io.format import Format, What
from schuler.io.source import MemorySource
from schuler.io.tables.arrays import source_of_arrays
from schuler.io.tables.foreign import refuse_foreign

if TYPE_CHECKING:
    from schuler.io.options import ReadOptions


def open_npz(path: Path, what: What, options: ReadOptions) -> MemorySource:
    """Open a NumPy archive; objects in it are refused, never unpickled."""
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            if not all(m.endswith(".npy") for m in archive.zip.namelist()):
                refuse_foreign(path, b"PK\x03\x04")
            arrays = {name: archive[name] for name in archive.files}
    except InputError:
        raise
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
    return source_of_arrays(path, arrays)


def _damaged_archive(path: Path, error: Exception) -> InputError:
    return InputError(
        f"the NPZ archive is cut short or damaged ({type(error).__name__})",
        expected="a complete archive written by numpy.savez",
        cure="copy or write it again",
        where=str(path),
    )


FORMATS = (
    Format(
        "npz",
        "an NPZ archive",
        (".npz",),
        ("imu", "gnss", "sensor"),
        magic=(b"PK\x03\x04",),
        open=open_npz,
    ),
)
