"""NovAtel OEM7 logs, ASCII and binary: BESTPOS, BESTVEL, INSPVA(X), RAWIMU(S), CORRIMUDATA(S)."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from schuler.errors import InputError
from schuler.io.format import Format, Start, What
from schuler.io.source import Columns, MemorySource

if TYPE_CHECKING:
    from schuler.io.options import ReadOptions

_LINE = re.compile(
    r"[#%](?P<head>[A-Z0-9_]+A),(?P<rest>[^;]*);(?P<body>[^*]*)\*(?P<crc>[0-9a-f]{8})"
)
# Number of a binary log: name, and what stands where in its body.
_BINARY = {
    42: ("BESTPOS", "<ii3df4s3f"),
    99: ("BESTVEL", "<iiff3d"),
    507: ("INSPVA", "<Ldddddddddi"),
    508: ("INSPVAS", "<Ldddddddddi"),
    1465: ("INSPVAX", "<ii3df6d9f"),
    268: ("RAWIMU", "<LdL6l"),
    325: ("RAWIMUS", "<LdL6l"),
    812: ("CORRIMUDATA", "<Ld6d"),
    813: ("CORRIMUDATAS", "<Ld6d"),
}
_KINDS = {"NARROW_INT": 1, "WIDE_INT": 1, "L1_INT": 1, "INS_RTKFIXED": 1, "NARROW_FLOAT": 2,
          "WIDE_LANE": 2, "FLOATCONV": 2, "INS_RTKFLOAT": 2, "PSRDIFF": 4, "INS_PSRDIFF": 4,
          "SINGLE": 5, "INS_PSRSP": 5, "PPP": 6, "INS_PPP": 6, "PPP_CONVERGING": 6}  # fmt: skip
_NUMBERS = {50: 1, 49: 1, 48: 1, 56: 1, 34: 2, 33: 2, 32: 2, 55: 2, 17: 4, 54: 4, 16: 5, 53: 5,
            69: 6, 68: 6, 74: 6, 73: 6}  # fmt: skip
_Rows = dict[str, list[list[float]]]


def open_novatel(path: Path, what: What, options: ReadOptions) -> MemorySource:
    """Read IMU or GNSS of a log of OEM7, ASCII or binary."""
    data = path.read_bytes()
    rows, wrong = _read(data)
    note = (f"left out {wrong} logs with a wrong checksum",) if wrong else ()
    source = _imu(path, rows, options) if what == "imu" else _gnss(path, rows)
    return MemorySource(
        path, source.columns, source.units, None, (*source.history, *note), "log",
        (*source.assumptions, *note),
    )  # fmt: skip


def _read(data: bytes) -> tuple[_Rows, int]:
    rows: _Rows = {}
    wrong = 0
    for name, row in (*_ascii(data), *_binary(data)):
        if row is None:
            wrong += 1
        else:
            rows.setdefault(name, []).append(row)
    return rows, wrong


def checksum(data: bytes) -> int:
    """Return NovAtel's 32-bit CRC: that of zlib without its inversions."""
    return zlib.crc32(data, 0xFFFFFFFF) ^ 0xFFFFFFFF


def _ascii(data: bytes) -> Iterator[tuple[str, list[float] | None]]:
    for match in _LINE.finditer(data.decode("latin-1")):
        name = match["head"][:-1]
        if name not in {n for n, _ in _BINARY.values()}:
            continue
        text = match[0][1 : match[0].rindex("*")].encode("latin-1")
        try:
            if checksum(text) != int(match["crc"], 16):
                raise ValueError
            head, body = match["rest"].split(","), match["body"].split(",")
            yield name, _row_of_text(name, head, body)
        except (ValueError, IndexError):
            yield name, None


def _row_of_text(name: str, head: list[str], body: list[str]) -> list[float]:
    """Return week, seconds and values of a log, kinds of solutions as RTKLIB's numbers."""
    # A long header has nine fields, a short one week and seconds alone.
    when = head[4:6] if len(head) > 4 else head[0:2]
    week, seconds = float(when[0]), float(when[1])
    if name in ("BESTPOS", "BESTVEL", "INSPVAX"):
        kind = float(_KINDS.get(body[1], 0))
        numbers = body[2:6] + body[7:10] if name == "BESTPOS" else body[2:]
        values = [float(x) for x in numbers if re.fullmatch(r"[-+\d.eE]+", x)]
        return [week, seconds, kind, *values]
    if name.startswith("RAWIMU"):
        return [float(body[0]), float(body[1]), *(float(x) for x in body[3:9])]
    if name.startswith("INSPVA"):
        return [float(x) for x in body[:-1]]
    return [float(x) for x in body]


