"""Latitudes and longitudes with their hemisphere in the cell, as '48.1 N' and '4807.038 N'."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence

from schuler.io.tables.content import Content
from schuler.io.tables.fields import split_all

_SUSPECT = re.compile(rb"(?m)[\d.'\"\xb3\xb2\xb0\x9d\x99] ?[NSEW][\t;,|\"\r\n]")
_PART = r"(\d+(?:\.\d+)?)"
_CELL = re.compile(
    rf"{_PART}\s*(?:[°º\s]\s*{_PART}\s*(?:['′’\s]\s*(?:{_PART}\s*)?)?)?[\"″”°º'′]*\s*([NSEW])"
)
_LOOKED_AT = 40


def signed_degrees(content: Content) -> Content:
    """Return the text with signed degrees in place of numbers with a hemisphere."""
    if len(_SUSPECT.findall(content.head(1 << 14)[0])) < 2:
        return content
    lines = content.whole().decode("utf-8-sig", errors="replace").splitlines()
    for delimiter in "\t;,|":
        rows = [split_all(x, delimiter) for x in lines[-_LOOKED_AT:] if x.strip()]
        width = max(map(len, rows), default=0)
        rows = [r for r in rows if len(r) == width]
        # all rows but those of the header, which a short file shows too
        enough = max(2.0, 0.9 * (len(rows) - 3))
        which = [
            k for k in range(width) if sum(bool(_CELL.fullmatch(r[k])) for r in rows) >= enough
        ]
        if width > 1 and which:
            joined = _joined_minutes([r[k] for r in rows for k in which])
            text = _rewritten(lines, delimiter, which, joined)
            note = "hemispheres in the cells became signs"
            if joined:
                note = "taken as degrees and minutes in one number (NMEA): cells with N, S, E, W"
            return Content(content.path, text.encode(), (*content.notes, note))
    return content


def _joined_minutes(cells: Sequence[str]) -> bool:
    """Tell whether degrees and minutes stand in one number, as in NMEA."""
    found = [m for m in map(_CELL.fullmatch, cells) if m]
    return any(m[2] is None and float(m[1]) > (90.0 if m[4] in "NS" else 180.0) for m in found)


def _degrees(cell: str, joined: bool) -> str:
    match = _CELL.fullmatch(cell)
    if match is None:
        return cell
    degrees, minutes, seconds = (float(match[k] or 0.0) for k in (1, 2, 3))
    if joined:
        degrees, minutes = divmod(degrees, 100.0)
    size = degrees + minutes / 60.0 + seconds / 3600.0
    return f"{-size if match[4] in 'SW' else size:.11f}"


def _rewritten(lines: Sequence[str], delimiter: str, which: Sequence[int], joined: bool) -> str:
    out = io.StringIO()
    writer = csv.writer(out, delimiter=delimiter, lineterminator="\n")
    for line in lines:
        fields = split_all(line, delimiter)
        if len(fields) > max(which) and any(_CELL.fullmatch(fields[k]) for k in which):
            writer.writerow(
                [_degrees(f, joined) if k in which else f for k, f in enumerate(fields)]
            )
        else:
            out.write(line + "\n")
    return out.getvalue()
