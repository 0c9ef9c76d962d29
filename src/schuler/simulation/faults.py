"""Faults put into a recording on purpose, each described beforehand and logged as done."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from schuler.data import CHANNELS, ImuRecording
from schuler.errors import InputError
from schuler.types import FloatArray

INFINITE = float("inf")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Lasting:
    """What all faults have: rows with start <= time < start + duration."""

    start: float
    duration: float = INFINITE

    def rows(self, time: FloatArray) -> slice:
        """Return the rows that the fault concerns."""
        first, stop = np.searchsorted(time, [self.start, self.start + self.duration])
        return slice(int(first), int(stop))


@dataclass(frozen=True, slots=True, kw_only=True)
class _OnChannels(_Lasting):
    """A fault of some channels."""

    channels: tuple[str, ...]

    def __post_init__(self) -> None:
        unknown = [c for c in self.channels if c not in CHANNELS]
        if unknown or not self.channels:
            raise InputError(
                f"a fault on {', '.join(unknown) if unknown else 'no channel'}",
                expected=f"a tuple out of {', '.join(CHANNELS)}",
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class StepFault(_OnChannels):
    """A bias that is there at once, and gone after the duration.

    Parameters
    ----------
    start, duration : float
        Seconds.
    channels : tuple of str
        Out of `schuler.data.CHANNELS`.
    size : float
        rad/s or m/s².
    """

    size: float


@dataclass(frozen=True, slots=True, kw_only=True)
class RampFault(_OnChannels):
    """A bias that grows from zero, and is gone after the duration.

    Parameters
    ----------
    start, duration : float
        Seconds.
    channels : tuple of str
        Out of `schuler.data.CHANNELS`.
    slope : float
        rad/s² or m/s³.
    """

    slope: float


@dataclass(frozen=True, slots=True, kw_only=True)
class StuckFault(_OnChannels):
    """A channel that shows one value.

    Parameters
    ----------
    start, duration : float
        Seconds.
    channels : tuple of str
        Out of `schuler.data.CHANNELS`.
    value : float or None
        rad/s or m/s²; None: the last value before the fault.
    """

    value: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseBurst(_OnChannels):
    """White noise besides that of the sensor.

    Parameters
    ----------
    start, duration : float
        Seconds.
    channels : tuple of str
        Out of `schuler.data.CHANNELS`.
    deviation : float
        Standard deviation of a sample, rad/s or m/s².
    seed : int
        Of the draw; each channel has its own child.
    """

    deviation: float
    seed: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleSlip(_OnChannels):
    """A channel that comes some samples late, its stamps unmoved.

    Parameters
    ----------
    start, duration : float
        Seconds.
    channels : tuple of str
        Out of `schuler.data.CHANNELS`.
    samples : int
        Positive: row k shows what belongs to row k - samples.
    """

    samples: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class DropOut(_Lasting):
    """Rows that do not arrive.

    Parameters
    ----------
    start, duration : float
        Seconds.
    hold : bool
        False: the rows are missing. True: they show the last values before, as a logger writes
        that does not notice.
    """

    hold: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class TimeJump(_Lasting):
    """Stamps that jump by some seconds, and back after the duration.

    Rows whose stamp would not come after that of an earlier row are removed, as a reader has to.

    Parameters
    ----------
    start, duration : float
        Seconds.
    jump : float
        Seconds added to the stamps.
    """

    jump: float


Fault = StepFault | RampFault | StuckFault | NoiseBurst | SampleSlip | DropOut | TimeJump


@dataclass(frozen=True, slots=True)
class FaultEntry:
    """What one fault did."""

    fault: Fault  # its description
    # first row that it changed in the recording as it was given, and the one after the last
    rows: tuple[int, int]
    # start, stop: stamps, as given, of the first and the last row changed, s; NaN where none was.
    start: float
    stop: float
    removed: int  # rows that it took away
    text: str  # for people


def inject_faults(
    recording: ImuRecording, faults: Sequence[Fault]
) -> tuple[ImuRecording, tuple[FaultEntry, ...]]:
    """Return a recording with faults, and the log of what was done.

    What changes values comes first, in the order given; then rows are dropped, then stamps jump,
    all by the stamps of the recording as given.
    """
    time = recording.time
    values = np.hstack([recording.gyro, recording.accel])
    for fault in faults:
        if isinstance(fault, _OnChannels):
            columns = [_column(recording, c) for c in fault.channels]
            _spoil(values, columns, fault.rows(time), time, fault)
        elif isinstance(fault, DropOut) and fault.hold:
            rows = fault.rows(time)
            values[rows] = values[max(rows.start - 1, 0)]
    keep = np.ones(time.size, dtype=bool)
    removed = [0] * len(faults)
    for k, fault in enumerate(faults):
        if isinstance(fault, DropOut) and not fault.hold:
            rows = fault.rows(time)
            removed[k] = int(np.count_nonzero(keep[rows]))
            keep[rows] = False
    stamps = time.copy()
    for k, fault in enumerate(faults):
        if isinstance(fault, TimeJump):
            stamps[fault.rows(time)] += fault.jump
            late = keep & ~_in_order(stamps, keep)
            removed[k] = int(np.count_nonzero(late))
            keep &= ~late
    if np.count_nonzero(keep) < 2:
        raise InputError("faults that leave fewer than two rows", expected="shorter faults")
    warmth = recording.temperature
    entries = tuple(_entry(f, time, r) for f, r in zip(faults, removed, strict=True))
    faulty = replace(
        recording,
        time=stamps[keep],
        gyro=values[keep, :3],
        accel=values[keep, 3:],
        temperature=None if warmth is None else warmth[keep],
        history=(*recording.history, *(f"fault: {e.text}" for e in entries)),
    )
    return faulty, entries


def _column(recording: ImuRecording, channel: str) -> int:
    if channel not in recording.channels:
        raise InputError(
            f"a fault on {channel}, which recording '{recording.name}' does not have",
            expected=f"one of {', '.join(recording.channels)}",
        )
    return CHANNELS.index(channel)


def _spoil(
    values: FloatArray, columns: list[int], rows: slice, time: FloatArray, fault: Fault
) -> None:
    """Change some columns (n, 6) within the rows."""
    count = rows.stop - rows.start
    if count <= 0:
        return
    if isinstance(fault, StepFault):
        values[rows, columns] += fault.size
    elif isinstance(fault, RampFault):
        values[rows, columns] += (fault.slope * (time[rows] - fault.start))[:, None]
    elif isinstance(fault, StuckFault):
        last = values[max(rows.start - 1, 0), columns]
        values[rows, columns] = last if fault.value is None else fault.value
    elif isinstance(fault, NoiseBurst):
        children = np.random.default_rng(fault.seed).spawn(len(CHANNELS))
        draws = [children[c].standard_normal(count) for c in columns]
        values[rows, columns] += fault.deviation * np.stack(draws, axis=-1)
    elif isinstance(fault, SampleSlip):
        source = np.arange(rows.start, rows.stop) - fault.samples
        values[rows, columns] = values[np.clip(source, 0, time.size - 1)][:, columns]


def _in_order(stamps: FloatArray, keep: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Rows whose stamp comes after those of all rows kept before."""
    seen = np.where(keep, stamps, -np.inf)
    before = np.concatenate([[-np.inf], np.maximum.accumulate(seen)[:-1]])
    return stamps > before


