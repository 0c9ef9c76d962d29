"""Several recordings with their own clocks to one array."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from schuler.arrays.clocks.alignment import WINDOW, ClockFit, check_recordings, fit_clock
from schuler.arrays.clocks.resampling import resample
from schuler.data import ImuArray, ImuRecording, Mounting
from schuler.data.exportable import Exportable
from schuler.errors import EstimationError, InputError
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Synchronization(Exportable):
    """Recordings brought to one clock.

    Parameters
    ----------
    array : ImuArray
        At the stamps of the reference; a sensor is missing where it has no samples around.
    clocks : tuple of ClockFit
        One for each recording but the reference.
    reference : str
        Name of the recording whose clock counts.
    noise_gain : (k,) ndarray
        Mean variance of white noise after resampling, over that before; 1 for the reference,
        whose samples are left alone.

    Examples
    --------
    >>> import numpy as np
    >>> import schuler
    >>> rng, time = np.random.default_rng(1), np.arange(6_000) / 50.0
    >>> rate = np.stack([np.sin(f * time * (1 + 0.01 * time)) for f in (1.3, 2.1, 3.7)], axis=1)
    >>> force = rate * 2.0 + (0.0, 0.0, 9.81)
    >>> first, second = (
    ...     schuler.ImuRecording(time + late, rate + 1e-3 * rng.standard_normal((6_000, 3)), force)
    ...     for late in (0.0, 0.3)
    ... )
    >>> found = schuler.synchronize([first, second])
    >>> round(found.clocks[0].offset, 1)
    -0.3
    """

    array: ImuArray
    clocks: tuple[ClockFit, ...]
    reference: str
    noise_gain: FloatArray


def synchronize(
    recordings: Sequence[ImuRecording],
    mounting: Mounting | None = None,
    *,
    reference: int = 0,
    window: float = WINDOW,
) -> Synchronization:
    """Bring recordings of one body to the clock of one of them.

    Parameters
    ----------
    recordings : sequence of ImuRecording
        Each with its own clock: any offset, rates that differ by up to 1000 ppm, lost samples,
        steps of whole samples.
    mounting : Mounting, optional
        Of the IMUs; all aligned with the body if not given. Plays no part in finding the clocks.
    reference : int
        Which recording gives the time axis, from zero. That only names the axis: nobody's clock
        is known to be right.
    window : float
        Length of the windows in which offsets are measured, s.

    Returns
    -------
    Synchronization
        The others resampled by polynomials through six samples. Nothing is bridged: gaps stay
        gaps (NaN).

    Raises
    ------
    InputError
        Fewer than two recordings, no such reference, or a recording without gyros.
    EstimationError
        No overlap, or no motion in common.

    Examples
    --------
    >>> import numpy as np
    >>> import schuler
    >>> rng, time = np.random.default_rng(1), np.arange(6_000) / 50.0
    >>> rate = np.stack([np.sin(f * time * (1 + 0.01 * time)) for f in (1.3, 2.1, 3.7)], axis=1)
    >>> force = rate * 2.0 + (0.0, 0.0, 9.81)
    >>> first, second = (
    ...     schuler.ImuRecording(time + late, rate + 1e-3 * rng.standard_normal((6_000, 3)), force)
    ...     for late in (0.0, 0.3)
    ... )
    >>> found = schuler.synchronize([first, second])
    >>> round(found.clocks[0].offset, 1)
    -0.3
    """
    check_recordings(recordings)
    if not 0 <= reference < len(recordings):
        raise InputError(
            f"recording {reference} as reference", expected=f"0 to {len(recordings) - 1}"
        )
    base = recordings[reference]
    gyro = np.full((base.size, len(recordings), 3), np.nan)
    accel = np.full_like(gyro, np.nan)
    gains = np.ones(len(recordings))
    clocks = []
    lines: list[str] = []
    for i, recording in enumerate(recordings):
        if i == reference:
            gyro[:, i], accel[:, i] = base.gyro, base.accel
            continue
        clock, rotation = fit_clock(base, recording, window=window)
        if clock.jumps:
            clock = _dated(base, recording, clock, rotation, window)
        stamps, values = _own_samples(recording, clock)
        moved = resample(stamps, values, base.time)
        gyro[:, i] = moved.values[:, :3]
        if values.shape[1] == 6:
            accel[:, i] = moved.values[:, 3:]
        if np.isnan(moved.noise_gain).all():
            raise EstimationError(
                f"'{recording.name}' does not overlap with '{base.name}'",
                expected="recordings of the same time",
            )
        gains[i] = float(np.nanmean(moved.noise_gain))
        clocks.append(clock)
        lines.append(_line(clock, base.name, gains[i]))
    names = [r.name for r in recordings]
    if len(set(names)) < len(names):
        names = [f"{name} {i + 1}" for i, name in enumerate(names)]
    history = tuple(f"{n}: {h}" for n, r in zip(names, recordings, strict=True) for h in r.history)
    array = ImuArray(
        base.time,
        gyro,
        accel,
        Mounting.aligned(len(recordings)) if mounting is None else mounting,
        tuple(names),
        (*history, *lines),
        tuple(dict.fromkeys(line for r in recordings for line in r.assumptions)),
    )
    return Synchronization(array, tuple(clocks), base.name, gains)


def _own_samples(recording: ImuRecording, clock: ClockFit) -> tuple[FloatArray, FloatArray]:
    """Stamps on the reference's time, in order, and the values that go with them."""
    stamps = clock.to_reference(recording.time, 1.0 / recording.rate)
    with_force = not np.isnan(recording.accel).any()
    values = np.hstack([recording.gyro, recording.accel]) if with_force else recording.gyro
    later = np.concatenate([[True], stamps[1:] > np.maximum.accumulate(stamps)[:-1]])
    return stamps[later], values[later]


