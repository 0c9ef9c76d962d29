"""Twins: a known drive, a sensor and a receiver that do exactly what the filter is told."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from schuler import earth
from schuler.data import CHANNELS, GnssRecording, ImuRecording
from schuler.navigation.error_models.sensor_error_model import sensor_error_model
from schuler.navigation.preparation.alignment import Alignment
from schuler.navigation.preparation.setup import NoiseFactors, RunSetup, TimeOffsets
from schuler.noise import GaussMarkov, RandomWalk, WhiteNoise
from schuler.noise.noise_model import NoiseModel
from schuler.rotations import dcm_from_rotation_vector, rotation_vector_from_dcm
from schuler.simulation import Profile, ideal_imu, simulate_gnss

Array = NDArray[np.float64]

LEVER = np.array([0.8, -0.4, -1.3])
TILT_SD = np.radians(0.5)
HEADING_SD = np.radians(1.0)
POSITION_SD = 0.5
VELOCITY_SD = 0.05

ACCEL = WhiteNoise(2e-3) + GaussMarkov(3e-3, 30.0) + RandomWalk(1e-4, initial_sd=0.05)
GYRO = WhiteNoise(2e-4) + GaussMarkov(1e-4, 60.0) + RandomWalk(2e-6, initial_sd=2e-3)
NOISE = NoiseModel(
    processes={c: GYRO if c.startswith("gyro") else ACCEL for c in CHANNELS}, source="twin"
)


@dataclass(frozen=True, eq=False)
class Twin:
    """One draw: recordings, the true sensor states at every sample, and how the filter starts."""

    imu: ImuRecording
    gnss: GnssRecording
    sensor_truth: Array
    setup: RunSetup


def with_noise(
    ideal: ImuRecording, noise: NoiseModel, rng: np.random.Generator
) -> tuple[ImuRecording, Array]:
    """Add every component by itself; returns also the states (n, m) in the filter's order."""
    dt = float(np.median(np.diff(ideal.time)))
    added, states = {}, {}
    for name in CHANNELS:
        total, kept = np.zeros(ideal.size), []
        for part in noise.process(name).components:
            values = part.simulate(ideal.size, dt, rng)
            total += values
            if not isinstance(part, WhiteNoise):
                kept.append(values)
        added[name], states[name] = total, kept
    imu = replace(
        ideal,
        gyro=ideal.gyro + np.stack([added[c] for c in CHANNELS[:3]], axis=-1),
        accel=ideal.accel + np.stack([added[c] for c in CHANNELS[3:]], axis=-1),
    )
    order = (*CHANNELS[3:], *CHANNELS[:3])
    return imu, np.stack([s for c in order for s in states[c]], axis=-1)


def draw_twin(
    profile: Profile,
    ideal: ImuRecording,
    seed: int,
    *,
    first_fix: float = 1.0,
    noise: NoiseModel = NOISE,
    interval: float | None = None,
) -> Twin:
    rng = np.random.default_rng(seed)
    imu, sensor_truth = with_noise(ideal, noise, rng)
    gnss = simulate_gnss(
        profile,
        1.0,
        position_sd=POSITION_SD,
        velocity_sd=VELOCITY_SD,
        lever_arm=LEVER,
        rng=rng,
        start=first_fix,
    )
    truth = profile.trajectory(imu.time[:1])
    psi = rng.standard_normal(3) * [TILT_SD, TILT_SD, HEADING_SD]
    alignment = Alignment(
        rotation=dcm_from_rotation_vector(-psi) @ truth.rotation[0],
        tilt_sd=TILT_SD,
        heading_sd=HEADING_SD,
        gyro_bias=np.zeros(3),
        gyro_bias_sd=None,
        rest=(0.0, 1.0),
        method="truth and a draw",
        velocity=truth.velocity[0] + 0.1 * rng.standard_normal(3),
    )
    model = sensor_error_model(noise, turn_on_accel=0.0, turn_on_gyro=0.0, interval=interval)
    setup = RunSetup(model, NoiseFactors.none(), TimeOffsets(), alignment, LEVER)
    return Twin(imu, gnss, sensor_truth, setup)


def navigation_errors(
    profile: Profile, time: Array, position: Array, velocity: Array, rotation: Array
) -> Array:
    """(n, 9): computed - true in NED m, m/s, and psi of C_hat = (I - [psi x]) C in rad."""
    truth = profile.trajectory(time)
    north, east = earth.metres_per_radian(truth.position)
    scale = np.stack([north, east, -np.ones(north.size)], axis=-1)
    psi = -rotation_vector_from_dcm(rotation @ truth.rotation.transpose(0, 2, 1))
    return np.hstack([(position - truth.position) * scale, velocity - truth.velocity, psi])


def perfect(profile: Profile, rate: float = 100.0) -> ImuRecording:
    return ideal_imu(profile, rate)
