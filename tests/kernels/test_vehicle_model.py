"""Constraints of a vehicle: what they measure, and their Jacobians by finite differences."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.typing import NDArray

from schuler.kernels.navigation.filter_data import (
    FilterState,
    Measurement,
    Rules,
    SensorModel,
    Work,
)
from schuler.kernels.navigation.vehicle import (
    vehicle_velocity_model,
    zero_rate_model,
    zero_velocity_model,
)
from schuler.rotations import dcm_from_euler, dcm_from_rotation_vector

Array = NDArray[np.float64]

VELOCITY = np.array([12.0, -7.0, 1.5])
ROTATION = dcm_from_euler(-0.5, 0.4, 1.3)
RATE = np.array([0.8, -0.6, 1.1])
FORCE = np.array([1.5, -4.0, -8.0])
GRAVITY = np.array([0.0, 0.0, 9.8])
NOMINAL = dcm_from_euler(*np.radians([-14.0, -60.0, -163.0]))
# accel_x, gyro_x, gyro_z, a gyro state and an accelerometer state along directions of their own,
# then the vehicle's eight; nothing is small
CHANNEL = np.array([0, 3, 5, 4, 2] + [0] * 8, dtype=np.int64)
DIRECTION = np.concatenate(
    [np.full((3, 3), np.nan), [[0.2, 0.9, -0.3], [0.1, 0.2, 0.9]], np.zeros((8, 3))]
)
FIRST = 5
STATES = np.array([0.1, 0.2, -0.1, 0.3, 0.1, 0.06, -0.04, 0.05, -1.3, 0.4, 0.7, 0.03, -0.02])
SIZE = 9 + CHANNEL.size
VALUE = np.array([0.0, 0.2, -0.1])


@dataclass(frozen=True, eq=False)
class Case:
    """What the filter believes when its errors are `error` (22,), by the conventions of spec 0."""

    error: Array = field(default_factory=lambda: np.zeros(SIZE))
    by_rate: Array = field(default_factory=lambda: np.empty((3, 3)))

    @property
    def rotation(self) -> Array:
        return dcm_from_rotation_vector(-self.error[6:9]) @ ROTATION

    @property
    def rate(self) -> Array:
        # sensor states are true minus estimated: what was not taken off is still in the rate
        left: Array = (
            np.array([self.error[10], 0.0, self.error[11]]) + DIRECTION[3] * self.error[12]
        )
        left += RATE
        return left

    def velocity(self) -> tuple[Array, Array]:
        v = View(self.rotation, VELOCITY + self.error[3:6], STATES - self.error[9:])
        found = v.velocity(VALUE, self.rate, FORCE + self.rotation.T @ GRAVITY)
        self.by_rate[:] = v.work.vehicle.by_rate
        return found

    def standstill(self, kind: int) -> tuple[Array, Array]:
        v = View(self.rotation, VELOCITY + self.error[3:6], STATES - self.error[9:])
        v.z.body_rate[:] = self.rate
        if kind == 3:
            zero_velocity_model(v.state, v.z)
        else:
            zero_rate_model(v.state, v.model, v.work, v.z)
        return v.z.residual, v.z.design


class View:
    """What the kernels are told: a state, and the sensors above."""

    def __init__(self, rotation: Array, velocity: Array, states: Array) -> None:
        m = CHANNEL.size
        self.model = SensorModel(
            channel=CHANNEL,
            direction=DIRECTION,
            scaled_by=np.full(m, -1),
            block=np.column_stack([np.arange(m), np.ones(m, dtype=np.int64)]),
            interval=np.zeros(m),
            drift=np.zeros((m, 1)),
            diffusion=np.zeros((m, 1)),
            white=np.zeros((2, 3, 3)),
            discrete=False,
            modulated=False,
        )
        self.rules = Rules(np.full(4, np.inf), np.zeros(9), 4, FIRST, NOMINAL, 1.0, 0.2, 0.05, 0.25)
        self.state, self.work = FilterState.empty(m, 1, False), Work.of(self.model)
        self.z = Measurement.empty(SIZE)
        self.z.design[:] = np.nan
        self.state.rotation[:], self.state.velocity[:] = rotation, velocity
        self.state.sensor[:] = states

    def velocity(self, value: Array, rate: Array, acceleration: Array) -> tuple[Array, Array]:
        seen = self.work.vehicle
        self.z.value[:], seen.rate[:], seen.acceleration[:] = value, rate, acceleration
        vehicle_velocity_model(self.state, self.model, self.rules, self.work, self.z)
        return self.z.residual, self.z.design


def derivative(kind: int) -> Array:
    numerical = np.empty((3, SIZE))
    for j in range(SIZE):
        step = np.zeros(SIZE)
        step[j] = 1e-5
        up = Case(step).velocity()[0] if kind == 2 else Case(step).standstill(kind)[0]
        down = Case(-step).velocity()[0] if kind == 2 else Case(-step).standstill(kind)[0]
        numerical[:, j] = (up - down) / 2e-5
    return numerical


def test_the_velocity_in_vehicle_axes_is_that_of_rigid_motion() -> None:
    residual, _ = Case().velocity()
    mount = dcm_from_rotation_vector(STATES[5:8]) @ NOMINAL
    u = mount @ ROTATION.T @ VELOCITY + np.cross(mount @ RATE, STATES[8:11])
    turn = (mount @ RATE)[2]
    ahead = (mount @ (FORCE + ROTATION.T @ GRAVITY))[0]
    u[1] += STATES[11] * turn * u[0] ** 2
    u[2] += STATES[12] * ahead * u[0]
    np.testing.assert_allclose(residual, u - VALUE, atol=1e-8)


def test_a_car_that_drives_along_its_axis_shows_nothing_across() -> None:
    # forward from the mounting alone, rear axle under the IMU, no slip
    states = np.zeros(13)
    velocity = ROTATION @ NOMINAL.T @ np.array([15.0, 0.0, 0.0])
    zero = np.zeros(3)
    residual, _ = View(ROTATION, velocity, states).velocity(zero, RATE, zero)
    np.testing.assert_allclose(residual, [15.0, 0.0, 0.0], atol=1e-12)
    # an IMU believed to point 0.01 rad to the right of the car sees it slide to the left
    states[7] = 0.01
    residual, _ = View(ROTATION, velocity, states).velocity(zero, RATE, zero)
    assert residual[1] == pytest.approx(0.15, rel=1e-3)


def test_design_of_the_vehicle_velocity_is_the_derivative_of_the_residual() -> None:
    _, design = Case().velocity()
    np.testing.assert_allclose(design, derivative(2), atol=1e-7)
    # every kind of state shows: attitude, gyros, mounting, axle, slip and springs
    for columns in ([3, 4, 5], [6, 7, 8], [10, 11, 12], [14, 15, 16], [17, 18, 19], [20], [21]):
        assert np.abs(design[1:, columns]).max() > 0.1
    # and what the gyros do shows as their states do
    case = Case()
    case.velocity()
    np.testing.assert_allclose(case.by_rate @ DIRECTION[3], design[:, 12], atol=1e-12)
    # position and accelerometers do not
    assert not design[:, [0, 1, 2, 9, 13]].any()


@pytest.mark.parametrize("kind", [3, 4], ids=["velocity", "rate"])
def test_design_of_a_standstill_is_the_derivative_of_the_residual(kind: int) -> None:
    residual, design = Case().standstill(kind)
    np.testing.assert_allclose(residual, VELOCITY if kind == 3 else ROTATION @ RATE)
    np.testing.assert_allclose(design, derivative(kind), atol=1e-8)
    shown = np.flatnonzero(design.any(axis=0)).tolist()
    assert shown == ([3, 4, 5] if kind == 3 else [6, 7, 8, 10, 11, 12])
