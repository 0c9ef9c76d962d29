"""Screening of motion: when the sensor stood still, and when something touched it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.data import ImuRecording
from schuler.screening.finding import Finding
from schuler.screening.values import grid_step
from schuler.types import FloatArray

_WINDOW = 1.0  # s over which rest is judged
_CONTRAST = 8.0  # loud to quiet windows; below it a smooth ride looks like standing still
_BLOCK = 10.0  # s over which a slowly moving bias may be taken as constant
_BY_CHANCE = 1e-3  # knocks that outliers make by chance, per record
_KNOCK = 8.0  # robust standard deviations
_TAIL = 4.0
_HEAVY = 5e-3  # share beyond _TAIL; a normal distribution has 6.3e-5
_FOR_GRID = 20_000  # samples that suffice to see the grid
_MERGE = 2.0  # s between disturbed samples that belong to one knock
_PAD = 0.25  # s cut on either side of a knock


@dataclass(frozen=True, slots=True)
class Rest:
    """When the sensor stood still."""

    static: bool  # throughout
    rest: tuple[tuple[float, float], ...]  # intervals of at least two seconds, s
    findings: tuple[Finding, ...]  # what to say about it
    level: bool = False  # the accelerometers, where there are any, stayed as if throughout static


def look_at_rest(imu: ImuRecording, rate: float) -> Rest:
    """Find out when the sensor stood still."""
    window = max(2, round(_WINDOW * rate))
    count = imu.size // window
    if count < 3:
        return Rest(False, (), ())
    means, spreads = _windows(imu, window, count)
    low, high = np.percentile(means, [5, 95], axis=0)
    limits = np.array([0.02 if c.startswith("gyro") else 0.3 for c in imu.channels])
    gyros = np.array([c.startswith("gyro") for c in imu.channels])
    steady = high - low < limits
    level = bool(steady[~gyros].all())
    edge = np.append(imu.time[::window][:count], imu.time[count * window - 1])
    # The floor lets a grid or averaging over a second, which hides noise, not forbid rest.
    if bool(steady.all()):
        whole = (float(imu.time[0]), float(imu.time[-1]))
        text = "the sensor stood still throughout"
        finding = Finding("rest", "info", text, (), (whole,), imu.duration)
        return Rest(True, (whole,), (finding,), level)
    quiet, loud = np.percentile(spreads, [5, 95], axis=0)
    if float(np.median(loud / np.maximum(quiet, 1e-12))) < _CONTRAST:
        return Rest(False, (), (), level)
    # Without a floor, a coarse grid would make windows without a single step the only rest.
    calm = np.all(spreads < 3.0 * quiet + 0.05 * limits, axis=1)
    if calm.any() and gyros.any():
        bias = np.median(means[calm][:, gyros], axis=0)
        calm &= np.all(np.abs(means[:, gyros] - bias) < 0.02, axis=1)
    rest = _runs(calm, edge, 2)
    if not rest:
        return Rest(False, (), (), level)
    total = sum(b - a for a, b in rest)
    text = f"stood still {len(rest)} times, {total:.0f} s in all, first at {rest[0][0]:.1f} s"
    return Rest(False, rest, (Finding("rest", "info", text, (), rest[:100], total),), level)


def _windows(imu: ImuRecording, window: int, count: int) -> tuple[FloatArray, FloatArray]:
    """Return means and standard deviations (windows, channels)."""
    means = np.empty((count, len(imu.channels)))
    spreads = np.empty_like(means)
    for j, name in enumerate(imu.channels):
        signal = imu.channel(name)
        table = (signal[: count * window] - signal.mean()).reshape(count, window)
        mean = table.mean(axis=1)
        square = np.einsum("ij,ij->i", table, table) / window
        means[:, j] = mean + signal.mean()
        spreads[:, j] = np.sqrt(np.maximum(square - mean**2, 0.0))
    return means, spreads


def _runs(calm: NDArray[np.bool_], edge: FloatArray, least: int) -> tuple[tuple[float, float], ...]:
    """Return the intervals of runs of at least `least` calm windows."""
    change = np.flatnonzero(np.diff(np.concatenate([[False], calm, [False]]).astype(np.int8)))
    pairs = change.reshape(-1, 2)
    return tuple((float(edge[a]), float(edge[b])) for a, b in pairs if b - a >= least)


def look_for_knocks(
    imu: ImuRecording, rate: float, still: Rest
) -> tuple[tuple[tuple[int, int], ...], list[Finding]]:
    """Find knocks and outliers of a static recording, and channels with heavy tails."""
    if not still.static:
        return (), []
    block = max(3, round(_BLOCK * rate))
    score = np.zeros(imu.size)
    worst: dict[str, float] = {}
    findings = []
    for name in imu.channels:
        deviation = _deviation(imu.channel(name), block)
        scale = 1.4826 * float(np.median(deviation))
        # On a coarse grid most deviations are zero; two steps of it are no knock.
        scale = max(scale, 0.3 * grid_step(imu.channel(name)[:_FOR_GRID]))
        if scale == 0.0:
            continue
        tail = float(np.count_nonzero(deviation > _TAIL * scale)) / imu.size
        if tail > _HEAVY and _spread_evenly(deviation > _KNOCK * scale, block):
            text = (
                f"{name} has heavy tails: {100 * tail:.1f} % of the samples are beyond 4 robust "
                f"standard deviations ({scale:.3g} SI), in many parts of it; use a robust estimate"
            )
            findings.append(Finding("heavy tails", "warning", text, (name,), value=tail))
            dense = _too_dense(deviation > _KNOCK * scale, max(round(_PAD * rate), 2))
            if dense.any():
                worst[name] = float(deviation[dense].max()) / scale
                np.maximum(score, np.where(dense, deviation / scale, 0.0), out=score)
            continue
        worst[name] = float(deviation.max()) / scale
        np.maximum(score, deviation / scale, out=score)
    rows = np.flatnonzero(score > _KNOCK)
    if not rows.size:
        return (), findings
    groups = np.split(rows, np.flatnonzero(np.diff(rows) > _MERGE * rate) + 1)
    return _disturbed(imu, rate, groups), [*_on_knocks(imu, groups, score, worst), *findings]


def _deviation(signal: FloatArray, block: int) -> FloatArray:
    """Return the distance of each sample from the median of its block."""
    count = max(1, signal.size // block)
    whole = count * block
    if signal.size <= block:
        return np.abs(signal - np.median(signal))
    table = signal[:whole].reshape(count, block)
    middle = np.median(table, axis=1)
    deviation = np.empty(signal.size)
    np.abs(table - middle[:, np.newaxis], out=deviation[:whole].reshape(count, block))
    np.abs(signal[whole:] - middle[-1], out=deviation[whole:])
    return deviation


def _too_dense(far: NDArray[np.bool_], window: int) -> NDArray[np.bool_]:
    """Far samples that lie closer together than the rate of all others explains."""
    from scipy.stats import binom

    dense = np.zeros(far.size, dtype=bool)
    for _ in range(5):
        rest = far & ~dense
        background = float(rest.mean())
        most = int(binom.isf(_BY_CHANCE / far.size, window, max(background, 1e-9)))
        running = np.cumsum(np.concatenate([[0], rest]))
        crowded = running[window:] - running[:-window] > max(most, 2)
        if not crowded.any():
            break
        spread = np.convolve(crowded, np.ones(window, dtype=int))[: far.size] > 0
        dense |= far & spread
    return dense


def _spread_evenly(far: NDArray[np.bool_], block: int) -> bool:
    """Tell whether far samples are spread over the recording instead of lying in a few blocks."""
    count = far.size // block
    if count < 20:
        return True
    hits = far[: count * block].reshape(count, block).any(axis=1)
    return float(hits.mean()) > 0.1


def _disturbed(
    imu: ImuRecording, rate: float, groups: list[NDArray[np.int64]]
) -> tuple[tuple[int, int], ...]:
    pad = max(1, round(_PAD * rate))
    return tuple((max(0, int(g[0]) - pad), min(imu.size, int(g[-1]) + 1 + pad)) for g in groups)


def _on_knocks(
    imu: ImuRecording, groups: list[NDArray[np.int64]], score: FloatArray, worst: dict[str, float]
) -> list[Finding]:
    """Say where the knocks (several samples) and the outliers (one or two) are."""
    found = []
    channels = tuple(c for c, w in worst.items() if w > _KNOCK)
    for kind, chosen in (
        ("knock", [g for g in groups if g.size > 2]),
        ("outlier", [g for g in groups if g.size <= 2]),
    ):
        if not chosen:
            continue
        times = tuple((float(imu.time[g[0]]), float(imu.time[g[-1]])) for g in chosen)
        largest = max(float(score[g].max()) for g in chosen)
        shown = ", ".join(f"{a:.2f}" for a, _ in times[:8]) + (", ..." if len(times) > 8 else "")
        text = (
            f"{len(chosen)} {kind}{'s' if len(chosen) > 1 else ''} at {shown} s, up to "
            f"{largest:.0f} robust standard deviations (repair with close_up cuts them out)"
        )
        found.append(Finding(kind, "warning", text, channels, times, largest))
    return found
