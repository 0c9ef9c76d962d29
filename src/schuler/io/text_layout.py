"""How a text file of numbers is laid out: comments, header, delimiter, decimal comma."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from schuler.errors import InputError
from schuler.io.columns import split_unit
from schuler.io.source import TextOptions

_HEAD_BYTES = 1 << 18
_COMMENTS = ("#", "%", "//")
_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?$")
_COMMA_NUMBER = re.compile(r"[+-]?(?:\d+(?:,\d*)?|,\d+)(?:[eE][+-]?\d+)?$")
_MISSING = {"", "nan", "na", "n/a", "null", "none", "inf", "-inf", "-nan", "+inf"}
_CLOCK = r"\d\d?:\d\d(?::\d\d(?:[.,]\d+)?)?"
_DATE = re.compile(rf"{_CLOCK}$|\d{{4}}[-/]\d\d?[-/]\d\d?(?:[T ]{_CLOCK}\s*\S*)?$")
MISSING_WORDS = sorted(
    {case for word in _MISSING if word for case in (word, word.upper(), word.title())}
    | {"NaN", "-NaN"}
)


@dataclass(frozen=True, slots=True)
class Layout:
    """The layout of a text file.

    Parameters
    ----------
    first_line : int
        Index of the first line of numbers, counted from 0.
    delimiter : str
        Character between columns; " " stands for any number of blanks.
    decimal_comma : bool
        Whether 1,5 means one and a half.
    comment : str or None
        Beginning of lines that are left out.
    names : tuple of str
        Names of the columns, without units where these were split off.
    units : dict of str to str
        Unit by name.
    sample : tuple of str
        Fields of the first line of numbers.
    named : bool
        Whether the names come from the file or the user; False: they were made up.
    """

    first_line: int
    delimiter: str
    decimal_comma: bool
    comment: str | None
    names: tuple[str, ...]
    units: dict[str, str]
    sample: tuple[str, ...]
    named: bool


def split(line: str, delimiter: str) -> list[str]:
    """Split a line into fields without blanks and quotes around them."""
    if delimiter == " ":
        return line.split()
    fields = [f.strip().strip('"').strip() for f in line.split(delimiter)]
    if len(fields) > 1 and not fields[-1] and line.rstrip("\r\n").rstrip(" ").endswith(delimiter):
        fields = fields[:-1]
    return fields


def is_number(field: str, decimal_comma: bool) -> bool:
    """Tell whether a field is a number or stands for a missing one."""
    if field.lower() in _MISSING:
        return True
    return bool(_NUMBER.match(field) or (decimal_comma and _COMMA_NUMBER.match(field)))


def find_layout(path: Path, options: TextOptions) -> Layout:
    """Find out how a text file is laid out."""
    lines = head(path)
    comment = options.comment or next(
        (c for c in _COMMENTS if any(x.startswith(c) for x in lines)), None
    )
    candidates = [
        (k, x)
        for k, x in enumerate(lines)
        if k >= options.skip_lines and x.strip() and not (comment and x.startswith(comment))
    ]
    for position, (index, _) in enumerate(candidates):
        following = [x for _, x in candidates[position : position + 5]]
        found = _delimiter(following, options)
        if found is not None:
            delimiter, comma = found
            above = [x for x in lines[options.skip_lines : index] if x.strip()]
            names, units, named = _header(above, following[0], delimiter, comment, options, path)
            sample = tuple(split(following[0], delimiter))
            return Layout(index, delimiter, comma, comment, names, units, sample, named)
    raise InputError(
        "no line of numbers was found",
        expected="a table of numbers, one sample a line",
        cure="check the file, or describe it with skip_lines=, comment=, delimiter=, decimal=",
        where=str(path),
    )


def head(path: Path) -> list[str]:
    """Return the first lines of a text file."""
    with path.open("rb") as stream:
        data = stream.read(_HEAD_BYTES)
        more = bool(stream.read(1))
    if b"\0" in data:
        raise InputError(
            "the file is not text and not of a known format",
            expected="CSV or text, Parquet, NPZ, RTKLIB .pos, or a ROS bag",
            where=str(path),
        )
    whole = data[: data.rfind(b"\n") + 1] or data  # no character is cut in two
    try:
        whole.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")  # where the degree sign of old loggers is one byte
    else:
        text = data.decode("utf-8-sig", errors="replace")
    lines = text.splitlines()
    return lines[:-1] if more and len(lines) > 1 else lines


def _delimiter(lines: Sequence[str], options: TextOptions) -> tuple[str, bool] | None:
    """Return delimiter and decimal comma that make every line a row of values."""
    given = {"whitespace": " ", "\\t": "\t", "tab": "\t"}.get(
        options.delimiter or "", options.delimiter
    )
    order = [given] if given else ["\t", ";", ",", "|", " "]
    commas = [options.decimal == ","] if options.decimal else [False, True]
    single = None
    for comma in commas:
        for delimiter in order:
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
    dates = [bool(_DATE.match(f)) for f in first]
    others = [not f or f.lower() in _MISSING or f[0].isalpha() for f in first]
    if sum(numbers) + sum(dates) == 0:
        return False
    if not all(n or d or o for n, d, o in zip(numbers, dates, others, strict=True)):
        return False
    if len(first) == 1:
        return all(len(r) == 1 for r in rows)
    return len(rows) == 1 or any(len(r) == len(first) for r in rows[1:])


def _header(
    above: Sequence[str],
    first: str,
    delimiter: str,
    comment: str | None,
    options: TextOptions,
    path: Path,
) -> tuple[tuple[str, ...], dict[str, str], bool]:
    """Return names, units, and whether the names were given."""
    width = len(split(first, delimiter))
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
    if len(fitting) > 1 and _all_units(fitting[-1]):
        names = fitting[-2]
        units = {
            n: u.strip("[]() ")
            for n, u in zip(names, fitting[-1], strict=True)
            if u.strip("[]() -")
        }
    if len(set(names)) != len(names):
        twice = next(n for n in names if names.count(n) > 1)
        raise InputError(
            f"two columns are named '{twice}'", cure="rename one of them", where=str(path)
        )
    return tuple(names), units, True


def _header_fields(line: str, delimiter: str, comment: str | None, width: int) -> list[str] | None:
    """Split a line of names; a comment sign in front of it does not count."""
    text = line
    if comment and text.startswith(comment):
        text = text[len(comment) :]
    for one in dict.fromkeys((delimiter, ",", ";", "\t", " ")):
        fields = split(text.strip(), one)
        if len(fields) == width:
            return fields
    return None


def _all_units(fields: Sequence[str]) -> bool:
    """Tell whether a second line of a header holds units only."""
    filled = [f.strip("[]() ") for f in fields if f.strip("[]() -")]
    return bool(filled) and all(split_unit(f"value [{f}]")[1] for f in filled)
