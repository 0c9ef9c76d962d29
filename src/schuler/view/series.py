"""Long series as a screen can show them: the smallest and the largest value of each stretch."""

from __future__ import annotations

from collections import OrderedDict
from pathlib import Path
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.data import GnssRecording, ImuRecording
from schuler.earth import ned_from_geodetic
from schuler.errors import InputError
from schuler.io import read_gnss, read_imu
from schuler.report.figures import broken_at_gaps, encode
from schuler.report.numbers import duration, number
from schuler.types import FloatArray

POINTS = 4000
"""Points of a line that are sent."""
BLOCK = 64
"""Samples whose extremes are kept ready."""
KEPT = 2
"""Recordings that are kept in memory."""


class Extremes:
    """One long series with the extremes of its blocks.

    Parameters
    ----------
    values : (n,) ndarray
        The series; NaN where nothing was measured.
    """

    def __init__(self, values: FloatArray) -> None:
        self.values = values
        starts = np.arange(0, values.size, BLOCK)
        self.low = np.fmin.reduceat(values, starts)
        self.high = np.fmax.reduceat(values, starts)

    def between(self, edges: NDArray[np.int64]) -> FloatArray:
        """Return the smallest and the largest value between edges, one after the other.

        Long stretches are taken from whole blocks, so that their edges are up to a block off.
        """
        low, high = self.values, self.values
        if np.diff(edges).min() >= 4 * BLOCK:
            low, high, edges = self.low, self.high, np.append(edges[:-1], edges[-1] + BLOCK - 1)
            edges = edges // BLOCK
        stop, starts = int(edges[-1]), edges[:-1] - edges[0]
        ends = (np.fmin.reduceat(low[edges[0] : stop], starts),
                np.fmax.reduceat(high[edges[0] : stop], starts))  # fmt: skip
        return np.stack(ends, axis=1).reshape(-1)


class Series:
    """A recording as lines over time.

    Parameters
    ----------
    recording : ImuRecording or GnssRecording
        What is shown.
    """

    def __init__(self, recording: ImuRecording | GnssRecording) -> None:
        self.recording = recording
        self.time = recording.time
        self.track: FloatArray | None = None
        columns: dict[str, FloatArray]
        if isinstance(recording, ImuRecording):
            self.groups = {"Angular rate in deg/s": ("gyro", np.degrees(1.0)),
                           "Specific force in m/s²": ("accel", 1.0)}  # fmt: skip
            columns = {
                f"{kind}_{axis}": getattr(recording, kind)[:, k]
                for kind in ("gyro", "accel")
                for k, axis in enumerate("xyz")
                if f"{kind}_{axis}" in recording.channels
            }
        else:
            self.groups = {"Height in m": ("height", 1.0), "Velocity in m/s": ("velocity", 1.0)}
            columns = {"height": recording.position[:, 2]}
            if recording.velocity is not None:
                names = ("velocity_north", "velocity_east", "velocity_down")
                columns |= dict(zip(names, recording.velocity.T, strict=True))
            self.track = ned_from_geodetic(recording.position, recording.position[0])[:, :2]
        self.lines = {name: Extremes(np.ascontiguousarray(c)) for name, c in columns.items()}

    def facts(self) -> dict[str, Any]:
        """Return what the recording is."""
        one = self.recording
        facts = {"rows": number(one.size), "duration": duration(one.duration)}
        if isinstance(one, ImuRecording):
            facts |= {"rate": f"{number(one.rate)} Hz", "channels": ", ".join(one.channels)}
        return {
            "kind": "imu" if isinstance(one, ImuRecording) else "gnss",
            "facts": facts,
            "start": float(self.time[0]),
            "stop": float(self.time[-1]),
            "assumptions": list(one.assumptions),
            "track": self._track(),
        }

    def window(self, start: float, stop: float) -> dict[str, Any]:
        """Return all lines between two times, each of at most `POINTS` points."""
        first = max(int(np.searchsorted(self.time, start)) - 1, 0)
        last = min(int(np.searchsorted(self.time, stop, side="right")) + 1, self.time.size)
        if last - first < 2:
            raise InputError("nothing was recorded there", expected="a longer stretch of time")
        if last - first <= POINTS:
            x, lines = self.time[first:last], {n: e.values[first:last] for n, e in self._lines()}
        else:
            edges = np.linspace(first, last, POINTS // 2 + 1).astype(np.int64)
            middle = (edges[:-1] + edges[1:]) // 2
            x = self.time[np.stack([edges[:-1], middle], axis=1).reshape(-1)]
            lines = {name: line.between(edges) for name, line in self._lines()}
        x, *values = broken_at_gaps(x, *lines.values())
        lines = dict(zip(lines, values, strict=True))
        groups = [
            {
                "title": title,
                "lines": [
                    {"name": name, "y": encode(line * scale)}
                    for name, line in lines.items()
                    if name.startswith(prefix)
                ],
            }
            for title, (prefix, scale) in self.groups.items()
        ]
        return {"x": encode(x, "f8"), "groups": [group for group in groups if group["lines"]]}

    def _lines(self) -> list[tuple[str, Extremes]]:
        return list(self.lines.items())

    def _track(self) -> dict[str, Any] | None:
        if self.track is None:
            return None
        track = self.track[:: -(-len(self.track) // POINTS)]
        return {"north": encode(track[:, 0]), "east": encode(track[:, 1])}


class Shelf:
    """Recordings that were read, the last few kept."""

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[Any, ...], Series] = OrderedDict()
        self._lock = Lock()

    def series(self, place: Path, how: dict[str, Any]) -> Series:
        """Return a recording, read when it is not at hand or has changed."""
        there = place.stat()
        key = (place, there.st_mtime_ns, there.st_size, tuple(sorted(how.items())))
        with self._lock:  # two requests for one file read it once
            if key not in self._kept:
                self._kept[key] = Series(_read(place, how))
            self._kept.move_to_end(key)
            while len(self._kept) > KEPT:
                self._kept.popitem(last=False)
            return self._kept[key]


def _read(place: Path, how: dict[str, Any]) -> ImuRecording | GnssRecording:
    """Read the IMU of a file, or its GNSS where it has none."""
    try:
        return read_imu(place, **how)
    except InputError as error:
        try:
            return read_gnss(place)
        except InputError:
            raise error from None
