"""Drives that begin with minutes of creeping: the heading waits for real motion, and is honest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from twins import navigation_errors, with_noise

from schuler.data import GnssRecording, ImuRecording
from schuler.errors import InputError, NavigationError
from schuler.navigation.aiding.gnss import require_possible
from schuler.navigation.preparation.alignment import align
from schuler.navigation.preparation.felt_lag import find_felt_lag
from schuler.navigation.preparation.moving_start import start_in_motion
from schuler.navigation.preparation.rest import find_initial_rest
from schuler.rotations import dcm_from_euler
from schuler.simulation import Profile, ideal_imu, simulate_gnss
from schuler.simulation.grades import grade_noise
from schuler.simulation.motions.drives import Manoeuvre, drive
from schuler.simulation.shaking import shaken

RATE = 50.0


def creeping(rng: np.random.Generator, standing: bool) -> Profile:
    """Three minutes at 0.1 to 0.5 m/s, then a town."""
    speed = 0.0 if standing else 0.3
    plan = [Manoeuvre(4.0, speed)]
    while sum(m.duration for m in plan) < 180.0:
        speed = float(rng.uniform(0.1, 0.5)) if rng.random() < 0.75 else 0.0
        plan.append(Manoeuvre(float(rng.uniform(3.0, 5.0)), speed))
        turn = float(rng.uniform(-0.15, 0.15)) if speed else 0.0
        plan.append(Manoeuvre(float(rng.uniform(4.0, 15.0)), speed, turn))
    for _ in range(6):
        fast = float(rng.uniform(8.0, 14.0))
        plan += [Manoeuvre(6.0, fast), Manoeuvre(8.0, fast)]
        plan += [Manoeuvre(5.0, 5.0), Manoeuvre(6.0, 5.0, float(rng.choice([-1.5, 1.5])))]
    return drive(plan, heading=float(rng.uniform(-3.0, 3.0)))


def drawn(
    seed: int, standing: bool, latency: float = 0.0
) -> tuple[Profile, ImuRecording, GnssRecording, np.ndarray]:
    """A phone in a car, with a receiver whose velocities err four times as much as it says."""
    rng = np.random.default_rng([seed, 3])
    profile = creeping(rng, standing)
    mounting = dcm_from_euler(*rng.uniform([-3.0, -1.2, -3.0], [3.0, 1.2, 3.0]))
    ideal = ideal_imu(profile, RATE)
    felt = replace(ideal, gyro=ideal.gyro @ mounting, accel=ideal.accel @ mounting)
    shaking = shaken(felt, profile, "car_urban", 1.0, rng)
    imu, _ = with_noise(shaking, grade_noise("phone"), rng)
    bias = np.radians(1.0) * rng.standard_normal(3)
    imu = replace(imu, gyro=imu.gyro + bias, accel=imu.accel + 0.1 * rng.standard_normal(3))
    gnss = simulate_gnss(
        profile, 2.0, position_sd=1.5, velocity_sd=0.2, rng=rng, velocity_latency=latency
    )
    assert gnss.velocity_sd is not None
    return profile, imu, replace(gnss, velocity_sd=0.25 * gnss.velocity_sd), mounting


def test_a_heading_after_creeping_is_inside_what_is_claimed() -> None:
    normalised, claims = [], []
    for seed in range(8):
        profile, imu, gnss, mounting = drawn(seed, standing=bool(seed % 2))
        lag = find_felt_lag(imu, gnss)
        assert lag is not None
        assert abs(lag) < 0.15
        start = align(imu, gnss, velocity_offset=lag)
        e = navigation_errors(
            profile,
            imu.time[:1],
            np.zeros((1, 3)),
            np.zeros((1, 3)),
            (start.rotation @ mounting.T)[None],
        )[0, 6:]
        normalised.append(e[2] / start.heading_sd)
        claims.append(np.degrees(start.heading_sd))
        assert "real motion" in start.method
    assert np.abs(normalised).max() < 3.0
    assert np.mean(np.square(normalised)) < 1.8
    assert np.median(claims) < 7.0


@pytest.mark.parametrize("latency", [-0.8, 0.0, 0.5])
def test_accelerations_tell_the_time_offset_before_anything_is_known(latency: float) -> None:
    _, imu, gnss, _ = drawn(20, standing=True, latency=latency)
    found = find_felt_lag(imu, gnss)
    assert found is not None
    assert abs(found + latency) < 0.1


def test_recordings_without_motion_tell_no_lag() -> None:
    _, imu, gnss, _ = drawn(21, standing=True)
    assert find_felt_lag(imu.between(0.0, 150.0), gnss.select(gnss.time < 150.0)) is None


def test_slow_and_steady_creeping_is_no_rest() -> None:
    rng = np.random.default_rng(1)
    time = np.arange(0.0, 60.0, 0.02)
    level = np.tile([0.0, 0.0, -9.8], (time.size, 1))
    imu = ImuRecording(time, np.zeros((time.size, 3)) + 1e-9, level)
    epochs = np.arange(0.0, 60.0, 0.5)
    for speed in (0.0, 0.3):
        way = np.maximum(epochs - 10.0, 0.0) * speed
        place = np.tile([0.8, 0.1, 100.0], (epochs.size, 1))
        place[:, 0] += way / 6.37e6
        noise = 0.5 * rng.standard_normal((epochs.size, 3)) / [6.37e6, 4.4e6, 1.0]
        gnss = GnssRecording(
            epochs,
            place + noise,
            np.full((epochs.size, 3), 0.5),
            np.tile([speed, 0.0, 0.0], (epochs.size, 1)),
            np.full((epochs.size, 3), 0.2),
        )
        rest = find_initial_rest(imu, gnss)
        assert rest is not None
        assert rest[1] > 50.0 if speed == 0.0 else rest[1] < 30.0


def test_seldom_fixes_at_a_moving_start_are_refused_with_their_cause() -> None:
    _, imu, gnss, _ = drawn(23, standing=False)
    seldom = gnss.select(np.arange(gnss.size) % 40 == 0)
    with pytest.raises(NavigationError, match="a fix every 20 s") as error:
        start_in_motion(imu, seldom, 0.0, np.zeros(3))
    assert "two seconds at rest" in str(error.value)


@pytest.mark.parametrize(
    ("latitude", "sd", "words"),
    [(89.9999, 1.0, "of a pole"), (48.0, 1e-9, "no receiver is that sure")],
)
def test_fixes_that_cannot_be_used_are_refused_with_their_cause(
    latitude: float, sd: float, words: str
) -> None:
    place = np.tile([np.radians(latitude), 0.1, 100.0], (5, 1))
    with pytest.raises(InputError, match=words):
        require_possible(GnssRecording(np.arange(5.0), place, np.full((5, 3), sd)))
