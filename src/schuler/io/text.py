"""CSV and other text: read fast by polars, and slowly once more only to find a fault."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from schuler.errors import InputError
from schuler.io.source import Columns, TextOptions
from schuler.io.text_layout import MISSING_WORDS, Layout, find_layout, is_number, split

if TYPE_CHECKING:
    import polars


@dataclass(frozen=True, slots=True, eq=False)
class TextSource:
    """A text file whose layout is known.

    Parameters
    ----------
    path : Path
        The file.
    layout : Layout
        How it is laid out.
    history : tuple of str
        What the reader did.
    end : int or None
        Length in bytes to be read, when a last line that was cut off is left out.
    """

    path: Path
    layout: Layout
    history: tuple[str, ...] = ()
    end: int | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the columns."""
        return self.layout.names

    @property
    def units(self) -> dict[str, str]:
        """Units from a line of units under the header."""
        return self.layout.units

    @property
    def rate(self) -> float | None:
        """Not stated by text files."""
        return None

    def is_text(self, name: str) -> bool:
        """Tell whether the first value of a column is neither a number nor missing."""
        field = self.layout.sample[self.names.index(name)]
        return not is_number(field, self.layout.decimal_comma)

    def load(self, names: Sequence[str]) -> Columns:
        """Read columns as float64 (NaN: missing), or as text where `is_text` says so."""
        frame = self._frame(names)
        if frame is None:
            raise self._fault(names)
        keys = {n: f"c{self.names.index(n)}" for n in names}
        blank = frame.select(_all_null(frame)).to_series()
        if blank.any():
            frame = frame.filter(~blank)
        columns: Columns = {}
        for name, key in keys.items():
            series = frame[key]
            if self.is_text(name):
                columns[name] = series.fill_null("").to_numpy().astype(str)
            else:
                columns[name] = series.fill_null(float("nan")).to_numpy()
        return columns

    def place(self, row: int, name: str = "") -> str:
        """Return file, line (counted from 1) and column of a row (counted from 0)."""
        column = f", column '{name}'" if name else ""
        for count, (number, _) in enumerate(self._rows()):
            if count == row:
                return f"{self.path}, line {number}{column}"
        return f"{self.path}, row {row}{column}"

    def _frame(self, names: Sequence[str]) -> polars.DataFrame | None:
        import polars

        layout = self.layout
        wanted = [self.names.index(n) for n in names]
        schema: dict[str, Any] = {f"c{k}": polars.String for k in range(len(self.names))}
        for name, k in zip(names, wanted, strict=True):
            if not self.is_text(name):
                schema[f"c{k}"] = polars.Float64
        if layout.sample and self._trailing_delimiter():
            schema["end of line"] = polars.String
        data = self._data()
        # Words for missing values and odd encodings cost time, so they are tried second.
        for words in (None, MISSING_WORDS):
            try:
                return polars.read_csv(
                    data,
                    glob=False,
                    has_header=False,
                    skip_lines=layout.first_line,
                    schema=schema,
                    separator=layout.delimiter,
                    comment_prefix=layout.comment,
                    decimal_comma=layout.decimal_comma,
                    null_values=words,
                    encoding="utf8-lossy" if words else "utf8",
                ).select(f"c{k}" for k in wanted)
            except polars.exceptions.PolarsError:
                continue
        return None

    def _trailing_delimiter(self) -> bool:
        if self.layout.delimiter == " ":
            return False
        with self.path.open("rb") as stream:
            for _ in range(self.layout.first_line):
                stream.readline()
            line = stream.readline().decode("utf-8", errors="replace")
        fields = line.rstrip("\r\n").rstrip(" ")
        return fields.endswith(self.layout.delimiter) and len(self.names) == len(
            split(line, self.layout.delimiter)
        )

    def _data(self) -> Path | bytes:
        """Return what polars can read: the file, or its content with single delimiters."""
        delimiter = self.layout.delimiter
        padded = delimiter != " " and self._has_blanks()
        if delimiter != " " and not padded and self.end is None:
            return self.path
        data = self.path.read_bytes()[: self.end]
        if delimiter == " ":
            return _single_blanks(data)
        if not padded:
            return data
        if not any(self.is_text(n) for n in self.names):
            return data.replace(b" ", b"")
        mark = delimiter.encode()
        data = re.sub(rb"[ \t]*" + re.escape(mark) + rb"[ ]*", mark, data)
        return re.sub(rb"(?m)^[ ]+|[ ]+(?=\r?$)", b"", data)

    def _has_blanks(self) -> bool:
        """Tell whether blanks stand around the numbers (polars does not skip them)."""
        with self.path.open("rb") as stream:
            for _ in range(self.layout.first_line):
                stream.readline()
            sample = stream.read(1 << 16)
        if any(not is_number(f, True) for f in self.layout.sample):
            return bool(re.search(rb"[ ][^\w]|[^\w\r\n][ ]", sample))
        return b" " in sample

    def _rows(self) -> Iterator[tuple[int, str]]:
        """Yield line number (from 1) and text of every line of numbers."""
        with self.path.open(encoding="utf-8-sig", errors="replace") as stream:
            for number, line in enumerate(stream):
                if number < self.layout.first_line or not line.strip():
                    continue
                if self.layout.comment and line.startswith(self.layout.comment):
                    continue
                yield number + 1, line

    def _fault(self, names: Sequence[str]) -> InputError:
        """Find the line and the column that cannot be read."""
        layout = self.layout
        wanted = [(self.names.index(n), n) for n in names if not self.is_text(n)]
        for number, line in self._rows():
            fields = split(line, layout.delimiter)
            if len(fields) != len(self.names):
                return self._ragged(number, len(fields))
            for k, name in wanted:
                if not is_number(fields[k], layout.decimal_comma):
                    return InputError(
                        f"'{fields[k][:30]}' is not a number",
                        expected="a number",
                        cure="correct or remove this line",
                        where=f"{self.path}, line {number}, column '{name}'",
                    )
        return InputError("cannot be read as a table of numbers", where=str(self.path))

    def _ragged(self, number: int, count: int) -> InputError:
        return InputError(
            f"this line has {count} field{'' if count == 1 else 's'}",
            expected=f"{len(self.names)}, as the lines before",
            cure="correct or remove this line",
            where=f"{self.path}, line {number}",
        )


