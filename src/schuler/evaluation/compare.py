"""Results of the same kind beside each other: what is the same, what differs and by how much."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

from schuler.data.columns import Columns, table_of
from schuler.data.exportable import Exportable
from schuler.data.to_dict import ToDict
from schuler.errors import InputError

LEFT_OUT = {"provenance"}
"""Parts of a result that differ in any case."""


@dataclass(frozen=True, slots=True)
class ComparedValue(ToDict):
    """One number of all results."""

    key: str  # where it stands in a result, its parts joined by dots
    values: tuple[float, ...]  # by result; NaN where it has none.
    errors: tuple[float, ...]  # standard errors; NaN where none is told.

    @property
    def change(self) -> float:
        """Largest difference from the first result, as a share of the larger of the two."""
        first = self.values[0]
        return max((_share(first, v) for v in self.values[1:]), default=0.0)

    @property
    def sigmas(self) -> float:
        """Largest difference from the first result in standard errors of it; NaN without."""
        return max(
            (
                abs(v - self.values[0]) / math.hypot(self.errors[0], e)
                for v, e in zip(self.values[1:], self.errors[1:], strict=True)
                if math.hypot(self.errors[0], e) > 0.0
            ),
            default=math.nan,
        )


ASKED = (
    "_of_maxima", "max_m", "rms", "horizontal", "within_2_sigma", "claimed", "nees", "nis",
    "parameters.", "ieee952.",
)  # fmt: skip
"""In the names of errors, claims and coefficients."""
ASIDE = ("findings", "screening", "settings", "history", "inputs", "notes", "diagnostics")


@dataclass(frozen=True, slots=True, eq=False)
class ResultComparison(Exportable):
    """Several results, number by number.

    Parameters
    ----------
    names : tuple of str
        Of the results.
    numbers : tuple of ComparedValue
        What at least two of them hold: what a result is asked for first, figures of all before
        those of one window or row, and then that which differs most.
    words : tuple of (str, tuple of str)
        Texts that differ, such as settings, and what each result says.
    lacking : tuple of str
        Numbers that only one result holds.

    Examples
    --------
    >>> from schuler import compare_results
    >>> found = compare_results({"before": {"rms_m": 2.0}, "after": {"rms_m": 1.5}})
    >>> found.names
    ('before', 'after')
    """

    JSON: ClassVar[str] = "names numbers words lacking"

    names: tuple[str, ...]
    numbers: tuple[ComparedValue, ...]
    words: tuple[tuple[str, tuple[str, ...]], ...]
    lacking: tuple[str, ...]

    @property
    def different(self) -> tuple[ComparedValue, ...]:
        """The numbers that are not the same in all results."""
        return tuple(n for n in self.numbers if n.change > 0.0)

    def to_columns(self) -> Columns:
        """Return one row for each number: its key, its value in each result, its change."""
        return table_of(
            [
                {"key": n.key, **dict(zip(self.names, n.values, strict=True)), "change": n.change}
                for n in self.numbers
            ]
        )


def compare_results(
    results: Sequence[Any] | Mapping[str, Any],
) -> ResultComparison:
    """Put results beside each other.

    Parameters
    ----------
    results : sequence or mapping
        Two or more files of JSON that a command wrote, results that have `to_dict`, or
        dictionaries; a mapping gives them names.

    Returns
    -------
    ResultComparison
        By the names under which the numbers stand; lists are compared where they are of one
        length.

    Raises
    ------
    InputError
        Fewer than two, a file that is no JSON, or nothing in common.

    Examples
    --------
    >>> from schuler import compare_results
    >>> found = compare_results({"before": {"rms_m": 2.0}, "after": {"rms_m": 1.5}})
    >>> found.numbers[0].values, found.numbers[0].change
    ((2.0, 1.5), 0.25)
    """
    if not isinstance(results, Mapping):
        results = {_name(r, k): r for k, r in enumerate(results)}
    if len(results) < 2:
        raise InputError(f"{len(results)} result", expected="two or more, of different names")
    leaves = [_leaves(_content(r)) for r in results.values()]
    keys = list(dict.fromkeys(k for one in leaves for k in one))
    numbers, words, lacking = [], [], []
    for key in keys:
        found = [one.get(key) for one in leaves]
        if any(isinstance(v, str) for v in found):
            said = tuple("" if v is None else str(v) for v in found)
            words += [(key, said)] if len(set(said)) > 1 else []
        elif sum(v is not None for v in found) < 2:
            lacking += [key] if any(v is not None for v in found) else []
        elif not key.endswith("standard_error"):
            numbers.append(ComparedValue(key, _floats(found), _errors(key, leaves)))
    if not numbers:
        raise InputError(
            f"the results have no number in common ({', '.join(results)})",
            expected="results of the same command",
        )
    numbers.sort(key=lambda n: (_place(n.key), _one_of_many(n.key), -n.change))
    return ResultComparison(tuple(results), tuple(numbers), tuple(words), tuple(lacking))


def _place(key: str) -> int:
    """Return 0 for what a result is asked for, 2 for what only tells how it came about."""
    if any(word in key for word in ASIDE):
        return 2
    return 0 if any(word in key for word in ASKED) else 1


def _one_of_many(key: str) -> bool:
    """Whether a number is of one window, run or row among several."""
    return any(part.isdigit() for part in key.split("."))


def _name(result: Any, k: int) -> str:
    return str(result) if isinstance(result, str | Path) else f"result {k + 1}"


def _content(result: Any) -> Any:
    if hasattr(result, "to_dict"):
        return result.to_dict()
    if not isinstance(result, str | Path):
        return result
    path = Path(result)
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", where=str(path)) from None
    except ValueError as error:
        raise InputError(
            f"is no JSON ({error})", expected="a file that --json wrote", where=str(path)
        ) from None
    if not isinstance(content, dict):
        raise InputError("holds no named values", expected="a result", where=str(path))
    return content


def _leaves(value: Any, before: str = "") -> dict[str, Any]:
    """Return all numbers and texts of nested dictionaries and lists."""
    if isinstance(value, Mapping):
        inner = ((str(k), v) for k, v in value.items() if before or k not in LEFT_OUT)
    elif isinstance(value, list | tuple):
        inner = ((str(k), v) for k, v in enumerate(value))
    else:
        return {before: value}
    found: dict[str, Any] = {}
    for key, each in inner:
        found |= _leaves(each, f"{before}.{key}" if before else key)
    return found


def _floats(values: Sequence[Any]) -> tuple[float, ...]:
    return tuple(math.nan if v is None else float(v) for v in values)


def _errors(key: str, leaves: Sequence[Mapping[str, Any]]) -> tuple[float, ...]:
    """Return the standard errors that stand beside values."""
    beside = f"{key.removesuffix('.value')}.standard_error"
    own = key.endswith(".value")
    found = [one.get(beside) if own else None for one in leaves]
    return _floats([e if isinstance(e, int | float) else None for e in found])


def _share(first: float, other: float) -> float:
    if math.isnan(first) or math.isnan(other) or first == other:
        return 0.0
    return abs(other - first) / max(abs(first), abs(other))
