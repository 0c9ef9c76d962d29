"""Lasting faults of gyros in motion: windows that healthy recordings do not explain."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.arrays.calibration.result import ArrayCalibration
from schuler.arrays.detection.fault_log import FaultRecord
from schuler.arrays.detection.healthy_motion import (
    LEAST,
    HealthyMotion,
    WindowStatistics,
    motion_class,
    window_statistics,
)
from schuler.arrays.detection.window_offsets import WindowOffsets, calibrated_rates, window_offsets
from schuler.data import ImuArray
from schuler.data.exportable import Exportable
from schuler.types import FloatArray

TITLES = ("at rest", "below 500 deg/s", "above 500 deg/s")
POWER = 1.645
"""Deviations beyond the threshold at which a fault is found with probability 0.95."""


@dataclass(frozen=True, slots=True, eq=False)
class LastingFaults(Exportable):
    """What the windows of a recording say.

    Parameters
    ----------
    offsets : WindowOffsets
        Of every window.
    tests : WindowStatistics
        Of every window.
    normal : HealthyMotion
        Covariances and thresholds.
    names : tuple of str
        Of the IMUs.
    records : tuple of FaultRecord
        The log.

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
    >>> len(schuler.detect_lasting_faults(found, array, healthy).names)
    4
    """

    offsets: WindowOffsets
    tests: WindowStatistics
    normal: HealthyMotion
    names: tuple[str, ...]
    records: tuple[FaultRecord, ...] = ()

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
    def statistic(self) -> FloatArray:
        """Chi-square statistic of all axes together, (w,)."""
        return self.tests.total

    @property
    def freedom(self) -> NDArray[np.int64]:
        """Degrees of freedom of it, (w,)."""
        return np.asarray(3 * np.maximum(self.offsets.present.sum(axis=1) - 1, 0))

    @property
    def motion(self) -> NDArray[np.int64]:
        """Class of motion of each window: 0 at rest, 1 slower, 2 faster."""
        return motion_class(self.offsets)

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
                self.tests.axis.max(axis=(1, 2)) / limit[:, 1],
                self.tests.unit.max(axis=1) / limit[:, 2],
            )
        )

    @property
    def alarm(self) -> NDArray[np.bool_]:
        """Windows with a fault of an axis or of a unit."""
        return np.asarray(self.excess > 1.0)

    @property
    def suspect(self) -> NDArray[np.int64]:
        """Most likely axis of each window, 3 times the IMU plus the component."""
        return np.asarray(self.tests.axis.reshape(len(self.statistic), -1).argmax(axis=1))

    def exceedance(self, rate: float, rows: NDArray[np.bool_]) -> float:
        """Return the share of some windows whose chi-square is beyond theory's threshold."""
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
            "log": [r.to_dict() | {"start": r.start, "stop": r.stop} for r in self.records],
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
        """Return the fault found with power 0.95 in half of the windows of a class, rad/s.

        For Gaussian noise; None without windows.
        """
        rows = self.motion == motion
        if not rows.any():
            return None
        deviation = float(np.median(self.tests.deviation[rows]))
        return deviation * float(np.sqrt(self.normal.thresholds[motion, 1]) + POWER)


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
    >>> len(schuler.detect_lasting_faults(found, array, healthy).names)
    4
    """
    how = healthy.settings
    offsets = window_offsets(calibrated_rates(calibration, array), how.window, how.step)
    tests = window_statistics(offsets, healthy.covariance(offsets))
    found = LastingFaults(offsets, tests, healthy, array.names)
    return replace(found, records=_records(found))


def _records(found: LastingFaults) -> tuple[FaultRecord, ...]:
    """Windows in a row that accuse the same, as one line."""
    whole, unit = _whole_units(found)
    accused = np.where(whole, -1 - unit, found.suspect)
    records: list[FaultRecord] = []
    latest: dict[int, tuple[int, float]] = {}
    for w in np.flatnonzero(found.alarm):
        key, stop = int(accused[w]), float(found.offsets.stop[w])
        one = _record(found, int(w), int(unit[w]) if whole[w] else None)
        place, before = latest.get(key, (-1, -np.inf))
        if one.start > before + found.normal.settings.step:
            records.append(one)
            latest[key] = (len(records) - 1, stop)
            continue
        old = records[place]
        best = one if one.statistic / one.threshold > old.statistic / old.threshold else old
        records[place] = replace(best, start=old.start, stop=stop)
        latest[key] = (place, stop)
    return tuple(records)


def _whole_units(found: LastingFaults) -> tuple[NDArray[np.bool_], NDArray[np.int64]]:
    """In which windows a whole unit explains more than its worst axis, and which unit."""
    from scipy.stats import chi2

    how, tests = found.normal.settings, found.tests
    limit = found.normal.thresholds[found.motion]
    unit = tests.unit.argmax(axis=1)
    # tails longer than theory's make this evidence weaker, too
    rate = 0.5 * how.false_alarm_rate / tests.axis[0].size if unit.size else 0.5
    longer = np.maximum(limit[:, 1] / float(chi2.isf(rate, 1)), 1.0)
    gain = tests.unit[np.arange(unit.size), unit] - tests.axis.max(axis=(1, 2))
    return np.asarray(gain > longer * float(chi2.isf(how.unit_evidence, 2))), unit


def _record(found: LastingFaults, w: int, unit: int | None) -> FaultRecord:
    """What one window accuses: a unit, or the axis it suspects."""
    tests, limit = found.tests, found.normal.thresholds[found.motion[w]]
    suspect = int(found.suspect[w])
    imu = suspect // 3 if unit is None else unit
    worst = suspect % 3 if unit is None else int(np.abs(tests.size[w, imu]).argmax())
    axis = f" {'xyz'[worst]}" if unit is None else ""
    others = [n for i, n in enumerate(found.names) if i != imu and found.offsets.present[w, i]]
    return FaultRecord(
        "gyro",
        "axis" if unit is None else "unit",
        found.names[imu] + axis,
        float(found.offsets.start[w]),
        float(found.offsets.stop[w]),
        float(tests.size[w, imu, worst]),
        float(tests.axis[w, imu, worst] if unit is None else tests.unit[w, imu]),
        float(limit[1 if unit is None else 2]),
        None,
        others[0] + axis if len(others) == 1 else "",
        taken_out=False,
    )