def _single_blanks(data: bytes) -> bytes:
    """Return text with one blank between columns and none at either end of a line.

    Replacing whole strings again and again is ten times as fast as one regular expression.
    """
    data = data.replace(b"\t", b" ").replace(b"\r\n", b"\n")
    for many in (8, 4, 2, 2, 2):
        data = data.replace(b" " * many, b" ")
    while b"  " in data:
        data = data.replace(b"  ", b" ")
    data = data.replace(b"\n ", b"\n").replace(b" \n", b"\n")
    return data.removeprefix(b" ").removesuffix(b" ")


def _all_null(frame: polars.DataFrame) -> polars.Expr:
    import polars

    return polars.all_horizontal(polars.all().is_null()).alias("blank")


def open_text(path: Path, options: TextOptions) -> TextSource:
    """Open a text file: find its layout and check that its end is not cut off."""
    layout = find_layout(path, options)
    source = TextSource(path, layout)
    reason = _cut_off(path, layout)
    if not reason:
        return source
    if not options.repair:
        with path.open("rb") as stream:
            number = sum(1 for _ in stream)
        raise InputError(
            f"the file ends in the middle of a line ({reason})",
            expected=f"{len(layout.names)} fields and an end of line",
            cure="copy the file again, or read it with repair=True to leave this line out",
            where=f"{path}, line {number}",
        )
    end = _start_of_last_line(path)
    return TextSource(path, layout, ("left out the last line, which was cut off",), end)


def _tail(path: Path) -> bytes:
    with path.open("rb") as stream:
        stream.seek(0, 2)
        stream.seek(max(0, stream.tell() - (1 << 15)))
        return stream.read()


def _start_of_last_line(path: Path) -> int:
    tail = _tail(path)
    return path.stat().st_size - (len(tail) - (tail.rfind(b"\n") + 1))


def _cut_off(path: Path, layout: Layout) -> str:
    """Say why the last line looks cut off; empty when it does not."""
    tail = _tail(path)
    if tail.endswith((b"\n", b"\r")):
        return ""
    lines = tail.decode("utf-8", errors="replace").splitlines()
    if len(lines) < 2 or (layout.comment and lines[-1].startswith(layout.comment)):
        return ""
    last = split(lines[-1], layout.delimiter)
    if len(last) < len(layout.names):
        return f"{len(last)} of {len(layout.names)} fields"
    if not last[-1] or last[-1][-1] in ".,eE+-":
        return f"its last field is '{last[-1]}'"
    before = [split(x, layout.delimiter)[-1] for x in lines[-40:-1] if x.strip()]
    decimals = np.array([_decimals(x) for x in before if x])
    if decimals.size > 5 and np.ptp(decimals) == 0 and _decimals(last[-1]) < decimals[0]:
        return f"its last field is '{last[-1]}', shorter than in the lines before"
    return ""


def _decimals(field: str) -> int:
    digits = re.split(r"[eE]", field.replace(",", "."))[0]
    return len(digits.partition(".")[2])
