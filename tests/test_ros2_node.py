"""The example of a ROS 2 node, driven with the message classes of ROS but without ROS."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

import schuler
from schuler.rotations import dcm_from_rotation_vector
from schuler.simulation import RTK_FIXED

pytest.importorskip("rosbags")
from rosbags.typesys import Stores, get_typestore

TYPES: dict[str, Any] = get_typestore(Stores.ROS2_HUMBLE).types
PLACE = Path(__file__).resolve().parents[1] / "examples" / "ros2_node.py"


@pytest.fixture(scope="module")
def node() -> ModuleType:
    spec = importlib.util.spec_from_file_location("ros2_node", PLACE)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def message(name: str, **fields: Any) -> Any:
    return TYPES[name](**fields)


def header(time: float, frame: str = "imu_link") -> Any:
    whole = int(time)
    stamp = message("builtin_interfaces/msg/Time", sec=whole, nanosec=round((time - whole) * 1e9))
    return message("std_msgs/msg/Header", stamp=stamp, frame_id=frame)


def vector(values: np.ndarray) -> Any:
    return message("geometry_msgs/msg/Vector3", **dict(zip("xyz", map(float, values), strict=True)))


def imu_message(time: float, gyro: np.ndarray, accel: np.ndarray) -> Any:
    still = message("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
    return message(
        "sensor_msgs/msg/Imu", header=header(time), orientation=still,
        orientation_covariance=np.full(9, -1.0), angular_velocity=vector(gyro),
        angular_velocity_covariance=np.zeros(9), linear_acceleration=vector(accel),
        linear_acceleration_covariance=np.zeros(9),
    )  # fmt: skip


def fix_message(time: float, place: np.ndarray, sd: float) -> Any:
    status = message("sensor_msgs/msg/NavSatStatus", status=0, service=1)
    return message(
        "sensor_msgs/msg/NavSatFix", header=header(time), status=status,
        latitude=np.degrees(place[0]), longitude=np.degrees(place[1]), altitude=place[2],
        position_covariance=np.diag([4.0 * sd**2, sd**2, 9.0 * sd**2]).ravel(),
        position_covariance_type=2,
    )  # fmt: skip


def blank_odometry() -> Any:
    def pose() -> Any:
        point = message("geometry_msgs/msg/Point", x=0.0, y=0.0, z=0.0)
        turn = message("geometry_msgs/msg/Quaternion", x=0.0, y=0.0, z=0.0, w=1.0)
        return message("geometry_msgs/msg/Pose", position=point, orientation=turn)

    twist = message(
        "geometry_msgs/msg/Twist", linear=vector(np.zeros(3)), angular=vector(np.zeros(3))
    )
    return message(
        "nav_msgs/msg/Odometry", header=header(0.0), child_frame_id="",
        pose=message("geometry_msgs/msg/PoseWithCovariance", pose=pose(), covariance=np.zeros(36)),
        twist=message(
            "geometry_msgs/msg/TwistWithCovariance", twist=twist, covariance=np.zeros(36)
        ),
    )  # fmt: skip


def test_the_node_publishes_where_it_is_with_its_covariance(node: ModuleType) -> None:
    model = schuler.NoiseModel.isotropic(schuler.WhiteNoise(5e-5), schuler.WhiteNoise(7e-4))
    scenario = schuler.Scenario("car_urban", model, RTK_FIXED, duration=120.0)
    drive = schuler.simulate_drive(scenario, seed=3)
    imu, gnss, truth = drive.imus[0], drive.gnss, drive.truth
    navigator = node.Navigator(model, learning=90.0, time_offset=0.0, tune_noise=False)
    events = [(t, 0, k) for k, t in enumerate(gnss.time)]
    events += [(t, 1, k) for k, t in enumerate(imu.time)]
    for time, kind, k in sorted(events):
        if kind == 0:
            navigator.add_fix(fix_message(time, gnss.position[k], 0.02))
        else:
            navigator.add_imu(imu_message(time, imu.gyro[k], imu.accel[k]))
    assert navigator.filter is not None
    odometry = blank_odometry()
    navigator.fill(odometry)
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("map", "imu_link")
    stamp = odometry.header.stamp
    assert stamp.sec + 1e-9 * stamp.nanosec == pytest.approx(imu.time[-1], abs=1e-6)
    last = int(np.searchsorted(truth.time, imu.time[-1] - 1e-9).clip(max=truth.time.size - 1))
    north, east, down = schuler.ned_from_geodetic(truth.position[last], gnss.position[0])
    place = odometry.pose.pose.position
    assert [place.x, place.y, place.z] == pytest.approx([east, north, -down], abs=0.3)
    covariance = odometry.pose.covariance.reshape(6, 6)
    assert covariance == pytest.approx(covariance.T)
    assert (np.linalg.eigvalsh(covariance) > 0.0).all()
    # east of the fixes is twice as uncertain as north, up thrice
    assert 1.2 < np.sqrt(covariance[0, 0] / covariance[1, 1]) < 2.5
    velocity = odometry.twist.twist.linear
    speed = np.linalg.norm([velocity.x, velocity.y, velocity.z])
    assert speed == pytest.approx(np.linalg.norm(truth.velocity[last]), abs=0.3)


@pytest.mark.parametrize("turn", [(0.0, 0.0, 0.0), (0.3, -1.2, 2.0), (0.0, 0.0, np.pi - 1e-6)])
def test_quaternions_are_the_rotation(node: ModuleType, turn: tuple[float, ...]) -> None:
    rotation = dcm_from_rotation_vector(np.array(turn))
    x, y, z, w = node.quaternion(rotation)
    assert np.array([x, y, z, w]) @ (x, y, z, w) == pytest.approx(1.0)
    point = np.array([0.3, -0.7, 1.1])
    axis = np.array([x, y, z])
    turned = point + 2.0 * np.cross(axis, np.cross(axis, point) + w * point)
    assert turned == pytest.approx(rotation @ point)


def test_a_receiver_without_a_fix_is_not_used(node: ModuleType) -> None:
    navigator = node.Navigator(None)
    lost = fix_message(1.0, np.zeros(3), 1.0)
    lost.status.status = -1
    navigator.add_fix(lost)
    assert navigator._fixes == []
