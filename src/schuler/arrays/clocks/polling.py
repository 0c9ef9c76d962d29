"""Chips that run free and are polled: their delay is a sawtooth of one internal period.

A chip that samples at its own rate f and is read at the array's rate shows its latest sample, which
is between nothing and one internal period old. The age grows by the beat between f and the nearest
multiple of the reading rate, and falls back by a period when the next sample is there. Turning at
thousands of degrees a second squared, a millisecond of age is the largest difference between
sensors; the phase of the sawtooth is found from these very differences.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.errors import InputError
from schuler.types import FloatArray

PHASES = 64
"""Phases among which the most likely is tracked."""
BLOCK = 2.0
"""Seconds in which a phase is taken as moving evenly."""
WANDER = 0.02
"""Cycles by which a phase may leave the even pace from block to block: an oscillator's warmth."""
SEGMENT = 10.0
"""Seconds over which a beat is looked for coherently."""
GRID = 0.03
"""Hz between beats that are tried."""
FREEDOM = 4.0
"""Of the t distribution of the residuals: knocks make heavy tails."""
EVIDENCE = 50.0
"""Log-likelihood that the sawtooth must gain over a constant delay to be believed."""
LEAST = 200
"""Lively samples that are needed."""
ROUNDS = 3
"""Of tracking all chips against each other's latest phases."""
SHARE = 0.1
"""Of a period: error of a delay from the interpolation of the motion between samples."""


@dataclass(frozen=True, slots=True, eq=False)
class PollingTrack:
    """Sampling phases of polled chips through one recording."""

    period: float  # internal sampling period, s
    period_sd: float  # standard deviation, s
    # (k,): cycles a second by which the delay of each IMU's sawtooth moves on; negative where it
    # falls.
    beat: FloatArray
    origin: float  # stamp to which beats and phases refer, s
    block_time: FloatArray  # (b,): stamps of the blocks in which there was motion, s
    phase: FloatArray  # (b, k): cycles beyond beat times (time - origin), unwrapped
    phase_sd: FloatArray  # (b, k): standard deviations, cycles
    evidence: FloatArray  # (k,): Log-likelihood gained over constant delays

    def delay(self, time: FloatArray) -> FloatArray:
        """Return the age of every sample."""
        columns = [
            np.interp(time, self.block_time, self.phase[:, i]) for i in range(self.beat.size)
        ]
        cycles = np.stack(columns, axis=1) + self.beat * (time - self.origin)[:, None]
        return np.asarray(self.period * np.mod(cycles, 1.0))

    def relative_delay(self, time: FloatArray) -> FloatArray:
        """Return the age of every sample less the mean age over the IMUs."""
        age = self.delay(time)
        return np.asarray(age - age.mean(axis=1, keepdims=True))


