"""NumPy archives and arrays."""

from __future__ import annotations

import math
import zipfile
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from schuler.errors import InputError
from schuler.io.format import Format, What
from schuler.io.source import MemorySource, even_parts
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


def npz_parts(path: Path, what: What, options: ReadOptions, rows: int) -> Iterator[MemorySource]:
    """Yield an archive in parts: all its arrays are unpacked side by side."""
    with ExitStack() as opened, zipfile.ZipFile(path) as archive:
        members = {n: opened.enter_context(archive.open(n)) for n in archive.namelist()}
        arrays = {n.removesuffix(".npy"): _Unpacked.of(m) for n, m in members.items()}
        long = [a for a in arrays.values() if a is not None and a.shape]
        if len(long) < len(arrays) - 1 or len({a.shape[0] for a in long}) != 1:
            yield open_npz(path, what, options)  # an array that lies in columns, or a wrong file
            return
        for first, stop in even_parts(long[0].shape[0], rows):
            found = {n: a.next(stop - first) for n, a in arrays.items() if a is not None}
            yield replace(source_of_arrays(path, found), first_row=first)


class _Unpacked:
    """An array in an archive, from its first row to its last."""

    def __init__(self, stream: IO[bytes], shape: tuple[int, ...], dtype: np.dtype[Any]) -> None:
        self.stream, self.shape, self.dtype = stream, shape, dtype
        self.value: Any = None if shape else self._read(())

    @classmethod
    def of(cls, stream: IO[bytes]) -> _Unpacked | None:
        """Read the header; None for an array that cannot be read row by row."""
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0
        shape, in_columns, dtype = (
            read if version == (1, 0) else np.lib.format.read_array_header_2_0
        )(stream)
        plain = dtype.kind in "biufUM" and not (in_columns and len(shape) > 1)
        return cls(stream, shape, dtype) if plain else None

    def next(self, rows: int) -> Any:
        """Return so many rows more; the whole of a number that stands alone."""
        return self._read((rows, *self.shape[1:])) if self.shape else self.value

    def _read(self, shape: tuple[int, ...]) -> Any:
        width = math.prod(shape[1:])
        data = self.stream.read(math.prod(shape) * self.dtype.itemsize)
        values = np.frombuffer(data, self.dtype)
        return values.reshape(len(values) // width, *shape[1:]) if shape else values[0]


def open_npy(path: Path, what: What, options: ReadOptions) -> MemorySource:
    """Open one array: with named fields, or rows of numbers whose columns the user names."""
    return source_of_arrays(path, _mapped(path, options))


def npy_parts(path: Path, what: What, options: ReadOptions, rows: int) -> Iterator[MemorySource]:
    """Yield one array in parts; the file is mapped, not read."""
    arrays = _mapped(path, options)
    for first, stop in even_parts(len(next(iter(arrays.values()))), rows):
        part = {n: np.array(a[first:stop]) for n, a in arrays.items()}
        yield replace(source_of_arrays(path, part), first_row=first)


def _mapped(path: Path, options: ReadOptions) -> dict[str, Any]:
    try:
        array = np.load(path, mmap_mode="r", allow_pickle=False)
    except (ValueError, OSError, EOFError) as error:
        raise InputError(
            f"the array is cut short, damaged, or holds no numbers ({str(error)[:80]})",
            expected="a complete file written by numpy.save", where=str(path),
        ) from None  # fmt: skip
    names = options.text().names
    if array.dtype.names:
        return {n: array[n] for n in array.dtype.names}
    if array.ndim == 2 and len(names) == array.shape[1]:
        return {n: array[:, k] for k, n in enumerate(names)}
    raise InputError(
        f"an array of shape {array.shape} without names",
        expected="named fields, or rows of numbers and the names of their columns in order",
        cure="columns=('gyro_x', 'gyro_y', ...), and rate= where none of them is time",
        where=str(path),
    )


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
        parts=npz_parts,
    ),
    Format(
        "npy",
        "an NPY array",
        (".npy",),
        ("imu", "gnss", "sensor"),
        magic=(b"\x93NUMPY",),
        open=open_npy,
        parts=npy_parts,
    ),
)
