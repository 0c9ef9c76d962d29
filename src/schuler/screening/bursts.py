"""Screening of channels whose noise rises for a while, with no motion that explains it."""

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
