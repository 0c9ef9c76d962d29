"""The time axis of a recording: columns of time in any unit, dates, GPS weeks, or a rate only."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from schuler import units
from schuler.errors import InputError
from schuler.io.columns import Column
from schuler.io.source import Columns, Source
from schuler.types import FloatArray

RATE_FROM_README = "sampling rate taken from"
"""How a line of history begins when the rate was found in a README beside the file."""

# A count since 1970 tells its unit by its size: 1e8 s is 1973, 1e10 s is 2286.
_EPOCH_UNITS = ((1e17, 1e19, "ns"), (1e14, 1e16, "us"), (1e11, 1e13, "ms"), (1e8, 1e10, "s"))
_TIME_OF_DAY = re.compile(r"\d\d?:\d\d:\d\d(?:[.,]\d+)?\s*Z?")
_HERTZ = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?)\s*Hz\b")


def time_axis(
    source: Source, chosen: Mapping[str, Column], columns: Columns, time_unit: str | None
) -> tuple[FloatArray, list[str]]:
    """Return the time stamps of a file in seconds."""
    column, week = chosen["time"], chosen.get("week")
    values = columns[column.name]
    if values.dtype.kind in "US" and values.size and _TIME_OF_DAY.fullmatch(values[0].strip()):
        date = chosen.get("date")
        if date is None or columns[date.name].dtype.kind not in "US":
            seconds = _dates(source, column, np.char.add("1970-01-01 ", np.char.strip(values)))
            return seconds, [f"time from time of day in '{column.name}', as seconds of the day"]
        joined = np.char.add(np.char.add(np.char.strip(columns[date.name]), " "), values)
        note = f"time from '{date.name}' and '{column.name}'"
        return _dates(source, column, joined), [note]
    if values.dtype.kind in "US":
        return _dates(source, column, values), [f"time from dates in '{column.name}'"]
    _check_resolution(source, column, values)
    unit = time_unit or column.unit
    history = [f"time from '{column.name}'"]
    if not unit:
        unit = _epoch_unit(values)
        history.append(f"time taken as {unit}: no unit is named")
    factor = units.scale(unit, "time")
    time = values.astype(np.float64) * factor
    if unit == "ns":  # a division keeps one more digit than a product with 1e-9
        time = values.astype(np.float64) / 1e9
    if factor != 1.0:
        history.append(f"time converted from {unit}")
    if week is not None and time.size:
        weeks = columns[week.name].astype(np.float64)
        first = weeks[np.isfinite(weeks)][:1]
        time = time + (weeks - (first[0] if first.size else 0.0)) * 604800.0
        history.append(f"seconds of GPS week {first[0] if first.size else 0.0:.0f}")
    return time, history


def _dates(source: Source, column: Column, values: Any) -> FloatArray:
    import polars

    text = polars.Series(values).str.strip_chars()
    text = text.str.replace_all("/", "-", literal=True).str.replace(",", ".", literal=True)
    text = text.str.replace(r"^(\d{4}-\d\d?-\d\d?)T", "${1} ").str.replace(
        r"\s*(Z|UTC|\+00:?00)$", ""
    )
    moments = text.str.to_datetime("%Y-%m-%d %H:%M:%S%.f", time_unit="ns", strict=False)
    bad = moments.is_null().to_numpy()
    if bad.any():
        row = int(np.argmax(bad))
        raise InputError(
            f"'{str(values[row])[:40]}' is not a time",
            expected="a number, or a date such as 2025-07-08T19:34:00.010 in UTC",
            cure="correct it, or name the right column with columns={'time': ...}",
            where=source.place(row, column.name),
        )
    counts = moments.to_physical().to_numpy()
    return np.asarray(counts // 10**9 + (counts % 10**9) / 1e9, dtype=np.float64)


def _check_resolution(source: Source, column: Column, values: Any) -> None:
    if values.dtype != np.float32 or values.size < 3:
        return
    step = float(np.median(np.diff(values.astype(np.float64))))
    grain = float(np.spacing(np.float32(np.nanmax(np.abs(values)))))
    if not grain > 0.05 * abs(step):
        return
    raise InputError(
        f"time is stored in 32-bit floats: at {np.nanmax(values):.6g} they are {grain:.2g} apart",
        expected="64-bit floats, or time counted from the start of the recording",
        cure="write the file again, or give rate= if the samples are evenly spaced",
        where=f"{source.path}, column '{column.name}'",
    )


def _epoch_unit(values: Any) -> str:
    size = float(np.nanmedian(np.abs(values))) if np.isfinite(values).any() else 0.0
    return next((unit for low, high, unit in _EPOCH_UNITS if low < size < high), "s")


def shifted(time: FloatArray, offset: float) -> tuple[FloatArray, list[str]]:
    """Return time moved by an offset that the user gave."""
    if not np.isfinite(offset):
        raise InputError(f"time_offset is {offset}", expected="a finite number of seconds")
    return (time + offset, [f"{offset:+.6f} s added to time"]) if offset else (time, [])


def even_axis(source: Source, rows: int, rate: float | None) -> tuple[FloatArray, list[str]]:
    """Return the time of samples that are evenly spaced, for a file without a column of time.

    The rate is the one given, or stated inside the file, or, at last, the one and only sampling
    rate that a README in the same folder states.
    """
    if rate is not None:
        if not (np.isfinite(rate) and rate > 0.0):
            raise InputError(f"rate is {rate}", expected="a positive number of Hz")
        return np.arange(rows) / rate, [f"time from row / {rate:g} Hz, as given"]
    if source.rate is not None:
        return np.arange(rows) / source.rate, [f"time from row / {source.rate:g} Hz, in the file"]
    found, name = _rate_beside(source.path)
    text = f"{RATE_FROM_README} {name}: {found:g} Hz; time from row / rate"
    return np.arange(rows) / found, [text]


def _rate_beside(path: Path) -> tuple[float, str]:
    cure = "give the rate in Hz with rate=, or name the column of time with columns={'time': ...}"
    readmes = sorted(p for p in path.parent.glob("[Rr][Ee][Aa][Dd][Mm][Ee]*") if p.is_file())
    stated: set[float] = set()
    for readme in readmes[:1]:
        text = readme.read_text(encoding="utf-8", errors="replace")[:100_000]
        stated = {float(m) for m in _HERTZ.findall(text)}
    if len(stated) == 1 and min(stated) > 0.0:
        return stated.pop(), readmes[0].name
    found = "there is no column of time and no sampling rate"
    if len(stated) > 1:
        several = ", ".join(f"{r:g}" for r in sorted(stated))
        found = (
            f"there is no column of time, and {readmes[0].name} states several rates ({several} Hz)"
        )
    raise InputError(found, expected="time stamps or a rate", cure=cure, where=str(path))


def check_steps(
    source: Source, column: Column, time: FloatArray, rows: Any, longest: float
) -> None:
    """Raise when time does not run forward or cannot be seconds."""
    step = np.diff(time)
    if step.size and step.min() <= 0.0:
        k = int(np.argmax(step <= 0.0))
        kind = "repeats" if step[k] == 0.0 else "goes backwards"
        count = int(np.sum(step <= 0.0))
        more = "" if count == 1 else f", as in {count} rows"
        raise InputError(
            f"time {kind} ({time[k]:.6f} s, then {time[k + 1]:.6f} s{more})",
            expected="strictly increasing time",
            cure="correct the file, or read it with repair=True to leave such rows out",
            where=source.place(int(rows[k + 1]), column.name),
        )
    if step.size and float(np.median(step)) >= longest:
        raise InputError(
            f"as seconds, the samples are {np.median(step):g} s apart",
            expected="the unit of time",
            cure="name it, e.g. time_unit='ms'",
            where=f"{source.path}, column '{column.name}'",
        )


def check_rate(source: Source, column: Column, time: FloatArray) -> None:
    """Raise when the samples have no rate: their steps differ too much from each other."""
    short, middle, long = np.percentile(np.diff(time), [10.0, 50.0, 90.0])
    if long <= 10.0 * short:
        return
    raise InputError(
        f"no sampling rate can be found: steps of time range from {short:.3g} s to {long:.3g} s "
        f"(median {middle:.3g} s)",
        expected="samples about evenly spaced",
        cure="name the sensor's own clock with columns={'time': ...}, or give rate=",
        where=f"{source.path}, column '{column.name}'",
    )
