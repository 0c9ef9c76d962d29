"""The time axis of a recording: columns of time in any unit, dates, GPS weeks, or a rate only."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from schuler import units
from schuler.data._checks import extreme_steps, median_step
from schuler.errors import InputError
from schuler.io.columns import Column, counter_column
from schuler.io.dates import TIME_OF_DAY, day_and_time, moments
from schuler.io.source import Columns, Notes, Source
from schuler.io.time_repair import (
    between_neighbours,
    joined_restarts,
    packet_size,
    spread_packets,
    unwrapped,
)
from schuler.types import FloatArray

RATE_FROM_README = "sampling rate taken from"
"""How a line of history begins when the rate was found in a README beside the file."""

# A count since 1970 tells its unit by its size: 1e8 s is 1973, 1e10 s is 2286.
_EPOCH_UNITS = ((1e17, 1e19, "ns"), (1e14, 1e16, "us"), (1e11, 1e13, "ms"), (1e8, 1e10, "s"))
_HERTZ = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?)\s*Hz\b")
_DAY_OF_1970 = (("MATLAB (datenum)", 719529.0), ("Excel", 25569.0))
_SCALES = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}


@dataclass(frozen=True, slots=True)
class Pace:
    """How fast a sensor can be sampled."""

    # slowest, fastest: samples a second
    slowest: float
    fastest: float

    def fits(self, step: float) -> bool:
        """Tell whether a step of time is plausible."""
        return 0.999 / self.fastest <= step <= 1.001 / self.slowest


IMU_PACE = Pace(2.0, 1e4)
GNSS_PACE = Pace(1.0 / 60.0, 250.0)
ANY_PACE = Pace(1.0 / 3600.0, 1e4)


def time_axis(
    source: Source,
    chosen: Mapping[str, Column],
    columns: Columns,
    time_unit: str | None,
    pace: Pace,
    notes: Notes,
) -> FloatArray:
    """Return the time stamps of a file in seconds."""
    column, week = chosen["time"], chosen.get("week")
    values = columns[column.name]
    form = time_unit if time_unit is not None and "%" in time_unit else None
    written = values.dtype.kind in "US"
    first = str(values[0]).strip() if written and values.size else ""
    if form is None and TIME_OF_DAY.fullmatch(first):
        time = day_and_time(source, chosen.get("date"), column, columns, notes)
        return unwrapped(time, f"'{column.name}'", notes)
    if values.dtype.kind in "US":
        notes.did(f"time from dates in '{column.name}'")
        return np.asarray(moments(source, column, values, form, notes))
    _check_resolution(source, column, values)
    notes.did(f"time from '{column.name}'")
    counts = values.astype(np.float64)
    if week is None:
        counts = unwrapped(counts, f"'{column.name}'", notes)
    unit = time_unit or column.unit
    origin = None if unit else _serial_dates(counts, pace)
    if origin is not None:
        name, start = origin
        counts, unit = counts - start, "day"
        notes.assumed(f"time taken as days of {name}: of that size, and nothing else gives a rate")
    if not unit:
        unit = _unit_by_size(source, column, counts, pace)
        notes.assumed(f"time taken as {unit}: no unit is named")
    factor = units.scale(unit, "time")
    # A division keeps one more digit than a product with 1e-9.
    time = counts / 1e9 if unit == "ns" else counts * factor
    if factor != 1.0:
        notes.did(f"time converted from {unit}")
    if "time_fraction" in chosen:
        part = chosen["time_fraction"]
        time = time + columns[part.name].astype(np.float64) * units.scale(part.unit, "time")
        notes.did(f"time from '{column.name}' and '{part.name}'")
    if week is not None and time.size:
        weeks = np.asarray(columns[week.name], dtype=np.float64)
        opening = weeks[np.isfinite(weeks)][:1]
        time = time + (weeks - (opening[0] if opening.size else 0.0)) * 604800.0
        notes.did(f"seconds of GPS week {opening[0] if opening.size else 0.0:.0f}")
    return np.asarray(time)


def repaired_time(time: FloatArray, notes: Notes) -> FloatArray:
    """Return time with packets spread, restarts put behind each other and stamps that repeat."""
    return between_neighbours(joined_restarts(spread_packets(time, notes), notes), notes)


def _serial_dates(counts: FloatArray, pace: Pace) -> tuple[str, float] | None:
    """Return which program's count of days this is, with the day of 1970; None: no days."""
    finite = counts[np.isfinite(counts)]
    step = np.diff(finite)
    forward = step[step > 0.0]
    if not forward.size:
        return None
    usual = float(np.median(forward))
    if not pace.fits(usual * 86400.0) or any(pace.fits(usual * f) for f in _SCALES.values()):
        return None
    day = float(np.median(finite))
    return next(((name, start) for name, start in _DAY_OF_1970 if 0.0 <= day - start < 36525.0),
                None)  # fmt: skip


