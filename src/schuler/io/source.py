"""What every reader delivers: named columns, and the place in the file of each row."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any, Protocol

from numpy.typing import NDArray

from schuler.errors import InputError

Columns = dict[str, NDArray[Any]]


class Source(Protocol):
    """A file that has been opened: the names of its columns are known, its numbers not yet.

    `load` returns float64 columns of one length (NaN where a value is missing), or columns of
    text for those named in `texts`. `place` names a row and a column in the user's terms.
    """

    @property
    def path(self) -> Path:
        """File the columns come from."""

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns, in the order of the file."""

    @property
    def units(self) -> Mapping[str, str]:
        """Units that stand beside the names, where the file gives them."""

    @property
    def rate(self) -> float | None:
        """Sampling rate in Hz, where the file states it."""

    @property
    def history(self) -> tuple[str, ...]:
        """What the reader did so far."""

    @property
    def assumptions(self) -> tuple[str, ...]:
        """What the reader took for granted without being told."""

    def is_text(self, name: str) -> bool:
        """Tell whether a column holds text (such as a date) instead of numbers."""

    def load(self, names: Sequence[str]) -> Columns:
        """Read the columns."""

    def place(self, row: int, name: str = "") -> str:
        """Return file, line or row, and column."""


@dataclass(frozen=True, slots=True)
class TextOptions:
    """How a text file is laid out, where the user wants to say so."""

    # character between columns; "whitespace" for any number of blanks. None: find out.
    delimiter: str | None = None
    decimal: str | None = None  # decimal point or comma. None: find out.
    comment: str | None = None  # lines that begin with this are left out. None: "#", "%" and "//".
    skip_lines: int = 0  # lines left out at the beginning of the file
    # whether a line with names stands above the numbers. None: find out.
    header: bool | None = None
    names: tuple[str, ...] = ()  # names of the columns where the file has none
    repair: bool = False  # leave out a last line that was cut off


@dataclass(frozen=True, slots=True, eq=False)
class MemorySource:
    """Columns that are in memory already."""

    path: Path  # file they come from
    columns: Columns  # columns of one length
    units: Mapping[str, str] = field(default_factory=dict)  # unit of a column
    rate: float | None = None  # sampling rate in Hz
    history: tuple[str, ...] = ()  # what the reader did
    row_word: str = "row"  # what one row is called in messages
    assumptions: tuple[str, ...] = ()  # what the reader took for granted
    first_row: int | None = None  # of a part of a file: which row of it comes first

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return tuple(self.columns)

    def is_text(self, name: str) -> bool:
        """Tell whether a column holds text."""
        return self.columns[name].dtype.kind in "US"

    def load(self, names: Sequence[str]) -> Columns:
        """Return the columns as floats (32-bit ones stay so), or as text."""
        return {
            n: c if c.dtype.kind in "fUS" else c.astype("float64")
            for n, c in ((n, self.columns[n]) for n in names)
        }

    def place(self, row: int, name: str = "") -> str:
        """Return file, row (counted from 0) and column."""
        column = f", column '{name}'" if name else ""
        return f"{self.path}, {self.row_word} {row + (self.first_row or 0)}{column}"


def even_parts(total: int, most: int | None) -> list[tuple[int, int]]:
    """Cut so many rows into parts about equally long, none longer than `most`; (first, stop)."""
    count = 1 if most is None else max(1, -(-total // most))
    edges = [total * k // count for k in range(count + 1)]
    return list(pairwise(edges))


class Notes:
    """Lines of history, and those among them that nobody told the reader.

    Parameters
    ----------
    history, assumptions : iterable of str
        What was said before.
    """

    def __init__(self, history: Iterable[str] = (), assumptions: Iterable[str] = ()) -> None:
        self.history = list(history)
        self.assumptions = list(assumptions)

    def did(self, *lines: str) -> None:
        """Add what was done, each line once."""
        self.history += [x for x in lines if x and x not in self.history]

    def assumed(self, *lines: str) -> None:
        """Add what was taken for granted; it is part of the history too."""
        self.did(*lines)
        self.assumptions += [x for x in lines if x and x not in self.assumptions]


def existing_file(path: Path) -> Path:
    """Return the path when it is a file that can be read and is not empty."""
    if not path.exists():
        raise InputError("there is no such file", cure="check the name", where=str(path))
    if path.is_dir():
        raise InputError("this is a folder", expected="a file", where=str(path))
    if not path.is_file():
        raise InputError(
            "this is a pipe or a device, which can be read only once",
            expected="a file",
            cure="write its content to a file first",
            where=str(path),
        )
    try:
        with path.open("rb") as stream:
            empty = not stream.read(1)
    except OSError as error:
        raise InputError(f"cannot be read ({error.strerror})", where=str(path)) from None
    if empty:
        raise InputError(
            "the file is empty",
            expected="a recording",
            cure="check that the copy or the download was complete",
            where=str(path),
        )
    return path


class RenamedSource:
    """A source under other names and with units that its file leaves out.

    Parameters
    ----------
    source : Source
        What stands in the file.
    renamed : mapping of str to str
        Name in the file by the name it gets.
    units : mapping of str to str
        Units by name.
    history, assumptions : tuple of str
        What is added to those of the source.
    """

    def __init__(
        self,
        source: Source,
        renamed: Mapping[str, str],
        units: Mapping[str, str],
        history: tuple[str, ...],
        assumptions: tuple[str, ...],
    ) -> None:
        given = {name: ours for ours, name in renamed.items()}
        self._source = source
        self._of = {given.get(n, n): n for n in source.names}
        self.path = source.path
        self.names = tuple(self._of)
        self.units = units
        self.rate = source.rate
        self.history = (*source.history, *history, *assumptions)
        self.assumptions = (*source.assumptions, *assumptions)

    def is_text(self, name: str) -> bool:
        """Tell whether a column holds text."""
        return self._source.is_text(self._of[name])

    def load(self, names: Sequence[str]) -> Columns:
        """Read the columns."""
        table = self._source.load(tuple(self._of[n] for n in names))
        return {n: table[self._of[n]] for n in names}

    def place(self, row: int, name: str = "") -> str:
        """Return file, line or row, and column as it stands in the file."""
        return self._source.place(row, self._of.get(name, name))
