"""Power spectral density: Welch, then averages over a constant number of bins an octave."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from schuler.curves.confidence import chi_square_bounds
from schuler.curves.finite_signal import checked_rate, finite_samples
from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.types import FloatArray, IntArray

_FIRST_BIN = 2
_NEIGHBOURS = 2
_SHORTEST_SEGMENT = 16
_LONGEST_SEGMENT = 2**22
"""More would take memory beside a long record, and show only what the Allan curve shows."""
_MOST_TREND = 1_000_000
_STRAIGHT = 0.95


@dataclass(frozen=True, slots=True, eq=False)
class SpectrumCurve(Exportable):
    """Power spectral density against frequency.

    Parameters
    ----------
    frequency : (b,) ndarray
        Mean frequency of every point in Hz.
    density : (b,) ndarray
        (unit of the signal)²/Hz.
    lower, upper : (b,) ndarray
        95 % chi-square limits of the density.
    degrees_of_freedom : (b,) ndarray
        Equivalent, of every point.
    first, count : (b,) ndarray of int
        The bins of the segment's Fourier transform that were averaged.
    onesided : bool
        True: all power is at positive frequencies, twice the two-sided density.
    rate : float
        Samples a second.
    samples : int
        Length of the signal.
    segment : int
        Samples in a segment.
    segments : int
        How many, half overlapping.
    flags : tuple of str
        "constant"; "trend" where a straight line explains 95 % of the variance: a ramp is no
        noise, and its spectrum depends on the segment.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import power_spectral_density
    >>> signal = np.random.default_rng(1).standard_normal(100_000)
    >>> power_spectral_density(signal, 100.0, onesided=True).onesided
    True
    """

    JSON = (
        "frequency_hz=frequency density lower_95=lower upper_95=upper degrees_of_freedom "
        "onesided rate_hz=rate samples segment segments flags"
    )

    frequency: FloatArray
    density: FloatArray
    lower: FloatArray
    upper: FloatArray
    degrees_of_freedom: FloatArray
    first: IntArray
    count: IntArray
    onesided: bool
    rate: float
    samples: int
    segment: int
    segments: int
    flags: tuple[str, ...] = ()

    @property
    def duration(self) -> float:
        """Length of the record in s."""
        return self.samples / self.rate

    @property
    def two_sided(self) -> FloatArray:
        """Two-sided density S(f), that of N², B²/(2 pi f) and K²/(2 pi f)²."""
        return self.density / (2.0 if self.onesided else 1.0)


def power_spectral_density(
    signal: ArrayLike,
    rate: float,
    *,
    onesided: bool,
    segment: int | None = None,
    bins_per_octave: int | None = 8,
) -> SpectrumCurve:
    """Return Welch's density with the same number of points in every octave.

    Parameters
    ----------
    signal : (n,) array_like
        Samples in any unit.
    rate : float
        Samples a second.
    onesided : bool
        Which of the two conventions `.density` follows; there is no default, because reading a
        density of noise from the wrong one is wrong by sqrt(2).
    segment : int, optional
        Samples in a segment. Default: the largest power of two that fits the record twice, 2**22
        at most (12 h at 100 Hz): long segments keep the low frequencies, and averaging over bins
        makes the high ones as sure as short segments would.
    bins_per_octave : int or None
        Points an octave; None leaves all bins alone, from zero, as `scipy.signal.welch` returns
        them.

    Returns
    -------
    SpectrumCurve
        From the third bin on (the Hann window and the removal of the mean bend the first two).

    Raises
    ------
    InputError
        Not (n,) or not finite, fewer than 32 samples, an impossible rate or segment.

    Notes
    -----
    Spec 2.2, S004 (12): Hann window, half overlap, mean of each segment removed. Degrees of
    freedom from the overlap of segments and of neighbouring bins (the window correlates them:
    2 x bins x segments x 0.95 would count nearly everything twice).

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import power_spectral_density
    >>> rate = np.random.default_rng(1).standard_normal(100_000)
    >>> curve = power_spectral_density(rate, 100.0, onesided=False)
    >>> round(float(np.median(curve.density)), 2)
    0.01
    """
    values = finite_samples(signal, shortest=2 * _SHORTEST_SEGMENT)
    rate = checked_rate(rate)
    length = _segment(segment, values.size)
    shift = float(values.mean())
    low, high = float(values.min()), float(values.max())
    scale, constant = max(high - shift, shift - low), low == high
    density = _welch(values, shift, np.inf if constant else scale, length, rate)
    flags = ("constant",) if constant else _trend(values, shift, scale)
    cut = _Cut(length, 1 + (values.size - length) // (length - length // 2), values.size, rate)
    density *= 1.0 if constant else scale**2
    return spectrum_of(density, cut, onesided, bins_per_octave, flags)


class _Cut(NamedTuple):
    """How a record was cut into half-overlapping segments."""

    length: int
    segments: int
    samples: int
    rate: float


def spectrum_of(
    density: FloatArray,
    cut: tuple[int, int, int, float],
    onesided: bool,
    bins_per_octave: int | None = 8,
    flags: tuple[str, ...] = (),
) -> SpectrumCurve:
    """Average Welch's one-sided density over octaves; cut: length, segments, samples, rate."""
    length, segments, samples, rate = cut
    raw = np.arange(density.size) * (rate / length)
    if bins_per_octave is None:
        first, count = np.arange(raw.size), np.ones(raw.size, dtype=np.int64)
    else:
        first, count = _octave_groups(raw.size, bins_per_octave)
    halves = np.full(raw.size, 0.5)
    halves[0] = 1.0
    if length % 2 == 0:
        halves[-1] = 1.0  # neither zero nor the Nyquist frequency has a mirror image
    weight = np.ones(raw.size) if onesided and bins_per_octave is None else halves
    averaged = np.add.reduceat(density * weight, first) / count
    if onesided and bins_per_octave is not None:
        averaged *= 2.0
    freedom = group_degrees_of_freedom(count, segments)
    down, up = chi_square_bounds(freedom)
    return SpectrumCurve(
        frequency=np.add.reduceat(raw, first) / count,
        density=averaged,
        lower=averaged * down**2,
        upper=averaged * up**2,
        degrees_of_freedom=freedom,
        first=first.astype(np.int64),
        count=count,
        onesided=onesided,
        rate=rate,
        samples=samples,
        segment=length,
        segments=segments,
        flags=flags,
    )