def _unit_by_size(source: Source, column: Column, counts: FloatArray, pace: Pace) -> str:
    """Return the unit of time that nobody named: by the count since 1970, or by the rate."""
    finite = counts[np.isfinite(counts)]
    size = float(np.median(np.abs(finite))) if finite.size else 0.0
    epoch = next((unit for low, high, unit in _EPOCH_UNITS if low < size < high), "")
    step = np.diff(finite)
    forward = step[step > 0.0]
    if not forward.size:
        return epoch or "s"
    usual = float(np.median(forward))
    packets = packet_size(counts)
    if packets is not None:
        usual /= max(1.0, counts.size / max(1, np.unique(counts).size))
    if epoch and pace.fits(usual * _SCALES[epoch]):
        return epoch
    stated = source.rate
    if stated is not None:
        agreeing = [u for u, f in _SCALES.items() if abs(usual * f * stated - 1.0) < 0.1]
        if agreeing:
            return agreeing[0]
    fitting = [u for u, f in _SCALES.items() if pace.fits(usual * f)]
    if fitting and (fitting[0] == "s" or len(fitting) == 1):
        return fitting[0]
    if epoch:
        return epoch
    if not fitting:
        shown = "nothing fits"
        choice = "ms"
    else:
        shown = ", ".join(f"as {u} {_hertz(usual * _SCALES[u])}" for u in fitting)
        choice = fitting[0]
    raise InputError(
        f"time names no unit: as seconds, the samples are {usual:g} s apart; {shown}",
        expected=f"the unit of time; {pace.slowest:.3g} to {pace.fastest:g} samples a second",
        cure=f"name it, e.g. time_unit='{choice}'",
        where=f"{source.path}, column '{column.name}'",
    )


def _hertz(step: float) -> str:
    return f"{1.0 / step:.4g} Hz"


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


def shifted(time: FloatArray, offset: float, notes: Notes) -> FloatArray:
    """Return time moved by an offset that the user gave."""
    if not np.isfinite(offset):
        raise InputError(f"time_offset is {offset}", expected="a finite number of seconds")
    if offset:
        notes.did(f"{offset:+.6f} s added to time")
    return time + offset if offset else time


def even_axis(source: Source, rows: int, rate: float | None, notes: Notes) -> FloatArray:
    """Return the time of samples that are evenly spaced, for a file without a column of time."""
    if rate is not None:
        if not (np.isfinite(rate) and rate > 0.0):
            raise InputError(f"rate is {rate}", expected="a positive number of Hz")
        found, text = rate, f"time from row / {rate:g} Hz, as given"
    elif source.rate is not None:
        found, text = source.rate, f"time from row / {source.rate:g} Hz, in the file"
    else:
        found, name = _rate_beside(source.path)
        text = f"{RATE_FROM_README} {name}: {found:g} Hz; time from row / rate"
        notes.assumed(text)
    first: int | None = getattr(source, "first_row", None)
    counter = counter_column(source.names)
    if counter is not None and not source.is_text(counter):
        numbers = _counted(source, counter, rows, notes)
        if numbers is not None:
            # parts count on from each other
            numbers = numbers if first is not None else numbers - numbers[0]
            notes.did(text.replace("from row /", f"from '{counter}' /"))
            return numbers / found
    notes.did(text)
    return (np.arange(rows) + (first or 0)) / found


