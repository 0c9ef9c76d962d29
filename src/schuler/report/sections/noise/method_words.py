"""Names and units of parameters and signals on the pages about methods."""

from __future__ import annotations

import re

from schuler.data.imu import CHANNELS
from schuler.noise.noise_model_file import parameter_kind
from schuler.report.sections.noise.parameters import WORDS
from schuler.report.sections.recording import channel_title, pretty
from schuler.units import kind_of, scale

_UNITS = {"gyro": ("gyro bias", "deg/h"), "accel": ("accel bias", "ug")}


def shown_name(name: str) -> str:
    """Return the name of a signal for people."""
    if name in CHANNELS:
        return channel_title(name)
    return name or "Signal"


def unit_of(name: str) -> tuple[str, float]:
    """Return the unit in which deviations of a signal are drawn."""
    kind, unit = _UNITS.get(name.split("_")[0], ("", ""))
    return (pretty(unit), scale(unit, kind)) if kind else ("", 1.0)


def quantity(parameter: str, name: str) -> tuple[str, str, float]:
    """Return how a parameter is shown."""
    match = re.match(r"^([a-z_]+?)(?:_(\d+))?\.(\w+)$", parameter)
    words = parameter.replace("_", " ").replace(".", " ")
    if match:
        words = WORDS.get(f"{match[1]}.{match[3]}", words)
        if match[2]:
            words = words.replace("Gauss-Markov", f"Gauss-Markov {match[2]}")
    kind = parameter_kind(name, parameter)
    if name.split("_")[0] not in _UNITS and not parameter.endswith("correlation_time"):
        return words, "SI", 1.0
    if kind is None:
        return words, "", 1.0
    unit = kind_of(kind).datasheet
    return words, pretty(unit), scale(unit, kind)
