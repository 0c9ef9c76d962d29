"""What the covariance kernels see in a process: white noise, walks, exponential correlations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from schuler.types import FloatArray

_TAUS, _LONGEST, _PER_DECADE = 60, 1e6, 2


@dataclass(frozen=True, slots=True)
class Elements:
    """A process in the terms of kernels, for samples one interval apart."""

    white: float = 0.0  # variance of the white part of a sample, u²
    quantization: float = 0.0  # variance of the white part of the running sum of samples, u²
    walk: float = 0.0  # variance of a random walk's step from sample to sample, u²
    # coefficient B²/pi of lag² ln(lag)/2 in the covariance of the running sum, u²
    flicker: float = 0.0
    # variance in u² and correlation time in s of every exponential correlation
    gauss_markovs: tuple[tuple[float, float], ...] = ()

    @classmethod
    def together(cls, parts: Sequence[Elements]) -> Elements:
        """Elements of a sum of independent processes."""
        return cls(
            white=float(sum(p.white for p in parts)),
            quantization=float(sum(p.quantization for p in parts)),
            walk=float(sum(p.walk for p in parts)),
            flicker=float(sum(p.flicker for p in parts)),
            gauss_markovs=tuple(g for p in parts for g in p.gauss_markovs),
        )


def imitation(allan_variance: Callable[[FloatArray], FloatArray], dt: float) -> Elements:
    """White and Gauss-Markov noises whose Allan variances come nearest to those of a process.

    Their sums rise and fall no faster than the cluster time; where the process does, its least
    majorant that does not is imitated.
    """
    from scipy.optimize import nnls

    clusters = np.unique(np.round(np.geomspace(1.0, _LONGEST, _TAUS)))
    wanted = np.asarray(allan_variance(clusters * dt), dtype=np.float64)
    seen = wanted > 0.0
    if not seen.any():
        return Elements()
    x = clusters[seen]
    target = np.maximum.accumulate((wanted[seen] / x)[::-1])[::-1] * x
    target = np.maximum.accumulate(target * x) / x
    times = np.geomspace(1.0, _LONGEST, round(np.log10(_LONGEST) * _PER_DECADE) + 1)
    ratio = x[:, None] / times
    rise = -np.expm1(-ratio)
    # cancels below a hundredth, where the shape is two thirds of the ratio
    exact = (2.0 / ratio) * (1.0 - (rise + 0.5 * rise * rise) / ratio)
    shapes = np.column_stack([1.0 / x, np.where(ratio < 1e-2, ratio * 2.0 / 3.0, exact)])
    powers = nnls(shapes / target[:, None], np.ones(x.size))[0]
    noises = tuple((float(p), float(t * dt)) for p, t in zip(powers[1:], times, strict=True) if p)
    return Elements(white=float(powers[0]), gauss_markovs=noises)
