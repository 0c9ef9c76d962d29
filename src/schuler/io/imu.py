"""From columns to an `ImuRecording`: units, increments, several IMUs in one file, bad rows."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from schuler import units
from schuler.data import ImuRecording
from schuler.data._checks import all_finite, median_step
from schuler.errors import InputError
from schuler.io.clock import (
    IMU_PACE,
    check_rate,
    check_steps,
    even_axis,
    repaired_time,
    shifted,
    time_axis,
)
from schuler.io.columns import (
    IMU_ROLES,
    Column,
    bare,
    imu_numbers,
    missing,
    names_of_imu,
    unused_rates,
)
from schuler.io.options import ReadOptions, choose_columns, unit_of
from schuler.io.source import Columns, Notes, Source
from schuler.io.time_repair import on_one_axis
from schuler.io.units_by_physics import Taken, confirm_units, refuse_impossible
from schuler.types import FloatArray

_AXES = ("x", "y", "z")
_FEW = 20  # rows that may be left out of any file


def imu_recordings(
    source: Source, options: ReadOptions, only_first: bool
) -> tuple[ImuRecording, ...]:
    """Return every IMU of a file, or the one that the options name."""
    side_by_side = imu_numbers(source.names)
    if len(side_by_side) > 1:
        return tuple(
            _one_of_wide(source, number, options, note)
            for number, note in _wanted(source, side_by_side, options, only_first)
        )
    chosen = choose_columns(source, source.names, IMU_ROLES, options)
    if not side_by_side and "imu" in chosen and not source.is_text(chosen["imu"].name):
        return _from_blocks(source, chosen, options, only_first)
    if side_by_side:
        return (_one_of_wide(source, side_by_side[0], options, ""),)
    columns = _load(source, chosen)
    rows = np.arange(_length(source, columns))
    notes = _notes(source, source.names, chosen, options)
    name = options.name or source.path.stem
    return (_assemble(source, chosen, columns, rows, options, name, notes),)


def _wanted(
    source: Source, numbers: tuple[int, ...], options: ReadOptions, only_first: bool
) -> tuple[tuple[int, str], ...]:
    """Return the numbers of the IMUs to be read, each with a line of history."""
    of_all = f"of {len(numbers)} in the file"
    if options.imu is None and only_first and len(numbers) > 1:
        text = f"IMU {numbers[0]} {of_all} (the first; choose another with imu={numbers[-1]})"
        return ((numbers[0], text),)
    if options.imu is None:
        return tuple((k, f"IMU {k} {of_all}") for k in numbers)
    if options.imu not in numbers:
        raise InputError(
            f"there is no IMU {options.imu}",
            expected=f"one of {', '.join(map(str, numbers))}",
            where=str(source.path),
        )
    return ((options.imu, f"IMU {options.imu} {of_all}"),)


def _one_of_wide(source: Source, number: int, options: ReadOptions, note: str) -> ImuRecording:
    """Return one IMU of a file with columns imuK_gyro_x, ..."""
    names = names_of_imu(source.names, number)
    found = choose_columns(source, tuple(names), IMU_ROLES, options)
    chosen = {r: Column(r, names.get(c.name, c.name), c.unit) for r, c in found.items()}
    columns = _load(source, chosen)
    rows = np.arange(_length(source, columns))
    name = options.name or f"{source.path.stem} imu{number}"
    notes = _notes(source, tuple(names.values()), chosen, options)
    return _noted(_assemble(source, chosen, columns, rows, options, name, notes), note)


def _noted(recording: ImuRecording, *notes: str) -> ImuRecording:
    lines = tuple(n for n in notes if n)
    chosen = tuple(n for n in lines if "choose another" in n or "replaced by" in n)
    return replace(
        recording,
        history=(*recording.history, *lines),
        assumptions=(*recording.assumptions, *chosen),
    )


def _refuse_parted(source: Source, names: tuple[str, ...]) -> None:
    """Refuse what phones make of their accelerometers: gravity, and acceleration without it."""
    bares = {n: bare(n) for n in names}
    gravity = [n for n, b in bares.items() if "gravity" in b]
    rest = [n for n, b in bares.items() if re.search("(?:user|linear)acc", b)]
    if len(gravity) >= 3 and len(rest) >= 3:
        raise InputError(
            f"the accelerometers stand in two parts: {gravity[0]}, ... and {rest[0]}, ...",
            expected="what they measured, which is the sum of both",
            cure="add them, or leave the accelerometers out with columns={'accel_x': None}",
            where=str(source.path),
        )


def _notes(
    source: Source, names: tuple[str, ...], chosen: dict[str, Column], options: ReadOptions
) -> Notes:
    """Begin the notes of a recording: what its file says, and which columns are not used."""
    notes = Notes((f"read from {source.path.name}", *source.history), source.assumptions)
    unused = unused_rates(names, chosen.values(), source.units)
    told = options.columns if isinstance(options.columns, Mapping) else {}
    for sensor, kind in (("gyro", "angular rate"), ("accel", "acceleration")):
        there = any(_plays(chosen, r) for r, (_, _, s) in _KINDS.items() if s == sensor)
        left = unused.get(kind, [])
        shown = ", ".join(left[:6]) + (", ..." if len(left) > 6 else "")
        refused = any(r.startswith(sensor) for r in told)
        if not there and len(left) >= 3 and not refused:
            raise InputError(
                f"no column for {sensor}, but not used, with a unit of {kind}: {shown}",
                expected=f"names such as {sensor}_x",
                cure=f"say which is which with columns={{'{sensor}': ('{left[0]}', ...)}}, or "
                f"leave the sensor out with columns={{'{sensor}_x': None}}",
                where=str(source.path),
            )
        if sensor == "accel" and not (there or refused):
            _refuse_parted(source, names)
        if left:
            notes.assumed(f"not used, though with a unit of {kind}: {shown}")
    lacking = [s for s in ("gyro", "accel")
               if not any(_plays(chosen, r) for r, k in _KINDS.items() if k[2] == s)]  # fmt: skip
    if lacking and not any(r.startswith(lacking[0]) for r in told):
        notes.assumed(f"no columns for {lacking[0]}: not recorded")
    turned = {"gyro_x": r"roll_?rate", "gyro_y": r"pitch_?rate", "gyro_z": r"yaw_?rate"}
    if all(r in chosen and re.search(p, chosen[r].name, re.I) for r, p in turned.items()):
        notes.assumed("gyro x, y, z taken from the rates of roll, pitch, yaw")
    return notes


def _from_blocks(
    source: Source, chosen: dict[str, Column], options: ReadOptions, only_first: bool
) -> tuple[ImuRecording, ...]:
    """Return the IMUs of a file in long form: a column says which IMU a row belongs to."""
    columns = _load(source, chosen)
    which = columns[chosen["imu"].name]
    if not np.isfinite(which).all():
        row = int(np.argmax(~np.isfinite(which)))
        raise InputError("the number of the IMU is missing", where=source.place(row, "imu"))
    numbers = tuple(int(k) for k in np.unique(which))
    rows = {k: np.flatnonzero(which == k) for k in numbers}
    shared: dict[int, tuple[FloatArray, str]] = {}
    if "time" in chosen and not options.repair:
        shared = _shared_clock({k: columns[chosen["time"].name][r] for k, r in rows.items()})
    recordings = []
    for k, one_of_many in _wanted(source, numbers, options, only_first):
        block: Columns = {n: c[rows[k]] for n, c in columns.items()}
        note = ""
        if k in shared:
            block[chosen["time"].name], note = shared[k]
        name = options.name or f"{source.path.stem} imu{k}"
        notes = _notes(source, source.names, chosen, options)
        recording = _assemble(source, chosen, block, rows[k], options, name, notes)
        recordings.append(_noted(recording, one_of_many, note))
    return tuple(recordings)


def _shared_clock(times: dict[int, Any]) -> dict[int, tuple[FloatArray, str]]:
    """Correct repeated stamps of an IMU by those of the others on the same clock."""
    result = {}
    for number, stamps in times.items():
        time = np.array(stamps, dtype=np.float64)
        repeats = np.flatnonzero(np.diff(time) == 0.0)
        if not 0 < repeats.size <= max(3, 0.001 * time.size):
            continue
        others = np.unique(np.concatenate([t for k, t in times.items() if k != number] or [[]]))
        first = time[repeats[0]]
        for row in repeats[repeats > 0]:
            a, b = np.searchsorted(others, [time[row - 1], time[row]])
            slots = others[a:b][np.diff(others[a:b], prepend=time[row - 1]) > 1e-6]
            slots = slots[slots < time[row] - 1e-6]
            if slots.size == 1:
                time[row] = slots[0]
        if np.diff(time).min() > 0.0:
            count = f"{repeats.size} wrong time stamp{'s' if repeats.size > 1 else ''}"
            result[number] = (
                time,
                f"{count} (first {first:.6f} s, repeated) replaced by that of the other IMUs of "
                "the file, which share the clock",
            )
    return result


def _load(source: Source, chosen: dict[str, Column]) -> Columns:
    signals = [r for r in chosen if r.rpartition("_")[0] in _KINDS]
    if not signals:
        raise missing("angular rate or specific force", source.names, str(source.path))
    for role in (*signals, "temperature", "week", "imu"):
        if role in chosen and source.is_text(chosen[role].name):
            raise InputError(
                "the column holds text",
                expected="numbers",
                cure="correct it, or name the right columns with columns=",
                where=source.place(0, chosen[role].name),
            )
    return source.load(tuple(dict.fromkeys(c.name for c in chosen.values())))


_KINDS = {
    "gyro": ("angular rate", "rad/s", "gyro"),
    "accel": ("acceleration", "m/s^2", "accel"),
    "angle_step": ("angle", "rad", "gyro"),
    "velocity_step": ("velocity", "m/s", "accel"),
}


def _length(source: Source, columns: Columns) -> int:
    return int(next(iter(columns.values())).size) if columns else 0


def _assemble(
    source: Source,
    chosen: dict[str, Column],
    columns: Columns,
    rows: Any,
    options: ReadOptions,
    name: str,
    notes: Notes,
) -> ImuRecording:
    """Build the recording of one IMU out of its columns; `rows` are their rows in the file."""
    _check_enough(source, rows.size)
    stamped = "time" in chosen and options.rate is None
    if stamped:
        time = time_axis(source, chosen, columns, options.time_unit, IMU_PACE, notes)
        time = repaired_time(time, notes) if options.repair else time
    else:
        time = even_axis(source, rows.size, options.rate, notes)
    time = shifted(time, options.time_offset, notes)
    gyro, accel, taken = _signals(source, chosen, columns, options, notes)
    temperature = _temperature(chosen, columns, notes)
    merged = on_one_axis(time, gyro, accel, notes)
    if merged is not None:
        gyro, accel, own = merged
        time, gyro, accel, rows = time[own], gyro[own], accel[own], rows[own]
        temperature = None if temperature is None else temperature[own]
    keep = _usable_rows(source, chosen, (time, gyro, accel), rows, options, notes)
    if not isinstance(keep, slice):
        time, gyro, accel, rows = time[keep], gyro[keep], accel[keep], rows[keep]
        temperature = None if temperature is None else temperature[keep]
    _check_enough(source, time.size)
    if stamped:
        check_steps(source, chosen["time"], time, rows, IMU_PACE)
        check_rate(source, chosen["time"], time)
    gyro, accel = _rates_from_increments(chosen, time, gyro, accel, options, notes)
    where = str(source.path)
    confirm_units(time, gyro, accel, taken, notes, where)
    said = Taken(options.gyro_unit is not None, options.accel_unit is not None)
    refuse_impossible(gyro, accel, said, where)
    return ImuRecording(
        time, gyro, accel, name, temperature, tuple(notes.history), tuple(notes.assumptions)
    )


def _check_enough(source: Source, count: int) -> None:
    if count < 3:
        raise InputError(
            f"the recording has {count} sample{'' if count == 1 else 's'}: no rate can be found",
            expected="at least 3",
            cure="check that the file is complete",
            where=str(source.path),
        )


def _temperature(chosen: dict[str, Column], columns: Columns, notes: Notes) -> FloatArray | None:
    """Return degrees Celsius, or None when not every row has a value."""
    if "temperature" not in chosen:
        return None
    values: FloatArray = columns[chosen["temperature"].name].astype(np.float64)
    if not np.isfinite(values).all():
        notes.assumed("temperature left out: it is not complete")
        return None
    if chosen["temperature"].unit.lower() == "k":
        notes.did("temperature converted from K")
        return values - 273.15
    return values


def _signals(
    source: Source,
    chosen: dict[str, Column],
    columns: Columns,
    options: ReadOptions,
    notes: Notes,
) -> tuple[FloatArray, FloatArray, Taken]:
    """Return gyro and accelerometer in SI (rates, or increments not yet divided)."""
    n = _length(source, columns)
    result = {"gyro": np.full((n, 3), np.nan), "accel": np.full((n, 3), np.nan)}
    taken = set()
    for role, (kind, default, sensor) in _KINDS.items():
        if not _plays(chosen, role) or (role.endswith("step") and _plays(chosen, sensor)):
            continue
        for k, axis in enumerate(_AXES):
            column = chosen.get(f"{role}_{axis}")
            if column is None:
                continue
            given = options.gyro_unit if sensor == "gyro" else options.accel_unit
            its_kind, its_default = _kind(given or column.unit, role, options)
            factor, unit, assumed = unit_of(column, given, its_kind or kind, its_default or default)
            values = columns[column.name].astype(np.float64, copy=False)
            result[sensor][:, k] = values * factor if factor != 1.0 else values
            if assumed:
                taken.add(sensor)
            elif factor != 1.0:
                written = unit.replace("_s2", "/s^2").replace("_", "/")
                notes.did(f"{sensor} converted from {written}")
    return result["gyro"], result["accel"], Taken("gyro" in taken, "accel" in taken)


def _plays(chosen: dict[str, Column], role: str) -> bool:
    return any(f"{role}_{axis}" in chosen for axis in _AXES)


def _kind(unit: str, role: str, options: ReadOptions) -> tuple[str, str]:
    """Return kind and default unit where a rate's column holds increments."""
    if role == "gyro" and (options.increments or (unit and units.measures(unit, "angle"))):
        return ("angular rate", "rad/s") if options.increments is False else ("angle", "rad")
    if role == "accel" and (options.increments or (unit and units.measures(unit, "velocity"))):
        return ("acceleration", "m/s^2") if options.increments is False else ("velocity", "m/s")
    return "", ""


