"""Lines of a turning wheel in the vibration that an IMU feels, and how likely a speed makes them.

A wheel that is not quite round or balanced shakes a vehicle at its turning rate and at multiples of
it. In the record of an IMU they are weak lines at k cycles a circumference. Where the way over
ground is known, a Fourier transform over the way instead of time gathers each of them in one place,
its order (cycles per metre), whatever the speed does; where it is known up to an error of speed,
the lines appear shifted by that error times their order. Engines make lines as well, at orders of
their own that change with the gear.

Periodograms over their local background are exponentially distributed with mean one; where there
is a line of relative power s, with mean 1 + s (Percival, Walden, Spectral Analysis for Univariate
Time Series, sections 5.3 and 10.11, Rayleigh line in noise).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.types import FloatArray

# length of a block of vibration (s): two or three turns of a wheel at walking pace, twenty on a
# fast road, and short enough for the error of acceleration to stay what it is
BLOCK_SECONDS = 4.0
# multiples of the turning rate that are looked at
HARMONICS = 6
# turns per metre of wheels between 0.4 and 1.0 m of diameter
ORDERS = np.exp(np.arange(np.log(0.318), np.log(0.80), 1e-3))
# the order spectrum that is remembered, cycles per metre, and how many of its places make up the
# background of one
ORDER_STEP = 0.004
SPECTRUM_ORDERS = np.arange(0.28, HARMONICS * 0.80 + 0.1, ORDER_STEP)
BACKGROUND_ORDERS = 61
# blocks that are remembered: ten minutes
MOST_BLOCKS = 300
# largest ratio of a periodogram to its background that counts
LARGEST_RATIO = 10.0
# evidence of one harmonic, all channels together, counts up to this log-likelihood: what looks like
# a line of the wheel may be one of something else, which all channels feel at once
LARGEST_EVIDENCE = 4.0
# blocks of no lines that every speed is taken to have seen already
PRIOR_BLOCKS = 3.0
# the strength of lines changes over some m/s
SPEED_WIDTH = 2.0
# lines above this share of the sampling rate are left out
HIGHEST_SHARE = 0.47
# blocks, score and ratio of the score to that of any other circumference that are asked for
FEWEST_BLOCKS = 8
LEAST_SCORE = 40.0
LEAST_RATIO = 1.5


@dataclass(frozen=True, slots=True, eq=False)
class VibrationBlock:
    """A stretch of vibration and the way of the vehicle in it."""

    time: FloatArray  # (n,): seconds before the end of the block, negative, the last one zero
    vibration: FloatArray  # (n, c): channels of an IMU, mean and trend removed, tapered (sine)
    way: FloatArray  # (n,): metres, from anywhere
    speed: float  # mean, m/s
    rate: float  # samples a second


def vibration_block(time: FloatArray, channels: FloatArray, speed: FloatArray) -> VibrationBlock:
    """Prepare a block."""
    n = time.size
    span = time[-1] - time[0]
    since = np.linspace(-0.5, 0.5, n)
    values = channels - channels.mean(axis=0)
    values -= np.outer(since, (since @ values) / (since @ since))
    taper = np.sin(np.pi * (np.arange(n) + 0.5) / n)
    way = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * np.diff(time))])
    return VibrationBlock(
        time=time - time[-1],
        vibration=values * taper[:, None],
        way=way - way[n // 2],
        speed=float(speed.mean()),
        rate=(n - 1) / span,
    )


class WheelMemory:
    """What was learned of a wheel's lines while the speed was known.

    Parameters
    ----------
    channels : int
        Of the IMU.

    Attributes
    ----------
    order : float or None
        Turns per metre, once they are known.
    """

    __slots__ = ("_count", "_spectra", "_speeds", "order")

    def __init__(self, channels: int = 6) -> None:
        self._spectra = np.ones((MOST_BLOCKS, SPECTRUM_ORDERS.size, channels))
        self._speeds = np.zeros(MOST_BLOCKS)
        self._count = 0
        self.order: float | None = None

    def learn(self, block: VibrationBlock) -> None:
        """Take in a block whose speed is known, and look for the wheel anew."""
        place = self._count % MOST_BLOCKS
        seen = int(np.searchsorted(SPECTRUM_ORDERS, HIGHEST_SHARE * block.rate / block.speed))
        self._spectra[place] = 1.0
        self._spectra[place, :seen] = _over_background(_order_spectrum(block, seen))
        self._speeds[place] = block.speed
        self._count += 1
        if self._count >= FEWEST_BLOCKS and self._count % 4 == 0:
            self.order = self._find()

    def strengths(self, speed: float) -> FloatArray:
        """Relative powers of the lines to be expected, from blocks at similar speeds."""
        assert self.order is not None
        used = min(self._count, MOST_BLOCKS)
        weight = np.exp(-0.5 * ((self._speeds[:used] - speed) / SPEED_WIDTH) ** 2)
        place = (self.order * np.arange(1, HARMONICS + 1) - SPECTRUM_ORDERS[0]) / ORDER_STEP
        left = place.astype(np.int64)
        share = (place - left)[:, None]
        at_lines = self._spectra[:used, left] * (1.0 - share)
        at_lines += self._spectra[:used, left + 1] * share
        excess = np.tensordot(weight, at_lines - 1.0, 1) / (weight.sum() + PRIOR_BLOCKS)
        lines: FloatArray = np.maximum(excess.T, 0.0)
        return lines

    def log_likelihood(
        self, block: VibrationBlock, shifts: FloatArray, accelerations: FloatArray
    ) -> FloatArray:
        """How much more likely an error of speed makes a block than no line at all."""
        assert self.order is not None
        total = np.zeros((accelerations.size, shifts.size))
        strength = self.strengths(block.speed)
        for k in range(1, HARMONICS + 1):
            order = k * self.order
            if order * block.speed > HIGHEST_SHARE * block.rate:
                break
            used = strength[:, k - 1] > 0.1
            if not used.any():
                continue
            power, frequency = _around_line(
                block, used, order, self.order * block.speed, shifts, accelerations
            )
            s = strength[used, k - 1]
            gain = (power * (s / (1.0 + s)) - np.log1p(s)).sum(axis=2)
            # bounded, yet the top of a strong line stays one
            gain = LARGEST_EVIDENCE * np.tanh(gain / LARGEST_EVIDENCE)
            for a in range(accelerations.size):
                total[a] += np.interp(order * shifts, frequency, gain[a])
        return total

    def _find(self) -> float | None:
        """Turns per metre whose multiples carry power, slow and fast; as before if none stands out.

        Every half of the blocks, by speed, must show them without their two strongest harmonics,
        and odd harmonics must take part: an engine in one gear does not pass for a wheel.
        """
        used = min(self._count, MOST_BLOCKS)
        rank = np.argsort(self._speeds[:used], kind="stable")
        score, total = np.full(ORDERS.size, np.inf), np.zeros(ORDERS.size)
        for half in np.array_split(rank, 2):
            mean = np.maximum(self._spectra[half].mean(axis=0), 1.0)
            gain = half.size * (mean - 1.0 - np.log(mean)).sum(axis=1)
            by_harmonic = np.array(
                [np.interp(k * ORDERS, SPECTRUM_ORDERS, gain) for k in range(1, HARMONICS + 1)]
            )
            everything = by_harmonic.sum(axis=0)
            odd = by_harmonic[::2].sum(axis=0) > 0.2 * everything
            weaker = np.sort(by_harmonic, axis=0)[:-2].sum(axis=0)
            score = np.minimum(score, np.where(odd, weaker, 0.0))
            total += everything
        best = int(np.argmax(score))
        far = np.abs(np.log(ORDERS / ORDERS[best])) > 0.05
        if score[best] < max(LEAST_SCORE, LEAST_RATIO * float(score[far].max())):
            return self.order
        near = np.abs(np.log(ORDERS / ORDERS[best])) < 0.008
        return float(ORDERS[near][np.argmax(total[near])])


def _order_spectrum(block: VibrationBlock, count: int) -> FloatArray:
    """Periodogram (count, c) over the way at the first of `SPECTRUM_ORDERS`."""
    power = np.empty((count, block.vibration.shape[1]))
    turn = np.exp(-2j * np.pi * SPECTRUM_ORDERS[0] * block.way)
    step = np.exp(-2j * np.pi * ORDER_STEP * block.way)
    chunk = 64
    waves = np.empty((chunk, block.way.size), dtype=np.complex128)
    for start in range(0, count, chunk):
        size = min(chunk, count - start)
        for i in range(size):
            waves[i] = turn
            turn = turn * step
        power[start : start + size] = np.abs(waves[:size] @ block.vibration) ** 2
    return power


def _over_background(power: FloatArray) -> FloatArray:
    """Ratio of a spectrum to its running median, which a line hardly moves."""
    if len(power) < BACKGROUND_ORDERS:
        return np.ones_like(power)
    windows = np.lib.stride_tricks.sliding_window_view(power, BACKGROUND_ORDERS, axis=0)[::10]
    middle = np.arange(len(windows)) * 10 + 0.5 * (BACKGROUND_ORDERS - 1)
    median = np.median(windows, axis=2) / np.log(2.0)
    every = np.arange(len(power))
    background = np.column_stack([np.interp(every, middle, m) for m in median.T])
    ratio: FloatArray = np.minimum(power / np.maximum(background, 1e-300), LARGEST_RATIO)
    return ratio


def _around_line(
    block: VibrationBlock,
    used: NDArray[np.bool_],
    order: float,
    spacing: float,
    shifts: FloatArray,
    accelerations: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Periodograms over background (a, f, c) around one line, and their frequencies (f,) in Hz.

    The line is turned to zero frequency, the band around it decimated, and errors of acceleration
    taken out as a quadratic phase.
    """
    half = max(0.4 * spacing, 1.0)
    length = -float(block.time[0])
    bend = order * float(np.abs(accelerations).max()) * length
    band = max(1.1 * order * float(np.abs(shifts).max()), half) + bend + 1.0
    group = max(int(block.rate / (2.6 * band)), 1)
    count = block.time.size // group
    first = block.time.size - count * group
    base = block.vibration[:, used] * np.exp(-2j * np.pi * order * block.way)[:, None]
    base = base[first:].reshape(count, group, -1).sum(axis=1)
    when = block.time[first:].reshape(count, group).mean(axis=1)
    phase = np.exp(-1j * np.pi * order * accelerations[:, None] * when**2)
    size = 1 << int(np.ceil(np.log2(4 * count)))
    power = np.abs(np.fft.fft(base[None] * phase[:, :, None], size, axis=1)) ** 2
    power = np.fft.fftshift(power, axes=1)
    frequency = np.fft.fftshift(np.fft.fftfreq(size, group / block.rate))
    power /= (np.sinc(frequency * group / block.rate) ** 2)[None, :, None]
    straight = int(np.argmin(np.abs(accelerations)))
    background = np.median(power[straight, np.abs(frequency) < half], axis=0) / np.log(2.0)
    ratio = np.minimum(power / np.maximum(background, 1e-300), LARGEST_RATIO)
    return ratio, frequency
