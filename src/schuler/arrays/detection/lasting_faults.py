"""Lasting faults of gyros in motion: what a healthy recording makes normal, and what is not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from schuler.arrays.calibration.disagreement import LIMITS, MOVING
from schuler.arrays.calibration.result import ArrayCalibration
from schuler.arrays.detection.window_offsets import (
    WindowOffsets,
    calibrated_rates,
    join_offsets,
    window_offsets,
)
from schuler.data import ImuArray
from schuler.data.to_dict import ToDict
from schuler.errors import EstimationError, InputError
from schuler.types import FloatArray

CLASSES = (MOVING, LIMITS[0])
"""Mean rates between rest, slower and faster motion, each with thresholds of its own, rad/s."""
TITLES = ("at rest", "below 500 deg/s", "above 500 deg/s")
LEAST = 20
"""Windows of a class from which its thresholds may be learnt."""
TAIL = 0.2
"""Share of the windows that show how the tail of a statistic falls."""
CAUTION = 2.0
"""Standard errors of the tail that are added to it."""
POWER = 1.645
"""Deviations beyond the threshold at which a fault is found with probability 0.95."""
WHITEST = 0.01
"""Least share of white scatter in the variance of means."""
SWEEPS = 50
"""Rounds of fitting the covariance."""


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
class HealthyMotion:
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


@dataclass(frozen=True, slots=True)
class LastingFault(ToDict):
    """One lasting fault.

    Parameters
    ----------
    kind : {"axis", "unit"}
        Whether one explains it as well as the other.
    name : str
        "imu 3 y", or "imu 3".
    start, stop : float
        Of the windows that showed it, s.
    size : float
        Greatest offset from the others, rad/s; for a unit that of its worst axis.
    statistic, threshold : float
        Of the window that showed it best.
    other : str
        Who else could be to blame: of two IMUs, either.
    """

    JSON = "* text"

    kind: Literal["axis", "unit"]
    name: str
    start: float
    stop: float
    size: float
    statistic: float
    threshold: float
    other: str = ""

    @property
    def text(self) -> str:
        """One line for people."""
        from schuler.units import format_value

        who = f"gyros of {self.name}" if self.kind == "unit" else f"gyro {self.name}"
        who += f" or {self.other}" if self.other else ""
        return (
            f"{self.start:.2f} s to {self.stop:.2f} s: {who} off by "
            f"{format_value(self.size, 'angular rate', digits=3)} "
            f"(F = {self.statistic:.0f} over {self.threshold:.0f})"
        )


@dataclass(frozen=True, slots=True, eq=False)
class LastingFaults:
    """What the windows of a recording say.

    Parameters
    ----------
    offsets : WindowOffsets
        Of every window.
    statistic : (w,) ndarray
        Chi-square statistic of all axes together.
    freedom : (w,) ndarray of int
        Its degrees of freedom.
    axis_statistic : (w, k, 3) ndarray
        Likelihood of a fault of an axis; zero for absent sensors.
    unit_statistic : (w, k) ndarray
        Likelihood of a fault of a unit.
    standard_deviation : (w, k) ndarray
        Of a component of an estimated fault, rad/s; infinite for absent sensors.
    normal : HealthyMotion
        Covariances and thresholds.
    names : tuple of str
        Of the IMUs.
    records : tuple of LastingFault
        The log.
    """

    offsets: WindowOffsets
    statistic: FloatArray
    freedom: NDArray[np.int64]
    axis_statistic: FloatArray
    unit_statistic: FloatArray
    standard_deviation: FloatArray
    normal: HealthyMotion
    names: tuple[str, ...]
    records: tuple[LastingFault, ...] = ()

    @property
    def healthy(self) -> bool:
        """True when no window accuses a sensor."""
        return not self.records

    @property
    def limits(self) -> tuple[str, ...]:
        """What these windows cannot show, in words."""
        said = []
        if len(self.names) == 2:
            said.append("of two IMUs a fault can be seen, but not whose it is")
        if self.offsets.skipped:
            all_ = self.offsets.skipped + self.statistic.size
            said.append(
                f"{self.offsets.skipped} of {all_} windows are not judged: too many samples are "
                "missing or saturated"
            )
        said += [
            f"the healthy recordings hold {self.normal.windows[c]} windows {TITLES[c]}: thresholds "
            "of other motion stand in"
            for c in np.unique(self.motion)
            if self.normal.windows[c] < LEAST
        ]
        said.append(
            "what lasts through all rests (without rest: through half of the recording) counts as "
            "a bias, and what all sensors share is not seen"
        )
        return tuple(said)

    @property
    def motion(self) -> NDArray[np.int64]:
        """Class of motion of each window: 0 at rest, 1 slower, 2 faster."""
        return np.digitize(self.offsets.speed, CLASSES)

    @property
    def inconsistent(self) -> NDArray[np.bool_]:
        """Windows in which all axes together are above their threshold."""
        return np.asarray(self.statistic > self.normal.thresholds[self.motion, 0])

    @property
    def excess(self) -> FloatArray:
        """How far each window is above its threshold: above 1 the likelihoods raise an alarm."""
        limit = self.normal.thresholds[self.motion]
        return np.asarray(
            np.maximum(
                self.axis_statistic.max(axis=(1, 2)) / limit[:, 1],
                self.unit_statistic.max(axis=1) / limit[:, 2],
            )
        )

    @property
    def alarm(self) -> NDArray[np.bool_]:
        """Windows with a fault of an axis or of a unit."""
        return np.asarray(self.excess > 1.0)

    @property
    def suspect(self) -> NDArray[np.int64]:
        """Most likely axis of each window, 3 times the IMU plus the component."""
        return np.asarray(self.axis_statistic.reshape(len(self.statistic), -1).argmax(axis=1))

    def exceedance(self, rate: float, rows: NDArray[np.bool_]) -> float:
        """Return the share of windows whose chi-square is beyond theory's threshold.

        Parameters
        ----------
        rate : float
            False-alarm rate of that threshold.
        rows : (w,) ndarray of bool
            Which windows to count.
        """
        from scipy.stats import chi2

        if not rows.any():
            return float("nan")
        return float(np.mean(chi2.sf(self.statistic[rows], self.freedom[rows]) < rate))

    def to_dict(self) -> dict[str, Any]:
        """Return plain Python for JSON, SI."""
        rows = self.motion
        return {
            "imus": list(self.names),
            "healthy": self.healthy,
            "limits": list(self.limits),
            "log": [r.to_dict() for r in self.records],
            "window_s": self.normal.settings.window,
            "step_s": self.normal.settings.step,
            "false_alarm_rate": self.normal.settings.false_alarm_rate,
            "windows": len(self.statistic),
            "windows_not_judged": self.offsets.skipped,
            "windows_learnt_from": self.normal.windows.tolist(),
            "covariance": {
                "colour": self.normal.colour,
                "floor_rad_s": self.normal.floor,
                "scale": self.normal.scale,
                "timing_s": self.normal.timing,
            },
            "motion": {
                title: {
                    "windows": int(np.count_nonzero(rows == c)),
                    "alarms": int(np.count_nonzero(self.alarm & (rows == c))),
                    "smallest_fault_rad_s": self.smallest_fault(c),
                }
                for c, title in enumerate(TITLES)
            },
        }

    def smallest_fault(self, motion: int) -> float | None:
        """Return the fault of an axis found with power 0.95 in half of the windows of a class.

        Parameters
        ----------
        motion : int
            0 at rest, 1 slower, 2 faster.

        Returns
        -------
        float or None
            rad/s, if the noise is Gaussian. None without windows.
        """
        rows = self.motion == motion
        if not rows.any():
            return None
        deviation = float(np.median(self.standard_deviation[rows]))
        return deviation * float(np.sqrt(self.normal.thresholds[motion, 1]) + POWER)


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
    """
    how = LastingFaultSettings() if settings is None else settings
    if not arrays:
        raise InputError("no healthy recording", expected="at least one")
    offsets = join_offsets(
        [window_offsets(calibrated_rates(calibration, a), how.window, how.step) for a in arrays]
    )
    motion = np.digitize(offsets.speed, CLASSES)
    windows = np.bincount(motion, minlength=3)
    if windows.max() < LEAST:
        raise EstimationError(
            f"{windows.sum()} windows of {how.window:g} s to learn from",
            expected=f"at least {LEAST} in one class of motion",
            cure="give a longer healthy recording",
        )
    coefficients = _fit_covariance(calibration, offsets, motion)
    draft = HealthyMotion(*coefficients, np.ones((3, 3)), windows, how)
    judged = _judge(offsets, draft, calibration.names)
    thresholds = np.full((3, 3), np.nan)
    # alarms of axes and of units share the rate
    half = 0.5 * how.false_alarm_rate
    largest = (
        (judged.statistic, how.false_alarm_rate),
        (judged.axis_statistic.max(axis=(1, 2)), half),
        (judged.unit_statistic.max(axis=1), half),
    )
    share = min(how.step / how.window, 1.0)
    for c in np.flatnonzero(windows >= LEAST):
        for s, (values, rate) in enumerate(largest):
            thresholds[c, s] = _threshold(values[motion == c], rate, share)
    thresholds = np.where(np.isnan(thresholds), np.nanmax(thresholds, axis=0), thresholds)
    return HealthyMotion(*coefficients, thresholds, windows, how)