def _usable_rows(
    source: Source,
    chosen: dict[str, Column],
    signals: tuple[FloatArray, FloatArray, FloatArray],
    rows: Any,
    options: ReadOptions,
    notes: Notes,
) -> Any:
    """Find rows that cannot be used: raise, or with repair return which to keep."""
    time, gyro, accel = signals
    if not options.repair and all(all_finite(values) for values in signals):
        _no_axis_all_zero(source, chosen, gyro, accel)
        return slice(None)
    bad = ~np.isfinite(time)
    first = ("time", bad) if bad.any() else None
    for role, (_, _, sensor) in _KINDS.items():
        values = gyro if sensor == "gyro" else accel
        for k, axis in enumerate(_AXES):
            one = ~np.isfinite(values[:, k])
            if f"{role}_{axis}" not in chosen or not one.any():
                continue
            if one.all():
                raise InputError(
                    f"the column of {sensor} {axis} holds no numbers",
                    expected="values, or no such column",
                    where=source.place(int(rows[0]), chosen[f"{role}_{axis}"].name),
                )
            first = first or (f"{role}_{axis}", one)
            bad |= one
    _no_axis_all_zero(source, chosen, gyro, accel)
    if first is not None and not (options.repair or options.missing):
        role, one = first
        row = int(np.argmax(one))
        raise InputError(
            f"NaN or no value in {int(bad.sum())} of {bad.size} rows",
            expected="a number in every row",
            cure="read it with repair=True to leave these rows out",
            where=source.place(int(rows[row]), chosen[role].name),
        )
    keep = ~bad
    if bad.any():
        line = f"left out {int(bad.sum())} rows with NaN or no value"
        (notes.assumed if options.repair else notes.did)(line)
    if not options.repair:
        return keep if bad.any() else slice(None)
    latest = np.maximum.accumulate(np.where(keep, time, -np.inf))
    forward = np.ones(time.size, dtype=bool)
    forward[1:] = time[1:] > latest[:-1]
    late = int(np.sum(keep & ~forward))
    if late > max(_FEW, 0.01 * time.size):
        row = int(np.argmax(keep & ~forward))
        raise InputError(
            f"time repeats or goes backwards in {late} of {time.size} rows: too many to leave out",
            expected="a clock that runs forward, but for 1 % of the rows",
            cure="correct the time, name another column with columns={'time': ...}, or give rate=",
            where=source.place(int(rows[row]), chosen["time"].name if "time" in chosen else ""),
        )
    if late:
        notes.assumed(f"left out {late} rows whose time repeats or goes backwards")
    return keep & forward if bad.any() or late else slice(None)


