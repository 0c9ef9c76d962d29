"""From columns to a `GnssRecording`: geodetic, earth-fixed or local positions, and their errors."""

from __future__ import annotations

from typing import Any

import numpy as np

from schuler import units
from schuler.data import GnssRecording
from schuler.errors import InputError
from schuler.io.clock import check_steps, even_axis, shifted, time_axis
from schuler.io.columns import GNSS_ROLES, Column, missing
from schuler.io.options import ReadOptions, choose_columns, unit_of
from schuler.io.source import Columns, Source
from schuler.types import FloatArray

_NED = ("north", "east", "down")
_LONGEST_STEP = 120.0  # s between fixes, when no unit of time is named
_POSITIONS = (
    ("latitude", "longitude", "height"),
    ("ecef_x", "ecef_y", "ecef_z"),
    ("north", "east", "down"),
    ("north", "east", "up"),
)


class _Table:
    """The columns of a file by role, converted to SI."""

    def __init__(self, source: Source, chosen: dict[str, Column], columns: Columns) -> None:
        self.source = source
        self.chosen = chosen
        self.columns = columns
        self.notes: list[str] = []

    def has(self, *roles: str) -> bool:
        return all(r in self.chosen for r in roles)

    def values(self, role: str, kind: str, default: str, given: str | None = None) -> FloatArray:
        column = self.chosen[role]
        if self.source.is_text(column.name):
            raise InputError(
                "the column holds text",
                expected="numbers",
                where=self.source.place(0, column.name),
            )
        factor, unit, assumed = unit_of(column, given, kind, default)
        if assumed and default != units.KINDS[kind].si:
            self.note(f"{role} taken as {unit}: no unit is named")
        elif factor != 1.0:
            self.note(f"{role} converted from {unit}")
        values: FloatArray = self.columns[column.name].astype(np.float64) * factor
        return values

    def plain(self, role: str) -> FloatArray:
        values: FloatArray = self.columns[self.chosen[role].name].astype(np.float64)
        return values

    def note(self, text: str) -> None:
        if text not in self.notes:
            self.notes.append(text)


def gnss_recording(source: Source, options: ReadOptions) -> GnssRecording:
    """Build the recording of a receiver out of the columns of a file."""
    chosen = choose_columns(source, source.names, GNSS_ROLES, options)
    _check_position(source, chosen, options)
    chosen = {
        r: c for r, c in chosen.items() if r in ("time", "date") or not source.is_text(c.name)
    }
    columns = source.load(tuple(dict.fromkeys(c.name for c in chosen.values())))
    table = _Table(source, chosen, columns)
    position = _position(table, options)
    time, notes = _time(table, position.shape[0], options)
    time, moved = shifted(time, options.time_offset)
    keep, dropped = _usable(table, time, position, options)
    velocity, velocity_sd = _velocity(table)
    position_sd = _position_sd(table)
    quality = _quality(table)
    history = notes + moved + table.notes + dropped
    rows = np.arange(time.size)[keep]
    if "time" in chosen and options.rate is None:
        named = bool(options.time_unit or chosen["time"].unit)
        check_steps(source, chosen["time"], time[keep], rows, np.inf if named else _LONGEST_STEP)
    recording = GnssRecording(
        time[keep],
        position[keep],
        _given_or(position_sd, options.position_sd, keep),
        None if velocity is None else velocity[keep],
        None if velocity is None else _given_or(velocity_sd, options.velocity_sd, keep),
        None if quality is None else quality[keep],
        options.name or source.path.stem,
        (f"read from {source.path.name}", *source.history, *history),
    )
    return recording.with_standard_deviations(options.position_sd, options.velocity_sd)


def _given_or(values: FloatArray | None, given: float | None, keep: Any) -> FloatArray | None:
    """Drop the file's standard deviations where the user gave one; keep 'not measured'."""
    if values is None:
        return None
    kept: FloatArray = values[keep]
    return kept if given is None else np.where(np.isinf(kept), np.inf, np.nan)


def _check_position(source: Source, chosen: dict[str, Column], options: ReadOptions) -> None:
    complete = [p for p in _POSITIONS if all(r in chosen for r in p)]
    if not complete:
        started = max(_POSITIONS, key=lambda p: sum(r in chosen for r in p))
        lacking = [r for r in started if r not in chosen]
        raise missing(" and ".join(lacking), source.names, str(source.path))
    text = [r for r in complete[0] if source.is_text(chosen[r].name)]
    if text:
        raise InputError(
            "the column holds text",
            expected="numbers",
            cure="correct it, or name the right columns with columns=",
            where=source.place(0, chosen[text[0]].name),
        )


def _time(table: _Table, size: int, options: ReadOptions) -> tuple[FloatArray, list[str]]:
    if table.has("time") and options.rate is None:
        return time_axis(table.source, table.chosen, table.columns, options.time_unit)
    return even_axis(table.source, size, options.rate)


