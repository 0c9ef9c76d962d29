"""Measurements of attitude: a heading, and the earth's magnetic field in three axes.

The kinds of measurement that follow those of kernels/navigation/vehicle.py and the linear one:

    6  heading of a direction of the body (two antennas, a compass)
    7  magnetic field in body axes
    8  height (kernels/navigation/update.py, the down component of a position)

With C = C_nb and psi the attitude error, C_computed = (I - [psi x]) C: a direction d = C u that is
computed is off by -psi x d, and a field seen in the body, C' m, by C' (psi x m). Groves, 2nd ed.,
sections 6.1.1 (magnetic heading) and 14.4.3 (GNSS attitude).
"""

from __future__ import annotations

import math

from schuler.kernels.compile import kernel
from schuler.kernels.navigation.update import clear
from schuler.kernels.types import FloatArray


@kernel()
def heading_model(
    value: FloatArray,
    baseline: FloatArray,
    rotation: FloatArray,
    residual: FloatArray,
    design: FloatArray,
) -> None:
    """Write residual (3,) and H (3, n) of the heading of a direction of the body.

    value[0]: heading from true north, rad; `baseline` (3,): the direction in body axes. Only the
    first component is used; a direction that points straight up or down has no heading and gives
    no information.
    """
    clear(design)
    for i in range(3):
        residual[i] = 0.0
    d0 = rotation[0, 0] * baseline[0] + rotation[0, 1] * baseline[1] + rotation[0, 2] * baseline[2]
    d1 = rotation[1, 0] * baseline[0] + rotation[1, 1] * baseline[1] + rotation[1, 2] * baseline[2]
    d2 = rotation[2, 0] * baseline[0] + rotation[2, 1] * baseline[1] + rotation[2, 2] * baseline[2]
    square = d0 * d0 + d1 * d1
    if square < 1e-6 * (square + d2 * d2):
        return
    off = math.atan2(d1, d0) - value[0]
    residual[0] = off - 2.0 * math.pi * math.floor(off / (2.0 * math.pi) + 0.5)
    # (d0 (-psi x d)_1 - d1 (-psi x d)_0) / (d0^2 + d1^2)
    design[0, 6] = d0 * d2 / square
    design[0, 7] = d1 * d2 / square
    design[0, 8] = -1.0


@kernel()
def magnetic_model(
    value: FloatArray,
    field: FloatArray,
    rotation: FloatArray,
    residual: FloatArray,
    design: FloatArray,
) -> None:
    """Write residual (3,) and H (3, n) of the magnetic field in body axes.

    value (3,): as measured, the sensor's own offset (hard iron) being an error that adds to it;
    `field` (3,): of the earth in north, east, down, in the same unit.
    """
    clear(design)
    m0, m1, m2 = field[0], field[1], field[2]
    for i in range(3):
        a, b, c = rotation[0, i], rotation[1, i], rotation[2, i]
        residual[i] = a * m0 + b * m1 + c * m2 - value[i]
        # row i of C' times psi x m
        design[i, 6] = c * m1 - b * m2
        design[i, 7] = a * m2 - c * m0
        design[i, 8] = b * m0 - a * m1