def track_polling(
    time: FloatArray,
    residual: FloatArray,
    slope: FloatArray,
    noise: float,
    *,
    period: float | None = None,
    before: PollingTrack | None = None,
) -> PollingTrack | None:
    """Find whether the chips run free, and track their sampling phases."""
    if period is not None and not period > 0.0:
        raise InputError(f"an internal period of {period:g} s", expected="a positive time")
    size = np.linalg.norm(slope, axis=1)
    good = np.isfinite(residual).all(axis=(1, 2)) & np.isfinite(size)
    # motion in which a delay of a tenth of a millisecond is worth as much as the noise
    good &= np.nan_to_num(size) > noise / 1e-3
    if np.count_nonzero(good) < LEAST:
        return None
    stamps, length = time[good], size[good]
    unit = slope[good] / length[:, None]
    seen = -np.einsum("nki,ni->nk", residual[good], unit) / length[:, None]
    k = seen.shape[1]
    scale = 1.0 - 1.0 / k
    step = float(np.median(np.diff(time)))
    if before is None:
        amplitude, beat = _beats(stamps, seen, length)
        value = float(np.median(amplitude)) * np.pi / scale
    else:
        beat, value = before.beat.copy(), before.period
    value = min(value if period is None else period, step)
    blocks, index = np.unique(((stamps - time[0]) // BLOCK).astype(np.int64), return_inverse=True)
    age = np.full(seen.shape, 0.5 * value)
    state = _State(beat, np.zeros((blocks.size, k)), np.ones((blocks.size, k)), np.zeros(k))
    for turn in range(ROUNDS):
        for i in range(k):
            # residuals are against the mean, in which this chip has its share
            own = (seen[:, i] + (age.sum(axis=1) - age[:, i]) / k) / scale
            weight = 1.0 / ((noise / length) ** 2 + (SHARE * value) ** 2)
            known = turn > 0 or before is not None
            signs = (float(np.sign(state.beat[i])) or 1.0,) if known else (1.0, -1.0)
            _track_one(state, i, signs, stamps - time[0], own, weight, value, index)
        age = _ages(state, stamps, time[0], index, value)
        if period is None:
            value = min(_period(seen, age, length, value), step)
            age = _ages(state, stamps, time[0], index, value)
    if float(np.median(state.evidence)) < EVIDENCE:
        return None
    moved = age - age.mean(axis=1, keepdims=True)
    left = (seen - moved) * length[:, None]
    spread = 1.4826 * float(np.median(np.abs(left)))
    information = np.sum((moved * length[:, None]) ** 2) / spread**2
    return PollingTrack(
        value, value / np.sqrt(information), state.beat, float(time[0]),
        time[0] + (blocks + 0.5) * BLOCK, state.phase, state.phase_sd, state.evidence,
    )  # fmt: skip


@dataclass(slots=True)
class _State:
    beat: FloatArray
    phase: FloatArray
    phase_sd: FloatArray
    evidence: FloatArray


def _beats(time: FloatArray, seen: FloatArray, length: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Amplitude and frequency, without sign, of the first harmonic of each chip's delay."""
    step = float(np.median(np.diff(time)))
    frequency = np.arange(0.0, 0.5 / step, GRID)
    weight = np.minimum(length, np.percentile(length, 75.0)) ** 2
    limit = 1.5 * np.percentile(np.abs(seen), 90.0)
    power = np.zeros((frequency.size, seen.shape[1]))
    total = np.zeros((frequency.size, seen.shape[1]))
    piece = ((time - time[0]) // SEGMENT).astype(np.int64)
    for p in np.unique(piece):
        rows = piece == p
        if np.count_nonzero(rows) < 30:
            continue
        w = weight[rows][:, None]
        y = np.clip(seen[rows], -limit, limit)
        y = y - np.sum(w * y, axis=0) / w.sum()
        wave = np.exp(-2j * np.pi * np.outer(frequency, time[rows]))
        coefficient = np.abs(wave @ (w * y)) / w.sum()
        power += w.sum() * coefficient**2
        total += w.sum()
    mean = power / np.maximum(total, 1e-300)
    best = np.argmax(mean, axis=0)
    return 2.0 * np.sqrt(mean[best, np.arange(best.size)]), frequency[best]


def _track_one(
    state: _State,
    imu: int,
    signs: tuple[float, ...],
    time: FloatArray,
    own: FloatArray,
    weight: FloatArray,
    period: float,
    index: NDArray[np.int64],
) -> None:
    """Track one chip's phase, at the beats around the present one and both signs at first."""
    blocks = len(state.phase)
    grid = (np.arange(PHASES) + 0.5) / PHASES
    middle = np.median(own)
    floor = float(np.sum(_log_likelihood(own - middle, weight)))
    pace = abs(float(state.beat[imu]))
    near = np.arange(-2, 3) * (0.3 * GRID) if len(signs) > 1 else np.zeros(1)
    best = -np.inf
    for sign in signs:
        for off in near:
            beat = sign * (pace + off)
            table = np.zeros((blocks, PHASES))
            for j, start in enumerate(grid):
                error = own - period * np.mod(beat * time + start, 1.0)
                table[:, j] = np.bincount(index, _log_likelihood(error, weight), minlength=blocks)
            likelihood, posterior = _smooth(table)
            if likelihood > best:
                best, kept = likelihood, (beat, posterior)
    beat, posterior = kept
    mean = posterior @ np.exp(2j * np.pi * grid)
    phase = np.unwrap(np.angle(mean)) / (2.0 * np.pi)
    length = np.clip(np.abs(mean), 1e-6, 1.0 - 1e-9)
    spread = np.sqrt(-2.0 * np.log(length)) / (2.0 * np.pi)
    # what the phase drifts evenly belongs to the beat
    if blocks > 3:
        moments = np.bincount(index, time, minlength=blocks) / np.bincount(index, minlength=blocks)
        drift = float(np.polyfit(moments, phase, 1, w=1.0 / (spread + 0.5 / PHASES))[0])
        beat, phase = beat + drift, phase - drift * moments
    state.beat[imu], state.phase[:, imu], state.phase_sd[:, imu] = beat, phase, spread
    state.evidence[imu] = best - floor


def _log_likelihood(error: FloatArray, weight: FloatArray) -> FloatArray:
    return np.asarray(-0.5 * (FREEDOM + 1.0) * np.log1p(error**2 * weight / FREEDOM))


def _smooth(table: FloatArray) -> tuple[float, FloatArray]:
    """Forward-backward smoothing of a phase that wanders around a circle."""
    blocks, phases = table.shape
    lag = np.minimum(np.arange(phases), phases - np.arange(phases)) / phases
    kernel = np.exp(-0.5 * (lag / WANDER) ** 2)
    offsets = np.subtract.outer(np.arange(phases), np.arange(phases)) % phases
    spread = kernel[offsets] / kernel.sum()  # symmetric
    top = table.max(axis=1, keepdims=True)
    likelihood = np.exp(table - top)
    forward = np.empty_like(table)
    probability, total = np.full(phases, 1.0 / phases), float(top.sum())
    for b in range(blocks):
        probability = np.maximum(spread @ probability, 1e-30) * likelihood[b]
        norm = float(probability.sum())
        total += np.log(norm)
        probability = probability / norm
        forward[b] = probability
    backward = np.full(phases, 1.0 / phases)
    posterior = np.empty_like(table)
    for b in range(blocks - 1, -1, -1):
        posterior[b] = forward[b] * backward
        posterior[b] /= posterior[b].sum()
        backward = np.maximum(spread @ (backward * likelihood[b]), 1e-30)
        backward /= backward.sum()
    return total, posterior


def _ages(
    state: _State, time: FloatArray, origin: float, index: NDArray[np.int64], period: float
) -> FloatArray:
    cycles = state.phase[index] + state.beat * (time - origin)[:, None]
    return np.asarray(period * np.mod(cycles, 1.0))


def _period(seen: FloatArray, age: FloatArray, length: FloatArray, period: float) -> float:
    """Period by robust least squares of the delays seen on the ages in periods."""
    share = (age - age.mean(axis=1, keepdims=True)) / period
    weight = np.ones_like(seen)
    value = period
    for _ in range(8):
        w = weight * length[:, None] ** 2
        value = float(np.sum(w * share * seen) / np.sum(w * share**2))
        left = np.abs(seen - value * share) * length[:, None]
        limit = 4.685 * 1.4826 * float(np.median(left))
        weight = np.where(left < limit, (1.0 - (left / limit) ** 2) ** 2, 0.0)
    return value


def sharpened_slope(
    residual: FloatArray, relative_delay: FloatArray, slope: FloatArray, noise: float
) -> FloatArray:
    """Return the derivative of the rate, as the polled chips themselves show it.

    Chips that are read at one instant, but sampled some tenths of a millisecond apart, hold the
    derivative between them: also that of motion too fast for the reading rate.
    """
    shown, weight = own_derivative(residual, relative_delay, slope, noise)
    both = weight[:, None] * shown + (1.0 - weight[:, None]) * slope
    return np.asarray(np.where(np.isfinite(both), both, slope))


def own_derivative(
    residual: FloatArray, relative_delay: FloatArray, slope: FloatArray, noise: float
) -> tuple[FloatArray, FloatArray]:
    """Return the derivative that polled chips show between them, and what it is worth."""
    energy = np.sum(relative_delay**2, axis=1)
    spread = np.median(energy[energy > 0.0]) if (energy > 0.0).any() else 1.0
    energy = np.maximum(energy, 1e-3 * spread)
    shown = -np.einsum("nk,nki->ni", relative_delay, residual) / energy[:, None]
    own = noise**2 / energy
    size = np.linalg.norm(slope, axis=1)
    good = np.isfinite(size) & np.isfinite(shown).all(axis=1)
    if np.count_nonzero(good) < LEAST:
        return shown, np.zeros(size.size)
    apart = np.linalg.norm(shown - slope, axis=1)[good]
    order = np.argsort(size[good])
    parts = np.array_split(order, 12)
    middle = np.array([np.median(size[good][p]) for p in parts])
    error = np.array([(np.median(apart[p]) / 1.5382) ** 2 for p in parts])
    error = np.maximum(error - np.median(own), 1e-3 * np.median(own))
    variance = np.interp(np.nan_to_num(size), middle, np.maximum.accumulate(error))
    return shown, np.asarray(variance / (variance + own))
