"""Grades of inertial sensors, from a phone's to a tactical one (typical values of the classes)."""

from __future__ import annotations

from typing import TYPE_CHECKING

from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.noise import NoiseModel

# white noise, bias instability and constant at switch-on, gyro then accelerometer
GRADES: dict[str, tuple[tuple[str, str, str], tuple[str, str, str]]] = {
    "phone": (("0.4 deg/sqrt(h)", "20 deg/h", "1 deg/s"), ("0.1 m/s/sqrt(h)", "0.15 mg", "20 mg")),
    "consumer": (
        ("0.3 deg/sqrt(h)", "12 deg/h", "0.3 deg/s"),
        ("0.045 m/s/sqrt(h)", "0.1 mg", "10 mg"),
    ),
    "industrial": (
        ("0.15 deg/sqrt(h)", "6 deg/h", "0.1 deg/s"),
        ("0.025 m/s/sqrt(h)", "0.03 mg", "3 mg"),
    ),
    "tactical": (
        ("0.07 deg/sqrt(h)", "1 deg/h", "10 deg/h"),
        ("0.03 m/s/sqrt(h)", "0.3 mg", "1 mg"),
    ),
}
"""By name; the tactical ones are those of spec 1.5 (of the class of the LN200)."""
SHORTEST, LONGEST = 1.0, 1e4
"""Correlation times of the bias instability, s."""


def grade_noise(name: str) -> NoiseModel:
    """Return the noise of a grade of inertial sensor."""
    if name not in GRADES:
        raise InputError(f"no grade '{name}' of IMU", expected=f"one of {', '.join(GRADES)}")
    from schuler.data import CHANNELS
    from schuler.noise import BiasInstability, NoiseModel, TurnOnBias, WhiteNoise
    from schuler.units import parse

    kinds = {}
    for sensor, texts in zip(("gyro", "accel"), GRADES[name], strict=True):
        white, bias, start = (
            parse(text, f"{sensor} {what}")
            for text, what in zip(texts, ("white noise", "bias", "bias"), strict=True)
        )
        kinds[sensor] = (
            WhiteNoise(white) + BiasInstability(bias, SHORTEST, LONGEST) + TurnOnBias(start)
        )
    return NoiseModel(
        {c: kinds[c.split("_")[0]] for c in CHANNELS},
        source=f"{name} grade, typical values of the class",
    )
