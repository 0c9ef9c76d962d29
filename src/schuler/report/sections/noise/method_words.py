"""Names and units of parameters and signals on the pages about methods."""

from __future__ import annotations

from schuler.data.imu import CHANNELS
from schuler.noise.parameter_names import parameter_kind, spoken_name
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
    words = spoken_name(parameter).replace(" sigma", " σ")
    kind = parameter_kind(name, parameter)
    if name.split("_")[0] not in _UNITS and not parameter.endswith("correlation_time"):
        return words, "SI", 1.0
    if kind is None:
        return words, "", 1.0
    unit = kind_of(kind).datasheet
    return words, pretty(unit), scale(unit, kind)
