"""What a channel does with a quantity beside it, such as temperature."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np

from schuler.data.imu import ImuRecording
from schuler.types import FloatArray

Term = Literal["linear", "square", "rate"]
TERMS: tuple[Term, ...] = ("linear", "square", "rate")


@dataclass(frozen=True, slots=True)
class Effect:
    """One term of one column."""

    column: str  # such as "temperature"
    term: str  # of the column less its reference: itself, its square, its change a second
    # u per unit of the column (kelvin), per its square, or per its change a second
    coefficient: float
    standard_error: float  # of it
    reference: float  # value of the column at which the effect is zero

    def of(self, values: FloatArray, rate: float) -> FloatArray:
        """What the column does to the channel."""
        return self.coefficient * term_of(self.term, values - self.reference, rate)

    @property
    def words(self) -> str:
        """Name of the term for people."""
        return {"linear": self.column, "square": f"{self.column} squared"}.get(
            self.term, f"rate of {self.column}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain Python for JSON, SI."""
        return asdict(self)


def term_of(term: str, values: FloatArray, rate: float) -> FloatArray:
    """A term of a column that is zero at its reference."""
    if term == "square":
        return np.asarray(values**2)
    if term == "rate":
        return np.asarray(np.gradient(values) * rate) if values.size > 1 else np.zeros(values.size)
    return values


def compensated(imu: ImuRecording, effects: Mapping[str, Sequence[Effect]]) -> ImuRecording:
    """A recording less the effects of its temperature; the same one where it has none."""
    if imu.temperature is None or not any(effects.values()):
        return imu
    values = np.asarray(imu.temperature, dtype=np.float64)
    if not np.isfinite(values).all():
        return imu
    data = {"gyro": np.array(imu.gyro), "accel": np.array(imu.accel)}
    done = []
    for channel, own in effects.items():
        sensor, axis = channel.split("_")
        for effect in own:
            if effect.column == "temperature" and channel in imu.channels:
                data[sensor][:, "xyz".index(axis)] -= effect.of(values, imu.rate)
                done.append(f"{channel} {effect.words}")
    if not done:
        return imu
    history = (*imu.history, f"taken off: {', '.join(done)}")
    return replace(imu, gyro=data["gyro"], accel=data["accel"], history=history)
