"""Fields of a line of text: numbers, missing values, dates, units, the rate in a header."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from schuler.errors import InputError

_NUMBER = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?$")
_COMMA_NUMBER = re.compile(r"[+-]?(?:\d+(?:,\d*)?|,\d+)(?:[eE][+-]?\d+)?$")
_THOUSANDS = {
    ",": re.compile(r"[+-]?\d{1,3}(?:,\d{3})+(?:\.\d*)?$"),
    ".": re.compile(r"[+-]?\d{1,3}(?:\.\d{3})+(?:,\d*)?$"),
}
MISSING = {"", "nan", "na", "n/a", "null", "none", "inf", "-inf", "-nan", "+inf", "#n/a", "--"}
MISSING |= {
    "-",
    "1.#qnan",
    "-1.#qnan",
    "1.#ind",
    "-1.#ind",
    "nan(ind)",
    "-nan(ind)",
    "<na>",
    "*",
    "?",
}
MISSING |= {"#value!", "#div/0!", "#num!", "#null!", "#ref!"}
MISSING_WORDS = sorted(
    {case for word in MISSING if word for case in (word, word.upper(), word.title())}
    | {"NaN", "-NaN", "NaN(ind)", "-NaN(ind)"}
)
_HEX_MARKED = re.compile(r"[-+]?0[xX][0-9A-Fa-f]+")
_HEX = re.compile(r"[0-9A-Fa-f]{2}|[0-9A-Fa-f]{4}|[0-9A-Fa-f]{8}")
_CLOCK = r"\d\d?:\d\d(?::\d\d(?:[.,:]\d+)?)?"
DATE = re.compile(
    rf"{_CLOCK}(?:\s*[AaPp]\.?[Mm]\.?)?$"
    rf"|\d{{4}}[-/.]\d\d?[-/.]\d\d?(?:[T ]{_CLOCK}\s*\S*)?$"
    rf"|\d\d?[-/.]\d\d?[-/.](?:\d{{4}}|\d\d)(?:[T ,]+{_CLOCK}\s*\S*)?$"
    rf"|\d\d?[- ][A-Za-z]{{3,9}}[- ]\d{{4}}(?:[T ,]+{_CLOCK}\s*\S*)?$"
)
_RATE = re.compile(
    r"(?:sampl\w*|data|output|update|log\w*|imu|sensor)[ _-]*(?:rate|freq\w*)\b[^\d\n]{0,14}?"
    r"(?P<rate>\d+(?:\.\d+)?)\s*(?P<kilo>k?)(?:Hz|sps|samples)?(?![\w.])"
    r"|(?:^|[\s#%/;,\"])(?:rate|freq(?:uency)?|fs|odr)\s*(?:\(hz\)|\[hz\])?\s*[:=,;\t ]+\s*"
    r"(?P<plain>\d+(?:\.\d+)?)\s*(?P<unit>Hz)?\s*[;,\"]*\s*$",
    re.I,
)
_PERIOD = re.compile(
    r"(?:sampl\w*|log\w*)[ _-]*(?:period|interval|time)\b[^\d\n]{0,14}?(?P<n>\d+(?:\.\d+)?)\s*"
    r"(?P<unit>ms|us|µs|s)\b",
    re.I,
)


def split_all(line: str, delimiter: str) -> list[str]:
    """Split a line into fields without blanks and quotes around them; blank last ones stay."""
    if delimiter == " ":
        return line.split()
    if '"' in line:
        try:
            parts = next(csv.reader([line.strip("\r\n ")], delimiter=delimiter))
        except (csv.Error, StopIteration):
            parts = line.split(delimiter)
        return [f.strip().strip('"').strip() for f in parts]
    return [f.strip() for f in line.rstrip("\r\n").split(delimiter)]


def split(line: str, delimiter: str) -> list[str]:
    """Split a line into fields; a delimiter at its end begins no new one."""
    fields = split_all(line, delimiter)
    if len(fields) < 2 or fields[-1] or delimiter == " ":
        return fields
    return fields[:-1] if line.rstrip("\r\n").rstrip(" ").endswith(delimiter) else fields


def is_number(field: str, decimal_comma: bool) -> bool:
    """Tell whether a field is a number or stands for a missing one."""
    if field.lower() in MISSING:
        return True
    return bool(_NUMBER.match(field) or (decimal_comma and _COMMA_NUMBER.match(field)))


def refuse_hexadecimal(rows: Sequence[Sequence[str]], path: Path) -> None:
    """Raise when three rows or columns hold hexadecimal numbers of a chip alone."""
    for least, pattern in ((2, _HEX_MARKED), (4, _HEX)):
        found = [r for r in rows if sum(bool(pattern.fullmatch(f)) for f in r) >= least]
        shown = next((f for r in found for f in r if pattern.fullmatch(f)), "")
        if len(found) >= 3 and (pattern is _HEX_MARKED or _all_match(found, pattern)):
            raise InputError(
                f"numbers are written in hexadecimal ('{shown}')",
                expected="decimal numbers",
                cure="write them in decimal, with their sign (of 16 bits: less 65536 above 32767)",
                where=str(path),
            )


def _all_match(columns: Sequence[Sequence[str]], pattern: re.Pattern[str]) -> bool:
    return all(pattern.fullmatch(f) for column in columns for f in column)


def has_comma(rows: Iterable[Sequence[str]], delimiter: str) -> bool:
    """Tell whether the numbers of a table have decimal commas."""
    commas = points = 0
    for row in rows:
        for field in row:
            if "," in field and _COMMA_NUMBER.match(field):
                commas += 1
            elif "." in field and _NUMBER.match(field):
                points += 1
    if delimiter == "," and commas and not points:
        # Quoted fields: "1,230" alone may be a thousand; any other count of digits is a fraction.
        return not all(_THOUSANDS[","].match(f) for row in rows for f in row if "," in f)
    return commas > points if delimiter != "," else False


def separated_thousands(rows: Iterable[Sequence[str]], column: int, decimal_comma: bool) -> bool:
    """Tell whether the numbers of a column are written with separators of thousands."""
    mark = "." if decimal_comma else ","
    fields = [r[column] for r in rows if column < len(r) and r[column]]
    marked = [f for f in fields if mark in f]
    return bool(marked) and all(_THOUSANDS[mark].match(f) for f in marked)


def bare_unit(text: str) -> str:
    """Return a unit without the brackets around it."""
    text = text.strip().strip('"')
    while len(text) > 1 and (text[0], text[-1]) in {("(", ")"), ("[", "]"), ("{", "}")}:
        if text.find(")") not in (-1, len(text) - 1) and text[0] == "(":
            break
        text = text[1:-1].strip()
    return "" if text in ("-", "--") else text


def stated_rate(lines: Iterable[str]) -> float | None:
    """Return the sampling rate that the lines above a table state, in Hz."""
    found: set[float] = set()
    for line in lines:
        match = _RATE.search(line)
        if match and match["rate"]:
            found.add(float(match["rate"]) * (1e3 if match["kilo"] else 1.0))
        elif match and match["plain"]:
            found.add(float(match["plain"]))
        period = _PERIOD.search(line)
        if period and not match and float(period["n"]) > 0.0:
            scale = {"s": 1.0, "ms": 1e-3}.get(period["unit"].lower(), 1e-6)
            found.add(1.0 / (float(period["n"]) * scale))
    return found.pop() if len(found) == 1 and min(found) > 0.0 else None
