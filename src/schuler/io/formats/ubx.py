"""u-blox UBX: NAV-PVT and NAV-PVAT, ESF-RAW and ESF-MEAS, out of a mixed stream."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from schuler.errors import InputError
from schuler.io.format import Format, Start, What
from schuler.io.formats.fixes import only_fixes
from schuler.io.source import Columns, MemorySource
from schuler.types import FloatArray, IntArray

if TYPE_CHECKING:
    from schuler.io.options import ReadOptions

_PVT, _PVAT, _MEAS, _RAW = 0x0107, 0x0117, 0x1002, 0x1003
_TAIL = ["lon", "lat", "height", "hMSL", "hAcc", "vAcc", "velN", "velE", "velD", "gSpeed"]
_SOLUTIONS = {
    _PVT: (92, {"iTOW": (0, "<u4"), "fixType": (20, "u1"), "flags": (21, "u1"),
                **{n: (24 + 4 * k, "<u4" if "Acc" in n else "<i4") for k, n in enumerate(_TAIL)},
                "sAcc": (68, "<u4")}),
    _PVAT: (116, {"iTOW": (0, "<u4"), "fixType": (24, "u1"), "flags": (25, "u1"),
                  **{n: (28 + 4 * k, "<u4" if "Acc" in n else "<i4") for k, n in enumerate(_TAIL)},
                  "sAcc": (68, "<u4")}),
}  # fmt: skip
# Data type of a measurement: channel, and the value of one bit.
_CHANNELS = {
    14: ("gyro_x", 2.0**-12), 13: ("gyro_y", 2.0**-12), 5: ("gyro_z", 2.0**-12),
    16: ("accel_x", 2.0**-10), 17: ("accel_y", 2.0**-10), 18: ("accel_z", 2.0**-10),
}  # fmt: skip
_TICK = 2.56e-5  # s, of the time tags of ESF-RAW


def messages(data: bytes, wanted: frozenset[int]) -> dict[int, list[bytes]]:
    """Return the payloads of messages by class and number; those with a wrong checksum are not."""
    found: dict[int, list[bytes]] = {}
    at = data.find(b"\xb5b")
    while 0 <= at <= len(data) - 8:
        kind = data[at + 2] << 8 | data[at + 3]
        size = data[at + 4] | data[at + 5] << 8
        end = at + 6 + size
        if end + 2 <= len(data) and (kind not in wanted or _sum(data[at + 2 : end]) == data[
            end : end + 2
        ]):  # fmt: skip
            if kind in wanted:
                found.setdefault(kind, []).append(data[at + 6 : end])
                at = data.find(b"\xb5b", end + 2)
                continue
            known = data[end + 2 : end + 4] in (b"\xb5b", b"") or data[end + 2 : end + 3] in (
                b"$", b"\xd3"
            )  # fmt: skip
            at = data.find(b"\xb5b", end + 2 if known else at + 2)
        else:
            at = data.find(b"\xb5b", at + 2)
    return found


def _sum(part: bytes) -> bytes:
    values = np.frombuffer(part, dtype=np.uint8).astype(np.uint64)
    first = int(values.sum()) & 0xFF
    second = int((values * np.arange(values.size, 0, -1, dtype=np.uint64)).sum()) & 0xFF
    return bytes((first, second))


def open_ubx(path: Path, what: What, options: ReadOptions) -> MemorySource:
    """Read IMU or GNSS of a stream of UBX messages, perhaps mixed with NMEA and RTCM."""
    found = messages(path.read_bytes(), frozenset((_PVT, _PVAT, _MEAS, _RAW)))
    if what == "gnss":
        return _solutions(path, found)
    if found.get(_RAW):
        return _raw(path, found[_RAW])
    if found.get(_MEAS):
        return _measured(path, found[_MEAS])
    raise InputError(
        "the stream has no messages of an IMU",
        expected="ESF-RAW or ESF-MEAS",
        cure="switch them on in the receiver",
        where=str(path),
    )


def _solutions(path: Path, found: dict[int, list[bytes]]) -> MemorySource:
    kind = max((_PVT, _PVAT), key=lambda k: len(found.get(k, ())))
    size, fields = _SOLUTIONS[kind]
    payloads = [p for p in found.get(kind, ()) if len(p) >= size]
    if not payloads:
        raise InputError(
            "the stream has no solutions", expected="NAV-PVT or NAV-PVAT", where=str(path)
        )
    dtype = np.dtype(
        {"names": list(fields), "formats": [f for _, f in fields.values()],
         "offsets": [o for o, _ in fields.values()], "itemsize": size}
    )  # fmt: skip
    table = np.frombuffer(b"".join(p[:size] for p in payloads), dtype=dtype)
    flags, fix = table["flags"].astype(int), table["fixType"].astype(int)
    carrier = flags >> 6
    quality = np.where(carrier == 2, 1, np.where(carrier == 1, 2, np.where(flags & 2, 4, 5)))
    usable = ((flags & 1) > 0) & ((fix == 3) | (fix == 4) | (fix == 2))
    columns: Columns = {
        "tow_s": table["iTOW"] * 1e-3,
        "latitude_deg": table["lat"] * 1e-7,
        "longitude_deg": table["lon"] * 1e-7,
        "height_ellipsoid_m": table["height"] * 1e-3,
        "vel_north_m_s": table["velN"] * 1e-3,
        "vel_east_m_s": table["velE"] * 1e-3,
        "vel_down_m_s": table["velD"] * 1e-3,
        "hacc_m": table["hAcc"] * 1e-3,
        "vacc_m": table["vAcc"] * 1e-3,
        "sacc_m_s": table["sAcc"] * 1e-3,
        "quality": np.where(usable, quality, 0).astype(np.float64),
    }
    name = "NAV-PVT" if kind == _PVT else "NAV-PVAT"
    return only_fixes(path, columns, f"{name}, time as seconds of the GPS week")


def _signed(words: IntArray) -> FloatArray:
    """Return the lower 24 bits as a signed number."""
    low = words & 0xFFFFFF
    signed: FloatArray = np.where(low >= 1 << 23, low - (1 << 24), low).astype(np.float64)
    return signed


def _spread(kinds: IntArray, stamps: FloatArray, values: FloatArray) -> Columns:
    """Return one row for every stamp, with a column for every channel."""
    known = np.isin(kinds, list(_CHANNELS))
    times, place = np.unique(stamps[known], return_inverse=True)
    columns: Columns = {"time": times}
    for kind, (name, scale) in _CHANNELS.items():
        here = kinds[known] == kind
        if here.any():
            column = np.full(times.size, np.nan)
            column[place[here]] = values[known][here] * scale
            columns[name] = column
    return columns


_UNITS = {"time": "s"} | {f"gyro_{a}": "deg/s" for a in "xyz"} | {
    f"accel_{a}": "m/s^2" for a in "xyz"
}  # fmt: skip


def _raw(path: Path, payloads: list[bytes]) -> MemorySource:
    """Read ESF-RAW: pairs of a measurement and its time tag."""
    words = np.frombuffer(b"".join(p[4 : 4 + (len(p) - 4) // 8 * 8] for p in payloads), "<u4")
    data, tags = words[0::2].astype(np.int64), words[1::2].astype(np.int64)
    turns = np.concatenate([[0], np.cumsum(np.diff(tags) < -(1 << 31))])
    stamps = (tags + turns * (1 << 32)).astype(np.float64) * _TICK
    columns = _spread((data >> 24) & 0x3F, stamps, _signed(data))
    said = f"time tags of ESF-RAW taken as ticks of {_TICK * 1e6:g} us"
    return MemorySource(path, columns, _UNITS, None, ("ESF-RAW", said), "message", (said,))


def _measured(path: Path, payloads: list[bytes]) -> MemorySource:
    """Read ESF-MEAS: measurements that share the time tag of their message."""
    kinds, stamps, values = [], [], []
    for payload in payloads:
        tag = int.from_bytes(payload[0:4], "little")
        count = (len(payload) - 8) // 4
        told = int.from_bytes(payload[4:6], "little") >> 11
        words = np.frombuffer(payload[8 : 8 + 4 * count], "<u4").astype(np.int64)
        words = words[: told or count]
        kinds.append((words >> 24) & 0x3F)
        values.append(_signed(words))
        stamps.append(np.full(words.size, tag * 1e-3))
    columns = _spread(np.concatenate(kinds), np.concatenate(stamps), np.concatenate(values))
    if len(columns) == 1:
        raise InputError(
            "ESF-MEAS holds no gyros or accelerometers",
            expected="measurements of an IMU",
            where=str(path),
        )
    return MemorySource(path, columns, _UNITS, None, ("ESF-MEAS",), "message")


def _is_ubx(start: Start) -> bool:
    data = start.bytes
    at = data.find(b"\xb5b")
    while 0 <= at <= len(data) - 8:
        size = data[at + 4] | data[at + 5] << 8
        end = at + 6 + size
        if end + 2 <= len(data) and _sum(data[at + 2 : end]) == data[end : end + 2]:
            return True
        at = data.find(b"\xb5b", at + 2)
    return False


FORMATS = (Format("ubx", "u-blox UBX", (".ubx",), ("imu", "gnss"), detect=_is_ubx, open=open_ubx),)
