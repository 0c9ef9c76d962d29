"""One door to all kinds of aiding measurements: what is compared, and how it depends on the state.

Kinds 0 and 1 are in kernels/update.py, what a vehicle tells (2 to 4) in kernels/vehicle.py, those
whose rows carry their derivatives (5 and 9) in kernels/general_aiding.py.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.attitude_aiding import heading_model, magnetic_model
from schuler.kernels.compile import kernel
from schuler.kernels.general_aiding import general_model
from schuler.kernels.transition import correct_sample
from schuler.kernels.update import (
    add_offset_states,
    add_rate_noise,
    measurement_model,
)
from schuler.kernels.vehicle import standstill_model, vehicle_velocity_model

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@kernel(inline=True)
def constraint_applies(
    kind: int, velocity: Array, covariance: Array, rolling: float, standing: float
) -> bool:
    """Whether the vehicle moves as a constraint supposes, by the filter's own speed.

    A vehicle that only rolls (kind 2) must be faster than `rolling`. One that was taken for
    standing (kinds 3, 4) must be slower than `standing` within three standard deviations, of
    which no more than 1 m/s each is granted: a smooth road feels like no road. Other kinds always
    apply.
    """
    speed = math.sqrt(velocity[0] ** 2 + velocity[1] ** 2)
    if kind == 2:
        return speed > rolling
    if kind > 4:
        return True
    sd = math.sqrt(max(covariance[3, 3] + covariance[4, 4], 0.0))
    return speed < standing + 3.0 * min(sd, 1.0)


@kernel()
def aiding_model(
    kind: int,
    value: Array,
    variance: Array,
    lever: Array,
    offset: Integers,
    matrix: Array,
    position: Array,
    velocity: Array,
    rotation: Array,
    earth: Array,
    angle: Array,
    accel: Array,
    step: float,
    sensor_state: Array,
    channel: Integers,
    direction: Array,
    white: Array,
    habits: Array,
    vehicle: int,
    mounting: Array,
    residual: Array,
    design: Array,
    noise_variance: Array,
) -> None:
    """Write residual (3,), H (3, n) and the variances (3,) of the noise of one measurement.

    `angle` (3,) is the corrected increment of the sample that the measurement falls into, `step`
    its length and `accel` (3,) its specific force as measured; `white` (2, 3, 3) as in
    `propagate_covariance`, `habits` as in `carve_navigation`.
    """
    body_rate = np.empty(3)
    for i in range(3):
        rate = angle[i] / step
        for c in range(3):
            rate -= rotation[c, i] * earth[3 + c]
        body_rate[i] = rate
        noise_variance[i] = variance[i]
    if kind < 2:
        measurement_model(
            kind,
            value,
            lever,
            position,
            velocity,
            rotation,
            body_rate,
            channel,
            direction,
            residual,
            design,
        )
        if kind == 1:
            add_rate_noise(lever, rotation, white, step, noise_variance)
    elif kind == 2:
        acceleration, turn_variance = np.empty(3), np.empty(3)
        by_rate = np.zeros((3, 3))
        for i in range(3):
            acceleration[i] = habits[i] + 9.8 * rotation[2, i]
            body_rate[i] = habits[3 + i] + habits[6] * (body_rate[i] - habits[3 + i])
            turn_variance[i] = habits[7] * white[1, i, i]
        vehicle_velocity_model(
            value,
            velocity,
            rotation,
            body_rate,
            turn_variance,
            acceleration,
            channel,
            direction,
            sensor_state,
            vehicle,
            mounting,
            residual,
            design,
            by_rate,
        )
        for i in range(3):
            for c in range(3):
                noise_variance[i] += by_rate[i, c] ** 2 * turn_variance[c]
    elif kind < 5:
        if kind == 4:
            unused = np.empty(3)
            correct_sample(value, accel, 1.0, sensor_state, channel, direction, body_rate, unused)
            for i in range(3):
                for c in range(3):
                    body_rate[i] -= rotation[c, i] * earth[3 + c]
        standstill_model(kind, velocity, rotation, body_rate, channel, direction, residual, design)
    elif kind == 5 or kind == 9:
        general_model(
            value,
            lever,
            matrix,
            position,
            velocity,
            rotation,
            sensor_state,
            residual,
            design,
        )
    elif kind == 6:
        heading_model(value, lever, rotation, residual, design)
    elif kind == 7:
        magnetic_model(value, lever, rotation, residual, design)
    else:
        # of the position only the height is used
        measurement_model(
            0,
            value,
            lever,
            position,
            velocity,
            rotation,
            body_rate,
            channel,
            direction,
            residual,
            design,
        )
    add_offset_states(offset, sensor_state, residual, design)
