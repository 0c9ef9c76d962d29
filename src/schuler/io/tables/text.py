"""CSV and other text: read fast by polars, and slowly once more only to find a fault."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from schuler.errors import InputError
from schuler.io.columns import is_unit, split_unit
from schuler.io.format import Format, Start, What
from schuler.io.source import Columns, TextOptions, even_parts
from schuler.io.tables.cells_with_units import plain_cells
from schuler.io.tables.content import Content, content_of
from schuler.io.tables.fields import (
    MISSING,
    MISSING_WORDS,
    is_number,
    refuse_hexadecimal,
    separated_thousands,
    split,
    split_all,
)
from schuler.io.tables.hemispheres import signed_degrees
from schuler.io.tables.layout import Layout, find_layout
from schuler.io.tables.terminal_lines import without_terminal_stamps
from schuler.io.trajectories.table import recording_csv, write_csv
from schuler.unit_grammar import evaluate

if TYPE_CHECKING:
    import polars

    from schuler.io.options import ReadOptions


_LINES_WEIGHED = 200


@dataclass(frozen=True, eq=False)
class TextSource:
    """A text file whose layout is known."""

    content: Content  # the file
    layout: Layout  # how it is laid out
    history: tuple[str, ...] = ()  # what the reader did
    assumptions: tuple[str, ...] = ()  # what the reader took for granted
    # length in bytes to be read, when a last line that was cut off is left out
    end: int | None = None
    first_row: int | None = None  # of a part of a file: which row of it comes first
    lines_before: int = 0  # lines of the file in front of a part

    @property
    def path(self) -> Path:
        """File the columns come from."""
        return self.content.path

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
        """Sampling rate that the lines above the table state."""
        return self.layout.rate

    @cached_property
    def _texts(self) -> frozenset[str]:
        """Names of the columns that hold text: more words than numbers in the first rows."""
        comma, special = self.layout.decimal_comma, self._separated
        found = set()
        for k, name in enumerate(self.names):
            if k in special:
                continue
            fields = [f for f in self.layout.fields_of(name) if f.lower() not in MISSING]
            numbers = sum(is_number(f, comma) for f in fields)
            if fields and (numbers < 0.5 * len(fields) or (numbers == 0)):
                found.add(name)
        return frozenset(found)

    @cached_property
    def _separated(self) -> frozenset[int]:
        """Columns whose numbers are written with separators of thousands."""
        layout = self.layout
        if layout.delimiter == " ":
            return frozenset()
        return frozenset(
            k for k in range(len(self.names))
            if separated_thousands(layout.rows, k, layout.decimal_comma)
        )  # fmt: skip

    @cached_property
    def _rewritten(self) -> bool:
        """Whether polars cannot read the numbers as they are written."""
        layout = self.layout
        return bool(self._separated) or (layout.decimal_comma and layout.delimiter == ",")

    def is_text(self, name: str) -> bool:
        """Tell whether a column holds words instead of numbers."""
        return name in self._texts

    def load(self, names: Sequence[str]) -> Columns:
        """Read columns as float64 (NaN: missing), or as text where `is_text` says so."""
        frame = self._frame(names)
        if frame is None:
            frame = self._without_repeated_headers(names)
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

    def _frame(self, names: Sequence[str], data: bytes | None = None) -> polars.DataFrame | None:
        import polars

        layout, rewritten = self.layout, self._rewritten
        wanted = [self.names.index(n) for n in names]
        schema: dict[str, Any] = {f"c{k}": polars.String for k in range(len(self.names))}
        for name, k in zip(names, wanted, strict=True):
            if not self.is_text(name):
                schema[f"c{k}"] = polars.Float64
        if self._trailing_delimiter() and not rewritten:
            schema["end of line"] = polars.String
        source = self._data() if data is None else data
        if rewritten:
            source = self._plain_numbers(source)
        # Words for missing values and odd encodings cost time, so they are tried second.
        for words in (None, MISSING_WORDS):
            try:
                return polars.read_csv(
                    source,
                    glob=False,
                    has_header=False,
                    skip_lines=0 if rewritten else layout.first_line,
                    schema=schema,
                    separator="\t" if rewritten else layout.delimiter,
                    comment_prefix=layout.comment,
                    decimal_comma=layout.decimal_comma and not rewritten,
                    null_values=words,
                    encoding="utf8-lossy" if words else "utf8",
                ).select(f"c{k}" for k in wanted)
            except polars.exceptions.PolarsError:
                continue
        return None

    def _without_repeated_headers(self, names: Sequence[str]) -> polars.DataFrame:
        """Read once more without lines that repeat the header; raise when that is not the fault."""
        header = self.layout.header.strip().encode()
        data = self.content.whole()[: self.end]
        lines = data.split(b"\n")
        first = self.layout.first_line
        kept = [x for k, x in enumerate(lines) if k < first or x.strip() != header]
        if not header or len(kept) == len(lines):
            raise self._fault(names)
        again = replace(
            self, content=Content(self.path, b"\n".join(kept), self.content.notes), end=None
        )
        frame = again._frame(names)
        if frame is None:
            raise self._fault(names)
        return frame

    def _trailing_delimiter(self) -> bool:
        """Tell whether rows end in a delimiter behind which no column stands."""
        layout = self.layout
        if layout.delimiter == " ":
            return False
        lines = self.content.head()[0].split(b"\n")[layout.first_line : layout.first_line + 40]
        widths = [
            len(split_all(x.decode("utf-8", errors="replace"), layout.delimiter))
            for x in lines[:-1] or lines
            if x.strip()
        ]
        return bool(widths) and max(widths) == len(self.names) + 1

    def _data(self) -> Path | bytes:
        """Return what polars can read: the file, or its content with single delimiters."""
        delimiter = self.layout.delimiter
        padded = delimiter != " " and self._has_blanks()
        whole = self.content.data is None and self.end is None
        if delimiter != " " and not padded and whole:
            return self.path
        data = self.content.whole()[: self.end]
        if delimiter == " ":
            return _single_blanks(data)
        if not padded:
            return data
        if not self._texts and '"' not in self.layout.header:
            return data.replace(b" ", b"")
        mark = delimiter.encode()
        data = re.sub(rb"[ \t]*" + re.escape(mark) + rb"[ ]*", mark, data)
        return re.sub(rb"(?m)^[ ]+|[ ]+(?=\r?$)", b"", data)

    def _plain_numbers(self, data: Path | bytes) -> bytes:
        """Return rows between tabs, with points and without separators of thousands."""
        raw = data.read_bytes() if isinstance(data, Path) else data
        text = raw.decode("utf-8-sig", errors="replace").split("\n", self.layout.first_line)[-1]
        rows = csv.reader(io.StringIO(text), delimiter=self.layout.delimiter)
        comma, width = self.layout.decimal_comma, len(self.names)
        mark = "." if comma else ","
        lines = []
        for row in rows:
            fields = [f.strip().replace("\t", " ") for f in row[:width]]
            for k, field in enumerate(fields):
                plain = field.replace(mark, "") if k in self._separated else field
                if comma:
                    plain = plain.replace(",", ".")
                fields[k] = plain if is_number(plain, False) else field
            lines.append("\t".join(fields))
        return "\n".join(lines).encode()

    def _has_blanks(self) -> bool:
        """Tell whether blanks stand around the numbers (polars does not skip them)."""
        sample = self.content.head()[0]
        for _ in range(self.layout.first_line):
            sample = sample.partition(b"\n")[2]
        if any(not is_number(f, True) for row in self.layout.rows for f in row):
            return bool(re.search(rb"[ ][^\w]|[^\w\r\n][ ]", sample))
        return b" " in sample

    def _rows(self) -> Iterator[tuple[int, str]]:
        """Yield line number (from 1) and text of every line of numbers."""
        if self.content.data is None:
            with self.path.open("rb") as stream:
                yield from self._numbered(stream)
        else:
            yield from self._numbered(io.BytesIO(self.content.data))

    def _numbered(self, stream: Any) -> Iterator[tuple[int, str]]:
        for number, raw in enumerate(stream):
            line = raw.decode("utf-8-sig", errors="replace")
            if number < self.layout.first_line or not line.strip():
                continue
            if self.layout.comment and line.startswith(self.layout.comment):
                continue
            yield number + 1 + self.lines_before, line

    def _fault(self, names: Sequence[str]) -> InputError:
        """Find the line and the column that cannot be read."""
        layout = self.layout
        wanted = [(self.names.index(n), n) for n in names if not self.is_text(n)]
        for number, line in self._rows():
            fields = split_all(line, layout.delimiter)
            if len(fields) > len(self.names) + 1 or (len(fields) > len(self.names) and fields[-1]):
                return self._ragged(number, len(fields))
            if len(split(line, layout.delimiter)) < 2 <= len(self.names):
                return self._ragged(number, len(fields))
            for k, name in wanted:
                field = fields[k] if k < len(fields) else ""
                if not is_number(field, layout.decimal_comma):
                    if len(fields) != len(self.names):
                        return self._ragged(number, len(fields))
                    return InputError(
                        f"'{field[:30]}' is not a number",
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
    content = signed_degrees(without_terminal_stamps(content_of(path)))
    content, in_cells = plain_cells(content)
    layout = find_layout(content, options)
    if in_cells:
        layout = replace(layout, units=_with_cells(layout, in_cells, path))
    left_out = tuple(n for n in content.notes if n.startswith(("left out", "taken as")))
    source = TextSource(content, layout, content.notes, left_out)
    refuse_hexadecimal([layout.fields_of(n) for n in source.names if source.is_text(n)], path)
    reason = _cut_off(content, layout)
    if not reason:
        return source
    if not options.repair:
        number = content.whole().count(b"\n") + 1
        raise InputError(
            f"the file ends in the middle of a line ({reason})",
            expected=f"{len(layout.names)} fields and an end of line",
            cure="copy the file again, or read it with repair=True to leave this line out",
            where=f"{path}, line {number}",
        )
    end = content.whole().rfind(b"\n") + 1
    said = "left out the last line, which was cut off"
    return replace(source, history=(*content.notes, said), assumptions=(*left_out, said), end=end)


def _with_cells(layout: Layout, in_cells: dict[int, str], path: Path) -> dict[str, str]:
    """Return the units of a table with those of its cells, which the header must not contradict."""
    units = dict(layout.units)
    for k, unit in in_cells.items():
        name = layout.names[k]
        stated = units.get(name) or split_unit(name)[1]
        if stated and is_unit(stated) and is_unit(unit) and evaluate(stated) != evaluate(unit):
            raise InputError(
                f"the header says '{stated}', the cells say '{unit}'",
                expected="the same unit",
                cure="correct the header or the cells",
                where=f"{path}, column '{name}'",
            )
        units[name] = unit
    return units


def text_parts(path: Path, what: What, options: ReadOptions, rows: int) -> Iterator[TextSource]:
    """Yield a text file in parts that end at ends of lines."""
    whole = open_table(path, what, options)
    layout, data, left = whole.layout, whole.content.data, whole.end
    head = whole.content.head()[0].split(b"\n")[layout.first_line :][:_LINES_WEIGHED]
    size = rows * (1 + sum(map(len, head)) // max(len(head), 1))
    row = lines = 0
    total = path.stat().st_size if data is None else len(data)
    size = max(stop - start for start, stop in even_parts(total, size))
    with path.open("rb") if data is None else io.BytesIO(data) as stream:
        while piece := stream.read(size if left is None else min(size, left)):
            if left is None or len(piece) < left:
                piece += stream.readline()
            left = None if left is None else max(left - len(piece), 0)
            count = _rows_in(piece, layout)
            if count > 0:
                content = Content(path, piece, whole.content.notes)
                yield replace(
                    whole, content=content, layout=layout, end=None, first_row=row,
                    lines_before=lines,
                )  # fmt: skip
            row, lines = row + count, lines + piece.count(b"\n")
            layout = replace(layout, first_line=0)


def _rows_in(piece: bytes, layout: Layout) -> int:
    """Count the lines of numbers: all but the header, blank ones and comments."""
    ends = piece.count(b"\n") + (not piece.endswith(b"\n"))
    blank = piece.count(b"\n\n") + piece.count(b"\n\r\n")
    remarks = piece.count(b"\n" + layout.comment.encode()) if layout.comment else 0
    return ends - layout.first_line - blank - remarks


def _cut_off(content: Content, layout: Layout) -> str:
    """Say why the last line looks cut off; empty when it does not."""
    tail = content.tail()
    if tail.endswith((b"\n", b"\r")):
        return ""
    lines = tail.decode("utf-8", errors="replace").splitlines()
    if len(lines) < 2 or (layout.comment and lines[-1].startswith(layout.comment)):
        return ""
    last = split_all(lines[-1], layout.delimiter)
    if len(last) < len(layout.names):
        return f"{len(last)} of {len(layout.names)} fields"
    before = [split_all(x, layout.delimiter) for x in lines[-40:-1] if x.strip()]
    if not last[-1]:
        usual = sum(not f[-1] for f in before) > 0.5 * len(before)
        return "" if usual else f"its last field is '{last[-1]}'"
    if last[-1][-1] in ".,eE+-":
        return f"its last field is '{last[-1]}'"
    decimals = np.array([_decimals(f[-1]) for f in before if f[-1]])
    if decimals.size > 5 and np.ptp(decimals) == 0 and _decimals(last[-1]) < decimals[0]:
        return f"its last field is '{last[-1]}', shorter than in the lines before"
    return ""


def _decimals(field: str) -> int:
    digits = re.split(r"[eE]", field.replace(",", "."))[0]
    return len(digits.partition(".")[2])


def open_table(path: Path, what: What, options: ReadOptions) -> TextSource:
    """Open a table of text with the options of a reader; it must have names."""
    text = options.text()
    source = open_text(path, text)
    if not source.layout.named and options.columns is None:
        raise InputError(
            f"the file has no line with the names of its {len(source.names)} columns",
            expected="a header, or the names in order",
            cure=f"give them, e.g. {_NAMES_IN_ORDER[what]}",
            where=str(path),
        )
    return source


_NAMES_IN_ORDER = {
    "imu": "columns=('time', 'gyro_x', 'gyro_y', 'gyro_z', 'accel_x', ...)",
    "gnss": "columns=('time', 'latitude', 'longitude', 'height', ...)",
    "sensor": "columns=('time', 'value', 'sd')",
}


def _is_text(start: Start) -> bool:
    data = start.bytes
    if not data or start.path.suffix.lower() in _BINARY:
        return False
    return b"\0" not in data or bool(start.lines)


_BINARY = {".parquet", ".npz", ".npy", ".bag", ".db3", ".mcap"}

FORMATS = (
    Format(
        "csv",
        "CSV and other text",
        (".csv", ".txt", ".tsv", ".dat", ".log", ".asc"),
        ("imu", "gnss", "sensor"),
        detect=_is_text,
        open=open_table,
        parts=text_parts,
        write_trajectory=write_csv,
        write_recording=recording_csv,
    ),
)
