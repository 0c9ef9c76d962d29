"""ArduPilot's DataFlash logs, binary and text: messages whose layout the log itself describes."""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from schuler.errors import InputError
from schuler.io.format import Format, Start, What
from schuler.io.formats.fixes import QUALITY_OF_FIX_TYPE, only_fixes
from schuler.io.source import Columns, MemorySource
from schuler.types import FloatArray

if TYPE_CHECKING:
    from schuler.io.options import ReadOptions

_MARK = b"\xa3\x95"
_FORMAT_TYPE = 128
# Letter: type in memory, and the factor of the number.
_LETTERS = {
    "a": ("64V", 1.0), "b": ("i1", 1.0), "B": ("u1", 1.0), "M": ("u1", 1.0), "h": ("<i2", 1.0),
    "H": ("<u2", 1.0), "i": ("<i4", 1.0), "I": ("<u4", 1.0), "f": ("<f4", 1.0), "d": ("<f8", 1.0),
    "n": ("S4", 1.0), "N": ("S16", 1.0), "Z": ("S64", 1.0), "c": ("<i2", 0.01),
    "C": ("<u2", 0.01), "e": ("<i4", 0.01), "E": ("<u4", 0.01), "L": ("<i4", 1e-7),
    "q": ("<i8", 1.0), "Q": ("<u8", 1.0), "g": ("<f2", 1.0),
}  # fmt: skip
_IMU = re.compile(r"IMU(\d?)$")
_WANTED = {"imu": ("IMU", "IMU2", "IMU3"), "gnss": ("GPS", "GPA")}
_Table = dict[str, FloatArray]


class _Layout:
    """The layout of one kind of message."""

    def __init__(self, name: str, letters: str, labels: list[str], length: int) -> None:
        self.name, self.length = name, length
        pairs = list(zip(labels, letters, strict=False))
        self.dtype = np.dtype([("head", "V3"), *((n, _LETTERS[x][0]) for n, x in pairs)])
        self.factors = {n: _LETTERS[x][1] for n, x in pairs}
        self.texts = {n for n, x in pairs if x in "nNZa"}


def open_binary(path: Path, what: What, options: ReadOptions) -> MemorySource:
    """Read IMU or GNSS of a binary log."""
    data = path.read_bytes()
    layouts, places = _walk(data, _WANTED[what])
    raw = np.frombuffer(data, dtype=np.uint8)
    tables: dict[str, _Table] = {}
    for kind, offsets in places.items():
        layout = layouts[kind]
        if layout.dtype.itemsize != layout.length:
            continue
        rows = np.array(offsets)[:, np.newaxis] + np.arange(layout.length)
        block = np.ascontiguousarray(raw[rows]).view(layout.dtype).ravel()
        tables[layout.name] = {
            n: block[n].astype(np.float64) * layout.factors[n]
            for n in layout.factors
            if n not in layout.texts
        }
    return _source(path, what, tables)


def _walk(data: bytes, wanted: Iterable[str]) -> tuple[dict[int, _Layout], dict[int, list[int]]]:
    """Go through the messages and note where the wanted ones begin."""
    layouts: dict[int, _Layout] = {}
    lengths = {_FORMAT_TYPE: 89}
    places: dict[int, list[int]] = {}
    names = frozenset(wanted)
    at, end = 0, len(data)
    while at + 3 <= end:
        kind = data[at + 2]
        length = lengths.get(kind, 0)
        if data[at] != 0xA3 or data[at + 1] != 0x95 or not length:
            at = data.find(_MARK, at + 1)
            if at < 0:
                break
            continue
        if at + length > end:
            break
        if kind == _FORMAT_TYPE:
            layout = _described(data[at : at + length], lengths)
            if layout is not None and layout[1].name in names:
                layouts[layout[0]] = layout[1]
                places.setdefault(layout[0], [])
        elif kind in places:
            places[kind].append(at)
        at += length
    return layouts, {k: p for k, p in places.items() if p}


def _described(message: bytes, lengths: dict[int, int]) -> tuple[int, _Layout] | None:
    """Return the kind and the layout that a message of formats describes."""
    kind, length = message[3], message[4]
    texts = (message[5:9], message[9:25], message[25:89])
    name, letters, labels = (t.split(b"\0")[0].decode("latin-1") for t in texts)
    lengths[kind] = length
    if any(x not in _LETTERS for x in letters):
        return None
    return kind, _Layout(name, letters, labels.split(","), length)


