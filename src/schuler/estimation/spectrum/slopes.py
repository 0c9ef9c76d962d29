"""Parameters read off straight runs of a power spectral density, as S004 does (spec 2.2).

On the two-sided density: white noise N² is flat, flicker noise B²/(2 pi f) falls with f, a random
walk K²/(2 pi f)² with f², quantisation (2 pi f)² Q² dt rises with f².
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.curves.spectrum import SpectrumCurve
from schuler.data.to_dict import ToDict
from schuler.types import FloatArray

_TOLERANCE = 0.25
_HALF_WINDOW = 0.3
_SHORTEST_RUN = 0.35
_EVEN = 16.0


@dataclass(frozen=True, slots=True)
class SpectrumReading(ToDict):
    """One parameter read off a straight run."""

    value: float  # N, B, K or Q in SI
    # start, stop: frequencies in Hz between which the run was read
    start: float
    stop: float
    relative_error: float  # from the degrees of freedom of the run alone


@dataclass(frozen=True, slots=True)
class SpectrumReadings(ToDict):
    """What the slope method finds in a spectrum; None where it has no such run."""

    # white_noise, bias_instability, random_walk, quantization: N = sqrt(S), B = sqrt(2 pi f S), K =
    # 2 pi f sqrt(S), Q = sqrt(S/dt)/(2 pi f), S two-sided
    white_noise: SpectrumReading | None
    bias_instability: SpectrumReading | None
    random_walk: SpectrumReading | None
    quantization: SpectrumReading | None


def spectrum_slopes(curve: SpectrumCurve) -> SpectrumReadings:
    """Read N, B, K and Q off an averaged density."""
    good = curve.density > 0.0
    frequency, density = curve.frequency[good], curve.two_sided[good]
    freedom = curve.degrees_of_freedom[good]
    nothing = SpectrumReadings(None, None, None, None)
    if frequency.size < 5:
        return nothing
    x, y = np.log10(frequency), np.log10(density)
    slope, doubt = local_spectral_slope(x, y, freedom)

    def read(power: float, factor: float) -> SpectrumReading | None:
        run = _longest_run(np.abs(slope - power) <= _TOLERANCE + doubt, x)
        if run is None:
            return None
        # the upper end has nearly all degrees of freedom, but is where the run bends first
        weight = np.minimum(freedom[run], _EVEN * freedom[run].min())
        level = float(np.average(y[run] - power * x[run], weights=weight))
        # the logarithm of a chi-square lies below that of its mean
        level += float(np.average(1.0 / freedom[run], weights=weight)) / math.log(10.0)
        share = weight / float(np.sum(weight))
        error = 0.5 * math.sqrt(float(share**2 @ (2.0 / freedom[run])))
        value = factor * 10.0 ** (0.5 * level)
        return SpectrumReading(value, float(frequency[run][0]), float(frequency[run][-1]), error)

    turn = 2.0 * math.pi
    return SpectrumReadings(
        white_noise=read(0.0, 1.0),
        bias_instability=read(-1.0, math.sqrt(turn)),
        random_walk=read(-2.0, turn),
        quantization=read(2.0, math.sqrt(curve.rate) / turn),
    )


def local_spectral_slope(
    x: FloatArray, y: FloatArray, freedom: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Slope of log density against log frequency about every point."""
    weight_all = np.minimum(freedom, 100.0 * freedom.min())
    slope, error = np.empty(x.size), np.empty(x.size)
    # relative variance of a density is 2/freedom
    variance_all = 2.0 / freedom / math.log(10.0) ** 2
    for k in range(x.size):
        distance = np.abs(x - x[k])
        near = np.flatnonzero(distance <= _HALF_WINDOW)
        if near.size < 5:
            near = np.argsort(distance)[:5]
        weight = weight_all[near]
        dx = x[near] - np.average(x[near], weights=weight)
        share = weight * dx / float(np.sum(weight * dx * dx))
        slope[k] = float(share @ y[near])
        error[k] = math.sqrt(float(share**2 @ variance_all[near]))
    return slope, error


def _longest_run(mask: NDArray[np.bool_], x: FloatArray) -> slice | None:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    runs = [
        slice(a, b)
        for a, b in zip(edges[::2], edges[1::2], strict=True)
        if b - a >= 2 and x[b - 1] - x[a] >= _SHORTEST_RUN
    ]
    return max(runs, key=lambda r: x[r.stop - 1] - x[r.start], default=None)
