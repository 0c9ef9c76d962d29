"""Power spectral density of signals longer than memory: pieces in, sums that add up."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from schuler.curves.spectrum import (
    SpectrumCurve,
    add_segment,
    one_sided,
    segment_window,
    spectrum_of,
)
from schuler.errors import InputError
from schuler.types import FloatArray

SEGMENT = 1 << 16
"""Samples of a segment unless told otherwise: what is slower the Allan curve shows."""


@dataclass(frozen=True, slots=True, eq=False)
class SpectrumSums:
    """Squared transforms of Welch's segments of one or more stretches of a signal."""

    power: FloatArray  # (segment // 2 + 1, m): sums over the segments
    segments: int  # how many
    segment: int  # samples of each
    rate: float  # samples a second
    samples: int  # of all stretches

    def __add__(self, other: SpectrumSums) -> SpectrumSums:
        """Return the sums of both, which have to be of one rate, segment and as many channels."""
        if self.power.shape != other.power.shape or self.segment != other.segment:
            raise InputError(
                f"spectra of {self.power.shape[1]} channels in segments of {self.segment} samples "
                f"and of {other.power.shape[1]} in segments of {other.segment}",
                expected="the same in all parts",
            )
        return replace(
            self,
            power=self.power + other.power,
            segments=self.segments + other.segments,
            samples=self.samples + other.samples,
        )

    def curve(self, channel: int, *, onesided: bool) -> SpectrumCurve:
        """Return the density of a channel, as `power_spectral_density` with this segment does.

        Parameters
        ----------
        channel : int
            Column.
        onesided : bool
            Which convention.

        Returns
        -------
        SpectrumCurve
            With 95 % intervals.

        Raises
        ------
        InputError
            No stretch as long as a segment.
        """
        if not self.segments:
            raise InputError(
                f"no stretch holds {self.segment} samples", expected="one as long as a segment"
            )
        density = one_sided(self.power[:, channel], self.segments, self.rate, self.segment)
        cut = (self.segment, self.segments, self.samples, self.rate)
        return spectrum_of(density, cut, onesided)


class SpectrumAccumulator:
    """Collects a signal piece by piece; memory of two segments a channel.

    Parameters
    ----------
    rate : float
        Samples a second.
    channels : int
        Columns of the signal.
    segment : int
        Samples of a segment.
    """

    def __init__(self, rate: float, channels: int = 1, segment: int = SEGMENT) -> None:
        if segment < 16:
            raise InputError(f"segment of {segment} samples", expected="at least 16")
        self._window = segment_window(segment)
        self._power = np.zeros((channels, segment // 2 + 1))
        self._left = np.empty((0, channels))
        self._segments = self._samples = 0
        self.rate = rate

    def add(self, values: FloatArray) -> None:
        """Add samples (n, m) that follow those before them."""
        length = self._window.size
        self._samples += len(values)
        whole = np.concatenate([self._left, values])
        start = 0
        for start in range(0, len(whole) - length + 1, length - length // 2):
            for j, power in enumerate(self._power):
                add_segment(power, whole[start : start + length, j].copy(), self._window)
            self._segments += 1
        if len(whole) >= length:
            start += length - length // 2
        self._left = whole[start:]

    def pause(self) -> None:
        """End a stretch."""
        self._left = self._left[:0]

    def sums(self) -> SpectrumSums:
        """Return the sums of all that was added."""
        return SpectrumSums(
            self._power.T.copy(), self._segments, self._window.size, self.rate, self._samples
        )
