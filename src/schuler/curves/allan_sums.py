"""Allan deviation of signals longer than memory: pieces in, sums that add up, a curve out."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.curves.allan_curve import AllanCurve, default_factors
from schuler.curves.confidence import (
    chi_square_bounds,
    local_slope,
    not_by_chance,
    power_law_degrees_of_freedom,
)
from schuler.curves.wavelet_variance import WaveletVarianceCurve, wavelet_curve
from schuler.data._checks import all_finite
from schuler.errors import InputError
from schuler.types import FloatArray

LONGEST = 1 << 16
"""Samples of a cluster up to which every cluster is used, as in memory; beyond, clusters begin
every LONGEST/2 to LONGEST part of their length, which loses nothing that could be seen."""
_PIECE = 1 << 19
_BLOCK = 4096
_GRID = np.union1d(default_factors(9 * LONGEST), 2 ** np.arange(17))
_UPPER = _GRID[_GRID > LONGEST // 2]
_WHOLE = 0.75


@dataclass(frozen=True, slots=True, eq=False)
class AllanSums:
    """Sums of squared second differences of one or more stretches of a signal.

    Those of a week are the sum of those of its days: ``monday + tuesday``.
    """

    factors: NDArray[np.int64]  # (t,): samples of a cluster
    # (t, m): sums of squared second differences of the integrated signal, divided by the cluster's
    # length squared
    squares: FloatArray
    clusters: NDArray[np.int64]  # (t,): how many of them there are
    # (t,): samples from the beginning of one cluster to that of the next
    strides: NDArray[np.int64]
    rate: float  # samples a second
    samples: int  # of all stretches

    def __add__(self, other: AllanSums) -> AllanSums:
        """Return the sums of both, which have to be of one rate and as many channels."""
        if self.squares.shape[1] != other.squares.shape[1]:
            raise InputError(
                f"{self.squares.shape[1]} and {other.squares.shape[1]} channels",
                expected="as many in all parts",
            )
        if abs(self.rate - other.rate) > 1e-3 * self.rate:
            raise InputError(
                f"parts of {self.rate:.6g} and {other.rate:.6g} Hz", expected="one rate"
            )
        long, short = (self, other) if self.factors.size >= other.factors.size else (other, self)
        squares, clusters = long.squares.copy(), long.clusters.copy()
        squares[: short.factors.size] += short.squares
        clusters[: short.factors.size] += short.clusters
        return AllanSums(
            long.factors, squares, clusters, long.strides, self.rate, self.samples + other.samples
        )

    def curve(self, share: int = 9) -> AllanCurve:
        """Return the Allan deviation with 95 % intervals.

        Parameters
        ----------
        share : int
            The longest cluster is at most this part of the record.

        Returns
        -------
        AllanCurve
            Cluster times up to a ninth of a record that came in one stretch; arrays (t, m).

        Raises
        ------
        InputError
            Not a single cluster.
        """
        held = self.clusters * self.strides >= (share - 2) * self.factors
        if not held.any():
            raise InputError(f"the signal has {self.samples} samples", expected=f"at least {share}")
        factors, clusters = self.factors[held], self.clusters[held]
        variance = self.squares[held] / (2.0 * clusters[:, np.newaxis])
        tau = factors / self.rate
        slopes = np.column_stack([local_slope(tau, v) for v in variance.T])
        slopes = not_by_chance(slopes, factors, self.samples)
        freedom = power_law_degrees_of_freedom(slopes, factors, self.samples)
        # of a record in parts fewer clusters are there than of one in one stretch
        there = clusters * self.strides[held] / (self.samples + 1.0 - 2.0 * factors)
        freedom = np.maximum(freedom * np.minimum(there, 1.0)[:, np.newaxis], 1.0)
        deviation = np.sqrt(variance)
        down, up = chi_square_bounds(freedom)
        return AllanCurve(
            tau, deviation, deviation * down, deviation * up, freedom, self.rate, self.samples
        )

    def wavelet_variance(self, channel: int) -> WaveletVarianceCurve:
        """Return the Haar wavelet variance of a channel, as `wavelet_variance` does.

        Parameters
        ----------
        channel : int
            Column.

        Returns
        -------
        WaveletVarianceCurve
            Scales 1, 2, 4, ... samples up to a quarter of a record that came in one stretch; of
            parts up to where they hold three quarters of its clusters.
        """
        octaves = self.factors & (self.factors - 1) == 0
        share = self.clusters * self.strides / np.maximum(self.samples + 1 - 2 * self.factors, 1)
        held = octaves & (self.factors <= self.samples // 4) & (share >= _WHOLE)
        variance = self.squares[held, channel] / (4.0 * self.clusters[held])
        return wavelet_curve(variance, self.factors[held], self.samples, self.rate)


class _Level:
    """The signal averaged over 2^k samples: the end of its running sum, and sums so far."""

    def __init__(self, channels: int, factors: NDArray[np.int64], piece: int) -> None:
        self.factors = factors
        self.history = np.zeros((channels, 1))
        self.waiting: list[FloatArray] = []
        self.pending = 0
        self.piece = piece
        self.squares = np.zeros((factors.size, channels))
        self.samples = 0

    def add(self, values: FloatArray) -> None:
        self.waiting.append(values)
        self.pending += len(values)
        if self.pending >= self.piece:
            self.flush()

    def flush(self) -> None:
        """Use what is waiting: clusters that end in it, beginning in what came before."""
        from schuler.kernels.noise.allan import allan_sums, integrate

        if not self.pending:
            return
        values = np.concatenate(self.waiting)
        channels, before = self.history.shape
        theta = np.empty((channels, len(values) + 1))
        integrate(values, np.zeros(channels), theta)
        new, old = np.empty(self.factors.size), np.empty(self.factors.size)
        keep = min(2 * int(self.factors[-1]), before + len(values) - 1) + 1
        history = np.empty((channels, keep))
        for j in range(channels):
            whole = np.concatenate([self.history[j], self.history[j, -1] + theta[j, 1:]])
            allan_sums(whole, self.factors, new, _BLOCK)
            allan_sums(self.history[j], self.factors, old, _BLOCK)
            self.squares[:, j] += (new - old) / self.factors.astype(np.float64) ** 2
            history[j] = whole[-keep:] - whole[-1]  # second differences do not see a constant
        self.history, self.samples = history, self.samples + len(values)
        self.waiting, self.pending = [], 0


class AllanAccumulator:
    """Collects a signal piece by piece in bounded memory.

    About 15 MB a channel, whatever its length. Clusters of up to 65 536 samples are those of
    `allan_deviation`, to rounding.

    Parameters
    ----------
    rate : float
        Samples a second.
    channels : int
        Columns of the signal.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler.curves.allan_sums import AllanAccumulator
    >>> rng = np.random.default_rng(1)
    >>> collected = AllanAccumulator(rate=100.0)
    >>> for _ in range(10):
    ...     collected.add(rng.standard_normal(10_000))
    >>> collected.sums().curve().deviation[0].round(2)
    array([1.])
    """

    def __init__(self, rate: float, channels: int = 1) -> None:
        if not (np.isfinite(rate) and rate > 0.0):
            raise InputError(f"rate is {rate:g} Hz", expected="a finite number above zero")
        self.rate = float(rate)
        self.channels = channels
        self._done: AllanSums | None = None
        self._begin()

    def _begin(self) -> None:
        self._offset: FloatArray | None = None
        self._levels = [_Level(self.channels, _GRID, _PIECE)]
        self._halves: list[FloatArray] = []

    def add(self, samples: ArrayLike) -> None:
        """Add samples that follow those before them.

        Parameters
        ----------
        samples : (n,) or (n, m) array_like
            One column a channel.

        Raises
        ------
        InputError
            Another number of channels, or samples that are not finite.
        """
        values = np.asarray(samples, dtype=np.float64)
        values = values.reshape(len(values), -1)
        if values.shape[1] != self.channels:
            raise InputError(f"{values.shape[1]} channels", expected=f"{self.channels}")
        if not len(values):
            return
        if not all_finite(values):
            raise InputError(
                "samples are not finite", expected="finite numbers", cure="end the stretch there "
                "with pause(), and go on behind it",
            )  # fmt: skip
        if self._offset is None:
            self._offset = values[:: max(1, len(values) // 4096)].mean(axis=0)
        values = values - self._offset
        for k in range(64):
            if k == len(self._levels):
                self._levels.append(_Level(self.channels, _UPPER, _PIECE // 8))
                self._halves.append(np.empty((0, self.channels)))
            self._levels[k].add(values)
            if k == len(self._halves):
                self._halves.append(np.empty((0, self.channels)))
            values = np.concatenate([self._halves[k], values])
            even = len(values) // 2 * 2
            self._halves[k] = values[even:]
            values = 0.5 * (values[0:even:2] + values[1:even:2])
            if not len(values):
                return

    def pause(self) -> None:
        """End a stretch: what is added next does not follow what was added before."""
        done = self._sums()
        if done is not None:
            self._done = done if self._done is None else self._done + done
        self._begin()

    def sums(self) -> AllanSums:
        """Return the sums of all that was added.

        Returns
        -------
        AllanSums
            To be kept, or added to those of other parts.

        Raises
        ------
        InputError
            Nothing was added.
        """
        now = self._sums()
        parts = [s for s in (self._done, now) if s is not None]
        if not parts:
            raise InputError("no samples were added", expected="a signal")
        return parts[0] if len(parts) == 1 else parts[0] + parts[1]

    def _sums(self) -> AllanSums | None:
        rows = list(self._of_levels())
        if not rows:
            return None
        factors, squares, clusters, strides = zip(*rows, strict=True)
        return AllanSums(
            np.concatenate(factors),
            np.concatenate(squares),
            np.concatenate(clusters),
            np.concatenate(strides),
            self.rate,
            self._levels[0].samples,
        )

    def _of_levels(self) -> Iterator[Sequence[NDArray[np.generic]]]:
        for k, level in enumerate(self._levels):
            level.flush()
            if not level.samples:
                continue
            clusters = np.maximum(level.samples + 1 - 2 * level.factors, 0)
            strides = np.full(level.factors.size, 1 << k)
            yield level.factors << k, level.squares, clusters, strides
