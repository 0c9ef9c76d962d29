"""From columns to a `GnssRecording`: geodetic, earth-fixed or local positions, and their errors."""

from __future__ import annotations

from typing import Any

import numpy as np

from schuler import units
from schuler.data import GnssRecording
from schuler.errors import InputError
from schuler.io.clock import GNSS_PACE, check_steps, even_axis, shifted, time_axis
from schuler.io.columns import GNSS_ROLES, Column, missing
from schuler.io.gnss_checks import check_motion, check_vertical, held, unfixed
from schuler.io.options import ReadOptions, choose_columns, unit_of
from schuler.io.source import Columns, Notes, Source
from schuler.types import BoolArray, FloatArray

_NED = ("north", "east", "down")
_FEW = 20  # epochs that may be left out of any file
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
        self.notes = Notes((f"read from {source.path.name}", *source.history), source.assumptions)

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
            self.notes.assumed(f"{role} taken as {unit}: no unit is named")
        elif factor != 1.0:
            self.notes.did(f"{role} converted from {unit}")
        values: FloatArray = self.plain(role) * factor
        return values

    def plain(self, role: str) -> FloatArray:
        values: FloatArray = self.columns[self.chosen[role].name].astype(np.float64)
        return values


def gnss_recording(source: Source, options: ReadOptions) -> GnssRecording:
    """Build the recording of a receiver out of the columns of a file."""
    chosen = choose_columns(source, source.names, GNSS_ROLES, options)
    _check_position(source, chosen, options)
    chosen = {
        r: c for r, c in chosen.items() if r in ("time", "date") or not source.is_text(c.name)
    }
    columns = source.load(tuple(dict.fromkeys(c.name for c in chosen.values())))
    table = _Table(source, chosen, columns)
    notes = table.notes
    position = _signed(table, _position(table, options))
    time = _time(table, position.shape[0], options)
    time = shifted(time, options.time_offset, notes)
    velocity, velocity_sd = _velocity(table, options)
    keep = _usable(table, time, position, velocity, options)
    position_sd = _position_sd(table)
    quality = _quality(table)
    rows = np.flatnonzero(keep)
    if "time" in chosen and options.rate is None:
        check_steps(source, chosen["time"], time[keep], rows, GNSS_PACE)
    speed = None if velocity is None else velocity[keep]
    check_motion(time[keep], position[keep], speed, notes, str(source.path))
    if speed is not None and (table.has("velocity_down") or table.has("velocity_up")):
        measured = check_vertical(time[keep], position[keep], speed, str(source.path))
        if not measured and velocity_sd is not None:
            notes.assumed("vertical velocity is always 0: taken as not measured")
            velocity_sd[:, 2] = np.inf
    recording = GnssRecording(
        time[keep],
        position[keep],
        _given_or(position_sd, options.position_sd, keep),
        speed,
        None if velocity is None else _given_or(velocity_sd, options.velocity_sd, keep),
        None if quality is None else quality[keep],
        options.name or source.path.stem,
        tuple(notes.history),
        tuple(notes.assumptions),
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
        if lacking == ["height"]:
            raise InputError(
                "there is no height beside latitude and longitude",
                expected="a column such as height_m",
                cure="name it with columns={'height': ...}, or write the file with heights",
                where=str(source.path),
            )
        raise missing(" and ".join(lacking), source.names, str(source.path))
    text = [r for r in complete[0] if source.is_text(chosen[r].name)]
    if text:
        raise InputError(
            "the column holds text",
            expected="numbers",
            cure="correct it, or name the right columns with columns=",
            where=source.place(0, chosen[text[0]].name),
        )


def _time(table: _Table, size: int, options: ReadOptions) -> FloatArray:
    if table.has("time") and options.rate is None:
        unit = options.time_unit
        return time_axis(table.source, table.chosen, table.columns, unit, GNSS_PACE, table.notes)
    return even_axis(table.source, size, options.rate, table.notes)


def _angles(table: _Table, options: ReadOptions) -> tuple[FloatArray, FloatArray, bool]:
    """Return latitude and longitude in radians, and whether they were scaled whole numbers."""
    unit = options.angle_unit or table.chosen["latitude"].unit
    raw = [table.plain(r) for r in ("latitude", "longitude")]
    finite = [r[np.isfinite(r)] for r in raw]
    most = [float(np.abs(r).max()) if r.size else 0.0 for r in finite]
    where = str(table.source.path)
    if unit:
        pair = [table.values(r, "angle", "deg", options.angle_unit)
                for r in ("latitude", "longitude")]  # fmt: skip
        return pair[0], pair[1], False
    whole = all(bool(np.all(r == np.round(r))) for r in finite)
    if most[0] > 91.0 and whole and most[0] * 1e-7 <= 90.0 and most[1] * 1e-7 <= 360.0:
        table.notes.assumed("latitude and longitude taken as 1e-7 deg: whole numbers of that size")
        return np.radians(raw[0] * 1e-7), np.radians(raw[1] * 1e-7), True
    if most[0] > 91.0:
        minutes = all(bool(np.all(np.abs(r) % 100.0 < 60.0)) for r in finite) and most[0] < 9060.0
        hint = (
            "it looks like ddmm.mmmm of NMEA, degrees and minutes in one number"
            if minutes
            else "it is no latitude in degrees"
        )
        raise InputError(
            f"latitude is {most[0]:g}: {hint}",
            expected="degrees",
            cure="write the file in degrees: whole hundreds are degrees, the rest divided by 60 is "
            "added, south and west are negative"
            if minutes
            else "write the file in degrees, say angle_unit='1e-7 deg' or the like, or, where "
            "they are exchanged, columns={'latitude': ..., 'longitude': ...}",
            where=where,
        )
    if 0.0 < most[0] <= np.pi / 2 + 1e-9 and most[1] <= np.pi + 1e-9:
        raise InputError(
            f"latitude and longitude name no unit and stay within {max(most):.3g}: radians, or "
            "degrees near 0, 0",
            expected="their unit",
            cure="say angle_unit='rad' or angle_unit='deg'",
            where=where,
        )
    pair = [table.values(r, "angle", "deg", None) for r in ("latitude", "longitude")]
    return pair[0], pair[1], False


def _signed(table: _Table, position: FloatArray) -> FloatArray:
    """Apply hemispheres that stand in columns of their own (N or S, E or W)."""
    if not table.has(*_POSITIONS[0]):
        return position
    signed = position.copy()
    texts = [n for n in table.source.names if table.source.is_text(n)]
    for name, letters in table.source.load(tuple(texts)).items() if texts else ():
        letters = np.char.upper(np.char.strip(letters.astype(str)))
        there = set(np.unique(letters)) - {""}
        for k, (plus, minus) in enumerate((("N", "S"), ("E", "W"))):
            if there and there <= {plus, minus}:
                size = np.abs(position[:, k])
                signed[:, k] = np.where(letters == minus, -size, size)
                table.notes.did(f"hemisphere from '{name}'")
    turned = np.abs(signed[:, 1]) > np.pi
    signed[turned, 1] = np.remainder(signed[turned, 1] + np.pi, 2.0 * np.pi) - np.pi
    return signed


def _height(table: _Table, scaled: bool) -> FloatArray:
    column = table.chosen["height"]
    raw = table.plain("height")
    if scaled and not column.unit and bool(np.all(raw == np.round(raw))):
        table.notes.assumed("height taken as mm: whole numbers beside 1e-7 deg")
        height = raw * 1e-3
    else:
        height = table.values("height", "length", "m")
    name = column.name.lower()
    if "msl" in name:
        table.notes.assumed(f"height from '{column.name}': above mean sea level, not the ellipsoid")
    elif name.startswith("alt") and "ell" not in name:
        table.notes.assumed(f"height from '{column.name}', taken as above the ellipsoid")
    return height


def _position(table: _Table, options: ReadOptions) -> FloatArray:
    if table.has(*_POSITIONS[0]):
        latitude, longitude, scaled = _angles(table, options)
        return np.column_stack([latitude, longitude, _height(table, scaled)])
    if table.has(*_POSITIONS[1]):
        from schuler.earth import geodetic_from_ecef

        table.notes.did("position converted from earth-fixed x, y, z")
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
        if "baseline" in table.chosen["north"].name:
            raise InputError(
                "this is a baseline solution: east, north, up from a base",
                expected="the position of the base",
                cure="say origin=(latitude, longitude, height) in radians and metres",
                where=str(table.source.path),
            )
        table.notes.assumed(
            "local coordinates without an origin: placed at 45 deg north, 0 deg east, height 0; "
            "only differences of position mean something, and gravity is uncertain by 0.03 m/s²"
        )
        origin = np.array([np.pi / 4.0, 0.0, 0.0])
    else:
        table.notes.did("position converted from local coordinates about the given origin")
        origin = np.asarray(options.origin, dtype=np.float64)
    return np.asarray(geodetic_from_ned(ned, origin), dtype=np.float64)


def _usable(
    table: _Table,
    time: FloatArray,
    position: FloatArray,
    velocity: FloatArray | None,
    options: ReadOptions,
) -> BoolArray:
    """Return which epochs are fixes of their own; raise when some have no time or position."""
    notes, where = table.notes, table.source
    empty = unfixed(position)
    if empty.any() and not empty.all():
        notes.assumed(f"left out {int(empty.sum())} epochs at 0, 0: no fix yet")
    bad = (~np.isfinite(time) | ~np.isfinite(position).all(axis=1)) & ~empty
    if bad.any() and not options.repair:
        raise InputError(
            f"no time or no position in {int(bad.sum())} of {bad.size} epochs",
            expected="a number in every row",
            cure="read it with repair=True to leave these epochs out",
            where=where.place(int(np.argmax(bad))),
        )
    keep = ~bad & ~(empty & ~empty.all())
    if bad.any():
        notes.assumed(f"left out {int(bad.sum())} epochs without time or position")
    if keep.sum() > 2:
        rows = np.flatnonzero(keep)
        again = held(time[rows], position[rows], None if velocity is None else velocity[rows])
        if again.any():
            notes.assumed(
                f"left out {int(again.sum())} epochs that repeat the fix before: held fixes"
            )
            keep[rows[again]] = False
    if options.repair:
        _leave_out_late(table, time, keep)
    if not keep.any():
        raise InputError("no epoch has a time and a position", where=str(where.path))
    return keep


def _leave_out_late(table: _Table, time: FloatArray, keep: BoolArray) -> None:
    latest = np.maximum.accumulate(np.where(keep, time, -np.inf))
    forward = np.ones(time.size, dtype=bool)
    forward[1:] = time[1:] > latest[:-1]
    late = int(np.sum(keep & ~forward))
    if late > max(_FEW, 0.01 * time.size):
        raise InputError(
            f"time repeats or goes backwards in {late} of {time.size} epochs: too many to leave "
            "out",
            expected="a clock that runs forward, but for 1 % of the epochs",
            cure="correct the time, or name another column with columns={'time': ...}",
            where=str(table.source.path),
        )
    if late:
        table.notes.assumed(f"left out {late} epochs whose time repeats or goes backwards")
        keep &= forward


def _velocity(table: _Table, options: ReadOptions) -> tuple[FloatArray | None, FloatArray | None]:
    """Return velocity and standard deviation; what was not measured is 0 with infinite sd."""
    unit = options.velocity_unit
    if table.has("velocity_north", "velocity_east"):
        north = table.values("velocity_north", "velocity", "m/s", unit)
        east = table.values("velocity_east", "velocity", "m/s", unit)
    elif table.has("speed", "course"):
        speed = table.values("speed", "velocity", "m/s", unit)
        course = table.values("course", "angle", "deg")
        north, east = speed * np.cos(course), speed * np.sin(course)
        table.notes.did("velocity computed from speed and course")
    else:
        return None, None
    if table.has("velocity_down"):
        down = table.values("velocity_down", "velocity", "m/s", unit)
    elif table.has("velocity_up"):
        down = -table.values("velocity_up", "velocity", "m/s", unit)
        table.notes.did("velocity down from velocity up")
    else:
        down = np.full(north.size, np.nan)
        table.notes.did("velocity down was not measured")
    velocity = np.column_stack([north, east, down])
    sd = _spread(table, "velocity_sd", "velocity", "m/s")
    if sd is None:
        sd = np.full(velocity.shape, np.nan)
    unknown = ~np.isfinite(velocity)
    if unknown[:, :2].any():
        table.notes.did(f"{int(unknown[:, 0].sum())} epochs have no velocity")
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
    table.notes.did("position standard deviations from horizontal accuracy / sqrt(2)")
    return np.column_stack([horizontal, horizontal, down])


def _spread(table: _Table, role: str, kind: str, unit: str) -> FloatArray | None:
    """Return (n, 3) standard deviations from three columns, or from one for all."""
    if table.has(*(f"{role}_{a}" for a in _NED)):
        return np.column_stack([table.values(f"{role}_{a}", kind, unit) for a in _NED])
    if table.has(role):
        table.notes.assumed(f"'{table.chosen[role].name}' taken for each of north, east, down")
        return np.repeat(table.values(role, kind, unit)[:, np.newaxis], 3, axis=1)
    return None


def _quality(table: _Table) -> Any:
    if not table.has("quality"):
        return None
    values = table.plain("quality")
    return np.where(np.isfinite(values), values, 0.0).astype(np.int64)