def _binary(data: bytes) -> Iterator[tuple[str, list[float] | None]]:
    at = data.find(b"\xaa\x44")
    while 0 <= at <= len(data) - 16:
        mark = data[at + 2]
        if mark == 0x12:
            header, number = data[at + 3], int.from_bytes(data[at + 4 : at + 6], "little")
            size = int.from_bytes(data[at + 8 : at + 10], "little")
            week, milliseconds = struct.unpack_from("<HL", data, at + 14)
        elif mark == 0x13:
            header, size = 12, data[at + 3]
            number, week, milliseconds = struct.unpack_from("<HHL", data, at + 4)
        else:
            at = data.find(b"\xaa\x44", at + 2)
            continue
        end = at + header + size
        if end + 4 > len(data):
            break
        if number in _BINARY:
            name, form = _BINARY[number]
            good = checksum(data[at:end]) == int.from_bytes(data[end : end + 4], "little")
            row = None
            if good and size >= struct.calcsize(form):
                values = struct.unpack_from(form, data, at + header)
                row = _row_of_binary(name, float(week), milliseconds * 1e-3, values)
            yield name, row
            at = data.find(b"\xaa\x44", end + 4 if good else at + 2)
        else:
            at = data.find(b"\xaa\x44", at + 2)


def _row_of_binary(name: str, week: float, seconds: float, v: tuple[float, ...]) -> list[float]:
    if name in ("BESTPOS", "BESTVEL", "INSPVAX"):
        kind = float(_NUMBERS.get(int(v[1]), 0))
        values = [float(x) for x in v[2:] if not isinstance(x, bytes)]
        if name == "BESTPOS":  # latitude, longitude, height, undulation, then deviations
            return [week, seconds, kind, *values[:7]]
        return [week, seconds, kind, *values]
    if name.startswith("RAWIMU"):
        return [float(v[0]), float(v[1]), *map(float, v[3:9])]
    return [float(x) for x in (v[:-1] if name.startswith("INSPVA") else v)]


def _table(rows: _Rows, *names: str) -> tuple[str, np.ndarray] | None:
    for name in names:
        if rows.get(name):
            width = min(len(r) for r in rows[name])
            return name, np.array([r[:width] for r in rows[name]])
    return None


def _gnss(path: Path, rows: _Rows) -> MemorySource:
    found = _table(rows, "BESTPOS", "INSPVAX", "INSPVA", "INSPVAS")
    if found is None:
        raise InputError("the log has no positions", expected="BESTPOS or INSPVA", where=str(path))
    name, table = found
    columns: Columns = {"week": table[:, 0], "tow_s": table[:, 1]}
    if name == "BESTPOS":
        columns |= _position(table, 3) | {"quality": table[:, 2]}
        velocity = _table(rows, "BESTVEL")
        if velocity is not None:
            columns |= _joined_velocity(columns, velocity[1])
        height = table[:, 5] + table[:, 6]
        sd = table[:, 7:10]
    elif name == "INSPVAX":
        columns |= _position(table, 3) | {"quality": table[:, 2]}
        height, sd = table[:, 5] + table[:, 6], table[:, 13:16]
        columns |= _velocity(table, 7)
        for k, axis in enumerate(("north", "east", "down")):
            columns[f"vel_std_{axis}_m_s"] = table[:, 16 + k]
    else:
        columns |= _position(table, 2) | _velocity(table, 5)
        height, sd = table[:, 4], None
    columns["height_ellipsoid_m"] = height
    if sd is not None:
        columns |= {f"pos_std_{a}_m": sd[:, k] for k, a in enumerate(("north", "east", "down"))}
    if "quality" in columns:
        columns = {n: c[columns["quality"] > 0] for n, c in columns.items()}
    if not columns["tow_s"].size:
        raise InputError(f"no {name} has a solution", expected="positions", where=str(path))
    return MemorySource(path, columns, {}, None, (f"logs {name}, GPS time",), "log")


