"""Folders of phone loggers, one file a sensor: Sensor Logger, phyphox, EuRoC and TUM-VI."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from schuler.errors import InputError
from schuler.io.columns import Column, bare, find_columns, split_unit
from schuler.io.format import Format, Start, What
from schuler.io.source import Columns, MemorySource, Source, TextOptions
from schuler.io.tables.text import open_text

if TYPE_CHECKING:
    from schuler.io.options import ReadOptions

# Sensor: names of files, the first that is there is taken; a second one is added to it.
_FILES = {
    "gyro": (("Gyroscope.csv",), ("GyroscopeUncalibrated.csv",), ("Raw Data Gyroscope.csv",)),
    "accel": (
        ("TotalAcceleration.csv",),
        ("Accelerometer.csv", "Gravity.csv"),
        ("AccelerometerUncalibrated.csv",),
        ("Accelerometer.csv",),
    ),
}
_POSITION = ("Location.csv", "LocationGps.csv", "GPS.csv")
_UNITS = {"gyro": "rad/s", "accel": "m/s^2"}


def open_folder(path: Path, what: What, options: ReadOptions) -> Source:
    """Read IMU or positions of a folder with one file a sensor."""
    if what == "gnss":
        found = next((path / n for n in _POSITION if (path / n).exists()), None)
        if found is None:
            raise InputError(
                "the folder has no positions",
                expected=f"one of {', '.join(_POSITION)}",
                where=str(path),
            )
        return open_text(found, TextOptions())
    blocks, said, assumed = [], [], []
    for place, (sensor, choices) in enumerate(_FILES.items()):
        files = next((c for c in choices if all((path / n).exists() for n in c)), None)
        if files is None:
            continue
        time, values, note = _sensor(path, files, sensor)
        table = np.full((time.size, 6), np.nan)
        table[:, 3 * place : 3 * place + 3] = values
        blocks.append((time, table))
        said.append(" + ".join(files))
        assumed.append(note)
    stamps = np.concatenate([t for t, _ in blocks])
    table = np.vstack([v for _, v in blocks])
    order = np.argsort(stamps, kind="stable")
    columns: Columns = {"time_s": stamps[order]}
    units = {}
    for k, name in enumerate([f"{s}_{a}" for s in _FILES for a in "xyz"]):
        if np.isfinite(table[:, k]).any():
            columns[name] = table[order, k]
            units[name] = _UNITS[name.partition("_")[0]]
    notes = tuple(n for n in assumed if n)
    return MemorySource(path, columns, units, None, (f"files {', '.join(said)}",), "row", notes)


def _sensor(path: Path, files: tuple[str, ...], sensor: str) -> tuple[np.ndarray, np.ndarray, str]:
    """Return stamps and values of a sensor, summed over files that belong together."""
    sources = [open_text(path / n, TextOptions()) for n in files]
    tables = [_three(s) for s in sources]
    time, values, unit = tables[0]
    for stamps, more, _ in tables[1:]:
        values = values + np.column_stack([np.interp(time, stamps, more[:, k]) for k in range(3)])
    factor = 1.0
    note = "" if unit else f"{sensor} taken as {_UNITS[sensor]}, as such folders hold it"
    if unit == "g" and sensor == "accel":
        factor = 9.80665
    elif unit.startswith("deg") or unit == "°/s":
        factor = float(np.pi / 180.0)
    return time, values * factor, note


def _three(source: Source) -> tuple[np.ndarray, np.ndarray, str]:
    """Return stamps in seconds and the three axes of a file of one sensor."""
    found = find_columns(source.names, {}, source.units)
    stamp = found.get("time") or Column("time", source.names[0], "")
    axes: dict[str, str] = {}
    unit = ""
    for name in source.names:
        stem, its = split_unit(name)
        last = bare(stem)[-1:]
        if name != stamp.name and last in "xyz" and bare(stem) and last not in axes:
            axes[last], unit = name, source.units.get(name, its)
    if len(axes) != 3:
        raise InputError("no columns x, y, z", expected="three axes", where=str(source.path))
    table = source.load((stamp.name, *axes.values()))
    time = table[stamp.name].astype(np.float64)
    scale = {"ms": 1e-3, "us": 1e-6, "ns": 1e-9}.get(stamp.unit, 1.0)
    if not stamp.unit:
        size = float(np.median(np.abs(time)))
        scale = 1e-9 if size > 1e16 else 1e-6 if size > 1e13 else 1e-3 if size > 1e11 else 1.0
    values = np.column_stack([table[axes[a]] for a in "xyz"])
    return time / (1.0 / scale), values, unit


def _is_folder(start: Start) -> bool:
    names = start.names
    return all(any(set(c) <= names for c in choices) for choices in _FILES.values())


def open_dataset(path: Path, what: What, options: ReadOptions) -> Source:
    """Read the IMU of a sequence of EuRoC or TUM-VI."""
    return open_text(_data_file(path), TextOptions())


def _data_file(path: Path) -> Path:
    for part in ("mav0/imu0/data.csv", "imu0/data.csv", "dso/imu.txt"):
        if (path / part).exists():
            return path / part
    return path / "data.csv"


def _is_dataset(start: Start) -> bool:
    names = start.names
    if not names:
        return False
    if {"data.csv", "sensor.yaml"} <= names:
        return True
    return bool({"mav0", "imu0", "dso"} & names) and _data_file(start.path).exists()


FORMATS = (
    Format("phone-folder", "a folder of Sensor Logger or phyphox", (), ("imu", "gnss"),
           detect=_is_folder, open=open_folder),
    Format("euroc-folder", "a sequence of EuRoC or TUM-VI (a folder)", (), ("imu",),
           detect=_is_dataset, open=open_dataset),
)  # fmt: skip
