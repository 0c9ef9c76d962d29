"""Cells that hold a number with its unit, as '9.81 m/s^2': the unit belongs to the column."""

from __future__ import annotations

import csv
import io
import re
from collections import Counter
from collections.abc import Sequence

from schuler.errors import InputError
from schuler.io.columns import is_unit
from schuler.io.tables.content import Content
from schuler.io.tables.fields import MISSING, split_all

_SUSPECT = re.compile(
    rb"(?m)(?:^|[\t,;| ])[ \"]*[-+]?[\d.]+(?:[eE][-+]?\d+)?[ ]*(?![eE][-+]?\d)"
    rb"(?:[A-Za-z%]|[\xb0-\xce])"
)
_CELL = re.compile(r"([-+]?(?:\d+[.,]?\d*|[.,]\d+)(?:[eE][-+]?\d+)?)\s*([^\W\d_].*|[°%].*)$")
_ELECTRIC = re.compile(r"[mµμuk]?(?:V|A|T|G|Pa|Hz)|hPa|%|LSB|counts?|dB(?:-?Hz)?|°")
_NUMBERS = re.compile(r"\s*[-+]?[.\d]")
_LOOKED_AT = 200


def plain_cells(content: Content) -> tuple[Content, dict[int, str]]:
    """Return the text with numbers alone, and the unit that stood in each column."""
    if not _SUSPECT.search(content.head()[0]):
        return content, {}
    text = content.whole().decode("utf-8-sig", errors="replace")
    if "\ufffd" in text:  # the degree sign of old loggers is one byte
        text = content.whole().decode("latin-1")
    lines = text.split("\n")
    for delimiter in "\t;,| ":
        # a blank stands between numbers, and before each unit too
        looked = lines[: 2 * _LOOKED_AT]
        looked = [_joined(x) for x in looked] if delimiter == " " else looked
        rows = [split_all(x, delimiter) for x in looked if x.strip()]
        width = Counter(map(len, rows[-_LOOKED_AT:])).most_common(1)[0][0] if rows else 0
        units = _units([r for r in rows if len(r) == width], width)
        if width > 1 and units:
            plain = _rewritten(content, lines, delimiter, width, units)
            notes = (*content.notes, "units stood in the cells of the table")
            return Content(content.path, plain.encode(), notes), units
    return content, {}


def _joined(line: str) -> str:
    """Return a line of numbers with each unit right behind its number."""
    return re.sub(r"(?<=\d)[ \t]+(?=[^\W\d_]|[°%])", "", line) if _NUMBERS.match(line) else line


def _cell(field: str) -> tuple[str, str]:
    """Return the number and the unit of a cell; no unit where it holds anything else."""
    match = _CELL.match(field)
    if match is None:
        return field, ""
    unit = match[2].strip()
    return (match[1], unit) if _ELECTRIC.fullmatch(unit) or is_unit(unit) else (field, "")


def _units(rows: Sequence[Sequence[str]], width: int) -> dict[int, str]:
    """Return the columns in which all cells but those of the header hold a unit."""
    found = {}
    for k in range(width):
        cells = [_cell(r[k])[1] for r in rows if r[k].lower() not in MISSING]
        stated = Counter(u for u in cells if u)
        if stated and sum(stated.values()) >= max(1, 0.9 * (len(cells) - 3)):
            found[k] = stated.most_common(1)[0][0]
    return found


def _rewritten(
    content: Content, lines: Sequence[str], delimiter: str, width: int, units: dict[int, str]
) -> str:
    """Take the units out of the rows; a row with another unit than the others is refused."""
    out = io.StringIO()
    writer = csv.writer(out, delimiter=delimiter, lineterminator="\n")
    begun = False
    for number, line in enumerate(lines, 1):
        fields = split_all(_joined(line) if delimiter == " " else line, delimiter)
        cells = {k: _cell(fields[k]) for k in units} if len(fields) == width else {}
        begun = begun or any(unit for _, unit in cells.values())
        if not cells or not begun:
            out.write(line + ("\n" if number < len(lines) else ""))
            continue
        for k, (value, unit) in cells.items():
            if unit != units[k] and value.lower() not in MISSING:
                raise InputError(
                    f"'{fields[k][:30]}' where other cells of this column are in '{units[k]}'",
                    expected="one unit a column",
                    cure="convert the cells to one unit",
                    where=f"{content.path}, line {number}, column {k + 1}",
                )
            fields[k] = value
        writer.writerow(fields)
    return out.getvalue()
