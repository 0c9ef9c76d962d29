"""Trajectories of the odometry world: TUM, KITTI, EuRoC; east, north, up about the first place."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np

from schuler.io.format import Format, TrackColumns
from schuler.io.trajectories.frames import Poses, local_poses, velocity
from schuler.types import FloatArray

_EUROC = (
    "#timestamp [ns]", "p_RS_R_x [m]", "p_RS_R_y [m]", "p_RS_R_z [m]", "q_RS_w []", "q_RS_x []",
    "q_RS_y []", "q_RS_z []", "v_RS_R_x [m s^-1]", "v_RS_R_y [m s^-1]", "v_RS_R_z [m s^-1]",
    "b_w_RS_S_x [rad s^-1]", "b_w_RS_S_y [rad s^-1]", "b_w_RS_S_z [rad s^-1]",
    "b_a_RS_S_x [m s^-2]", "b_a_RS_S_y [m s^-2]", "b_a_RS_S_z [m s^-2]",
)  # fmt: skip


def _lines(path: Path, rows: Iterable[Sequence[str]], head: str = "") -> None:
    with path.open("w", encoding="utf-8", newline="\n") as stream:
        stream.write(head)
        for row in rows:
            stream.write(" ".join(row) + "\n")


def _said(poses: Poses) -> str:
    latitude, longitude, height = poses.origin
    return (
        "# x east, y north, z up; body forward, left, up; origin "
        f"latitude_deg {latitude:.10f} longitude_deg {longitude:.10f} height_m {height:.4f}\n"
    )


def write_tum(path: Path, track: TrackColumns) -> None:
    """Write time, position and quaternion (w last): eight fields, the origin in a comment."""
    poses = local_poses(track)
    rows = (
        (f"{t:.9f}", *(f"{x:.6f}" for x in p), *(f"{x:.9f}" for x in q))
        for t, p, q in zip(poses.time, poses.position, poses.quaternion, strict=True)
    )
    _lines(path, rows, "# timestamp tx ty tz qx qy qz qw\n" + _said(poses))


def write_kitti(path: Path, track: TrackColumns) -> None:
    """Write twelve numbers a line: rotation and position, row by row, without time."""
    poses = local_poses(track)
    table = np.concatenate([poses.rotation, poses.position[:, :, np.newaxis]], axis=2)
    _lines(path, ([f"{x:.9e}" for x in row] for row in table.reshape(-1, 12)))


def write_euroc(path: Path, track: TrackColumns) -> None:
    """Write the ground truth of EuRoC: stamps in ns, quaternion with w first, biases 0."""
    poses = local_poses(track)
    speed = velocity(track)[:, [1, 0, 2]] * (1.0, 1.0, -1.0)
    with path.open("w", encoding="utf-8", newline="\n") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(_EUROC)
        for t, p, q, v in zip(poses.time, poses.position, poses.quaternion, speed, strict=True):
            writer.writerow(
                [_nanoseconds(t), *_fixed(p, 6), f"{q[3]:.9f}", *_fixed(q[:3], 9), *_fixed(v, 6),
                 *("0" for _ in range(6))]
            )  # fmt: skip


def _nanoseconds(time: float) -> str:
    whole = int(np.floor(time))
    return str(whole * 10**9 + round((time - whole) * 1e9))


def _fixed(values: FloatArray, digits: int) -> list[str]:
    return [f"{x:.{digits}f}" for x in values]


def origin_json(track: TrackColumns) -> str:
    """Return the origin and the axes of a local form as JSON, to be kept beside it."""
    poses = local_poses(track)
    latitude, longitude, height = map(float, poses.origin)
    said = {
        "origin": {"latitude_deg": latitude, "longitude_deg": longitude, "height_m": height},
        "axes": "x east, y north, z up; body forward, left, up",
        "first_time_s": float(poses.time[0]),
        "last_time_s": float(poses.time[-1]),
    }
    return json.dumps(said, indent=2) + "\n"


FORMATS = (
    Format("tum", "TUM (evo)", (".tum",), write_trajectory=write_tum, beside=origin_json),
    Format("kitti", "KITTI poses", (".kitti",), write_trajectory=write_kitti,
           beside=origin_json),
    Format("euroc", "EuRoC ground truth", (".euroc",), write_trajectory=write_euroc,
           beside=origin_json),
)  # fmt: skip
