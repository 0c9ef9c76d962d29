"""Faults of redundant sensors: found, put on an axis or a unit, taken out, let back in."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from schuler.arrays.common_axes import require_common_axes
from schuler.arrays.detection.fault_log import FaultRecord, fault_records
from schuler.arrays.detection.fault_settings import FaultSettings
from schuler.arrays.geometry import Geometry
from schuler.arrays.lever_arms import turning_tensor
from schuler.arrays.merit import figures_of_merit
from schuler.arrays.redundant import (
    TITLES,
    RedundantSensors,
    Sensor,
    kinds_recorded,
    redundant_sensors,
)
from schuler.arrays.synthesis.array_noise import ArrayNoise
from schuler.arrays.synthesis.least_squares import fuse_constant
from schuler.arrays.tracking import Followed, follow_sensors
from schuler.data import ImuArray
from schuler.data.exportable import Exportable
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class SensorFaults:
    """What the tests said of one kind of sensor.

    Parameters
    ----------
    followed : Followed
        Statistics, weights and usage through time.
    records : tuple of FaultRecord
        The log.
    settings : FaultSettings
        Of the tests.
    """

    followed: Followed
    records: tuple[FaultRecord, ...]
    settings: FaultSettings

    @property
    def sensor(self) -> Sensor:
        """Which kind."""
        return self.followed.sensors.sensor

    @property
    def thresholds(self) -> FloatArray:
        """Of the chi-square statistic D of each sample at the false-alarm rate, (n,)."""
        from scipy.stats import chi2

        freedom = self.followed.freedom
        degrees = np.arange(1, max(int(freedom.max()), 1) + 1)
        table: FloatArray = np.asarray(
            chi2.isf(self.settings.false_alarm_rate, degrees), dtype=np.float64
        ).reshape(-1)
        per_block = np.where(freedom > 0, table[np.maximum(freedom - 1, 0)], np.nan)
        return np.repeat(per_block, self.followed.block)[: self.followed.statistic.size]

    def exceedance(self, rate: float | None = None, rows: NDArray[np.bool_] | None = None) -> float:
        """Return the share of samples whose D is above its threshold."""
        from scipy.stats import chi2

        d = self.followed.statistic
        freedom = np.repeat(self.followed.freedom, self.followed.block)[: d.size].astype(np.float64)
        use = np.isfinite(d) & (freedom > 0.0)
        use &= True if rows is None else rows
        if not use.any():
            return float("nan")
        wanted = self.settings.false_alarm_rate if rate is None else rate
        return float(np.mean(chi2.sf(d[use], freedom[use]) < wanted))

    @property
    def spikes(self) -> dict[str, int]:
        """Single samples not used, by axis."""
        followed = self.followed
        rows = np.nan_to_num(followed.axis_statistic) > self.settings.spike**2
        number = np.bincount(followed.axis_suspect[rows], minlength=followed.sensors.count)
        return {followed.sensors.names[m]: int(number[m]) for m in np.flatnonzero(number)}

    @property
    def used_share(self) -> dict[str, float]:
        """Share of the time in which each axis was used."""
        share = (self.followed.usage == 0).mean(axis=0)
        return dict(zip(self.followed.sensors.names, share.tolist(), strict=True))


@dataclass(frozen=True, slots=True, eq=False)
class FaultDetection(Exportable):
    """What the tests said of an array.

    Parameters
    ----------
    gyro, accel : SensorFaults or None
        None: that kind was not recorded redundantly.
    names : tuple of str
        Of the IMUs.
    limits : tuple of str
        What cannot be seen or told apart, in words.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import ImuArray, Mounting, detect_faults
    >>> rng = np.random.default_rng(1)
    >>> gyro, accel = 1e-3 * rng.standard_normal((2, 6_000, 4, 3))
    >>> accel[..., 2] -= 9.81
    >>> array = ImuArray(np.arange(6_000) / 100.0, gyro, accel, Mounting.aligned(4))
    >>> found = detect_faults(array)
    >>> found.names, len(found.gyro.records)
    (('imu 1', 'imu 2', 'imu 3', 'imu 4'), 0)
    """

    gyro: SensorFaults | None
    accel: SensorFaults | None
    names: tuple[str, ...]
    limits: tuple[str, ...]

    @property
    def sensors(self) -> tuple[SensorFaults, ...]:
        """The kinds there are."""
        return tuple(s for s in (self.gyro, self.accel) if s is not None)

    @property
    def records(self) -> tuple[FaultRecord, ...]:
        """The log of all sensors, in order of time."""
        return tuple(sorted((r for s in self.sensors for r in s.records), key=lambda r: r.start))

    @property
    def healthy(self) -> bool:
        """True when nothing was taken out and no sensors contradicted one another."""
        return all(r.kind == "missing" for r in self.records)

    def to_dict(self) -> dict[str, Any]:
        """Return plain Python for JSON, SI."""
        return {
            "imus": list(self.names),
            "healthy": self.healthy,
            "limits": list(self.limits),
            "log": [r.to_dict() for r in self.records],
            "sensors": {
                s.sensor: {
                    "false_alarm_rate": s.settings.false_alarm_rate,
                    "exceedance": s.exceedance(),
                    "exceedance_at_5_percent": s.exceedance(0.05),
                    "spikes": s.spikes,
                    "used_share": s.used_share,
                    "wander_factors": s.followed.factor.tolist(),
                }
                for s in self.sensors
            },
        }


def detect_faults(
    array: ImuArray,
    settings: FaultSettings | None = None,
    *,
    noise: ArrayNoise | None = None,
    causal: bool = True,
) -> FaultDetection:
    """Look for faults of the sensors of an array, in order of time.

    Parameters
    ----------
    array : ImuArray
        Of two or more IMUs, calibrated as well as may be.
    settings : FaultSettings, optional
        How.
    noise : ArrayNoise, optional
        Noise and bias differences known beforehand; taken from the first seconds if not given.
    causal : bool
        Angular accelerations for the lever arms from the past alone; from both sides otherwise.

    Returns
    -------
    FaultDetection
        Chi-square and likelihood statistics of every sample, and a log of what was taken out and
        let back in by residuals smoothed over several time constants. Errors that all sensors
        share (of the mounting, of the clock) leave no trace (spec 6.5). Source: S002 (2)-(3);
        Daly, Gai and Harrison 1979 for the likelihood of an axis and of a unit.

    Raises
    ------
    InputError
        One IMU only, a direction that no axis measures, an IMU recorded twice, or axes that are
        not what the mounting says.
    EstimationError
        No beginning from which noise can be taken.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import ImuArray, Mounting, detect_faults
    >>> rng = np.random.default_rng(1)
    >>> four = Mounting(np.tile(np.eye(3), (4, 1, 1)), np.zeros((4, 3)))
    >>> gyro = 1e-3 * rng.standard_normal((6_000, 4, 3))
    >>> accel = np.array([0.0, 0.0, -9.81]) + 1e-2 * rng.standard_normal((6_000, 4, 3))
    >>> gyro[3_000:, 2, 0] += 0.05
    >>> found = detect_faults(ImuArray(np.arange(6_000) / 100.0, gyro, accel, four))
    >>> len(found.gyro.records) > 0
    True
    """
    how = FaultSettings() if settings is None else settings
    require_common_axes(array, broken_may_pass=True)
    kinds = kinds_recorded(array)
    found: dict[str, SensorFaults] = {}
    rate: FloatArray | None = None
    limits: list[str] = []
    for kind in kinds:
        sensors = redundant_sensors(array, kind)
        tensor, judged = None, sensors
        if kind == "accel" and rate is not None and sensors.spacing > 0.0:
            tensor = turning_tensor(sensors.time, rate, causal=causal)
            # where every gyro is saturated, nobody knows what rotation does over the lever arms
            lost = np.asarray(np.isnan(rate).any(axis=1))
            known = np.where(lost[:, None], np.nan, sensors.measurements)
            judged = replace(sensors, measurements=known) if lost.any() else sensors
        followed = follow_sensors(
            judged,
            None if noise is None else noise.of(sensors),
            how.online_of(kind),
            how.watch(sensors),
            tensor=tensor,
            extra=_motion_extra(sensors, how, rate),
        )
        if kind == "gyro":
            rate = followed.fused
        found[kind] = SensorFaults(
            followed, fault_records(followed.events, sensors, how.time_constants), how
        )
        limits += _limits(sensors)
    return FaultDetection(found.get("gyro"), found.get("accel"), array.names, tuple(limits))


def _motion_extra(
    sensors: RedundantSensors, settings: FaultSettings, rate: FloatArray | None
) -> FloatArray | None:
    """Return the variance that motion may add, from the plain mean of the sensors."""
    gyros = sensors.sensor == "gyro"
    none = np.zeros((2, 3))
    if settings.motion_variance(np.arange(2.0), none, sensors.sensor, none) is None:
        return None
    fused, _, _ = fuse_constant(sensors.measurements, sensors.axes, np.ones(sensors.count))
    return settings.motion_variance(sensors.time, fused, sensors.sensor, None if gyros else rate)


def _limits(sensors: RedundantSensors) -> list[str]:
    geometry = Geometry(sensors.axes, sensors.unit, "array", sensors.names)
    said = [
        f"{TITLES[sensors.sensor].capitalize()}: {s}" for s in figures_of_merit(geometry).statements
    ]
    if sensors.units == 2 and not said:
        said = [
            f"{TITLES[sensors.sensor].capitalize()}: with two units a fault of a whole unit can be "
            "detected but not isolated."
        ]
    return said
