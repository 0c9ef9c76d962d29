"""Rotations: conventions written out, and identities at identity, tiny, random and near pi."""

from __future__ import annotations

from math import cos, pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from schuler import rotations as rot
from schuler.errors import EstimationError, InputError

angle = st.floats(-pi, pi)
length = st.one_of(
    st.just(0.0),
    st.floats(1e-12, 1e-6),
    st.floats(1e-3, pi - 1e-3),
    st.floats(1e-12, 1e-6).map(lambda d: pi - d),
)


@st.composite
def rotation_vectors(draw: st.DrawFn) -> np.ndarray:
    azimuth, elevation = draw(angle), draw(st.floats(-pi / 2, pi / 2))
    axis = [cos(elevation) * cos(azimuth), cos(elevation) * sin(azimuth), sin(elevation)]
    return draw(length) * np.array(axis)


def assert_rotation(c: np.ndarray) -> None:
    np.testing.assert_allclose(c @ np.swapaxes(c, -1, -2), np.broadcast_to(np.eye(3), c.shape),
                               atol=4e-15)  # fmt: skip
    np.testing.assert_allclose(np.linalg.det(c), 1.0, atol=4e-15)


def test_euler_matrix_is_that_of_the_paper() -> None:
    phi, theta, psi = 0.3, -0.5, 2.1
    s, c = sin, cos
    paper = np.array(
        [
            [
                c(theta) * c(psi),
                -c(phi) * s(psi) + s(phi) * s(theta) * c(psi),
                s(phi) * s(psi) + c(phi) * s(theta) * c(psi),
            ],
            [
                c(theta) * s(psi),
                c(phi) * c(psi) + s(phi) * s(theta) * s(psi),
                -s(phi) * c(psi) + c(phi) * s(theta) * s(psi),
            ],
            [-s(theta), s(phi) * c(theta), c(phi) * c(theta)],
        ]
    )
    np.testing.assert_allclose(rot.dcm_from_euler(phi, theta, psi), paper, atol=1e-15)


def test_euler_matrix_is_yaw_then_pitch_then_roll() -> None:
    z, y, x = (rot.dcm_from_rotation_vector(v) for v in ([0, 0, 2.1], [0, -0.5, 0], [0.3, 0, 0]))
    np.testing.assert_allclose(rot.dcm_from_euler(0.3, -0.5, 2.1), z @ y @ x, atol=1e-15)


def test_a_car_that_heads_east_goes_east_and_a_raised_nose_goes_up() -> None:
    forward = np.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(rot.dcm_from_euler(0, 0, pi / 2) @ forward, [0, 1, 0], atol=1e-15)
    assert (rot.dcm_from_euler(0, 0.1, 0) @ forward)[2] == pytest.approx(-sin(0.1))
    right = np.array([0.0, 1.0, 0.0])
    assert (rot.dcm_from_euler(0.1, 0, 0) @ right)[2] == pytest.approx(sin(0.1))


@given(angle, st.floats(-pi / 2, pi / 2), angle)
def test_euler_angles_give_the_matrix_back(roll: float, pitch: float, yaw: float) -> None:
    c = rot.dcm_from_euler(roll, pitch, yaw)
    assert_rotation(c)
    np.testing.assert_allclose(rot.dcm_from_euler(*rot.euler_from_dcm(c)), c, atol=2e-15)


@given(st.floats(-3.1, 3.1), st.floats(-1.5, 1.5), st.floats(-3.1, 3.1))
def test_euler_angles_come_back(roll: float, pitch: float, yaw: float) -> None:
    back = rot.euler_from_dcm(rot.dcm_from_euler(roll, pitch, yaw))
    np.testing.assert_allclose(np.array(back), [roll, pitch, yaw], atol=2e-14)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("short_of", [0.0, 1e-13, 1e-10, 1e-7])
def test_gimbal_lock_keeps_the_rotation(sign: float, short_of: float) -> None:
    c = rot.dcm_from_euler(0.4, sign * (pi / 2 - short_of), 1.3)
    roll, pitch, yaw = rot.euler_from_dcm(c)
    np.testing.assert_allclose(rot.dcm_from_euler(roll, pitch, yaw), c, atol=3e-13)
    if short_of == 0.0:
        assert roll == 0.0
        assert yaw == pytest.approx(1.3 - sign * 0.4, abs=1e-12)


@given(rotation_vectors())
def test_matrix_quaternion_and_vector_agree(p: np.ndarray) -> None:
    c = rot.dcm_from_rotation_vector(p)
    assert_rotation(c)
    q = rot.quaternion_from_dcm(c)
    np.testing.assert_allclose(np.linalg.norm(q), 1.0, atol=1e-15)
    # scalar part last there
    np.testing.assert_allclose(Rotation.from_quat(np.roll(q, -1)).as_matrix(), c, atol=3e-15)
    back = rot.rotation_vector_from_dcm(c)
    scale = np.linalg.norm(p)
    if scale < 1.0:  # tiny rotations keep their leading digits, not only their absolute error
        np.testing.assert_allclose(back, p, rtol=0, atol=1e-15 + 1e-15 * scale)
    np.testing.assert_allclose(rot.dcm_from_rotation_vector(back), c, atol=1e-14)


def test_tiny_quaternions_keep_all_digits() -> None:
    p = np.array([1e-170, -3e-20, 2e-20])
    q = np.array([1.0, *(0.5 * p)])
    np.testing.assert_allclose(rot.rotation_vector_from_quaternion(q), p, rtol=1e-15)


