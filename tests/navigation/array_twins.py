"""Twins of arrays: a known ride, IMUs that do what the filter is told, a start that is drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from twins import HEADING_SD, POSITION_SD, TILT_SD, VELOCITY_SD, with_noise

from schuler.data import CHANNELS, GnssRecording, ImuArray, Mounting
from schuler.navigation.error_models.sensor_error_model import sensor_error_model
from schuler.navigation.mechanizations.array_model import (
    fused_model,
    without_idle_states,
)
from schuler.navigation.mechanizations.array_preparation import PreparedArray
from schuler.navigation.mechanizations.array_recording import fused_recording
from schuler.navigation.mechanizations.sensor_table import sensor_table
from schuler.navigation.preparation.alignment import Alignment
from schuler.navigation.preparation.setup import NoiseFactors, RunSetup, TimeOffsets
from schuler.navigation.settings import NavigationSettings
from schuler.noise import GaussMarkov, RandomWalk, WhiteNoise
from schuler.noise.noise_model import NoiseModel
from schuler.rotations import dcm_from_rotation_vector
from schuler.simulation import Profile, add_size_effect, arm_tensor, ideal_imu, simulate_gnss

Array = NDArray[np.float64]

ANTENNA = np.array([0.2, -0.1, -0.9])


def mems(bias: float = 1.0, white: float = 1.0) -> NoiseModel:
    """A consumer MEMS IMU whose biases are a Gauss-Markov noise and a constant."""
    accel = (
        WhiteNoise(3e-3 * white) + GaussMarkov(0.02 * bias, 60.0) + RandomWalk(1e-4, 0.03 * bias)
    )
    gyro = WhiteNoise(1e-3 * white) + GaussMarkov(5e-4 * bias, 60.0) + RandomWalk(2e-6, 2e-3 * bias)
    return NoiseModel({c: gyro if c.startswith("gyro") else accel for c in CHANNELS}, source="twin")


def one_state(bias: float = 1.0, times: tuple[float, float] = (80.0, 80.0)) -> NoiseModel:
    """One Gauss-Markov state an axis, as in S002 (5): 9 + 6 k states in all."""
    accel = WhiteNoise(3e-3) + GaussMarkov(0.02 * bias, times[0])
    gyro = WhiteNoise(1e-3) + GaussMarkov(2e-3 * bias, times[1])
    return NoiseModel({c: gyro if c.startswith("gyro") else accel for c in CHANNELS}, source="twin")


@dataclass(frozen=True, eq=False)
class ArrayTwin:
    """One draw: the prepared array, GNSS, and the true sensor states at every sample."""

    prepared: PreparedArray
    gnss: GnssRecording
    sensor_truth: Array


def draw_array(
    profile: Profile,
    mounting: Mounting,
    noises: Sequence[NoiseModel],
    seed: int,
    *,
    believed: Mounting | None = None,
    rate: float = 50.0,
    velocity: bool = True,
) -> ArrayTwin:
    """IMUs on a known motion; the filter believes in another mounting where one is given."""
    rng = np.random.default_rng(seed)
    centre = ideal_imu(profile, rate)
    tensor = arm_tensor(profile, centre.time)
    recordings, truths = [], []
    for c, place, noise in zip(mounting.rotation, mounting.position, noises, strict=True):
        here = add_size_effect(centre, tensor, place)
        seen = replace(here, gyro=here.gyro @ c, accel=here.accel @ c)
        imu, truth = with_noise(seen, noise, rng)
        recordings.append(imu)
        truths.append(truth)
    array = ImuArray(
        centre.time,
        np.stack([r.gyro for r in recordings], axis=1),
        np.stack([r.accel for r in recordings], axis=1),
        mounting if believed is None else believed,
    )
    gnss = simulate_gnss(
        profile, 1.0, position_sd=POSITION_SD, velocity_sd=VELOCITY_SD if velocity else None,
        lever_arm=ANTENNA, rng=rng, start=1.0,
    )  # fmt: skip
    return ArrayTwin(
        prepare_twin(profile, array, noises, rng), gnss, np.concatenate(truths, axis=1)
    )


def prepare_twin(
    profile: Profile, array: ImuArray, noises: Sequence[NoiseModel], rng: np.random.Generator
) -> PreparedArray:
    """Start from the truth and a draw of the errors that the filter is told."""
    truth = profile.trajectory(array.time[:1])
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
    models = tuple(
        without_idle_states(sensor_error_model(n, turn_on_accel=0.0, turn_on_gyro=0.0))
        for n in noises
    )
    table = sensor_table(array.time, array.mounting, models)
    fusion = table.fusions[0]
    model, _ = fused_model(models, fusion)
    setup = RunSetup(model, NoiseFactors.none(), TimeOffsets(), alignment, ANTENNA - fusion.centre)
    return PreparedArray(
        array, fused_recording(array, table), table, models, tuple(noises), setup,
        NavigationSettings(lever_arm=ANTENNA),
    )  # fmt: skip