def _no_axis_all_zero(
    source: Source, chosen: dict[str, Column], gyro: FloatArray, accel: FloatArray
) -> None:
    for role, (_, _, sensor) in _KINDS.items():
        values = gyro if sensor == "gyro" else accel
        for k, axis in enumerate(_AXES):
            if f"{role}_{axis}" in chosen and not (values[0, k] or values[:, k].any()):
                raise InputError(
                    f"{sensor} {axis} is zero in all {values.shape[0]} rows: no sensor does that",
                    expected="measured values",
                    cure=f"check it, or leave it out with columns={{'{role}_{axis}': None}}",
                    where=f"{source.path}, column '{chosen[f'{role}_{axis}'].name}'",
                )


def _rates_from_increments(
    chosen: dict[str, Column],
    time: FloatArray,
    gyro: FloatArray,
    accel: FloatArray,
    options: ReadOptions,
    notes: Notes,
) -> tuple[FloatArray, FloatArray]:
    """Divide increments by the time since the sample before.

    After a gap the sensor has summed over one ordinary interval only, and the first sample has no
    sample before it: both are divided by the median step.
    """
    arrays = {"gyro": gyro, "accel": accel}
    for sensor, role, kind in (
        ("gyro", "angle_step", "angle"),
        ("accel", "velocity_step", "velocity"),
    ):
        unit = next((chosen[f"{sensor}_{a}"].unit for a in _AXES if f"{sensor}_{a}" in chosen), "")
        given = options.gyro_unit if sensor == "gyro" else options.accel_unit
        stepwise = _plays(chosen, role) and not _plays(chosen, sensor)
        if not stepwise and _plays(chosen, sensor):
            stepwise = bool(options.increments) or (
                options.increments is None
                and bool(given or unit)
                and units.measures(given or unit, kind)
            )
        if stepwise:
            arrays[sensor] = arrays[sensor] / _summed_over(time)[:, np.newaxis]
            notes.did(f"{sensor} increments divided by the time step")
    return arrays["gyro"], arrays["accel"]


def _summed_over(time: FloatArray) -> FloatArray:
    """Return the interval that each sample has summed over."""
    usual = median_step(time)
    interval = np.diff(time, prepend=time[0] - usual)
    interval[interval > 1.5 * usual] = usual
    return interval
