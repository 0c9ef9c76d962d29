"""How samples reach a log: the device's box-car filter, its clock, lost and repeated rows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.data import ImuRecording
from schuler.errors import InputError
from schuler.types import FloatArray

LARGEST_JITTER = 0.45
"""Of a step: stamps stay in order."""


def box_car(recording: ImuRecording, taps: int, decimation: int) -> ImuRecording:
    """Return the moving average that a device takes before it delivers fewer samples.

    Parameters
    ----------
    recording : ImuRecording
        As the sensor samples inside.
    taps : int
        Samples of a mean.
    decimation : int
        Every how many samples a mean is delivered.

    Returns
    -------
    ImuRecording
        Stamped at the last sample of each mean.

    Raises
    ------
    InputError
        A recording of fewer than two means.

    Notes
    -----
    S004 section 5.2: fifteen taps at 1 kHz, every tenth delivered.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> fast = schuler.ImuRecording(np.arange(1, 101) * 1e-3, np.ones((100, 3)), np.ones((100, 3)))
    >>> schuler.box_car(fast, 15, 10).size
    9
    """
    count = (recording.size - taps) // decimation + 1 if taps >= 1 and decimation >= 1 else 0
    if count < 2:
        raise InputError(
            f"{taps} taps and every {decimation}th of {recording.size} samples",
            expected="at least one of both, and a recording of at least two means",
        )

    def mean(values: FloatArray) -> FloatArray:
        total = np.zeros((count, *values.shape[1:]))
        for tap in range(taps):
            total += values[tap : tap + (count - 1) * decimation + 1 : decimation]
        return total / taps

    warmth = recording.temperature
    return replace(
        recording,
        time=recording.time[taps - 1 :: decimation][:count],
        gyro=mean(recording.gyro),
        accel=mean(recording.accel),
        temperature=None if warmth is None else mean(warmth),
        history=(*recording.history, f"mean of {taps} samples, every {decimation}th"),
    )


def box_car_gain(frequency: ArrayLike, taps: int, rate: float) -> FloatArray:
    """Return the gain of a moving average.

    Parameters
    ----------
    frequency : float or array_like
        Hz.
    taps : int
        Samples of a mean.
    rate : float
        At which they are taken, Hz.

    Returns
    -------
    ndarray
        0 to 1.

    Notes
    -----
    |sin(n x)/(n sin x)| with x = pi f / rate.

    Examples
    --------
    >>> import schuler
    >>> round(float(schuler.box_car_gain(20.0, 15, 1000.0)), 3)
    0.859
    """
    cycles = np.asarray(frequency, dtype=np.float64) / rate
    whole = np.sinc(taps * cycles)
    # sinc(n x) / sinc(x); both vanish at whole numbers of cycles a sample, where the gain is one
    single = np.sinc(cycles)
    unseen = np.abs(single) < 1e-12
    return np.asarray(np.where(unseen, 1.0, np.abs(whole / np.where(unseen, 1.0, single))))


@dataclass(frozen=True, slots=True)
class StampErrors:
    """What is wrong with the clock and the way to the log."""

    offset: float = 0.0  # seconds that the clock is ahead at the first sample
    rate_error: float = 0.0  # seconds that it gains each second (50 ppm: 5e-5)
    # standard deviation of the stamps, s; limited to 0.45 of a step, so that they stay in order.
    jitter: float = 0.0
    lost: float = 0.0  # share of the rows that are missing
    gap: float = 1.0  # mean length of a loss, rows; the lengths are geometrically distributed.
    # share of the rows that show the values of the row before under a stamp of their own, as when a
    # driver reads faster than the sensor delivers
    repeated: float = 0.0

    def __post_init__(self) -> None:
        if not (
            self.jitter >= 0.0
            and 0.0 <= self.lost < 0.9
            and self.gap >= 1.0
            and 0.0 <= self.repeated < 0.9
            and abs(self.rate_error) < 0.5
        ):
            raise InputError(
                f"{self}",
                expected="a jitter of zero or more, shares below 0.9, gaps of one row or more, and "
                "a clock that keeps time within a half",
            )


def restamp(recording: ImuRecording, errors: StampErrors, rng: np.random.Generator) -> ImuRecording:
    """Return a recording as it arrives in a log."""
    jitter_rng, lost_rng, repeat_rng = rng.spawn(3)
    n, dt = recording.size, recording.duration / (recording.size - 1)
    noise = errors.jitter * jitter_rng.standard_normal(n)
    limit = LARGEST_JITTER * dt
    time = recording.time + errors.offset + np.clip(noise, -limit, limit)
    time += errors.rate_error * (recording.time - recording.time[0])
    source = np.arange(n)
    source[repeat_rng.random(n) < errors.repeated] = -1
    source = np.maximum.accumulate(np.where(np.arange(n) == 0, 0, source))
    keep = ~_lost(n, errors.lost, errors.gap, lost_rng)
    warmth = recording.temperature
    said = f"stamps: offset {errors.offset:g} s, rate error {errors.rate_error:g}"
    return replace(
        recording,
        time=time[keep],
        gyro=recording.gyro[source][keep],
        accel=recording.accel[source][keep],
        temperature=None if warmth is None else warmth[source][keep],
        history=(*recording.history, said),
    )


def _lost(n: int, share: float, gap: float, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Losses of geometric length, good stretches of the length that makes the share right."""
    lost = np.zeros(n, dtype=bool)
    if share == 0.0:
        return lost
    good = max(gap * (1.0 - share) / share, 1.0)
    row = int(rng.geometric(1.0 / good))
    while row < n - 1:
        length = int(rng.geometric(1.0 / gap))
        lost[row : min(row + length, n - 1)] = True
        row += length + int(rng.geometric(1.0 / good))
    return lost
