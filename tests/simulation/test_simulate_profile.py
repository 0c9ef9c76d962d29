"""True motion: force and rate integrate back to it by a way that shares no formula with it."""

from __future__ import annotations

from math import cos, pi, radians, sin

import numpy as np
import pytest

from schuler import earth
from schuler import simulation as simulate
from schuler.errors import InputError
from schuler.rotations import dcm_from_euler, rotation_vector_from_dcm, skew

EARTH_RATE_ECEF = np.array([0.0, 0.0, 7.292115e-5])


def tumbling() -> simulate.Profile:
    """Large turns about all axes while flying a curve with climbs."""
    t = np.linspace(0.0, 40.0, 81)
    position = np.column_stack(
        [
            0.9 + 4e-5 * np.sin(0.11 * t),
            -2.0 + 9e-5 * np.sin(0.07 * t + 0.4),
            800.0 + 40.0 * np.sin(0.2 * t),
        ]
    )
    euler = np.column_stack(
        [1.2 * np.sin(0.9 * t), 1.3 * np.sin(0.5 * t + 1.0), 0.4 * t + np.sin(0.6 * t)]
    )
    return simulate.fit_profile(t, position, euler)


def ecef_truth(profile: simulate.Profile, time: np.ndarray):
    truth = profile.trajectory(time)
    c_ne = earth.ned_from_ecef_rotation(truth.position[:, 0], truth.position[:, 1])
    c_en = np.swapaxes(c_ne, 1, 2)
    velocity = (c_en @ truth.velocity[..., None])[..., 0]
    return earth.ecef_from_geodetic(truth.position), velocity, c_en @ truth.rotation


def integrate_in_ecef(profile: simulate.Profile, start: float, stop: float, step: float):
    """Runge-Kutta of the navigation equations in the earth-fixed frame."""
    n = round((stop - start) / step)
    time = start + 0.5 * step * np.arange(2 * n + 1)
    omega, force = profile.rates(time)
    w = skew(EARTH_RATE_ECEF)

    def slope(state, k):
        r, v, c = state
        latitude, longitude, height = earth.geodetic_from_ecef(r)
        g_e = earth.ned_from_ecef_rotation(latitude, longitude)[2] * earth.gravity(latitude, height)
        return v, c @ force[k] + g_e - 2.0 * w @ v, c @ skew(omega[k]) - w @ c

    def moved(state, change, h):
        return tuple(s + h * d for s, d in zip(state, change, strict=True))

    state = tuple(x[0] for x in ecef_truth(profile, np.array([start])))
    for i in range(n):
        k1 = slope(state, 2 * i)
        k2 = slope(moved(state, k1, 0.5 * step), 2 * i + 1)
        k3 = slope(moved(state, k2, 0.5 * step), 2 * i + 1)
        k4 = slope(moved(state, k3, step), 2 * i + 2)
        state = tuple(
            s + step / 6.0 * (a + 2.0 * b + 2.0 * c + d)
            for s, a, b, c, d in zip(state, k1, k2, k3, k4, strict=True)
        )
    return state


@pytest.mark.parametrize(
    ("make", "start", "stop", "step"),
    [
        (tumbling, 2.0, 38.0, 0.01),
        (lambda: simulate.car_urban(200.0, 3, standstill=20.0), 15.0, 120.0, 0.05),
        (lambda: simulate.car_mixed(500.0, 4, standstill=20.0), 230.0, 300.0, 0.05),
    ],
    ids=["tumbling", "urban", "motorway"],
)
def test_rates_integrate_back_to_the_truth(make, start, stop, step) -> None:
    profile = make()
    position, velocity, c_eb = integrate_in_ecef(profile, start, stop, step)
    true_position, true_velocity, true_c_eb = (x[0] for x in ecef_truth(profile, np.array([stop])))
    assert np.linalg.norm(true_position - ecef_truth(profile, np.array([start]))[0][0]) > 50.0
    # what is left is the fourth order of the integration
    assert np.linalg.norm(position - true_position) < 5e-6
    assert np.linalg.norm(velocity - true_velocity) < 5e-7
    assert np.linalg.norm(rotation_vector_from_dcm(c_eb @ true_c_eb.T)) < 2e-8


def test_velocity_is_the_derivative_of_position() -> None:
    profile, t, h = tumbling(), np.linspace(1.0, 39.0, 50), 1e-3
    after, before = (profile.trajectory(t + s).position for s in (h, -h))
    here = profile.trajectory(t)
    north, east = earth.metres_per_radian(here.position)
    finite = (after - before) / (2 * h) * np.stack([north, east, -np.ones(50)], axis=-1)
    np.testing.assert_allclose(here.velocity, finite, atol=3e-6)
    assert np.abs(here.velocity).max(axis=0).min() > 5.0


