"""The characters of a text file: encodings and ends of lines, made plain where they are not."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

_SAMPLE = 1 << 18


@dataclass(frozen=True, slots=True, eq=False)
class Content:
    """A text file as UTF-8 with ordinary ends of lines."""

    path: Path  # the file
    # its content where it had to be made plain; None: the file can be read as it is.
    data: bytes | None = None
    notes: tuple[str, ...] = ()  # what was done

    def whole(self) -> bytes:
        """Return all of it."""
        return self.path.read_bytes() if self.data is None else self.data

    def head(self, size: int = _SAMPLE) -> tuple[bytes, bool]:
        """Return the beginning, and whether there is more."""
        if self.data is not None:
            return self.data[:size], len(self.data) > size
        with self.path.open("rb") as stream:
            return stream.read(size), bool(stream.read(1))

    def tail(self, size: int = 1 << 15) -> bytes:
        """Return the end."""
        if self.data is not None:
            return self.data[-size:]
        with self.path.open("rb") as stream:
            stream.seek(0, 2)
            stream.seek(max(0, stream.tell() - size))
            return stream.read()


def content_of(path: Path) -> Content:
    """Open a text file, whatever program wrote it."""
    with path.open("rb") as stream:
        sample = stream.read(_SAMPLE)
    wide = _wide_encoding(sample)
    if wide:
        text = path.read_bytes().decode(wide, errors="replace").lstrip("\ufeff")
        data = _plain_ends(text.encode())
        return Content(path, data, (f"decoded from {wide.upper()}",))
    zeros = _zeros_at_end(path)
    if zeros:
        data, said = path.read_bytes()[:-zeros], f"left out {zeros} zero bytes at the end"
        return Content(path, _plain_ends(data), (f"{said}: the power failed while it was written",))
    if b"\r\r\n" in sample or (b"\r" in sample and b"\n" not in sample):
        word = "CR CR LF" if b"\n" in sample else "CR"
        return Content(path, _plain_ends(path.read_bytes()), (f"ends of lines are {word}",))
    return Content(path)


def _wide_encoding(sample: bytes) -> str:
    """Return the name of a 16-bit encoding; empty for any other."""
    if sample[:2] == b"\xff\xfe":
        return "utf-16-le"
    if sample[:2] == b"\xfe\xff":
        return "utf-16-be"
    even, odd = sample[0:2000:2], sample[1:2000:2]
    if len(odd) > 20 and odd.count(0) > 0.95 * len(odd) and not even.count(0):
        return "utf-16-le"
    if len(odd) > 20 and even.count(0) > 0.95 * len(even) and not odd.count(0):
        return "utf-16-be"
    return ""


def _zeros_at_end(path: Path) -> int:
    """Count the zero bytes that a card without power leaves where lines should have come."""
    with path.open("rb") as stream:
        end = stream.seek(0, 2)
        zeros = 0
        while zeros < end:
            stream.seek(max(end - zeros - _SAMPLE, 0))
            piece = stream.read(min(_SAMPLE, end - zeros))
            found = len(piece) - len(piece.rstrip(b"\0"))
            zeros += found
            if found < len(piece):
                break
    return zeros


def _plain_ends(data: bytes) -> bytes:
    return data.replace(b"\r\r\n", b"\n").replace(b"\r\n", b"\n").replace(b"\r", b"\n")
