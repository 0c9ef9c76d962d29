"""What healthy recordings make normal for offsets of gyros in windows of motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.arrays.calibration.disagreement import LIMITS, MOVING
from schuler.arrays.calibration.result import ArrayCalibration
from schuler.arrays.detection.motion_errors import fit_variances
from schuler.arrays.detection.window_offsets import (
    WindowOffsets,
    calibrated_rates,
    join_offsets,
    window_offsets,
)
from schuler.data import ImuArray
from schuler.data.exportable import Exportable
from schuler.errors import EstimationError, InputError
from schuler.types import FloatArray

CLASSES = (MOVING, LIMITS[0])
"""Mean rates between rest, slower and faster motion, each with thresholds of its own, rad/s."""
LEAST = 20
"""Windows of a class from which its thresholds may be learnt."""
TAIL = 0.2
"""Share of the windows that show how the tail of a statistic falls."""
CAUTION = 2.0
"""Standard errors of the tail that are added to it."""
WHITEST = 0.01
"""Least share of white scatter in the variance of means."""


@dataclass(frozen=True, slots=True, kw_only=True)
class LastingFaultSettings:
    """How lasting faults are looked for.

    Parameters
    ----------
    window : float
        Length of the windows, s.
    step : float
        From one window to the next, s.
    false_alarm_rate : float
        Probability that a window without fault raises an alarm.
    unit_evidence : float
        Probability with which a fault of one axis may be taken for one of its whole unit.

    Examples
    --------
    >>> from schuler import LastingFaultSettings
    >>> LastingFaultSettings(window=2.0).step
    0.25
    """

    window: float = 1.0
    step: float = 0.25
    false_alarm_rate: float = 0.01
    unit_evidence: float = 0.001

    def __post_init__(self) -> None:
        if not (0.0 < self.false_alarm_rate < TAIL and 0.0 < self.unit_evidence < 1.0):
            raise InputError(
                f"probabilities {self.false_alarm_rate:g} and {self.unit_evidence:g}",
                expected=f"false alarms below {TAIL:g} of the windows, evidence between 0 and 1",
            )
        if not (self.window > 0.0 and self.step > 0.0):
            raise InputError(
                f"windows of {self.window:g} s every {self.step:g} s", expected="positive times"
            )


@dataclass(frozen=True, slots=True, eq=False)
class HealthyMotion(Exportable):
    """What a healthy recording says of offsets in windows of motion.

    The covariance of the offsets of one component is colour times what the scatter within the
    window explains, plus floor² + (scale |w|)² + (timing |dw/dt|)² for each sensor alone, w and
    dw/dt being means over the window.

    Parameters
    ----------
    colour : float
        How much larger the variance of means is than white scatter makes it; below 1 where the
        sensors shake, because vibration averages out sooner.
    floor : float
        rad/s.
    scale : float
        What scale factors and misalignments leave, as a share of the rate.
    timing : float
        What timing leaves, s.
    thresholds : (3, 3) ndarray
        Of the statistics of all axes, of an axis and of a unit, at rest, in slower and in faster
        motion (`CLASSES`).
    windows : (3,) ndarray of int
        Windows of each class. Where they were too few, the thresholds are the largest of the
        others.
    settings : LastingFaultSettings
        With which it was learnt.

    Examples
    --------
    >>> import numpy as np
    >>> import schuler
    >>> rng, time = np.random.default_rng(1), np.arange(2_000) / 50.0
    >>> rate = np.stack([np.sin(f * time) for f in (2.3, 3.1, 4.7)], axis=1)[:, None]
    >>> force = rate * 2.0 + (0.0, 0.0, 9.81)
    >>> gyro = rate + 1e-3 * rng.standard_normal((2_000, 4, 3))
    >>> accel = force + 1e-2 * rng.standard_normal((2_000, 4, 3))
    >>> array = schuler.ImuArray(time, gyro, accel, schuler.Mounting.aligned(4))
    >>> found = schuler.calibrate_array(array)
    >>> healthy = schuler.learn_healthy_motion(found, [array])
    >>> healthy.settings.window
    1.0
    """

    colour: float
    floor: float
    scale: float
    timing: float
    thresholds: FloatArray
    windows: NDArray[np.int64]
    settings: LastingFaultSettings

    def covariance(self, offsets: WindowOffsets) -> FloatArray:
        """Return the covariance of one component of the offsets, (w, k, k), (rad/s)².

        Parameters
        ----------
        offsets : WindowOffsets
            Of the same array.
        """
        own = self.floor**2 + (self.scale * offsets.rate) ** 2 + (self.timing * offsets.slope) ** 2
        return np.asarray(
            self.colour * offsets.sampling + own[:, None, None] * _centring(offsets.present)
        )


@dataclass(frozen=True, slots=True, eq=False)
class WindowStatistics:
    """How far the offsets of windows are from what is normal.

    Parameters
    ----------
    total : (w,) ndarray
        Chi-square statistic of all axes together.
    axis : (w, k, 3) ndarray
        Likelihood of a fault of an axis; zero for absent sensors.
    size : (w, k, 3) ndarray
        Of that fault, rad/s.
    deviation : (w, k) ndarray
        Standard deviation of the size, rad/s; infinite for absent sensors.
    """

    total: FloatArray
    axis: FloatArray
    size: FloatArray
    deviation: FloatArray

    @property
    def unit(self) -> FloatArray:
        """Likelihood of a fault of a unit, (w, k)."""
        return np.asarray(self.axis.sum(axis=2))


def learn_healthy_motion(
    calibration: ArrayCalibration,
    arrays: Sequence[ImuArray],
    settings: LastingFaultSettings | None = None,
) -> HealthyMotion:
    """Learn from recordings without faults how far offsets go in motion.

    Parameters
    ----------
    calibration : ArrayCalibration
        Of the same IMUs; it may come from one of these very recordings.
    arrays : sequence of ImuArray
        Healthy, in the sensors' own axes, with rests and the kinds of motion to come.
    settings : LastingFaultSettings, optional
        How.

    Returns
    -------
    HealthyMotion
        Four coefficients of the covariance by least squares, not negative, relative to what they
        explain; and thresholds, because knocks and wander have longer tails than the covariance
        makes. A threshold is the quantile of the largest statistic of a window, with the tail
        above its 80 % quantile taken as exponential and 2 standard errors longer than seen.

    Raises
    ------
    InputError
        No recording, or another number of IMUs.
    EstimationError
        Too few windows.

    Examples
    --------
    >>> import numpy as np
    >>> import schuler
    >>> rng, time = np.random.default_rng(1), np.arange(2_000) / 50.0
    >>> rate = np.stack([np.sin(f * time) for f in (2.3, 3.1, 4.7)], axis=1)[:, None]
    >>> force = rate * 2.0 + (0.0, 0.0, 9.81)
    >>> gyro = rate + 1e-3 * rng.standard_normal((2_000, 4, 3))
    >>> accel = force + 1e-2 * rng.standard_normal((2_000, 4, 3))
    >>> array = schuler.ImuArray(time, gyro, accel, schuler.Mounting.aligned(4))
    >>> found = schuler.calibrate_array(array)
    >>> healthy = schuler.learn_healthy_motion(found, [array])
    >>> healthy.settings.window
    1.0
    """
    how = LastingFaultSettings() if settings is None else settings
    if not arrays:
        raise InputError("no healthy recording", expected="at least one")
    offsets = join_offsets(
        [window_offsets(calibrated_rates(calibration, a), how.window, how.step) for a in arrays]
    )
    motion = motion_class(offsets)
    windows = np.bincount(motion, minlength=3)
    if windows.max() < LEAST:
        raise EstimationError(
            f"{windows.sum()} windows of {how.window:g} s to learn from",
            expected=f"at least {LEAST} in one class of motion",
            cure="give a longer healthy recording",
        )
    coefficients = _fit_covariance(calibration, offsets, motion)
    judged = window_statistics(
        offsets, HealthyMotion(*coefficients, np.ones((3, 3)), windows, how).covariance(offsets)
    )
    thresholds = np.full((3, 3), np.nan)
    # alarms of axes and of units share the rate
    half = 0.5 * how.false_alarm_rate
    largest = (
        (judged.total, how.false_alarm_rate),
        (judged.axis.max(axis=(1, 2)), half),
        (judged.unit.max(axis=1), half),
    )
    share = min(how.step / how.window, 1.0)
    for c in np.flatnonzero(windows >= LEAST):
        for s, (values, rate) in enumerate(largest):
            thresholds[c, s] = _threshold(values[motion == c], rate, share)
    thresholds = np.where(np.isnan(thresholds), np.nanmax(thresholds, axis=0), thresholds)
    return HealthyMotion(*coefficients, thresholds, windows, how)


def motion_class(offsets: WindowOffsets) -> NDArray[np.int64]:
    """Return the class of motion of each window: 0 at rest, 1 slower, 2 faster."""
    return np.digitize(offsets.speed, CLASSES)


def window_statistics(offsets: WindowOffsets, covariance: FloatArray) -> WindowStatistics:
    """Test the offsets of windows, which sum to zero, against a covariance of a component."""
    centring = _centring(offsets.present)
    rest = np.eye(offsets.present.shape[1]) - centring
    size = np.maximum(np.einsum("wii->w", covariance), 1e-300)[:, None, None]
    precision = np.linalg.inv(covariance + size * rest) - rest / size
    weighted = precision @ offsets.offset
    diagonal = np.einsum("wii->wi", precision)
    diagonal = np.where(offsets.present & (diagonal > 0.0), diagonal, np.inf)
    with np.errstate(divide="ignore"):
        deviation = np.where(np.isinf(diagonal), np.inf, 1.0 / np.sqrt(diagonal))
    return WindowStatistics(
        np.einsum("wia,wia->w", weighted, offsets.offset),
        weighted**2 / diagonal[..., None],
        weighted / diagonal[..., None],
        deviation,
    )


def _fit_covariance(
    calibration: ArrayCalibration, offsets: WindowOffsets, motion: NDArray[np.int64]
) -> tuple[float, float, float, float]:
    """Colour, floor, scale and timing by non-negative least squares of squared offsets."""
    number = offsets.present.sum(axis=1)
    freedom = np.maximum(number - 1, 1)
    square = (offsets.offset**2).sum(axis=(1, 2)) / (3.0 * freedom)
    sampling = np.einsum("wii->w", offsets.sampling) / freedom
    # what is asked of the window is the excess over white scatter
    columns = np.stack([sampling, np.ones(sampling.size), offsets.rate**2, offsets.slope**2], 1)
    # every class of motion has the same say
    share = 1.0 / np.sqrt(np.bincount(motion, minlength=3)[motion])
    values = fit_variances(columns, square, share)
    # the calibration's own error is new in every other recording
    scale = values[2] + float(np.mean(calibration.gyro_deviation_sd**2))
    return (
        max(float(values[0]), WHITEST),
        float(np.sqrt(values[1])),
        float(np.sqrt(scale)),
        float(np.sqrt(values[3])),
    )


def _threshold(values: FloatArray, rate: float, share: float) -> float:
    """Quantile of 1 - rate, the tail exponential; windows that overlap count as their share."""
    start = float(np.quantile(values, 1.0 - TAIL))
    above = values[values > start] - start
    if not above.size:
        return start
    error = 1.0 / np.sqrt(max(above.size * share, 1.0))
    tail = start + float(above.mean()) * (1.0 + CAUTION * error) * np.log(TAIL / rate)
    return float(max(tail, np.quantile(values, 1.0 - rate)))


def _centring(present: NDArray[np.bool_]) -> FloatArray:
    """I - 11'/k of the sensors that are there, (w, k, k)."""
    mean = present / np.sqrt(np.maximum(present.sum(axis=1, keepdims=True), 1))
    same = present[:, :, None] * np.eye(present.shape[1])
    return np.asarray(same - mean[:, :, None] * mean[:, None, :])
