"""Results as plain values for JSON: each class names what goes in, one function does the rest."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from operator import attrgetter
from typing import Any, ClassVar


class ToDict:
    """A result with plain values.

    `JSON` holds words with blanks between: ``name``, or ``key=name`` where the key differs; ``*``
    stands for all fields. A name may lead on (``raw.tau``) and may be that of a method.
    """

    __slots__ = ()
    JSON: ClassVar[str] = "*"

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, in SI; None where there is no finite number."""
        found: dict[str, Any] = {}
        for word in self.JSON.split():
            key, _, name = word.rpartition("=")
            names = [f.name for f in fields(self)] if name == "*" else [name]  # type: ignore[arg-type]
            for each in names:
                value = attrgetter(each)(self)
                found[key or each] = plain(value() if callable(value) else value)
        return found


def plain(value: Any) -> Any:
    """Return lists, dictionaries, numbers and texts; numbers that are not finite become None."""
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): plain(v) for key, v in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(v) for v in value]
    if isinstance(value, complex):
        return [value.real, value.imag]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, (str, int)):
        return value
    if is_dataclass(value):
        return {one.name: plain(getattr(value, one.name)) for one in fields(value)}
    return str(value)


def named_rows(names: Sequence[str], rows: Iterable[Sequence[Any]]) -> list[dict[str, Any]]:
    """Return rows of values as dictionaries by name."""
    return [dict(zip(names, map(plain, row), strict=True)) for row in rows]