def test_velocity_rate_is_the_derivative_of_velocity() -> None:
    profile, t, h = tumbling(), np.linspace(1.0, 39.0, 50), 1e-3
    finite = (profile.motion(t + h).velocity - profile.motion(t - h).velocity) / (2 * h)
    motion = profile.motion(t)
    np.testing.assert_allclose(motion.velocity_rate, finite, atol=1e-6)
    # the terms of curvature are not small print: they are above what this test resolves
    crude = motion.velocity_rate[:, 1] + motion.velocity[:, 1] * motion.velocity[:, 0] / 6.4e6
    assert np.abs(crude - motion.velocity_rate[:, 1]).max() > 1e-5


def test_force_and_rate_have_no_steps_in_their_derivatives() -> None:
    profile = simulate.car_urban(200.0, 5, standstill=20.0)
    t = np.arange(25.0, 190.0, 0.01)
    for values in profile.rates(t):
        second = np.diff(values, 2, axis=0) / 0.01**2
        # a step in the first derivative would be a spike of (step / 0.01) in the second; where
        # it is continuous, the second derivative is what the manoeuvres make it: below 10 / s²
        assert np.abs(second).max() < 10.0
        assert np.abs(second).max() > 1e-2


@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.5])
def test_at_rest_force_opposes_gravity_and_rate_is_that_of_the_earth(yaw: float) -> None:
    latitude, roll, pitch = radians(40.0), 0.2, -0.3
    profile = simulate.static(
        100.0, position=(latitude, 1.0, 500.0), roll=roll, pitch=pitch, yaw=yaw
    )
    omega, force = (x[0] for x in profile.rates(50.0))
    c_nb = dcm_from_euler(roll, pitch, yaw)
    down = np.array([0.0, 0.0, earth.gravity(latitude, 500.0)])
    np.testing.assert_allclose(c_nb @ force, -down, atol=1e-9)
    w_ie = 7.292115e-5 * np.array([cos(latitude), 0.0, -sin(latitude)])
    np.testing.assert_allclose(c_nb @ omega, w_ie, atol=1e-13)
    # level and pointing north: the accelerometer below shows -g
    flat = simulate.static(10.0, position=(latitude, 1.0, 500.0))
    np.testing.assert_allclose(flat.rates(5.0)[1][0], -down, atol=1e-9)


def test_braking_and_turning_feel_as_they_should() -> None:
    plan = [
        simulate.Manoeuvre(20.0, 20.0),
        simulate.Manoeuvre(10.0, 20.0),
        simulate.Manoeuvre(20.0, 20.0, pi / 2),
        simulate.Manoeuvre(20.0, 0.0),
    ]
    profile = simulate.drive(plan, suspension=simulate.Suspension(0.0, 0.0))
    omega, force = profile.rates([10.0, 40.0, 60.0])
    peak = 315.0 / 128.0
    assert force[0, 0] == pytest.approx(peak * 1.0, rel=1e-3)  # speeding up pushes forward
    assert omega[1, 2] == pytest.approx(peak * pi / 2 / 20.0, rel=1e-3)  # to the right: positive
    assert force[1, 1] == pytest.approx(20.0 * peak * pi / 2 / 20.0, rel=2e-3)  # to the centre
    assert force[2, 0] == pytest.approx(-peak * 1.0, rel=1e-3)


def test_suspension_leans_out_of_curves_and_lifts_the_nose() -> None:
    plan = [simulate.Manoeuvre(20.0, 20.0), simulate.Manoeuvre(20.0, 20.0, pi / 2)]
    roll, pitch, _ = simulate.drive(plan).motion([10.0, 30.0]).euler.T
    peak = 315.0 / 128.0
    assert pitch[0] == pytest.approx(0.005 * peak, rel=1e-3)
    assert roll[1] == pytest.approx(-0.009 * 20.0 * peak * pi / 2 / 20.0, rel=1e-3)


def test_a_drive_goes_where_its_plan_says() -> None:
    straight = [simulate.Manoeuvre(10.0, 10.0), simulate.Manoeuvre(90.0, 10.0)]
    origin = np.array([radians(60.0), 0.3, 0.0])
    end = simulate.drive(straight, origin=origin, heading=pi / 2).trajectory([100.0]).position[0]
    _, east = earth.metres_per_radian(origin)
    assert (end[1] - origin[1]) * east == pytest.approx(50.0 + 900.0, abs=1e-6)
    assert end[0] == pytest.approx(origin[0], abs=1e-15)
    road = simulate.Road(grade=np.array([[0.03, 400.0, 0.0]]))
    climbed = simulate.drive(straight, origin=origin, road=road)
    top = climbed.trajectory(np.linspace(0, 100, 1001)).position[:, 2].max()
    assert top == pytest.approx(0.03 * 400.0 / pi, rel=1e-2)
    speed = np.linalg.norm(climbed.trajectory([50.0]).velocity)
    assert speed == pytest.approx(10.0, abs=1e-5)


