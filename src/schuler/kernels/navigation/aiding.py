"""One door to all kinds of aiding measurements: what is compared, and how it depends on the state.

Kinds 0 and 1 are in update.py, what a vehicle tells (2 to 4) in vehicle.py, those whose rows carry
their derivatives (5 and 9) in general_aiding.py.
"""

from __future__ import annotations

import math

from schuler.kernels.compile import kernel
from schuler.kernels.navigation.attitude_aiding import heading_model, magnetic_model
from schuler.kernels.navigation.filter_data import Filter
from schuler.kernels.navigation.general_aiding import general_model
from schuler.kernels.navigation.transition import correct_sample
from schuler.kernels.navigation.update import (
    add_offset_states,
    add_rate_noise,
    measurement_model,
)
from schuler.kernels.navigation.vehicle import (
    vehicle_velocity_model,
    zero_rate_model,
    zero_velocity_model,
)
from schuler.kernels.types import FloatArray


@kernel(inline=True)
def constraint_applies(
    kind: int, velocity: FloatArray, covariance: FloatArray, rolling: float, standing: float
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
def read_measurement(f: Filter, u: int) -> int:
    """Take the measurement in row u to hand; returns its kind."""
    row, z = f.schedule.rows[u], f.measurement
    value, variance, lever, offset = row["value"], row["variance"], row["lever"], row["offset"]
    for i in range(3):
        z.value[i] = value[i]
        z.variance[i] = variance[i]
        z.noise_variance[i] = variance[i]
        z.lever[i] = lever[i]
        z.offset[i] = offset[i]
        z.offset_scale[i] = row["offset_scale"][i]
    kind: int = row["kind"]
    return kind


@kernel()
def antenna_model(f: Filter, kind: int) -> None:
    """Position (kind 0) or velocity (kind 1) of an antenna; of a height only that is used."""
    state, z = f.state, f.measurement
    measurement_model(
        kind,
        z.value,
        z.lever,
        state.position,
        state.velocity,
        state.rotation,
        z.body_rate,
        f.model.channel,
        f.work.shown,
        z.residual,
        z.design,
    )


@kernel()
def rolling_model(f: Filter) -> None:
    """Velocity in vehicle axes, with the noise of the gyros that shows in it."""
    state, work, z, v = f.state, f.work, f.measurement, f.work.vehicle
    for i in range(3):
        v.acceleration[i] = state.mean_force[i] + 9.8 * state.rotation[2, i]
        mean = state.mean_rate[i]
        v.rate[i] = mean + state.rate_share[0] * (z.body_rate[i] - mean)
        v.rate_variance[i] = state.rate_noise[0] * work.white[1, i, i]
    vehicle_velocity_model(state, f.model, f.rules, work, z)
    for i in range(3):
        for c in range(3):
            z.noise_variance[i] += v.by_rate[i, c] ** 2 * v.rate_variance[c]


@kernel()
def standing_model(f: Filter, k: int) -> None:
    """Zero rate of turn against the earth, by the mean of the gyros."""
    state, z = f.state, f.measurement
    correct_sample(
        z.value,
        f.samples.accel[k],
        1.0,
        state.sensor,
        f.model.channel,
        f.work.shown,
        z.body_rate,
        f.work.vehicle.acceleration,
    )
    for i in range(3):
        for c in range(3):
            z.body_rate[i] -= state.rotation[c, i] * state.earth[3 + c]
    zero_rate_model(state, f.model, f.work, z)


@kernel()
def aiding_model(f: Filter, u: int, kind: int, k: int, step: float) -> None:
    """Write residual, H and the variances of the noise of the measurement at hand.

    It stands in row u, and falls into sample k, whose length is `step`.
    """
    state, work, z = f.state, f.work, f.measurement
    for i in range(3):
        rate = state.angle[i] / step
        for c in range(3):
            rate -= state.rotation[c, i] * state.earth[3 + c]
        z.body_rate[i] = rate
    if kind == 0 or kind == 1 or kind == 8:
        # by a number that is not literal: one signature for both
        antenna_model(f, kind % 8)
    if kind == 1:
        add_rate_noise(z.lever, state.rotation, work.white, step, z.noise_variance)
    elif kind == 2:
        rolling_model(f)
    elif kind == 3:
        zero_velocity_model(state, z)
    elif kind == 4:
        standing_model(f, k)
    elif kind == 5 or kind == 9:
        general_model(f, max(f.schedule.rows[u]["matrix"], 0))
    elif kind == 6:
        heading_model(z.value, z.lever, state.rotation, z.residual, z.design)
    elif kind == 7:
        magnetic_model(z.value, z.lever, state.rotation, z.residual, z.design)
    add_offset_states(z.offset, z.offset_scale, state.sensor, z.residual, z.design)
