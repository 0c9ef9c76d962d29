"""Redundant sensors followed on line: the settings, the start, and what comes out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.arrays.lever_arms import arm_coefficients
from schuler.arrays.redundant import RedundantSensors
from schuler.arrays.synthesis.cornered_hat import FLOOR, cornered_hat
from schuler.arrays.synthesis.least_squares import least_squares, residuals
from schuler.errors import EstimationError, InputError
from schuler.types import FloatArray

if TYPE_CHECKING:
    from schuler.kernels.arrays.redundancy_data import FollowedOutputs, Tuning

EVENTS = 10_000
"""Lines of the log of one kind of sensor that are kept."""
COMMON = 0.25
"""Memory of the level that all variances share, of the memory of each."""
RECALL = 2.0
"""What was taken out this many seconds before most sensors contradict one another comes back."""
MEDIAN_TO_DEVIATION = 1.4826


@dataclass(frozen=True, slots=True, kw_only=True)
class OnlineSettings:
    """How weights follow the noise of the sensors.

    Parameters
    ----------
    time_constant : float
        Memory of the variances, s; their common level is followed four times as fast. Shorter
        follows faster; equal sensors then lose more by the scatter of their weights.
    block : float
        Between two updates of weights, biases and tests, s.
    learning : float
        At the beginning, from which start values are taken, s; no axis is taken out in it.
    bias_time_constant : float or None
        Memory of the differences between the sensors' biases, s. They are removed, so that
        changing weights do not make noise out of them; the mean of all biases stays. None: the
        differences are not followed after the start.
    keep_biases : bool
        Biases of the sensors are not touched at all: what S000 (12) does at rest.
    clip : float
        Deviations beyond which the residuals of a sample are made smaller in all estimates.
    shrink : bool
        Variances are drawn together as far as chance explains their differences.

    Examples
    --------
    >>> from schuler import OnlineSettings
    >>> OnlineSettings(time_constant=1.0).shrink
    True
    """

    time_constant: float = 2.0
    block: float = 0.1
    learning: float = 10.0
    bias_time_constant: float | None = 100.0
    keep_biases: bool = False
    clip: float = 4.0
    shrink: bool = True

    def __post_init__(self) -> None:
        values = (self.time_constant, self.block, self.clip, self.bias_time_constant or 1.0)
        if not (all(np.isfinite(v) and v > 0.0 for v in values) and self.learning >= 0.0):
            raise InputError(
                "settings of the weights that are not positive",
                expected="time constants, block and clip above zero, learning zero or more",
            )


@dataclass(frozen=True, slots=True, kw_only=True)
class Watch:
    """Thresholds of the on-line tests in the numbers the kernel works with."""

    time_constants: tuple[float, ...]  # of the smoothed residuals, s
    # axis_threshold, unit_threshold: F for each
    axis_threshold: tuple[float, ...]
    unit_threshold: tuple[float, ...]
    unit_margin: float  # F by which a unit must beat its worst axis
    spike: float  # F of one axis in one sample
    readmission: float  # F below which an axis taken out behaves
    hold: float  # how long it must, s
    factor_time_constant: float  # memory of the calibration of the smoothed residuals, s
    wander: float  # standard deviation of slow wander of a bias that is no fault, rad/s or m/s²


@dataclass(frozen=True, slots=True, eq=False)
class AxisNoise:
    """What is known of the axes of one kind of sensor beforehand."""

    # (M,): differences of the biases in the gauge of the mean of the sensors, rad/s or m/s²
    bias: FloatArray
    variance: FloatArray  # (M,): of a sample, square of that


@dataclass(frozen=True, slots=True, eq=False)
class Followed:
    """What came out for one kind of sensor; see `schuler.kernels.arrays.redundancy.follow`."""

    sensors: RedundantSensors  # what was followed
    block: int  # samples in a block
    learning: int  # blocks at the beginning in which nothing was taken out
    fused: FloatArray  # (n, 3): in the body
    covariance: FloatArray  # (b, 3, 3): of the fused vector in each block
    variance: FloatArray  # (b, M): of a sample of each axis as it was used
    usage: NDArray[np.int8]  # (b, M): 0 used, 1 taken out, 2 taken out with its unit, 3 missing
    freedom: NDArray[np.int16]  # (b,): degrees of freedom of the chi-square statistic
    # statistic, axis_statistic, unit_statistic: (n,) D, and the largest likelihood statistics of an
    # axis and a unit
    statistic: FloatArray
    axis_statistic: FloatArray
    # axis_suspect, unit_suspect: (n,) which
    axis_suspect: NDArray[np.int16]
    unit_statistic: FloatArray
    unit_suspect: NDArray[np.int16]
    # (b, J): largest likelihood statistic of an axis in the smoothed residuals
    smoothed: FloatArray
    # (J,): at the end, how much larger smoothed residuals were than white noise makes them
    factor: FloatArray
    bias: FloatArray  # (M,): differences of the biases at the end
    events: FloatArray  # (e, 8): the log
    lost_events: int  # lines that did not fit in

    @property
    def block_time(self) -> FloatArray:
        """Stamp of the first sample of each block, (b,) s."""
        return self.sensors.time[:: self.block]

    @property
    def weight(self) -> FloatArray:
        """Share of each axis in the information, (b, M); zero when not used."""
        raw = np.where(self.usage == 0, 1.0 / self.variance, 0.0)
        total = raw.sum(axis=1, keepdims=True)
        return np.asarray(raw / np.where(total > 0.0, total, 1.0))


def start_values(sensors: RedundantSensors, samples: int) -> AxisNoise:
    """Return biases and variances from the first samples, or from all of them."""
    values = sensors.measurements[:samples]
    whole = np.isfinite(values).all(axis=1)
    if np.count_nonzero(whole) >= 100:
        # rows with gaps compare with the mean of other sensors: they would mix the biases
        values = values[whole]
    x = residuals(values, sensors.axes)
    if np.count_nonzero(np.isfinite(x).any(axis=1)) < 10:
        raise EstimationError(
            f"{np.count_nonzero(np.isfinite(x).any(axis=1))} of the first {samples} samples have "
            "enough axes",
            expected="at least 10 to start from",
            cure="learn for longer, or cut the beginning",
        )
    with np.errstate(all="ignore"):
        middle = _nan_median(x)
        spread = MEDIAN_TO_DEVIATION * _nan_median(np.abs(x - middle))
        kept = np.where(np.abs(x - middle) <= 5.0 * np.maximum(spread, 1e-300), x, np.nan)
    number = np.isfinite(kept).sum(axis=0)
    mean = np.where(number > 0, np.nansum(kept, axis=0) / np.maximum(number, 1), 0.0)
    share = least_squares(sensors.axes).residual
    bias = share @ mean
    seen = number > 10
    pooled = float(
        np.nansum((kept - mean)[:, seen] ** 2)
        / max(np.sum(number[seen] * np.diag(share)[seen]), 1e-9)
    )
    if not pooled > 0.0:
        raise EstimationError(
            "redundant axes that agree to the last digit",
            expected="sensors with noise of their own",
            cure="check whether one recording was written several times",
        )
    variance = np.full(sensors.count, pooled)
    try:
        rows = np.isfinite(kept).all(axis=1)
        if np.count_nonzero(rows) >= 50:
            variance = cornered_hat(kept[rows], sensors.axes).variances
    except EstimationError:
        pass
    return AxisNoise(bias, np.maximum(variance, FLOOR * np.median(variance)))


def _nan_median(x: FloatArray) -> FloatArray:
    """Median of every column; zero for a column without values."""
    out = np.zeros(x.shape[1])
    for m in range(x.shape[1]):
        values = x[np.isfinite(x[:, m]), m]
        if values.size:
            out[m] = np.median(values)
    return out


@dataclass(frozen=True, slots=True)
class _Blocks:
    """How a recording is cut: n samples of M sensors in blocks of `size` samples.

    The first samples give the start values, `learning` blocks are followed before faults count.
    """

    samples: int
    sensors: int
    size: int
    number: int
    seconds: float
    first: int
    learning: int

    @classmethod
    def of(cls, sensors: RedundantSensors, settings: OnlineSettings, *, known: bool) -> _Blocks:
        """Cut a recording; nothing has to be learnt where the noise is known."""
        n, count = sensors.measurements.shape
        step = sensors.step
        size = max(1, min(round(settings.block / step), n))
        first = min(n, max(round(settings.learning / step), 20))
        learning = 0 if known else -(-first // size)
        return cls(n, count, size, -(-n // size), size * step, first, learning)


def _tuning(
    settings: OnlineSettings, watch: Watch | None, cut: _Blocks, *, adapting: bool, known: bool
) -> Tuning:
    """Shares of a block and thresholds, as the kernel wants them."""
    from schuler.kernels.arrays.redundancy_data import Tuning

    seconds = cut.seconds
    gain = 0.0
    if settings.bias_time_constant is not None and not settings.keep_biases:
        gain = 1.0 - np.exp(-seconds / settings.bias_time_constant)
    adaptation = 1.0 - np.exp(-seconds / settings.time_constant) if adapting else 0.0
    scatter = 0.0
    if settings.shrink and adapting:
        pull = 1.0 - adaptation * (cut.sensors - 3.0) / cut.sensors
        scatter = adaptation**2 * (2.0 / cut.size) / (1.0 - pull**2)
    return Tuning(
        block=cut.size,
        adaptation=float(adaptation),
        common=float(1.0 - np.exp(-seconds / (COMMON * settings.time_constant))),
        scatter=float(scatter),
        clip=settings.clip**2,
        floor=FLOOR if adapting else 0.0,
        bias_gain=float(gain),
        bias_samples=np.inf if known else float(cut.first),
        wander=0.0 if watch is None else watch.wander**2,
        spike=np.inf if watch is None else watch.spike,
        smoothing=np.zeros(0) if watch is None else smoothing_shares(watch, seconds),
        axis_threshold=_numbers(() if watch is None else watch.axis_threshold),
        unit_threshold=_numbers(() if watch is None else watch.unit_threshold),
        unit_margin=np.inf if watch is None else watch.unit_margin,
        factor_gain=0.0 if watch is None else 1.0 - np.exp(-seconds / watch.factor_time_constant),
        learning=cut.learning,
        readmission=np.inf if watch is None else watch.readmission,
        recall=round(RECALL / seconds),
    )


def _outputs(cut: _Blocks, smoothed: int, events: int = EVENTS) -> FollowedOutputs:
    """Rows for samples and blocks."""
    from schuler.kernels.arrays.redundancy_data import FollowedOutputs

    n, blocks = cut.samples, cut.number
    return FollowedOutputs(
        fused=np.empty((n, 3)),
        covariance=np.empty((blocks, 6)),
        variances=np.empty((blocks, cut.sensors)),
        usage=np.empty((blocks, cut.sensors), np.int8),
        freedom=np.empty(blocks, np.int16),
        statistic=np.empty(n),
        axis_statistic=np.empty(n),
        axis_suspect=np.empty(n, np.int16),
        unit_statistic=np.empty(n),
        unit_suspect=np.empty(n, np.int16),
        smoothed=np.empty((blocks, smoothed)),
        events=np.zeros((events, 8)),
    )


def follow_sensors(
    sensors: RedundantSensors,
    start: AxisNoise | None,
    settings: OnlineSettings,
    watch: Watch | None = None,
    *,
    adapting: bool = True,
    given: FloatArray | None = None,
    tensor: FloatArray | None = None,
    extra: FloatArray | None = None,
) -> Followed:
    """Follow one kind of sensor through a recording."""
    from schuler.kernels.arrays.redundancy import follow
    from schuler.kernels.arrays.redundancy_data import Redundancy, RedundantAxes, Remembered

    known = start is not None
    cut = _Blocks.of(sensors, settings, known=known)
    begin = start_values(sensors, cut.first) if start is None else start
    bias = begin.bias.astype(np.float64).copy()
    if settings.keep_biases:
        bias = np.zeros(cut.sensors)
    per_block = np.zeros((0, cut.sensors))
    if given is not None:
        wide = np.broadcast_to(given[:: cut.size], (cut.number, cut.sensors))
        per_block = np.ascontiguousarray(wide)
    tuning = _tuning(settings, watch, cut, adapting=adapting, known=known)
    out = _outputs(cut, tuning.smoothing.size)
    axes = RedundantAxes(
        measurements=np.ascontiguousarray(sensors.measurements),
        arm_tensor=np.zeros((0, 9)) if tensor is None else np.ascontiguousarray(tensor),
        arm=np.ascontiguousarray(arm_coefficients(sensors.axes, sensors.arms)),
        extra=np.zeros(0) if extra is None else np.ascontiguousarray(extra),
        axes=np.ascontiguousarray(sensors.axes),
        unit=np.ascontiguousarray(sensors.unit, dtype=np.int64),
        given=per_block,
    )
    hold = 1 if watch is None else max(round(watch.hold / cut.seconds), 1)
    variance = begin.variance.astype(np.float64).copy()
    memory = Remembered.begin(bias, variance, tuning.smoothing.size, hold)
    number = follow(Redundancy.of(axes, sensors.units, tuning, memory, out))
    return Followed(
        sensors,
        cut.size,
        cut.learning,
        out.fused,
        out.covariance[:, [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 3, 3),
        out.variances,
        out.usage,
        out.freedom,
        out.statistic,
        out.axis_statistic,
        out.axis_suspect,
        out.unit_statistic,
        out.unit_suspect,
        out.smoothed,
        memory.factor,
        bias,
        out.events[: min(number, EVENTS)].copy(),
        max(number - EVENTS, 0),
    )


def tuning_of_stream(learnt: Followed, settings: OnlineSettings, watch: Watch) -> Tuning:
    """Shares and thresholds for blocks that come one by one, behind what was learnt from."""
    cut = _Blocks.of(learnt.sensors, settings, known=False)
    return replace(_tuning(settings, watch, cut, adapting=True, known=False), learning=-1)


def outputs_of_block(size: int, sensors: int, constants: int) -> FollowedOutputs:
    """Room for one block."""
    return _outputs(_Blocks(size, sensors, size, 1, 0.0, 0, 0), constants, events=50)


def _numbers(values: ArrayLike) -> FloatArray:
    return np.array(values, dtype=np.float64)


def smoothing_shares(watch: Watch, seconds: float) -> FloatArray:
    """Return the share of a block in the smoothed residuals of every time constant."""
    return np.asarray(1.0 - np.exp(-seconds / np.asarray(watch.time_constants)))
