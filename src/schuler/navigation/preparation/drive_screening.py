"""Look at a drive before it is navigated: what is missing, stuck, reversed or out of step.

What single recordings tell comes from screening/screen; here IMU and GNSS are held against
each other. What makes every result wrong stops the run with a clear message; the rest is said,
and the filter copes with it (navigation/preparation/gaps.py).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from schuler.data import CHANNELS, GnssRecording, ImuRecording
from schuler.data.vertical_velocity import trouble_of_vertical_velocity
from schuler.errors import NavigationError
from schuler.navigation.preparation.fixes import (
    CONVINCING,
    LEAST_JUMP,
    FixScreening,
    TurnComparison,
    compare_turns,
    screen_fixes,
)
from schuler.navigation.preparation.gaps import (
    DataGap,
    DriveCondition,
    find_gaps,
    interpolation_variance,
)
from schuler.screening.screen import Finding
from schuler.screening.stuck import findings_on_bursts, stuck_intervals
from schuler.types import FloatArray

LONG_OUTAGE = 10.0
"""Seconds without GNSS that are worth a line."""
LATE_GNSS = 2.0
"""Seconds of IMU before the first fix that are worth a line."""
MOST_NAMED = 5
MOST_JUMPS = 5
"""Longest gaps that are tried for jumps of the stamps."""
WRONG_WAY_UP = np.radians(60.0)
"""Angle between the down of the mounting and that of gravity that no road explains."""


def screen_drive(
    imu: ImuRecording,
    gnss: GnssRecording,
    *,
    mounting: FloatArray | None = None,
    time_offset: float | None = None,
) -> tuple[ImuRecording, DriveCondition]:
    """Screen a drive and put right what can be."""
    findings: list[Finding] = []
    turns = compare_turns(imu, gnss)
    _require_right_way_round(imu, turns, mounting)
    imu, turns, jumped = _without_jump(imu, gnss, turns)
    findings += jumped
    findings += _clock(turns, time_offset)
    no_down = _not_measured_down(gnss)
    findings += no_down
    fixes = screen_fixes(gnss)
    findings += _findings_on_fixes(gnss, fixes)
    findings += _coverage(imu, gnss)
    gaps = find_data_gaps(imu)
    findings += [_finding_on_gap(part) for part in gaps]
    findings += findings_on_bursts(imu)
    return imu, DriveCondition(
        findings=tuple(findings),
        gaps=gaps,
        wrong_fixes=gnss.time[fixes.wrong].copy() if fixes.wrong.any() else None,
        no_down=bool(no_down),
    )


def _not_measured_down(gnss: GnssRecording) -> list[Finding]:
    """Say that the vertical velocity was not measured; stop when it points up."""
    if gnss.velocity is None or gnss.velocity_sd is None or np.isinf(gnss.velocity_sd[:, 2]).all():
        return []
    trouble = trouble_of_vertical_velocity(gnss.time, gnss.position[:, 2], gnss.velocity)
    if trouble == "points up":
        raise NavigationError(
            "the vertical velocity of GNSS has the other sign than the change of height",
            expected="velocity north, east, down: positive where it sinks",
            cure="turn its sign",
            where=gnss.name,
        )
    text = "the vertical velocity of GNSS is always 0: taken as not measured"
    return [] if trouble is None else [Finding("vertical velocity", "warning", text)]


def find_data_gaps(imu: ImuRecording) -> tuple[DataGap, ...]:
    """Find gaps and stuck axes, and how much may have happened in them."""
    parts: list[tuple[float, float, NDArray[np.bool_], bool]] = [
        (a, b, np.ones(6, dtype=bool), True) for a, b in find_gaps(imu)
    ]
    for stuck in stuck_intervals(imu):
        channels = np.zeros(6, dtype=bool)
        channels[(CHANNELS.index(stuck.channel) + 3) % 6] = True
        start = float(imu.time[max(stuck.first - 1, 0)])
        stop = float(imu.time[min(stuck.stop, imu.size - 1)])
        parts.append((start, stop, channels, False))
    merged: list[tuple[float, float, NDArray[np.bool_], bool]] = []
    for part in sorted(parts, key=lambda p: p[:2]):
        if merged and part[0] < merged[-1][1] and not (part[3] or merged[-1][3]):
            last = merged[-1]
            merged[-1] = (last[0], max(last[1], part[1]), last[2] | part[2], False)
        else:
            merged.append(part)
    spans = [(a, b) for a, b, _, _ in merged]
    return tuple(
        DataGap(a, b, c, np.where(c, interpolation_variance(imu, b - a, spans), 0.0), gap)
        for a, b, c, gap in merged
    )


def _finding_on_gap(part: DataGap) -> Finding:
    names = tuple(c for k, c in enumerate((*CHANNELS[3:], *CHANNELS[:3])) if part.channels[k])
    if part.gap:
        what, kind = "the IMU recorded nothing", "gap"
    elif part.channels.all():
        what, kind = "the IMU repeats one row", "gap"
    else:
        what, kind = f"{', '.join(names)} {'is' if len(names) == 1 else 'are'} stuck", "stuck axis"
    turn = np.degrees(part.attitude_sd)
    by = f"by {turn:.1f} deg" if turn < 90.0 else "anywhere"
    return Finding(
        kind,
        "warning",
        f"{what} from {part.start:.3f} to {part.stop:.3f} s ({part.seconds:.2f} s)"
        + (f", in which it may have turned {by}" if turn else ""),
        () if part.channels.all() else names,
        ((part.start, part.stop),),
        part.seconds,
    )


def _require_right_way_round(
    imu: ImuRecording, turns: TurnComparison, mounting: FloatArray | None
) -> None:
    """Stop when gravity or gyros are reversed."""
    if turns.together and turns.correlation < 0.0:
        raise NavigationError(
            "the IMU turns about the vertical against the course that GNSS sees (correlation "
            f"{turns.correlation:.2f}): its accelerometers show gravity instead of specific force, "
            "as some ENU logs do, or an axis is reversed",
            expected="specific force (at rest it points up) and right-handed axes",
            cure="turn the sign of all three accelerometers with --flip accel, or of the gyros "
            "with --flip gyro",
            where=imu.name,
        )
    if mounting is None:
        return
    force = imu.accel.mean(axis=0)
    down = -(np.asarray(mounting) @ force) / np.linalg.norm(force)
    lean = float(np.arccos(np.clip(down[2], -1.0, 1.0)))
    if lean > WRONG_WAY_UP:
        raise NavigationError(
            f"by the mounting that was given gravity points {np.degrees(lean):.0f} deg away from "
            "down",
            expected="a mounting that takes the axes of the IMU to forward, right, down",
            cure="check --mounting (a log with z up needs a roll or pitch of 180 deg), or whether "
            "the accelerometers show gravity instead of specific force (--flip accel)",
            where=imu.name,
        )


def _without_jump(
    imu: ImuRecording, gnss: GnssRecording, turns: TurnComparison
) -> tuple[ImuRecording, TurnComparison, list[Finding]]:
    """Take jumps out of the IMU's stamps: gaps in which no motion is missing."""
    found: list[Finding] = []
    if not turns.seconds:
        return imu, turns, found
    for a, b in sorted(find_gaps(imu), key=lambda g: g[0] - g[1])[:MOST_JUMPS]:
        jump = b - a - 1.0 / imu.rate
        if jump < LEAST_JUMP:
            break
        put_back = replace(imu, time=np.where(imu.time >= b, imu.time - jump, imu.time))
        trial = compare_turns(put_back, gnss)
        if not (trial.together and trial.log_likelihood - turns.log_likelihood > CONVINCING):
            continue
        imu = replace(
            put_back, history=(*imu.history, f"stamps from {b:.3f} s on put back by {jump:.3f} s")
        )
        turns = trial
        text = (
            f"the stamps of the IMU jump by {jump:.3f} s at {a:.3f} s, by the turns that GNSS "
            "sees: no motion is missing, and later stamps were put back by as much"
        )
        found.append(Finding("time jump", "warning", text, (), ((a, b),), jump))
    change = turns.change
    if change is None or not turns.together:
        return imu, turns, found
    about = change.time + change.before
    raise NavigationError(
        f"the clocks of IMU and GNSS jump against each other by {change.after - change.before:+.1f}"
        f" s at about {about:.0f} s (turns of the IMU before and after it, against the course)",
        expected="one time axis for the whole drive",
        cure=f"put the stamps right, or cut both recordings at {about:.0f} s and navigate the "
        "parts by themselves",
        where=imu.name,
    )


