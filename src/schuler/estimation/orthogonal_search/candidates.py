"""Candidate terms of the Fast Orthogonal Search and their Gram matrix (spec 4.1, 4.3)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import InputError
from schuler.estimation.products import gram
from schuler.estimation.signals import Series, prepare
from schuler.types import FloatArray, IntArray

_BLOCK_NUMBERS = 2**18


@dataclass(frozen=True, slots=True, eq=False)
class Candidates:
    """Terms that a search may choose from: lagged samples and products of two of them."""

    # (c, 2): signal of each factor: 0 the signal itself, 1 .. the inputs; second -1 if linear.
    sources: IntArray
    lags: IntArray  # (c, 2): lag of each factor

    @classmethod
    def all_up_to(cls, max_lag: int, degree: int, inputs: int, input_lags: int) -> Candidates:
        """List y(n-1) .. y(n-L), x(n) .. x(n-K) of every input, and all their products."""
        factors = [(0, lag) for lag in range(1, max_lag + 1)]
        factors += [(j, lag) for j in range(1, inputs + 1) for lag in range(input_lags + 1)]
        pairs = [(f, (-1, 0)) for f in factors]
        if degree == 2:
            pairs += [(f, g) for k, f in enumerate(factors) for g in factors[k:]]
        sources = np.array([[f[0], g[0]] for f, g in pairs], dtype=np.int64).reshape(-1, 2)
        lags = np.array([[f[1], g[1]] for f, g in pairs], dtype=np.int64).reshape(-1, 2)
        return cls(sources, lags)

    @property
    def count(self) -> int:
        """Number of candidates."""
        return len(self.sources)

    @property
    def memory(self) -> int:
        """Largest lag of any factor."""
        return int(self.lags.max(initial=0))

    def some(self, chosen: Sequence[int]) -> Candidates:
        """Return a few of the candidates."""
        index = np.array(chosen, dtype=np.int64)
        return Candidates(self.sources[index], self.lags[index])


@dataclass(frozen=True, slots=True, eq=False)
class Signals:
    """The signal and its inputs, centred and scaled for the search."""

    values: FloatArray  # (s, n): centred and scaled, the signal first
    # means, scales: (s,) mean over scale, and scale
    means: FloatArray
    scales: FloatArray
    series: Series  # the signal itself

    def blocks(self, candidates: Candidates, first: int) -> Iterator[FloatArray]:
        """Blocks of (1, candidates, signal) by sample, from sample `first` (from zero) on."""
        from schuler.kernels.noise.orthogonal_search import fill_candidates

        width = max(256, _BLOCK_NUMBERS // (candidates.count + 2))
        work = np.ones((candidates.count + 2, width))
        total = self.values.shape[1]
        for start in range(first, total, width):
            part = work[:, : min(width, total - start)]
            fill_candidates(
                self.values, self.means, candidates.sources, candidates.lags, start, part[1:-1]
            )
            part[-1] = self.values[0, start : start + part.shape[1]]
            yield part


def gather(signal: ArrayLike, inputs: Sequence[ArrayLike], fewest: int) -> Signals:
    """Check, centre and scale the signal and its inputs."""
    every = [prepare(signal, fewest=fewest)]
    for k, column in enumerate(inputs, 1):
        found = prepare(column, fewest=1)
        if found.values.size != every[0].values.size:
            raise InputError(
                f"input {k} has {found.values.size} samples",
                expected=f"{every[0].values.size} as the signal has",
            )
        every.append(found)
    return Signals(
        values=np.stack([s.values for s in every]),
        means=np.array([s.offset / s.scale for s in every]),
        scales=np.array([s.scale for s in every]),
        series=every[0],
    )


def centred_gram(blocks: Iterator[FloatArray], size: int) -> tuple[FloatArray, FloatArray, int]:
    """Gram matrix of centred rows, and their means, in one pass."""
    total = np.zeros((size + 1, size + 1))
    for block in blocks:
        total += gram(block)
    samples = total[0, 0]
    means = total[0, 1:] / samples
    # the rows are centred but for the small mean of a product of centred factors
    return total[1:, 1:] - samples * np.outer(means, means), means, int(samples)
