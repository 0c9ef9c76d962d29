"""What is known of a wheeled vehicle: it rolls along its forward axis, and sometimes it stands.

The non-holonomic constraint needs to know how the IMU sits in the vehicle. A first guess of the
mounting is corrected by the filter, which also estimates where the point lies that does not slip
sideways (the middle of the rear axle), how far the rear axle slips in curves and how far the
springs pitch the vehicle when it speeds up. They are states without a sensor channel; the
equations are in kernels/vehicle.py. Spec 10, "constraints".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.data import ImuRecording
from schuler.errors import InputError
from schuler.navigation.aiding.gnss import (
    VEHICLE_VELOCITY,
    ZERO_RATE,
    ZERO_VELOCITY,
    AidingSchedule,
)
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.stepping import VehicleStates
from schuler.types import FloatArray

CONSTRAINTS = ("nhc", "zupt", "wheel")

# states of the vehicle: name, standard deviation at the start, walk per square root of a second.
# The roll of the mounting shows in curves and slopes only; a first pass knows it best.
STATES = (
    ("mounting roll", np.radians(1.0), 1e-5),
    ("mounting pitch", np.radians(3.0), 1e-5),
    ("mounting yaw", np.radians(3.0), 1e-5),
    ("axle ahead", 1.5, 1e-4),
    ("axle right", 0.5, 1e-4),
    ("axle below", 0.5, 1e-4),
    ("rear slip", 0.01, 1e-5),
    ("spring pitch", 0.01, 1e-5),
)
# one more where the speed is seen in the vibration of the wheels: what is wrong with it for longer
# than a moment (curves, load and warmth of tyres), m/s, and for how long, s
WHEEL_STATE = "wheel speed error"
WHEEL_ERROR_SD = 0.05
WHEEL_ERROR_TIME = 20.0

# one-second means of a vehicle at rest change by less from one second to the next
STEADY_ACCEL = 0.08
STEADY_GYRO = np.radians(0.35)
# what may be left of velocity (m/s) and rate (rad/s) in a vehicle at rest
REST_VELOCITY_SD = 0.05
REST_RATE_SD = 5e-4
# seconds between zero velocities
REST_INTERVAL = 0.5


@dataclass(frozen=True, slots=True, eq=False)
class VehicleConstraint:
    """How a vehicle aids the filter.

    Parameters
    ----------
    constraints : tuple of str
        Out of `CONSTRAINTS`: "nhc", no velocity across and through the floor of a vehicle that
        rolls; "zupt", no velocity and no rate in a vehicle that stands; "wheel", its speed shows
        in the vibration of its wheels.
    mounting : (3, 3) ndarray
        Vehicle (forward, right, down) from IMU, to a few degrees.
    first_state : int
        Place of the vehicle's states among the sensor states; -1 without "nhc".
    lateral_sd, vertical_sd : float
        What a vehicle that rolls may show of velocity to the right and down, m/s: more than single
        constraints do, as slopes, ruts and side wind last for seconds.
    interval : float
        Seconds between non-holonomic constraints.
    """

    constraints: tuple[str, ...]
    mounting: FloatArray
    first_state: int
    lateral_sd: float = 0.05
    vertical_sd: float = 0.15
    interval: float = 0.125

    @property
    def states(self) -> VehicleStates:
        """What `run_engine` has to be told."""
        return VehicleStates(self.first_state, self.mounting)

    def rows(self, imu: ImuRecording, gyro_density: FloatArray) -> list[AidingSchedule]:
        """Return all constraints over a recording; the filter leaves out what cannot be."""
        schedules = []
        if "nhc" in self.constraints:
            time = np.arange(imu.time[0] + 1.0, imu.time[-1], self.interval)
            across = [np.inf, self.lateral_sd**2, self.vertical_sd**2]
            schedules.append(_rows(time, VEHICLE_VELOCITY, np.zeros((time.size, 3)), across))
        if "zupt" in self.constraints:
            rest = detect_standstill(imu)
            schedules.append(
                _rows(
                    rest.time,
                    ZERO_VELOCITY,
                    np.zeros((rest.time.size, 3)),
                    np.full(3, REST_VELOCITY_SD**2),
                )
            )
            # means of whole seconds must not overlap, or their noise would be counted twice
            once = _apart(rest.time, 1.0 - 1e-6)
            variance = np.full((once.size, 3), np.inf)
            variance[:, 2] = rest.down[once] ** 2 @ gyro_density**2 + REST_RATE_SD**2
            schedules.append(_rows(rest.time[once], ZERO_RATE, rest.gyro[once], variance))
        return schedules


@dataclass(frozen=True, slots=True, eq=False)
class Standstill:
    """Moments at which an IMU feels no motion, and the mean of its gyros up to them.

    Parameters
    ----------
    time : (k,) ndarray
        Seconds.
    gyro : (k, 3) ndarray
        Mean over the second before, rad/s, as measured.
    down : (k, 3) ndarray
        Direction of gravity in IMU axes, by the mean force over the second before.
    """

    time: FloatArray
    gyro: FloatArray
    down: FloatArray


def detect_standstill(imu: ImuRecording) -> Standstill:
    """Find moments at which force and rate have not changed for two seconds."""
    n, block = imu.size, max(round(imu.rate), 2)
    ends = np.arange(2 * block, n, max(round(REST_INTERVAL * imu.rate), 1))
    # no second across a gap
    span = imu.time[ends] - imu.time[ends - 2 * block]
    ends = ends[span < 2.2 * block / imu.rate]

    def means(values: FloatArray) -> tuple[FloatArray, FloatArray]:
        total = np.concatenate([np.zeros((1, 3)), np.cumsum(values, axis=0)])
        last = (total[ends + 1] - total[ends + 1 - block]) / block
        before = (total[ends + 1 - block] - total[ends + 1 - 2 * block]) / block
        return last, np.abs(last - before).max(axis=1)

    gyro, turn = means(imu.gyro)
    force, push = means(imu.accel)
    steady = (turn < STEADY_GYRO) & (push < STEADY_ACCEL)
    down = -force[steady] / np.linalg.norm(force[steady], axis=1, keepdims=True)
    return Standstill(time=imu.time[ends[steady]], gyro=gyro[steady], down=down)


def with_vehicle_states(
    model: SensorErrorModel, constraints: Sequence[str] = ("nhc",)
) -> SensorErrorModel:
    """Append the states of a vehicle to those of its IMU."""
    names, sd, walk = zip(*STATES, strict=True)
    with_vehicle = model.with_states(names, sd, walk_density=walk)
    if "wheel" in constraints:
        return with_vehicle.with_states(
            (WHEEL_STATE,), (WHEEL_ERROR_SD,), correlation_time=WHEEL_ERROR_TIME
        )
    return with_vehicle


def check_constraints(aiding: Sequence[str]) -> tuple[str, ...]:
    """Return the names of constraints once each."""
    names = (aiding,) if isinstance(aiding, str) else tuple(aiding)
    for name in names:
        if name not in CONSTRAINTS:
            raise InputError(
                f"aiding '{name}' is not known",
                expected=" or ".join(CONSTRAINTS),
                cure="nhc: a wheeled vehicle; zupt: anything that stands now and then; wheel: "
                "wheels that the IMU feels",
            )
    if "wheel" in names and "nhc" not in names:
        raise InputError(
            "aiding 'wheel' without 'nhc'",
            expected="both: the forward axis of the vehicle has to be known",
            cure="add nhc",
        )
    return tuple(name for name in CONSTRAINTS if name in names)


def _apart(time: FloatArray, least: float) -> NDArray[np.int64]:
    """Indices of moments at least so far apart."""
    kept: list[int] = []
    for k, t in enumerate(time):
        if not kept or t - time[kept[-1]] >= least:
            kept.append(k)
    return np.array(kept, dtype=np.int64)


def _rows(
    time: FloatArray, kind: int, value: FloatArray, variance: Sequence[float] | FloatArray
) -> AidingSchedule:
    return AidingSchedule(
        time=time,
        kind=np.full(time.size, kind, dtype=np.int64),
        value=value,
        variance=np.array(np.broadcast_to(np.asarray(variance), (time.size, 3))),
        lever_arm=np.zeros((time.size, 3)),
    )
