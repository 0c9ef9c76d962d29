"""NumPy archives: arrays by name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from schuler.errors import InputError
from schuler.io.format import Format, What
from schuler.io.source import MemorySource
from schuler.io.tables.arrays import source_of_arrays
from schuler.io.tables.foreign import refuse_foreign

if TYPE_CHECKING:
    from schuler.io.options import ReadOptions


_LARGE = 100_000_000
"""Bytes up to which an archive is unpacked without looking at how far it was packed."""
_MOST_PACKED = 100
"""How far an honest recording packs at most; zeros pack to one part in 1000."""


def open_npz(path: Path, what: What, options: ReadOptions) -> MemorySource:
    """Open a NumPy archive; objects in it are refused, never unpickled."""
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            if not all(m.endswith(".npy") for m in archive.zip.namelist()):
                refuse_foreign(path, b"PK\x03\x04")
            _check_sizes(path, archive.zip)
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
    for name, array in arrays.items():
        if not isinstance(array, np.ndarray) or array.dtype.kind not in "biufUM":
            kind = getattr(array, "dtype", "no array")
            raise InputError(
                f"the array '{name}' holds no numbers ({str(kind)[:40]})",
                expected="arrays of numbers",
                where=str(path),
            )
    return source_of_arrays(path, arrays)


def _check_sizes(path: Path, archive: Any) -> None:
    """Refuse what would not fit into memory before anything is unpacked."""
    sizes = [(m.file_size, m.compress_size) for m in archive.infolist()]
    unpacked, packed = sum(s for s, _ in sizes), sum(s for _, s in sizes)
    if unpacked > _LARGE and unpacked > _MOST_PACKED * packed:
        raise InputError(
            f"the archive of {packed / 1e6:.1f} MB would unpack to {unpacked / 1e6:.0f} MB",
            expected=f"a recording, which packs to no less than one part in {_MOST_PACKED}",
            cure="save it again with numpy.savez (not compressed) if it is yours",
            where=str(path),
        )


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
