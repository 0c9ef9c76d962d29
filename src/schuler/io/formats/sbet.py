"""SBET: the smoothed best estimate of trajectory of Applanix, 17 numbers of 64 bits an epoch."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from schuler.errors import InputError
from schuler.io.format import Format, Start, What
from schuler.io.source import Columns, MemorySource
from schuler.io.trajectories.receivers import write_sbet
from schuler.types import BoolArray, FloatArray

if TYPE_CHECKING:
    from schuler.io.options import ReadOptions

WIDTH = 17
"""Numbers of an epoch: time, latitude, longitude, altitude, velocity x, y, z, roll, pitch,
platform heading, wander angle, accelerations and angular rates of the body."""


def open_sbet(path: Path, what: What, options: ReadOptions) -> MemorySource:
    """Read positions and velocities; time is seconds of the GPS week."""
    size = path.stat().st_size
    if size % (8 * WIDTH):
        raise InputError(
            f"the file ends in the middle of an epoch ({size % (8 * WIDTH)} bytes more)",
            expected=f"a multiple of {8 * WIDTH} bytes",
            cure="copy it again",
            where=str(path),
        )
    table = np.fromfile(path, dtype="<f8").reshape(-1, WIDTH)
    wander = table[:, 10]
    north = table[:, 4] * np.cos(wander) - table[:, 5] * np.sin(wander)
    east = table[:, 4] * np.sin(wander) + table[:, 5] * np.cos(wander)
    columns: Columns = {
        "tow_s": table[:, 0],
        "latitude_rad": table[:, 1],
        "longitude_rad": table[:, 2],
        "height_ellipsoid_m": table[:, 3],
        "vel_north_m_s": north,
        "vel_east_m_s": east,
        "vel_down_m_s": table[:, 6],
    }
    return MemorySource(path, columns, {}, None, ("SBET",), "epoch")


def plausible(table: FloatArray) -> BoolArray:
    """Tell which rows of 17 numbers can be epochs."""
    with np.errstate(invalid="ignore"):
        good = np.isfinite(table).all(axis=1)
        good &= (table[:, 0] >= 0.0) & (table[:, 0] < 1e10)
        good &= (np.abs(table[:, 1]) <= np.pi / 2) & (np.abs(table[:, 2]) <= 2 * np.pi)
        good &= (np.abs(table[:, 3]) < 1e5) & (np.abs(table[:, 7:11]) <= 7.0).all(axis=1)
        good &= np.abs(table[:, 1]) > 1e-6
    return np.asarray(good)


def _is_sbet(start: Start) -> bool:
    data = start.bytes
    count = len(data) // (8 * WIDTH)
    if count < 2 or (b"\0" not in data and start.lines):
        return False
    table = np.frombuffer(data[: count * 8 * WIDTH], dtype="<f8").reshape(-1, WIDTH)
    return bool(plausible(table).all() and (np.diff(table[:, 0]) > 0.0).all())


FORMATS = (
    Format(
        "sbet",
        "SBET of Applanix",
        (".sbet", ".out"),
        ("gnss",),
        detect=_is_sbet,
        open=open_sbet,
        write_trajectory=write_sbet,
    ),
)
