"""Screening of channels whose noise rises, for a while or for good, with no motion behind it."""

from __future__ import annotations

import numpy as np

from schuler.data import ImuRecording
from schuler.screening.finding import Finding
from schuler.screening.values import grid_step
from schuler.types import FloatArray

_WINDOW = 1.0
"""Seconds over which the level of noise is taken."""
_FEWEST = 20
"""Windows, and samples in one."""
SHORTEST = 3
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
        runs = [r for r in runs if r.size >= SHORTEST]
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