def _position(table: _Table, options: ReadOptions) -> FloatArray:
    if table.has(*_POSITIONS[0]):
        latitude = table.values("latitude", "angle", "deg", options.angle_unit)
        longitude = table.values("longitude", "angle", "deg", options.angle_unit)
        height = table.values("height", "length", "m")
        name = table.chosen["height"].name
        if "msl" in name.lower():
            table.note(f"height from '{name}': above mean sea level, not the ellipsoid")
        return np.column_stack([latitude, longitude, height])
    if table.has(*_POSITIONS[1]):
        from schuler.earth import geodetic_from_ecef

        table.note("position converted from earth-fixed x, y, z")
        xyz = np.column_stack([table.values(f"ecef_{a}", "length", "m") for a in "xyz"])
        return np.asarray(geodetic_from_ecef(xyz), dtype=np.float64)
    from schuler.earth import geodetic_from_ned

    down = (
        table.values("down", "length", "m")
        if table.has("down")
        else -table.values("up", "length", "m")
    )
    ned = np.column_stack([table.values(a, "length", "m") for a in ("north", "east")] + [down])
    if options.origin is None:
        table.note(
            "local coordinates without an origin: placed at 45 deg north, 0 deg east, height 0; "
            "only differences of position mean something, and gravity is uncertain by 0.03 m/s²"
        )
        origin = np.array([np.pi / 4.0, 0.0, 0.0])
    else:
        table.note("position converted from local coordinates about the given origin")
        origin = np.asarray(options.origin, dtype=np.float64)
    return np.asarray(geodetic_from_ned(ned, origin), dtype=np.float64)


def _usable(
    table: _Table, time: FloatArray, position: FloatArray, options: ReadOptions
) -> tuple[Any, list[str]]:
    """Return which epochs have a time and a position; raise when some have not."""
    bad = ~np.isfinite(time) | ~np.isfinite(position).all(axis=1)
    if bad.any() and not options.repair:
        raise InputError(
            f"no time or no position in {int(bad.sum())} of {bad.size} epochs",
            expected="a number in every row",
            cure="read it with repair=True to leave these epochs out",
            where=table.source.place(int(np.argmax(bad))),
        )
    if not options.repair:
        return slice(None), []
    keep = ~bad
    latest = np.maximum.accumulate(np.where(keep, time, -np.inf))
    forward = np.ones(time.size, dtype=bool)
    forward[1:] = time[1:] > latest[:-1]
    late = int(np.sum(keep & ~forward))
    notes = [f"left out {int(bad.sum())} epochs without time or position"] if bad.any() else []
    if late:
        notes.append(f"left out {late} epochs whose time repeats or goes backwards")
    if not (keep & forward).any():
        raise InputError("no epoch has a time and a position", where=str(table.source.path))
    return keep & forward, notes


def _velocity(table: _Table) -> tuple[FloatArray | None, FloatArray | None]:
    """Return velocity and standard deviation; what was not measured is 0 with infinite sd."""
    if table.has("velocity_north", "velocity_east"):
        north = table.values("velocity_north", "velocity", "m/s")
        east = table.values("velocity_east", "velocity", "m/s")
    elif table.has("speed", "course"):
        speed = table.values("speed", "velocity", "m/s")
        course = table.values("course", "angle", "deg")
        north, east = speed * np.cos(course), speed * np.sin(course)
        table.note("velocity computed from speed and course")
    else:
        return None, None
    if table.has("velocity_down"):
        down = table.values("velocity_down", "velocity", "m/s")
    elif table.has("velocity_up"):
        down = -table.values("velocity_up", "velocity", "m/s")
        table.note("velocity down from velocity up")
    else:
        down = np.full(north.size, np.nan)
        table.note("velocity down was not measured")
    velocity = np.column_stack([north, east, down])
    sd = _spread(table, "velocity_sd", "velocity", "m/s")
    if sd is None:
        sd = np.full(velocity.shape, np.nan)
    unknown = ~np.isfinite(velocity)
    if unknown[:, :2].any():
        table.note(f"{int(unknown[:, 0].sum())} epochs have no velocity")
    return np.where(unknown, 0.0, velocity), np.where(unknown, np.inf, sd)


def _position_sd(table: _Table) -> FloatArray | None:
    sd = _spread(table, "position_sd", "length", "m")
    if sd is not None:
        return sd
    if not table.has("horizontal_accuracy"):
        return None
    # Receivers state the radial horizontal accuracy: sqrt(2) times that of one component.
    horizontal = table.values("horizontal_accuracy", "length", "m") / np.sqrt(2.0)
    down = np.full(horizontal.size, np.nan)
    if table.has("vertical_accuracy"):
        down = table.values("vertical_accuracy", "length", "m")
    table.note("position standard deviations from horizontal accuracy / sqrt(2)")
    return np.column_stack([horizontal, horizontal, down])


def _spread(table: _Table, role: str, kind: str, unit: str) -> FloatArray | None:
    """Return (n, 3) standard deviations from three columns, or from one for all."""
    if table.has(*(f"{role}_{a}" for a in _NED)):
        return np.column_stack([table.values(f"{role}_{a}", kind, unit) for a in _NED])
    if table.has(role):
        table.note(f"'{table.chosen[role].name}' taken for each of north, east, down")
        return np.repeat(table.values(role, kind, unit)[:, np.newaxis], 3, axis=1)
    return None


def _quality(table: _Table) -> Any:
    if not table.has("quality"):
        return None
    values = table.plain("quality")
    return np.where(np.isfinite(values), values, 0.0).astype(np.int64)