def detect_lasting_faults(
    calibration: ArrayCalibration, array: ImuArray, healthy: HealthyMotion
) -> LastingFaults:
    """Look for lasting faults of the gyros of an array that moves.

    Parameters
    ----------
    calibration : ArrayCalibration
        Of the same IMUs.
    array : ImuArray
        In the sensors' own axes.
    healthy : HealthyMotion
        From a healthy recording.

    Returns
    -------
    LastingFaults
        Biases come from the rests of this recording (without rest, from its medians) and sampling
        phases from its motion: a fault that lasts through all of that is taken for a bias.

    Raises
    ------
    InputError
        Another number of IMUs.
    """
    how = healthy.settings
    offsets = window_offsets(calibrated_rates(calibration, array), how.window, how.step)
    return _judge(offsets, healthy, array.names)


def _fit_covariance(
    calibration: ArrayCalibration, offsets: WindowOffsets, motion: NDArray[np.int64]
) -> tuple[float, float, float, float]:
    """Colour, floor, scale and timing by non-negative least squares of squared offsets."""
    from scipy.optimize import nnls

    number = offsets.present.sum(axis=1)
    freedom = np.maximum(number - 1, 1)
    square = (offsets.offset**2).sum(axis=(1, 2)) / (3.0 * freedom)
    sampling = np.einsum("wii->w", offsets.sampling) / freedom
    # what is asked of the window is the excess over white scatter
    columns = np.stack([sampling, np.ones(sampling.size), offsets.rate**2, offsets.slope**2], 1)
    size = np.maximum(columns.mean(axis=0), 1e-300)
    # every class of motion has the same say
    share = 1.0 / np.sqrt(np.bincount(motion, minlength=3)[motion])
    explained = np.maximum(square, float(np.median(square)))
    values = np.zeros(4)
    for _ in range(SWEEPS):
        weight = share / explained
        values = nnls(columns / size * weight[:, None], square * weight)[0] / size
        explained = np.maximum(columns @ values, 1e-3 * float(np.median(square)) + 1e-300)
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


