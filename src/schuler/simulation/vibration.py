"""Vibration of what carries the IMU: lines and narrow bands that alias into the recording.

Samples are means over their intervals, so a vibration of frequency f comes through with the gain
sinc(f dt) and appears at the frequency to which it aliases.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from schuler.data import ImuRecording
from schuler.errors import InputError
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Vibration:
    """One vibration, of a frequency f = frequency + order times the turning rate."""

    gyro: ArrayLike = (0.0, 0.0, 0.0)  # (3,): root mean square at strength one, rad/s
    accel: ArrayLike = (0.0, 0.0, 0.0)  # (3,): likewise, m/s²
    frequency: float = 0.0  # hz
    order: float = 0.0  # cycles a turn of the wheel, rotor or engine whose turning rate is given
    # zero: a sinusoid. Otherwise random, with a spectrum of this width at half power, Hz.
    bandwidth: float = 0.0

    def __post_init__(self) -> None:
        if np.shape(self.gyro) != (3,) or np.shape(self.accel) != (3,):
            raise InputError(
                f"gyro of shape {np.shape(self.gyro)}, accel of shape {np.shape(self.accel)}",
                expected="(3,) of both",
            )
        if not (
            min(self.frequency, self.order, self.bandwidth) >= 0.0
            and self.frequency + self.order > 0.0
        ):
            raise InputError(
                f"frequency {self.frequency:g} Hz, order {self.order:g}, bandwidth "
                f"{self.bandwidth:g} Hz",
                expected="a positive frequency or order, and none negative",
            )


def engine_turning_rate(
    speed: ArrayLike,
    *,
    idle: float = 13.0,
    shift: float = 42.0,
    metres_per_turn: Sequence[float] = (0.14, 0.26, 0.40, 0.55, 0.70),
) -> FloatArray:
    """Return how fast the engine of a car turns."""
    v = np.abs(np.asarray(speed, dtype=np.float64))
    gear = np.searchsorted(shift * np.asarray(metres_per_turn[:-1]), v)
    return np.asarray(np.maximum(idle, v / np.asarray(metres_per_turn)[gear]))


def wheel_turning_rate(speed: ArrayLike, circumference: float = 1.95) -> FloatArray:
    """Return how fast a wheel turns."""
    return np.abs(np.asarray(speed, dtype=np.float64)) / circumference


def add_vibration(
    ideal: ImuRecording,
    vibrations: Sequence[Vibration],
    rng: np.random.Generator,
    *,
    turning_rate: ArrayLike | None = None,
    strength: ArrayLike = 1.0,
) -> ImuRecording:
    """Return an error-free recording of a body that vibrates besides its motion."""
    n = ideal.size
    dt = ideal.duration / (n - 1)
    turning = None if turning_rate is None else np.asarray(turning_rate, dtype=np.float64)
    factor = np.asarray(strength, dtype=np.float64)
    if (turning is not None and turning.shape != (n,)) or factor.shape not in ((), (n,)):
        raise InputError("a turning rate or strength of another length", expected=f"{n} values")
    gyro, accel = ideal.gyro.copy(), ideal.accel.copy()
    for vibration, child in zip(vibrations, rng.spawn(len(vibrations)), strict=True):
        if vibration.order > 0.0 and turning is None:
            raise InputError(
                f"a vibration of order {vibration.order:g}", expected="a turning rate to follow"
            )
        cycles = np.full(n, vibration.frequency * dt)
        if turning is not None:
            cycles += vibration.order * turning * dt
        rms = np.concatenate([vibration.gyro, vibration.accel])
        shape = np.stack(
            [_unit(cycles, vibration.bandwidth * dt, channel) for channel in child.spawn(6)],
            axis=-1,
        )
        moved = rms * shape * np.broadcast_to(factor, (n,))[:, None]
        gyro += moved[:, :3]
        accel += moved[:, 3:]
    history = (*ideal.history, f"{len(vibrations)} vibrations added")
    return replace(ideal, gyro=gyro, accel=accel, history=history)


def _unit(cycles: FloatArray, width: float, rng: np.random.Generator) -> FloatArray:
    """Means over the intervals of a vibration of root mean square one.

    `cycles` (n,) are those within each interval, `width` the bandwidth in cycles a sample.
    """
    middle = 2.0 * np.pi * (np.cumsum(cycles) - 0.5 * cycles)
    gain = np.sinc(cycles)
    if width == 0.0:
        phase = rng.uniform(0.0, 2.0 * np.pi)
        return np.asarray(np.sqrt(2.0) * gain * np.cos(middle + phase))
    from scipy.signal import lfilter

    phi = np.exp(-np.pi * width)
    drive = rng.standard_normal((2, cycles.size))
    drive[:, 1:] *= np.sqrt(-np.expm1(-2.0 * np.pi * width))
    cosine, sine = lfilter([1.0], [1.0, -phi], drive, axis=1)
    return np.asarray(gain * (cosine * np.cos(middle) - sine * np.sin(middle)))
