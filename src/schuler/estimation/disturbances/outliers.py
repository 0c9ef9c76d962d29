"""Whether outliers decide what a plain estimate says of a signal."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from schuler.curves.robust import biweight_tuning, median_scale, robust_variance
from schuler.types import FloatArray

_FAR = 6.0
_FEWEST_FAR = 10
_MOST_STEPS, _BLOCKS = 2_000_000, 64
_LEAST, _CHANCE = 0.005, 15.0


@dataclass(frozen=True, slots=True)
class Contamination:
    """How far the differences of a signal are from those of its bulk."""

    ratio: float  # variance of the differences over its robust value
    share: float  # share of the differences beyond six robust standard deviations
    serious: bool  # more than chance, and carried by outliers

    @property
    def words(self) -> str:
        """The same for people."""
        return (
            f"{100.0 * self.share:.2g} % of the steps between samples are outliers and raise "
            f"their variance {self.ratio:.3g} times"
        )


def _steps(values: FloatArray) -> FloatArray:
    """Differences of neighbours; of a very long signal, those of blocks spread over it."""
    if values.size <= _MOST_STEPS:
        return np.diff(np.asarray(values, dtype=np.float64))
    size = _MOST_STEPS // _BLOCKS
    starts = np.linspace(0, values.size - size, _BLOCKS).astype(np.int64)
    return np.concatenate(
        [np.diff(np.asarray(values[s : s + size], dtype=np.float64)) for s in starts]
    )


def contamination(values: FloatArray, *, closely: bool = True) -> Contamination:
    """Compare the variance of the differences with what it is without outliers.

    Not closely: the ratio stays 1 where too few are far for it to be serious, whatever it is.
    """
    step = _steps(values)
    scale = median_scale(step)
    if step.size < 2 or scale == 0.0:
        return Contamination(1.0, 0.0, False)
    far = int(np.count_nonzero(step > _FAR * scale) + np.count_nonzero(step < -_FAR * scale))
    if far < _FEWEST_FAR and not closely:
        return Contamination(1.0, far / step.size, False)
    ratio = float(step @ step) / step.size / robust_variance(step, biweight_tuning(0.5))[0]
    limit = 1.0 + max(_LEAST, _CHANCE / math.sqrt(step.size))
    return Contamination(ratio, far / step.size, ratio > limit and far >= _FEWEST_FAR)
