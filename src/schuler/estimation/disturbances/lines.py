"""Lines of vibration: found against the smooth spectrum around them, and taken out.

A line is a bin of Welch's spectrum that stands above a running median of its neighbours further
than chance allows in the whole record. A steady line is one sinusoid, taken out by least squares
on all samples; a wandering one fills a band, which is refilled at the level of its neighbours.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from schuler.types import FloatArray

_SEGMENTS = 12
_LONGEST_SEGMENT = 65_536
_FIRST_BIN = 12
_CHANCE = 1e-3
_NARROWEST, _WIDEST, _SHARE, _APART = 4, 64, 3, 8
_MOST_LINES = 8
_FEWEST_SAMPLES = 1200


@dataclass(frozen=True, slots=True)
class Line:
    """A line in the spectrum of a signal."""

    frequency: float  # hz, as the samples show it
    # of the sinusoid; of a wandering line, sqrt(2) times its root mean square, in u.
    amplitude: float
    # frequency_error, amplitude_error: standard errors
    frequency_error: float
    amplitude_error: float
    steady: bool  # one sinusoid throughout, not a band
    rate: float  # samples a second

    @property
    def aliases(self) -> tuple[float, float]:
        """Vibration of these frequencies would look the same, Hz."""
        return self.rate - self.frequency, self.rate + self.frequency

    @property
    def words(self) -> str:
        """The line for people, without its amplitude."""
        low, high = self.aliases
        return (
            f"a {'line' if self.steady else 'wandering line'} at {self.frequency:.6g} Hz "
            f"(or its aliases, {low:.6g} and {high:.6g} Hz)"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain Python for JSON, SI."""
        return {
            "frequency_hz": self.frequency,
            "frequency_error_hz": self.frequency_error,
            "amplitude": self.amplitude,
            "amplitude_error": self.amplitude_error,
            "steady": self.steady,
            "aliases_hz": list(self.aliases),
        }


@dataclass(frozen=True, slots=True, eq=False)
class WithoutLines:
    """A signal less its lines."""

    signal: FloatArray
    lines: tuple[Line, ...]


def without_lines(signal: FloatArray, rate: float) -> WithoutLines:
    """Find lines and take them out, the strongest first, until none is left."""
    values = signal
    found: list[Line] = []
    while values.size >= _FEWEST_SAMPLES and len(found) < _MOST_LINES:
        spectrum = _Spectrum.of(values)
        peak = spectrum.strongest()
        if peak is None:
            break
        low, high = spectrum.extent(peak)
        taken = _take_sinusoid(values, rate, low, high)
        after = _Spectrum.of(taken[0])
        if after.strongest(low, high) is None:
            values = taken[0]
            found.append(taken[1])
            continue
        filled, rms = _refill(values, low, high)
        width = (high - low) * rate / 4.0
        line = replace(
            taken[1],
            amplitude=math.sqrt(2.0) * rms,
            frequency=0.5 * (low + high) * rate,
            frequency_error=width,
            steady=False,
        )
        if rms <= 0.0 or filled is values:
            break
        values = filled
        found.append(line)
    return WithoutLines(values, tuple(_joined(found)))


def _joined(found: list[Line]) -> list[Line]:
    """Take the fragments of one wandering line together."""
    out: list[Line] = []
    for line in found:
        for k, other in enumerate(out):
            reach = 4.0 * (line.frequency_error + other.frequency_error)
            if not (line.steady or other.steady) and abs(line.frequency - other.frequency) < reach:
                out[k] = replace(other, amplitude=math.hypot(line.amplitude, other.amplitude))
                break
        else:
            out.append(line)
    return out


