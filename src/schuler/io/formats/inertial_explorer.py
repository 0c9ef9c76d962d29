"""Text exports of NovAtel's Inertial Explorer: a report above the names, units below them."""

from __future__ import annotations

import re

from schuler.io.format import Format, Start
from schuler.io.tables.text import open_table

_NAMES = re.compile(r"(?:GPSTime|UTCTime)\b.*\bLatitude\b.*\bLongitude\b.*\bH-?(?:Ell|MSL)\b")


def _is_export(start: Start) -> bool:
    return any(_NAMES.search(x) for x in start.lines[:60])


FORMATS = (
    Format(
        "inertial-explorer",
        "text of Inertial Explorer",
        (".txt",),
        ("gnss", "imu"),
        detect=_is_export,
        open=open_table,
    ),
)
