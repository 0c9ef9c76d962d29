"""The noise model of a fused sensor, for the filter (spec 7.4)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from schuler.data import CHANNELS
from schuler.errors import ModelError
from schuler.noise import NoiseModel, Process, ProcessSum, WhiteNoise
from schuler.types import FloatArray

NEGLIGIBLE = 1e-12


def combine_processes(processes: Sequence[Process], shares: FloatArray) -> ProcessSum:
    """Return the process of a weighted sum of independent sensors."""
    members: dict[type[Process], list[tuple[Process, float]]] = {}
    for process, share in zip(processes, shares, strict=True):
        if abs(share) >= NEGLIGIBLE:
            for part in process.components:
                members.setdefault(type(part), []).append((part, float(share)))
    parts = [part for kind, found in members.items() for part in kind.combined(found)]
    if not parts:
        raise ModelError("a fused sensor without noise", expected="at least one process")
    return ProcessSum(tuple(parts))


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
