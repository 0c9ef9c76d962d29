"""Parquet files, looked over before Polars decodes them.

Polars allocates what the headers claim and ends the whole process when there is not as much;
a single damaged byte suffices. Footer and page headers (Thrift's compact protocol, and
parquet.thrift of the Parquet format) are therefore followed here first, in a few milliseconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from schuler.errors import InputError

if TYPE_CHECKING:
    from polars import DataFrame, DataType

Struct = dict[int, Any]
_MAGIC = b"PAR1"
_HEADER_BYTES = 1 << 16
_MAX_DEPTH = 32
_REPEATED = 2


class Damaged(Exception):
    """What is wrong with the bytes."""


def parquet_schema(path: Path) -> tuple[dict[str, DataType], dict[str, str]]:
    """Return names and types of the columns, and the key-value metadata."""
    import polars

    _look_over(path)
    try:
        # Opened here: a path with brackets would be taken for a pattern.
        with path.open("rb") as file:
            schema = dict(polars.read_parquet_schema(file))
        return schema, polars.read_parquet_metadata(_for_polars(path))
    except (polars.exceptions.PolarsError, polars.exceptions.PanicException, OSError) as error:
        raise _refusal(path, error) from None


def parquet_rows(path: Path) -> int:
    """Return the number of rows of a file that was opened before."""
    import polars

    return int(
        polars.scan_parquet(_for_polars(path), glob=False).select(polars.len()).collect().item()
    )


def parquet_frame(
    path: Path, names: Sequence[str] | None = None, part: tuple[int, int] | None = None
) -> DataFrame:
    """Read columns of a Parquet file, all by default; first row and number of rows of a part."""
    import polars

    if part is None:
        _look_over(path)
    try:
        columns = None if names is None else list(names)
        if part is not None:
            frame = polars.scan_parquet(_for_polars(path), glob=False).slice(*part)
            return (frame if columns is None else frame.select(columns)).collect()
        return polars.read_parquet(_for_polars(path), glob=False, columns=columns)
    except (polars.exceptions.PolarsError, polars.exceptions.PanicException, OSError) as error:
        raise _refusal(path, error) from None


def _for_polars(path: Path) -> Path | BytesIO:
    """Return a path; the content of the file where its name is not Unicode, as Rust wants it."""
    try:
        str(path).encode()
    except UnicodeEncodeError:
        return BytesIO(path.read_bytes())
    return path


def _refusal(path: Path, error: Exception) -> InputError:
    reason = str(error).splitlines()[0] if str(error) else type(error).__name__
    return InputError(
        f"the Parquet file is cut short or damaged ({reason[:80]})",
        expected="a complete Parquet file",
        cure="copy or write it again",
        where=str(path),
    )


def _look_over(path: Path) -> None:
    try:
        with path.open("rb") as file:
            _check_file(file, path.stat().st_size)
    except (Damaged, OSError) as error:
        raise _refusal(path, error) from None


def _check_file(file: BinaryIO, size: int) -> None:
    file.seek(max(size - 8, 0))
    tail = file.read(8)
    length = int.from_bytes(tail[:4], "little")
    if size < 12 or tail[4:] != _MAGIC or length > size - 12:
        raise Damaged("no footer at its end")
    start = size - 8 - length
    file.seek(start)
    footer = _Thrift(file.read(length)).struct()
    schema, groups = _list(footer, 2), _list(footer, 4)
    _check_schema(schema)
    flat = all(_number(e, 3, 0) != _REPEATED for e in schema)
    if sum(_number(g, 3) for g in groups) != _number(footer, 3):
        raise Damaged("the rows of its groups do not add up")
    for group in groups:
        for chunk in _list(group, 1):
            about = _struct(chunk, 3)
            if flat and _number(about, 5) != _number(group, 3):
                raise Damaged("a column differs in length from its group")
            _check_pages(file, about, start)


def _check_schema(schema: list[Struct]) -> None:
    """Follow the tree of columns; its depth is what a reader recurses into."""
    open_branches: list[int] = []
    for element in schema:
        children = _number(element, 5, 0)
        if len(open_branches) > _MAX_DEPTH or children > len(schema):
            raise Damaged("a tree of columns that does not end")
        open_branches.append(children)
        while open_branches and open_branches[-1] == 0:
            open_branches.pop()
            if open_branches:
                open_branches[-1] -= 1
    if open_branches or not schema:
        raise Damaged("a tree of columns that does not end")


def _check_pages(file: BinaryIO, column: Struct, end_of_data: int) -> None:
    """Follow the pages of one column: each inside the column, with as many values in all."""
    place = _number(column, 9)
    if 11 in column:
        place = min(place, _number(column, 11))
    end = place + _number(column, 7)
    if place < len(_MAGIC) or end > end_of_data:
        raise Damaged("a column lies outside of the file")
    values, unpacked = 0, 0
    while place < end:
        file.seek(place)
        header = _Thrift(file.read(min(_HEADER_BYTES, end - place)))
        page = header.struct()
        place += header.place + _number(page, 3)
        unpacked += header.place + _number(page, 2)
        for kind in (5, 8):  # data pages of version 1 and 2
            if kind in page:
                values += _number(_struct(page, kind), 1)
        if 7 in page and _number(_struct(page, 7), 1) > 8 * _number(page, 2):
            raise Damaged("a dictionary larger than its page")
        if place > end or unpacked > _number(column, 6):
            raise Damaged("a page is larger than its column")
    if values != _number(column, 5):
        raise Damaged("the pages of a column do not add up")


def _number(struct: Struct, field: int, default: int | None = None) -> int:
    value = struct.get(field, default)
    if not isinstance(value, int) or value < 0:
        raise Damaged("a size is missing or negative")
    return value


def _struct(struct: Struct, field: int) -> Struct:
    value = struct.get(field)
    if not isinstance(value, dict):
        raise Damaged("a header is missing")
    return value


def _list(struct: Struct, field: int) -> list[Struct]:
    value = struct.get(field)
    if not isinstance(value, list) or not all(isinstance(v, dict) for v in value):
        raise Damaged("a list is missing")
    return value


@dataclass(slots=True)
class _Thrift:
    """A reader of Thrift's compact protocol: structs as mappings from field number to value."""

    data: bytes
    place: int = 0

    def struct(self, depth: int = 0) -> Struct:
        found: Struct = {}
        field = 0
        while True:
            head = self._byte()
            if head == 0:
                return found
            field = field + (head >> 4) if head >> 4 else self._zigzag()
            kind = head & 15
            found[field] = kind == 1 if kind in (1, 2) else self._value(kind, depth)

    def _value(self, kind: int, depth: int) -> Any:
        if depth > _MAX_DEPTH:
            raise Damaged("headers nested without end")
        if kind in (1, 2, 3):
            return self._byte()
        if kind in (4, 5, 6):
            return self._zigzag()
        if kind == 7:
            return self._bytes(8)
        if kind == 8:
            return self._bytes(self._varint())
        if kind in (9, 10):
            head = self._byte()
            count = head >> 4 if head >> 4 < 15 else self._varint()
            self._fits(count)
            return [self._value(head & 15, depth + 1) for _ in range(count)]
        if kind == 12:
            return self.struct(depth + 1)
        raise Damaged("a header of unknown kind")

    def _byte(self) -> int:
        return self._bytes(1)[0]

    def _bytes(self, count: int) -> bytes:
        self._fits(count)
        self.place += count
        return self.data[self.place - count : self.place]

    def _fits(self, count: int) -> None:
        if count > len(self.data) - self.place:
            raise Damaged("a header is cut short")

    def _varint(self) -> int:
        value, shift = 0, 0
        while shift < 64:
            byte = self._byte()
            value |= (byte & 127) << shift
            if byte < 128:
                return value
            shift += 7
        raise Damaged("a number without end")

    def _zigzag(self) -> int:
        value = self._varint()
        return (value >> 1) ^ -(value & 1)