def _dated(
    base: ImuRecording,
    recording: ImuRecording,
    clock: ClockFit,
    rotation: FloatArray,
    window: float,
) -> ClockFit:
    """Find the sample at which each jump happens; the windows know it to seconds only.

    Before the jump the samples fit the reference without it, after the jump with it: the sums of
    squares of both, up to each row and from it on, are least at the first row that is off.
    """
    step = 1.0 / recording.rate
    dated: list[tuple[float, int]] = []
    for k, (around, samples) in enumerate(clock.jumps):
        before = replace(clock, jumps=(*dated, *clock.jumps[k + 1 :]))
        stamps, values = _own_samples(recording, before)
        place = float(before.to_reference(np.array([around]), step)[0])
        part = base.between(place - 2.0 * window, place + 2.0 * window)
        squares = []
        for moved_by in (0.0, samples * step):
            turned = resample(stamps + moved_by, values[:, :3], part.time).values @ rotation.T
            residual = turned - part.gyro
            residual -= np.nanmedian(residual, axis=0)
            squares.append(np.sum(residual**2, axis=1))
        worse = squares[1] - squares[0]
        limit = 10.0 * float(np.nanmedian(np.abs(worse))) + 1e-300
        gain = np.concatenate([[0.0], np.cumsum(np.clip(np.nan_to_num(worse), -limit, limit))])
        first = min(int(np.argmax(gain)), part.size - 1)
        dated.append((float(part.time[first]) - (place - around) - 0.5 * step, samples))
    return replace(clock, jumps=tuple(dated))


def _line(clock: ClockFit, reference: str, gain: float) -> str:
    text = (
        f"{clock.name}: clock brought to that of {reference}: {clock.offset:+.6f} s at "
        f"{clock.epoch:.3f} s (sd {1e6 * clock.offset_sd:.3g} µs), "
        f"{-1e6 * clock.rate_error:+.3f} ppm (sd {1e6 * clock.rate_error_sd:.2g} ppm); "
        f"resampled, which leaves {100.0 * gain:.0f} % of the variance of white noise"
    )
    for start, samples in clock.jumps:
        text += f"; jump of {samples:+d} sample{'' if abs(samples) == 1 else 's'} at {start:.4f} s"
    return text
