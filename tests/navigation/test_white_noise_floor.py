"""What white noise alone does in an outage (spec 10): claims by closed form, errors by draws."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from twins import navigation_errors, perfect

from schuler.navigation.aiding.schedule import AidingSchedule
from schuler.navigation.engine import FilterRun, InitialState, gate_thresholds, run_engine
from schuler.navigation.error_models.sensor_error_model import SensorErrorModel, sensor_error_model
from schuler.noise import GaussMarkov, RandomWalk, TurnOnBias, WhiteNoise
from schuler.noise.base import Process
from schuler.noise.noise_model import NoiseModel
from schuler.simulation import Profile, static

RATE = 50.0
GRAVITY = 9.806
NOTHING = AidingSchedule(
    np.empty(0),
    np.empty(0, dtype=np.int64),
    np.empty((0, 3)),
    np.empty((0, 3)),
    np.empty((0, 3)),
)


def model_of(accel: Process, gyro: Process) -> SensorErrorModel:
    noise = NoiseModel(
        processes={f"{s}_{a}": p for s, p in (("gyro", gyro), ("accel", accel)) for a in "xyz"},
        source="test",
    )
    return sensor_error_model(noise, turn_on_accel=0.0, turn_on_gyro=0.0)


def free_run(
    profile: Profile, model: SensorErrorModel, accel: np.ndarray, gyro: np.ndarray
) -> FilterRun:
    """An outage from a perfect start; errors of the sensors (n, 3) are added."""
    ideal = perfect(profile, RATE)
    imu = replace(ideal, accel=ideal.accel + accel, gyro=ideal.gyro + gyro)
    truth = profile.trajectory(ideal.time[:1])
    covariance = np.zeros((9 + model.size, 9 + model.size))
    covariance[9:, 9:] = model.initial_covariance
    start = InitialState(
        truth.position[0],
        truth.velocity[0],
        truth.rotation[0],
        np.zeros(model.size),
        covariance,
    )
    return run_engine(imu, start, model, NOTHING, gate=gate_thresholds(0.0))


def horizontal_sd(run: FilterRun, time: float) -> np.ndarray:
    """Claimed north and east sd (m) a time after the first sample."""
    return np.sqrt(np.diag(run.samples.position_covariance[round(time * RATE)])[:2])


@pytest.mark.parametrize("time", [10.0, 30.0, 60.0])
def test_claims_of_white_noise_follow_the_closed_forms(time: float) -> None:
    # spec 10: g N_g t^{5/2}/sqrt(20) and N t^{3/2}/sqrt(3); the Schuler period bends them by
    # less than (t/806 s)²
    profile = static(61.0, yaw=0.8, roll=0.2)
    zero = np.zeros(3)
    gyro_density, accel_density = 7.0e-4, 7.5e-4
    gyro = free_run(profile, model_of(WhiteNoise(0.0), WhiteNoise(gyro_density)), zero, zero)
    wanted = GRAVITY * gyro_density * time**2.5 / np.sqrt(20.0)
    np.testing.assert_allclose(horizontal_sd(gyro, time), wanted, rtol=0.02)
    accel = free_run(profile, model_of(WhiteNoise(accel_density), WhiteNoise(0.0)), zero, zero)
    wanted = accel_density * time**1.5 / np.sqrt(3.0)
    np.testing.assert_allclose(horizontal_sd(accel, time), wanted, rtol=0.02)


def test_claims_of_biases_and_walks_follow_the_closed_forms() -> None:
    # b t²/2 and g b t³/6; K t^{5/2}/sqrt(20) and g K t^{7/2}/sqrt(252)
    profile, t = static(41.0), 40.0
    zero = np.zeros(3)
    none = WhiteNoise(0.0)
    cases = [
        (TurnOnBias(0.01), none, 0.01 * t**2 / 2),
        (none, TurnOnBias(1e-4), GRAVITY * 1e-4 * t**3 / 6),
        (RandomWalk(1e-3), none, 1e-3 * t**2.5 / np.sqrt(20.0)),
        (none, RandomWalk(1e-5), GRAVITY * 1e-5 * t**3.5 / np.sqrt(252.0)),
        # a Gauss-Markov process much faster than the outage is white: N² = 2 sigma² Tc
        (GaussMarkov(0.02, 0.1), none, 0.02 * np.sqrt(0.2) * t**1.5 / np.sqrt(3.0)),
    ]
    for accel, gyro, wanted in cases:
        run = free_run(profile, model_of(accel, gyro), zero, zero)
        np.testing.assert_allclose(horizontal_sd(run, t), wanted, rtol=0.02)


def test_errors_of_free_runs_are_as_large_as_claimed() -> None:
    rng = np.random.default_rng(21)
    profile = static(31.0, yaw=0.5, pitch=0.1)
    accel, gyro = WhiteNoise(0.01) + RandomWalk(1e-3), WhiteNoise(5e-4) + GaussMarkov(1e-4, 10.0)
    model = model_of(accel, gyro)
    n = perfect(profile, RATE).size
    squares = []
    for _ in range(60):
        errors = [
            np.stack([p.simulate(n, 1.0 / RATE, rng) for _ in range(3)], axis=-1)
            for p in (accel, gyro)
        ]
        run = free_run(profile, model, *errors)
        s = run.samples
        time = np.array([30.0 + 1.0 / RATE])
        k = round(30.0 * RATE)
        e = navigation_errors(
            profile, time, s.position[k : k + 1], s.velocity[k : k + 1], s.rotation[k : k + 1]
        )[0]
        c = s.position_covariance[k]
        squares.append(e[:3] @ np.linalg.solve(c, e[:3]))
    # chi-square of 180 degrees of freedom: 95 % between 0.80 and 1.22
    from scipy.stats import chi2

    low, high = chi2.ppf([0.025, 0.975], 180) / 180
    assert low < np.mean(squares) / 3.0 < high
