"""The earth against published values, and coordinates against each other."""

from __future__ import annotations

from math import cos, pi, radians, sin

import numpy as np
import pytest

from schuler import earth
from schuler.errors import InputError


def places(n: int = 200) -> np.ndarray:
    rng = np.random.default_rng(7)
    grid = np.column_stack(
        [rng.uniform(-pi / 2, pi / 2, n), rng.uniform(-pi, pi, n), rng.uniform(-5e3, 5e4, n)]
    )
    edges = [[pi / 2, 0.3, 10.0], [-pi / 2, 0.0, -50.0], [0.0, pi, 0.0], [0.0, 0.0, 2e7],
             [1e-9, -pi / 2, 0.0], [pi / 2 - 1e-9, 1.0, 100.0]]  # fmt: skip
    return np.vstack([grid, edges])


def test_normal_gravity_against_published_values() -> None:
    assert earth.gravity(0.0, 0.0) == pytest.approx(9.7803253359, abs=1e-12)
    assert earth.gravity(pi / 2, 0.0) == pytest.approx(9.8321849379, abs=1e-12)
    assert earth.gravity(-pi / 2, 0.0) == pytest.approx(9.8321849379, abs=1e-12)
    assert earth.gravity(pi / 4, 0.0) == pytest.approx(9.806197769, abs=2e-9)


def test_gravity_is_somigliana_with_the_published_constant() -> None:
    for latitude in np.radians([10.0, 33.0, 62.0]):
        s2 = sin(latitude) ** 2
        published = 9.7803253359 * (1 + 0.00193185265241 * s2) / np.sqrt(1 - 6.69437999014e-3 * s2)
        assert earth.gravity(latitude, 0.0) == pytest.approx(published, abs=1e-10)


def test_free_air_gradient() -> None:
    gradient = (earth.gravity(radians(45.0), 0.5) - earth.gravity(radians(45.0), -0.5)) / 1.0
    assert gradient == pytest.approx(-3.0855e-6, rel=2e-4)  # -0.30855 mGal/m at 45 degrees
    # Second order: gravity at 10 km, the inverse square of the distance to within its own
    # oblateness terms.
    fall = earth.gravity(0.7, 1e4) / earth.gravity(0.7, 0.0) - 1.0
    linear = 1e4 * (earth.gravity(0.7, 1e-1) / earth.gravity(0.7, 0.0) - 1.0) / 1e-1
    assert fall - linear == pytest.approx(3.0 * (1e4 / 6378137.0) ** 2, rel=1e-2)


def test_radii_at_equator_and_pole() -> None:
    a, b = 6378137.0, 6356752.314245
    meridian, transverse = earth.radii(np.array([0.0, pi / 2]))
    np.testing.assert_allclose(meridian, [b * b / a, a * a / b], rtol=1e-12)
    np.testing.assert_allclose(transverse, [a, a * a / b], rtol=1e-12)


def test_radii_slopes_are_the_derivatives() -> None:
    latitude, step = np.radians([-70.0, -1.0, 20.0, 45.0, 80.0]), 1e-5
    for k, slope in enumerate(earth.radii_slopes(latitude)):
        finite = (earth.radii(latitude + step)[k] - earth.radii(latitude - step)[k]) / (2 * step)
        np.testing.assert_allclose(slope, finite, rtol=1e-6, atol=1e-3)


def test_metres_per_radian_is_the_derivative_of_ned() -> None:
    origin, step = np.array([0.8, 0.2, 300.0]), 1e-6
    north, east = earth.metres_per_radian(origin)
    by_latitude = earth.ned_from_geodetic(origin + np.array([step, 0, 0]), origin) / step
    by_longitude = earth.ned_from_geodetic(origin + np.array([0, step, 0]), origin) / step
    assert by_latitude[0] == pytest.approx(north, abs=5.0)
    assert by_latitude[0] == pytest.approx(north, rel=1e-6)
    assert by_longitude[1] == pytest.approx(east, rel=1e-6)
    assert abs(by_latitude[1]) < 1e-2
    down = earth.ned_from_geodetic(origin + np.array([0, 0, 1.0]), origin)
    np.testing.assert_allclose(down, [0, 0, -1.0], atol=5e-9)


def test_earth_rate_and_transport_rate() -> None:
    rate = earth.earth_rate_ned(0.9)
    assert np.linalg.norm(rate) == pytest.approx(7.292115e-5, rel=1e-14)
    # resolved into the earth-fixed frame it is the axis of the earth
    to_ecef = earth.ned_from_ecef_rotation(0.9, -2.0).T
    np.testing.assert_allclose(to_ecef @ rate, [0, 0, 7.292115e-5], atol=1e-19)


