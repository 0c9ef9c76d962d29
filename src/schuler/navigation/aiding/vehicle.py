"""What is known of a wheeled vehicle: it rolls along its forward axis.

The non-holonomic constraint needs to know how the IMU sits in the vehicle. A first guess of the
mounting is corrected by the filter, which also estimates where the point lies that does not slip
sideways (the middle of the rear axle), how far the rear axle slips in curves and how far the
springs pitch the vehicle when it speeds up. They are states without a sensor channel; the
equations are in kernels/navigation/vehicle.py. Spec 10, "constraints".
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from schuler.data import ImuRecording
from schuler.errors import InputError
from schuler.navigation.aiding.schedule import (
    VEHICLE_VELOCITY,
    Aiding,
    AidingSchedule,
    schedule_rows,
)
from schuler.navigation.aiding.standstill import StandingJudgement, Standstill
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


@dataclass(frozen=True, slots=True, eq=False)
class VehicleConstraint:
    """How a vehicle aids the filter."""

    # out of `CONSTRAINTS`: "nhc", no velocity across and through the floor of a vehicle that rolls;
    # "zupt", no velocity and no rate in a vehicle that stands; "wheel", its speed shows in the
    # vibration of its wheels.
    constraints: tuple[str, ...]
    mounting: FloatArray  # (3, 3): vehicle (forward, right, down) from IMU, to a few degrees
    first_state: int  # place of the vehicle's states among the sensor states; -1 without "nhc".
    # lateral_sd, vertical_sd: what a vehicle that rolls may show of velocity to the right and down,
    # m/s: more than single constraints do, as slopes, ruts and side wind last for seconds
    lateral_sd: float = 0.05
    vertical_sd: float = 0.15
    interval: float = 0.125  # seconds between non-holonomic constraints
    # which moments without felt motion are creeping; None: all are standing.
    standing: StandingJudgement | None = None

    @property
    def states(self) -> VehicleStates:
        """What `run_engine` has to be told."""
        return VehicleStates(self.first_state, self.mounting)

    def sources(self, imu: ImuRecording, gyro_density: FloatArray) -> tuple[Aiding, ...]:
        """Return what tells of the vehicle over a recording; the filter leaves out what cannot be.

        The speed of the wheels is not among it: it needs a filter that has learnt them.
        """
        told: dict[str, Aiding] = {
            "nhc": RollingForward(
                float(imu.time[0]) + 1.0,
                float(imu.time[-1]),
                self.lateral_sd,
                self.vertical_sd,
                self.interval,
            ),
            "zupt": Standstill(imu, gyro_density, self.standing),
        }
        return tuple(source for name, source in told.items() if name in self.constraints)


@dataclass(frozen=True, slots=True)
class RollingForward:
    """No velocity across and through the floor of a vehicle that rolls."""

    # start, stop: s
    start: float
    stop: float
    # lateral_sd, vertical_sd: see `VehicleConstraint`, m/s
    lateral_sd: float
    vertical_sd: float
    interval: float  # s

    def rows(self) -> AidingSchedule:
        """Return one row every `interval`."""
        time = np.arange(self.start, self.stop, self.interval)
        across = [np.inf, self.lateral_sd**2, self.vertical_sd**2]
        return schedule_rows(time, VEHICLE_VELOCITY, np.zeros((time.size, 3)), across)


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
