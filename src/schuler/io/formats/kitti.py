"""KITTI's oxts: a folder with one line of 30 numbers a packet, and their time stamps."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from schuler.errors import InputError
from schuler.io.columns import Column
from schuler.io.dates import moments
from schuler.io.format import Format, Start, What
from schuler.io.source import Columns, MemorySource, Notes

if TYPE_CHECKING:
    from schuler.io.options import ReadOptions

_NAMES = ("lat", "lon", "alt", "roll", "pitch", "yaw", "vn", "ve", "vf", "vl", "vu", "ax", "ay",
          "az", "af", "al", "au", "wx", "wy", "wz", "wf", "wl", "wu", "pos_accuracy",
          "vel_accuracy")  # fmt: skip


def open_oxts(path: Path, what: What, options: ReadOptions) -> MemorySource:
    """Read IMU or GNSS of a folder of oxts; axes forward, left, up."""
    folder = path / "oxts" if (path / "oxts").is_dir() else path
    files = sorted((folder / "data").glob("*.txt"))
    stamps = (folder / "timestamps.txt").read_text(encoding="utf-8").split("\n")
    stamps = [x.strip() for x in stamps if x.strip()]
    if not files or len(files) != len(stamps):
        raise InputError(
            f"{len(files)} packets and {len(stamps)} time stamps",
            expected="one of each",
            where=str(folder),
        )
    try:
        rows = [[float(x) for x in f.read_text(encoding="utf-8").split()[:25]] for f in files]
        table = np.array(rows)
        if table.ndim != 2 or table.shape[1] < len(_NAMES):
            raise ValueError
    except ValueError:
        raise InputError(
            "a packet does not hold 30 numbers", expected="oxts of KITTI", where=str(folder)
        ) from None
    memory = MemorySource(folder / "timestamps.txt", {"time": np.array(stamps)})
    time = moments(memory, Column("time", "time", ""), np.array(stamps), None, Notes())
    data = dict(zip(_NAMES, table.T, strict=False))
    columns: Columns = {"time_s": time}
    if what == "imu":
        columns |= {f"gyro_{a}_rad_s": data[f"w{a}"] for a in "xyz"}
        columns |= {f"accel_{a}_m_s2": data[f"a{a}"] for a in "xyz"}
    else:
        columns |= {"latitude_deg": data["lat"], "longitude_deg": data["lon"]}
        columns |= {"height_m": data["alt"], "vel_north_m_s": data["vn"]}
        columns |= {"vel_east_m_s": data["ve"], "vel_up_m_s": data["vu"]}
        columns |= {"pos_std_m": data["pos_accuracy"], "vel_std_m_s": data["vel_accuracy"]}
    return MemorySource(path, columns, {}, None, ("oxts of KITTI",), "packet")


def _is_oxts(start: Start) -> bool:
    names = start.names
    return ("timestamps.txt" in names and (start.path / "data").is_dir()) or (
        "oxts" in names and (start.path / "oxts" / "timestamps.txt").exists()
    )


FORMATS = (
    Format("kitti-oxts", "oxts of KITTI (a folder)", (), ("imu", "gnss"), detect=_is_oxts,
           open=open_oxts),
)  # fmt: skip
