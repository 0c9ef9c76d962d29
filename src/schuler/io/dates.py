"""Moments written as text: ISO 8601 with zones, and the many other ways."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING, Any

import numpy as np

from schuler.errors import InputError
from schuler.io.columns import Column
from schuler.io.source import Notes, Source
from schuler.types import FloatArray

if TYPE_CHECKING:
    import polars

TIME_OF_DAY = re.compile(r"\d\d?:\d\d:\d\d(?:[.,]\d+)?\s*Z?")
_ISO = re.compile(r"\d{4}[-/.]\d\d?[-/.]\d\d?")
_DOTTED = re.compile(r"(\d\d?)\.(\d\d?)\.(\d{4})")
_SLASHED = re.compile(r"(\d\d?)[/-](\d\d?)[/-](\d{4})")
_NAMED = re.compile(r"\d\d?[- ][A-Za-z]{3,9}[- ]\d{4}")


def moments(source: Source, column: Column, values: Any, form: str | None, notes: Notes) -> Any:
    """Return seconds of the Unix epoch of a column of dates.

    `form` is a pattern of `strptime` that the user gave in place of a unit of time.
    """
    import polars

    text = polars.Series(values.astype(str)).str.strip_chars()
    first = str(text[0]) if len(text) else ""
    if form is not None:
        pattern = form
    else:
        text, pattern = _prepared(source, column, text, first, notes)
    zoned = bool(re.search(r"[+-]\d\d:?\d\d$", str(text[0]) if len(text) else ""))
    if form is None and zoned:
        pattern += "%#z"
        notes.did("zone of the time stamps taken into account")
    try:
        read = text.str.to_datetime(pattern, time_unit="ns", strict=False)
    except polars.exceptions.PolarsError:
        read = polars.Series([None] * len(text), dtype=polars.Datetime("ns"))
    bad = read.is_null().to_numpy()
    if bad.any():
        raise _no_time(source, column, values, int(np.argmax(bad)))
    counts = read.to_physical().to_numpy()
    return np.asarray(counts // 10**9 + (counts % 10**9) / 1e9, dtype=np.float64)


def _prepared(
    source: Source, column: Column, text: polars.Series, first: str, notes: Notes
) -> tuple[polars.Series, str]:
    """Bring the date to the front, year first, and return the pattern of what is then there."""
    afternoon = bool(re.search(r"\d\s*[AaPp]\.?[Mm]\.?$", first))
    text = text.str.replace(r"(\d)\s*([AaPp])\.?[Mm]\.?$", "${1} ${2}M").str.replace(
        r"\s*(Z|UTC|GMT)$", ""
    )
    clock = "%I:%M:%S%.f %p" if afternoon else "%H:%M:%S%.f"
    if _ISO.match(first):
        text = text.str.replace(r"^(\d{4})[-/.](\d\d?)[-/.](\d\d?)[T_ ]?\s*", "${1}-${2}-${3} ")
    elif _NAMED.match(first):
        text = text.str.replace(r"^(\d\d?)[- ]([A-Za-z]{3})[A-Za-z]*[- ](\d{4})[T, ]*",
                                "${3}-${2}-${1} ")  # fmt: skip
        text, clock = _points(text), clock
        return text, f"%Y-%b-%d {clock}"
    elif _DOTTED.match(first) or _SLASHED.match(first):
        dotted = _DOTTED.match(first) is not None
        day_first = _day_first(source, column, text, dotted, afternoon)
        order = "day.month.year" if day_first else "month/day/year"
        notes.assumed(f"dates in '{column.name}' taken as {order}, in UTC")
        year = "${3}-${2}-${1} " if day_first else "${3}-${1}-${2} "
        text = text.str.replace(r"^(\d\d?)[./-](\d\d?)[./-](\d{4})[T, ]*", year)
    return _points(text), f"%Y-%m-%d {clock}"


def _points(text: polars.Series) -> polars.Series:
    """Put a point before the fraction of a second, whatever stood there."""
    return text.str.replace(r"(\d:\d\d:\d\d)[,:](\d+)", "${1}.${2}").str.replace(
        r"^(\S+ \d\d?)[.](\d\d?)[.](\d\d?)", "${1}:${2}:${3}"
    )


def _day_first(
    source: Source, column: Column, text: polars.Series, dotted: bool, afternoon: bool
) -> bool:
    """Tell whether the day stands before the month; raise where nothing tells."""
    numbers = text.str.extract_groups(r"^(\d\d?)[./-](\d\d?)[./-]\d{4}").struct.unnest()
    columns = [numbers.to_series(k).cast(int).to_numpy() for k in (0, 1)]
    if columns[0].max() > 12 or dotted:
        return True
    if columns[1].max() > 12 or afternoon:
        return False
    raise InputError(
        f"'{text[0]}' does not tell the day from the month",
        expected="a date such as 2025-07-08T19:34:00.010 in UTC",
        cure="say how dates are written with time_unit='%d/%m/%Y %H:%M:%S%.f'",
        where=f"{source.path}, column '{column.name}'",
    )


def _no_time(source: Source, column: Column, values: Any, row: int) -> InputError:
    return InputError(
        f"'{str(values[row])[:40]}' is not a time",
        expected="a number, or a date such as 2025-07-08T19:34:00.010 in UTC",
        cure="correct it, say how dates are written with time_unit='%d.%m.%Y %H:%M:%S%.f', or "
        "name the right column with columns={'time': ...}",
        where=source.place(row, column.name),
    )


def day_and_time(
    source: Source, date: Column | None, column: Column, columns: Any, notes: Notes
) -> FloatArray:
    """Return seconds from a column of times of day, with that of the dates where there is one."""
    values = columns[column.name]
    if date is None or columns[date.name].dtype.kind not in "US":
        day = np.char.add("1970-01-01 ", np.char.strip(values))
        notes.did(f"time from time of day in '{column.name}', as seconds of the day")
        return np.asarray(moments(source, column, day, None, notes))
    joined = np.char.add(np.char.add(np.char.strip(columns[date.name]), " "), values)
    notes.did(f"time from '{date.name}' and '{column.name}'")
    return np.asarray(moments(source, column, joined, None, notes))
