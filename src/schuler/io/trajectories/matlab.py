"""Trajectories as a struct for MATLAB, with the fields of NaveGo."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from schuler.io.format import TrackColumns
from schuler.io.trajectories.frames import attitude, place, velocity

if TYPE_CHECKING:
    from schuler.data import GnssRecording, ImuRecording


def write_mat(path: Path, track: TrackColumns) -> None:
    """Write a struct `nav` in SI and radians."""
    points, speed, angles = place(track), velocity(track), attitude(track)
    nav = {"t": np.asarray(track["time_s"]).reshape(-1, 1), "vel": speed}
    names = (("lat", points[:, 0]), ("lon", points[:, 1]), ("h", points[:, 2]),
             ("roll", angles[:, 0]), ("pitch", angles[:, 1]), ("yaw", angles[:, 2]))  # fmt: skip
    nav |= {n: v.reshape(-1, 1) for n, v in names}
    for stem, key in (("pos_std", "stdm"), ("vel_std", "stdv")):
        unit = "m" if stem == "pos_std" else "m_s"
        columns = [track.get(f"{stem}_{a}_{unit}") for a in ("north", "east", "down")]
        if all(c is not None for c in columns):
            nav[key] = np.column_stack([np.asarray(c) for c in columns])
    _save(path, {"nav": nav})


def write_recording(path: Path, recording: ImuRecording | GnssRecording) -> None:
    """Write a struct `imu` or `gnss` as NaveGo reads it."""
    from schuler.data import ImuRecording

    stamps = recording.time.reshape(-1, 1)
    if isinstance(recording, ImuRecording):
        imu = {"t": stamps, "wb": recording.gyro, "fb": recording.accel, "freq": recording.rate}
        _save(path, {"imu": imu})
        return
    gnss = {"t": stamps, "lat": recording.position[:, :1], "lon": recording.position[:, 1:2],
            "h": recording.position[:, 2:]}  # fmt: skip
    more = {"vel": recording.velocity, "stdm": recording.position_sd, "stdv": recording.velocity_sd}
    gnss |= {key: values for key, values in more.items() if values is not None}
    _save(path, {"gnss": gnss})


def _save(path: Path, content: Mapping[str, Mapping[str, object]]) -> None:
    from scipy.io import savemat

    with path.open("wb") as stream:
        savemat(stream, dict(content))  # type: ignore[arg-type]  # a stream is taken
