"""Strapdown navigation against exact truth, and the ellipsoid of the kernels against `earth`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from schuler import earth
from schuler.data import ImuRecording
from schuler.navigation.preparation.alignment import dead_reckon
from schuler.rotations import rotation_vector_from_dcm
from schuler.simulation import Profile, car_mixed, car_urban, ideal_imu, static


def from_the_start(profile: Profile, rate: float) -> ImuRecording:
    """An ideal IMU with a stamp at the start of the profile; the first sample is not integrated."""
    ideal = ideal_imu(profile, rate)
    return replace(
        ideal,
        time=np.concatenate([[profile.start], ideal.time]),
        gyro=np.concatenate([ideal.gyro[:1], ideal.gyro]),
        accel=np.concatenate([ideal.accel[:1], ideal.accel]),
    )


def errors(profile: Profile, imu: ImuRecording) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distance (m), speed error (m/s) and angle (rad) of dead reckoning from the exact start."""
    truth = profile.trajectory(imu.time)
    position, velocity, rotation = dead_reckon(
        imu, truth.position[0], truth.velocity[0], truth.rotation[0]
    )
    north, east = earth.metres_per_radian(truth.position)
    offset = (position - truth.position) * np.stack([north, east, np.ones(north.size)], axis=-1)
    turn = rotation_vector_from_dcm(rotation @ truth.rotation.transpose(0, 2, 1))
    return (
        np.linalg.norm(offset, axis=1),
        np.linalg.norm(velocity - truth.velocity, axis=1),
        np.linalg.norm(turn, axis=1),
    )


@pytest.mark.parametrize("drive", [car_urban, car_mixed])
def test_a_noise_free_drive_of_ten_minutes_comes_back_within_a_millimetre(drive) -> None:
    # spec 1.2: 1 mm and 1e-6 rad over 10 min at 100 Hz
    profile = drive(600.0, 4)
    imu = from_the_start(profile, 100.0)
    distance, speed, angle = errors(profile, imu)
    assert np.ptp(profile.trajectory(imu.time).position[:, 0]) * 6.4e6 > 100.0
    assert distance.max() < 1e-3
    assert speed.max() < 1e-5
    assert angle.max() < 1e-6


def test_standing_still_on_the_turning_earth_moves_nothing() -> None:
    # wrong sign or frame of the earth's rate turns 7.3e-5 rad a second; of Coriolis, more
    profile = static(300.0, position=(-0.9, 2.5, 1200.0), roll=0.3, pitch=-0.5, yaw=2.0)
    distance, speed, angle = errors(profile, from_the_start(profile, 50.0))
    assert angle.max() < 1e-9
    assert speed.max() < 1e-7
    assert distance.max() < 1e-5


def test_an_unseen_rate_turns_the_attitude_by_its_integral_and_its_sign() -> None:
    # psi of C_hat = (I - [psi x]) C grows as -C dw t: spec 0 and 7.2
    profile = static(20.0, yaw=0.7)
    imu = from_the_start(profile, 50.0)
    truth = profile.trajectory(imu.time)
    bias = np.array([2e-5, -1e-5, 3e-5])
    _, _, rotation = dead_reckon(
        replace(imu, gyro=imu.gyro + bias),
        truth.position[0],
        truth.velocity[0],
        truth.rotation[0],
    )
    psi = -rotation_vector_from_dcm(rotation[-1] @ truth.rotation[-1].T)
    np.testing.assert_allclose(psi, -truth.rotation[0] @ bias * 20.0, atol=1e-6)