@dataclass(frozen=True, slots=True, eq=False)
class _Spectrum:
    """Averaged spectrum over a running median of its logarithm, by bin."""

    ratio: FloatArray
    segment: int
    threshold: float

    @classmethod
    def of(cls, values: FloatArray) -> _Spectrum:
        from scipy.stats import chi2

        segment = min(values.size // _SEGMENTS, _LONGEST_SEGMENT)
        density = _density(values, segment)
        logs = np.log(np.maximum(density, 1e-300))
        smooth = _running_median(logs)
        # twice the segments, half overlapping: about 1.9 times independent ones with a Hann window
        freedom = 2.0 * 1.9 * (values.size // segment) * 0.95
        bins = max(density.size - _FIRST_BIN, 1)
        limit = float(chi2.isf(_CHANCE / bins, freedom)) / float(chi2.median(freedom))
        # a median of few neighbours errs itself
        return cls(np.exp(logs - smooth), segment, limit * 1.25)

    def strongest(self, low: float = 0.0, high: float = 0.5) -> int | None:
        """The bin that stands out most, among cycles a sample from low to high."""
        cycles = np.arange(self.ratio.size) / self.segment
        seen = (cycles >= low) & (cycles <= high)
        seen[:_FIRST_BIN] = False
        seen[-1] = False
        if not seen.any():
            return None
        best = int(np.argmax(np.where(seen, self.ratio, 0.0)))
        return best if self.ratio[best] > self.threshold else None

    def extent(self, peak: int) -> tuple[float, float]:
        """Cycles a sample between which the smoothed ratio is above one about a bin."""
        kernel = np.full(3, 1.0 / 3.0)
        above = np.convolve(self.ratio, kernel, mode="same") > 1.15
        low = high = peak
        while low > 1 and above[low - 1]:
            low -= 1
        while high < self.ratio.size - 2 and above[high + 1]:
            high += 1
        low, high = min(low, peak - 2), max(high, peak + 2)
        return low / self.segment, min(high / self.segment, 0.5)


def _density(values: FloatArray, segment: int) -> FloatArray:
    """Welch's average over half overlapping Hann segments, one segment in memory at a time."""
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(segment) / segment)
    starts = range(0, values.size - segment + 1, max(segment // 2, 1))
    total, seen = np.zeros(segment // 2 + 1), np.empty(segment)
    for start in starts:
        piece = values[start : start + segment]
        np.subtract(piece, piece.mean(), out=seen)
        np.multiply(seen, window, out=seen)
        transform = np.fft.rfft(seen)
        total += transform.real**2
        total += transform.imag**2
    return np.asarray(total / len(starts))


def _running_median(logs: FloatArray) -> FloatArray:
    """Median over a window that widens with the bin: a third of it to either side, 4 to 64 bins."""
    padded = np.pad(logs, _WIDEST, mode="reflect")
    # the widest windows share nearly all their bins with their neighbours: every eighth will do
    narrow = np.arange(min(_SHARE * _WIDEST, logs.size))
    at = np.concatenate([narrow, np.arange(narrow.size, logs.size, _APART), [logs.size - 1]])
    half = np.clip(at // _SHARE, _NARROWEST, _WIDEST)
    medians = [
        float(np.partition(padded[k + _WIDEST - h : k + _WIDEST + h + 1], h)[h])
        for k, h in zip(narrow.tolist(), half.tolist(), strict=False)
    ]
    windows = np.lib.stride_tricks.sliding_window_view(padded, 2 * _WIDEST + 1)
    wide = np.partition(windows[at[narrow.size :]], _WIDEST, axis=1)[:, _WIDEST]
    return np.asarray(np.interp(np.arange(logs.size), at, np.concatenate([medians, wide])))


def _take_sinusoid(
    values: FloatArray, rate: float, low: float, high: float
) -> tuple[FloatArray, Line]:
    """Least squares of one sinusoid over the whole record, frequency found within a band."""
    from scipy.optimize import minimize_scalar

    n = values.size
    centred = values - values.mean()
    taper = np.hanning(n)
    power = np.abs(np.fft.rfft(centred * taper)) ** 2
    bins = np.arange(power.size) / n
    inside = np.flatnonzero((bins >= low) & (bins <= high))
    start = float(bins[inside[np.argmax(power[inside])]])
    index = np.arange(n) - 0.5 * (n - 1)

    def transform(cycles: float) -> complex:
        return complex(np.dot(centred, np.exp(-2j * np.pi * cycles * index)))

    best = minimize_scalar(
        lambda c: -(abs(transform(c)) ** 2),
        bounds=(start - 1.0 / n, start + 1.0 / n),
        method="bounded",
        options={"xatol": 1e-5 / n},
    )
    cycles = float(best.x)
    turn = 2.0 * np.pi * cycles * index
    design = np.column_stack([np.cos(turn), np.sin(turn)])
    size = np.linalg.solve(design.T @ design, design.T @ centred)
    amplitude = float(np.hypot(*size))
    # noise about the line: the spectrum beside it
    beside = (bins >= low - (high - low)) & (bins <= high + (high - low))
    beside &= (bins < low) | (bins > high)
    density = float(np.median(power[beside])) / math.log(2.0) / float(taper @ taper)
    # Cramér and Rao's bounds for a sinusoid in noise of this density (Rife and Boorstyn 1974)
    amplitude_error = math.sqrt(2.0 * density / n)
    frequency_error = math.sqrt(6.0 * density / n**3) / (math.pi * max(amplitude, 1e-300))
    line = Line(cycles * rate, amplitude, frequency_error * rate, amplitude_error, True, rate)
    return np.asarray(values - design @ size), line


def _refill(values: FloatArray, low: float, high: float) -> tuple[FloatArray, float]:
    """Replace a band by noise at the level of its neighbours; the rms of what was there more."""
    n = values.size
    spectrum = np.fft.rfft(values)
    bins = np.arange(spectrum.size) / n
    width = high - low
    inside = (bins >= low) & (bins <= high)
    beside = ((bins >= low - width) & (bins < low)) | ((bins > high) & (bins <= high + width))
    if not beside.any() or not inside.any():
        return values, 0.0
    power = np.abs(spectrum) ** 2
    level = float(np.median(power[beside])) / math.log(2.0)
    excess = float(power[inside].sum()) - level * int(inside.sum())
    rng = np.random.default_rng(n)
    drawn = rng.standard_normal((2, int(inside.sum()))) * math.sqrt(0.5 * level)
    spectrum[inside] = drawn[0] + 1j * drawn[1]
    rms = math.sqrt(max(2.0 * excess, 0.0)) / n
    return np.asarray(np.fft.irfft(spectrum, n)), rms
