"""Text of well-known makers of IMUs, whose units and names their files leave to the manual."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from schuler.errors import InputError
from schuler.io.columns import bare, split_unit
from schuler.io.format import Format, Start, What
from schuler.io.source import Columns, MemorySource, RenamedSource, Source
from schuler.io.tables.text import open_table

if TYPE_CHECKING:
    from schuler.io.options import ReadOptions


@dataclass(frozen=True, slots=True)
class Dialect:
    """The text files of one maker."""

    # name, title: as of the format
    name: str
    title: str
    header: str  # pattern that is found in the first lines of such files and of no others
    # pattern of a bare name by our name; others keep theirs.
    columns: Mapping[str, str] = field(default_factory=dict)
    # unit by our name, where the file names none
    units: Mapping[str, str] = field(default_factory=dict)


def _three(stem: str, pattern: str) -> dict[str, str]:
    return {f"{stem}_{a}": pattern.replace("AXIS", a) for a in "xyz"}


def _unit(stem: str, unit: str) -> dict[str, str]:
    return {f"{stem}_{a}": unit for a in "xyz"}


_SI = _unit("gyro", "rad/s") | _unit("accel", "m/s^2")
DIALECTS = (
    Dialect("xsens-dot", "Xsens DOT", r"PacketCounter.*SampleTimeFine(?!.*Status).*Acc_X",
            units=_unit("accel", "m/s^2") | {"time": "us"},
            columns={"time": "sampletimefine"}),
    Dialect("xsens-mt", "Xsens MT Manager", r"(?m)^// (?:Start Time|Update Rate|Sample rate)",
            units=_SI),
    Dialect("vectornav", "VectorNav", r"(?:UncompGyro|ImuGyro|TimeStartup|UncompAccel)",
            columns=_three("gyro", r"(?:imu)?(?:uncompgyro|gyro|angularrate)AXIS")
            | _three("accel", r"(?:imu)?(?:uncompaccel|accel)AXIS")
            | {"time": r"(?:time)?timestartup(?:ns)?|timegps"},
            units=_SI | {"time": "ns"}),
    Dialect("microstrain", "MicroStrain", r"\[x80[0-9A-F]{2}\]",
            columns={f"gyro_{a}": rf"{a}gyro(?:x80..)?" for a in "xyz"}
            | {f"accel_{a}": rf"{a}accel(?:x80..)?" for a in "xyz"}
            | {"week": r"gpsweek(?:x8012)?", "tow": r"gpstow(?:x8012)?"},
            units=_unit("gyro", "rad/s") | _unit("accel", "g") | {"tow": "s"}),
    Dialect("witmotion", "WitMotion", r"(?i)(?:asx|ax)\(g\).*(?:asx|wx|gx)\((?:deg|°)/s\)"),
    Dialect("shimmer", "Shimmer Consensys", r"Shimmer_[0-9A-F]{4}_",
            columns=_three("gyro", r"shimmer[0-9a-f]{4}gyro(?:scope)?AXIS(?:cal)?")
            | _three("accel", r"shimmer[0-9a-f]{4}accelln(?:AXIS)(?:cal)?")
            | {"time": r"shimmer[0-9a-f]{4}timestamp(?:unix|sync)?(?:unix)?cal"}),
    Dialect("sensorlog", "SensorLog of iOS", r"loggingTime\(txt\)|accelerometerAccelerationX",
            columns=_three("gyro", r"gyrorotationAXIS(?:rads)?")
            | _three("accel", r"accelerometeraccelerationAXIS(?:g)?")
            | {"time": r"loggingsample|accelerometertimestampsincereboots?|"
                       r"accelerometertimestampsincereboot"},
            units=_unit("gyro", "rad/s") | _unit("accel", "g") | {"time": "s"}),
    Dialect("phyphox", "phyphox", r"(?:Gyroscope|Acceleration|Accelerometer) x \("),
    Dialect("euroc-text", "EuRoC", r"(?<!b_)w_RS_S_x"),
)  # fmt: skip


def open_dialect(dialect: Dialect, path: Path, what: What, options: ReadOptions) -> Source:
    """Open a table under the names and with the units that its maker means."""
    source = open_table(path, what, options)
    names: dict[str, str] = {}
    units = dict(source.units)
    given = set()
    for name in source.names:
        stem, its = split_unit(name)
        own = next((o for o, p in dialect.columns.items()
                    if o not in names and (re.fullmatch(p, bare(stem))
                                           or re.fullmatch(p, bare(name)))), "")  # fmt: skip
        ours = own or _plain_role(bare(stem))
        if own:
            names[own] = name
        if not its and name not in units and ours in dialect.units:
            units[own or name] = dialect.units[ours]
            if not ours.startswith(("time", "tow")):
                sensor = ours.partition("_")[0]
                given.add((sensor, dialect.units[ours]))
        elif own:
            units[own] = units.get(name, its)
    notes = tuple(
        f"{s} taken as {u}, as {dialect.title} writes it ({s}_unit= says otherwise)"
        for s, u in sorted(given)
    )
    return RenamedSource(source, names, units, (dialect.title,), notes)


def _plain_role(text: str) -> str:
    match = re.fullmatch(r"(gyr|gyro|acc|accel)(?:eration|oscope)?([xyz])", text)
    if match is None:
        return "time" if text in ("time", "sampletimefine") else ""
    return f"{'gyro' if match[1].startswith('gyr') else 'accel'}_{match[2]}"


def _has(pattern: re.Pattern[str], start: Start) -> bool:
    return bool(pattern.search("\n".join(start.lines[:40])))


_VECTORNAV = re.compile(r"\$VN(?:IMU|YMR|CMV|MAR),[-+\d.,]+\*[0-9A-F]{2}")
_FIRST = {"IMU": (3, 6), "YMR": (6, 9), "CMV": (3, 6), "MAR": (3, 6)}


def open_vectornav(path: Path, what: What, options: ReadOptions) -> MemorySource:
    """Read the lines of a VectorNav on a serial port; they hold no time."""
    rows, wrong = [], 0
    kind = ""
    for line in path.read_text(encoding="latin-1").splitlines():
        match = _VECTORNAV.search(line)
        if match is None:
            continue
        body, _, told = match[0][1:].partition("*")
        if int(np.bitwise_xor.reduce(np.frombuffer(body.encode(), np.uint8))) != int(told, 16):
            wrong += 1
            continue
        kind = kind or body[2:5]
        if body[2:5] == kind:
            rows.append([float(x) for x in body.split(",")[1:]])
    if not rows:
        raise InputError("no line with a right checksum", expected="$VNIMU", where=str(path))
    table = np.array(rows)
    accel, gyro = _FIRST[kind]
    columns: Columns = {f"accel_{a}": table[:, accel + k] for k, a in enumerate("xyz")}
    columns |= {f"gyro_{a}": table[:, gyro + k] for k, a in enumerate("xyz")}
    note = (f"left out {wrong} lines with a wrong checksum",) if wrong else ()
    return MemorySource(path, columns, dict(_SI), None, (f"lines VN{kind}", *note), "line", note)


FORMATS = (
    Format("vectornav-lines", "lines of a VectorNav", (".txt",), ("imu",),
           detect=lambda start: _has(_VECTORNAV, start), open=open_vectornav),
    *(
        Format(d.name, f"text of {d.title}", (".csv", ".txt"), ("imu", "sensor"),
               detect=partial(_has, re.compile(d.header)), open=partial(open_dialect, d))
        for d in DIALECTS
    ),
)  # fmt: skip