def test_rotation_is_the_exponential_of_its_skew_matrix() -> None:
    from scipy.linalg import expm

    rng = np.random.default_rng(1)
    p = rng.normal(size=(20, 3)) * rng.uniform(0, 4, size=(20, 1))
    expected = np.stack([expm(rot.skew(v)) for v in p])
    np.testing.assert_allclose(rot.dcm_from_rotation_vector(p), expected, atol=1e-13)


def test_half_turn_about_every_axis() -> None:
    for axis in np.eye(3):
        c = 2.0 * np.outer(axis, axis) - np.eye(3)
        p = rot.rotation_vector_from_dcm(c)
        np.testing.assert_allclose(np.abs(p), pi * axis, atol=1e-15)


def test_hamilton_not_jpl() -> None:
    # a quarter turn about z takes x into y: a quaternion of JPL would take y into x
    quarter = rot.dcm_from_rotation_vector([0.0, 0.0, pi / 2])
    np.testing.assert_allclose(quarter @ [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], atol=1e-15)
    root = np.sqrt(0.5)
    np.testing.assert_allclose(rot.quaternion_from_dcm(quarter), [root, 0, 0, root], atol=1e-15)


def test_skew_is_the_cross_product() -> None:
    a, b = np.random.default_rng(2).normal(size=(2, 5, 3))
    np.testing.assert_allclose((rot.skew(a) @ b[..., None])[..., 0], np.cross(a, b), atol=1e-15)


def test_leading_axes_are_kept_and_values_do_not_mix() -> None:
    p = np.random.default_rng(3).normal(size=(2, 4, 3))
    c = rot.dcm_from_rotation_vector(p)
    one = rot.quaternion_from_dcm(c[1, 2])
    np.testing.assert_array_equal(rot.quaternion_from_dcm(c)[1, 2], one)
    np.testing.assert_allclose(c[1, 2], rot.dcm_from_rotation_vector(p[1, 2]), atol=1e-16)
    roll, pitch, yaw = rot.euler_from_dcm(c)
    np.testing.assert_allclose(rot.dcm_from_euler(roll, pitch, yaw), c, atol=2e-15)


def test_frames_of_others() -> None:
    east, up = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
    np.testing.assert_array_equal(rot.NED_FROM_ENU @ east, [0, 1, 0])
    np.testing.assert_array_equal(rot.NED_FROM_ENU @ up, [0, 0, -1])
    left = np.array([0.0, 1.0, 0.0])
    np.testing.assert_array_equal(rot.FRD_FROM_FLU @ left, [0, -1, 0])
    for frame in (rot.NED_FROM_ENU, rot.FRD_FROM_FLU):
        assert_rotation(frame)


def test_orthonormalize_finds_the_nearest_rotation() -> None:
    rng = np.random.default_rng(4)
    noisy = rot.dcm_from_rotation_vector([0.3, -1.0, 2.0]) + 0.02 * rng.normal(size=(3, 3))
    nearest = rot.orthonormalize(noisy)
    assert_rotation(nearest)
    distance = np.linalg.norm(nearest - noisy)
    for step in 1e-4 * rng.normal(size=(30, 3)):  # no neighbour is nearer
        assert np.linalg.norm(rot.dcm_from_rotation_vector(step) @ nearest - noisy) > distance
    assert_rotation(rot.orthonormalize(np.diag([1.0, 1.0, -0.1])))  # a reflection is none


def test_wahba_recovers_a_rotation_and_its_direction() -> None:
    rng = np.random.default_rng(5)
    c_ab = rot.dcm_from_rotation_vector([0.4, 2.0, -1.0])
    b = rng.normal(size=(50, 3))
    np.testing.assert_allclose(rot.wahba(b @ c_ab.T, b), c_ab, atol=1e-14)
    np.testing.assert_allclose(rot.wahba(b[:2] @ c_ab.T, b[:2]), c_ab, atol=1e-12)


def test_wahba_error_is_that_of_theory() -> None:
    rng = np.random.default_rng(6)
    b, sd = rng.normal(size=(200, 3)), 0.01
    information = np.sum(
        np.sum(b * b, axis=1)[:, None, None] * np.eye(3) - b[:, :, None] * b[:, None, :], axis=0
    )
    claimed = np.trace(sd**2 * np.linalg.inv(information))
    errors = [
        rot.rotation_vector_from_dcm(rot.wahba(b + sd * rng.normal(size=b.shape), b))
        for _ in range(300)
    ]
    ratio = np.mean(np.sum(np.square(errors), axis=1)) / claimed
    assert 0.85 < ratio < 1.15  # 900 degrees of freedom: sd 0.047


def test_wahba_weights_silence_a_bad_vector() -> None:
    b = np.vstack([np.eye(3), [[1.0, 1.0, 0.0]]])
    a = b.copy()
    a[3] = [0.0, 0.0, 5.0]
    np.testing.assert_allclose(rot.wahba(a, b, [1, 1, 1, 0]), np.eye(3), atol=1e-15)


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(EstimationError, match="one line"):
        rot.wahba([[0, 0, 1.0], [0, 0, 2.0]], [[0, 0, 1.0], [0, 0, 2.0]])
    with pytest.raises(InputError, match="shape"):
        rot.wahba(np.eye(3), np.eye(3), [1.0])
    with pytest.raises(InputError, match=r"\(\.\.\., 3, 3\)"):
        rot.euler_from_dcm(np.eye(4))
    with pytest.raises(InputError, match=r"\(\.\.\., 3\)"):
        rot.skew([1.0, 2.0])
    with pytest.raises(InputError, match="not finite"):
        rot.orthonormalize(np.full((3, 3), np.nan))
