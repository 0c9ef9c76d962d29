"""Faults of GNSS put in on purpose: fixes elsewhere, stamps that are late."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from schuler.data import GnssRecording
from schuler.earth import metres_per_radian
from schuler.errors import InputError


@dataclass(frozen=True, slots=True, kw_only=True)
class WrongFix:
    """Positions that are off by some metres."""

    start: float  # of the first epoch concerned, s
    # epochs with start <= time < start + duration; zero: the first one at or after start.
    duration: float = 0.0
    # north, east, down: by how much, m
    north: float = 0.0
    east: float = 0.0
    down: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LateStamps:
    """Epochs whose stamps are later than they should be.

    Epochs that would come out of order are left out, as a reader has to.
    """

    # start, duration: seconds, by the stamps as they should be
    start: float
    late: float  # seconds added to the stamps
    duration: float = float("inf")


FixFault = WrongFix | LateStamps


def inject_fix_faults(
    recording: GnssRecording, faults: Sequence[FixFault]
) -> tuple[GnssRecording, tuple[str, ...]]:
    """Return a recording of GNSS with faults, and what was done."""
    log = []
    for fault in faults:
        since = recording.time >= fault.start
        inside = since & (recording.time < fault.start + fault.duration)
        if isinstance(fault, WrongFix) and fault.duration == 0.0 and since.any():
            inside[int(np.argmax(since))] = True
        if not inside.any():
            raise InputError(
                f"a fault at {fault.start:g} s, where GNSS has no epoch",
                expected=f"within {recording.time[0]:.2f} .. {recording.time[-1]:.2f} s",
            )
        begin, end = recording.time[inside][[0, -1]]
        if isinstance(fault, WrongFix):
            position = recording.position.copy()
            north, east = metres_per_radian(position[inside])
            position[inside, 0] += fault.north / north
            position[inside, 1] += fault.east / east
            position[inside, 2] -= fault.down
            recording = replace(recording, position=position)
            away = np.linalg.norm([fault.north, fault.east, fault.down])
            text = f"position off by {away:g} m"
        else:
            time = recording.time + np.where(inside, fault.late, 0.0)
            ordered = time > np.concatenate([[-np.inf], np.maximum.accumulate(time)[:-1]])
            recording = replace(recording.select(ordered), time=time[ordered])
            text = f"stamps late by {fault.late:g} s"
        log.append(f"{text}, {begin:.2f} .. {end:.2f} s")
        recording = replace(recording, history=(*recording.history, f"fault: {log[-1]}"))
    return recording, tuple(log)
