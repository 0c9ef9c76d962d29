"""Noise models for SLAM and smoothing: OpenVINS, VINS-Fusion, GTSAM."""

from __future__ import annotations

import json
import math

from schuler.io.format import Format, NoiseRequest
from schuler.io.noise_forms.numbers import number, rate_of, sensor_numbers, source_line
from schuler.noise import NoiseModel
from schuler.unit_grammar import STANDARD_GRAVITY

_EYE = ("[ 1.0, 0.0, 0.0 ]", "[ 0.0, 1.0, 0.0 ]", "[ 0.0, 0.0, 1.0 ]")


def openvins(model: NoiseModel, request: NoiseRequest) -> str:
    """Return kalibr_imu_chain.yaml of OpenVINS: continuous densities; extrinsics are unit."""
    rate = rate_of(model, request)
    accel, gyro = sensor_numbers(model, "accel"), sensor_numbers(model, "gyro")
    lines = [
        "%YAML:1.0",
        source_line(model),
        "imu0:",
        "  T_i_b:",
        "    - [1.0, 0.0, 0.0, 0.0]",
        "    - [0.0, 1.0, 0.0, 0.0]",
        "    - [0.0, 0.0, 1.0, 0.0]",
        "    - [0.0, 0.0, 0.0, 1.0]",
        f"  accelerometer_noise_density: {number(accel.density)}  # m/s^2/sqrt(Hz)",
        f"  accelerometer_random_walk: {number(accel.walk)}  # m/s^3/sqrt(Hz)",
        f"  gyroscope_noise_density: {number(gyro.density)}  # rad/s/sqrt(Hz)",
        f"  gyroscope_random_walk: {number(gyro.walk)}  # rad/s^2/sqrt(Hz)",
        f"  rostopic: {json.dumps(request.topic)}",
        "  time_offset: 0.0",
        f"  update_rate: {number(rate)}",
        '  model: "kalibr"',
    ]
    for name in ("Tw", "R_IMUtoGYRO", "Ta", "R_IMUtoACC"):
        lines += [f"  {name}:", *(f"    - {row}" for row in _EYE)]
    lines += ["  Tg:", *("    - [ 0.0, 0.0, 0.0 ]" for _ in range(3))]
    return "\n".join(lines) + "\n"


def vins_fusion(model: NoiseModel, request: NoiseRequest) -> str:
    """Return the noise of VINS-Fusion, which are no densities but deviations of one sample."""
    rate = rate_of(model, request)
    accel, gyro = sensor_numbers(model, "accel"), sensor_numbers(model, "gyro")
    root = math.sqrt(rate)
    lines = [
        "%YAML:1.0",
        source_line(model),
        "# VINS-Fusion never divides by the time step: these are N*sqrt(rate) and K*sqrt(rate)",
        f"# at {rate:g} Hz. Its midpoint rule halves the variance of white noise; for the exact",
        "# one multiply acc_n and gyr_n by sqrt(2).",
        f"acc_n: {number(accel.density * root)}",
        f"gyr_n: {number(gyro.density * root)}",
        f"acc_w: {number(accel.walk * root)}",
        f"gyr_w: {number(gyro.walk * root)}",
        f"g_norm: {STANDARD_GRAVITY}",
    ]
    return "\n".join(lines) + "\n"


def gtsam(model: NoiseModel, request: NoiseRequest) -> str:
    """Return Python that makes PreintegrationCombinedParams: continuous covariances."""
    accel, gyro = sensor_numbers(model, "accel"), sensor_numbers(model, "gyro")
    lines = [
        source_line(model),
        "# Continuous-time covariances: densities squared. z up; MakeSharedD for z down.",
        "import gtsam",
        "import numpy as np",
        "",
        f"params = gtsam.PreintegrationCombinedParams.MakeSharedU({STANDARD_GRAVITY})",
        f"params.setAccelerometerCovariance({number(accel.density**2)} * np.eye(3))"
        "  # (m/s^2)^2/Hz",
        f"params.setGyroscopeCovariance({number(gyro.density**2)} * np.eye(3))  # (rad/s)^2/Hz",
        "params.setIntegrationCovariance(1e-8 * np.eye(3))",
        f"params.setBiasAccCovariance({number(accel.walk**2)} * np.eye(3))  # (m/s^3)^2/Hz",
        f"params.setBiasOmegaCovariance({number(gyro.walk**2)} * np.eye(3))  # (rad/s^2)^2/Hz",
        "params.setBiasAccOmegaInit(1e-5 * np.eye(6))",
    ]
    return "\n".join(lines) + "\n"


FORMATS = (
    Format("openvins", "OpenVINS kalibr_imu_chain.yaml", write_noise=openvins),
    Format("vins-fusion", "VINS-Fusion", write_noise=vins_fusion),
    Format("gtsam", "GTSAM (Python)", write_noise=gtsam),
)
