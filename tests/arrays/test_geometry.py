"""Geometries of redundant sensors against closed forms (spec 6.1, 6.4)."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2, ncx2

from schuler.arrays.geometry import (
    Geometry,
    cone,
    cone_with_axis,
    orthogonal,
    platonic,
    tetrahedron,
    tetrahedron_mounting,
)
from schuler.arrays.merit import figures_of_merit
from schuler.arrays.optimum import optimize_cone, optimize_geometry
from schuler.errors import InputError
from schuler.rotations import dcm_from_euler


def test_any_four_triads_give_the_same_noise_and_the_tetrahedron_is_one() -> None:
    rng = np.random.default_rng(1)
    turned = dcm_from_euler(*rng.uniform(-3, 3, (3, 4)))
    for geometry in (
        tetrahedron(),
        orthogonal(4),
        Geometry.from_axes(np.swapaxes(turned, 1, 2).reshape(-1, 3), units=np.repeat(range(4), 3)),
    ):
        np.testing.assert_allclose(geometry.axes.T @ geometry.axes, 4 * np.eye(3), atol=1e-12)
        figures = figures_of_merit(geometry, 0.0194)
        # 0.0194/2 rad/s and not 0.0388: the information is not the covariance (E-002-2)
        np.testing.assert_allclose(np.sqrt(np.diag(figures.covariance)), 0.0097, rtol=1e-12)
        np.testing.assert_allclose(figures.residual_share, 0.75, atol=1e-12)


def test_faces_of_the_tetrahedron_look_apart_by_the_same_angle_and_hold_the_units() -> None:
    mounting = tetrahedron_mounting(0.05)
    normals = mounting.rotation[:, :, 2]
    np.testing.assert_allclose(
        normals @ normals.T, 4 / 3 * np.eye(4) - 1 / 3 * np.ones((4, 4)), atol=1e-12
    )
    np.testing.assert_allclose(normals[0], [0, 0, -1], atol=1e-12)
    np.testing.assert_allclose(mounting.position, 0.05 * normals, atol=1e-15)
    assert tetrahedron().names[:4] == ("1 x", "1 y", "1 z", "2 x")


@pytest.mark.parametrize("count", [4, 5, 6, 9])
def test_a_cone_is_best_and_isotropic_at_54_74_degrees(count: int) -> None:
    best = optimize_cone(count)
    assert np.degrees(best.parameters[0]) == pytest.approx(54.7356, abs=1e-3)
    assert best.figures.gdop == pytest.approx(3 / np.sqrt(count), rel=1e-9)
    assert best.figures.anisotropy == pytest.approx(1.0, abs=1e-6)
    assert best.figures.determinant == pytest.approx((count / 3) ** 3, rel=1e-6)
    # flatter is better for the horizontal plane, steeper for the vertical
    flat, steep = figures_of_merit(cone(count, 1.2)), figures_of_merit(cone(count, 0.6))
    assert flat.covariance[0, 0] < 3 / count < flat.covariance[2, 2]
    assert steep.covariance[2, 2] < 3 / count < steep.covariance[0, 0]


def test_a_cone_with_its_axis_is_isotropic_at_its_own_angle() -> None:
    for count in (3, 5, 8):
        figures = figures_of_merit(cone_with_axis(count))
        np.testing.assert_allclose(figures.covariance, 3 / (count + 1) * np.eye(3), atol=1e-12)
        found = optimize_cone(count, with_axis=True)
        np.testing.assert_allclose(found.geometry.axes, cone_with_axis(count).axes, atol=1e-4)


@pytest.mark.parametrize(
    ("solid", "count"),
    [("cube", 3), ("octahedron", 4), ("dodecahedron", 6), ("icosahedron", 10)],
)
def test_platonic_solids_are_isotropic_with_even_angles(solid: str, count: int) -> None:
    geometry = platonic(solid)
    assert geometry.count == count
    np.testing.assert_allclose(geometry.axes.T @ geometry.axes, count / 3 * np.eye(3), atol=1e-12)
    cosines = np.abs(geometry.axes @ geometry.axes.T)
    # every sensor has the same neighbours
    np.testing.assert_allclose(np.sort(cosines, axis=1), np.sort(cosines, axis=1)[[0] * count])


def test_the_minimal_detectable_bias_has_its_power() -> None:
    figures = figures_of_merit(tetrahedron(), 2.0, false_alarm_rate=0.05, power=0.661)
    # spec 6.4: power 0.661 at 4 sigma on one of 12 axes
    np.testing.assert_allclose(figures.minimal_detectable_bias / 2.0, 4.0, atol=2e-3)
    six = figures_of_merit(platonic("dodecahedron"), false_alarm_rate=0.01, power=0.9)
    bias = six.minimal_detectable_bias[0]
    assert ncx2.sf(chi2.isf(0.01, 3), 3, bias**2 * 0.5) == pytest.approx(0.9, abs=1e-9)


def test_a_noisy_sensor_counts_less_by_its_variance() -> None:
    sigma = np.ones(12)
    sigma[9:] = 5.0
    figures = figures_of_merit(tetrahedron(), 0.0194 * sigma)
    # 1/(3 + 1/25) of the variance: 0.0111, not 0.0866 as with the covariance for a weight
    np.testing.assert_allclose(np.sqrt(np.diag(figures.covariance)), 0.0194 / np.sqrt(3.04))


def test_two_aligned_triads_detect_but_do_not_isolate_and_turned_ones_do() -> None:
    figures = figures_of_merit(orthogonal(2))
    assert figures.inseparable == (("1 x", "2 x"), ("1 y", "2 y"), ("1 z", "2 z"))
    assert np.isfinite(figures.minimal_detectable_bias).all()
    assert figures.smallest_isolation_angle == pytest.approx(0.0, abs=1e-6)
    assert "not isolated between 1 x and 2 x" in figures.statements[0]
    turned = np.vstack([np.eye(3), dcm_from_euler(0.4, 0.3, 0.9).T])
    skewed = figures_of_merit(Geometry.from_axes(turned, units=[0] * 3 + [1] * 3))
    assert not skewed.inseparable and not skewed.statements
    assert figures_of_merit(orthogonal(3)).smallest_isolation_angle == pytest.approx(np.pi / 3)


def test_a_single_triad_sees_no_fault_and_a_lone_axis_none_of_its_own() -> None:
    assert "no fault can be detected" in figures_of_merit(orthogonal(1)).statements[0]
    lone = Geometry.from_axes([[1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1]])
    figures = figures_of_merit(lone)
    assert figures.minimal_detectable_bias[3] == np.inf
    assert "fault of 4 cannot be detected" in figures.statements[0]


def test_axes_in_a_plane_are_refused_with_the_direction_that_is_not_seen() -> None:
    with pytest.raises(InputError, match=r"one plane \(rank 2\).*\(0\.00, 0\.00, 1\.00\)"):
        Geometry.from_axes([[1, 0, 0], [0, 1, 0], [1, 1, 0], [1, -1, 0]])
    with pytest.raises(InputError, match="all parallel"):
        Geometry.from_axes([[1, 0, 0], [2, 0, 0], [-1, 0, 0]])
    with pytest.raises(InputError, match="one plane"):
        cone(5, np.pi / 2)
    with pytest.raises(InputError, match="at least three"):
        cone(2)


def test_the_best_of_a_users_family_is_found_within_the_constraint() -> None:
    # two triads, the second turned by any two angles: isolation wants the parity lines apart
    def build(angles: np.ndarray) -> Geometry:
        return Geometry.from_axes(np.vstack([np.eye(3), dcm_from_euler(angles[0], angles[1], 0.3)]))

    best = optimize_geometry(build, [(-1.0, 1.0), (-1.0, 1.0)], "isolation")
    grid = [build(np.array([a, b])) for a in np.linspace(-1, 1, 9) for b in np.linspace(-1, 1, 9)]
    assert best.figures.smallest_isolation_angle >= max(
        figures_of_merit(g).smallest_isolation_angle for g in grid
    )
    # a constraint that binds: not steeper than 40 degrees
    bound = optimize_cone(6, half_angles=(0.1, np.radians(40.0)))
    assert np.degrees(bound.parameters[0]) == pytest.approx(40.0, abs=1e-4)
    vertical = optimize_cone(6, criterion=lambda f: f.covariance[2, 2] + 3 * f.covariance[0, 0])
    # 1 / cos² + 6 / sin² is least where tan⁴ = 6
    assert vertical.parameters[0] == pytest.approx(np.arctan(6**0.25), abs=1e-6)