def _counted(source: Source, name: str, rows: int, notes: Notes) -> FloatArray | None:
    """Return the numbers of samples from a counter; None when it does not count them."""
    quiet = Notes()
    values = unwrapped(source.load((name,))[name].astype(np.float64), f"'{name}'", quiet)
    if values.size != rows or not np.isfinite(values).all() or rows < 2:
        return None
    step = np.diff(values)
    if step.min() < 1.0 or np.median(step) != 1.0 or np.any(step != np.round(step)):
        return None
    notes.assumed(*quiet.assumptions)
    lost = int(values[-1] - values[0]) + 1 - rows
    if lost:
        notes.assumed(f"'{name}' shows that {lost} samples are missing: their time is left empty")
    return np.asarray(values)


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


def check_steps(source: Source, column: Column, time: FloatArray, rows: Any, pace: Pace) -> None:
    """Raise when time does not run forward or cannot be what its unit says."""
    if time.size < 2:
        return
    if extreme_steps(time)[0] <= 0.0:
        raise _not_forward(source, column, time, rows, np.diff(time))
    usual = median_step(time)
    if pace.fits(usual):
        return
    fitting = [u for u, f in _SCALES.items() if pace.fits(usual * f)]
    text = f"{usual:g} s" if usual >= 1e-3 else f"{usual:.3g} s"
    raise InputError(
        f"the samples are {text} apart, a rate of {_hertz(usual)}",
        expected=f"{pace.slowest:.3g} to {pace.fastest:g} Hz",
        cure=f"say the right unit, e.g. time_unit='{fitting[0] if fitting else 'us'}', or, where "
        f"they are right, rate={1.0 / usual:.4g}",
        where=f"{source.path}, column '{column.name}'",
    )


def _not_forward(
    source: Source, column: Column, time: FloatArray, rows: Any, step: FloatArray
) -> InputError:
    """Return the error for stamps that repeat or go backwards, with the likely cause."""
    k = int(np.argmax(step <= 0.0))
    kind = "repeats" if step[k] == 0.0 else "goes backwards"
    count = int(np.sum(step <= 0.0))
    more = "" if count == 1 else f", as in {count} rows"
    expected, cure = "strictly increasing time", ""
    packets = packet_size(time)
    if packets is not None:
        text = f"{packets[0]}" if packets[0] == packets[1] else f"{packets[0]} to {packets[1]}"
        more += f": packets of {text} samples share one stamp"
        cure = "read it with repair=True to spread them evenly, or give rate="
    elif count > 0.5 * step.size and step.min() == 0.0:
        more += ": the stamps were written with too few digits"
        expected = "stamps whose resolution is finer than a sample"
        cure = "write the file again with more digits, or give rate="
    elif step.min() < 0.0 and step.size and joined_restarts(time, Notes()) is not time:
        more += ": the clock starts again"
        cure = "cut the file there, or read it with repair=True to put the parts behind each other"
    return InputError(
        f"time {kind} ({time[k]:.6f} s, then {time[k + 1]:.6f} s{more})",
        expected=expected,
        cure=cure or "correct the file, or read it with repair=True to leave such rows out",
        where=source.place(int(rows[k + 1]), column.name),
    )


def check_rate(source: Source, column: Column, time: FloatArray) -> None:
    """Raise when the samples have no rate: their steps differ too much from each other."""
    short, long = extreme_steps(time)
    if long <= 10.0 * short:
        return
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
