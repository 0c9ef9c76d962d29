"""Trajectories in the frames and clocks of other programs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schuler.earth import ned_from_geodetic
from schuler.io.format import TrackColumns
from schuler.rotations import dcm_from_euler, quaternion_from_dcm
from schuler.types import FloatArray

GPS_EPOCH = 315964800.0
"""Unix time of the beginning of GPS time."""
LEAP_SECONDS = 18.0
"""GPS time minus UTC since 2017."""
_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
_FLU = np.diag([1.0, -1.0, -1.0])


@dataclass(frozen=True, slots=True, eq=False)
class Poses:
    """A trajectory about an origin: x east, y north, z up; body forward, left, up (REP-103)."""

    time: FloatArray  # (n,): seconds
    position: FloatArray  # (n, 3): metres from the origin
    rotation: FloatArray  # (n, 3, 3): from body to east, north, up
    quaternion: FloatArray  # (n, 4): the same as x, y, z, w
    origin: FloatArray  # (3,): latitude deg, longitude deg, height m of the first position


def place(track: TrackColumns) -> FloatArray:
    """Return latitude rad, longitude rad, height m."""
    return np.column_stack(
        [np.radians(track["latitude_deg"]), np.radians(track["longitude_deg"]), track["height_m"]]
    )


def velocity(track: TrackColumns) -> FloatArray:
    """Return north, east, down; zeros where the trajectory holds none."""
    zero = np.zeros(track["time_s"].size)
    return np.column_stack([track.get(f"vel_{a}_m_s", zero) for a in ("north", "east", "down")])


def attitude(track: TrackColumns) -> FloatArray:
    """Return roll, pitch, heading in radians; zeros where the trajectory holds none."""
    zero = np.zeros(track["time_s"].size)
    names = ("roll", "pitch", "heading")
    return np.column_stack([np.radians(track.get(f"{a}_deg", zero)) for a in names])


def local_poses(track: TrackColumns) -> Poses:
    """Return the trajectory about its first position."""
    points = place(track)
    ned = np.asarray(ned_from_geodetic(points, points[0]))
    rotation = _ENU @ dcm_from_euler(*attitude(track).T) @ _FLU
    wxyz = quaternion_from_dcm(rotation)
    origin = np.array([*np.degrees(points[0, :2]), points[0, 2]])
    return Poses(
        np.asarray(track["time_s"]), ned @ _ENU.T, rotation, np.roll(wxyz, -1, axis=1), origin
    )


def gps_week_and_seconds(time: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return GPS week and seconds of it: from Unix time, or week 0 where time counts in a week."""
    unix = float(time[0]) > 1e9 if time.size else False
    total = time - GPS_EPOCH + LEAP_SECONDS if unix else np.asarray(time)
    week = np.floor(total / 604800.0) if unix else np.zeros(time.size)
    return week, total - week * 604800.0


def utc(time: FloatArray) -> FloatArray:
    """Return Unix time: what counts in a GPS week is put into the week of the GPS epoch."""
    unix = float(time[0]) > 1e9 if time.size else False
    return np.asarray(time if unix else time + GPS_EPOCH)


def thinned(track: TrackColumns, rate: float) -> TrackColumns:
    """Return about so many rows a second, for forms that people look at."""
    time = track["time_s"]
    if time.size < 3:
        return track
    step = float(np.median(np.diff(time)))
    every = max(1, round(1.0 / (rate * step)))
    return {n: c[::every] for n, c in track.items()}
