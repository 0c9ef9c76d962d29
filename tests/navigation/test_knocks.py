"""An IMU that is another one from some moment on: biases after a knock, axes after a slip."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import schuler
from schuler.navigation.preparation.knocks import moment_of_knock, squares_of
from schuler.navigation.preparation.prepare import prepare
from schuler.rotations import dcm_from_rotation_vector, rotation_vector_from_dcm
from schuler.simulation import DIFFERENTIAL_CODE

NOISE = schuler.NoiseModel.isotropic(schuler.WhiteNoise(8e-5), schuler.WhiteNoise(1e-3))
KNOCK = 160.0


@pytest.fixture(scope="module")
def drive() -> schuler.SimulatedDrive:
    scenario = schuler.Scenario("car_urban", NOISE, DIFFERENTIAL_CODE, duration=320.0)
    return schuler.simulate_drive(scenario, 821)


@pytest.mark.parametrize("what", ["biases", "axes"])
def test_the_filter_forgets_what_it_knew_of_an_imu_that_was_knocked(
    drive: schuler.SimulatedDrive, what: str
) -> None:
    imu = drive.imus[0]
    after = (imu.time > KNOCK)[:, None]
    turn = np.eye(3)
    if what == "biases":
        gyro = imu.gyro + np.where(after, np.radians([0.1, -0.2, 0.4]), 0.0)
        accel = imu.accel + np.where(after, [0.5, -0.3, 0.3], 0.0)
    else:
        turn = dcm_from_rotation_vector(np.radians([[-3.0, 5.0, 8.0]]))[0]
        gyro = np.where(after, imu.gyro @ turn, imu.gyro)
        accel = np.where(after, imu.accel @ turn, imu.accel)
    knocked = replace(imu, gyro=gyro, accel=accel)
    solution = schuler.navigate(knocked, drive.gnss, time_offset=0.0, smooth=True)
    (said,) = [f for f in solution.settings["findings"] if f["kind"] == "knock"]
    assert abs(said["intervals_s"][0][0] - KNOCK) < 8.0
    at = np.arange(KNOCK + 20.0, 300.0, 1.0)
    mine, real = (np.searchsorted(t, at) for t in (solution.trajectory.time, drive.truth.time))
    true = drive.truth.rotation[real] @ turn
    off = rotation_vector_from_dcm(solution.trajectory.rotation[mine] @ true.mT)
    # of a filter that goes on with what it knew: 20 to 1000
    assert np.mean(off**2 / solution.attitude_sd[mine] ** 2) < 5.0


def test_an_imu_that_was_not_is_left_alone(drive: schuler.SimulatedDrive) -> None:
    imu, setup = prepare(drive.imus[0], drive.gnss, time_offset=0.0)
    assert setup.condition.knocks == ()
    assert moment_of_knock(squares_of(imu, drive.gnss, setup), drive.gnss, setup) is None
