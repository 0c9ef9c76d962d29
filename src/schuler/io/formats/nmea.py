"""NMEA 0183: GGA, RMC, GST and VTG of any talker, out of a mixed stream."""

from __future__ import annotations

import datetime
import re
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from schuler.errors import InputError
from schuler.io.format import Format, Start, What
from schuler.io.formats.fixes import QUALITY_OF_NMEA, only_fixes
from schuler.io.source import Columns, MemorySource
from schuler.io.trajectories.receivers import write_nmea

if TYPE_CHECKING:
    from schuler.io.options import ReadOptions

_SENTENCE = re.compile(rb"\$[A-Z]{2}(GGA|RMC|GST|VTG),([^*\r\n$]*)\*([0-9A-Fa-f]{2})")
_KNOT = 1852.0 / 3600.0
_Epoch = dict[str, float]


def open_nmea(path: Path, what: What, options: ReadOptions) -> MemorySource:
    """Read the epochs of a receiver; the time is UTC, with the date where RMC gives it."""
    epochs: dict[float, _Epoch] = {}
    wrong, now, day, last = 0, 0.0, 0.0, -1.0
    for match in _SENTENCE.finditer(path.read_bytes()):
        if not _intact(match):
            wrong += 1
            continue
        kind, fields = match[1].decode(), match[2].decode("latin-1").split(",")
        if kind != "VTG":
            moment = _time_of_day(fields[0])
            if moment is None:
                continue
            if last - moment > 43200.0:
                day += 86400.0
            last = moment
            now = day + moment
        epoch = epochs.setdefault(now, {})
        try:
            _READERS[kind](fields, epoch)
        except (ValueError, IndexError):
            wrong += 1
    if not epochs and wrong:
        raise InputError(
            f"NMEA 0183 whose checksums are wrong in all {wrong} sentences",
            expected="sentences as the receiver wrote them",
            cure="copy the file again, as it came from the receiver",
            where=str(path),
        )
    if not epochs or not any("latitude" in e for e in epochs.values()):
        raise InputError("NMEA without positions", expected="sentences GGA", where=str(path))
    columns, notes = _columns(epochs)
    if wrong:
        notes = (*notes, f"left out {wrong} sentences with a wrong checksum or content")
    source = only_fixes(path, columns, "NMEA, time as UTC")
    history, said = (*source.history, *notes), (*source.assumptions, *notes)
    return MemorySource(path, source.columns, {}, None, history, "epoch", said)


def _intact(match: re.Match[bytes]) -> bool:
    body = match[0][1 : match[0].rindex(b"*")]
    return int(np.bitwise_xor.reduce(np.frombuffer(body, np.uint8))) == int(match[3], 16)


def _time_of_day(text: str) -> float | None:
    try:
        return int(text[0:2]) * 3600.0 + int(text[2:4]) * 60.0 + float(text[4:])
    except ValueError:
        return None


def _angle(text: str, side: str) -> float:
    point = text.index(".") if "." in text else len(text)
    degrees = float(text[: point - 2] or 0) + float(text[point - 2 :]) / 60.0
    return -degrees if side in "SW" else degrees


def _gga(f: list[str], epoch: _Epoch) -> None:
    epoch["quality"] = float(QUALITY_OF_NMEA[min(int(f[5] or 0), 8)])
    if f[1]:
        epoch["latitude"], epoch["longitude"] = _angle(f[1], f[2]), _angle(f[3], f[4])
        epoch["msl"], epoch["geoid"] = float(f[8] or "nan"), float(f[10] or "nan")


def _rmc(f: list[str], epoch: _Epoch) -> None:
    if f[1] == "A" and f[6]:
        epoch["speed"], epoch["course"] = float(f[6]) * _KNOT, float(f[7] or "nan")
    if len(f[8]) == 6:
        day, month, two = int(f[8][:2]), int(f[8][2:4]), int(f[8][4:])
        year = two + (2000 if two < 80 else 1900)
        epoch["date"] = datetime.datetime(year, month, day, tzinfo=datetime.UTC).timestamp()


def _gst(f: list[str], epoch: _Epoch) -> None:
    epoch["north"], epoch["east"], epoch["up"] = (float(x or "nan") for x in f[5:8])


def _vtg(f: list[str], epoch: _Epoch) -> None:
    if f[6]:
        epoch["speed"], epoch["course"] = float(f[6]) / 3.6, float(f[0] or "nan")


_READERS = {"GGA": _gga, "RMC": _rmc, "GST": _gst, "VTG": _vtg}


def _columns(epochs: dict[float, _Epoch]) -> tuple[Columns, tuple[str, ...]]:
    kept = [(t, e) for t, e in epochs.items() if "latitude" in e]

    def column(key: str, default: float = np.nan) -> np.ndarray:
        return np.array([e.get(key, default) for _, e in kept])

    time = np.array([t for t, _ in kept])
    dates = [e["date"] - np.floor(t / 86400.0) * 86400.0 for t, e in epochs.items() if "date" in e]
    notes: tuple[str, ...] = ()
    if dates:
        time = time + dates[0]
    else:
        notes = ("no date (RMC): time is that of the day",)
    geoid = column("geoid")
    height = column("msl") + np.where(np.isfinite(geoid), geoid, 0.0)
    name = "height_ellipsoid_m" if np.isfinite(geoid).all() else "height_msl_m"
    columns: Columns = {
        "time_s": time,
        "latitude_deg": column("latitude"),
        "longitude_deg": column("longitude"),
        name: height,
        "quality": column("quality", 0.0),
    }
    columns["quality"] = np.where(np.isfinite(height), columns["quality"], 0.0)
    if np.isfinite(column("speed")).any():
        slow = column("speed") < 0.05
        course = np.where(slow & ~np.isfinite(column("course")), 0.0, column("course"))
        columns |= {"speed_m_s": column("speed"), "course_deg": course}
    if np.isfinite(column("north")).any():
        for axis, key in (("north", "north"), ("east", "east"), ("down", "up")):
            columns[f"pos_std_{axis}_m"] = column(key)
    return columns, notes


def _is_nmea(start: Start) -> bool:
    found = _SENTENCE.findall(start.bytes[:16384])
    return sum(kind in (b"GGA", b"RMC") for kind, _, _ in found) > 1


FORMATS = (
    Format(
        "nmea",
        "NMEA 0183",
        (".nmea", ".nma"),
        ("gnss",),
        detect=_is_nmea,
        open=open_nmea,
        write_trajectory=write_nmea,
    ),
)