def open_text_log(path: Path, what: What, options: ReadOptions) -> MemorySource:
    """Read IMU or GNSS of a log that was converted to text."""
    labels: dict[str, list[str]] = {}
    rows: dict[str, list[list[str]]] = {}
    with path.open(encoding="utf-8", errors="replace") as stream:
        for line in stream:
            name, _, rest = line.partition(",")
            name = name.strip()
            if name == "FMT":
                fields = [f.strip() for f in rest.split(",")]
                labels[fields[2]] = fields[4:]
            elif name in _WANTED[what] and name in labels:
                rows.setdefault(name, []).append(rest.split(","))
    tables: dict[str, _Table] = {}
    for name, found in rows.items():
        whole = [r for r in found if len(r) == len(labels[name])]
        tables[name] = {
            n: np.array([_number(r[k]) for r in whole]) for k, n in enumerate(labels[name])
        }
    return _source(path, what, tables)


def _number(text: str) -> float:
    try:
        return float(text)
    except ValueError:
        return np.nan


def _source(path: Path, what: What, tables: dict[str, _Table]) -> MemorySource:
    name = "IMU" if what == "imu" else "GPS"
    if name not in tables:
        raise InputError(
            f"the log has no messages {name}",
            expected="a DataFlash log with LOG_BITMASK for IMU and GPS",
            where=str(path),
        )
    return _imu(path, tables) if what == "imu" else _gnss(path, tables)


def _imu(path: Path, tables: dict[str, _Table]) -> MemorySource:
    """Put the IMUs below each other, with their number."""
    blocks: list[Columns] = []
    for name, table in tables.items():
        if not _IMU.match(name):
            continue
        number = table.get("I", np.full(table["TimeUS"].size, float(name[3:] or 1) - 1.0))
        block: Columns = {"TimeUS": table["TimeUS"], "imu": number}
        block |= {f"gyro_{a.lower()}": table[f"Gyr{a}"] for a in "XYZ"}
        block |= {f"accel_{a.lower()}": table[f"Acc{a}"] for a in "XYZ"}
        blocks.append(block)
    joined: Columns = {n: np.concatenate([b[n] for b in blocks]) for n in blocks[0]}
    if np.unique(joined["imu"]).size == 1:
        del joined["imu"]
    units = {"TimeUS": "us"} | {f"gyro_{a}": "rad/s" for a in "xyz"}
    units |= {f"accel_{a}": "m/s^2" for a in "xyz"}
    return MemorySource(path, joined, units, None, ("messages IMU of a DataFlash log",))


def _gnss(path: Path, tables: dict[str, _Table]) -> MemorySource:
    table = tables["GPS"]
    first = table.get("I", np.zeros(table["TimeUS"].size)) == 0
    table = {n: c[first] for n, c in table.items()}
    speed, course = table["Spd"], np.radians(table["GCrs"])
    scale = 1.0 if np.nanmax(np.abs(table["Lat"])) <= 90.0 else 1e-7
    columns: Columns = {
        "time_s": table["TimeUS"] * 1e-6,
        "latitude_deg": table["Lat"] * scale,
        "longitude_deg": table["Lng"] * scale,
        "height_msl_m": table["Alt"],
        "vel_north_m_s": speed * np.cos(course),
        "vel_east_m_s": speed * np.sin(course),
        "vel_down_m_s": table["VZ"],
        "quality": QUALITY_OF_FIX_TYPE[np.clip(table["Status"].astype(int), 0, 6)].astype(float),
    }
    accuracy = tables.get("GPA")
    if accuracy is not None:
        own = accuracy.get("I", np.zeros(accuracy["TimeUS"].size)) == 0
        at = accuracy["TimeUS"][own] * 1e-6
        for name, key in (("hacc_m", "HAcc"), ("vacc_m", "VAcc"), ("sacc_m_s", "SAcc")):
            columns[name] = np.interp(columns["time_s"], at, accuracy[key][own])
    return only_fixes(path, columns, "messages GPS of a DataFlash log")


def _is_text_log(start: Start) -> bool:
    return sum(x.startswith("FMT, ") for x in start.lines[:40]) > 3


FORMATS = (
    Format(
        "dataflash",
        "an ArduPilot DataFlash log",
        (".bin",),
        ("imu", "gnss"),
        magic=(b"\xa3\x95\x80",),
        open=open_binary,
    ),
    Format(
        "dataflash-text",
        "an ArduPilot log as text",
        (".log",),
        ("imu", "gnss"),
        detect=_is_text_log,
        open=open_text_log,
    ),
)
