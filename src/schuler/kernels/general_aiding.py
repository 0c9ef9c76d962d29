"""Measurements whose rows carry their derivatives.

Linear functions of the sensor states (kind 5), and models of a user's own (kind 9), which were
linearised at a position and an attitude nearby.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.compile import kernel
from schuler.kernels.geodesy import radii_of_curvature

Array = NDArray[np.float64]


@kernel()
def general_model(
    value: Array,
    place: Array,
    matrix: Array,
    position: Array,
    velocity: Array,
    rotation: Array,
    sensor_state: Array,
    residual: Array,
    design: Array,
) -> None:
    """Write residual (3,) and H (3, n) of z = h(x) + noise, h near a state that it was asked at.

    `matrix` (3, 12 + m): attitude C_nb there, then the derivatives of h by position (m), velocity,
    attitude error and sensor states; `place` (3,) the position there; value = what h is there,
    velocities and sensor states taken as zero, less what was measured, with the sign turned. As
    sensor states are true minus estimated, their columns of H are turned. Spec 7.5.
    """
    meridian, transverse = radii_of_curvature(math.sin(position[0]))
    turn = position[1] - place[1]
    turn -= 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
    north = (position[0] - place[0]) * (meridian + position[2])
    east = turn * (transverse + position[2]) * math.cos(position[0])
    down = place[2] - position[2]
    # C C_there' = I - [psi x]
    d = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            total = 0.0
            for c in range(3):
                total += rotation[i, c] * matrix[j, c]
            d[i, j] = total
    psi0 = 0.5 * (d[1, 2] - d[2, 1])
    psi1 = 0.5 * (d[2, 0] - d[0, 2])
    psi2 = 0.5 * (d[0, 1] - d[1, 0])
    for i in range(3):
        total = -value[i]
        for j in range(sensor_state.size):
            total += matrix[i, 12 + j] * sensor_state[j]
            design[i, 9 + j] = -matrix[i, 12 + j]
        for j in range(3):
            total += matrix[i, 6 + j] * velocity[j]
        total += matrix[i, 3] * north + matrix[i, 4] * east + matrix[i, 5] * down
        total += matrix[i, 9] * psi0 + matrix[i, 10] * psi1 + matrix[i, 11] * psi2
        residual[i] = total
        for j in range(9):
            design[i, j] = matrix[i, 3 + j]
