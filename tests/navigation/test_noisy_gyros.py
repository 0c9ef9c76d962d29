"""Gyros whose bias wanders a lot are no slip of axes or units."""

from __future__ import annotations

import numpy as np
import pytest

from schuler import navigate
from schuler.errors import NavigationError
from schuler.navigation.error_models.sensor_error_model import sensor_error_model
from schuler.navigation.preparation.moving_start import inflated_model
from schuler.noise import GaussMarkov, NoiseModel, RandomWalk, WhiteNoise
from schuler_papers.waegli2008.rides import Ride


def test_a_straight_ride_with_poor_gyros_is_not_refused_but_one_in_degrees_is() -> None:
    """The ride hardly turns: beside gyros that wander by a deg/s, none at all would fit better."""
    ride = Ride("motorcycle", 17, (1.0, 1.0, 1.0, 1.0))
    imu, gnss = ride.array.in_body().imu(1), ride.gnss("L1/L2")
    navigate(imu, gnss, heading=ride.heading, tune_noise=False)
    turning = Ride("motorcycle", 20, (1.0, 1.0, 1.0, 1.0))
    imu, gnss = turning.array.in_body().imu(1), turning.gnss("L1/L2")
    degrees = type(imu)(imu.time, np.degrees(imu.gyro), imu.accel, imu.name)
    with pytest.raises(NavigationError, match="gyros are in deg/s"):
        navigate(degrees, gnss, heading=turning.heading, tune_noise=False)


def test_a_trial_forgives_what_the_noise_model_knows() -> None:
    gyro = WhiteNoise(4e-3) + GaussMarkov(0.02, 3000.0)
    known = sensor_error_model(
        NoiseModel.isotropic(gyro, WhiteNoise(1e-4) + RandomWalk(1e-6)),
        turn_on_accel=0.1,
        turn_on_gyro=0.01,
    )
    plain, model = inflated_model(), inflated_model(known)
    place = model.constant_states(4)[0]
    assert model.white_density[3:] == pytest.approx([4e-3] * 3)
    assert model.diffusion[place, 0] == pytest.approx(0.02**2 * 2.0 / 3000.0)
    accel = model.constant_states(0)[0]
    assert model.white_density[0] == plain.white_density[0]
    assert model.diffusion[accel, 0] == plain.diffusion[accel, 0]
