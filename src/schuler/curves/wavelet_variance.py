"""The Haar wavelet variance at octave scales, plain and robust, with honest intervals."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.curves.allan_curve import AllanCurve
from schuler.curves.confidence import (
    chi_square_bounds,
    local_slope,
    power_law_degrees_of_freedom,
)
from schuler.curves.finite_signal import LARGEST, too_large
from schuler.curves.robust import (
    BiweightTuning,
    biweight_tuning,
    median_scale,
    robust_variance,
)
from schuler.data._checks import numbers
from schuler.data.exportable import Exportable
from schuler.errors import EstimationError, InputError
from schuler.noise import Process
from schuler.types import FloatArray

RobustKind = Literal["", "samples", "coefficients"]

_BLOCK = 4096
_LONGEST_FRACTION = 4
_FEWEST_SAMPLES = 16
_WINDOWS = (33, 129, 513, 2049)
_GROWTH = 1.15
_DENSE = 16
_WHITE = 0.3


@dataclass(frozen=True, slots=True, eq=False)
class WaveletVarianceCurve(Exportable):
    """Haar wavelet variance against scale.

    Parameters
    ----------
    scale : (t,) ndarray
        Length in s of either of the two neighbouring means: the cluster time of the Allan
        variance, which is twice the wavelet variance. Level j of the transform has scale
        2^(j-1) samples.
    variance : (t,) ndarray
        In the signal's unit squared.
    lower, upper : (t,) ndarray
        95 % confidence interval of the variance.
    degrees_of_freedom : (t,) ndarray
        Equivalent degrees of freedom.
    rate : float
        Samples a second.
    samples : int
        Length of the signal.
    robust : {"", "samples", "coefficients"}
        Where outliers were held back; "" for the plain estimate.
    efficiency : float
        Of the robust estimate at the normal; 1 for the plain one.
    core_variance : float
        "samples": variance of a sample about the local level, without outliers; else 0.
    core_error : float
        Its standard error.
    excess_variance : float
        "samples": variance of the white noise that holding back outliers adds to a sample, which
        the curve has been freed of.
    outliers : float
        "samples": share of samples that count for nothing.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import wavelet_variance
    >>> curve = wavelet_variance(np.random.default_rng(1).standard_normal(10_000), 100.0)
    >>> (curve.variance[:2] * curve.scale[:2] * 100.0).round(1)
    array([0.5, 0.5])
    """

    JSON = (
        "scale variance lower upper degrees_of_freedom rate samples robust efficiency "
        "core_variance excess_variance outliers"
    )

    scale: FloatArray
    variance: FloatArray
    lower: FloatArray
    upper: FloatArray
    degrees_of_freedom: FloatArray
    rate: float
    samples: int
    robust: RobustKind = ""
    efficiency: float = 1.0
    core_variance: float = 0.0
    core_error: float = 0.0
    excess_variance: float = 0.0
    outliers: float = 0.0

    @property
    def duration(self) -> float:
        """Length of the record in s."""
        return self.samples / self.rate

    @property
    def factors(self) -> NDArray[np.int64]:
        """Samples under either mean: 1, 2, 4, ..."""
        return np.round(self.scale * self.rate).astype(np.int64)

    @property
    def allan(self) -> AllanCurve:
        """The same as an Allan deviation: sqrt(2 variance) at cluster time scale."""
        return AllanCurve(
            tau=self.scale,
            deviation=np.sqrt(2.0 * self.variance),
            lower=np.sqrt(2.0 * self.lower),
            upper=np.sqrt(2.0 * self.upper),
            degrees_of_freedom=self.degrees_of_freedom,
            rate=self.rate,
            samples=self.samples,
        )

    def of(self, process: Process) -> FloatArray:
        """Wavelet variance of samples of a process at the scales."""
        return 0.5 * process.sampled_allan_variance(self.factors, 1.0 / self.rate)


def wavelet_variance(
    signal: ArrayLike,
    rate: float,
    robust: bool | Literal["samples", "coefficients"] = False,
    efficiency: float = 0.6,
) -> WaveletVarianceCurve:
    """Return the Haar wavelet variance at octave scales, with 95 % intervals.

    Parameters
    ----------
    signal : (n,) array_like
        Rate-like samples (angular rate, specific force).
    rate : float
        Samples a second.
    robust : bool or {"samples", "coefficients"}
        Hold outliers back. "coefficients": M-estimate of the variance of the coefficients of
        every scale, right where few coefficients hold an outlier. "samples": samples are drawn
        to their local median first, and the noise which that adds is taken off, so that coarse
        scales, where every coefficient holds outliers, are right as well; it needs noise that is
        about white from sample to sample. True takes "samples" where that is so.
    efficiency : float
        Of the robust variance at the normal; less is more robust.

    Returns
    -------
    WaveletVarianceCurve
        Scales 1, 2, 4, ... samples up to a quarter of the record.

    Raises
    ------
    InputError
        Not one-dimensional, not finite, an impossible rate or efficiency.
    EstimationError
        Fewer than 16 samples; a robust estimate of samples most of which are equal.

    Notes
    -----
    Spec 10. Only coefficients inside the record count (unbiased MODWT estimate; Percival and
    Walden, Wavelet Methods for Time Series Analysis, 2000, ch. 8), so that the plain variance is
    exactly half the overlapping Allan variance.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import wavelet_variance
    >>> curve = wavelet_variance(np.random.default_rng(1).standard_normal(10_000), 100.0)
    >>> curve.scale[:3]
    array([0.01, 0.02, 0.04])
    """
    values = _checked(signal, rate)
    n = values.size
    factors = 2 ** np.arange(int(math.log2(n // _LONGEST_FRACTION)) + 1, dtype=np.int64)
    if not robust:
        return wavelet_curve(_plain(values, factors), factors, n, float(rate))
    tuning = biweight_tuning(float(efficiency))
    kind: RobustKind
    if robust is True or robust == "samples":
        cleaned = _drawn_to_level(values, tuning)
        kind = "samples" if robust == "samples" or cleaned.is_white else "coefficients"
    elif robust == "coefficients":
        kind = robust
    else:
        raise InputError(f"robust is '{robust}'", expected="True, 'samples' or 'coefficients'")
    if kind == "coefficients":
        variance = _of_coefficients(values, factors, tuning)
        return wavelet_curve(variance, factors, n, float(rate), "coefficients", tuning.efficiency)
    variance = _plain(cleaned.values, factors) - cleaned.excess / (2.0 * factors)
    # a scale at which the noise that was added outweighs everything else says nothing
    keep = variance > 0.0
    return wavelet_curve(
        variance[keep],
        factors[keep],
        n,
        float(rate),
        "samples",
        tuning.efficiency,
        core_variance=cleaned.core,
        core_error=cleaned.core_error,
        excess_variance=cleaned.excess,
        outliers=cleaned.outliers,
    )


def robust_inflation(factors: NDArray[np.int64], efficiency: float) -> FloatArray:
    """Variance of M-estimates of every scale over that of plain ones, for white noise."""
    extra = 1.0 / efficiency - 1.0
    ratios = []
    for m in np.minimum(factors, 256):
        lag = np.arange(1, 2 * int(m)) / float(m)
        correlation = np.where(lag < 1.0, 1.0 - 1.5 * lag, 0.5 * lag - 1.0)
        squares = 1.0 + 2.0 * float(np.sum(correlation**2))
        ratios.append((1.0 + 2.0 * float(np.sum(correlation**4))) / squares)
    return 1.0 + extra * np.array(ratios)


def _checked(signal: ArrayLike, rate: float) -> FloatArray:
    data = numbers(signal, "signal")
    if data.ndim != 1:
        raise InputError(
            f"signal has shape {data.shape}", expected="numbers (n,), one channel at a time"
        )
    if data.size < _FEWEST_SAMPLES:
        raise EstimationError(
            f"signal has {data.size} samples",
            expected=f"at least {_FEWEST_SAMPLES}",
            cure="record longer",
        )
    if not (np.isfinite(rate) and rate > 0.0):
        raise InputError(f"rate is {rate:g} Hz", expected="a finite number above zero")
    values = np.ascontiguousarray(data, dtype=np.float64)
    if not math.isfinite(float(values.sum())) and not np.isfinite(values).all():
        bad = np.flatnonzero(~np.isfinite(values))
        raise InputError(
            f"signal holds {bad.size} samples that are not finite, the first at row {bad[0]}",
            expected="finite numbers",
            cure="remove or repair these rows first",
        )
    if max(float(values.max()), -float(values.min())) > LARGEST:
        raise too_large()
    return values


def _running_sum(values: FloatArray) -> FloatArray:
    from schuler.kernels.noise.allan import integrate

    theta = np.empty((1, values.size + 1))
    offset = values[:: max(1, values.size // 4096)].mean()
    integrate(values[:, None], np.array([offset]), theta)
    return np.asarray(theta[0])


def _plain(values: FloatArray, factors: NDArray[np.int64]) -> FloatArray:
    from schuler.kernels.noise.allan import allan_sums

    theta = _running_sum(values)
    sums = np.empty(factors.size)
    allan_sums(theta, factors, sums, _BLOCK)
    terms = values.size + 1 - 2 * factors
    return np.asarray(sums / (4.0 * factors.astype(np.float64) ** 2 * terms))


def _of_coefficients(
    values: FloatArray, factors: NDArray[np.int64], tuning: BiweightTuning
) -> FloatArray:
    from schuler.kernels.noise.wavelet_variance import haar_coefficients

    theta = _running_sum(values)
    out = []
    for m in factors.tolist():
        # sixteen coefficients a mean are as good as all
        stride = max(1, m // _DENSE)
        coefficients = np.empty((values.size - 2 * m) // stride + 1)
        haar_coefficients(theta, m, stride, coefficients)
        out.append(robust_variance(coefficients, tuning)[0])
    return np.array(out)


@dataclass(frozen=True, slots=True, eq=False)
class _Drawn:
    """A signal whose outliers were drawn to the local level (see `_drawn_to_level`)."""

    values: FloatArray
    core: float
    core_error: float
    excess: float
    outliers: float
    is_white: bool


def _residual(values: FloatArray) -> tuple[FloatArray, int]:
    """Samples less the local median, over the longest window in which the level stands still."""
    from schuler.kernels.noise.wavelet_variance import medians_at_nodes

    best: FloatArray | None = None
    length = 0
    shortest_scale = math.inf
    index = np.arange(values.size, dtype=np.float64)
    for window in _WINDOWS:
        if best is not None and window > values.size // 4:
            break
        window = min(window, values.size)
        step = max(1, window // 4)
        nodes = np.arange(0, values.size, step)
        medians = np.empty(nodes.size)
        medians_at_nodes(values, window, step, medians)
        residual = values - np.interp(index, nodes, medians)
        scale = median_scale(residual)
        if best is None:
            shortest_scale = scale
        elif scale > _GROWTH * shortest_scale:
            break
        best, length = residual, window
    assert best is not None
    return best, length


def _drawn_to_level(values: FloatArray, tuning: BiweightTuning) -> _Drawn:
    """Draw every sample to its local level by the biweight; slow changes keep their size."""
    from schuler.kernels.noise.wavelet_variance import biweight_influence

    residual, window = _residual(values)
    level = values - residual
    core, core_error = robust_variance(residual, tuning)
    # the level's own error is the residuals' loss: a few parts in the window, found by simulation
    core_error = math.hypot(core_error, 1.3 * (1.0 / tuning.efficiency - 1.0) / window * core)
    reach = tuning.cut * math.sqrt(core)
    influence = np.empty_like(residual)
    slope = biweight_influence(residual, reach, influence) / residual.size
    if slope < 0.1:
        raise EstimationError(
            "too many outliers for a robust estimate",
            expected="at most about a third of the samples",
            cure="lower the efficiency or use robust=False",
        )
    influence /= slope
    square = float(influence @ influence)
    neighbours = float(influence[1:] @ influence[:-1]) / square
    return _Drawn(
        values=level + influence,
        core=core,
        core_error=core_error,
        excess=square / residual.size - core,
        outliers=float(np.count_nonzero(influence == 0.0)) / residual.size,
        is_white=abs(neighbours) < _WHITE,
    )


def wavelet_curve(
    variance: FloatArray,
    factors: NDArray[np.int64],
    samples: int,
    rate: float,
    robust: RobustKind = "",
    efficiency: float = 1.0,
    **core: float,
) -> WaveletVarianceCurve:
    """Return the curve of variances of a record of so many samples, with their intervals."""
    scale = factors / rate
    slope = local_slope(scale, variance)
    freedom = power_law_degrees_of_freedom(slope, factors, samples)
    if robust == "coefficients":
        freedom = freedom / robust_inflation(factors, efficiency)
    elif robust == "samples":
        # white noise at that scale as the drawn signal has it, and as it is
        white = core["core_variance"] / (2.0 * factors)
        extra = core["excess_variance"] / (2.0 * factors)
        spread = 2.0 * (variance + extra) ** 2 / freedom
        own = (core["core_error"] / (2.0 * factors)) ** 2 - 2.0 * (white + extra) ** 2 / samples
        freedom = 2.0 * variance**2 / np.maximum(spread + own, 2.0 * variance**2 / samples)
    down, up = chi_square_bounds(freedom)
    return WaveletVarianceCurve(
        scale=scale,
        variance=variance,
        lower=variance * down**2,
        upper=variance * up**2,
        degrees_of_freedom=freedom,
        rate=rate,
        samples=samples,
        robust=robust,
        efficiency=efficiency,
        **core,
    )
