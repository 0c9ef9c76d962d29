"""Google's GnssLogger on Android phones: lines of several kinds, described in comments."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from schuler.errors import InputError
from schuler.io.format import Format, Start, What
from schuler.io.source import Columns, MemorySource

if TYPE_CHECKING:
    from schuler.io.options import ReadOptions

_IMU = (("gyro", "rad/s", ("UncalGyro", "Gyro")), ("accel", "m/s^2", ("UncalAccel", "Accel")))


def open_gnss_logger(path: Path, what: What, options: ReadOptions) -> MemorySource:
    """Read IMU or fixes; time is that since the boot of the phone, which both share."""
    labels: dict[str, list[str]] = {}
    rows: dict[str, list[list[str]]] = {}
    wanted = {"Fix"} if what == "gnss" else {n for _, _, names in _IMU for n in names}
    with path.open(encoding="utf-8", errors="replace") as stream:
        for line in stream:
            kind, _, rest = line.lstrip("# ").partition(",")
            if kind not in wanted:
                continue
            fields = [f.strip() for f in rest.split(",")]
            if line.startswith("#"):
                labels[kind] = fields
            elif kind in labels:
                rows.setdefault(kind, []).append(fields)
    tables = {
        kind: {n: [r[k] if k < len(r) else "" for r in found]
               for k, n in enumerate(labels[kind])}
        for kind, found in rows.items()
    }  # fmt: skip
    return _fixes(path, tables) if what == "gnss" else _imu(path, tables)


def _numbers(texts: list[str]) -> np.ndarray:
    return np.array([float(x) if x else np.nan for x in texts])


def _imu(path: Path, tables: dict[str, dict[str, list[str]]]) -> MemorySource:
    stamps, blocks, said = [], [], []
    for place, (_, _, names) in enumerate(_IMU):
        kind = next((n for n in names if n in tables), None)
        if kind is None:
            continue
        table = tables[kind]
        axes = [n for n in table if n.startswith(kind)]
        block = np.full((len(table[axes[0]]), 6), np.nan)
        for k, name in enumerate(axes[:3]):
            block[:, 3 * place + k] = _numbers(table[name])
        stamps.append(_numbers(table["elapsedRealtimeNanos"]))
        blocks.append(block)
        said.append(kind)
    if not blocks:
        raise InputError(
            "the log has no lines of an IMU", expected="UncalGyro and UncalAccel", where=str(path)
        )
    time, values = np.concatenate(stamps), np.vstack(blocks)
    order = np.argsort(time, kind="stable")
    columns: Columns = {"elapsedRealtimeNanos": time[order]}
    units = {"elapsedRealtimeNanos": "ns"}
    for place, (sensor, unit, _) in enumerate(_IMU):
        for k, axis in enumerate("xyz"):
            column = values[order, 3 * place + k]
            if np.isfinite(column).any():
                columns[f"{sensor}_{axis}"], units[f"{sensor}_{axis}"] = column, unit
    return MemorySource(path, columns, units, None, (f"lines {' and '.join(said)}",))


def _fixes(path: Path, tables: dict[str, dict[str, list[str]]]) -> MemorySource:
    if "Fix" not in tables:
        raise InputError("the log has no fixes", expected="lines Fix", where=str(path))
    table = tables["Fix"]
    providers = np.array([p.upper() for p in table["Provider"]])
    chosen = next((p for p in ("GPS", "FLP") if np.sum(providers == p) > 1), providers[0])
    here = providers == chosen
    names = {
        "LatitudeDegrees": "latitude_deg", "LongitudeDegrees": "longitude_deg",
        "AltitudeMeters": "height_ellipsoid_m", "SpeedMps": "speed_m_s",
        "BearingDegrees": "course_deg", "AccuracyMeters": "hacc_m",
        "VerticalAccuracyMeters": "vacc_m", "SpeedAccuracyMps": "sacc_m_s",
    }  # fmt: skip
    columns: Columns = {
        new: _numbers(table[old])[here] for old, new in names.items() if old in table
    }
    stamp, scale = "elapsedRealtimeNanos", 1e-9
    if stamp not in table or not all(np.array(table[stamp])[here]):
        stamp = next(n for n in ("UnixTimeMillis", "(UTC)TimeInMs") if n in table)
        scale = 1e-3
    columns = {"time_s": _numbers(table[stamp])[here] * scale, **columns}
    if "speed_m_s" in columns and "course_deg" in columns:
        still = np.isfinite(columns["speed_m_s"]) & ~np.isfinite(columns["course_deg"])
        columns["course_deg"] = np.where(still, 0.0, columns["course_deg"])
    there = np.isfinite(columns["height_ellipsoid_m"]) & np.isfinite(columns["latitude_deg"])
    note = f"{int(here.sum())} fixes of provider {chosen} out of {here.size}, on '{stamp}'"
    kept = {n: c[there] for n, c in columns.items()}
    return MemorySource(path, kept, {}, None, (note,), "fix", (note,))


def _is_gnss_logger(start: Start) -> bool:
    return any(x.startswith(("# Raw,", "# Fix,", "# UncalAccel,")) for x in start.lines[:60])


FORMATS = (
    Format(
        "gnss-logger",
        "GnssLogger of Android",
        (".txt",),
        ("imu", "gnss"),
        detect=_is_gnss_logger,
        open=open_gnss_logger,
    ),
)
