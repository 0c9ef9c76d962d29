"""PX4's ULog, through `pyulog` (``pip install 'schuler[px4]'``)."""

from __future__ import annotations

from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from schuler.errors import InputError
from schuler.io.format import Format, What, damaged, lacking
from schuler.io.formats.fixes import QUALITY_OF_FIX_TYPE, only_fixes
from schuler.io.source import Columns, MemorySource

if TYPE_CHECKING:
    from schuler.io.options import ReadOptions

_IMU_TOPICS = ("sensor_combined", "vehicle_imu", "sensor_gyro", "sensor_accel")
_GNSS_TOPICS = ("vehicle_gps_position", "sensor_gps")


def open_ulog(path: Path, what: What, options: ReadOptions) -> MemorySource:
    """Read IMU or GNSS of a log of PX4; time is that since its boot."""
    try:
        from pyulog import ULog
    except ImportError:
        raise lacking("pyulog", "px4", path) from None
    topics = _IMU_TOPICS if what == "imu" else _GNSS_TOPICS
    try:
        with redirect_stdout(StringIO()):  # where pyulog tells of damage
            log = ULog(
                str(path), message_name_filter_list=list(topics), disable_str_exceptions=True
            )
    except Exception as error:  # pyulog raises many kinds for damaged logs
        raise damaged(path, "PX4 ULog", error) from None
    there = {d.name: d.data for d in log.data_list if d.multi_id == 0}
    topic = next((t for t in topics if t in there), None)
    if topic is None:
        raise InputError(
            f"the log has no topic of {'an IMU' if what == 'imu' else 'GNSS'}",
            expected=f"one of {', '.join(topics)}",
            where=str(path),
        )
    if what == "gnss":
        return only_fixes(path, _gnss(there[topic]), f"topic {topic}")
    columns, units, note = _imu(topic, there, path)
    lost = sum(d.duration for d in log.dropouts) / 1e3
    notes = (f"{len(log.dropouts)} drop-outs of the log, {lost:.2g} s",) if log.dropouts else ()
    return MemorySource(path, columns, units, None, (note,), assumptions=notes)


def _imu(topic: str, there: dict[str, Any], path: Path) -> tuple[Columns, dict[str, str], str]:
    units = {"timestamp": "us"} | {f"gyro_{a}": "rad/s" for a in "xyz"}
    units |= {f"accel_{a}": "m/s^2" for a in "xyz"}
    data = there[topic]
    columns: Columns = {"timestamp": data["timestamp"]}
    if topic == "sensor_combined":
        names = [(f"gyro_rad[{k}]", f"accelerometer_m_s2[{k}]") for k in range(3)]
    elif topic == "vehicle_imu":
        columns |= _rates_of_steps(data)
        return columns, units, f"topic {topic}, increments divided by their time"
    else:
        return *_two_topics(there, path, units), "topics sensor_gyro and sensor_accel"
    for axis, (gyro, accel) in zip("xyz", names, strict=True):
        columns[f"gyro_{axis}"], columns[f"accel_{axis}"] = data[gyro], data[accel]
    return columns, units, f"topic {topic}"


def _rates_of_steps(data: dict[str, Any]) -> Columns:
    columns: Columns = {}
    for k, axis in enumerate("xyz"):
        turn = np.where(data["delta_angle_dt"] > 0, data["delta_angle_dt"], np.nan) * 1e-6
        push = np.where(data["delta_velocity_dt"] > 0, data["delta_velocity_dt"], np.nan) * 1e-6
        columns[f"gyro_{axis}"] = data[f"delta_angle[{k}]"] / turn
        columns[f"accel_{axis}"] = data[f"delta_velocity[{k}]"] / push
    return columns


def _two_topics(
    there: dict[str, Any], path: Path, units: dict[str, str]
) -> tuple[Columns, dict[str, str]]:
    """Put gyro and accelerometer that stand in topics of their own below each other."""
    stamps, rows = [], []
    for first, topic in ((0, "sensor_gyro"), (3, "sensor_accel")):
        if topic not in there:
            continue
        data = there[topic]
        stamp = "timestamp_sample" if "timestamp_sample" in data else "timestamp"
        block = np.full((data[stamp].size, 6), np.nan)
        block[:, first : first + 3] = np.column_stack([data[a] for a in "xyz"])
        stamps.append(data[stamp])
        rows.append(block)
    time, table = np.concatenate(stamps), np.vstack(rows)
    order = np.argsort(time, kind="stable")
    columns: Columns = {"timestamp": time[order]}
    for k, name in enumerate([f"{s}_{a}" for s in ("gyro", "accel") for a in "xyz"]):
        if np.isfinite(table[:, k]).any():
            columns[name] = table[order, k]
    return columns, {n: u for n, u in units.items() if n in columns}


def _gnss(data: dict[str, Any]) -> Columns:
    old = "lat" in data  # until 2023 in whole numbers
    columns: Columns = {
        "time_s": data["timestamp"] * 1e-6,
        "latitude_deg": data["lat"] * 1e-7 if old else data["latitude_deg"],
        "longitude_deg": data["lon"] * 1e-7 if old else data["longitude_deg"],
    }
    ellipsoid = "alt_ellipsoid" if old else "altitude_ellipsoid_m"
    sea = "alt" if old else "altitude_msl_m"
    scale = 1e-3 if old else 1.0
    known = ellipsoid in data and bool(np.any(data[ellipsoid]))
    name = "height_ellipsoid_m" if known else "height_msl_m"
    columns[name] = data[ellipsoid if known else sea] * scale
    for axis, key in (("north", "n"), ("east", "e"), ("down", "d")):
        columns[f"vel_{axis}_m_s"] = data[f"vel_{key}_m_s"]
    columns |= {"hacc_m": data["eph"], "vacc_m": data["epv"], "sacc_m_s": data["s_variance_m_s"]}
    columns["quality"] = QUALITY_OF_FIX_TYPE[np.clip(data["fix_type"].astype(int), 0, 6)]
    return {n: np.asarray(c, dtype=np.float64) for n, c in columns.items()}


FORMATS = (
    Format(
        "ulog",
        "a PX4 ULog",
        (".ulg",),
        ("imu", "gnss"),
        magic=(b"ULog\x01\x12\x35",),
        open=open_ulog,
        extra="px4",
    ),
)
