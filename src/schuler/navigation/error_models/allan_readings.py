"""What S004 reads off the Allan curve of a channel: N, B, K and the time of the flat part."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from schuler.data import ImuRecording
from schuler.errors import InputError
from schuler.noise import (
    BiasInstability,
    GaussMarkov,
    NoiseModel,
    Process,
    ProcessSum,
    RandomWalk,
    WhiteNoise,
)
from schuler.noise.gauss_markov import (
    ALLAN_PEAK_HEIGHT,
    ALLAN_PEAK_POSITION,
    FLICKER_LEVEL,
)

# cluster times between which a flat part is looked for (s)
FLAT_RANGE = (0.1, 3000.0)
GRID = 400


@dataclass(frozen=True, slots=True)
class AllanReading:
    """N, B, K of one channel in SI. Spec 2.4, S004 tables 4 and 5.

    Parameters
    ----------
    white_noise : float
        N in u/sqrt(Hz).
    bias_instability : float
        B in u: the flat part over 0.66428.
    flat_time : float
        Cluster time of the middle of the flat part, s (called correlation time in S004 table 5).
    random_walk : float
        K in u/sqrt(s).
    crossing : bool
        The flat part is only where white noise and random walk cross (E-004-9).

    Examples
    --------
    >>> from schuler import AllanReading
    >>> AllanReading(white_noise=1e-3, bias_instability=1e-4, flat_time=50.0).random_walk
    0.0
    """

    white_noise: float
    bias_instability: float
    flat_time: float
    random_walk: float = 0.0
    crossing: bool = False

    def __post_init__(self) -> None:
        values = (self.white_noise, self.bias_instability, self.random_walk)
        if not (all(math.isfinite(v) and v >= 0.0 for v in values) and self.flat_time > 0.0):
            raise InputError(
                f"N {values[0]:g}, B {values[1]:g}, K {values[2]:g}, time {self.flat_time:g} s",
                expected="finite, not negative, and a time above zero",
            )


def allan_readings(noise_model: NoiseModel) -> dict[str, AllanReading]:
    """Read N, B, K and the flat time of every channel off a noise model."""
    return {c: _reading(noise_model.process(c)) for c in noise_model.channels}


def readings_of_static(imu: ImuRecording) -> tuple[NoiseModel, dict[str, AllanReading]]:
    """Identify the noise of a static recording, and read it as S004 does."""
    from schuler.estimation.characterization import characterize_imu

    found = characterize_imu(imu).noise_model
    return found, allan_readings(found)


def _reading(process: ProcessSum) -> AllanReading:
    parts = process.components
    white = math.sqrt(sum(p.density**2 for p in parts if isinstance(p, WhiteNoise)))
    walk = math.sqrt(sum(p.density**2 for p in parts if isinstance(p, RandomWalk)))
    slow = tuple(p for p in parts if isinstance(p, GaussMarkov | BiasInstability))
    if len(slow) == 1 and isinstance(slow[0], GaussMarkov):
        peak = ALLAN_PEAK_HEIGHT * slow[0].sigma
        time = ALLAN_PEAK_POSITION * slow[0].correlation_time
        return AllanReading(white, peak / FLICKER_LEVEL, time, walk)
    if slow:
        return _plateau(white, walk, slow, process)
    if walk > 0.0 and white > 0.0:
        # the minimum of N²/tau + K² tau/3 (spec 2.4 b)
        level = math.sqrt(2.0 * white * walk / math.sqrt(3.0))
        time = math.sqrt(3.0) * white / walk
        return AllanReading(white, level / FLICKER_LEVEL, time, walk, crossing=True)
    return AllanReading(white, 0.0, 100.0, walk)


def _plateau(
    white: float, walk: float, slow: tuple[Process, ...], whole: ProcessSum
) -> AllanReading:
    tau = np.geomspace(*FLAT_RANGE, GRID)
    if len(slow) == 1 and isinstance(slow[0], BiasInstability):
        level = slow[0].level
    else:
        own = np.sqrt(sum(p.allan_variance(tau) for p in slow))
        level = float(own.max()) / FLICKER_LEVEL
    kinds = WhiteNoise | RandomWalk | GaussMarkov | BiasInstability
    measured = [p for p in whole.components if isinstance(p, kinds)]
    deviation = np.sqrt(sum(p.allan_variance(tau) for p in measured))
    slope = np.gradient(np.log(deviation), np.log(tau))
    flat = np.abs(slope) <= 0.1
    time = float(np.exp(np.log(tau[flat]).mean())) if flat.any() else float(tau[deviation.argmin()])
    return AllanReading(white, level, time, walk)