def test_heading_follows_the_course_while_driving() -> None:
    for profile in (simulate.car_urban(rng=1), simulate.car_mixed(rng=1)):
        motion = profile.motion(np.arange(0.0, 900.0, 0.1))
        moving = np.linalg.norm(motion.velocity, axis=1) > 1.0
        course = np.arctan2(motion.velocity[:, 1], motion.velocity[:, 0])
        error = np.angle(np.exp(1j * (course - motion.euler[:, 2])))[moving]
        assert np.abs(error).max() < 2e-5


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_drive_through_town_is_as_described(seed: int) -> None:
    profile = simulate.car_urban(rng=seed)
    assert profile.duration == pytest.approx(1038.0, abs=1e-6)
    motion = profile.motion(np.arange(0.0, 1038.0, 0.1))
    speed = 3.6 * np.linalg.norm(motion.velocity, axis=1)
    assert 40.0 < speed.max() <= 50.0 + 1e-3
    rest = speed < 1e-3
    assert rest[:600].all()
    assert rest[-95:].all()
    assert np.count_nonzero(np.diff(rest.astype(int)) == 1) >= 5  # stops
    corner = np.abs(motion.euler[80:, 2] - motion.euler[:-80, 2])
    assert np.count_nonzero(np.diff((corner > radians(60.0)).astype(int)) == 1) >= 10
    assert 1.0 < np.ptp(motion.position[:, 2]) < 40.0
    assert np.abs(motion.euler[:, :2]).max() < radians(6.0)


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_the_mixed_drive_is_as_described(seed: int) -> None:
    profile = simulate.car_mixed(rng=seed)
    assert profile.duration == pytest.approx(15.05 * 60.0, abs=1e-6)
    motion = profile.motion(np.arange(0.0, 903.0, 0.1))
    speed = 3.6 * np.linalg.norm(motion.velocity, axis=1)
    assert speed.max() == pytest.approx(123.0, abs=0.01)
    assert (speed < 1e-3)[:600].all()
    assert (speed < 1e-3)[-95:].all()
    omega, force = profile.rates(np.arange(0.0, 903.0, 0.1))
    assert np.abs(force[:, :2]).max() < 5.0
    assert np.abs(omega).max() < 0.7


def test_drives_are_reproducible_and_differ_by_seed() -> None:
    t = np.array([30.0, 100.0, 150.0])
    one, again, other = (
        simulate.car_urban(200.0, rng).trajectory(t).position
        for rng in (9, np.random.default_rng(9), 10)
    )
    np.testing.assert_array_equal(one, again)
    assert np.abs(one[2] - other[2]).max() > 1e-7


def test_waypoints_are_met_and_the_nose_follows_the_path() -> None:
    t = np.linspace(0.0, 100.0, 21)
    position = np.column_stack(
        [0.8 + 1e-5 * np.cos(0.05 * t), 0.1 + 1.5e-5 * np.sin(0.05 * t), 100.0 + t]
    )
    profile = simulate.from_waypoints(t, position)
    truth = profile.trajectory(t)
    np.testing.assert_allclose(truth.position[:, :2], position[:, :2], atol=1e-15)
    np.testing.assert_allclose(truth.position[:, 2], position[:, 2], atol=1e-9)
    dense = profile.trajectory(np.linspace(2.0, 98.0, 500))
    body = (np.swapaxes(dense.rotation, 1, 2) @ dense.velocity[..., None])[..., 0]
    assert np.abs(body[:, 1:]).max() < 1e-4 * body[:, 0].min()


def test_what_cannot_be_driven_is_refused() -> None:
    with pytest.raises(InputError, match="on the spot"):
        simulate.drive([simulate.Manoeuvre(5.0, 0.0, 1.0)])
    with pytest.raises(InputError, match="a second or more"):
        simulate.drive([simulate.Manoeuvre(0.5, 10.0)])
    with pytest.raises(InputError, match="or more"):
        simulate.car_urban(80.0)
    with pytest.raises(InputError, match="outside the profile"):
        simulate.static(10.0).rates(10.1)
    with pytest.raises(InputError, match="positive duration"):
        simulate.static(0.0)
    still = np.tile([0.8, 0.1, 0.0], (8, 1))
    with pytest.raises(InputError, match="all but stops"):
        simulate.from_waypoints(np.arange(8.0), still)
    with pytest.raises(InputError, match="do not increase"):
        simulate.from_waypoints(np.zeros(8), still, np.zeros((8, 3)))
