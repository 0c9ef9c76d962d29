"""MCAP bags of ROS 2, which Foxglove and PlotJuggler open: Odometry, Imu, NavSatFix."""

from __future__ import annotations

import shutil
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from schuler.io.format import TrackColumns, lacking
from schuler.io.trajectories.frames import local_poses, place, velocity
from schuler.output_file import workspace

if TYPE_CHECKING:
    from schuler.data import GnssRecording, ImuRecording

_Message = tuple[str, str, float, Any]


def _write(path: Path, messages: Iterable[_Message], types: Any) -> None:
    """Write a bag and keep the one file of it."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    bag = workspace(path)
    try:
        with Writer(bag, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
            connections: dict[str, Any] = {}
            for topic, kind, time, message in messages:
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=types)
                raw = types.serialize_cdr(message, kind)
                writer.write(connections[topic], round(max(time, 0.0) * 1e9), raw)
        shutil.copyfile(next(bag.glob("*.mcap")), path)
    finally:
        shutil.rmtree(bag, ignore_errors=True)


def _types(path: Path) -> Any:
    try:
        from rosbags.typesys import Stores, get_typestore
    except ImportError:
        raise lacking("rosbags", "ros", path) from None
    return get_typestore(Stores.ROS2_HUMBLE)


def _header(types: Any, time: float, frame: str) -> Any:
    seconds = int(np.floor(time))
    stamp = types.types["builtin_interfaces/msg/Time"](
        sec=seconds, nanosec=min(round((time - seconds) * 1e9), 999_999_999)
    )
    return types.types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame)


def write_trajectory(path: Path, track: TrackColumns) -> None:
    """Write Odometry (east, north, up; forward, left, up) and NavSatFix."""
    types = _types(path)
    poses, points, speed = local_poses(track), place(track), velocity(track)
    kinds = types.types
    vector, point = kinds["geometry_msgs/msg/Vector3"], kinds["geometry_msgs/msg/Point"]
    zero = np.zeros(poses.time.size)
    axes = ("east", "north", "down")
    sd = np.column_stack([track.get(f"pos_std_{a}_m", zero) for a in axes])
    enu = speed[:, [1, 0, 2]] * (1.0, 1.0, -1.0)
    body = np.einsum("nji,nj->ni", poses.rotation, enu)

    def messages() -> Iterable[_Message]:
        for k, time in enumerate(poses.time):
            covariance = np.zeros(36)
            covariance[[0, 7, 14]] = sd[k] ** 2
            pose = kinds["geometry_msgs/msg/Pose"](
                position=point(*map(float, poses.position[k])),
                orientation=kinds["geometry_msgs/msg/Quaternion"](*map(float, poses.quaternion[k])),
            )
            twist = kinds["geometry_msgs/msg/Twist"](
                linear=vector(*map(float, body[k])), angular=vector(0.0, 0.0, 0.0)
            )
            odometry = kinds["nav_msgs/msg/Odometry"](
                header=_header(types, time, "map"),
                child_frame_id="base_link",
                pose=kinds["geometry_msgs/msg/PoseWithCovariance"](pose, covariance),
                twist=kinds["geometry_msgs/msg/TwistWithCovariance"](twist, np.zeros(36)),
            )
            yield "/odometry", "nav_msgs/msg/Odometry", time, odometry
            at = (np.degrees(points[k, 0]), np.degrees(points[k, 1]), points[k, 2])
            yield "/fix", _FIX, time, _fix(types, time, at, sd[k])

    _write(path, messages(), types)


_FIX = "sensor_msgs/msg/NavSatFix"


def _fix(types: Any, time: float, at: tuple[float, float, float], sd: Any) -> Any:
    known = bool(np.isfinite(sd).all() and np.any(sd))
    covariance = np.diag(np.where(np.isfinite(sd), sd, 0.0) ** 2).ravel()
    return types.types[_FIX](
        header=_header(types, time, "base_link"),
        status=types.types["sensor_msgs/msg/NavSatStatus"](status=0, service=1),
        latitude=float(at[0]),
        longitude=float(at[1]),
        altitude=float(at[2]),
        position_covariance=covariance,
        position_covariance_type=2 if known else 0,
    )


def write_recording(path: Path, recording: ImuRecording | GnssRecording) -> None:
    """Write Imu or NavSatFix, in the axes of the recording."""
    from schuler.data import ImuRecording

    types = _types(path)
    kinds = types.types
    vector = kinds["geometry_msgs/msg/Vector3"]

    def imu_messages(imu: ImuRecording) -> Iterable[_Message]:
        unknown = np.array([-1.0, *np.zeros(8)])
        nothing = kinds["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
        for time, w, f in zip(imu.time, imu.gyro, imu.accel, strict=True):
            message = kinds["sensor_msgs/msg/Imu"](
                _header(types, time, "imu"), nothing, unknown,
                vector(*map(float, w)), np.zeros(9), vector(*map(float, f)), np.zeros(9),
            )  # fmt: skip
            yield "/imu/data", "sensor_msgs/msg/Imu", time, message

    def fix_messages(gnss: GnssRecording) -> Iterable[_Message]:
        sd = gnss.position_sd if gnss.position_sd is not None else np.full((gnss.size, 3), np.nan)
        for time, at, own in zip(gnss.time, gnss.position, sd, strict=True):
            degrees = (np.degrees(at[0]), np.degrees(at[1]), at[2])
            yield "/fix", _FIX, time, _fix(types, time, degrees, own[[1, 0, 2]])

    rows = imu_messages(recording) if isinstance(recording, ImuRecording) else fix_messages(
        recording
    )  # fmt: skip
    _write(path, rows, types)