def _position(table: np.ndarray, k: int) -> Columns:
    return {"latitude_deg": table[:, k], "longitude_deg": table[:, k + 1]}


def _velocity(table: np.ndarray, k: int) -> Columns:
    return {
        "vel_north_m_s": table[:, k],
        "vel_east_m_s": table[:, k + 1],
        "vel_up_m_s": table[:, k + 2],
    }


def _joined_velocity(columns: Columns, table: np.ndarray) -> Columns:
    """Return velocities of BESTVEL at the stamps of positions; NaN where there is none."""
    stamps = columns["week"] * 604800.0 + columns["tow_s"]
    own = table[:, 0] * 604800.0 + table[:, 1] - table[:, 3]  # latency
    place = np.clip(np.searchsorted(own, stamps - 1e-3), 0, own.size - 1)
    fits = np.abs(own[place] - stamps) < 0.26
    speed, course = table[place, 5], np.radians(table[place, 6])
    values = {
        "vel_north_m_s": speed * np.cos(course),
        "vel_east_m_s": speed * np.sin(course),
        "vel_up_m_s": table[place, 7],
    }
    return {n: np.where(fits, v, np.nan) for n, v in values.items()}


def _imu(path: Path, rows: _Rows, options: ReadOptions) -> MemorySource:
    found = _table(rows, "CORRIMUDATAS", "CORRIMUDATA", "RAWIMUS", "RAWIMU")
    if found is None:
        raise InputError(
            "the log has no messages of an IMU",
            expected="RAWIMU(S) or CORRIMUDATA(S)",
            where=str(path),
        )
    name, table = found
    columns: Columns = {"week": table[:, 0], "tow_s": table[:, 1]}
    if name.startswith("CORR"):  # pitch, roll, yaw; then lateral, longitudinal, vertical
        turned, pushed = table[:, 2:5], table[:, 5:8]
        units = {f"angle_step_{a}": "rad" for a in "xyz"}
        units |= {f"velocity_step_{a}": "m/s" for a in "xyz"}
    else:
        if options.gyro_unit is None or options.accel_unit is None:
            raise InputError(
                f"{name} holds counts, whose scale depends on the IMU",
                expected="the value of one count of angle and of velocity",
                cure="say gyro_unit='LSB 8589934592/rad' and accel_unit='LSB 134217728/(ft/s)', "
                "with the numbers of your IMU",
                where=str(path),
            )
        # z, minus y, x of the accelerometers, then of the gyros
        pushed = table[:, [4, 3, 2]] * (1.0, -1.0, 1.0)
        turned = table[:, [7, 6, 5]] * (1.0, -1.0, 1.0)
        units = {}
    for k, axis in enumerate("xyz"):
        columns[f"dtheta_{axis}"] = turned[:, k]
        columns[f"dvel_{axis}"] = pushed[:, k]
        if units:
            units[f"dtheta_{axis}"], units[f"dvel_{axis}"] = "rad", "m/s"
    return MemorySource(path, columns, units, None, (f"logs {name}, GPS time",), "log")


def _is_novatel(start: Start) -> bool:
    data = start.bytes
    if re.search(rb"[#%](?:BEST|INS|RAWIMU|CORRIMU)[A-Z0-9_]*A,[^;\n]*;", data):
        return True
    at = data.find(b"\xaa\x44\x12")
    at = data.find(b"\xaa\x44\x13") if at < 0 else at
    while 0 <= at <= len(data) - 16:
        short = data[at + 2] == 0x13
        size = data[at + 3] if short else int.from_bytes(data[at + 8 : at + 10], "little")
        end = at + (12 if short else data[at + 3]) + size
        if end + 4 <= len(data) and checksum(data[at:end]) == int.from_bytes(
            data[end : end + 4], "little"
        ):
            return True
        at = data.find(b"\xaa\x44", at + 2)
    return False


FORMATS = (
    Format(
        "novatel",
        "NovAtel OEM7",
        (".gps", ".nov"),
        ("imu", "gnss"),
        detect=_is_novatel,
        open=open_novatel,
    ),
)
