"""Files of other kinds, told by their first bytes and refused by name with the cure."""

from __future__ import annotations

from pathlib import Path

from schuler.errors import InputError

_KINDS: tuple[tuple[bytes, str, str], ...] = (
    (b"\x1f\x8b", "packed with gzip", "unpack it first (gunzip)"),
    (b"BZh", "packed with bzip2", "unpack it first (bunzip2)"),
    (b"\xfd7zXZ", "packed with xz", "unpack it first (unxz)"),
    (b"7z\xbc\xaf", "a 7z archive", "unpack it first"),
    (
        b"PK\x03\x04",
        "a ZIP archive",
        "unpack it (of an Excel workbook: save the sheet as CSV)",
    ),
    (b"\xd0\xcf\x11\xe0", "an old Excel workbook", "save the sheet as CSV"),
    (b"%PDF", "a PDF document", "take the log itself"),
    (b"<!doctype html", "an HTML page", "download the file itself, not the page about it"),
    (b"<html", "an HTML page", "download the file itself, not the page about it"),
    (b"<?xml", "XML", "write it as CSV (a GPX track: with columns time, lat, lon, ele)"),
    (b"<gpx", "XML", "write it as CSV (a GPX track: with columns time, lat, lon, ele)"),
)


def refuse_foreign(path: Path, opening: bytes) -> None:
    """Raise when a file opens like one of another kind."""
    begins = opening.removeprefix(b"\xef\xbb\xbf").lstrip()[:16].lower()
    for magic, kind, cure in _KINDS:
        if begins.startswith(magic.lower()):
            raise InputError(
                f"the file is {kind}", expected="a recording", cure=cure, where=str(path)
            )
