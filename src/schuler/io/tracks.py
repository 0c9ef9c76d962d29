"""One door for trajectories: those of this program, of receivers, of the odometry world."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from schuler.data.gnss import GnssRecording
from schuler.data.track import Track
from schuler.data.trajectory import DIRECTIONS
from schuler.earth import geodetic_from_ned
from schuler.errors import InputError
from schuler.io.format import Start
from schuler.io.formats.sbet import WIDTH
from schuler.io.read import read_gnss
from schuler.io.registry import format_of
from schuler.io.source import existing_file
from schuler.rotations import FRD_FROM_FLU, NED_FROM_ENU, dcm_from_euler, orthonormalize
from schuler.types import FloatArray

OURS = {"time_s", "latitude_deg", "longitude_deg", "height_m", "roll_deg"}
_NAV = 11
"""Numbers of a line of KF-GINS: week, seconds, position, velocity, attitude."""


def read_track(path: str | Path, **how: Any) -> Track:
    """Read a trajectory: the result of any program that estimates where something was.

    Parameters
    ----------
    path : str or Path
        Trajectory of `schuler navigate --out` or `schuler convert`, TUM (evo), ground truth of
        EuRoC, SBET, the .nav of KF-GINS, or all that `read_gnss` reads, such as RTKLIB .pos, NMEA
        and text with named columns.
    **how
        As in `read_gnss`, for the files that it reads.

    Returns
    -------
    Track
        TUM and EuRoC are in local axes, east, north, up, unless the file names its origin.

    Raises
    ------
    InputError
        No such file, none of a trajectory, or one without time.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from schuler import read_track
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "odometry.tum"
    ...     _ = path.write_text("0.0 0 0 0 0 0 0 1" + chr(10) + "0.1 1 2 3 0 0 0 1" + chr(10))
    ...     print(read_track(path).position[-1])
    [ 2.  1. -3.]
    """
    file = Path(path)
    if not file.is_dir():
        existing_file(file)
    columns = trajectory_columns(file)
    if columns is not None:
        return _named(file, columns)
    start = Start(file)
    rows = None if file.is_dir() else _numbers(start)
    if rows is not None:
        width = rows.shape[1]
        if width == 8 and np.allclose(np.linalg.norm(rows[:, 4:], axis=1), 1.0, atol=1e-2):
            return _tum(file, start)
        if width == _NAV and (np.abs(rows[:, 2]) <= 90.0).all() and np.ptp(rows[:, 0]) <= 1.0:
            return _nav(file)
        if width == 12:
            raise InputError(
                "the poses of KITTI hold no time",
                expected="a trajectory with time",
                cure="write it as TUM: `evo_traj kitti --save_as_tum`",
                where=str(file),
            )
    if start.lines and "p_RS_R_x" in start.lines[0]:
        return _euroc(file)
    fixes = read_gnss(file, **how)
    turned = _sbet_attitude(file, fixes) if format_of(file).name == "sbet" else None
    sd = fixes.position_sd
    known = sd is not None and bool(np.isfinite(sd).all())
    return Track(
        fixes.time, fixes.position, _whole(fixes), turned, sd if known else None,
        name=file.name, history=fixes.assumptions,
    )  # fmt: skip


def trajectory_columns(file: Path) -> dict[str, FloatArray] | None:
    """Return the columns of a trajectory of ours; None when the file is something else."""
    import polars

    from schuler.io.tables.parquet_file import parquet_frame, parquet_schema

    try:
        if file.suffix.lower() == ".parquet":
            if set(parquet_schema(file)[0]) >= OURS:
                return _arrays(parquet_frame(file))
        elif file.suffix.lower() == ".csv":
            with file.open(encoding="utf-8", errors="replace") as stream:
                head = set(stream.readline().strip().split(","))
            if head >= OURS:
                return _arrays(polars.read_csv(file.read_bytes()))
    except (polars.exceptions.PolarsError, OSError, InputError):
        return None  # the reader of recordings says what is wrong
    return None


def _arrays(frame: Any) -> dict[str, FloatArray]:
    return {name: frame[name].to_numpy() for name in frame.columns}


def _named(file: Path, columns: Mapping[str, FloatArray]) -> Track:
    def three(pattern: str) -> FloatArray | None:
        names = [pattern.format(d) for d in DIRECTIONS]
        there = all(n in columns for n in names)
        return np.column_stack([columns[n] for n in names]) if there else None

    latitude, longitude = (np.radians(columns[f"{n}_deg"]) for n in ("latitude", "longitude"))
    angles = ["roll_deg", "pitch_deg", "heading_deg" if "heading_deg" in columns else "yaw_deg"]
    turned = all(name in columns for name in angles)
    speed = three("vel_{}_m_s")
    return Track(
        columns["time_s"],
        np.column_stack([latitude, longitude, columns["height_m"]]),
        three("velocity_{}_m_s") if speed is None else speed,
        dcm_from_euler(*(np.radians(columns[name]) for name in angles)) if turned else None,
        three("pos_std_{}_m"),
        name=file.name,
    )


def _numbers(start: Start) -> FloatArray | None:
    """Return the first lines of a file that holds nothing but numbers, else None."""
    lines = [x for x in start.lines[:-1] if x.strip() and not x.startswith(("#", "%"))][:200]
    lines = lines or [x for x in start.lines if x.strip() and not x.startswith(("#", "%"))]
    try:
        rows = np.array([[float(f) for f in x.replace(",", " ").split()] for x in lines])
    except ValueError:
        return None
    return rows if rows.ndim == 2 and rows.size else None


def _table(file: Path) -> FloatArray:
    text = file.read_text(encoding="utf-8", errors="replace").replace(",", " ")
    lines = [x for x in text.splitlines() if x.strip() and not x.startswith(("#", "%"))]
    width = len(lines[0].split())
    for k, line in enumerate(lines):
        if len(line.split()) != width:
            raise InputError(
                f"row {k} has {len(line.split())} numbers",
                expected=f"{width}, as in the first row",
                where=str(file),
            )
    try:
        return np.array([[float(f) for f in x.split()] for x in lines])
    except ValueError as error:
        raise InputError(f"a row holds no numbers ({error})", where=str(file)) from None


def _tum(file: Path, start: Start) -> Track:
    """Time, position, quaternion with w last; our own files name their origin in a comment."""
    rows = _table(file)
    rotation = NED_FROM_ENU @ _dcm(np.roll(rows[:, 4:], 1, axis=1)) @ FRD_FROM_FLU
    ned = rows[:, 1:4] @ NED_FROM_ENU
    head = "\n".join(x for x in start.lines[:5] if x.startswith("#"))
    found = re.search(r"latitude_deg (\S+) longitude_deg (\S+) height_m (\S+)", head)
    if found is None:
        said = ("axes taken as x east, y north, z up; body forward, left, up",)
        return Track(rows[:, 0], ned, None, rotation, None, True, file.name, said)
    origin = np.array([np.radians(float(found[1])), np.radians(float(found[2])), float(found[3])])
    return Track(rows[:, 0], geodetic_from_ned(ned, origin), None, rotation, name=file.name)


def _euroc(file: Path) -> Track:
    """Ground truth of EuRoC: stamps in ns, position, quaternion with w first, velocity."""
    rows = _table(file)
    said = ("axes taken as x east, y north, z up; body forward, left, up",)
    return Track(
        rows[:, 0] * 1e-9, rows[:, 1:4] @ NED_FROM_ENU, rows[:, 8:11] @ NED_FROM_ENU,
        NED_FROM_ENU @ _dcm(rows[:, 4:8]) @ FRD_FROM_FLU, None, True, file.name, said,
    )  # fmt: skip


def _nav(file: Path) -> Track:
    """Result of KF-GINS; time counts in the GPS week of its first row."""
    rows = _table(file)
    time = (rows[:, 0] - rows[0, 0]) * 604800.0 + rows[:, 1]
    place = np.column_stack([np.radians(rows[:, 2:4]), rows[:, 4]])
    turned = dcm_from_euler(*np.radians(rows[:, 8:11]).T)
    return Track(time, place, rows[:, 5:8], turned, name=file.name)


def _dcm(wxyz: FloatArray) -> FloatArray:
    w, x, y, z = (wxyz / np.linalg.norm(wxyz, axis=1, keepdims=True)).T
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )
    return orthonormalize(np.stack([np.stack(row, axis=-1) for row in rows], axis=-2))


def _whole(fixes: GnssRecording) -> FloatArray | None:
    """Return velocities where all three components were measured."""
    if fixes.velocity is None or fixes.velocity_sd is None:
        return fixes.velocity
    return fixes.velocity if not np.isinf(fixes.velocity_sd).any() else None


def _sbet_attitude(file: Path, fixes: GnssRecording) -> FloatArray | None:
    table = np.fromfile(file, dtype="<f8").reshape(-1, WIDTH)
    if len(table) != fixes.size:
        return None
    return dcm_from_euler(table[:, 7], table[:, 8], table[:, 9] - table[:, 10])