def _welch(values: FloatArray, shift: float, scale: float, length: int, rate: float) -> FloatArray:
    """One-sided density of (values - shift) / scale: `scipy.signal.welch`, a segment in memory."""
    window = segment_window(length)
    power = np.zeros(length // 2 + 1)
    starts = range(0, values.size - length + 1, length - length // 2)
    for start in starts:
        add_segment(power, (values[start : start + length] - shift) / scale, window)
    return one_sided(power, len(starts), rate, length)


def segment_window(length: int) -> FloatArray:
    """Return the Hann window of Welch's segments."""
    from scipy.signal.windows import hann

    return np.asarray(hann(length, sym=False))


def add_segment(power: FloatArray, segment: FloatArray, window: FloatArray) -> None:
    """Add the squared transform of a segment, which is overwritten, to those before."""
    from scipy.fft import rfft

    segment -= segment.mean()
    segment *= window
    transform = rfft(segment, overwrite_x=True)
    power += transform.real**2
    power += transform.imag**2


def one_sided(power: FloatArray, segments: int, rate: float, length: int) -> FloatArray:
    """Return the one-sided density of the squared transforms of so many segments."""
    window = segment_window(length)
    density = power * (2.0 / (rate * float(window @ window) * segments))
    density[0] *= 0.5
    if length % 2 == 0:
        density[-1] *= 0.5
    return np.asarray(density)


def _segment(wanted: int | None, samples: int) -> int:
    if wanted is None:
        return int(min(2 ** (int(samples // 2).bit_length() - 1), _LONGEST_SEGMENT))
    if not _SHORTEST_SEGMENT <= wanted <= samples:
        raise InputError(
            f"segment of {wanted} samples", expected=f"from {_SHORTEST_SEGMENT} to {samples}"
        )
    return int(wanted)


def _octave_groups(bins: int, per_octave: int) -> tuple[IntArray, IntArray]:
    """First bin and number of bins of every point."""
    if per_octave < 1:
        raise InputError(f"{per_octave} bins an octave", expected="at least 1")
    octaves = np.log2(bins / _FIRST_BIN)
    edges = _FIRST_BIN * 2.0 ** (np.arange(int(np.ceil(octaves * per_octave)) + 1) / per_octave)
    first = np.unique(np.ceil(edges - 1e-9).astype(np.int64))
    first = first[first < bins]
    count = np.diff(np.append(first, bins))
    if first.size > 1 and count[-1] < count[-2] // 2:
        # what is left below the Nyquist frequency joins the last full point
        count[-2] += count[-1]
        first, count = first[:-1], count[:-1]
    return first, count


def _trend(values: FloatArray, shift: float, scale: float) -> tuple[str, ...]:
    """Whether a straight line explains most of a signal; a million samples spread over it tell."""
    unit = (values[:: max(1, values.size // _MOST_TREND)] - shift) / scale
    time = np.linspace(-1.0, 1.0, unit.size)
    power = float(unit @ unit)
    explained = float(time @ unit) ** 2 / (float(time @ time) * power)
    return ("trend",) if explained > _STRAIGHT else ()


def _bin_correlation(segments: int) -> FloatArray:
    """Squared correlation of Hann bins 0, 1, 2 apart, averaged over pairs of segments."""
    size = 64
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(size) / size)
    power = np.sum(window**2)
    out = np.zeros(_NEIGHBOURS + 1)
    for apart in (0, 1):
        shared = window[: size - apart * size // 2] * window[apart * size // 2 :]
        turn = np.arange(shared.size) / size
        for bins in range(_NEIGHBOURS + 1):
            overlap = np.abs(np.sum(shared * np.exp(2j * np.pi * bins * turn)) / power) ** 2
            out[bins] += overlap if apart == 0 else 2.0 * overlap * (1.0 - 1.0 / segments)
    return out / segments


def group_degrees_of_freedom(count: IntArray, segments: int) -> FloatArray:
    """Equivalent degrees of freedom of averages over bins and half-overlapping Hann segments."""
    correlation = _bin_correlation(segments)
    bins = count.astype(np.float64)
    variance = bins * correlation[0]
    for apart in range(1, _NEIGHBOURS + 1):
        variance = variance + 2.0 * np.maximum(bins - apart, 0.0) * correlation[apart]
    return np.asarray(2.0 * bins**2 / variance, dtype=np.float64)


def group_covariance(curve: SpectrumCurve) -> FloatArray:
    """Covariance of the relative errors of the points of an averaged density."""
    correlation = _bin_correlation(curve.segments)
    out = np.diag(2.0 / curve.degrees_of_freedom)
    last = curve.first + curve.count
    for k in range(len(last) - 1):
        for other in range(k + 1, min(k + 1 + _NEIGHBOURS, len(last))):
            shared = 0.0
            for apart in range(1, _NEIGHBOURS + 1):
                # pairs (i, i + apart) with i in the one and i + apart in the other
                low = max(curve.first[k], curve.first[other] - apart)
                high = min(last[k], last[other] - apart)
                shared += max(int(high - low), 0) * correlation[apart]
            out[k, other] = out[other, k] = shared / (curve.count[k] * curve.count[other])
    return out
