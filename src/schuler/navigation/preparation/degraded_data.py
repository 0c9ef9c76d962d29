"""What becomes of motion that was not seen: bridged where it is short, a new start where not.

A filter is linear in small attitude errors. Up to `BRIDGED_TURN` the missing motion is bridged and
its variance handed to the filter as noise; beyond it the filter stops at the last sample before
and is aligned anew behind it, like at the beginning of a recording.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from schuler.data import ImuRecording
from schuler.errors import NavigationError
from schuler.navigation.preparation.alignment import Alignment
from schuler.navigation.preparation.condition import DriveCondition, Restart
from schuler.navigation.preparation.gaps import DataGap, bridged
from schuler.screening.screen import Finding

BRIDGED_TURN = np.radians(10.0)
"""Standard deviation of a turn up to which it is bridged, rad."""
SHORTEST_SEGMENT = 5.0
"""Seconds; what is shorter between two breaks is left out."""


def split_at_gaps(
    imu: ImuRecording, gaps: Sequence[DataGap]
) -> tuple[list[ImuRecording], tuple[DataGap, ...]]:
    """Bridge what is short and cut where it is not."""
    last = float(imu.time[-1])
    short = tuple(u for u in gaps if u.attitude_sd <= BRIDGED_TURN and u.stop < last)
    # an axis that is stuck to the end cannot be bridged: nothing is known behind it
    long = [u for u in gaps if not any(u is s for s in short)]
    segments = []
    begin = float(imu.time[0])
    for part in long:
        segments.append(imu.between(begin, part.start + 1e-9))
        begin = part.stop
    if not long or long[-1].stop < last:
        segments.append(imu.between(begin, np.inf))
    kept = []
    for segment in segments:
        if segment.time.size > 1 and segment.duration >= SHORTEST_SEGMENT:
            inside = [u for u in short if segment.time[0] <= u.start and u.stop <= segment.time[-1]]
            kept.append(bridged(segment, inside))
    if not kept:
        raise NavigationError(
            "no stretch of the IMU is whole for five seconds",
            expected="a recording without so many gaps or stuck axes",
            where=imu.name,
        )
    if not long:
        kept[0] = replace(kept[0], history=(*imu.history, *kept[0].history[len(imu.history) + 1 :]))
    return kept, short


def align_segments(
    segments: Sequence[ImuRecording],
    align_one: Callable[[ImuRecording, bool], Alignment],
    condition: DriveCondition,
) -> tuple[ImuRecording, Alignment, DriveCondition]:
    """Align every segment; those that cannot be aligned are left out and said."""
    used: list[ImuRecording] = []
    restarts: list[Restart] = []
    findings = list(condition.findings)
    start: Alignment | None = None
    failure: NavigationError | None = None
    for k, segment in enumerate(segments):
        begin, end = float(segment.time[0]), float(segment.time[-1])
        try:
            found = align_one(segment, k == 0)
        except NavigationError as error:
            failure = failure or error
            if len(segments) > 1:
                findings.append(_left_out(begin, end, error))
            continue
        if start is None:
            start = found
        else:
            restarts.append(Restart(float(used[-1].time[-1]), begin, found))
            findings.append(_started_anew(begin, found))
        used.append(segment)
    if start is None:
        assert failure is not None
        raise failure
    done = replace(condition, findings=tuple(findings), restarts=tuple(restarts))
    return _joined(used), start, done


def _left_out(begin: float, end: float, error: NavigationError) -> Finding:
    return Finding(
        "left out",
        "warning",
        f"{begin:.3f} to {end:.3f} s cannot be navigated: {error.found}",
        (),
        ((begin, end),),
        end - begin,
        cure=error.cure,
    )


def _started_anew(begin: float, found: Alignment) -> Finding:
    return Finding(
        "new start",
        "info",
        f"the filter starts anew at {begin:.3f} s, {found.method}; heading within "
        f"{np.degrees(found.heading_sd):.1f} deg; what it knows of the sensor goes on",
        (),
        ((begin, begin),),
    )


def _joined(segments: Sequence[ImuRecording]) -> ImuRecording:
    if len(segments) == 1:
        return segments[0]
    return replace(
        segments[0],
        time=np.concatenate([p.time for p in segments]),
        gyro=np.concatenate([p.gyro for p in segments]),
        accel=np.concatenate([p.accel for p in segments]),
        temperature=None,
    )
