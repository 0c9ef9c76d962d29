"""The noise model of a fused sensor, for the filter (spec 7.4)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from schuler.data import CHANNELS
from schuler.errors import ModelError
from schuler.noise import (
    BiasInstability,
    GaussMarkov,
    NoiseModel,
    Process,
    ProcessSum,
    Quantization,
    RandomWalk,
    RateRamp,
    TurnOnBias,
    WhiteNoise,
)
from schuler.types import FloatArray

SIZES: dict[type[Process], str] = {
    WhiteNoise: "density",
    Quantization: "step_density",
    RandomWalk: "density",
    GaussMarkov: "sigma",
    BiasInstability: "level",
    TurnOnBias: "sigma",
    RateRamp: "slope",
}
"""The parameter by which a process grows in proportion."""
NEGLIGIBLE = 1e-12


def combine_processes(processes: Sequence[Process], shares: FloatArray) -> ProcessSum:
    """Return the process of a weighted sum of independent sensors."""
    sums: dict[Process, float] = {}
    start = 0.0
    for process, share in zip(processes, shares, strict=True):
        if abs(share) < NEGLIGIBLE:
            continue
        for part in process.components:
            name = SIZES.get(type(part))
            if name is None:
                raise ModelError(
                    f"a {part.kind} process in the noise of a fused sensor",
                    expected=f"one of {', '.join(k.__name__ for k in SIZES)}",
                    cure="identify it as white noise and Gauss-Markov processes",
                )
            size = float(getattr(part, name))
            if isinstance(part, RandomWalk):
                start += (share * part.initial_sd) ** 2
                part = RandomWalk(part.density)
            if size > 0.0:
                key = replace(part, **{name: 1.0})  # type: ignore[type-var]
                sums[key] = sums.get(key, 0.0) + (share * size) ** 2
    if start > 0.0:
        walk = RandomWalk(1.0)
        grown = sums.pop(walk, 0.0)
        if grown > 0.0:
            sums[RandomWalk(1.0, float(np.sqrt(start / grown)))] = grown
        else:
            sums[TurnOnBias(1.0)] = sums.get(TurnOnBias(1.0), 0.0) + start
    if not sums:
        raise ModelError("a fused sensor without noise", expected="at least one process")
    return ProcessSum(tuple(_scaled(k, float(np.sqrt(v))) for k, v in sums.items()))


def _scaled(process: Process, factor: float) -> Process:
    """Return the process with its size, which is one, multiplied."""
    if isinstance(process, RandomWalk):
        return RandomWalk(factor, factor * process.initial_sd)
    sized: Process = replace(process, **{SIZES[type(process)]: factor})  # type: ignore[type-var]
    return sized


def combine_noise_models(models: Sequence[NoiseModel], pi: dict[str, FloatArray]) -> NoiseModel:
    """Return the noise model of a synthetic IMU."""
    processes: dict[str, Process] = {}
    for sensor, matrix in pi.items():
        channels = [c for c in CHANNELS if c.startswith(sensor)]
        parts = [model.process(c) for model in models for c in channels]
        for j, channel in enumerate(channels):
            processes[channel] = combine_processes(parts, matrix[j])
    rates = {m.rate for m in models}
    return NoiseModel(
        processes,
        rate=rates.pop() if len(rates) == 1 else None,
        source=f"synthetic IMU of {len(models)} IMUs with independent noise",
    )


def white_noise_model(covariances: dict[str, FloatArray], step: float) -> NoiseModel:
    """Return the white noise that the redundancy itself shows."""
    processes: dict[str, Process] = {}
    for sensor, covariance in covariances.items():
        density = np.sqrt(np.diag(covariance) * step)
        for j, axis in enumerate("xyz"):
            processes[f"{sensor}_{axis}"] = WhiteNoise(float(density[j]))
    return NoiseModel(
        processes, rate=1.0 / step, source="redundancy of the array, white noise only"
    )
