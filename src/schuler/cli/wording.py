"""Messages of the library in the options of the command line."""

from __future__ import annotations

import re
from collections.abc import Mapping

# Argument of the readers: option of commands that read one file, of the IMU and of the GNSS of
# commands that read two.
_OPTIONS: Mapping[str, tuple[str, str, str]] = {
    "time_unit": ("--time-unit", "--imu-time-unit", "--gnss-time-unit"),
    "time_offset": ("--time-offset", "--imu-time-offset", "--gnss-time-offset"),
    "rate": ("--rate", "--imu-rate", "--gnss-rate"),
    "gyro_unit": ("--gyro-unit",) * 3,
    "accel_unit": ("--accel-unit",) * 3,
    "angle_unit": ("--angle-unit", "--gnss-angle-unit", "--gnss-angle-unit"),
    "velocity_unit": ("--velocity-unit", "--gnss-velocity-unit", "--gnss-velocity-unit"),
    "origin": ("--origin", "--gnss-origin", "--gnss-origin"),
    "position_sd": ("--position-sd", "--gnss-position-sd", "--gnss-position-sd"),
    "velocity_sd": ("--velocity-sd", "--gnss-velocity-sd", "--gnss-velocity-sd"),
    "delimiter": ("--delimiter", "--imu-delimiter", "--gnss-delimiter"),
    "decimal": ("--decimal", "--imu-decimal", "--gnss-decimal"),
    "comment": ("--comment", "--imu-comment", "--gnss-comment"),
    "skip_lines": ("--skip-lines", "--imu-skip-lines", "--gnss-skip-lines"),
    "topic": ("--ros-topic", "--imu-topic", "--gnss-topic"),
    "clock": ("--clock", "--imu-clock", "--gnss-clock"),
    "imu": ("--imu", "--imu-number", "--imu-number"),
    "repair": ("--repair",) * 3,
    "close_up": ("--repair",) * 3,
    "increments": ("--increments",) * 3,
    "align": ("--align",) * 3,
}
_COLUMN = ("--column", "--imu-column", "--gnss-column")
_COLUMNS = ("--columns", "--imu-columns", "--gnss-columns")
PLACES = {"one": 0, "imu": 1, "gnss": 2}
"""Which of the options is meant, by the file that is read."""

_VALUE = r"(?:'(?P<quoted>[^']*)'|(?P<bare>[^\s,;()'\"]*))"
_ARGUMENT = re.compile(rf"\b(?P<name>{'|'.join(_OPTIONS)})={_VALUE}")
_MAPPING = re.compile(r"\bcolumns=\{(?P<pairs>[^}]*)\}")
_SEQUENCE = re.compile(r"\bcolumns=\((?P<names>[^)]*)\)")


def in_options(text: str, place: str = "one") -> str:
    """Return a message with the arguments of Python as options of the command line."""
    k = PLACES[place]
    text = _MAPPING.sub(lambda m: _pairs(m["pairs"], _COLUMN[k]), text)
    text = _SEQUENCE.sub(lambda m: f"{_COLUMNS[k]} {_names(m['names'])}", text)
    text = re.sub(r"\bcolumns=", f"{_COLUMN[k]} ", text)
    return _ARGUMENT.sub(lambda m: _option(m, k), text)


def _option(match: re.Match[str], k: int) -> str:
    option = _OPTIONS[match["name"]][k]
    value = match["quoted"] if match["quoted"] is not None else match["bare"]
    if value in ("True", "False", ""):
        return option
    return f"{option} '{value}'" if re.search(r"[^\w.+-]", value) else f"{option} {value}"


def _names(text: str) -> str:
    return ",".join(n.strip().strip("'") for n in text.split(",")).strip(",")


def _pairs(text: str, option: str) -> str:
    shown = []
    for role, value in re.findall(r"'(\w+)':\s*(\([^)]*\)|[^,}]+)", text):
        if value.startswith("("):
            first = _names(value[1:-1]).split(",")[0].strip(".") or "NAME"
            shown.append(f"{option} {role}_x={first} and so on")
        else:
            name = value.strip().strip("'")
            shown.append(f"{option} {role}=" + {"...": "NAME", "None": ""}.get(name, name))
    return " ".join(shown) or f"{option} ROLE=NAME"
