"""What ties two IMUs on one body: zero for the truth, and derivatives by finite differences.

Spec 7.6 and 11 (S002 (10), (11)); the truth is built without the kernel, from the motion of one
body in an earth-fixed frame.
"""

from __future__ import annotations

import numpy as np
import pytest

from schuler import earth
from schuler.kernels.navigation.constraint import constraint_model
from schuler.kernels.navigation.stacked_data import StackState, Tie
from schuler.kernels.navigation.strapdown import rotation_from_quaternion
from schuler.kernels.navigation.update import feed_back
from schuler.rotations import (
    dcm_from_euler,
    dcm_from_rotation_vector,
    quaternion_from_dcm,
)

Array = np.ndarray
BODY_RATE = np.array([0.7, -0.4, 0.9])


class Pair:
    """Two IMUs on one turning body, in the state that the kernel takes."""

    def __init__(self) -> None:
        self.arm = np.array([0.08, -0.05, 0.03])
        self.relative = dcm_from_euler(0.4, -0.7, 2.0)
        c1 = dcm_from_euler(0.3, -0.2, 2.5)
        r1 = np.array([0.8, 0.13, 400.0])
        v1 = np.array([12.0, -5.0, 0.7])
        # rate of n against i, and the gyros of IMU 1
        rate_n = np.array([5.2e-5, 1.1e-5, -4.9e-5])
        self.frame_rate = rate_n
        self.gyro = BODY_RATE + c1.T @ rate_n
        shift = c1 @ self.arm
        c2 = c1 @ self.relative.T
        r2 = earth.geodetic_from_ned(shift, r1)
        v2 = v1 + c1 @ np.cross(BODY_RATE, self.arm)
        self.poses = [[r1, v1, c1], [r2, v2, c2]]

    def residual(self) -> tuple[Array, Array, Array, Array, Array]:
        state, tie = StackState.empty(2, 24, (0, 1)), Tie.empty()
        for i, (r, v, c) in enumerate(self.poses):
            state.position[i], state.velocity[i], state.rotation[i] = r, v, c
        state.relative[1], state.arm[1], state.earth[0, 3:6] = (
            self.relative, self.arm, self.frame_rate,
        )  # fmt: skip
        rate = self.gyro - state.rotation[0].T @ self.frame_rate
        constraint_model(state, 1, rate, tie)
        return tie.residual, tie.by_first, tie.by_second, tie.by_relative, tie.by_gyro

    def disturb(self, which: int, error: Array) -> None:
        """Make a computed pose wrong by an error of spec 7.2 (computed minus true)."""
        r, v, c = self.poses[which]
        position, velocity = r.copy(), v.copy()
        quaternion, rotation = np.ascontiguousarray(quaternion_from_dcm(c)), np.empty((3, 3))
        rotation_from_quaternion(quaternion, rotation)
        feed_back(-error, position, velocity, quaternion, rotation, np.empty(0))
        self.poses[which] = [position, velocity, rotation]


def test_the_truth_fits_exactly() -> None:
    residual = Pair().residual()[0]
    assert np.abs(residual[:3]).max() < 1e-12
    # a latitude in rad has a resolution of a nanometre
    assert np.abs(residual[3:6]).max() < 5e-9
    assert np.abs(residual[6:]).max() < 1e-12


@pytest.mark.parametrize("which", [0, 1])
def test_derivatives_by_the_navigation_errors(which: int) -> None:
    jacobian = Pair().residual()[1 + which]
    for j in range(9):
        step = np.zeros(9)
        step[j] = 1e-2 if j < 3 else 1e-5
        up, down = Pair(), Pair()
        up.disturb(which, step)
        down.disturb(which, -step)
        slope = (up.residual()[0] - down.residual()[0]) / (2.0 * step[j])
        np.testing.assert_allclose(jacobian[:, j], slope, atol=1e-6)


def test_derivatives_by_the_relative_pose_and_the_gyros() -> None:
    _, _, _, by_relative, by_gyro = Pair().residual()
    for j in range(6):
        ends = []
        for sign in (1.0, -1.0):
            pair, h = Pair(), np.zeros(3)
            h[j % 3] = sign * 1e-5
            if j < 3:
                pair.relative = dcm_from_rotation_vector(-h) @ Pair().relative
            else:
                pair.arm = pair.arm + h
            ends.append(pair.residual()[0])
        np.testing.assert_allclose(by_relative[:, j], (ends[0] - ends[1]) / 2e-5, atol=1e-6)
    for j in range(3):
        ends = []
        for sign in (1.0, -1.0):
            pair = Pair()
            # a bias that is still in the gyros
            pair.gyro = pair.gyro + sign * 1e-5 * np.eye(3)[j]
            ends.append(pair.residual()[0][6:])
        np.testing.assert_allclose(by_gyro[:, j], (ends[0] - ends[1]) / 2e-5, atol=1e-6)


def test_the_order_that_is_printed_does_not_fit() -> None:
    # S002 (11) writes C_1 = C_12 C_2; E-002-6
    (_, _, c1), (_, _, c2) = Pair().poses
    assert np.abs(Pair().relative @ c2 - c1).max() > 0.5
    assert np.abs(c2 @ Pair().relative - c1).max() < 1e-12
