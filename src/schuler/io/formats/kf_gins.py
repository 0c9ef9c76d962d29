"""Text of KF-GINS and PSINS without names: increments of an IMU, known by what gravity makes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from schuler.io.format import Format, Start, What
from schuler.io.source import MemorySource, Source
from schuler.io.tables.text import open_table
from schuler.types import FloatArray

if TYPE_CHECKING:
    from schuler.io.options import ReadOptions

_GRAVITY = (9.0, 10.6)  # m/s^2 that increments of velocity make in the median
_IMU_FORMS = {
    # time first, increments forward, right, down; or time last, increments right, front, up
    "KF-GINS": ("time", "dtheta_x", "dtheta_y", "dtheta_z", "dvel_x", "dvel_y", "dvel_z"),
    "PSINS": ("dtheta_x", "dtheta_y", "dtheta_z", "dvel_x", "dvel_y", "dvel_z", "time"),
}
_FIX = ("time", "latitude_deg", "longitude_deg", "height_m", "pos_std_north_m",
        "pos_std_east_m", "pos_std_down_m", "vel_north_m_s", "vel_east_m_s", "vel_down_m_s",
        "vel_std_north_m_s", "vel_std_east_m_s", "vel_std_down_m_s")  # fmt: skip


def _rows(start: Start) -> FloatArray | None:
    lines = [x for x in start.lines[:-1] if x.strip() and not x.startswith(("#", "%"))][:400]
    if len(lines) < 5 or "," in lines[0] or ";" in lines[0]:
        return None
    try:
        table = np.array([[float(f) for f in x.split()] for x in lines])
    except ValueError:
        return None
    return table if table.ndim == 2 else None


def form_of(table: FloatArray | None) -> str:
    """Return which of the forms rows of numbers are; empty when they are none."""
    if table is None:
        return ""
    if table.shape[1] == 7:
        for name, columns in _IMU_FORMS.items():
            time = table[:, columns.index("time")]
            step = np.diff(time)
            if not (step > 0.0).all() or not 1e-4 < np.median(step) < 0.5:
                continue
            first = columns.index("dvel_x")
            force = np.median(np.linalg.norm(table[:, first : first + 3], axis=1)) / np.median(step)
            if _GRAVITY[0] < force < _GRAVITY[1]:
                return name
    if table.shape[1] in (7, 13):
        step = np.diff(table[:, 0])
        sd = table[:, 4:7]
        degrees = (np.abs(table[:, 1]) <= 90.0).all() and (np.abs(table[:, 2]) <= 360.0).all()
        near = np.ptp(table[:, 1]) < 1.0 and np.abs(table[:, 1]).max() > 1.6
        if (step > 0.0).all() and degrees and near and ((sd > 0.0) & (sd < 200.0)).all():
            return "fixes"
    return ""


def _is_one(start: Start) -> bool:
    return start.path.suffix.lower() in {".txt", ".imu", ".dat", ".asc", ".gnss"} and bool(
        form_of(_rows(start))
    )


def open_increments(path: Path, what: What, options: ReadOptions) -> Source:
    """Read increments of an IMU, or fixes, out of columns that only their numbers tell."""
    if options.columns is not None:
        return open_table(path, what, options)
    form = form_of(_rows(Start(path)))
    if (form == "fixes") != (what == "gnss"):
        return open_table(path, what, options)
    table = np.loadtxt(path, comments=("#", "%"), ndmin=2)
    names = _FIX if form == "fixes" else _IMU_FORMS[form]
    columns = {n: table[:, k] for k, n in enumerate(names[: table.shape[1]])}
    units = {"time": "s"} | {n: "rad" for n in names if n.startswith("dtheta")}
    units |= {n: "m/s" for n in names if n.startswith("dvel")}
    axes = {"KF-GINS": "time, increments forward, right, down",
            "PSINS": "increments right, front, up, time",
            "fixes": "time, latitude, longitude, height, deviations"}[form]  # fmt: skip
    said = f"columns without names taken as those of KF-GINS or PSINS: {axes}"
    return MemorySource(path, columns, units, None, (said,), "row", (said,))


FORMATS = (
    Format(
        "kf-gins",
        "text of KF-GINS or PSINS without names",
        (".txt", ".imu"),
        ("imu", "gnss"),
        detect=_is_one,
        open=open_increments,
    ),
)
