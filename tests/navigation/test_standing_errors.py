"""Positions that wander while a vehicle stands set a least size of errors that last."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import schuler
from schuler.earth import metres_per_radian
from schuler.navigation.tuning.gnss_errors import Wander, wander_at_stands
from schuler.simulation import car_urban, ideal_imu, simulate_imu
from schuler.simulation.receivers import DIFFERENTIAL_CODE, simulate_receiver

NOISE = schuler.NoiseModel(
    {
        f"{sensor}_{axis}": schuler.WhiteNoise(white)
        for sensor, white in (("gyro", 1e-4), ("accel", 1.5e-3))
        for axis in "xyz"
    },
    rate=20.0,
)


def test_the_least_share_is_below_the_true_one_as_often_as_it_says() -> None:
    rng = np.random.default_rng(91)
    white, slow, time, sd = 0.3, 2.5, 60.0, 0.4
    seconds = np.array([10.0, 15.0, 30.0, 60.0, 100.0])
    variance = 2.0 * sd**2 * (white + slow * (1.0 - np.exp(-seconds / time)))
    found = []
    for _ in range(400):
        way = rng.standard_normal((5, 2)) * np.sqrt(variance)[:, None]
        wander = Wander(seconds, way, np.full((5, 2), sd))
        found.append(wander.least_slow(white, time, 16.0, sure=0.95))
    above = np.mean(np.array(found) > slow)
    assert abs(above - 0.05) < 3.0 * np.sqrt(0.05 * 0.95 / 400.0)
    # ten squares tell it to a factor of two
    assert 0.3 * slow < np.median(found) < 0.8 * slow
    assert Wander(np.empty(0), np.empty((0, 2)), np.empty((0, 2))).least_slow(0.3, 60.0, 16.0) == 0


def test_a_receiver_that_wanders_beside_a_standing_car_is_believed_less_and_it_is_said() -> None:
    rng = np.random.default_rng(92)
    profile = car_urban(150.0, 92, standstill=40.0)
    imu = simulate_imu(ideal_imu(profile, 20.0), NOISE, rng)
    gnss = simulate_receiver(profile, DIFFERENTIAL_CODE, 1.0, rng=rng)
    # 6 m in 30 s, and back while it drives
    away = np.interp(gnss.time, [5.0, 35.0, 140.0], [0.0, 6.0, 0.0])
    position = gnss.position.copy()
    position[:, 0] += away / metres_per_radian(gnss.position)[0]
    for fixes, wanders in ((gnss, False), (replace(gnss, position=position), True)):
        _, setup = schuler.prepare(imu, fixes, NOISE, time_offset=0.0)
        told = [f.message for f in setup.condition.findings if "vehicle stands" in f.message]
        assert len(told) == (1 if wanders else 0)
        split = setup.measurements.correlated
        assert isinstance(split, schuler.GnssErrorModel)
        assert (split.slow > 5.0) is wanders
    # the same way at a steady creep is the vehicle's
    velocity = np.zeros((gnss.size, 3))
    velocity[:, 0] = np.where(gnss.time < 40.0, 0.2, 1.0)
    assert wander_at_stands(imu, replace(gnss, velocity=velocity), 0.0).seconds.size == 0
