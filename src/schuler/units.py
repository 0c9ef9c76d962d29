"""The only place that knows degrees, hours, milli-g, mGal and ppm.

Everything inside the library is SI and radians (spec section 0). A person writes
``0.24 deg/sqrt(h)``; `parse` checks that this is the kind of quantity that is wanted and returns
the SI number; `format_value` writes it back. Angle counts as a dimension of its own, so that a
gyro value cannot be taken for an accelerometer value.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from functools import lru_cache
from typing import Literal

from schuler.errors import UnitError
from schuler.unit_grammar import (
    ACCELERATION,
    ANGLE,
    FREQUENCY,
    LENGTH,
    NONE,
    RATE,
    SPEED,
    STANDARD_GRAVITY,
    TIME,
    Dimension,
    dimension_of,
    evaluate,
)

__all__ = [
    "KINDS",
    "STANDARD_GRAVITY",
    "Kind",
    "format_value",
    "kind_of",
    "measures",
    "parse",
    "scale",
]

_NUMBER = re.compile(
    r"\s*(?P<number>[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?)(?P<rest>.*)$", re.S
)


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of quantity: what its unit must measure, and how people write it."""

    dimension: Dimension  # powers of length, time and angle
    si: str  # SI unit, as `format_value` writes it
    datasheet: str  # the unit of datasheets and papers


KINDS: dict[str, Kind] = {
    "gyro white noise": Kind(dimension_of(time="-1/2", angle="1"), "rad/s/sqrt(Hz)", "deg/sqrt(h)"),
    "accel white noise": Kind(
        dimension_of(length="1", time="-3/2"), "m/s^2/sqrt(Hz)", "m/s/sqrt(h)"
    ),
    "gyro bias instability": Kind(RATE, "rad/s", "deg/h"),
    "accel bias instability": Kind(ACCELERATION, "m/s^2", "m/s/h"),
    "gyro random walk": Kind(dimension_of(time="-3/2", angle="1"), "rad/s/sqrt(s)", "deg/h^1.5"),
    "accel random walk": Kind(dimension_of(length="1", time="-5/2"), "m/s^2/sqrt(s)", "m/s/h^1.5"),
    "gyro ramp": Kind(dimension_of(time="-2", angle="1"), "rad/s^2", "deg/h^2"),
    "accel ramp": Kind(dimension_of(length="1", time="-3"), "m/s^3", "m/s/h^2"),
    "gyro bias": Kind(RATE, "rad/s", "deg/s"),
    "accel bias": Kind(ACCELERATION, "m/s^2", "mg"),
    "gyro quantization": Kind(ANGLE, "rad", "arcsec"),
    "accel quantization": Kind(SPEED, "m/s", "m/s"),
    "correlation time": Kind(TIME, "s", "s"),
    "frequency": Kind(FREQUENCY, "Hz", "Hz"),
    "scale factor": Kind(NONE, "", "ppm"),
    "angular rate": Kind(RATE, "rad/s", "deg/s"),
    "acceleration": Kind(ACCELERATION, "m/s^2", "m/s^2"),
    "angle": Kind(ANGLE, "rad", "deg"),
    "velocity": Kind(SPEED, "m/s", "m/s"),
    "length": Kind(LENGTH, "m", "m"),
    "time": Kind(TIME, "s", "s"),
}
"""Every kind of quantity with a unit, by the name used in `parse` and `format_value`."""

_KIND_SYNONYMS = {
    "sigma": "bias",
    "turn-on bias": "bias",
    "amplitude": "bias",
    "gauss-markov": "bias",
    "rate random walk": "random walk",
    "slope": "ramp",
    "rate ramp": "ramp",
}
_MEASURED = {
    ANGLE: "an angle",
    RATE: "an angular rate",
    ACCELERATION: "an acceleration",
    SPEED: "a velocity",
    LENGTH: "a length",
    TIME: "a time",
    FREQUENCY: "a frequency",
    NONE: "a plain number",
}


def kind_of(name: str) -> Kind:
    """Return the kind of a name, forgiving about spelling."""
    text = " ".join(name.lower().replace("_", " ").split())
    text = text.replace("accelerometer", "accel").replace("gyroscope", "gyro")
    text = text.replace("quantisation", "quantization")
    if text not in KINDS:
        sensor, _, rest = text.partition(" ")
        text = f"{sensor} {_KIND_SYNONYMS.get(rest, rest)}"
    if text not in KINDS:
        raise UnitError(
            f"'{name}' is not a kind of quantity", expected=f"one of {', '.join(KINDS)}"
        )
    return KINDS[text]


def parse(text: str | float, kind: str, default_unit: str | None = None) -> float:
    """Return the SI value of a number with a unit."""
    wanted = kind_of(kind)
    if isinstance(text, (int, float)) and not isinstance(text, bool):
        return _finite(float(text), str(text))
    match = _NUMBER.match(str(text))
    if match is None:
        raise UnitError(
            f"'{text}' does not begin with a number",
            expected=f"a number with a unit, such as '1.5 {wanted.datasheet}'",
        )
    unit = match["rest"].strip()
    if unit[:1] == "," and unit[1:2].isdigit():
        raise UnitError(f"'{text}' has a decimal comma", expected="a decimal point")
    if not unit:
        unit = default_unit if default_unit is not None else ""
        if not unit and wanted.dimension != NONE:
            raise UnitError(
                f"'{text}' has no unit",
                expected=f"a unit for {kind}, such as '{text} {wanted.datasheet}'",
            )
    value = float(match["number"]) * scale(unit, kind)
    return _finite(value, str(text))


def format_value(
    value: float,
    kind: str,
    units: Literal["datasheet", "si"] | str = "datasheet",
    digits: int = 12,
) -> str:
    """Write an SI value with its unit, so that `parse` reads it back."""
    wanted = kind_of(kind)
    unit = {"datasheet": wanted.datasheet, "si": wanted.si}.get(units, units)
    return f"{value / scale(unit, kind):.{digits}g} {unit}".rstrip()


def scale(unit: str, kind: str) -> float:
    """Return the factor from a unit to SI."""
    wanted = kind_of(kind)
    factor, dimension = evaluate(unit)
    if dimension != wanted.dimension:
        found = _MEASURED.get(dimension, "of another kind")
        raise UnitError(
            f"unit '{unit}' is {found}",
            expected=f"a unit for {kind}, such as '{wanted.datasheet or wanted.si}'",
        )
    return factor


@lru_cache(1024)  # a name of a column is asked about in every way it could be meant
def measures(unit: str, kind: str) -> bool:
    """Tell whether a unit is known and measures that kind of quantity."""
    try:
        scale(unit, kind)
    except UnitError:
        return False
    return True


def _finite(value: float, text: str) -> float:
    if not math.isfinite(value):
        raise UnitError(f"'{text}' is not a finite number")
    return value
