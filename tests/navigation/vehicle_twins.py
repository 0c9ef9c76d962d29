"""Twins of a car whose IMU is mounted at odd angles and away from the rear axle."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from twins import Twin, draw_twin, perfect

from schuler import earth
from schuler.data import CHANNELS, ImuRecording
from schuler.navigation.aiding.vehicle import VehicleConstraint, with_vehicle_states
from schuler.noise import RandomWalk, WhiteNoise
from schuler.noise.noise_model import NoiseModel
from schuler.rotations import dcm_from_euler, dcm_from_rotation_vector, euler_from_dcm
from schuler.simulation import Profile, car_urban, fit_profile

Array = NDArray[np.float64]

# vehicle from IMU
MOUNTING = dcm_from_euler(*np.radians([-14.0, -60.0, -163.0]))
# IMU from the rear axle, vehicle axes, m
ARM = np.array([1.2, -0.3, -0.4])
# a gyro that drifts ten metres in 30 s by itself, as one on a car with a running engine does
NOISE = NoiseModel(
    processes={
        c: WhiteNoise(2e-3) + RandomWalk(1e-5, initial_sd=2e-3)
        if c.startswith("gyro")
        else WhiteNoise(5e-3) + RandomWalk(1e-4, initial_sd=0.05)
        for c in CHANNELS
    },
    source="twin",
)
MOUNTING_SD = np.radians([1.0, 3.0, 3.0])


def mounted(car: Profile, arm: Array = ARM, mounting: Array = MOUNTING) -> Profile:
    """The motion of an IMU that rides in a car."""
    time = np.arange(car.start, car.stop + 0.05, 0.1)
    time = time[time <= car.stop]
    path = car.trajectory(time)
    north, east = earth.metres_per_radian(path.position)
    away = path.rotation @ arm
    position = path.position + away / np.stack([north, east, -np.ones(north.size)], axis=-1)
    euler = np.stack(euler_from_dcm(path.rotation @ mounting), axis=-1)
    return fit_profile(time, position, np.unwrap(euler, axis=0))


@dataclass(frozen=True, eq=False)
class Ride:
    """A drive of a car and what its IMU would feel without error."""

    profile: Profile
    ideal: ImuRecording


def ride(duration: float, seed: int, standstill: float = 20.0) -> Ride:
    profile = mounted(car_urban(duration, seed, standstill=standstill))
    return Ride(profile, perfect(profile, 50.0))


@dataclass(frozen=True, eq=False)
class VehicleTwin:
    """A draw with a filter that knows the mounting to a few degrees; `mu` is what it misses."""

    plain: Twin
    aided: Twin
    mu: Array


def draw_vehicle(
    drive: Ride, seed: int, constraints: tuple[str, ...] = ("nhc",), **sd: float
) -> VehicleTwin:
    twin = draw_twin(drive.profile, drive.ideal, seed, noise=NOISE)
    mu = np.random.default_rng([seed, 77]).standard_normal(3) * MOUNTING_SD
    nominal = dcm_from_rotation_vector(-mu) @ MOUNTING
    vehicle = VehicleConstraint(constraints, nominal, twin.setup.model.size, **sd)
    model = with_vehicle_states(twin.setup.model, constraints)
    setup = replace(twin.setup, model=model, vehicle=vehicle)
    return VehicleTwin(twin, replace(twin, setup=setup), mu)
