"""Screening of channels that stop changing for a while, and go on later or never."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schuler.data import ImuRecording
from schuler.screening.finding import Finding
from schuler.types import FloatArray

SHORTEST = 1.0
"""Seconds: a coarse sensor at rest repeats itself, but not so long."""
FEWEST = 20
"""Samples."""
AROUND = 10.0
"""Seconds on either side in which a channel shows how long it repeats itself by chance."""
MOVING_RATE = 0.02
MOVING_FORCE = 0.3
"""Standard deviations beyond which a sensor is not at rest, rad/s and m/s²."""
CHANCE = 5.0
"""So many times longer than any repetition nearby, it is no chance."""


@dataclass(frozen=True, slots=True)
class StuckInterval:
    """A channel that shows one value for a while."""

    channel: str  # out of `schuler.data.CHANNELS`
    # first, stop: first row that repeats the value, and the row behind the last
    first: int
    stop: int


def stuck_intervals(imu: ImuRecording) -> tuple[StuckInterval, ...]:
    """Find stretches in which a channel does not change though it does before or after."""
    shortest = max(round(SHORTEST * imu.rate), FEWEST)
    near = round(AROUND * imu.rate)
    found = []
    for name in imu.channels:
        edges, lengths = _runs(imu.channel(name))
        if lengths.size < 2:
            continue
        for k in np.flatnonzero(lengths >= shortest):
            first, stop = int(edges[k]), int(edges[k + 1])
            around = (edges[1:] > first - near) & (edges[:-1] < stop + near)
            around[k] = False
            by_chance = int(lengths[around].max()) if around.any() else 1
            if lengths[k] > CHANCE * by_chance:
                found.append(StuckInterval(name, first + 1, stop))
    return tuple(s for s in found if _no_rest(imu, s, found, near))


def _no_rest(
    imu: ImuRecording, stuck: StuckInterval, all_stuck: list[StuckInterval], near: int
) -> bool:
    """Whether a channel that does not change cannot be one of a coarse sensor at rest.

    Other channels move meanwhile, or nothing moves before and after either, where this channel
    does change, or there is no other channel that does.
    """
    beside = {s.channel for s in all_stuck if s.first < stuck.stop and stuck.first < s.stop}
    others = [c for c in imu.channels if c not in beside]
    if not others:
        return True
    if _moves(imu, others, stuck.first, stuck.stop):
        return True
    return not (
        _moves(imu, others, max(stuck.first - near, 0), stuck.first)
        or _moves(imu, others, stuck.stop, min(stuck.stop + near, imu.size))
    )


def _moves(imu: ImuRecording, channels: list[str], first: int, stop: int) -> bool:
    if stop - first < 2:
        return False
    return any(
        float(imu.channel(c)[first:stop].std()) > (MOVING_RATE if c[0] == "g" else MOVING_FORCE)
        for c in channels
    )


def _runs(signal: FloatArray) -> tuple[np.ndarray, np.ndarray]:
    """First row of every run of equal values (and the end), and the lengths."""
    change = np.flatnonzero(signal[1:] != signal[:-1]) + 1
    edges = np.concatenate([[0], change, [signal.size]])
    return edges, np.diff(edges)


def findings_on_stuck(imu: ImuRecording, stuck: tuple[StuckInterval, ...]) -> tuple[Finding, ...]:
    """Say which channels stop for a while."""
    together: dict[tuple[int, int], list[str]] = {}
    for interval in stuck:
        together.setdefault((interval.first, interval.stop), []).append(interval.channel)
    found = []
    for (first, stop), channels in together.items():
        start, end = float(imu.time[first]), float(imu.time[stop - 1])
        to_the_end = stop == imu.size
        all_of_them = len(channels) == len(imu.channels)
        what = "all channels repeat one row" if all_of_them else f"{', '.join(channels)}: no"
        what += "" if all_of_them else " change"
        until = "to the end" if to_the_end else f"for {end - start:.2f} s"
        found.append(
            Finding(
                "stuck for a while",
                "warning",
                f"{what} from {start:.3f} s on {until}",
                tuple(channels),
                ((start, end),),
                end - start,
                cure="check the sensor and its cable",
            )
        )
    return tuple(found)
