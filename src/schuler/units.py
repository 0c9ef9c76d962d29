"""The only place that knows degrees, hours, milli-g, mGal and ppm.

Everything inside the library is SI and radians (spec section 0). A person writes
``0.24 deg/sqrt(h)``; `parse` checks that this is the kind of quantity that is wanted and returns
the SI number; `format_value` writes it back. Angle counts as a dimension of its own, so that a
gyro value cannot be taken for an accelerometer value.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction
from typing import Literal

from schuler.errors import UnitError

STANDARD_GRAVITY = 9.80665
"""m/s² in one g, by definition (CGPM 1901)."""

Dimension = tuple[Fraction, Fraction, Fraction]
"""Powers of length, time and angle."""


def _dimension(length: str = "0", time: str = "0", angle: str = "0") -> Dimension:
    return Fraction(length), Fraction(time), Fraction(angle)


_NONE = _dimension()
_LENGTH = _dimension(length="1")
_TIME = _dimension(time="1")
_FREQUENCY = _dimension(time="-1")
_ANGLE = _dimension(angle="1")
_RATE = _dimension(time="-1", angle="1")
_SPEED = _dimension(length="1", time="-1")
_ACCELERATION = _dimension(length="1", time="-2")
_DEGREE = math.pi / 180.0

# Name: factor to SI and dimension. Names are looked up as written first, then in lower case.
_UNITS: dict[str, tuple[float, Dimension]] = {
    "rad": (1.0, _ANGLE),
    "deg": (_DEGREE, _ANGLE),
    "arcmin": (_DEGREE / 60.0, _ANGLE),
    "arcsec": (_DEGREE / 3600.0, _ANGLE),
    "rev": (2.0 * math.pi, _ANGLE),
    "dps": (_DEGREE, _RATE),
    "dph": (_DEGREE / 3600.0, _RATE),
    "rpm": (2.0 * math.pi / 60.0, _RATE),
    "s": (1.0, _TIME),
    "min": (60.0, _TIME),
    "h": (3600.0, _TIME),
    "day": (86400.0, _TIME),
    "Hz": (1.0, _FREQUENCY),
    "MHz": (1e6, _FREQUENCY),
    "m": (1.0, _LENGTH),
    "ft": (0.3048, _LENGTH),
    "g": (STANDARD_GRAVITY, _ACCELERATION),
    "gal": (0.01, _ACCELERATION),
    "ppm": (1e-6, _NONE),
    "%": (1e-2, _NONE),
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


@dataclass(frozen=True, slots=True)
class Kind:
    """A kind of quantity: what its unit must measure, and how people write it.

    Parameters
    ----------
    dimension : tuple of Fraction
        Powers of length, time and angle.
    si : str
        SI unit, as `format_value` writes it.
    datasheet : str
        The unit of datasheets and papers.
    """

    dimension: Dimension
    si: str
    datasheet: str


KINDS: dict[str, Kind] = {
    "gyro white noise": Kind(_dimension(time="-1/2", angle="1"), "rad/s/sqrt(Hz)", "deg/sqrt(h)"),
    "accel white noise": Kind(_dimension(length="1", time="-3/2"), "m/s^2/sqrt(Hz)", "m/s/sqrt(h)"),
    "gyro bias instability": Kind(_RATE, "rad/s", "deg/h"),
    "accel bias instability": Kind(_ACCELERATION, "m/s^2", "m/s/h"),
    "gyro random walk": Kind(_dimension(time="-3/2", angle="1"), "rad/s/sqrt(s)", "deg/h^1.5"),
    "accel random walk": Kind(_dimension(length="1", time="-5/2"), "m/s^2/sqrt(s)", "m/s/h^1.5"),
    "gyro ramp": Kind(_dimension(time="-2", angle="1"), "rad/s^2", "deg/h^2"),
    "accel ramp": Kind(_dimension(length="1", time="-3"), "m/s^3", "m/s/h^2"),
    "gyro bias": Kind(_RATE, "rad/s", "deg/s"),
    "accel bias": Kind(_ACCELERATION, "m/s^2", "mg"),
    "gyro quantization": Kind(_ANGLE, "rad", "arcsec"),
    "accel quantization": Kind(_SPEED, "m/s", "m/s"),
    "correlation time": Kind(_TIME, "s", "s"),
    "frequency": Kind(_FREQUENCY, "Hz", "Hz"),
    "scale factor": Kind(_NONE, "", "ppm"),
    "angular rate": Kind(_RATE, "rad/s", "deg/s"),
    "acceleration": Kind(_ACCELERATION, "m/s^2", "m/s^2"),
    "angle": Kind(_ANGLE, "rad", "deg"),
    "velocity": Kind(_SPEED, "m/s", "m/s"),
    "length": Kind(_LENGTH, "m", "m"),
    "time": Kind(_TIME, "s", "s"),
}
"""Every kind of quantity with a unit, by the name used in `parse` and `format_value`."""

_KIND_SYNONYMS = {
    "sigma": "bias",
    "turn-on bias": "bias",
    "amplitude": "bias",
    "gauss-markov": "bias",
    "rate random walk": "random walk",
    "slope": "ramp",
    "rate ramp": "ramp",
}
_MEASURED = {
    _ANGLE: "an angle",
    _RATE: "an angular rate",
    _ACCELERATION: "an acceleration",
    _SPEED: "a velocity",
    _LENGTH: "a length",
    _TIME: "a time",
    _FREQUENCY: "a frequency",
    _NONE: "a plain number",
}


def kind_of(name: str) -> Kind:
    """Return the kind of a name, forgiving about spelling.

    Parameters
    ----------
    name : str
        E.g. ``"gyro white noise"``, ``"accelerometer turn-on bias"``, ``"correlation_time"``.

    Returns
    -------
    Kind
        Its dimension and units.

    Raises
    ------
    UnitError
        There is no such kind.
    """
    text = " ".join(name.lower().replace("_", " ").split())
    text = text.replace("accelerometer", "accel").replace("gyroscope", "gyro")
    text = text.replace("quantisation", "quantization")
    if text not in KINDS:
        sensor, _, rest = text.partition(" ")
        text = f"{sensor} {_KIND_SYNONYMS.get(rest, rest)}"
    if text not in KINDS:
        raise UnitError(
            f"'{name}' is not a kind of quantity", expected=f"one of {', '.join(KINDS)}"
        )
    return KINDS[text]


def parse(text: str | float, kind: str, default_unit: str | None = None) -> float:
    """Return the SI value of a number with a unit.

    Parameters
    ----------
    text : str or float
        E.g. ``"0.24 deg/sqrt(h)"``, ``"70 µg/√Hz"``, ``"4.6 m/s/h"``. A bare number (not text) is
        SI already.
    kind : str
        What it must be; see `KINDS`.
    default_unit : str, optional
        Unit of a text that is a number only.

    Returns
    -------
    float
        Value in SI units and radians.

    Raises
    ------
    UnitError
        Not a number, no unit, a unit that is not known, or a unit of another kind.

    Notes
    -----
    Factors: spec section 0, table of units.

    Examples
    --------
    >>> round(parse("0.24 deg/sqrt(h)", "gyro white noise"), 9)
    6.9813e-05
    """
    wanted = kind_of(kind)
    if isinstance(text, (int, float)) and not isinstance(text, bool):
        return _finite(float(text), str(text))
    match = _NUMBER.match(str(text))
    if match is None:
        raise UnitError(
            f"'{text}' does not begin with a number",
            expected=f"a number with a unit, such as '1.5 {wanted.datasheet}'",
        )
    unit = match["rest"].strip()
    if unit[:1] == "," and unit[1:2].isdigit():
        raise UnitError(f"'{text}' has a decimal comma", expected="a decimal point")
    if not unit:
        unit = default_unit if default_unit is not None else ""
        if not unit and wanted.dimension != _NONE:
            raise UnitError(
                f"'{text}' has no unit",
                expected=f"a unit for {kind}, such as '{text} {wanted.datasheet}'",
            )
    value = float(match["number"]) * scale(unit, kind)
    return _finite(value, str(text))


def format_value(
    value: float,
    kind: str,
    units: Literal["datasheet", "si"] | str = "datasheet",
    digits: int = 12,
) -> str:
    """Write an SI value with its unit, so that `parse` reads it back.

    Parameters
    ----------
    value : float
        SI value.
    kind : str
        What it is; see `KINDS`.
    units : {"datasheet", "si"} or str
        The usual unit of datasheets, the SI unit, or a unit of your own.
    digits : int
        Significant digits; 12 keep the value to 1e-11 of itself.

    Returns
    -------
    str
        E.g. ``"0.24 deg/sqrt(h)"``.

    Raises
    ------
    UnitError
        A unit of another kind.
    """
    wanted = kind_of(kind)
    unit = {"datasheet": wanted.datasheet, "si": wanted.si}.get(units, units)
    return f"{value / scale(unit, kind):.{digits}g} {unit}".rstrip()


def scale(unit: str, kind: str) -> float:
    """Return the factor from a unit to SI.

    Parameters
    ----------
    unit : str
        E.g. ``"deg/s"``, ``"mg"``, ``"ms"``, ``"m_s2"`` (underscore for 'per', as in the names
        of columns).
    kind : str
        What it must measure; see `KINDS`.

    Returns
    -------
    float
        SI value of one such unit.

    Raises
    ------
    UnitError
        A unit that is not known, or of another kind.
    """
    wanted = kind_of(kind)
    factor, dimension = _evaluate(unit)
    if dimension != wanted.dimension:
        found = _MEASURED.get(dimension, "of another kind")
        raise UnitError(
            f"unit '{unit}' is {found}",
            expected=f"a unit for {kind}, such as '{wanted.datasheet or wanted.si}'",
        )
    return factor


def measures(unit: str, kind: str) -> bool:
    """Tell whether a unit is known and measures that kind of quantity.

    Parameters
    ----------
    unit : str
        Any text.
    kind : str
        See `KINDS`.

    Returns
    -------
    bool
        True when `scale` would return a factor.
    """
    try:
        scale(unit, kind)
    except UnitError:
        return False
    return True


def _finite(value: float, text: str) -> float:
    if not math.isfinite(value):
        raise UnitError(f"'{text}' is not a finite number")
    return value


# --- the grammar of units -------------------------------------------------------------------
#   product := power (("*" | "/" | nothing) power)*        "/" binds the next power only
#   power   := atom ["^" exponent]
#   atom    := name | "(" product ")" | ("sqrt" | "rt") atom

_NUMBER = re.compile(r"\s*(?P<number>[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)(?P<rest>.*)$", re.S)
_SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺", "0123456789-+")
_EXPONENT = r"[+-]?\d+(?:\.\d+|/\d+)?"
_TOKEN = re.compile(
    rf"\s*(?:(?P<power>(?:\^|\*\*)\s*(?:\(\s*{_EXPONENT}\s*\)|{_EXPONENT}))"
    r"|(?P<attached>[+-]?\d+(?:\.5)?)"
    r"|(?P<sign>[*/()])|(?P<name>[^\W\d_]+|[°º%]))"
)


def _tidy(unit: str) -> str:
    """Bring the many spellings down to one."""
    text = re.sub(r"[⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺]+", lambda m: "^" + m[0].translate(_SUPERSCRIPTS), unit)
    text = text.strip().strip("[]").replace("µ", "u").replace("μ", "u").replace("½", "^0.5")
    text = text.replace("√", " sqrt ").replace("·", "*").replace("×", "*").replace("⋅", "*")
    text = re.sub(r"(?i)\b(?:rt|root|sqrt)[-\s]*(?=[A-Za-z(])", " sqrt ", text)
    text = re.sub(r"(?i)\brt(?=hz\b|hr\b|h\b|s\b)", " sqrt ", text)
    text = re.sub(r"(?i)\bper\b", "/", text)
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


def _evaluate(unit: str) -> tuple[float, Dimension]:
    tokens = list(_tokens(unit))
    factor, dimension, rest = _product(unit, tokens)
    if rest:
        raise UnitError(f"unit '{unit}' has a bracket too many")
    return factor, dimension


_Tokens = list[tuple[str, str]]


def _product(unit: str, tokens: _Tokens) -> tuple[float, Dimension, _Tokens]:
    factor, dimension, sign = 1.0, _NONE, 1
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
        exponent = Fraction(tokens[0][1].lstrip("^*").strip(" ()"))
        if abs(exponent) > 9:
            raise UnitError(f"unit '{unit}' has a power out of range")
        factor, dimension = factor ** float(exponent), _add(_NONE, dimension, exponent)
        tokens = tokens[1:]
    return factor, dimension, tokens


def _atom(unit: str, tokens: _Tokens) -> tuple[float, Dimension, _Tokens]:
    kind, text = tokens[0] if tokens else ("end", "")
    if kind == "name" and text == "sqrt":
        factor, dimension, rest = _atom(unit, tokens[1:])
        return math.sqrt(factor), _add(_NONE, dimension, Fraction(1, 2)), rest
    if kind == "name":
        return *_look_up(unit, text), tokens[1:]
    if (kind, text) == ("sign", "("):
        factor, dimension, rest = _product(unit, tokens[1:])
        if not rest:
            raise UnitError(f"unit '{unit}' has a bracket that is not closed")
        return factor, dimension, rest[1:]
    if kind == "power" and text == "1":  # as in 1/s
        return 1.0, _NONE, tokens[1:]
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
