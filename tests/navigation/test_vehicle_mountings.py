"""The IMU may sit in the vehicle in any way: on its head, across, on end. None of it is given."""

from __future__ import annotations

import numpy as np
import pytest
from twins import LEVER, perfect, with_noise
from vehicle_twins import NOISE, mounted

from schuler.navigation.preparation.prepare import prepare
from schuler.navigation.run import run
from schuler.rotations import dcm_from_euler, dcm_from_rotation_vector, rotation_vector_from_dcm
from schuler.simulation import car_urban, simulate_gnss


@pytest.mark.parametrize(
    ("angles", "arm"),
    [((180.0, -30.0, 90.0), (2.5, -0.6, -0.8)), ((0.0, 90.0, 0.0), (-1.0, 0.5, -0.3))],
    ids=["on its head and across", "on end"],
)
def test_any_mounting_and_axle_are_found(
    angles: tuple[float, float, float], arm: tuple[float, float, float]
) -> None:
    truth = dcm_from_euler(*np.radians(angles))
    profile = mounted(car_urban(300.0, 5, standstill=20.0), np.array(arm), truth)
    imu, _ = with_noise(perfect(profile, 50.0), NOISE, np.random.default_rng(1))
    gnss = simulate_gnss(
        profile,
        1.0,
        position_sd=0.1,
        velocity_sd=0.03,
        lever_arm=LEVER,
        rng=np.random.default_rng(2),
        start=1.0,
    )
    cut, setup = prepare(imu, gnss, NOISE, lever_arm=LEVER, aiding=("nhc", "zupt"), time_offset=0.0)
    assert setup.vehicle is not None
    done = run(cut, gnss, setup).causal
    at = done.sensor_error_names.index("mounting roll")
    state, sd = done.sensor_errors[-1, at : at + 4], done.sensor_errors_sd[-1, at : at + 4]
    found = dcm_from_rotation_vector(state[:3]) @ setup.vehicle.mounting
    off = rotation_vector_from_dcm(found @ truth.T)
    assert np.all(np.abs(off) < 4.0 * sd[:3])
    # frozen: 0.21 deg at most in pitch and yaw, 0.10 m in the axle (1.9 sd)
    assert np.all(np.degrees(np.abs(off[1:])) < 0.5)
    assert abs(state[3] + arm[0]) < 0.3
