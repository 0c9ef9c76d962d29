"""NumPy archives: arrays by name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from schuler.errors import InputError
from schuler.io.columns import bare, split_unit
from schuler.io.format import Format, What
from schuler.io.source import Columns, MemorySource
from schuler.io.tables.foreign import refuse_foreign
from schuler.io.tables.numbers import RATE_NAMES, positive_rate, seconds_of_nanoseconds

if TYPE_CHECKING:
    from schuler.io.options import ReadOptions


def open_npz(path: Path, what: What, options: ReadOptions) -> MemorySource:
    """Open a NumPy archive; objects in it are refused, never unpickled."""
    columns: Columns = {}
    rate = None
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
