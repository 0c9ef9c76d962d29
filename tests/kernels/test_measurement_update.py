"""Measurement models by finite differences, the update against the textbook formula."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from schuler import earth
from schuler.kernels.navigation.update import (
    feed_back,
    innovation_statistics,
    measurement_model,
    scalar_update,
)
from schuler.rotations import (
    dcm_from_euler,
    dcm_from_rotation_vector,
    quaternion_from_dcm,
    rotation_vector_from_dcm,
)

Array = NDArray[np.float64]

POSITION = np.array([-0.6, 3.1, 150.0])
VELOCITY = np.array([12.0, -7.0, 1.5])
ROTATION = dcm_from_euler(-0.5, 0.4, 1.3)
# rates as of a motorcycle and an arm as of a ship: nothing is small
RATE = np.array([0.8, -0.6, 1.1])
LEVER = np.array([4.0, -2.5, -3.0])
# accel_x, gyro_x, gyro_z, and two states that show along a direction of their own
CHANNEL = np.array([0, 3, 5, 4, 2], dtype=np.int64)
DIRECTION = np.array([[np.nan] * 3, [np.nan] * 3, [np.nan] * 3, [0.2, 0.9, -0.3], [0.1, 0.2, 0.9]])


@dataclass(frozen=True, eq=False)
class State:
    position: Array
    velocity: Array
    rotation: Array
    rate: Array


def erroneous(error: Array) -> State:
    """The state of a filter whose errors are `error` (14,), by the conventions of spec 0."""
    north, east = earth.metres_per_radian(POSITION)
    rate = RATE.copy()
    rate[0] += error[10]
    rate[2] += error[11]
    rate += DIRECTION[3] * error[12]
    return State(
        POSITION + np.array([error[0] / north, error[1] / east, -error[2]]),
        VELOCITY + error[3:6],
        dcm_from_rotation_vector(-error[6:9]) @ ROTATION,
        rate,
    )


def model(kind: int, state: State, value: Array) -> tuple[Array, Array]:
    residual, design = np.empty(3), np.empty((3, 14))
    measurement_model(
        kind,
        value,
        LEVER,
        state.position,
        state.velocity,
        state.rotation,
        state.rate,
        CHANNEL,
        DIRECTION,
        residual,
        design,
    )
    return residual, design


def true_antenna(kind: int) -> Array:
    if kind == 0:
        return earth.geodetic_from_ned(ROTATION @ LEVER, POSITION)
    return VELOCITY + ROTATION @ np.cross(RATE, LEVER)


@pytest.mark.parametrize("kind", [0, 1], ids=["position", "velocity"])
def test_residual_is_predicted_minus_measured(kind: int) -> None:
    residual, _ = model(kind, erroneous(np.zeros(14)), true_antenna(kind))
    np.testing.assert_allclose(residual, 0.0, atol=2e-5)  # flat earth over an arm of 5 m
    moved = np.zeros(14)
    moved[3 * kind : 3 * kind + 3] = [2.0, -1.0, 0.5]
    residual, _ = model(kind, erroneous(moved), true_antenna(kind))
    np.testing.assert_allclose(residual, [2.0, -1.0, 0.5], atol=3e-5)


@pytest.mark.parametrize("kind", [0, 1], ids=["position", "velocity"])
def test_design_matrix_is_the_derivative_of_the_residual(kind: int) -> None:
    value = true_antenna(kind)
    _, design = model(kind, erroneous(np.zeros(14)), value)
    numerical = np.empty((3, 14))
    for j in range(14):
        step = np.zeros(14)
        step[j] = 10.0 if j < 3 else 1e-4
        up, _ = model(kind, erroneous(step), value)
        down, _ = model(kind, erroneous(-step), value)
        numerical[:, j] = (up - down) / (2.0 * step[j])
    np.testing.assert_allclose(design, numerical, atol=3e-6)
    # the gyro columns of spec 7.2, -C [l x], are there and large
    gyro = np.abs(design[:, [10, 11, 12]]).max()
    assert gyro > 1.0 if kind == 1 else gyro == 0.0
    assert not design[:, [9, 13]].any()


def test_a_fix_across_the_date_line_is_near() -> None:
    state = State(np.array([0.2, np.pi - 1e-7, 10.0]), VELOCITY, np.eye(3), RATE)
    residual, _ = model(0, state, np.array([0.2, -np.pi + 1e-7, 10.0]))
    arm = LEVER
    wanted = -2e-7 * (float(earth.radii(0.2)[1]) + 10.0) * np.cos(0.2)
    assert residual[1] - arm[1] == pytest.approx(wanted, rel=1e-6)


def random_case(rng: np.random.Generator) -> tuple[Array, Array, Array, Array]:
    root = rng.standard_normal((14, 14)) * np.geomspace(1e-3, 3.0, 14)[:, None]
    return (
        root @ root.T,
        rng.standard_normal((3, 14)),
        rng.standard_normal(3),
        np.array([0.3, 0.02, 1.7]),
    )


@pytest.mark.parametrize("missing", [(), (1,), (0, 2)])
def test_scalar_updates_are_the_textbook_update(missing: tuple[int, ...]) -> None:
    covariance, design, residual, variance = random_case(np.random.default_rng(5))
    variance[list(missing)] = np.inf
    used = np.isfinite(variance)
    h, r, z = design[used], np.diag(variance[used]), residual[used]
    s = h @ covariance @ h.T + r
    gain = covariance @ h.T @ np.linalg.inv(s)
    wanted_error = gain @ z
    joseph = np.eye(14) - gain @ h
    wanted = joseph @ covariance @ joseph.T + gain @ r @ gain.T

    deviation = np.empty(3)
    nis, log_determinant, degrees = innovation_statistics(
        residual, design, variance, covariance, deviation
    )
    assert degrees == used.sum()
    assert nis == pytest.approx(z @ np.linalg.solve(s, z), rel=1e-11)
    assert log_determinant == pytest.approx(np.linalg.slogdet(s)[1], rel=1e-11)
    np.testing.assert_allclose(deviation[used], np.sqrt(np.diag(s)), rtol=1e-12)
    assert np.isnan(deviation[~used]).all()

    found, error, work = covariance.copy(), np.zeros(14), np.empty(14)
    density = 0.0
    for i in np.flatnonzero(used):
        innovation = residual[i] - design[i] @ error
        s_i = scalar_update(innovation, design[i], variance[i], found, error, work)
        density += innovation**2 / s_i
    np.testing.assert_allclose(error, wanted_error, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found, wanted, rtol=1e-8, atol=1e-11)
    np.testing.assert_array_equal(found, found.T)
    # the scalar innovations carry the whole of the NIS
    assert density == pytest.approx(nis, rel=1e-10)


def test_feeding_back_the_exact_error_restores_the_truth() -> None:
    error = np.array([3.0, -2.0, 1.0, 0.3, -0.2, 0.1, 0.02, -0.03, 0.05, 1, 2, 3, 4, 5])
    state = erroneous(error)
    quaternion = np.array(quaternion_from_dcm(state.rotation))
    rotation = np.array(state.rotation)
    sensor = np.array([0.5, 0.5, 0.5, 0.5, 0.5])
    feed_back(error, state.position, state.velocity, quaternion, rotation, sensor)
    north, east = earth.metres_per_radian(POSITION)
    left = (state.position - POSITION) * np.array([north, east, 1.0])
    np.testing.assert_allclose(left, 0.0, atol=1e-5)
    np.testing.assert_allclose(state.velocity, VELOCITY, atol=1e-12)
    np.testing.assert_allclose(rotation_vector_from_dcm(rotation @ ROTATION.T), 0.0, atol=1e-12)
    # a bias state is true minus already subtracted: the estimate grows by it
    np.testing.assert_allclose(sensor, 0.5 + error[9:])
