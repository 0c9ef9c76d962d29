"""Values of options, and names for titles."""

from __future__ import annotations

import math
from pathlib import Path

from schuler.errors import InputError


def title_of(path: Path) -> str:
    """Return how people would name a recording: its folder and its file."""
    whole = path.resolve()
    return whole.name if whole.is_dir() else f"{whole.parent.name}/{whole.stem}".lstrip("/")


def parse_numbers(text: str, count: int, what: str, separator: str = ",") -> tuple[float, ...]:
    """Return the numbers of an option such as ``0.1,0,-0.3``."""
    try:
        numbers = tuple(float(part) for part in text.split(separator))
    except ValueError:
        numbers = ()
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise InputError(f"'{text}' is not understood", expected=what)
    return numbers
