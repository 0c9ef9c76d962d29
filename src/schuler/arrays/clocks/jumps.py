"""One-sample time jumps: segments in which one IMU's samples are a whole number of steps off."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from schuler.arrays.calibration.rotation import MAD
from schuler.arrays.clocks.delays import DelayEstimate, estimate_delays, require_several
from schuler.arrays.clocks.resampling import low_pass, rate_of_change, resample
from schuler.data import ImuArray
from schuler.kernels.noise.viterbi import rare_changes
from schuler.types import FloatArray

LARGEST = 3
"""Steps; jumps by more are looked for by the clocks, not here."""
EVIDENCE = 20.0
"""Log-likelihood that a change must gain: a false one in some 1e8 independent samples."""
MOST = 20
"""Jumps that are reported at most; where there are more, the stamps are not worth much."""
CLIP = 8.0
"""Standard deviations at which a residual counts no more: one bad row is no jump."""

SHORTEST_FILTERED = 40
"""Samples below which nothing is low-passed."""


@dataclass(frozen=True, slots=True)
class SampleJump:
    """A segment in which the samples of an IMU belong to other stamps.

    Parameters
    ----------
    imu : int
        Number in the array, from zero.
    name : str
        Of the IMU.
    first, stop : int
        First row of the segment, and the one after its last.
    start_time, stop_time : float
        Stamps of the first row and of the last, s.
    samples : int
        Row r holds what belongs to row r + samples: positive where samples were lost before, and
        what comes after moved up.
    shift : float
        The same in seconds.
    evidence : float
        Log-likelihood gained against no jump.

    Examples
    --------
    >>> from schuler import SampleJump
    >>> jump = SampleJump(1, "imu 2", 900, 999, 9.0, 10.0, samples=-1, shift=-0.01, evidence=80.0)
    >>> jump.samples
    -1
    """

    imu: int
    name: str
    first: int
    stop: int
    start_time: float
    stop_time: float
    samples: int
    shift: float
    evidence: float

    def __str__(self) -> str:
        count = f"{abs(self.samples)} sample{'' if abs(self.samples) == 1 else 's'}"
        way = "early" if self.samples > 0 else "late"
        return (
            f"{self.name}: {count} ({1e3 * abs(self.shift):.3g} ms) too {way} from "
            f"{self.start_time:.3f} to {self.stop_time:.3f} s ({self.stop - self.first} rows)"
        )


def find_jumps(
    array: ImuArray,
    delays: DelayEstimate | None = None,
    *,
    bandwidth: float | None = None,
    largest: int = LARGEST,
) -> tuple[SampleJump, ...]:
    """Find segments in which an IMU is off by whole samples against its usual delay.

    Parameters
    ----------
    array : ImuArray
        At least two IMUs; with two, the jump is laid on the one whose own delay moves against
        their mean, which two cannot tell: it is named for the second.
    delays : DelayEstimate, optional
        From `estimate_delays`; estimated if not given.
    bandwidth : float, optional
        Low-pass the rates to this first, Hz. The ends of a segment are then known to about half
        a period of it.
    largest : int
        Largest jump looked for, samples.

    Returns
    -------
    tuple of SampleJump
        By IMU and time. The path of most likely shifts among -largest .. largest samples, a
        change paid for with a log-likelihood of 20 (Viterbi); the shift in which an IMU is most
        of the time is its usual one. Without motion nothing can be seen, and a jump that begins
        in rest is dated to the first motion after it.

    Raises
    ------
    EstimationError
        One IMU only, or too little motion.

    Examples
    --------
    >>> import numpy as np
    >>> import schuler
    >>> rng, time = np.random.default_rng(1), np.arange(2_000) / 50.0
    >>> rate = np.stack([np.sin(f * time) for f in (2.3, 3.1, 4.7)], axis=1)[:, None]
    >>> force = rate * 2.0 + (0.0, 0.0, 9.81)
    >>> gyro = rate + 1e-3 * rng.standard_normal((2_000, 4, 3))
    >>> accel = force + 1e-2 * rng.standard_normal((2_000, 4, 3))
    >>> array = schuler.ImuArray(time, gyro, accel, schuler.Mounting.aligned(4))
    >>> schuler.find_jumps(array)
    ()
    """
    require_several(array)
    jumps: list[SampleJump] = []
    # A jump of one IMU moves the mean of the others, too: the clearest is undone before the
    # next is looked for.
    for _ in range(MOST):
        # a jump moves the delays, too, by its share of the record
        found = estimate_delays(array, bandwidth=bandwidth) if delays is None else delays
        rates = array.gyro
        if bandwidth is not None:
            flat = rates.reshape(array.size, -1)
            rates = low_pass(array.time, flat, bandwidth).reshape(rates.shape)
        turned = np.einsum("kij,nkj->nki", found.rotation, rates)
        seen: list[SampleJump] = []
        for i in range(1 if array.count == 2 else 0, array.count):
            likelihood = _likelihoods(array, turned, found.delay, i, largest)
            path = np.zeros(array.size, dtype=np.int64)
            rare_changes(likelihood, EVIDENCE, path)
            usual = int(np.bincount(path, minlength=2 * largest + 1).argmax())
            seen += _stretches(array, i, path, usual, likelihood)
        if not seen:
            break
        clearest = max(seen, key=lambda jump: jump.evidence)
        jumps.append(clearest)
        array = undo_jumps(array, (clearest,))
    return tuple(sorted(jumps, key=lambda jump: (jump.imu, jump.first)))


def _likelihoods(
    array: ImuArray,
    turned: FloatArray,
    delay: FloatArray,
    imu: int,
    largest: int,
) -> FloatArray:
    """Log-likelihood of each row of one IMU being off by -largest .. largest samples."""
    step = 1.0 / array.rate
    others = [i for i in range(array.count) if i != imu]
    # The others are brought to the instants of this one, whose own rows stay where they are: so
    # the ends of a segment stay sharp.
    instants = array.time - delay[imu]
    aligned = [resample(array.time, turned[:, i], instants + delay[i]).values for i in others]
    reference = np.median(aligned, axis=0)
    apart = _without_errors_of_scale(turned[:, imu] - reference, reference)
    motion, noise_of = _motion(array, reference, apart)
    slope = np.linalg.norm(rate_of_change(array.time, motion), axis=1)
    # row r is off by j when it shows what the others show j rows later
    states = range(-largest, largest + 1)
    changes = [_rows_later(motion, j) - motion for j in states]
    there = np.min(
        [
            _clear_share(c, noise_of(j), round(array.rate))
            for j, c in zip(states, changes, strict=True)
            if j
        ],
        axis=0,
    )
    residuals = np.stack([apart - there[:, None] * change for change in changes], axis=1)
    length = np.linalg.norm(residuals, axis=2)
    noise = _noise(length[:, largest], np.min(length, axis=1), slope * step)
    correlated = _correlated_samples(apart)
    scaled = np.clip(residuals / noise[:, None, None], -CLIP, CLIP)
    likelihood = -0.5 * np.sum(scaled**2, axis=2) / correlated
    likelihood[np.isnan(likelihood).any(axis=1)] = 0.0
    return np.ascontiguousarray(likelihood)


def _motion(
    array: ImuArray, reference: FloatArray, apart: FloatArray
) -> tuple[FloatArray, Callable[[int], float]]:
    """Reference low-passed to where motion stands out of noise, and the noise of its changes.

    Noise of the reference that is shifted with it makes of every stretch of rest a jump by chance.
    """
    from scipy.signal import welch

    window = min(256, array.size)
    frequency, motion = welch(np.nan_to_num(reference), array.rate, nperseg=window, axis=0)
    noise = welch(np.nan_to_num(apart), array.rate, nperseg=window, axis=0)[1].sum(axis=1)
    clear = np.flatnonzero(motion.sum(axis=1) > 2.0 * noise)
    bandwidth = float(frequency[min(clear[-1] + 1 if clear.size else 1, frequency.size - 1)])
    if bandwidth < 0.45 * array.rate and array.size >= SHORTEST_FILTERED:
        reference = low_pass(array.time, reference, bandwidth)
        noise = np.where(frequency <= bandwidth, noise, 0.0)

    def noise_of(rows: int) -> float:
        gain = 2.0 - 2.0 * np.cos(2.0 * np.pi * frequency * rows / array.rate)
        return float(np.sum(gain * noise) * frequency[1])

    return reference, noise_of


def _without_errors_of_scale(apart: FloatArray, rates: FloatArray) -> FloatArray:
    """Take off a bias and what follows the rate itself: scale factors and axes are no jumps."""
    middle = np.nanmedian(apart, axis=0)
    limit = MAD * 5.0 * np.nanmedian(np.abs(apart - middle), axis=0)
    good = np.isfinite(apart).all(axis=1)
    design = np.column_stack([np.ones(apart.shape[0]), rates])
    clipped = np.clip(apart[good] - middle, -limit, limit)
    found = np.linalg.lstsq(design[good], clipped, rcond=None)[0]
    return np.asarray(apart - middle - design @ found)


def _clear_share(change: FloatArray, noise: float, window: int) -> FloatArray:
    """Share of a change of the motion that noise does not explain, about every row."""
    power = np.nan_to_num(np.sum(change**2, axis=1))
    power = np.convolve(power, np.ones(window) / window, mode="same")
    return np.asarray(np.maximum(1.0 - noise / np.maximum(power, 1e-300), 0.0))


def _correlated_samples(residual: FloatArray) -> float:
    """Samples that count as one: the sum of the autocorrelation up to where it vanishes."""
    good = residual[np.isfinite(residual).all(axis=1)]
    limit = MAD * 5.0 * np.median(np.abs(good), axis=0)
    good = np.clip(good, -limit, limit)
    energy = float(np.sum(good**2))
    total = 1.0
    for lag in range(1, min(200, good.shape[0] // 2)):
        correlation = float(np.sum(good[lag:] * good[:-lag])) / max(energy, 1e-300)
        if correlation < 0.05:
            break
        total += 2.0 * correlation
    return total


def _rows_later(values: FloatArray, rows: int) -> FloatArray:
    moved = np.full_like(values, np.nan)
    if rows >= 0:
        moved[: values.shape[0] - rows] = values[rows:]
    else:
        moved[-rows:] = values[:rows]
    return moved


def _noise(usual: FloatArray, least: FloatArray, motion: FloatArray) -> FloatArray:
    """Standard deviation of a component: a constant, and a share of what one step changes.

    The length of three normal numbers has the median 1.5382 standard deviations.
    """
    good = np.isfinite(usual) & np.isfinite(least) & np.isfinite(motion)
    calm = good & (motion <= np.median(motion[good]))
    constant = float(np.median(usual[calm])) / 1.5382
    lively = good & (motion > np.percentile(motion[good], 75.0))
    excess = 0.0
    if lively.any():
        excess = (float(np.median(least[lively])) / 1.5382) ** 2 - constant**2
    share = np.sqrt(max(excess, 0.0)) / max(float(np.median(motion[lively])), 1e-300)
    return np.asarray(np.hypot(max(constant, 1e-12), share * np.nan_to_num(motion)))


def _stretches(
    array: ImuArray, imu: int, path: NDArray[np.int64], usual: int, likelihood: FloatArray
) -> list[SampleJump]:
    edges = np.concatenate([[0], np.flatnonzero(np.diff(path)) + 1, [path.size]])
    found = []
    for a, b in pairwise(edges):
        samples = int(path[a]) - usual
        if samples == 0:
            continue
        gain = float(np.sum(likelihood[a:b, path[a]] - likelihood[a:b, usual]))
        start, stop = float(array.time[a]), float(array.time[b - 1])
        shift = samples / array.rate
        found.append(
            SampleJump(imu, array.names[imu], int(a), int(b), start, stop, samples, shift, gain)
        )
    return found


def undo_jumps(array: ImuArray, jumps: Sequence[SampleJump]) -> ImuArray:
    """Move the rows of every segment to where they belong.

    Examples
    --------
    >>> import numpy as np
    >>> import schuler
    >>> rng, time = np.random.default_rng(1), np.arange(2_000) / 50.0
    >>> rate = np.stack([np.sin(f * time) for f in (2.3, 3.1, 4.7)], axis=1)[:, None]
    >>> force = rate * 2.0 + (0.0, 0.0, 9.81)
    >>> gyro = rate + 1e-3 * rng.standard_normal((2_000, 4, 3))
    >>> accel = force + 1e-2 * rng.standard_normal((2_000, 4, 3))
    >>> array = schuler.ImuArray(time, gyro, accel, schuler.Mounting.aligned(4))
    >>> schuler.undo_jumps(array, schuler.find_jumps(array)).count
    4
    """
    gyro, accel = np.array(array.gyro), np.array(array.accel)
    for jump in jumps:
        _move_rows(gyro, gyro.copy(), jump)
        _move_rows(accel, accel.copy(), jump)
    lines = tuple(f"time jump undone, {jump}" for jump in jumps)
    return replace(array, gyro=gyro, accel=accel, history=(*array.history, *lines))


def _move_rows(values: FloatArray, before: FloatArray, jump: SampleJump) -> None:
    """Move one segment of `before` within `values`; rows that nothing belongs to become NaN."""
    rows = np.arange(jump.first, jump.stop)
    values[rows, jump.imu] = np.nan
    target = rows + jump.samples
    inside = (target >= 0) & (target < values.shape[0])
    rows, target = rows[inside], target[inside]
    free = np.isnan(values[target, jump.imu]).all(axis=1)
    values[target[free], jump.imu] = before[rows[free], jump.imu]