def _judge(offsets: WindowOffsets, healthy: HealthyMotion, names: tuple[str, ...]) -> LastingFaults:
    covariance = healthy.covariance(offsets)
    centring = _centring(offsets.present)
    rest = np.eye(offsets.present.shape[1]) - centring
    size = np.maximum(np.einsum("wii->w", covariance), 1e-300)[:, None, None]
    # of offsets that sum to zero
    precision = np.linalg.inv(covariance + size * rest) - rest / size
    weighted = precision @ offsets.offset
    diagonal = np.einsum("wii->wi", precision)
    diagonal = np.where(offsets.present & (diagonal > 0.0), diagonal, np.inf)
    axis = weighted**2 / diagonal[..., None]
    with np.errstate(divide="ignore"):
        deviation = np.where(np.isinf(diagonal), np.inf, 1.0 / np.sqrt(diagonal))
    found = LastingFaults(
        offsets,
        np.einsum("wia,wia->w", weighted, offsets.offset),
        3 * np.maximum(offsets.present.sum(axis=1) - 1, 0),
        axis,
        axis.sum(axis=2),
        deviation,
        healthy,
        names,
    )
    return replace(found, records=_records(found, weighted / diagonal[..., None]))


def _records(found: LastingFaults, size: FloatArray) -> tuple[LastingFault, ...]:
    """Windows in a row that accuse the same, as one line."""
    from scipy.stats import chi2

    how = found.normal.settings
    limit = found.normal.thresholds[found.motion]
    suspect = found.suspect
    unit = found.unit_statistic.argmax(axis=1)
    rows = np.arange(unit.size)
    # tails longer than theory's make this evidence weaker, too
    tests = 0.5 * how.false_alarm_rate / found.axis_statistic[0].size if unit.size else 0.5
    longer = np.maximum(limit[:, 1] / chi2.isf(tests, 1), 1.0)
    gain = found.unit_statistic[rows, unit] - found.axis_statistic.max(axis=(1, 2))
    whole = gain > longer * chi2.isf(how.unit_evidence, 2)
    accused = np.where(whole, -1 - unit, suspect)
    records: list[tuple[int, int, LastingFault]] = []
    for w in np.flatnonzero(found.alarm):
        imu = int(unit[w] if whole[w] else suspect[w] // 3)
        worst = int(np.abs(size[w, imu]).argmax()) if whole[w] else int(suspect[w] % 3)
        statistic = (
            found.unit_statistic[w, imu] if whole[w] else found.axis_statistic[w, imu, worst]
        )
        axis = "" if whole[w] else f" {'xyz'[worst]}"
        others = [n for i, n in enumerate(found.names) if i != imu and found.offsets.present[w, i]]
        one = LastingFault(
            "unit" if whole[w] else "axis",
            found.names[imu] + axis,
            float(found.offsets.start[w]),
            float(found.offsets.stop[w]),
            float(size[w, imu, worst]),
            float(statistic),
            float(limit[w, 2 if whole[w] else 1]),
            others[0] + axis if len(others) == 1 else "",
        )
        before = next((i for i in range(len(records) - 1, -1, -1)
                       if records[i][0] == accused[w]
                       and one.start <= records[i][2].stop + how.step), None)  # fmt: skip
        if before is None:
            records.append((int(accused[w]), int(w), one))
            continue
        old = records[before][2]
        best = one if one.statistic / one.threshold > old.statistic / old.threshold else old
        records[before] = (
            int(accused[w]), int(w), replace(best, start=old.start, stop=one.stop)
        )  # fmt: skip
    return tuple(r for _, _, r in records)
