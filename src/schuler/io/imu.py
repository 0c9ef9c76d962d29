"""From columns to an `ImuRecording`: units, increments, several IMUs in one file, bad rows."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from schuler import units
from schuler.data import ImuRecording
from schuler.errors import InputError
from schuler.io.clock import check_rate, check_steps, even_axis, shifted, time_axis
from schuler.io.columns import IMU_ROLES, Column, imu_numbers, missing, names_of_imu
from schuler.io.options import ReadOptions, choose_columns, unit_of
from schuler.io.source import Columns, Source
from schuler.types import FloatArray

_AXES = ("x", "y", "z")
_LONGEST_STEP = 0.5  # s; slower than 2 Hz is no IMU but a unit that was not named


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
    return (_assemble(source, chosen, columns, rows, options, options.name or source.path.stem),)


def _wanted(
    source: Source, numbers: tuple[int, ...], options: ReadOptions, only_first: bool
) -> tuple[tuple[int, str], ...]:
    """Return the numbers of the IMUs to be read, each with a line of history."""
    of_all = f"of {len(numbers)} in the file"
    if options.imu is None and only_first and len(numbers) > 1:
        text = f"IMU {numbers[0]} {of_all} (the first; choose another with imu=)"
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
    return _noted(_assemble(source, chosen, columns, rows, options, name), note)


def _noted(recording: ImuRecording, *notes: str) -> ImuRecording:
    return replace(recording, history=(*recording.history, *(n for n in notes if n)))


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
        recording = _assemble(source, chosen, block, rows[k], options, name)
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
) -> ImuRecording:
    """Build the recording of one IMU out of its columns; `rows` are their rows in the file."""
    _check_enough(source, rows.size)
    stamped = "time" in chosen and options.rate is None
    if stamped:
        time, notes = time_axis(source, chosen, columns, options.time_unit)
    else:
        time, notes = even_axis(source, rows.size, options.rate)
    time, moved = shifted(time, options.time_offset)
    gyro, accel, converted = _signals(source, chosen, columns, options)
    temperature, cold = _temperature(chosen, columns)
    keep, dropped = _usable_rows(source, chosen, time, gyro, accel, rows, options)
    if dropped:
        time, gyro, accel, rows = time[keep], gyro[keep], accel[keep], rows[keep]
        temperature = None if temperature is None else temperature[keep]
    if stamped:
        named = bool(options.time_unit or chosen["time"].unit)
        check_steps(source, chosen["time"], time, rows, np.inf if named else _LONGEST_STEP)
    _check_enough(source, time.size)
    if stamped:
        check_rate(source, chosen["time"], time)
    gyro, accel, divided = _rates_from_increments(chosen, time, gyro, accel, options)
    history = (f"read from {source.path.name}", *source.history, *notes, *moved)
    history = (*history, *converted, *cold, *dropped, *divided)
    return ImuRecording(time, gyro, accel, name, temperature, history)


def _check_enough(source: Source, count: int) -> None:
    if count < 3:
        raise InputError(
            f"the recording has {count} sample{'' if count == 1 else 's'}: no rate can be found",
            expected="at least 3",
            cure="check that the file is complete",
            where=str(source.path),
        )


def _temperature(
    chosen: dict[str, Column], columns: Columns
) -> tuple[FloatArray | None, list[str]]:
    """Return degrees Celsius, or None when not every row has a value."""
    if "temperature" not in chosen:
        return None, []
    values: FloatArray = columns[chosen["temperature"].name].astype(np.float64)
    if not np.isfinite(values).all():
        return None, ["temperature left out: it is not complete"]
    if chosen["temperature"].unit.lower() == "k":
        return values - 273.15, ["temperature converted from K"]
    return values, []


def _signals(
    source: Source, chosen: dict[str, Column], columns: Columns, options: ReadOptions
) -> tuple[FloatArray, FloatArray, list[str]]:
    """Return gyro and accelerometer in SI (rates, or increments not yet divided)."""
    n = _length(source, columns)
    result = {"gyro": np.full((n, 3), np.nan), "accel": np.full((n, 3), np.nan)}
    notes: list[str] = []
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
            values = columns[column.name].astype(np.float64)
            result[sensor][:, k] = values * factor if factor != 1.0 else values
            note = ""
            if assumed:
                note = f"{sensor} taken as {unit}: no unit is named"
            elif factor != 1.0:
                note = f"{sensor} converted from {unit.replace('_s2', '/s^2').replace('_', '/')}"
            if note and note not in notes:
                notes.append(note)
    return result["gyro"], result["accel"], notes


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
    time: FloatArray,
    gyro: FloatArray,
    accel: FloatArray,
    rows: Any,
    options: ReadOptions,
) -> tuple[Any, list[str]]:
    """Find rows that cannot be used: raise, or with repair return which to keep and why."""
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
    notes = [f"left out {int(bad.sum())} rows with NaN or no value"] if bad.any() else []
    if not options.repair:
        return keep if bad.any() else slice(None), notes
    latest = np.maximum.accumulate(np.where(keep, time, -np.inf))
    forward = np.ones(time.size, dtype=bool)
    forward[1:] = time[1:] > latest[:-1]
    late = int(np.sum(keep & ~forward))
    if late:
        notes.append(f"left out {late} rows whose time repeats or goes backwards")
    return keep & forward, notes


def _no_axis_all_zero(
    source: Source, chosen: dict[str, Column], gyro: FloatArray, accel: FloatArray
) -> None:
    for role, (_, _, sensor) in _KINDS.items():
        values = gyro if sensor == "gyro" else accel
        for k, axis in enumerate(_AXES):
            if f"{role}_{axis}" in chosen and not values[:, k].any():
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
) -> tuple[FloatArray, FloatArray, list[str]]:
    """Divide increments by the time since the sample before.

    After a gap the sensor has summed over one ordinary interval only, and the first sample has no
    sample before it: both are divided by the median step.
    """
    step = np.diff(time)
    usual = float(np.median(step))
    interval = np.concatenate([[usual], step])
    interval[interval > 1.5 * usual] = usual
    notes = []
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
            arrays[sensor] = arrays[sensor] / interval[:, np.newaxis]
            notes.append(f"{sensor} increments divided by the time step")
    return arrays["gyro"], arrays["accel"], notes