def test_transport_rate_turns_the_local_level_frame() -> None:
    position, velocity, dt = np.array([0.9, -2.0, 500.0]), np.array([30.0, -20.0, 3.0]), 1.0
    north, east = earth.metres_per_radian(position)
    step = np.array([velocity[0] / north, velocity[1] / east, -velocity[2]]) * dt
    before = earth.ned_from_ecef_rotation(*(position - 0.5 * step)[:2])
    after = earth.ned_from_ecef_rotation(*(position + 0.5 * step)[:2])
    # C_ne changes by -[w_en x] C_ne
    turned = (after - before) @ (0.5 * (after + before)).T / dt
    w_en = earth.transport_rate_ned(position, velocity)
    np.testing.assert_allclose(
        -np.array([turned[2, 1], turned[0, 2], turned[1, 0]]), w_en, rtol=1e-6, atol=1e-13
    )


def test_known_ecef_points() -> None:
    np.testing.assert_allclose(
        earth.ecef_from_geodetic([[0, 0, 0], [0, pi / 2, 10], [pi / 2, 0, -10]]),
        [[6378137.0, 0, 0], [0, 6378147.0, 0], [0, 0, 6356742.314245]],
        atol=1e-6,
    )


def test_ecef_there_and_back() -> None:
    place = places()
    ecef = earth.ecef_from_geodetic(place)
    back = earth.geodetic_from_ecef(ecef)
    north, east = earth.metres_per_radian(place)
    error = np.column_stack(
        [
            (back[:, 0] - place[:, 0]) * north,
            np.angle(np.exp(1j * (back[:, 1] - place[:, 1]))) * east,
            back[:, 2] - place[:, 2],
        ]
    )
    assert np.abs(error).max() < 5e-9  # the last bit of an earth radius is 1e-9 m
    near = np.abs(place[:, 2]) < 6e4
    assert np.abs(earth.ecef_from_geodetic(back) - ecef)[near].max() < 4e-9


def test_local_coordinates_there_and_back_and_their_axes() -> None:
    origin = np.array([radians(48.0), radians(11.0), 520.0])
    ned = np.random.default_rng(8).normal(size=(100, 3)) * [2e4, 2e4, 500.0]
    back = earth.ned_from_geodetic(earth.geodetic_from_ned(ned, origin), origin)
    np.testing.assert_allclose(back, ned, atol=6e-9)
    assert earth.geodetic_from_ned([100.0, 0, 0], origin)[0] > origin[0]
    assert earth.geodetic_from_ned([0, 100.0, 0], origin)[1] > origin[1]
    assert earth.geodetic_from_ned([0, 0, 100.0], origin)[2] == pytest.approx(420.0, abs=1e-8)
    # the earth falls away from the plane by s² / 2R: 8 cm at 1 km
    fall = earth.geodetic_from_ned([0, 1000.0, 0], origin)[2] - origin[2]
    assert fall == pytest.approx(1000.0**2 / (2 * earth.radii(origin[0])[1]), rel=1e-3)


def test_each_point_may_have_its_own_origin() -> None:
    origins = places(5)[:5]
    lever = np.tile([1.0, -2.0, 0.5], (5, 1))
    moved = earth.geodetic_from_ned(lever, origins)
    north, east = earth.metres_per_radian(origins)
    np.testing.assert_allclose((moved - origins)[:, 0] * north, 1.0, atol=2e-6)
    np.testing.assert_allclose((moved - origins)[:, 1] * east, -2.0, atol=2e-5)
    np.testing.assert_allclose((moved - origins)[:, 2], -0.5, atol=2e-6)


def test_meridian_arc() -> None:
    latitude = np.linspace(0, pi / 2, 20001)
    meridian, _ = earth.radii(latitude)
    quarter = np.sum(0.5 * (meridian[1:] + meridian[:-1])) * (latitude[1] - latitude[0])
    assert quarter == pytest.approx(10001965.729, abs=0.01)  # published meridian quadrant
    assert cos(latitude[-1]) < 1e-15


def test_wrong_shapes_are_refused() -> None:
    for function in (earth.ecef_from_geodetic, earth.geodetic_from_ecef, earth.metres_per_radian):
        with pytest.raises(InputError, match=r"\(\.\.\., 3\)"):
            function([1.0, 2.0])
