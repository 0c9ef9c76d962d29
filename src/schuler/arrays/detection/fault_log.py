"""What happened to the sensors, as lines that a person can read."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from schuler.arrays.redundant import TITLES, RedundantSensors, Sensor
from schuler.data.to_dict import ToDict
from schuler.types import FloatArray

Kind = Literal["axis", "unit", "inconsistent", "missing"]

Spans = tuple[tuple[float, float | None], ...]

OUT: dict[int, tuple[Kind, bool]] = {
    0: ("axis", False),
    1: ("unit", True),
    4: ("inconsistent", False),
    6: ("inconsistent", True),
}
"""Kinds of the kernel's log that begin something, and whether they concern whole units."""
BACK: dict[int, Kind] = {2: "axis", 3: "unit", 5: "inconsistent"}
SHORTEST_GAP = 0.25
"""Gaps shorter than this are counted, but have no line of their own, s."""


@dataclass(frozen=True, slots=True)
class FaultRecord(ToDict):
    """One fault.

    Parameters
    ----------
    sensor : {"gyro", "accel"}
        Of which sensors.
    kind : {"axis", "unit", "inconsistent", "missing"}
        An axis or a unit that was taken out, sensors that contradict one another without one that
        can be blamed, or values that are missing.
    name : str
        "imu 3 y", or "imu 3".
    start : float
        When it was noticed, s.
    stop : float or None
        When it was let back in, or agreed again; None: to the end.
    size : float or None
        Of the fault when it was noticed, rad/s or m/s²: for a unit that of its first axis.
    statistic, threshold : float
        Likelihood statistic and its threshold; NaN where values were missing.
    time_constant : float or None
        Of the smoothed residuals that showed it, s.
    other : str
        Who else could be to blame.
    taken_out : bool
        Whether the sensor was not used from then on, or only found to be off.
    """

    JSON = (
        "sensor kind name start_s=start stop_s=stop size statistic threshold "
        "time_constant_s=time_constant other text"
    )

    sensor: Sensor
    kind: Kind
    name: str
    start: float
    stop: float | None
    size: float | None
    statistic: float
    threshold: float
    time_constant: float | None
    other: str
    taken_out: bool = True

    @property
    def text(self) -> str:
        """One line for people."""
        from schuler.units import format_value

        end = "to the end" if self.stop is None else f"to {self.stop:.2f} s"
        what = TITLES[self.sensor] if self.kind in ("unit", "inconsistent") else self.sensor
        line = f"{self.start:.2f} s {end}: "
        if self.kind == "missing":
            return line + f"{what} {self.name} missing"
        shown = f"F = {self.statistic:.0f} over {self.threshold:.0f}"
        if self.time_constant is not None:
            shown += f" in {self.time_constant:g} s means"
        if self.kind == "inconsistent":
            rival = f", {self.name} or {self.other} could be to blame" if self.other else ""
            return line + f"{what} contradict one another{rival} ({shown}); nothing taken out"
        size = ""
        if self.size is not None:
            kind = "angular rate" if self.sensor == "gyro" else "acceleration"
            size = f", off by {format_value(self.size, kind, digits=3)} so far"
        who = f"{what} of {self.name}" if self.kind == "unit" else f"{what} {self.name}"
        if not self.taken_out:
            who += f" or {self.other}" if self.other else ""
            return line + f"{who}{size.removeprefix(',').removesuffix(' so far')} ({shown})"
        return line + f"{who} taken out{size} ({shown})"


def told_records(records: Sequence[FaultRecord]) -> list[tuple[Literal["warning", "info"], str]]:
    """Return faults, and after them what was missing: a line for sensors missing at one time."""
    lines: list[tuple[Literal["warning", "info"], str]] = [
        ("warning", r.text) for r in records if r.kind != "missing"
    ]
    gaps: dict[tuple[str, str], list[FaultRecord]] = {}
    for record in records:
        if record.kind == "missing":
            gaps.setdefault((record.sensor, record.name), []).append(record)
    together: dict[tuple[str, Spans], list[str]] = {}
    for (sensor, name), own in gaps.items():
        together.setdefault((sensor, tuple((r.start, r.stop) for r in own)), []).append(name)
    for (sensor, spans), names in together.items():
        who = ", ".join(names) if len(names) < 4 else f"{names[0]} and {len(names) - 1} more"
        start, stop = spans[0][0], spans[-1][1]
        end = "the end" if stop is None else f"{stop:.2f} s"
        line = f"{start:.2f} s to {end}: {sensor} {who} missing"
        if len(spans) > 1:
            line += f", {len(spans)} times"
            if stop is not None:
                line += f", {sum(b - a for a, b in spans if b is not None):.1f} s in all"
        lines.append(("info", line))
    return lines


def fault_records(
    events: FloatArray, sensors: RedundantSensors, time_constants: tuple[float, ...]
) -> tuple[FaultRecord, ...]:
    """Return what happened to one kind of sensor, in order of time."""
    open_since: dict[tuple[Kind, int], int] = {}
    records: list[FaultRecord] = []
    for row in events:
        sample, kind, index, scale = (int(v) for v in row[:4])
        time = float(sensors.time[sample])
        if kind in OUT:
            title, whole = OUT[kind]
            key = (title, -1 if title == "inconsistent" else index)
            open_since[key] = len(records)
            records.append(
                FaultRecord(
                    sensors.sensor,
                    title,
                    (sensors.unit_names if whole else sensors.names)[index],
                    time,
                    None,
                    None if title == "inconsistent" else float(row[6]),
                    float(row[4]),
                    float(row[5]),
                    time_constants[scale],
                    _other_name(sensors, int(row[7]), whole),
                )
            )
            continue
        title = BACK[kind]
        place = open_since.pop((title, -1 if title == "inconsistent" else index), None)
        if place is not None:
            records[place] = replace(records[place], stop=time)
    records += _gaps(sensors)
    return tuple(sorted(records, key=lambda r: r.start))


def _other_name(sensors: RedundantSensors, axis: int, whole: bool) -> str:
    if axis < 0:
        return ""
    return sensors.unit_names[int(sensors.unit[axis])] if whole else sensors.names[axis]


def _gaps(sensors: RedundantSensors) -> list[FaultRecord]:
    """Longer gaps, of whole units where all their axes are missing together."""
    records: list[FaultRecord] = []
    missing = np.isnan(sensors.measurements)
    if not missing.any():
        return records
    for u, unit_name in enumerate(sensors.unit_names):
        mine = np.flatnonzero(sensors.unit == u)
        together = missing[:, mine].all(axis=1)
        groups = [(unit_name, together)]
        groups += [(sensors.names[m], missing[:, m] & ~together) for m in mine]
        for name, rows in groups:
            edges = np.flatnonzero(np.diff(np.concatenate([[0], rows.astype(int), [0]])))
            for first, stop in edges.reshape(-1, 2):
                if (stop - first) * sensors.step < SHORTEST_GAP:
                    continue
                last = None if stop == sensors.time.size else float(sensors.time[stop])
                records.append(
                    FaultRecord(
                        sensors.sensor,
                        "missing",
                        name,
                        float(sensors.time[first]),
                        last,
                        None,
                        float("nan"),
                        float("nan"),
                        None,
                        "",
                    )
                )
    return records
