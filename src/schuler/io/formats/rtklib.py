"""RTKLIB's solution files (.pos): header of ``%`` lines, blanks between columns.

Columns as RTKLIB's manual (appendix B) describes them: time as date and time of day or as GPS
week and seconds; latitude, longitude, height in degrees (decimal, or degrees minutes seconds) or
x, y, z of the earth-fixed frame, or east, north, up from a base; Q, number of satellites,
standard deviations, covariances as signed roots, age, ratio; velocities with theirs if asked for.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from schuler.errors import InputError
from schuler.io.format import Format, Start, What
from schuler.io.source import Columns, MemorySource
from schuler.io.trajectories.receivers import write_pos

if TYPE_CHECKING:
    from schuler.io.options import ReadOptions

_GPS_EPOCH = np.datetime64("1980-01-06T00:00:00", "ns")
_DAY = re.compile(r"\d{4}[/-]\d\d[/-]\d\d")
_TIME_OF_DAY = re.compile(r"\d\d:\d\d:\d\d(?:\.\d{1,9})?")
_WEEK_SECONDS = 604800.0
_DEFAULT = ("latitude(deg)", "longitude(deg)", "height(m)", "Q", "ns", "sdn(m)", "sde(m)", "sdu(m)")


def open_pos(path: Path, what: What, options: ReadOptions) -> MemorySource:
    """Read an RTKLIB solution file."""
    names, rows, numbers, scale_name = _lines(path)
    if not rows:
        raise InputError(
            "the file has no epochs",
            expected="lines of solutions below the header",
            where=str(path),
        )
    width = len(rows[0])
    time, used, said = _time(path, rows, numbers)
    names = _spread_degrees(names, width - used)
    table = np.empty((len(rows), len(names)))
    for k, row in enumerate(rows):
        fields = row[used : used + len(names)]
        try:
            table[k] = [float(f) for f in fields]
        except ValueError:
            raise _bad_line(path, numbers[k], row, width, fields) from None
    columns: Columns = {"time": time}
    columns |= {n: table[:, j] for j, n in enumerate(names)}
    columns = _join_degrees(columns)
    history = (f"time from {said} ({scale_name})",)
    return MemorySource(path, columns, {"time": "s"}, None, history, row_word="epoch")


def is_pos(start: Start) -> bool:
    """Tell whether the first lines of a text file are those of an RTKLIB solution."""
    marked = [x for x in start.lines[:60] if x.startswith("%")]
    return any(re.search(r"\bQ\s+ns\b|RTKLIB|rnx2rtkp|RTKPOST|RTKNAVI", x) for x in marked)


def _lines(path: Path) -> tuple[tuple[str, ...], list[list[str]], list[int], str]:
    names: tuple[str, ...] = _DEFAULT
    scale_name = "GPST"
    rows, numbers = [], []
    with path.open(encoding="utf-8", errors="replace") as stream:
        for number, line in enumerate(stream, start=1):
            if line.startswith(("%", "#")):
                if re.search(r"\bQ\b", line) and re.search(r"\bns\b", line):
                    fields = line.lstrip("%# ").split()
                    scale_name = fields[0]
                    names = tuple(fields[1:])
            elif line.strip():
                rows.append(re.split(r"[\s,;]+", line.strip()))
                numbers.append(number)
    return names, rows, numbers, scale_name


def _bad_line(path: Path, number: int, row: list[str], width: int, fields: list[str]) -> InputError:
    where = f"{path}, line {number}"
    if len(row) != width:
        return InputError(
            f"this line has {len(row)} fields",
            expected=f"{width}, as the lines before",
            cure="copy the file again or remove this line",
            where=where,
        )
    wrong = next(f for f in fields if not _is_float(f))
    return InputError(
        f"'{wrong[:30]}' is not a number", expected="a number", cure="correct it", where=where
    )


def _is_float(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _time(path: Path, rows: list[list[str]], numbers: list[int]) -> tuple[Any, int, str]:
    """Return seconds, the number of fields used, and how the time was given."""
    first = rows[0]
    k = 0
    try:
        if "/" in first[0] or "-" in first[0][1:]:
            stamps = np.empty(len(rows), dtype="datetime64[ns]")
            for k, row in enumerate(rows):
                if not _DAY.fullmatch(row[0]) or not _TIME_OF_DAY.fullmatch(row[1]):
                    raise ValueError
                stamps[k] = np.datetime64(f"{re.sub('/', '-', row[0])}T{row[1]}", "ns")
            nanoseconds = (stamps - _GPS_EPOCH).astype(np.int64)
            week = nanoseconds[0] // (604800 * 10**9)
            relative = nanoseconds - week * 604800 * 10**9
            return relative / 1e9, 2, f"date and time, as seconds of GPS week {week}"
        table = np.empty((len(rows), 2))
        for k, row in enumerate(rows):
            table[k] = float(row[0]), float(row[1])
    except (ValueError, IndexError):
        raise InputError(
            f"the time '{' '.join(rows[k][:2])}' is not understood",
            expected="yyyy/mm/dd hh:mm:ss.sss, or GPS week and seconds",
            where=f"{path}, line {numbers[k]}",
        ) from None
    week0 = table[0, 0]
    return (
        table[:, 1] + (table[:, 0] - week0) * _WEEK_SECONDS,
        2,
        f"seconds of GPS week {week0:.0f}",
    )


def _spread_degrees(names: tuple[str, ...], width: int) -> tuple[str, ...]:
    """Give degrees, minutes and seconds their own columns: there the header has fewer names."""
    if "latitude(d'\")" not in names:
        return names[:width]
    result: list[str] = []
    for name in names:
        if name.endswith("(d'\")"):
            stem = name.removesuffix("(d'\")")
            result += [f"{stem} degrees", f"{stem} minutes", f"{stem} seconds"]
        else:
            result.append(name)
    return tuple(result[:width])


def _join_degrees(columns: Columns) -> Columns:
    if "latitude degrees" not in columns:
        return columns
    joined = {}
    for name in ("latitude", "longitude"):
        degrees = columns.pop(f"{name} degrees")
        rest = columns.pop(f"{name} minutes") / 60.0 + columns.pop(f"{name} seconds") / 3600.0
        joined[f"{name}(deg)"] = degrees + np.copysign(rest, degrees)
    return {**joined, **columns}


FORMATS = (
    Format(
        "rtklib",
        "a solution of RTKLIB",
        (".pos",),
        ("gnss",),
        detect=is_pos,
        open=open_pos,
        write_trajectory=write_pos,
    ),
)
