"""One IMU calibrated by hand: poses and turns against known errors, files, and refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from schuler.arrays.calibration.poses import STANDARD_GRAVITY
from schuler.arrays.calibration.single_imu import calibrate_imu, calibrate_magnetometer
from schuler.data import ImuRecording
from schuler.data.imu_calibration import ImuCalibration
from schuler.errors import EstimationError, InputError
from schuler.rotations import dcm_from_rotation_vector

RATE, REST, TURN = 100.0, 4.0, 2.0
ACCEL_BIAS = np.array([0.12, -0.2, 0.08])
GYRO_BIAS = np.radians([0.5, -0.3, 0.8])
ACCEL = np.eye(3) + np.array(
    [[0.012, 0.003, -0.004], [0.003, -0.008, 0.002], [-0.004, 0.002, 0.01]]
)
GYRO = np.eye(3) + np.array([[0.01, 0.002, 0.001], [-0.003, -0.012, 0.002], [0.002, 0.001, 0.008]])


def by_hand(poses: int = 18, seed: int = 1, felt: float = 0.0) -> ImuRecording:
    """Rests in random poses and smooth turns between them; what a flawed IMU shows of it."""
    rng = np.random.default_rng(seed)
    rest, turn = round(REST * RATE), round(TURN * RATE)
    ramp = np.pi / 2.0 * np.sin(np.pi * (np.arange(turn) + 0.5) / turn) / turn
    attitude, force, rate = np.eye(3), [], []
    up = np.array([0.0, 0.0, STANDARD_GRAVITY])
    for _ in range(poses):
        force.append(np.tile(attitude.T @ up, (rest, 1)))
        rate.append(np.zeros((rest, 3)))
        axis = rng.standard_normal(3)
        vector = axis / np.linalg.norm(axis) * rng.uniform(1.0, 2.5)
        for share in ramp:
            rate.append((share * RATE * vector)[None])
            half = attitude @ dcm_from_rotation_vector(0.5 * share * vector)
            force.append((half.T @ up)[None])
            attitude = attitude @ dcm_from_rotation_vector(share * vector)
    f, w = np.concatenate(force), np.concatenate(rate)
    g = np.radians(felt) / STANDARD_GRAVITY * np.array([[1, 0, 0], [0, -1, 0], [0, 0, 1.0]])
    accel = f @ np.linalg.inv(ACCEL).T + ACCEL_BIAS + 0.02 * rng.standard_normal(f.shape)
    gyro = w @ np.linalg.inv(GYRO).T + GYRO_BIAS + f @ g.T
    gyro += np.radians(0.1) * rng.standard_normal(gyro.shape)
    return ImuRecording(np.arange(f.shape[0]) / RATE, gyro, accel, name="hand")


def test_bias_scale_and_axes_are_found_by_hand_within_their_errors(tmp_path: Path) -> None:
    imu = by_hand()
    found = calibrate_imu(imu)
    assert found.poses == 18 and found.turns >= 15
    assert found.norm_before > 0.05 and found.norm_after < 0.01
    scores = [
        (found.accel_bias - ACCEL_BIAS) / found.accel_bias_sd,
        ((found.accel_matrix - ACCEL) / found.accel_matrix_sd)[np.triu_indices(3)],
        (found.gyro_bias - GYRO_BIAS) / found.gyro_bias_sd,
        ((found.gyro_matrix - GYRO) / found.gyro_matrix_sd).ravel(),
    ]
    for score in scores:
        assert np.sqrt(np.mean(score**2)) < 2.0 and np.abs(score).max() < 4.0
    found.save(tmp_path / "one.yaml")
    again = ImuCalibration.load(tmp_path / "one.yaml")
    applied = again.apply(imu)
    still = applied.gyro[:300]
    assert np.linalg.norm(still.mean(axis=0)) < np.radians(0.05)
    length = np.linalg.norm(applied.accel[50:300].mean(axis=0))
    assert length == pytest.approx(STANDARD_GRAVITY, abs=0.01)


def test_gyros_that_feel_the_force_are_told_and_cured() -> None:
    found = calibrate_imu(by_hand(felt=0.3, seed=2))
    told = np.degrees(np.diagonal(found.g_sensitivity)) * STANDARD_GRAVITY
    np.testing.assert_allclose(told, [0.3, -0.3, 0.3], atol=0.03)
    assert "feel the force" in found.findings[-1]
    np.testing.assert_allclose(found.gyro_bias, GYRO_BIAS, atol=np.radians(0.02))


def test_hard_and_soft_iron() -> None:
    rng = np.random.default_rng(3)
    direction = rng.standard_normal((400, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    iron = np.array([12.0, -7.0, 30.0])
    soft = np.eye(3) + 0.05 * np.array([[1.0, 0.3, 0.0], [0.3, -0.5, 0.2], [0.0, 0.2, -0.5]])
    readings = 48.0 * direction @ soft.T + iron + 0.3 * rng.standard_normal((400, 3))
    found = calibrate_magnetometer(readings, 48.0)
    np.testing.assert_allclose(found.bias, iron, atol=0.15)
    np.testing.assert_allclose(found.matrix, np.linalg.inv(soft), atol=0.005)


def test_too_few_poses_are_refused_with_the_cure() -> None:
    with pytest.raises(EstimationError, match="static poses that do not tell"):
        calibrate_imu(by_hand(poses=6))
    with pytest.raises(InputError, match="left-handed"):
        bad = calibrate_imu(by_hand()).to_dict()
        bad["accel_matrix"] = np.diag([1.0, 1.0, -1.0])
        names = ImuCalibration.__dataclass_fields__
        ImuCalibration(**{k: v for k, v in bad.items() if k in names})