def _entry(fault: Fault, time: FloatArray, removed: int) -> FaultEntry:
    rows = fault.rows(time)
    if isinstance(fault, TimeJump) and fault.jump == 0.0:
        rows = slice(rows.start, rows.start)
    if rows.stop <= rows.start:
        text = f"{type(fault).__name__} outside the recording, nothing done"
        return FaultEntry(fault, (rows.start, rows.start), float("nan"), float("nan"), 0, text)
    start, stop = float(time[rows.start]), float(time[rows.stop - 1])
    text = f"{_title(fault)}, {start:.3f} .. {stop:.3f} s"
    if removed:
        text += f", {removed} rows removed"
    return FaultEntry(fault, (rows.start, rows.stop), start, stop, removed, text)


def _title(fault: Fault) -> str:
    if isinstance(fault, DropOut):
        return "values held" if fault.hold else "drop-out"
    if isinstance(fault, TimeJump):
        return f"stamps jump by {fault.jump:g} s"
    if isinstance(fault, StepFault):
        what = f"step of {fault.size:g}"
    elif isinstance(fault, RampFault):
        what = f"ramp of {fault.slope:g} a second"
    elif isinstance(fault, StuckFault):
        what = "stuck" if fault.value is None else f"stuck at {fault.value:g}"
    elif isinstance(fault, NoiseBurst):
        what = f"noise of {fault.deviation:g}"
    else:
        what = f"{fault.samples} samples late"
    return f"{what} on {', '.join(fault.channels)}"
