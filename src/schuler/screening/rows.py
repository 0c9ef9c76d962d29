"""Screening of time stamps and rows: rate, jitter, gaps, repeated rows."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.data import CHANNELS, ImuRecording
from schuler.io.clock import RATE_FROM_README
from schuler.screening.finding import Finding

_GAP = 1.8  # median steps; a lost sample makes 2


@dataclass(frozen=True, slots=True)
class Steps:
    """Rate, jitter and gaps."""

    rate: float  # hz, gaps left out
    jitter: float  # standard deviation of the steps, s
    gaps: tuple[int, ...]  # rows before which samples are missing
    findings: tuple[Finding, ...]  # what to say about it


def look_at_steps(imu: ImuRecording) -> Steps:
    """Look at the time stamps."""
    step = np.diff(imu.time)
    gap = step > _GAP * float(np.median(step))
    usual = step[~gap]
    rate = 1.0 / float(usual.mean())
    jitter = float(usual.std())
    text = f"{imu.size} samples at {rate:.3f} Hz over {imu.duration:.1f} s"
    text += f", time steps vary by {1e3 * jitter:.3g} ms" if jitter * rate > 1e-4 else ""
    findings = [Finding("rate", "info", text, value=rate)]
    findings += [
        Finding("source of rate", "warning", f"{line}: check that it is right", value=rate)
        for line in imu.history
        if line.startswith(RATE_FROM_README)
    ]
    rows = np.flatnonzero(gap) + 1
    if rows.size:
        missing = int(np.sum(np.round(step[gap] * rate) - 1.0))
        worst = float(step.max())
        places = tuple((float(imu.time[k - 1]), float(imu.time[k])) for k in rows[:100])
        findings.append(
            Finding(
                "gap",
                "warning",
                f"{rows.size} gaps, about {missing} samples missing, the longest {worst:.3f} s "
                f"(first at {places[0][0]:.3f} s)",
                intervals=places,
                value=worst,
            )
        )
    absent = tuple(c for c in CHANNELS if c not in imu.channels)
    if absent:
        findings.append(Finding("channels", "info", f"not recorded: {', '.join(absent)}", absent))
    return Steps(rate, jitter, tuple(int(r) for r in rows), tuple(findings))


def repeated_rows(imu: ImuRecording) -> NDArray[np.bool_]:
    """Find rows that are equal to the row before in every channel."""
    repeated = np.zeros(imu.size, dtype=bool)
    same = np.ones(imu.size - 1, dtype=bool)
    chance = 1.0
    signals = [imu.channel(c) for c in imu.channels]
    for signal in signals:
        equal = signal[1:] == signal[:-1]
        if equal.all():  # a stuck axis says nothing about rows
            continue
        chance *= float(equal.mean())
        same &= equal
        if not same.any():
            return repeated
    if len(signals) < 2:
        return repeated
    if float(same.mean()) > max(5.0 * chance, 5e-5):
        repeated[1:] = same
    return repeated


def findings_on_rows(imu: ImuRecording, repeated: NDArray[np.bool_]) -> tuple[Finding, ...]:
    """Say what repeated rows mean."""
    count = int(repeated.sum())
    if not count:
        return ()
    share = count / imu.size
    real = (imu.size - count) / imu.duration
    return (
        Finding(
            "repeated rows",
            "warning",
            f"{count} rows ({100 * share:.1f} %) repeat the row before: the sensor was read faster "
            f"than it updates, at about {real:.1f} Hz (repair leaves them out)",
            value=share,
        ),
    )
