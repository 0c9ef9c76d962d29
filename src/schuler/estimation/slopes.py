"""The slope method: lines of fixed slope through straight runs of the log-log curve.

The twin of what papers and datasheets do (spec 2.4 a; S004 section 5.4). It reads the crossing
of white noise and random walk as bias instability; `identify` is the method to use.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.curves.allan_curve import AllanCurve
from schuler.data.to_dict import ToDict
from schuler.noise.gauss_markov import FLICKER_LEVEL
from schuler.types import FloatArray

_TOLERANCE = 0.1
_REACH = 0.125


@dataclass(frozen=True, slots=True)
class SlopeReading(ToDict):
    """One parameter read off a straight run."""

    value: float  # N, B or K in SI
    # start, stop: cluster times in s between which the run was fitted
    start: float
    stop: float
    # 1/sqrt(2 (T/tau - 1)) at the right end of the run: S004 (15), which is for clusters that do
    # not overlap
    relative_error: float


@dataclass(frozen=True, slots=True)
class SlopeReadings(ToDict):
    """What the slope method finds; None where the curve has no such run."""

    white_noise: SlopeReading | None  # N, the line of slope -1/2 at 1 s
    bias_instability: SlopeReading | None  # B, the level of the flat run over 0.66428
    random_walk: SlopeReading | None  # K, the line of slope +1/2 at 3 s


def slope_method(curve: AllanCurve) -> SlopeReadings:
    """Read N, B and K off the Allan curve of one signal, as papers and datasheets do.

    Parameters
    ----------
    curve : AllanCurve
        From `allan_deviation`.

    Returns
    -------
    SlopeReadings
        Each with its value in SI, the times it was read between and its relative error; None where
        the curve has no such part.

    Notes
    -----
    S004 section 5.4. Where the slopes of white noise and random walk cross, what is read as bias
    instability is none (erratum E-004-9); `identify` fits all parts together.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> noise = schuler.WhiteNoise(0.1).simulate(50_000, 0.01, np.random.default_rng(0))
    >>> read = schuler.slope_method(schuler.allan_deviation(noise, 100.0))
    >>> round(read.white_noise.value, 2)
    0.1
    """
    good = curve.deviation > 0.0
    tau, deviation = curve.tau[good], curve.deviation[good]
    if tau.size < 3:
        return SlopeReadings(None, None, None)
    x, y = np.log10(tau), np.log10(deviation)
    inside = (x >= x[0] + _REACH) & (x <= x[-1] - _REACH)
    slope = np.full(x.size, np.nan)
    ahead, behind = np.interp(x + _REACH, x, y), np.interp(x - _REACH, x, y)
    slope[inside] = (ahead - behind)[inside] / (2.0 * _REACH)

    def read(nominal: float, factor: float) -> SlopeReading | None:
        run = _longest_run(np.abs(np.nan_to_num(slope, nan=9.0) - nominal) <= _TOLERANCE, x)
        if run is None:
            return None
        level = 10.0 ** float(np.mean(y[run] - nominal * x[run]))
        stop = float(tau[run][-1])
        clusters = curve.duration / stop
        error = 1.0 / math.sqrt(2.0 * max(clusters - 1.0, 0.5))
        return SlopeReading(level * factor, float(tau[run][0]), stop, error)

    return SlopeReadings(
        white_noise=read(-0.5, 1.0),
        bias_instability=read(0.0, 1.0 / FLICKER_LEVEL),
        random_walk=read(0.5, math.sqrt(3.0)),
    )


def _longest_run(mask: NDArray[np.bool_], x: FloatArray) -> slice | None:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], mask, [False]]).astype(np.int8)))
    runs = [slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a >= 2]
    return max(runs, key=lambda r: x[r.stop - 1] - x[r.start], default=None)
