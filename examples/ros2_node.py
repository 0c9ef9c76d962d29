"""A ROS 2 node: Imu and NavSatFix in, Odometry with its covariance out.

Run it in a sourced ROS 2 environment: `python examples/ros2_node.py --noise noise.yaml`. It listens
to `imu` and `fix` and publishes `odometry` in the frame `map` (east, north, up from the first fix);
`child_frame_id` is that of the IMU, in whose own axes the twist is given.

The first seconds are kept to align the IMU and to find time offsets; begin standing still, then
drive. `Navigator` knows nothing of ROS but the fields of the messages.
"""

from __future__ import annotations

import argparse
from typing import Any

import numpy as np

import schuler

ENU_FROM_NED = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
NO_FIX, UNKNOWN = -1, 0
"""Of NavSatStatus and of position_covariance_type."""


def seconds(message: Any) -> float:
    """Return the time stamp of a message."""
    stamp = message.header.stamp
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def vector(one: Any) -> list[float]:
    """Return a Vector3."""
    return [one.x, one.y, one.z]


class Navigator:
    """The filter behind the node.

    Parameters
    ----------
    noise : NoiseModel or None
        Of the IMU; None: told by the first seconds, more coarsely.
    learning : float
        Seconds that are kept before the filter starts.
    position_sd : float
        Of fixes that do not tell theirs, m.
    **options
        Of `schuler.prepare`, such as ``lever_arm=(0.2, 0.0, 1.1)``.
    """

    def __init__(
        self,
        noise: schuler.NoiseModel | None,
        *,
        learning: float = 60.0,
        position_sd: float = 5.0,
        **options: Any,
    ) -> None:
        self.noise, self.learning, self.position_sd = noise, learning, position_sd
        self.options = options
        self.filter: schuler.NavigationFilter | None = None
        self.origin: np.ndarray | None = None
        self.frame = ""
        self._samples: list[tuple[float, list[float], list[float]]] = []
        self._fixes: list[tuple[float, list[float], np.ndarray]] = []

    def add_imu(self, message: Any) -> bool:
        """Take a sensor_msgs/Imu; tell whether there is a state to publish."""
        time, gyro = seconds(message), vector(message.angular_velocity)
        accel = vector(message.linear_acceleration)
        self.frame = message.header.frame_id
        if self.filter is not None:
            self.filter.add_imu(time, gyro, accel)
            return True
        if not self._samples or time > self._samples[-1][0]:
            self._samples.append((time, gyro, accel))
        if time - self._samples[0][0] >= self.learning and len(self._fixes) > 1:
            self._start()
        return self.filter is not None

    def add_fix(self, message: Any) -> None:
        """Take a sensor_msgs/NavSatFix."""
        if message.status.status == NO_FIX:
            return
        place = [np.radians(message.latitude), np.radians(message.longitude), message.altitude]
        sd = np.full(3, self.position_sd)
        if message.position_covariance_type != UNKNOWN:  # of east, north, up
            sd = np.sqrt(np.asarray(message.position_covariance, dtype=np.float64)[[4, 0, 8]])
        fix = (seconds(message), place, sd)
        if self.filter is not None:
            self.filter.add_gnss(*fix)
        elif not self._fixes or fix[0] > self._fixes[-1][0]:
            self._fixes.append(fix)

    def _start(self) -> None:
        """Align, and take what was kept."""
        imu = schuler.ImuRecording(*map(np.array, zip(*self._samples, strict=True)))
        gnss = schuler.GnssRecording(*map(np.array, zip(*self._fixes, strict=True)))
        try:
            ready, setup = schuler.prepare(imu, gnss, self.noise, **self.options)
        except schuler.SchulerError as error:
            print(f"not started yet: {error}")
            self.learning += 10.0
            return
        self.origin = gnss.position[0]
        self.filter = schuler.NavigationFilter.from_setup(setup, ready, gnss)
        for fix in self._fixes:
            self.filter.add_gnss(*fix)
        for sample in zip(ready.time, ready.gyro, ready.accel, strict=True):
            self.filter.add_imu(*sample)
        self._samples, self._fixes = [], []

    def fill(self, odometry: Any) -> None:
        """Write the state into a nav_msgs/Odometry."""
        assert self.filter is not None and self.origin is not None
        state = self.filter.state()
        whole = int(np.floor(state.time))
        odometry.header.stamp.sec = whole
        odometry.header.stamp.nanosec = int((state.time - whole) * 1e9)
        odometry.header.frame_id, odometry.child_frame_id = "map", self.frame
        pose, twist = odometry.pose.pose, odometry.twist.twist
        place = ENU_FROM_NED @ schuler.ned_from_geodetic(state.position, self.origin)
        for name, value in zip("xyz", place, strict=True):
            setattr(pose.position, name, float(value))
        for name, value in zip("xyzw", quaternion(ENU_FROM_NED @ state.rotation), strict=True):
            setattr(pose.orientation, name, float(value))
        for name, value in zip("xyz", state.rotation.T @ state.velocity, strict=True):
            setattr(twist.linear, name, float(value))
        # position and attitude in the map, velocity in the axes of the IMU; rates are not estimated
        turn = np.zeros((6, 9))
        turn[:3, :3] = turn[3:, 6:] = ENU_FROM_NED
        odometry.pose.covariance = (turn @ state.covariance[:9, :9] @ turn.T).ravel()
        velocity = np.zeros((6, 6))
        velocity[:3, :3] = state.rotation.T @ state.covariance[3:6, 3:6] @ state.rotation
        velocity[3:, 3:] = -np.eye(3)
        odometry.twist.covariance = velocity.ravel()


def quaternion(rotation: np.ndarray) -> np.ndarray:
    """Return x, y, z, w of a rotation."""
    vector = schuler.rotation_vector_from_dcm(rotation)
    angle = float(np.linalg.norm(vector))
    return np.append(0.5 * np.sinc(0.5 * angle / np.pi) * vector, np.cos(0.5 * angle))


def main() -> None:
    """Run the node until it is stopped."""
    import rclpy
    from nav_msgs.msg import Odometry
    from rclpy.qos import qos_profile_sensor_data
    from sensor_msgs.msg import Imu, NavSatFix

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--noise", help="noise model of schuler characterize --noise-out")
    parser.add_argument("--learning", type=float, default=60.0, help="seconds before the start")
    given, rest = parser.parse_known_args()
    noise = schuler.NoiseModel.load(given.noise) if given.noise else None
    navigator = Navigator(noise, learning=given.learning)
    rclpy.init(args=rest)
    node = rclpy.create_node("schuler")
    publisher = node.create_publisher(Odometry, "odometry", 10)

    def on_imu(message: Imu) -> None:
        if navigator.add_imu(message):
            odometry = Odometry()
            navigator.fill(odometry)
            publisher.publish(odometry)

    node.create_subscription(Imu, "imu", on_imu, qos_profile_sensor_data)
    node.create_subscription(NavSatFix, "fix", navigator.add_fix, qos_profile_sensor_data)
    rclpy.spin(node)


if __name__ == "__main__":
    main()
