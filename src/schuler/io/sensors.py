"""From columns to time series of the sensors beside IMU and GNSS: heading, air pressure, field."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from schuler import units
from schuler.errors import InputError, UnitError
from schuler.io.clock import ANY_PACE, time_axis
from schuler.io.columns import IMU_ROLES, Column, find_columns, missing
from schuler.io.source import Notes, Source
from schuler.types import FloatArray

_PRESSURE = {"pa": 1.0, "hpa": 100.0, "mbar": 100.0, "kpa": 1e3, "bar": 1e5}
_FIELD = {"t": 1.0, "mt": 1e-3, "ut": 1e-6, "nt": 1e-9, "g": 1e-4, "gauss": 1e-4, "mgauss": 1e-7}
_COUNTS = {"": 1.0, "ticks": 1.0, "counts": 1.0}
_OWN_UNITS = {"pressure": _PRESSURE, "magnetic field": _FIELD, "count": _COUNTS}
_TAIL = re.compile(r"^(?P<name>.*?)(?:[\s_]*[\[(](?P<bracket>[^\])]+)[\])]\s*|_(?P<tail>[^_]+))$")

_DEVIATION = r"(?:sd|std|stdev|sigma|deviation|accuracy|acc)"
_BAROMETER = r"(?:baro|barometer|barometric|pressure)?"
_MAGNETOMETER = r"(?:mag|magnetometer|magneticfield|magfield|field|magnetic|b|m)"


@dataclass(frozen=True, slots=True)
class SensorKind:
    """What a file of a sensor holds: one of several quantities, and perhaps its deviation."""

    name: str  # as it is called in messages
    # by name of the quantity: kind of its unit, and role and pattern of each column
    quantities: Mapping[str, tuple[str, tuple[tuple[str, str], ...]]]
    deviation: str  # pattern of the column with standard deviations
    example: str  # names of columns that are understood


HEADINGS = SensorKind(
    "heading",
    {"heading": ("angle", (("heading", r"(?:true|gnss|gps)?(?:heading|hdg|yaw|azimuth)"),))},
    rf"(?:heading|hdg|yaw|azimuth)?{_DEVIATION}|{_DEVIATION}(?:heading|hdg|yaw|azimuth)",
    "time_s, heading_deg, sd_deg",
)
BAROMETERS = SensorKind(
    "barometer",
    {
        "height": ("length", (("height", rf"{_BAROMETER}(?:height|altitude|alt|h)"),)),
        "pressure": (
            "pressure",
            (("pressure", r"(?:baro|barometric|air|static)?(?:pressure|press|p)|baro"),),
        ),
    },
    rf"{_BAROMETER}(?:height|altitude|alt)?{_DEVIATION}",
    "time_s, height_m, sd_m or time_s, pressure_hPa, sd_hPa",
)
MAGNETOMETERS = SensorKind(
    "magnetometer",
    {
        "field": (
            "magnetic field",
            tuple((f"field_{a}", rf"{_MAGNETOMETER}{a}|{a}{_MAGNETOMETER}") for a in "xyz"),
        )
    },
    rf"{_MAGNETOMETER}?{_DEVIATION}",
    "time_s, mag_x_uT, mag_y_uT, mag_z_uT, sd_uT",
)
_ODOMETER = r"(?:wheel|vehicle|odometer|odo|ground|forward|can)?"
ODOMETERS = SensorKind(
    "odometer",
    {
        "wheels": (
            "velocity",
            tuple((f"speed_{s}", rf"{_ODOMETER}(?:speed|vel|velocity)(?:rear)?{s}|"
                   rf"(?:rear)?{s}{_ODOMETER}(?:speed|vel|velocity)") for s in ("left", "right")),
        ),
        "speed": ("velocity", (("speed", rf"{_ODOMETER}(?:speed|velocity|vel|v)"),)),
        "ticks": ("count", (("ticks", rf"{_ODOMETER}(?:ticks?|counts?|pulses?|encoder)"),)),
    },
    rf"{_ODOMETER}(?:speed)?{_DEVIATION}",
    "time_s, speed_m_s; time_s, left_speed_m_s, right_speed_m_s; or time_s, ticks",
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class SensorSeries:
    """What a sensor measured, as it stands in a file."""

    time: FloatArray  # (n,): seconds, on the clock of the file
    quantity: str  # what was measured, e.g. "pressure".
    values: FloatArray  # in SI and radians
    # (n,): standard deviation of each, in the unit of the values; None: the file has none.
    sd: FloatArray | None


def sensor_series(
    source: Source, kind: SensorKind, *, unit: str | None = None, repair: bool = False
) -> SensorSeries:
    """Build the series of a sensor out of the columns of a file."""
    where = str(source.path)
    names = {name: _split(name, source.units.get(name, "")) for name in source.names}
    quantity = next((q for q in kind.quantities if _roles(kind, q, names)), None)
    if quantity is None:
        raise InputError(
            f"no column for {kind.name} among: {', '.join(source.names[:12])}",
            expected=f"names such as {kind.example}",
            where=where,
        )
    chosen = _roles(kind, quantity, names)
    if "time" not in chosen:
        raise missing("time", source.names, where, "")
    columns = source.load(tuple(dict.fromkeys(c.name for c in chosen.values())))
    measured = [role for role, _ in kind.quantities[quantity][1]]
    for role in (*measured, *(["sd"] if "sd" in chosen else [])):
        if source.is_text(chosen[role].name):
            place = source.place(0, chosen[role].name)
            raise InputError("the column holds text", expected="numbers", where=place)
    time = time_axis(source, chosen, columns, None, ANY_PACE, Notes())
    of = kind.quantities[quantity][0]
    factors = [_scale(chosen[r], of, unit, source) for r in measured]
    values = np.column_stack(
        [
            columns[chosen[r].name].astype(np.float64) * f
            for r, f in zip(measured, factors, strict=True)
        ]
    )
    bad = ~(np.isfinite(time) & np.isfinite(values).all(axis=1))
    sd = None
    if "sd" in chosen:
        column = chosen["sd"]
        factor = _scale(column, of, unit, source) if column.unit or unit else factors[0]
        sd = columns[column.name].astype(np.float64) * factor
        bad |= ~(np.isfinite(sd) & (sd > 0.0))
    if bad.any() and (bad.all() or not repair):
        raise InputError(
            f"{int(bad.sum())} of {bad.size} rows lack a number, or a deviation above zero",
            expected="time, values and a positive standard deviation in every row",
            cure="correct them, or leave them out with --repair",
            where=source.place(int(np.argmax(bad))),
        )
    kept = values[~bad]
    return SensorSeries(
        time[~bad],
        quantity,
        kept[:, 0] if len(measured) == 1 else kept,
        None if sd is None else sd[~bad],
    )


def _roles(
    kind: SensorKind, quantity: str, names: Mapping[str, tuple[str, str]]
) -> dict[str, Column]:
    """Return the columns of a quantity by role; none when it is not there."""
    wanted = kind.quantities[quantity][1]
    roles = {"date": IMU_ROLES["date"], "week": IMU_ROLES["week"], **dict(wanted)}
    roles["sd"] = kind.deviation
    stems = {stem: name for name, (stem, _) in reversed(list(names.items()))}
    stated = {stem: unit for stem, unit in names.values() if unit}
    found = {
        role: Column(role, stems[c.name], c.unit)
        for role, c in find_columns(tuple(stems), roles, stated).items()
    }
    return found if all(role in found for role, _ in wanted) else {}


def _split(name: str, stated: str) -> tuple[str, str]:
    """Split off a unit of pressure or field; other units are left to the names."""
    match = _TAIL.match(name)
    if match and match["name"]:
        unit = (match["bracket"] or match["tail"]).strip()
        if any(_plain(unit) in table for table in _OWN_UNITS.values()):
            return match["name"], unit
    return name, stated


def _plain(unit: str) -> str:
    return unit.strip().lower().replace("µ", "u").replace("μ", "u")


def _scale(column: Column, kind: str, given: str | None, source: Source) -> float:
    unit = given or column.unit
    known = _OWN_UNITS.get(kind)
    if not unit and kind not in ("length", "count"):
        raise InputError(
            f"column '{column.name}' does not say its unit",
            expected="a name such as " + _example(column, kind),
            cure="name it so, or say the unit as an option",
            where=str(source.path),
        )
    if known is None:
        return units.scale(unit or "m", kind)
    if _plain(unit) not in known:
        raise UnitError(
            f"'{unit}' is not a unit of {kind}",
            expected="out of " + ", ".join(known),
            where=str(source.path),
        )
    return known[_plain(unit)]


def _example(column: Column, kind: str) -> str:
    ending = {
        "angle": "deg", "pressure": "hPa", "magnetic field": "uT", "velocity": "m_s"
    }[kind]  # fmt: skip
    return f"{column.name}_{ending}"
