"""Measurements whose rows carry their derivatives.

Linear functions of the sensor states (kind 5), and models of a user's own (kind 9), which were
linearised at a position and an attitude nearby.
"""

from __future__ import annotations

import math

import numpy as np

from schuler.kernels.compile import kernel
from schuler.kernels.navigation.filter_data import Filter
from schuler.kernels.navigation.geodesy import radii_of_curvature


@kernel()
def general_model(f: Filter, place: int) -> None:
    """Write residual and H of z = h(x) + noise, h near a state that it was asked at."""
    state, z = f.state, f.measurement
    matrix, sensor = f.schedule.matrices[place], state.sensor
    meridian, transverse = radii_of_curvature(math.sin(state.position[0]))
    turn = state.position[1] - z.lever[1]
    turn -= 2.0 * math.pi * math.floor(turn / (2.0 * math.pi) + 0.5)
    north = (state.position[0] - z.lever[0]) * (meridian + state.position[2])
    east = turn * (transverse + state.position[2]) * math.cos(state.position[0])
    down = z.lever[2] - state.position[2]
    # C C_there' = I - [psi x]
    d = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            total = 0.0
            for c in range(3):
                total += state.rotation[i, c] * matrix[j, c]
            d[i, j] = total
    psi0 = 0.5 * (d[1, 2] - d[2, 1])
    psi1 = 0.5 * (d[2, 0] - d[0, 2])
    psi2 = 0.5 * (d[0, 1] - d[1, 0])
    for i in range(3):
        total = -z.value[i]
        for j in range(sensor.size):
            total += matrix[i, 12 + j] * sensor[j]
            z.design[i, 9 + j] = -matrix[i, 12 + j]
        for j in range(3):
            total += matrix[i, 6 + j] * state.velocity[j]
        total += matrix[i, 3] * north + matrix[i, 4] * east + matrix[i, 5] * down
        total += matrix[i, 9] * psi0 + matrix[i, 10] * psi1 + matrix[i, 11] * psi2
        z.residual[i] = total
        for j in range(9):
            z.design[i, j] = matrix[i, 3 + j]
