"""Numbers for people: with their error, with as many digits as they deserve."""

from __future__ import annotations

import math

_SUPERSCRIPT = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")
MISSING = "–"


def number(value: float, digits: int = 3) -> str:
    """Return a number with a few significant digits."""
    if not math.isfinite(value):
        return MISSING
    if value == 0.0:
        return "0"
    exponent = math.floor(math.log10(abs(value)))
    if -3 <= exponent < 6:
        decimals = max(digits - 1 - exponent, 0)
        return f"{value:.{decimals}f}".replace("-", "−")
    mantissa, power = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa}·10{str(int(power)).translate(_SUPERSCRIPT)}".replace("-", "−")


def with_error(value: float, error: float) -> str:
    """Return a number with its standard error, both to the second digit of the error."""
    if not math.isfinite(value) or not math.isfinite(error) or error <= 0.0:
        return number(value, 4)
    exponent = math.floor(math.log10(abs(value))) if value else math.floor(math.log10(error))
    plain = -3 <= exponent < 5
    power = 0 if plain else exponent
    decimals = min(max(1 - math.floor(math.log10(error / 10.0**power)), 0), 9)
    text = f"{value / 10.0**power:.{decimals}f} ± {error / 10.0**power:.{decimals}f}"
    text = text.replace("-", "−")
    return text if plain else f"({text})·10{str(power).translate(_SUPERSCRIPT)}"


def compact_with_error(value: float, error: float) -> str:
    """Return a number with the error of its last two digits in brackets."""
    text = with_error(value, error)
    if "±" not in text:
        return text
    body, _, power = text.removeprefix("(").partition(")")
    first, _, second = body.partition(" ± ")
    digits = second.replace(".", "").lstrip("0") if float(second) < 1.0 else second
    return f"{first}({digits}){power}"


def percent(share: float) -> str:
    """Return a share as a percentage."""
    return f"{100.0 * share:.0f} %" if math.isfinite(share) else MISSING


def duration(seconds: float) -> str:
    """Return a length of time in the unit a person would use."""
    if not math.isfinite(seconds):
        return MISSING
    if seconds < 120.0:
        return f"{number(seconds)} s"
    if seconds < 1200.0 and round(seconds) % 60:
        return f"{round(seconds) // 60} min {round(seconds) % 60} s"
    if seconds > 172_800.0:
        return f"{number(seconds / 86_400.0, 2)} days"
    minutes = round(seconds / 60.0)
    if minutes < 120:
        return f"{minutes} min"
    return f"{minutes // 60} h {minutes % 60} min" if minutes % 60 else f"{minutes // 60} h"
