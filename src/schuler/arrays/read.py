"""Array recordings in: one file of several IMUs, several files, or a folder of them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

from schuler.arrays.clocks.synchronization import synchronize
from schuler.data import ImuArray, ImuRecording, Mounting
from schuler.errors import InputError
from schuler.io import read_imus

SUFFIXES = {".parquet", ".csv", ".txt", ".npz", ".bag", ".db3", ".mcap", ".tsv", ".dat"}
"""Of files in a folder that may hold an IMU."""

Clocks = Literal["auto", "shared", "own"]


def read_array(
    path: str | Path | Sequence[str | Path],
    *,
    mounting: Mounting | None = None,
    clocks: Clocks = "auto",
    **how: Any,
) -> ImuArray:
    """Read the recordings of several IMUs on one body.

    Parameters
    ----------
    path : str, Path, or sequence of these
        One file with several IMUs (columns ``imu3_gyro_x_rad_s`` side by side, or a column
        ``imu`` with its number and the IMUs below each other); several files, each with one or
        more IMUs; or a folder with files named imu1.*, imu2.*, ...
    mounting : Mounting, optional
        Of the IMUs, in the order of files and numbers; all aligned with the body if not given.
    clocks : {"auto", "shared", "own"}
        Whether the stamps of different IMUs are of one clock. "auto": those of one file are, and
        those of several files where every stamp of one is a stamp of the others too. Otherwise
        offset and rate of each clock are found from the motion (`synchronize`) and the IMUs are
        resampled to the stamps of the first.
    **how
        As in `schuler.read_imu`, for every file.

    Returns
    -------
    ImuArray
        Rows that an IMU lacks, and rows without a number, are missing (NaN) for that IMU alone.
        `history` tells what was done to each.

    Raises
    ------
    InputError
        No file, or fewer than two IMUs in all; anything wrong with a file.
    EstimationError
        Clocks that cannot be brought together.
    """
    files = _files(path)
    how = {"missing": True, **how}
    recordings: list[ImuRecording] = [r for file in files for r in read_imus(file, **how)]
    if len(recordings) < 2:
        raise InputError(
            f"there is {len(recordings)} IMU in {', '.join(f.name for f in files)}",
            expected="at least two IMUs, in one file or in several",
            cure="name the files of the others too, or read it with read_imu",
        )
    if mounting is not None and mounting.count != len(recordings):
        raise InputError(
            f"{len(recordings)} recordings and mountings of {mounting.count} IMUs",
            expected="as many of each",
        )
    if clocks == "own":
        return synchronize(recordings, mounting).array
    if clocks == "shared" or len(files) == 1:
        return ImuArray.from_recordings(recordings, mounting)
    try:
        return ImuArray.from_recordings(recordings, mounting)
    except InputError:
        return synchronize(recordings, mounting).array


def _files(path: str | Path | Sequence[str | Path]) -> list[Path]:
    if isinstance(path, (str, Path)):
        one = Path(path)
        return _in_folder(one) if one.is_dir() else [one]
    files = [Path(p) for p in path]
    if not files:
        raise InputError("no file of an array", expected="at least one")
    if len({f.resolve() for f in files}) < len(files):
        raise InputError("a file is named twice", expected="each file once")
    return [inner for f in files for inner in (_in_folder(f) if f.is_dir() else [f])]


def _in_folder(folder: Path) -> list[Path]:
    """Return the files of a folder that hold IMUs, in the order of their numbers."""
    if (folder / "metadata.yaml").exists():  # a ROS 2 bag
        return [folder]
    files = [
        p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES and "imu" in p.stem.lower()
    ]
    if not files:
        raise InputError(
            "the folder holds no file with 'imu' in its name",
            expected="files such as imu1.csv, imu2.csv",
            cure="name the files themselves",
            where=str(folder),
        )

    def order(file: Path) -> tuple[list[int], str]:
        return [int(n) for n in re.findall(r"\d+", file.stem)], file.name

    return sorted(files, key=order)