def _clock(turns: TurnComparison, given: float | None) -> list[Finding]:
    if not turns.together or given is None or abs(turns.lag - given) < 0.5:
        return []
    return [
        Finding(
            "clock",
            "warning",
            f"GNSS seems to be stamped {turns.lag - given:+.1f} s off against the IMU, by its "
            f"turns: the time offset that was given is {given:g} s",
            value=turns.lag,
            cure=f"leave --time-offset out, or give about {turns.lag:.1f}",
        )
    ]


def _findings_on_fixes(gnss: GnssRecording, fixes: FixScreening) -> list[Finding]:
    found = []
    at = np.flatnonzero(fixes.wrong)
    if at.size:
        runs = [
            (float(gnss.time[r[0]]), float(gnss.time[r[-1]]))
            for r in np.split(at, np.flatnonzero(np.diff(at) > 1) + 1)
        ]
        times = ", ".join(
            f"{a:.2f}" if a == b else f"{a:.2f} to {b:.2f}" for a, b in runs[:MOST_NAMED]
        )
        times += ", ..." if len(runs) > MOST_NAMED else ""
        one, away = at.size == 1, float(fixes.away.max())
        found.append(
            Finding(
                "wrong fix",
                "warning",
                f"{at.size} GNSS position{' is' if one else 's are'} "
                f"{'' if one else 'up to '}{_distance(away)} away from where those "
                f"around {'it' if one else 'them'} put {'it' if one else 'them'} (at {times} s): "
                "left out",
                (),
                tuple(runs),
                away,
            )
        )
    for what, jumps in (("positions", fixes.jumps), ("heights", fixes.height_jumps)):
        for time, size in jumps[:MOST_NAMED]:
            found.append(
                Finding(
                    "GNSS jump",
                    "warning",
                    f"GNSS {what} jump by {_distance(size)} at {time:.2f} s and stay there",
                    (),
                    ((time, time),),
                    size,
                    cure=f"{what} before or after it may be wrong by as much"
                    + (": above ellipsoid and geoid mixed?" if what == "heights" else ""),
                )
            )
    return found


def _distance(metres: float) -> str:
    return f"{metres / 1000.0:.1f} km" if metres >= 1000.0 else f"{metres:.1f} m"


def _coverage(imu: ImuRecording, gnss: GnssRecording) -> list[Finding]:
    found = []
    late = float(gnss.time[0] - imu.time[0])
    if late > LATE_GNSS:
        found.append(
            Finding(
                "late GNSS",
                "warning" if late > 30.0 else "info",
                f"GNSS begins {late:.1f} s after the IMU (at {gnss.time[0]:.2f} s)",
                (),
                ((float(imu.time[0]), float(gnss.time[0])),),
                late,
            )
        )
    step = np.diff(gnss.time)
    usual = float(np.median(step)) if step.size else 0.0
    for k in np.flatnonzero(step > max(LONG_OUTAGE, 5.0 * usual))[:MOST_NAMED]:
        a, b = float(gnss.time[k]), float(gnss.time[k + 1])
        text = f"no GNSS from {a:.2f} to {b:.2f} s ({b - a:.1f} s)"
        found.append(Finding("GNSS outage", "info", text, (), ((a, b),), b - a))
    return found
