"""Two IMUs on one rigid body: what ties their navigation solutions together.

S002 (11) in its right form (spec 7.6, E-002-6). With a the place of IMU 2 from IMU 1 in the axes
of IMU 1, C_12 the rotation from the axes of IMU 1 into those of IMU 2, and w the rate of the
body against n in the axes of IMU 1:

    C_1 = C_2 C_12      r_1 = r_2 - C_1 a      v_1 = v_2 - C_1 (w x a)

The residuals are zero for the truth. Errors are computed minus true; that of C_12 is defined as
the attitude's: computed C_12 = (I - [eps x]) C_12.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.compile import kernel
from schuler.kernels.navigation.geodesy import radii_of_curvature
from schuler.kernels.navigation.stacked_data import StackState, Tie
from schuler.kernels.navigation.update import clear

Array = NDArray[np.float64]


@kernel(inline=True)
def write_skew(matrix: Array, row: int, column: int, x: float, y: float, z: float) -> None:
    """Write [(x, y, z) x] into a 3 by 3 part of a matrix."""
    matrix[row, column] = 0.0
    matrix[row, column + 1] = -z
    matrix[row, column + 2] = y
    matrix[row + 1, column] = z
    matrix[row + 1, column + 1] = 0.0
    matrix[row + 1, column + 2] = -x
    matrix[row + 2, column] = -y
    matrix[row + 2, column + 1] = x
    matrix[row + 2, column + 2] = 0.0


@kernel()
def rotation_residual(first: Array, second: Array, relative: Array, residual: Array) -> None:
    """Rotation vector of C_1 (C_2 C_12)', into residual (3,). Spec 7.6."""
    difference = np.zeros((3, 3))
    for i in range(3):
        for j in range(3):
            for a in range(3):
                product = 0.0
                for b in range(3):
                    product += second[j, b] * relative[b, a]
                difference[i, j] += first[i, a] * product
    x = 0.5 * (difference[2, 1] - difference[1, 2])
    y = 0.5 * (difference[0, 2] - difference[2, 0])
    z = 0.5 * (difference[1, 0] - difference[0, 1])
    sine = math.sqrt(x * x + y * y + z * z)
    cosine = 0.5 * (difference[0, 0] + difference[1, 1] + difference[2, 2] - 1.0)
    # solutions of one body never part by anything near half a turn
    scale = math.atan2(sine, cosine) / sine if sine > 1e-9 else 1.0
    residual[0], residual[1], residual[2] = scale * x, scale * y, scale * z


@kernel()
def constraint_model(state: StackState, second: int, body_rate: Array, tie: Tie) -> None:
    """Residuals and Jacobians of the first IMU and another. Spec 7.6.

    `body_rate` (3,): of the body against n, in the axes of the first.
    """
    position_1, velocity_1, rotation_1 = state.position[0], state.velocity[0], state.rotation[0]
    position_2, velocity_2 = state.position[second], state.velocity[second]
    rotation_2, frame_rate = state.rotation[second], state.earth[0, 3:6]
    relative, arm = state.relative[second], state.arm[second]
    residual, by_gyro = tie.residual, tie.by_gyro
    by_first, by_second, by_relative = tie.by_first, tie.by_second, tie.by_relative
    clear(by_first)
    clear(by_second)
    clear(by_relative)
    rotation_residual(rotation_1, rotation_2, relative, residual)
    for i in range(3):
        by_first[i, 6 + i] = -1.0
        by_second[i, 6 + i] = 1.0
        by_first[3 + i, i] = 1.0
        by_second[3 + i, i] = -1.0
        by_first[6 + i, 3 + i] = 1.0
        by_second[6 + i, 3 + i] = -1.0
        for j in range(3):
            by_relative[i, j] = rotation_2[i, j]
            by_relative[3 + i, 3 + j] = rotation_1[i, j]
    w0, w1, w2 = body_rate[0], body_rate[1], body_rate[2]
    a0, a1, a2 = arm[0], arm[1], arm[2]
    u0, u1, u2 = w1 * a2 - w2 * a1, w2 * a0 - w0 * a2, w0 * a1 - w1 * a0
    p, q = np.empty(3), np.empty(3)
    for i in range(3):
        p[i] = rotation_1[i, 0] * a0 + rotation_1[i, 1] * a1 + rotation_1[i, 2] * a2
        q[i] = rotation_1[i, 0] * u0 + rotation_1[i, 1] * u1 + rotation_1[i, 2] * u2
        # C_1 [w x] and -C_1 [a x]
        c0, c1, c2 = rotation_1[i, 0], rotation_1[i, 1], rotation_1[i, 2]
        by_relative[6 + i, 3] = c1 * w2 - c2 * w1
        by_relative[6 + i, 4] = c2 * w0 - c0 * w2
        by_relative[6 + i, 5] = c0 * w1 - c1 * w0
        by_gyro[i, 0] = -(c1 * a2 - c2 * a1)
        by_gyro[i, 1] = -(c2 * a0 - c0 * a2)
        by_gyro[i, 2] = -(c0 * a1 - c1 * a0)
    write_skew(by_first, 3, 6, p[0], p[1], p[2])
    write_skew(by_first, 6, 6, q[0], q[1], q[2])
    # w has the rate of n taken off with a computed attitude: -[C_1 a x] [w_in x] psi
    along = p[0] * frame_rate[0] + p[1] * frame_rate[1] + p[2] * frame_rate[2]
    for i in range(3):
        by_first[6 + i, 6 + i] += along
        for j in range(3):
            by_first[6 + i, 6 + j] -= frame_rate[i] * p[j]
    meridian, transverse = radii_of_curvature(math.sin(position_2[0]))
    residual[3] = (position_1[0] - position_2[0]) * (meridian + position_2[2]) + p[0]
    cosine = math.cos(position_2[0])
    turn = position_1[1] - position_2[1]
    turn -= 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
    residual[4] = turn * (transverse + position_2[2]) * cosine + p[1]
    residual[5] = position_2[2] - position_1[2] + p[2]
    for i in range(3):
        residual[6 + i] = velocity_1[i] - velocity_2[i] + q[i]