def test_coning_is_integrated_at_the_order_of_two_samples() -> None:
    # a body that cones at 5 Hz by 1 degree drifts by w sin(a)^2... if coning is left out
    rate, frequency, half = 100.0, 5.0, np.radians(1.0)
    omega = 2.0 * np.pi * frequency
    time = np.arange(0, int(60 * rate) + 1) / rate
    start, stop = time[:-1], time[1:]
    # w_nb of the classical coning motion (Savage 1998; Titterton & Weston 11.4), integrated
    constant = -2.0 * omega * np.sin(half / 2.0) ** 2
    size = np.sin(half)
    angle = np.stack(
        [
            constant * (stop - start),
            size * (np.cos(omega * stop) - np.cos(omega * start)) * 1.0,
            size * (np.sin(omega * stop) - np.sin(omega * start)) * 1.0,
        ],
        axis=-1,
    )
    position = np.array([0.8, 0.1, 0.0])
    still = static(61.0, position=position)
    w_ie, force = still.rates(1.0)
    gyro = angle * rate
    gyro = np.concatenate([gyro[:1], gyro])
    imu = ImuRecording(time, gyro, np.tile(force, (time.size, 1)))
    # the axis cones about a fixed direction: after whole periods the attitude is as at first,
    # but for the earth's rate (7.3e-5 rad/s over a minute) which is not in the gyro here
    start_rotation = np.eye(3)
    _, _, rotation = dead_reckon(imu, position, np.zeros(3), start_rotation)
    turn = rotation_vector_from_dcm(rotation[-1])
    by_earth = np.linalg.norm(w_ie) * 60.0
    left_out = 2.0 * omega * np.sin(half / 2.0) ** 2 * 60.0
    assert left_out > 0.25  # what an integration without coning terms would be wrong by
    assert abs(turn[0]) < by_earth + 0.01 * left_out


def cubic(rng: np.random.Generator, size: float) -> np.ndarray:
    """Coefficients (4, 3) of a cubic on the time of one sample, all terms of like size."""
    return size * rng.standard_normal((4, 3))


def integral(polynomial: np.ndarray, start: float, stop: float) -> np.ndarray:
    powers = np.arange(1, 5)
    return ((stop**powers - start**powers) / powers) @ polynomial


def body_increment(rate: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What a sample of cubic rate and force turns and pushes: rotation vector and velocity."""
    from scipy.integrate import solve_ivp

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        matrix, w, f = y[:9].reshape(3, 3), t ** np.arange(4) @ rate, t ** np.arange(4) @ force
        skew = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
        return np.concatenate([(matrix @ skew).ravel(), matrix @ f])

    start = np.concatenate([np.eye(3).ravel(), np.zeros(3)])
    end = solve_ivp(slope, (0.0, 1.0), start, method="DOP853", rtol=1e-13, atol=1e-16).y[:, -1]
    return rotation_vector_from_dcm(end[:9].reshape(3, 3)), end[9:]


def test_cubic_rates_and_forces_are_integrated_to_fourth_order() -> None:
    from schuler.kernels.navigation.strapdown import coning_and_sculling

    rng = np.random.default_rng(2)
    shape, pushed = cubic(rng, 1.0), cubic(rng, 10.0)
    left = []
    for size in (0.02, 0.01):
        # half the step: the k-th derivative counts for 2^-k less
        scale = size ** (1.0 + np.arange(4.0))[:, None] * 50.0 ** np.arange(4.0)[:, None]
        rate, force = shape * scale, pushed * scale
        samples = [(integral(rate, -k, 1.0 - k), integral(force, -k, 1.0 - k)) for k in range(4)]
        (angle, velocity), *before = samples
        past = np.array([np.concatenate([a, v]) for a, v in before])
        coning, sculling = np.empty(3), np.empty(3)
        coning_and_sculling(angle, velocity, past, 1.0, coning, sculling)
        turn = np.cross(angle, velocity)
        found = velocity + (0.5 - angle @ angle / 24.0) * turn + np.cross(angle, turn) / 6.0
        wanted_angle, wanted_velocity = body_increment(rate, force)
        left.append(
            (
                np.linalg.norm(angle + coning - wanted_angle),
                np.linalg.norm(found + sculling - wanted_velocity),
                np.linalg.norm(coning),
                np.linalg.norm(sculling),
            )
        )
    (coarse_a, coarse_v, by_coning, by_sculling), (fine_a, fine_v, _, _) = left
    # what is left is of fifth order in the step, a hundredth of the correction and less
    assert coarse_a < 0.01 * by_coning
    assert coarse_v < 0.01 * by_sculling
    assert coarse_a / fine_a > 2.0**4.5
    assert coarse_v / fine_v > 2.0**4.5


def test_radii_and_gravity_are_those_of_the_earth_module() -> None:
    from schuler.kernels.navigation.geodesy import gravity_down, radii_of_curvature

    for latitude in np.radians([-89.0, -45.0, 0.0, 12.3, 60.0, 89.9]):
        sine = float(np.sin(latitude))
        np.testing.assert_allclose(radii_of_curvature(sine), earth.radii(latitude), rtol=1e-13)
        for height in (-100.0, 0.0, 3000.0):
            assert gravity_down(sine, height) == pytest.approx(
                float(earth.gravity(latitude, height)), rel=1e-12
            )
