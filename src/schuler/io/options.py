"""What a user can say about a recording, checked once at the door."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from schuler import units
from schuler.errors import InputError, UnitError
from schuler.io.columns import Column, find_columns, missing, split_unit
from schuler.io.source import Source, TextOptions


@dataclass(frozen=True, slots=True)
class ReadOptions:
    """Options of `read_imu` and `read_gnss`; their docstrings explain each.

    Parameters
    ----------
    columns : mapping or sequence, optional
        Which column is what.
    time_unit, gyro_unit, accel_unit, angle_unit, velocity_unit : str, optional
        Units; a pattern such as ``%d.%m.%Y %H:%M:%S%.f`` for time written as dates.
    time_offset : float
        Seconds added to the time.
    rate : float, optional
        Hz.
    increments : bool, optional
        Whether the columns hold increments.
    delimiter, decimal, comment, skip_lines, header
        Layout of text, see `TextOptions`.
    imu : int, optional
        Number of the IMU in a file of several.
    topic, clock : str, optional
        Of ROS bags.
    origin : sequence of 3 floats, optional
        Latitude rad, longitude rad, height m.
    position_sd, velocity_sd : float, optional
        Standard deviations where the file has none, m and m/s.
    repair : bool
        Leave out bad rows.
    missing : bool
        Leave out rows without a number, and nothing else.
    name : str, optional
        Name of the recording.
    """

    columns: Mapping[str, Any] | Sequence[str] | None = None
    time_unit: str | None = None
    time_offset: float = 0.0
    gyro_unit: str | None = None
    accel_unit: str | None = None
    angle_unit: str | None = None
    velocity_unit: str | None = None
    rate: float | None = None
    increments: bool | None = None
    delimiter: str | None = None
    decimal: str | None = None
    comment: str | None = None
    skip_lines: int = 0
    header: bool | None = None
    imu: int | None = None
    topic: str | None = None
    clock: Literal["header", "bag"] = "header"
    origin: Sequence[float] | None = None
    position_sd: float | None = None
    velocity_sd: float | None = None
    repair: bool = False
    missing: bool = False
    name: str | None = None

    def text(self) -> TextOptions:
        """Return the part that lays out text files."""
        names: tuple[str, ...] = ()
        if self.columns is not None and not isinstance(self.columns, Mapping):
            given = [str(n or "") for n in self.columns]
            names = tuple(n or f"column{k}" for k, n in enumerate(given))
        if self.decimal not in (None, ".", ","):
            raise InputError(f"decimal is '{self.decimal}'", expected="'.' or ','")
        if self.skip_lines < 0:
            raise InputError(f"skip_lines is {self.skip_lines}", expected="0 or more")
        return TextOptions(
            self.delimiter,
            self.decimal,
            self.comment,
            self.skip_lines,
            self.header,
            names,
            self.repair,
        )


def choose_columns(
    source: Source, names: Sequence[str], roles: Mapping[str, str], options: ReadOptions
) -> dict[str, Column]:
    """Find the columns by their names, then put what the user said over it."""
    found = find_columns(names, roles, source.units)
    if not isinstance(options.columns, Mapping):
        return found
    for role, given in _single(options.columns).items():
        if role != "time" and role not in roles:
            raise InputError(
                f"columns= names '{role}'",
                expected=f"out of time, {', '.join(roles)}",
                where=str(source.path),
            )
        if given is None:
            found.pop(role, None)
            continue
        name = given
        if isinstance(given, int) and 0 <= given < len(source.names):
            name = source.names[given]
        if name not in source.names:
            raise missing(f"{role} ('{given}')", source.names, str(source.path))
        unit = source.units.get(name, split_unit(name)[1])
        found[role] = Column(role, name, unit)
        for other in _OTHERS.get(role, ()):
            if other not in options.columns:
                found.pop(other, None)
    return found


# What one column says in place of another: a velocity up leaves no velocity down.
_OTHERS = {
    "time": ("time_fraction",),
    "velocity_up": ("velocity_down",),
    "velocity_down": ("velocity_up",),
    "up": ("down",),
    "down": ("up",),
}


def _single(columns: Mapping[str, Any]) -> dict[str, Any]:
    """Spread ``gyro=("wx", "wy", "wz")`` over gyro_x, gyro_y, gyro_z."""
    result: dict[str, Any] = {}
    for role, given in columns.items():
        if isinstance(given, (str, int)) or given is None:
            result[role] = given
            continue
        axes = ("x", "y", "z")
        if role in ("velocity", "position_sd", "velocity_sd"):
            axes = ("north", "east", "down")
        if len(given) != 3:
            raise InputError(f"columns= gives {len(given)} columns for {role}", expected="three")
        if role == "position":
            result |= dict(zip(("latitude", "longitude", "height"), given, strict=True))
        else:
            result |= {f"{role}_{a}": g for a, g in zip(axes, given, strict=True)}
    return result


def unit_of(column: Column, given: str | None, kind: str, default: str) -> tuple[float, str, bool]:
    """Return factor, unit, and whether it was only assumed."""
    unit = column.unit
    if given:
        return units.scale(given, kind), given, False
    try:
        return units.scale(unit or default, kind), unit or default, not unit
    except UnitError as error:
        raise UnitError(
            f"column '{column.name}' is read as {kind}: {error.found}",
            expected=error.expected,
            cure="name the column that is meant with "
            f"columns={{'{column.role}': ...}}, or the unit that is right",
        ) from None
