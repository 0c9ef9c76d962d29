"""Screening of channels that break: stuck for a while or for good, or louder without a motion."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schuler.data import ImuRecording
from schuler.screening.finding import Finding
from schuler.screening.values import grid_step
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


_WINDOW = 1.0
"""Seconds over which the level of noise is taken."""
_FEWEST = 20
"""Windows, and samples in one."""
SHORTEST_BURST = 3
"""Windows in a row; what is shorter is a knock, or a vehicle that moves about one axis."""
LOUDER = 8.0
"""So many times louder than usual, while no other channel is a third as much louder than usual."""
_WHITE = 2.0
"""Ratio of the squares of second and first differences: 3 in white noise, 0 in smooth motion."""
_FOR_GRID = 20_000
BLOCKS = 20
"""Parts of a recording whose levels of noise are compared."""
CHANGED = 1.3
"""Ratio of the levels before and after at which the noise is another one."""


def findings_on_bursts(imu: ImuRecording) -> tuple[Finding, ...]:
    """Name the channels that become noisy alone: shaking would show in the others as well."""
    window = round(_WINDOW * imu.rate)
    count = imu.size // max(window, 1)
    if window < _FEWEST or count < _FEWEST or len(imu.channels) < 3:
        return ()
    signals = [imu.channel(c)[: count * window] for c in imu.channels]
    louder, white = (np.column_stack(t) for t in zip(*(_levels(s, window) for s in signals),
                                                     strict=True))  # fmt: skip
    found = []
    for k, name in enumerate(imu.channels):
        others = np.delete(louder, k, axis=1).max(axis=1)
        noisy = (louder[:, k] > LOUDER) & (louder[:, k] > 3.0 * others) & (white[:, k] > _WHITE)
        rows = np.flatnonzero(noisy)
        runs = np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1)
        runs = [r for r in runs if r.size >= SHORTEST_BURST]
        if runs:
            most = max(float(louder[r, k].max()) for r in runs)
            found.append(_finding(imu, name, runs, window, most))
    return tuple(found)


def findings_on_levels(imu: ImuRecording) -> tuple[Finding, ...]:
    """Say where the noise of a sensor at rest becomes another one and stays so."""
    window = round(_WINDOW * imu.rate)
    count = imu.size // max(window, 1) // BLOCKS * BLOCKS
    if window < _FEWEST or count < 3 * BLOCKS:
        return ()
    changes: dict[float, dict[str, float]] = {}
    for name in imu.channels:
        louder, _ = _levels(imu.channel(name)[: count * window], window)
        level = np.log(np.maximum(np.median(louder.reshape(BLOCKS, -1), axis=1), 1e-6))
        change = _step(level)
        if change is not None:
            at, rise = change
            when = float(imu.time[at * count // BLOCKS * window])
            changes.setdefault(when, {})[name] = float(np.exp(rise))
    return tuple(
        Finding(
            "noise level",
            "warning",
            f"{', '.join(ratios)}: from about {when:.0f} s on the noise is "
            f"{float(np.median([*ratios.values()])):.2g} times what it was: no one model describes "
            "both parts",
            tuple(ratios),
            ((when, float(imu.time[-1])),),
            float(np.median([*ratios.values()])),
            cure="another range, rate or filter, or another sensor? characterize each part alone",
        )
        for when, ratios in changes.items()
    )


def _step(level: FloatArray) -> tuple[int, float] | None:
    """Return where levels rise or fall once and for all, and by how much."""
    ends = range(2, level.size - 1)
    rises = [float(np.median(level[k:]) - np.median(level[:k])) for k in ends]
    spreads = [float(max(np.ptp(level[:k]), np.ptp(level[k:]))) for k in ends]
    best = int(np.argmin(spreads))
    if abs(rises[best]) < np.log(CHANGED) or spreads[best] > 0.5 * abs(rises[best]):
        return None
    return best + 2, rises[best]


def _levels(signal: FloatArray, window: int) -> tuple[FloatArray, FloatArray]:
    """Return how loud each window is against the usual, and how white."""
    table = signal.reshape(-1, window)
    step = np.diff(table, axis=1)
    first, second = np.mean(step**2, axis=1), np.mean(np.diff(step, axis=1) ** 2, axis=1)
    # Most differences of a coarse sensor are zero.
    least = (0.3 * grid_step(signal[:_FOR_GRID])) ** 2
    usual = max(float(np.median(second)), least, np.finfo(float).tiny)
    return np.sqrt(second / usual), second / np.maximum(first, np.finfo(float).tiny)


def _finding(
    imu: ImuRecording, name: str, runs: list[np.ndarray], window: int, most: float
) -> Finding:
    spans = tuple(
        (float(imu.time[r[0] * window]), float(imu.time[(r[-1] + 1) * window - 1])) for r in runs
    )
    more = f" and {len(spans) - 1} more times" if len(spans) > 1 else ""
    return Finding(
        "noise burst",
        "warning",
        f"{name} alone is up to {most:.0f} times as noisy as usual from {spans[0][0]:.1f} to "
        f"{spans[0][1]:.1f} s{more}, and no motion shows in the other axes",
        (name,),
        spans,
        most,
        "check the sensor, its supply and its cable; results of these seconds are surer than they "
        "should be",
    )
