"""Aiding measurements: what GNSS says about position and velocity, on the time axis of the IMU.

An aiding source turns a recording into rows of a schedule; the filter kernel knows how each kind
of row is compared with the state (kernels/update.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.data import GnssRecording
from schuler.errors import InputError, NavigationError

FloatArray = NDArray[np.float64]

POSITION = 0
VELOCITY = 1
VEHICLE_VELOCITY = 2
ZERO_VELOCITY = 3
ZERO_RATE = 4
KIND_NAMES = (
    "GNSS position",
    "GNSS velocity",
    "velocity across the vehicle",
    "zero velocity",
    "zero rate",
)


@dataclass(frozen=True, slots=True, eq=False)
class AidingSchedule:
    """Measurements in the order of their time.

    Parameters
    ----------
    time : (u,) ndarray
        Seconds on the IMU's axis.
    kind : (u,) ndarray of int
        Index into `KIND_NAMES`.
    value : (u, 3) ndarray
        In the units of the kind.
    variance : (u, 3) ndarray
        North, east, down; infinite where a component was not measured.
    lever_arm : (u, 3) ndarray
        Of the sensor from the IMU in the body frame, m.
    """

    time: FloatArray
    kind: NDArray[np.int64]
    value: FloatArray
    variance: FloatArray
    lever_arm: FloatArray

    @property
    def size(self) -> int:
        """Number of measurements."""
        return int(self.time.size)


class Aiding(Protocol):
    """Anything that can tell the filter something about its state."""

    def rows(self) -> AidingSchedule:
        """Return its measurements; they need not be sorted."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class GnssPosition:
    """Positions of a GNSS antenna.

    Parameters
    ----------
    recording : GnssRecording
        With known standard deviations.
    lever_arm : (3,) array_like
        Antenna from IMU in the body frame, m.
    time_offset : float
        Added to GNSS time to get the time on the IMU's axis, s.
    sd_factor : float
        Multiplies the receiver's own standard deviations.
    """

    recording: GnssRecording
    lever_arm: ArrayLike = (0.0, 0.0, 0.0)
    time_offset: float = 0.0
    sd_factor: float = 1.0

    def rows(self) -> AidingSchedule:
        """Return one row an epoch.

        Returns
        -------
        AidingSchedule
            Kind `POSITION`.

        Raises
        ------
        InputError
            Standard deviations are not known.
        """
        sd = _known(self.recording.position_sd, self.recording, "position")
        return _schedule(
            self.recording.time + self.time_offset,
            POSITION,
            self.recording.position,
            sd * self.sd_factor,
            self.lever_arm,
        )


@dataclass(frozen=True, slots=True, eq=False)
class GnssVelocity:
    """Velocities of a GNSS antenna, north, east, down. Parameters as `GnssPosition`."""

    recording: GnssRecording
    lever_arm: ArrayLike = (0.0, 0.0, 0.0)
    time_offset: float = 0.0
    sd_factor: float = 1.0

    def rows(self) -> AidingSchedule:
        """Return one row an epoch, none if the receiver gave no velocity.

        Returns
        -------
        AidingSchedule
            Kind `VELOCITY`.

        Raises
        ------
        InputError
            Standard deviations are not known.
        """
        velocity = self.recording.velocity
        if velocity is None:
            return _schedule(
                np.empty(0), VELOCITY, np.empty((0, 3)), np.empty((0, 3)), self.lever_arm
            )
        sd = _known(self.recording.velocity_sd, self.recording, "velocity")
        return _schedule(
            self.recording.time + self.time_offset,
            VELOCITY,
            velocity,
            sd * self.sd_factor,
            self.lever_arm,
        )


def merge_schedules(parts: Sequence[AidingSchedule], start: float, stop: float) -> AidingSchedule:
    """Sort several schedules into one and keep what falls inside the IMU's time.

    Parameters
    ----------
    parts : sequence of AidingSchedule
        Any order.
    start, stop : float
        First and last time of the IMU, s.

    Returns
    -------
    AidingSchedule
        Sorted by time; at equal times in the order of the parts.
    """
    time = np.concatenate([p.time for p in parts])
    order = np.argsort(time, kind="stable")
    order = order[(time[order] >= start) & (time[order] <= stop)]
    return AidingSchedule(
        time=np.ascontiguousarray(time[order]),
        kind=np.concatenate([p.kind for p in parts])[order],
        value=np.concatenate([p.value for p in parts])[order],
        variance=np.concatenate([p.variance for p in parts])[order],
        lever_arm=np.concatenate([p.lever_arm for p in parts])[order],
    )


def require_overlap(gnss: GnssRecording, start: float, stop: float) -> None:
    """Raise when no GNSS epoch falls inside the time of the IMU.

    Parameters
    ----------
    gnss : GnssRecording
        The fixes.
    start, stop : float
        First and last time of the IMU, s.

    Raises
    ------
    NavigationError
        No overlap.
    """
    if gnss.time[-1] < start or gnss.time[0] > stop:
        raise NavigationError(
            f"GNSS covers {gnss.time[0]:.3f} to {gnss.time[-1]:.3f} s, the IMU "
            f"{start:.3f} to {stop:.3f} s: they do not overlap",
            expected="recordings of the same time on one time axis",
            cure="bring both to one time scale (leap seconds, week, epoch)",
            where=gnss.name,
        )


def _schedule(
    time: FloatArray, kind: int, value: FloatArray, sd: FloatArray, lever_arm: ArrayLike
) -> AidingSchedule:
    arm = np.asarray(lever_arm, dtype=np.float64)
    if arm.shape != (3,) or not np.isfinite(arm).all():
        raise InputError(f"lever arm is {lever_arm!r}", expected="three finite numbers in m")
    return AidingSchedule(
        time=time,
        kind=np.full(time.size, kind, dtype=np.int64),
        value=value,
        variance=sd**2,
        lever_arm=np.tile(arm, (time.size, 1)),
    )


def _known(sd: FloatArray | None, recording: GnssRecording, what: str) -> FloatArray:
    if sd is None or np.isnan(sd).any():
        missing = recording.size if sd is None else int(np.isnan(sd).any(axis=1).sum())
        raise InputError(
            f"GNSS {what} has no standard deviation in {missing} of {recording.size} epochs",
            expected="one for every epoch",
            cure=f"give one for all with --gnss-{what}-sd",
            where=recording.name,
        )
    return sd
