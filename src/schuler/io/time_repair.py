"""Clocks that wrap round, start again, or stamp several samples at once."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from schuler.data._checks import all_finite
from schuler.io.source import Notes
from schuler.types import BoolArray, FloatArray

_DAY, _WEEK = 86400.0, 604800.0
_NEAR = 50.0  # steps within which a clock must be of its end when it wraps round
_SHARED = 0.2  # share of repeated stamps from which they are packets


def _rounds() -> Iterator[tuple[float, float, str]]:
    """Yield where clocks wrap round, to what, and how that is called."""
    for bits in (8, 16, 24, 32):
        yield 2.0**bits, 0.0, f"2^{bits}"
    for bits in (16, 32):
        yield 2.0 ** (bits - 1), -(2.0 ** (bits - 1)), f"2^{bits}"
    for seconds, word in ((_WEEK, "a week"), (_DAY, "a day"), (3600.0, "an hour")):
        for scale in (1.0, 1e3, 1e6, 1e9):
            yield seconds * scale, 0.0, word
    # Counters of microseconds shown in other units.
    for scale, word in ((1e-6, "2^32 us"), (1e-3, "2^32 us")):
        yield 2.0**32 * scale, 0.0, word


def unwrapped(values: FloatArray, what: str, notes: Notes) -> FloatArray:
    """Return a counter without its jumps back from a power of two, a day or a week."""
    step = np.diff(values)
    back = np.flatnonzero(step < 0.0)
    if not back.size or back.size > max(8, 0.1 * step.size):
        return values
    usual = float(np.median(step[step > 0.0])) if (step > 0.0).any() else 0.0
    if not usual:
        return values
    near = _NEAR * usual
    for top, bottom, word in _rounds():
        if near >= 0.2 * (top - bottom):
            continue
        before, after = values[back], values[back + 1]
        if np.all((before > top - near) & (before <= top + usual)) and np.all(
            (after >= bottom) & (after < bottom + near)
        ):
            added = np.zeros(values.size)
            added[back + 1] = top - bottom
            times = "once" if back.size == 1 else f"{back.size} times"
            notes.assumed(f"{what} wraps round at {word} {times}: undone")
            return np.asarray(values + np.cumsum(added))
    return values


def next_round(begin: float, end: float, step: float) -> tuple[float, str] | None:
    """Return what a clock in seconds has to be moved by to go on at `begin` where it was `end`."""
    for top, bottom, word in _rounds():
        if bottom == 0.0 and word[0] != "2" and 0.0 < begin + top - end <= _NEAR * step:
            return top, word
    return None


def packet_size(time: FloatArray) -> tuple[int, int] | None:
    """Return the fewest and the most samples on one stamp, when stamps are those of packets."""
    step = np.diff(time)
    if not step.size or (step < 0.0).any() or np.mean(step == 0.0) < _SHARED:
        return None
    lengths = _lengths(time)
    inner = lengths[1:-1] if lengths.size > 3 else lengths
    if lengths.size < 3 or inner.max() > 3 * max(np.median(inner), 2.0):
        return None
    return int(inner.min()), int(inner.max())


def _lengths(time: FloatArray) -> FloatArray:
    edges = np.flatnonzero(np.diff(time) > 0.0) + 1
    return np.diff(np.concatenate([[0], edges, [time.size]])).astype(np.float64)


def spread_packets(time: FloatArray, notes: Notes) -> FloatArray:
    """Spread the samples that share a stamp evenly over the time since the stamp before."""
    size = packet_size(time)
    if size is None:
        return time
    lengths = _lengths(time).astype(np.int64)
    stamps = time[np.cumsum(lengths) - 1]
    usual = float(np.median(np.diff(stamps)))
    before = np.concatenate([[stamps[0] - usual], stamps[:-1]])
    share = np.concatenate([np.arange(1, n + 1) / n for n in lengths])
    whole = np.repeat(stamps - before, lengths)
    text = f"{size[0]}" if size[0] == size[1] else f"{size[0]} to {size[1]}"
    notes.assumed(f"packets of {text} samples on one stamp: spread evenly up to their stamp")
    return np.asarray(np.repeat(before, lengths) + share * whole)


def joined_restarts(time: FloatArray, notes: Notes) -> FloatArray:
    """Put what was recorded after a restart of the clock behind what was before it."""
    step = np.diff(time)
    back = np.flatnonzero(step < 0.0)
    forward = step[step > 0.0]
    if not back.size or not forward.size or back.size > 20:
        return time
    usual = float(np.median(forward))
    starts = np.concatenate([[0], back + 1, [time.size]])
    pieces = np.diff(starts)
    # A stamp out of order comes back to the clock at once; a restart goes on from where it fell.
    if pieces.min() < 10 or np.abs(step[back]).min() < 20.0 * usual:
        return time
    if np.any(np.abs(step[back + 1] - usual) > 5.0 * usual):
        return time
    added = np.zeros(time.size)
    added[back + 1] = usual - step[back]
    rows = ", ".join(str(int(k) + 2) for k in back[:4])
    notes.assumed(
        f"the clock starts again {'once' if back.size == 1 else f'{back.size} times'} (at sample "
        f"{rows}): the parts are put behind each other, the pause between them is not known"
    )
    return np.asarray(time + np.cumsum(added))


def between_neighbours(time: FloatArray, notes: Notes) -> FloatArray:
    """Give a sample whose stamp repeats the one before the middle of the gap that follows it."""
    step = np.diff(time)
    repeats = np.flatnonzero(step == 0.0) + 1
    if not repeats.size or repeats.size > _SHARED * time.size or not (step > 0.0).any():
        return time
    usual = float(np.median(step[step > 0.0]))
    inner = repeats[repeats < time.size - 1]
    gap = time[inner + 1] - time[inner]
    fits = inner[(gap > 1.5 * usual) & (gap < 2.5 * usual)]
    if not fits.size:
        return time
    result = time.copy()
    result[fits] += (time[fits + 1] - time[fits]) / 2.0
    notes.assumed(
        f"{fits.size} stamps that repeat the one before, with a gap of two steps behind: put in "
        "the middle"
    )
    return result


_SPARSE = 0.3  # share of rows without a sensor from which it has rows of its own


def on_one_axis(
    time: FloatArray, gyro: FloatArray, accel: FloatArray, notes: Notes
) -> tuple[FloatArray, FloatArray, BoolArray] | None:
    """Return gyro and accelerometer and which rows to keep; None where every row has both.

    Of two sensors at one rate, each row of the gyro gets the nearest row of the accelerometer,
    so that the noise of both stays what it was; of two rates, the slower is interpolated.
    """
    if all_finite(gyro) and all_finite(accel):
        return None
    has = {"gyro": _there(gyro), "accel": _there(accel)}
    if any(h is None for h in has.values()):
        return None
    rows = {k: np.flatnonzero(h) for k, h in has.items() if h is not None}
    count = {k: r.size for k, r in rows.items()}
    fewest = min(count.values())
    if fewest > (1.0 - _SPARSE) * time.size or fewest < 3 or not np.isfinite(time).all():
        return None
    if not all(np.all(np.diff(time[r]) > 0.0) for r in rows.values()):
        return None
    base, other = ("gyro", "accel") if count["gyro"] >= count["accel"] else ("accel", "gyro")
    stamps, known = time[rows[base]], time[rows[other]]
    values = (accel if other == "accel" else gyro)[rows[other]]
    signals = {"gyro": gyro.copy(), "accel": accel.copy()}
    if abs(count[base] - count[other]) <= max(2, 0.02 * count[base]):
        after = np.clip(np.searchsorted(known, stamps), 1, known.size - 1)
        nearest = after - (stamps - known[after - 1] < known[after] - stamps)
        apart = float(np.median(np.abs(known[nearest] - stamps)))
        signals[other][rows[base]] = values[nearest]
        notes.assumed(
            f"{base} and {other} stand on rows of their own: each row of the {base} got the "
            f"nearest of the {other}, {apart * 1e3:.3g} ms apart"
        )
    else:
        for k in range(3):
            signals[other][rows[base], k] = np.interp(stamps, known, values[:, k])
        notes.assumed(
            f"{other} is slower than {base} ({count[other]} rows to {count[base]}): interpolated, "
            "so its noise is not what the sensor has"
        )
    keep = np.zeros(time.size, dtype=bool)
    inside = (stamps >= known[0] - 0.1) & (stamps <= known[-1] + 0.1)
    keep[rows[base][inside]] = True
    return signals["gyro"], signals["accel"], keep


def _there(values: FloatArray) -> BoolArray | None:
    """Return in which rows a sensor stands; None when its axes are not there together."""
    x, y, z = np.isfinite(values).T  # three columns at once are ten times as fast as row by row
    any_, all_ = x | y | z, x & y & z
    if not any_.any() or (any_ != all_).mean() > 0.01:
        return None
    return np.asarray(all_)
