"""The grammar of units: from text such as ``deg/s/sqrt(Hz)`` to a factor and a dimension.

A product of powers, read by a small parser of its own; nothing is ever evaluated as code.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from fractions import Fraction

from schuler.errors import UnitError

STANDARD_GRAVITY = 9.80665
"""m/s² in one g, by definition (CGPM 1901)."""

Dimension = tuple[Fraction, Fraction, Fraction]
"""Powers of length, time and angle."""


def dimension_of(length: str = "0", time: str = "0", angle: str = "0") -> Dimension:
    """Return a dimension from its powers, written as fractions."""
    return Fraction(length), Fraction(time), Fraction(angle)


NONE = dimension_of()
LENGTH = dimension_of(length="1")
TIME = dimension_of(time="1")
FREQUENCY = dimension_of(time="-1")
ANGLE = dimension_of(angle="1")
RATE = dimension_of(time="-1", angle="1")
SPEED = dimension_of(length="1", time="-1")
ACCELERATION = dimension_of(length="1", time="-2")
_DEGREE = math.pi / 180.0

# Name: factor to SI and dimension. Names are looked up as written first, then in lower case.
_UNITS: dict[str, tuple[float, Dimension]] = {
    "rad": (1.0, ANGLE),
    "deg": (_DEGREE, ANGLE),
    "arcmin": (_DEGREE / 60.0, ANGLE),
    "arcsec": (_DEGREE / 3600.0, ANGLE),
    "rev": (2.0 * math.pi, ANGLE),
    "dps": (_DEGREE, RATE),
    "dph": (_DEGREE / 3600.0, RATE),
    "rpm": (2.0 * math.pi / 60.0, RATE),
    "s": (1.0, TIME),
    "min": (60.0, TIME),
    "h": (3600.0, TIME),
    "day": (86400.0, TIME),
    "Hz": (1.0, FREQUENCY),
    "MHz": (1e6, FREQUENCY),
    "m": (1.0, LENGTH),
    "ft": (0.3048, LENGTH),
    "kn": (1852.0 / 3600.0, SPEED),
    "g": (STANDARD_GRAVITY, ACCELERATION),
    "gal": (0.01, ACCELERATION),
    "ppm": (1e-6, NONE),
    "%": (1e-2, NONE),
}
_SYNONYMS = {
    "°": "deg",
    "º": "deg",
    "degree": "deg",
    "degrees": "deg",
    "degs": "deg",
    "radian": "rad",
    "radians": "rad",
    "rads": "rad",
    "sec": "s",
    "secs": "s",
    "second": "s",
    "seconds": "s",
    "minute": "min",
    "minutes": "min",
    "hr": "h",
    "hrs": "h",
    "hour": "h",
    "hours": "h",
    "hz": "Hz",
    "hertz": "Hz",
    "metre": "m",
    "metres": "m",
    "meter": "m",
    "meters": "m",
    "gee": "g",
    "gn": "g",
    "gs": "g",
    "turn": "rev",
    "kt": "kn",
    "kts": "kn",
    "knot": "kn",
    "knots": "kn",
    "millisecond": "ms",
    "milliseconds": "ms",
    "microsecond": "us",
    "microseconds": "us",
    "nanosecond": "ns",
    "nanoseconds": "ns",
    "usec": "us",
    "msec": "ms",
    "nsec": "ns",
    "percent": "%",
}
_PREFIXES = {"n": 1e-9, "u": 1e-6, "m": 1e-3, "c": 1e-2, "k": 1e3}
_PREFIXED = frozenset({"rad", "deg", "dps", "s", "Hz", "m", "g", "gal"})

# --- the grammar of units -------------------------------------------------------------------
#   product := power (("*" | "/" | nothing) power)*        "/" binds the next power only
#   power   := atom ["^" exponent]
#   atom    := name | "(" product ")" | ("sqrt" | "rt") atom

_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺", "0123456789-+")
_EXPONENT = r"[+-]?\d+(?:\.\d+|/\d+)?"
_TOKEN = re.compile(
    rf"\s*(?:(?P<power>(?:\^|\*\*)\s*(?:\(\s*{_EXPONENT}\s*\)|{_EXPONENT}))"
    r"|(?P<attached>[+-]?\d+(?:\.5)?)"
    r"|(?P<sign>[*/()])|(?P<name>[^\W\d_]+|[°º%]))"
)


def _per_second(match: re.Match[str]) -> str:
    return f"{match[1]}/s" + ("^2" if match[2] else "")


def _tidy(unit: str) -> str:
    """Bring the many spellings down to one."""
    text = re.sub(r"[⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺]+", lambda m: "^" + m[0].translate(_SUPERSCRIPTS), unit)
    text = text.strip().strip("[]").replace("µ", "u").replace("μ", "u").replace("½", "^0.5")
    text = text.replace("√", " sqrt ").replace("·", "*").replace("×", "*").replace("⋅", "*")
    text = re.sub(r"(?i)\b(?:rt|root|sqrt)[-\s]*(?=[A-Za-z(])", " sqrt ", text)
    text = re.sub(r"(?i)\brt(?=hz\b|hr\b|h\b|s\b)", " sqrt ", text)
    text = re.sub(r"(?i)\bper\b", "/", text)
    # Shorthand of column names: mps2 is m/s^2, radps rad/s; a newton per kilogram is m/s^2.
    text = re.sub(r"(?i)^(m|cm|mm|km|ft|u?m?rad|deg)ps(?:\^?([s2]))?$", _per_second, text)
    text = re.sub(r"(?i)^N/kg$", "m/s^2", text)
    text = re.sub(r"(?i)^(?:1/s|s\^?-1)$", "rad/s", text)
    # Column names cannot hold a slash: rad_s, m_s2, deg_per_s.
    return re.sub(r"(?i)_+(?:per_+|/_*)?", "/", text)


def _tokens(unit: str) -> Iterator[tuple[str, str]]:
    if len(unit) > 80:
        raise UnitError(f"unit '{unit[:20]}...' is too long to be a unit")
    text = _tidy(unit)
    place = 0
    while place < len(text.rstrip()):
        match = _TOKEN.match(text, place)
        if match is None or match.lastgroup is None:
            raise UnitError(f"unit '{unit}' is not understood at '{text[place:].strip()}'")
        group = match.lastgroup
        yield ("power" if group == "attached" else group), match[group]
        place = match.end()


_SCALED = re.compile(r"\s*(?P<factor>\d+\.?\d*(?:[eE][+-]?\d+)?)\s*\*?\s*(?P<unit>[^\d\s*/].*)$")
_COUNTS = re.compile(
    r"\s*(?:(?:LSB|counts?|digits?)\s*(?P<behind>\d+\.?\d*)"
    r"|(?P<before>\d+\.?\d*)\s*(?:LSB|counts?|digits?))\s*(?:/|\bper\b)\s*(?P<unit>.+)$",
    re.I,
)


def evaluate(unit: str) -> tuple[float, Dimension]:
    """Return the SI value of one such unit and its dimension.

    A unit may have a factor in front (``1e-7 deg``), or be counts (``LSB 16384/g``).
    """
    counts = _COUNTS.match(unit)
    if counts is not None:
        number = float(counts["behind"] or counts["before"])
        factor, dimension = evaluate(counts["unit"])
        if number <= 0.0:
            raise UnitError(f"unit '{unit}' has {number:g} counts")
        return factor / number, dimension
    scaled = _SCALED.match(unit)
    if scaled is not None:
        factor, dimension = evaluate(scaled["unit"])
        return float(scaled["factor"]) * factor, dimension
    tokens = list(_tokens(unit))
    factor, dimension, rest = _product(unit, tokens)
    if rest:
        raise UnitError(f"unit '{unit}' has a bracket too many")
    return factor, dimension


_Tokens = list[tuple[str, str]]


def _product(unit: str, tokens: _Tokens) -> tuple[float, Dimension, _Tokens]:
    factor, dimension, sign = 1.0, NONE, 1
    expect = False
    while tokens and tokens[0] != ("sign", ")"):
        if tokens[0][0] == "sign" and tokens[0][1] in "*/":
            if expect:
                raise UnitError(f"unit '{unit}' has two operators in a row")
            sign, expect = (-1 if tokens[0][1] == "/" else 1), True
            tokens = tokens[1:]
            continue
        one, its, tokens = _power(unit, tokens)
        factor *= one**sign
        dimension = _add(dimension, its, Fraction(sign))
        sign, expect = 1, False
    if expect:
        raise UnitError(f"unit '{unit}' ends in an operator")
    return factor, dimension, tokens


def _power(unit: str, tokens: _Tokens) -> tuple[float, Dimension, _Tokens]:
    factor, dimension, tokens = _atom(unit, tokens)
    if tokens and tokens[0][0] == "power":
        digits = tokens[0][1].lstrip("^*").strip(" ()")
        if "/" in digits and int(digits.partition("/")[2]) == 0:
            raise UnitError(f"unit '{unit}' has a power over zero")
        exponent = Fraction(digits)
        if abs(exponent) > 9:
            raise UnitError(f"unit '{unit}' has a power out of range")
        factor, dimension = factor ** float(exponent), _add(NONE, dimension, exponent)
        tokens = tokens[1:]
    return factor, dimension, tokens


def _atom(unit: str, tokens: _Tokens) -> tuple[float, Dimension, _Tokens]:
    kind, text = tokens[0] if tokens else ("end", "")
    if kind == "name" and text == "sqrt":
        factor, dimension, rest = _atom(unit, tokens[1:])
        return math.sqrt(factor), _add(NONE, dimension, Fraction(1, 2)), rest
    if kind == "name":
        return *_look_up(unit, text), tokens[1:]
    if (kind, text) == ("sign", "("):
        factor, dimension, rest = _product(unit, tokens[1:])
        if not rest:
            raise UnitError(f"unit '{unit}' has a bracket that is not closed")
        return factor, dimension, rest[1:]
    if kind == "power" and text == "1":  # as in 1/s
        return 1.0, NONE, tokens[1:]
    raise UnitError(f"unit '{unit}' is not understood at '{text}'")


def _add(a: Dimension, b: Dimension, times: Fraction) -> Dimension:
    return a[0] + b[0] * times, a[1] + b[1] * times, a[2] + b[2] * times


def _look_up(unit: str, name: str) -> tuple[float, Dimension]:
    for spelling in (name, name.lower()):
        spelling = _SYNONYMS.get(spelling, spelling)
        if spelling in _UNITS:
            return _UNITS[spelling]
        rest = spelling[1:]
        rest = _SYNONYMS.get(rest, rest)
        if spelling[0] in _PREFIXES:
            for base in (rest, rest.lower()):
                if base in _PREFIXED:
                    factor, dimension = _UNITS[base]
                    return _PREFIXES[spelling[0]] * factor, dimension
    raise UnitError(
        f"unit '{name}' in '{unit}' is not known",
        expected="such as deg, rad, arcsec, s, ms, h, Hz, m, g, mg, ug, mGal, ppm",
    )
