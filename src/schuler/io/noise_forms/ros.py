"""Noise models for ROS: Kalibr, allan_variance_ros, robot_localization, filters of ROS 2."""

from __future__ import annotations

import json

from schuler.io.format import Format, NoiseRequest
from schuler.io.kalibr import kalibr_yaml
from schuler.io.noise_forms.numbers import number, rate_of, sensor_numbers, source_line
from schuler.noise import NoiseModel


def kalibr(model: NoiseModel, request: NoiseRequest) -> str:
    """Return Kalibr's imu.yaml."""
    return kalibr_yaml(model, rate=request.rate, topic=request.topic)


def allan_variance_ros(model: NoiseModel, request: NoiseRequest) -> str:
    """Return imu.yaml as allan_variance_ros writes it: continuous densities, no zeros."""
    rate = rate_of(model, request)
    accel, gyro = sensor_numbers(model, "accel"), sensor_numbers(model, "gyro")
    lines = [
        source_line(model),
        "#Accelerometer",
        f"accelerometer_noise_density: {number(accel.density)}",
        f"accelerometer_random_walk: {number(accel.walk)}",
        "#Gyroscope",
        f"gyroscope_noise_density: {number(gyro.density)}",
        f"gyroscope_random_walk: {number(gyro.walk)}",
        f"rostopic: {json.dumps(request.topic)}",
        f"update_rate: {number(rate)}",
    ]
    return "\n".join(lines) + "\n"


def _variances(model: NoiseModel, request: NoiseRequest) -> tuple[float, float, float]:
    rate = rate_of(model, request)
    accel, gyro = sensor_numbers(model, "accel"), sensor_numbers(model, "gyro")
    return rate, gyro.density**2 * rate, accel.density**2 * rate


def robot_localization(model: NoiseModel, request: NoiseRequest) -> str:
    """Return the IMU of an ekf_node, and the covariances its messages should carry.

    robot_localization weighs an IMU by the covariance in its messages; these are the variances
    of one sample, N^2 times the rate.
    """
    rate, gyro, accel = _variances(model, request)
    flags = (
        "[false, false, false, false, false, false, false, false, false, true, true, true, "
        "true, true, true]"
    )
    lines = [
        source_line(model),
        f"# Variances of one sample at {rate:g} Hz (density squared times rate); write them into",
        "# the covariances of sensor_msgs/Imu, diagonal, as robot_localization reads them there.",
        "ekf_filter_node:",
        "  ros__parameters:",
        f"    imu0: {json.dumps(request.topic)}",
        f"    imu0_config: {flags}",
        "    imu0_remove_gravitational_acceleration: true",
        "imu_covariances:",
        f"  angular_velocity_variance: {number(gyro)}  # rad^2/s^2",
        f"  linear_acceleration_variance: {number(accel)}  # m^2/s^4",
    ]
    return "\n".join(lines) + "\n"


def ros2_imu(model: NoiseModel, request: NoiseRequest) -> str:
    """Return parameters of imu_filter_madgwick and of drivers that take standard deviations."""
    rate, gyro, accel = _variances(model, request)
    lines = [
        source_line(model),
        f"# Standard deviations of one sample at {rate:g} Hz.",
        "imu_filter:",
        "  ros__parameters:",
        "    use_mag: false",
        "    world_frame: enu",
        f"    orientation_stddev: {number(max(gyro**0.5 / rate**0.5, 1e-6))}",
        "imu_driver:",
        "  ros__parameters:",
        f"    angular_velocity_stdev: {number(gyro**0.5)}  # rad/s",
        f"    linear_acceleration_stdev: {number(accel**0.5)}  # m/s^2",
    ]
    return "\n".join(lines) + "\n"


FORMATS = (
    Format("kalibr", "Kalibr imu.yaml", write_noise=kalibr),
    Format("allan-variance-ros", "allan_variance_ros imu.yaml", write_noise=allan_variance_ros),
    Format("robot-localization", "robot_localization", write_noise=robot_localization),
    Format("ros2-imu", "imu_filter and drivers of ROS 2", write_noise=ros2_imu),
)
