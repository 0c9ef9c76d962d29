"""The sensor of the paper: what is printed of it, and the twin that bears these numbers."""

from __future__ import annotations

import functools
from dataclasses import replace

import numpy as np

from schuler import (
    AllanReading,
    Autoregressive,
    BiasInstability,
    ErrorModel,
    ImuRecording,
    NoiseModel,
    Process,
    ProcessSum,
    RandomWalk,
    SensorDenoising,
    TurnOnBias,
    WhiteNoise,
    autoregressive_fits,
    error_model,
    simulate_static,
)
from schuler_papers.experiment import Size, generator

PAPER = "quinchia2013"
RATE = 100.0
HOURS: dict[Size, float] = {"quick": 2.0, "full": 7.0}
CHANNELS = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")
FLICKER_LEVEL = float(np.sqrt(2.0 * np.log(2.0) / np.pi))
"""Allan deviation of bias instability over B."""

# Table 4 (N, B, K in m/s, deg and h, with the printed errors) and the times of Table 5 (s)
TABLE_4: dict[str, tuple[tuple[float, float], tuple[float, float], tuple[float, float] | None]] = {
    "accel_x": ((0.045, 0.00023), (5.1581, 0.0370), (166.30, 4.6398)),
    "accel_y": ((0.045, 0.00022), (4.5507, 0.0506), (24.95, 2.8368)),
    "accel_z": ((0.047, 0.00050), (1.8336, 0.0524), (13.53, 1.8685)),
    "gyro_x": ((2.420, 0.0974), (44.533, 5.14), None),
    "gyro_y": ((1.988, 0.0565), (38.810, 2.51), None),
    "gyro_z": ((2.164, 0.0599), (31.717, 2.29), None),
}
TABLE_3: dict[str, tuple[float, float, float | None]] = {
    "accel_x": (0.045, 4.6447, 168.60),
    "accel_y": (0.044, 4.6700, 26.66),
    "accel_z": (0.047, 1.7733, 14.60),
    "gyro_x": (2.297, 43.438, None),
    "gyro_y": (1.937, 39.614, None),
    "gyro_z": (2.058, 30.705, None),
}
TABLE_5_TIME = {
    "accel_x": 4.56,
    "accel_y": 7.26,
    "accel_z": 20.74,
    "gyro_x": 490.89,
    "gyro_y": 623.25,
    "gyro_z": 735.17,
}
TABLE_5_SD = {
    "accel_x": 0.0068,
    "accel_y": 0.0065,
    "accel_z": 0.0063,
    "gyro_x": 0.0055,
    "gyro_y": 0.0045,
    "gyro_z": 0.0048,
}
# Table 2: AR(3) coefficients, its variance, AR(1) coefficient and variance
TABLE_2: dict[str, tuple[tuple[float, float, float], float, float, float]] = {
    "accel_x": ((-2.582, 2.166, -0.585), 4.973e-13, -1.0, 2.129e-10),
    "accel_y": ((-2.564, 2.136, -0.572), 8.399e-12, -1.0, 1.148e-9),
    "accel_z": ((-2.564, 2.136, -0.572), 7.964e-12, -1.0, 1.014e-9),
    "gyro_x": ((-2.564, 2.131, -0.567), 2.739e-13, -0.999, 1.014e-10),
    "gyro_y": ((-2.565, 2.133, -0.568), 1.905e-13, -0.999, 7.04e-11),
    "gyro_z": ((-2.562, 2.128, -0.566), 2.181e-13, -0.999, 8.066e-11),
}
# the bias instability that the accelerometers' own curves bear (spec 2.4 b, E-004-9)
TRUE_B = {"accel_x": 2.65, "accel_y": 4.22, "accel_z": 1.30}
TURN_ON_ACCEL = 0.02
TURN_ON_GYRO = float(np.radians(0.05))
NAMES = {
    "accel_x": "Acc X",
    "accel_y": "Acc Y",
    "accel_z": "Acc Z",
    "gyro_x": "Gyro X",
    "gyro_y": "Gyro Y",
    "gyro_z": "Gyro Z",
}
MODELS = ("15AV", "18AV", "18AVWD", "15AR", "27AR", "18AV+turn-on", "flicker4")
"""The five of the paper and two of ours."""


def scales(channel: str) -> tuple[float, float, float]:
    """Return what N, B and K of the tables are multiplied by to be in SI."""
    unit = float(np.radians(1.0)) if channel.startswith("gyro") else 1.0
    return unit / 60.0, unit / 3600.0, unit / 3600.0**1.5


def reading(channel: str, bias_instability: float | None = None) -> AllanReading:
    """Return what the paper reads off the Allan curve of a channel, in SI."""
    n, b, k = TABLE_4[channel]
    per = scales(channel)
    level = b[0] if bias_instability is None else bias_instability
    walk = 0.0 if k is None else k[0] * per[2]
    return AllanReading(n[0] * per[0], level * per[1], TABLE_5_TIME[channel], walk)


PRINTED = {c: reading(c) for c in CHANNELS}
TRUE = {c: reading(c, TRUE_B.get(c)) for c in CHANNELS}


def process(channel: str, *, turn_on: bool = False) -> ProcessSum:
    """Return the true error of a channel: spec 1.1 and 8.4."""
    r = TRUE[channel]
    flicker = BiasInstability(r.bias_instability, 0.05, 1e4)
    parts: list[Process] = [WhiteNoise(r.white_noise), flicker]
    if r.random_walk:
        parts.append(RandomWalk(r.random_walk))
    if turn_on:
        parts.append(TurnOnBias(TURN_ON_ACCEL if channel in TRUE_B else TURN_ON_GYRO))
    return ProcessSum(tuple(parts))


def twin(*, turn_on: bool = False) -> NoiseModel:
    """Return the true errors of all channels."""
    return NoiseModel(
        {c: process(c, turn_on=turn_on) for c in CHANNELS}, source="twin of S004 table 4"
    )


def static_record(size: Size, rng: np.random.Generator) -> ImuRecording:
    """Simulate the static record of the laboratory."""
    return simulate_static(twin(), HOURS[size] * 3600.0, RATE, rng)


@functools.cache
def fitted(size: Size) -> dict[int, dict[str, Autoregressive]]:
    """Fit AR(1) and AR(3) as the paper does, to one static record that all repetitions share."""
    return autoregressive_fits(static_record(size, generator(0, PAPER, "laboratory")))


@functools.cache
def models(size: Size) -> tuple[ErrorModel, ...]:
    """Return the error models that are compared."""
    order = {"15AR": 1, "27AR": 3}
    return tuple(
        error_model(
            name,
            TRUE if name == "flicker4" else PRINTED,
            autoregressive=fitted(size)[order[name]] if name in order else None,
        )
        for name in MODELS
    )


def bare(level: int) -> ErrorModel:
    """Return the filter of table 6: no error model, measurements de-noised to some level."""
    white = {c: WhiteNoise(r.white_noise) for c, r in PRINTED.items()}
    levels = {c: level - (c in ("accel_y", "accel_z")) for c in CHANNELS}
    nine = ErrorModel(f"LOD {level}", NoiseModel(white, source="white noise only"))
    return replace(nine, denoising=SensorDenoising(levels)) if level else nine
