"""Array recordings in: one file of several IMUs, several files, or a folder of them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal

from schuler.arrays.clocks.synchronization import synchronize
from schuler.data import ImuArray, ImuRecording, Mounting
from schuler.data.mounting import MOUNTING_FILE, read_mounting
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
        Of the IMUs, in the order of files and numbers. If not given, a file mounting.yaml beside
        the recordings says it by the names of the files (`schuler simulate` writes one); without
        one all are aligned with the body.
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

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from pathlib import Path
    >>> from schuler import NoiseModel, WhiteNoise, read_array, simulate_static
    >>> noise = NoiseModel.isotropic(WhiteNoise(1e-4), WhiteNoise(1e-3))
    >>> rng = np.random.default_rng(1)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     files = [Path(folder) / name for name in ("left.parquet", "right.parquet")]
    ...     for file in files:
    ...         simulate_static(noise, 30.0, 50.0, rng).to_parquet(file)
    ...     array = read_array(files)
    >>> array.count
    2
    """
    files = _files(path)
    how = {"missing": True, **how}
    parts = [read_imus(file, **how) for file in files]
    recordings: list[ImuRecording] = [r for part in parts for r in part]
    if len(recordings) < 2:
        raise InputError(
            f"there is {len(recordings)} IMU in {', '.join(f.name for f in files)}",
            expected="at least two IMUs, in one file or in several",
            cure="name the files of the others too, or read it with read_imu",
        )
    if mounting is None:
        mounting = _mounting_beside(files, [len(part) for part in parts])
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


def _mounting_beside(files: Sequence[Path], counts: Sequence[int]) -> Mounting | None:
    """Return what mounting.yaml says of the files: by their names, or in its order for one file."""
    folders = {file.parent if file.is_file() else file for file in files}
    places = [folder / MOUNTING_FILE for folder in folders if (folder / MOUNTING_FILE).is_file()]
    if not places:
        return None
    if len(folders) > 1:
        raise InputError(
            f"files of several folders, and a {MOUNTING_FILE} in {len(places)} of them",
            expected="one folder, or a mounting given by hand",
            cure="give the mounting itself (--mount, --calibration)",
        )
    names, mounting = read_mounting(places[0])
    if len(files) == 1 and mounting.count == counts[0]:
        return mounting
    unknown = [file.stem for file in files if file.stem not in names]
    if unknown or max(counts) > 1:
        said = f"says nothing of {unknown[0]}" if unknown else f"has no {sum(counts)} IMUs"
        raise InputError(
            f"{said}, but of {', '.join(names)}",
            expected="an entry for each IMU, named as its file without the ending",
            cure="add it, or give the mounting itself (--mount, --calibration)",
            where=str(places[0]),
        )
    return mounting.select([names.index(file.stem) for file in files])


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
