"""Screening of time: rate, jitter, gaps, repeated rows; the clocks of IMU and GNSS together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.data import CHANNELS, GnssRecording, ImuRecording
from schuler.errors import InputError
from schuler.io.clock import RATE_FROM_README
from schuler.screening.finding import Finding
from schuler.types import FloatArray

_STEP = 0.5  # s between the shifts that are tried
_WIDEST = 24.0  # s
_LEAPS = (18.0, 17.0, 16.0, 15.0, 19.0, 37.0)  # s between UTC, GPS time and TAI
_SPEED = 2.0  # m/s below which the course says nothing
_GPS_EPOCH, _WEEK = 315964800.0, 604800.0


def check_clocks(imu: ImuRecording, gnss: GnssRecording) -> None:
    """Raise where IMU and GNSS count time on axes that have a known difference."""
    apart = _axes_apart(imu, gnss)
    if apart is not None:
        raise apart
    shift, best, here = shift_of_clocks(imu, gnss)
    leap = next((x for x in _LEAPS if abs(abs(shift) - x) <= 0.75), None)
    if leap is None or best < 0.5 or here > 0.5 * best:
        return
    offset = float(np.copysign(leap, shift))
    raise InputError(
        f"the turns of GNSS come {leap:g} s {'before' if shift > 0 else 'after'} those of the "
        f"gyros (correlation {best:.2f}, {here:.2f} as they stand): leap seconds, one of them "
        "counts UTC and the other GPS time",
        expected="one axis of time",
        cure=f"say --gnss-time-offset {offset:g}",
        where=gnss.name,
    )


def _axes_apart(imu: ImuRecording, gnss: GnssRecording) -> InputError | None:
    """Return the error for Unix time beside seconds of a week; None where the axes meet."""
    a, b = (float(imu.time[0]), float(imu.time[-1])), (float(gnss.time[0]), float(gnss.time[-1]))
    if a[0] < b[1] and b[0] < a[1]:
        return None
    for (first, last), other, word, turn in ((a, b, "IMU", 1.0), (b, a, "GNSS", -1.0)):
        if first < 1e9 or other[0] > 3.0 * _WEEK:
            continue
        week = np.floor((first - _GPS_EPOCH + 18.0) / _WEEK)
        offset = _GPS_EPOCH + week * _WEEK - 18.0
        inside = first - offset < other[1] and other[0] < last - offset
        hint = (
            f"--imu-time-offset {-offset:.0f}" if turn > 0 else f"--gnss-time-offset {-offset:.0f}"
        )
        sure = "" if inside else ", if both are of one day"
        return InputError(
            f"the time of the {word} is Unix time (from {first:.3f} s), that of the other counts "
            f"in the GPS week (from {other[0]:.3f} s)",
            expected="one axis of time",
            cure=f"say {hint}{sure}, which takes the beginning of GPS week {week:.0f} and 18 leap "
            "seconds off it",
            where=imu.name,
        )
    return None


def shift_of_clocks(imu: ImuRecording, gnss: GnssRecording) -> tuple[float, float, float]:
    """Return the shift at which turns of GNSS and gyros fit best, and how well there and at 0."""
    if gnss.velocity is None or gnss.size < 30 or not np.isfinite(imu.gyro[0]).all():
        return 0.0, 0.0, 0.0
    grid = np.arange(max(imu.time[0], gnss.time[0]), min(imu.time[-1], gnss.time[-1]), _STEP)
    if grid.size < 4 * _WIDEST / _STEP:
        return 0.0, 0.0, 0.0
    north, east = gnss.velocity[:, 0], gnss.velocity[:, 1]
    course = np.unwrap(np.arctan2(east, north))
    speed = np.interp(grid, gnss.time, np.hypot(north, east))
    turns = np.abs(np.gradient(np.interp(grid, gnss.time, course), _STEP))
    turns = np.where(speed > _SPEED, np.minimum(turns, 1.5), 0.0)
    smooth = _means(imu, grid)
    most = round(_WIDEST / _STEP)
    scores = [_likeness(turns, smooth, k) for k in range(-most, most + 1)]
    best = int(np.argmax(scores))
    return (best - most) * _STEP, scores[best], scores[most]


def _means(imu: ImuRecording, grid: FloatArray) -> FloatArray:
    """Return the size of the mean turn rate around each moment of a grid."""
    rates = imu.gyro - np.median(imu.gyro, axis=0)
    total = np.vstack([np.zeros(3), np.cumsum(rates, axis=0)])
    low = np.searchsorted(imu.time, grid - _STEP)
    high = np.searchsorted(imu.time, grid + _STEP)
    count = np.maximum(high - low, 1)[:, np.newaxis]
    return np.asarray(np.linalg.norm((total[high] - total[low]) / count, axis=1))


def _likeness(turns: FloatArray, rates: FloatArray, lag: int) -> float:
    """Return the correlation of turns with rates so many steps later."""
    a = turns[max(0, -lag) : turns.size - max(0, lag)]
    b = rates[max(0, lag) : rates.size - max(0, -lag)]
    if a.std() == 0.0 or b.std() == 0.0:
        return 0.0
    return float(np.corrcoef(a, b)[0, 1])


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
