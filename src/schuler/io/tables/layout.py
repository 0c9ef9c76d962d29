"""How a text file of numbers is laid out: comments, header, delimiter, decimal comma."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from schuler.errors import InputError
from schuler.io.columns import bare, is_unit
from schuler.io.source import TextOptions
from schuler.io.tables.content import Content
from schuler.io.tables.fields import (
    DATE,
    MISSING,
    bare_unit,
    has_comma,
    is_number,
    refuse_hexadecimal,
    split,
    split_all,
    stated_rate,
)
from schuler.io.tables.foreign import refuse_foreign

_COMMENTS = ("#", "%", "//")
_LOOKED_AT = 40  # rows by which columns are judged


@dataclass(frozen=True, slots=True)
class Layout:
    """The layout of a text file."""

    first_line: int  # index of the first line of numbers, counted from 0
    delimiter: str  # character between columns; " " stands for any number of blanks.
    decimal_comma: bool  # whether 1,5 means one and a half
    comment: str | None  # beginning of lines that are left out
    names: tuple[str, ...]  # names of the columns, without units where these were split off
    units: dict[str, str]  # unit by name
    rows: tuple[tuple[str, ...], ...]  # fields of the first lines of numbers
    named: bool  # whether the names come from the file or the user; False: they were made up.
    header: str = ""  # the line of names as it stands; empty when there is none.
    rate: float | None = None  # sampling rate in Hz, where the lines above the table state it

    def fields_of(self, name: str) -> list[str]:
        """Return what stands in a column in the first rows, blanks left out."""
        k = self.names.index(name)
        return [r[k] for r in self.rows if k < len(r) and r[k]]


def find_layout(content: Content, options: TextOptions) -> Layout:
    """Find out how a text file is laid out."""
    lines = head(content)
    comment = options.comment or next(
        (c for c in _COMMENTS if any(x.startswith(c) for x in lines)), None
    )
    found = None
    if options.header is not False and not options.names:
        found = _by_header(lines, comment, options)
    if found is None:
        found = _by_rows(lines, comment, options, content.path)
    above = [x for x in lines[: found.first_line] if x.strip()]
    return replace(found, rate=stated_rate(above))


def head(content: Content) -> list[str]:
    """Return the first lines of a text file."""
    data, more = content.head()
    refuse_foreign(content.path, data)
    if b"\0" in data:
        raise InputError(
            "the file is not text and not of a known format",
            expected="CSV or text, Parquet, NPZ, RTKLIB .pos, a ROS bag, or a log of a known "
            "receiver or autopilot",
            cure="`schuler formats` lists what can be read",
            where=str(content.path),
        )
    whole = data[: data.rfind(b"\n") + 1] or data  # no character is cut in two
    try:
        whole.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")  # where the degree sign of old loggers is one byte
    else:
        text = data.decode("utf-8-sig", errors="replace")
    # UTF-8 that some program took for Latin-1 and wrote as UTF-8 once more
    text = text.replace("Â°", "°").replace("Â²", "²").replace("Â³", "³")
    lines = text.split("\n")
    lines = [x.removesuffix("\r") for x in lines]
    return lines[:-1] if len(lines) > 1 and (more or not lines[-1]) else lines


def _delimiters(options: TextOptions) -> list[str]:
    given = {"whitespace": " ", "\\t": "\t", "tab": "\t"}.get(
        options.delimiter or "", options.delimiter
    )
    return [given] if given else ["\t", ";", ",", "|", " "]


def _by_header(lines: list[str], comment: str | None, options: TextOptions) -> Layout | None:
    """Find a line of names with a table of its width below it."""
    for delimiter in _delimiters(options):
        for k in range(options.skip_lines, min(len(lines) - 1, 400)):
            line = _uncommented(lines[k], comment)
            names = split(line, delimiter)
            if not _is_names(names):
                continue
            found = _table_below(lines, k, names, delimiter, comment, options)
            if found is not None:
                return found
    return None


def _uncommented(line: str, comment: str | None) -> str:
    return line[len(comment) :].strip() if comment and line.startswith(comment) else line


def _is_names(fields: Sequence[str]) -> bool:
    filled = [f for f in fields if f]
    if len(fields) < 2 or len(filled) < max(2, 0.6 * len(fields)):
        return False
    if any(is_number(f, True) and f.lower() not in MISSING for f in filled):
        return False
    if any(DATE.match(f) for f in filled) or any(f.endswith(":") for f in filled):
        return False
    return sum(f[0].isalpha() or f[0] in "_/%" for f in filled) >= 0.6 * len(filled)


def _table_below(
    lines: list[str],
    k: int,
    names: list[str],
    delimiter: str,
    comment: str | None,
    options: TextOptions,
) -> Layout | None:
    width = len(names)
    first, unit_rows = _first_data(lines, k + 1, width, delimiter, comment)
    if first is None:
        return None
    below = [x for x in lines[first : first + 3 * _LOOKED_AT] if x.strip()]
    rows = [split_all(x, delimiter) for x in below if not (comment and x.startswith(comment))]
    fitting = [r for r in rows if _fits(r, width)]
    if len(fitting) < max(1, 0.6 * min(len(rows), 20)):
        return None
    kept = tuple(tuple(r[:width]) for r in fitting[:_LOOKED_AT])
    comma = options.decimal == "," if options.decimal else has_comma(kept, delimiter)
    units: dict[str, str] = {}
    for row in unit_rows:
        units |= {n: bare_unit(u) for n, u in zip(names, row, strict=False) if bare_unit(u)}
    named = _distinct(names)
    units = {n: u for n, u in units.items() if is_unit(u)}
    return Layout(first, delimiter, comma, comment, named, units, kept, True, lines[k])


def _first_data(
    lines: list[str], k: int, width: int, delimiter: str, comment: str | None
) -> tuple[int | None, list[list[str]]]:
    """Return the first line of numbers below a header, and rows of units between."""
    between: list[list[str]] = []
    for j in range(k, min(len(lines), k + 8)):
        if not lines[j].strip():
            continue
        fields = split_all(_uncommented(lines[j], comment), delimiter)
        numbers = sum(bool(f) and is_number(f, True) for f in fields)
        if _fits(fields, width) and numbers >= min(2, max(1, width - 1)):
            if not (comment and lines[j].startswith(comment)):
                return j, between
            continue
        if comment and lines[j].startswith(comment) and not _fits(fields, width):
            continue
        if numbers or not _fits(fields, width) or len(between) == 2:
            return None, []
        if not any(is_unit(bare_unit(f)) for f in fields if bare_unit(f)):
            return None, []
        between.append(fields)
    return None, []


def _fits(fields: Sequence[str], width: int) -> bool:
    """Tell whether a row belongs to a header: as wide, or one blank field more at its end."""
    return len(fields) == width or (len(fields) == width + 1 and not fields[-1])


def _distinct(names: Sequence[str]) -> tuple[str, ...]:
    """Give names that stand twice a number, and blank ones a name."""
    result: list[str] = []
    for k, name in enumerate(names):
        plain = name or f"column{k}"
        count = sum(n == name for n in names[:k]) if name else 0
        result.append(f"{plain}#{count + 1}" if count else plain)
    return tuple(result)


def _by_rows(lines: list[str], comment: str | None, options: TextOptions, path: Path) -> Layout:
    """Find the first row of numbers where no header leads to it."""
    candidates = [
        (k, x)
        for k, x in enumerate(lines)
        if k >= options.skip_lines and x.strip() and not (comment and x.startswith(comment))
    ]
    for position, (index, _) in enumerate(candidates):
        following = [x for _, x in candidates[position : position + 5]]
        found = _delimiter(following, options)
        if found is None:
            continue
        delimiter, comma = found
        rows = [tuple(split(x, delimiter)) for _, x in candidates[position:][:_LOOKED_AT]]
        _refuse_labels(rows[0], path)
        above = [x for x in lines[options.skip_lines : index] if x.strip()]
        names, units, named = _header(above, len(rows[0]), delimiter, comment, options, path)
        kept = tuple(r for r in rows if len(r) == len(rows[0]))
        return Layout(index, delimiter, comma, comment, names, units, kept, named)
    refuse_hexadecimal([re.split(r"[\s,;|]+", x.strip()) for _, x in candidates], path)
    raise InputError(
        "no line of numbers was found",
        expected="a table of numbers, one sample a line",
        cure="check the file, or describe it with skip_lines=, comment=, delimiter=, decimal=",
        where=str(path),
    )


def _refuse_labels(fields: Sequence[str], path: Path) -> None:
    labels = [f for f in fields if re.fullmatch(r"[A-Za-z_]\w*[:=]", f)]
    if len(labels) > 1 and 2 * len(labels) >= len(fields):
        raise InputError(
            f"every value has its label in front of it ('{labels[0]}')",
            expected="a line of names above a table of numbers alone",
            cure="print the labels once, as a header, or remove them",
            where=str(path),
        )


def _delimiter(lines: Sequence[str], options: TextOptions) -> tuple[str, bool] | None:
    """Return delimiter and decimal comma that make every line a row of values."""
    commas = [options.decimal == ","] if options.decimal else [False, True]
    single = None
    for comma in commas:
        for delimiter in _delimiters(options):
            rows = [split(x, delimiter) for x in lines]
            if (comma and delimiter == ",") or not _is_table(rows, comma):
                continue
            if len(rows[0]) > 1:
                return delimiter, comma
            single = single or (delimiter, comma)
    return single


def _is_table(rows: Sequence[Sequence[str]], comma: bool) -> bool:
    """Tell whether the first row is mostly values and the next ones are as wide.

    A bad field in a later row must not hide the table: it is an error to be told, not to be
    stepped over. So the first row decides, and one other row of the same width is enough.
    """
    first = rows[0]
    numbers = [is_number(f, comma) and bool(f) for f in first]
    dates = [bool(DATE.match(f)) for f in first]
    others = [not f or f.lower() in MISSING or f[0].isalpha() for f in first]
    if sum(numbers) + sum(dates) == 0:
        return False
    if not all(n or d or o for n, d, o in zip(numbers, dates, others, strict=True)):
        return False
    if len(first) == 1:
        return all(len(r) == 1 for r in rows)
    return len(rows) == 1 or any(len(r) == len(first) for r in rows[1:])


def _header(
    above: Sequence[str],
    width: int,
    delimiter: str,
    comment: str | None,
    options: TextOptions,
    path: Path,
) -> tuple[tuple[str, ...], dict[str, str], bool]:
    """Return names, units, and whether the names were given."""
    if options.names:
        if len(options.names) != width:
            raise InputError(
                f"{len(options.names)} columns are named, the file has {width}",
                expected="one name for each column ('' for those not wanted)",
                where=str(path),
            )
        return options.names, {}, True
    made_up = tuple(f"column{k}" for k in range(width))
    if options.header is False:
        return made_up, {}, False
    rows = [_header_fields(line, delimiter, comment, width) for line in above]
    fitting = [r for r in rows[-3:] if r is not None and any(f and f[0].isalpha() for f in r)]
    if not fitting:
        return made_up, {}, False
    names, units = fitting[-1], {}
    if len(fitting) > 1 and all(is_unit(bare_unit(f)) for f in fitting[-1] if bare_unit(f)):
        names = fitting[-2]
        units = {n: bare_unit(u) for n, u in zip(names, fitting[-1], strict=True) if bare_unit(u)}
    return _distinct(names), units, True


def _header_fields(line: str, delimiter: str, comment: str | None, width: int) -> list[str] | None:
    """Split a line of names; a comment sign in front of it does not count."""
    text = _uncommented(line, comment)
    for one in dict.fromkeys((delimiter, ",", ";", "\t", " ")):
        fields = split(text.strip(), one)
        if len(fields) == width and not any(is_number(f, False) and f for f in fields):
            return fields
    return None


def bare_name(name: str) -> str:
    """Return a name as it stands in the header."""
    return re.sub(r"#\d+$", "", name) if bare(name) else name
