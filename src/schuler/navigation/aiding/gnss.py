"""Aiding measurements: what GNSS says about position and velocity, on the time axis of the IMU.

An aiding source turns a recording into rows of a schedule; the filter kernel knows how each kind
of row is compared with the state (kernels/update.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.data import GnssRecording
from schuler.errors import InputError, NavigationError
from schuler.kernels.filter_data import AIDING_ROW
from schuler.types import FloatArray

POSITION = 0
VELOCITY = 1
VEHICLE_VELOCITY = 2
ZERO_VELOCITY = 3
ZERO_RATE = 4
LINEAR = 5
HEADING = 6
MAGNETIC_FIELD = 7
BAROMETER = 8
KIND_NAMES = (
    "GNSS position",
    "GNSS velocity",
    "velocity across the vehicle",
    "zero velocity",
    "zero rate",
    "linear function of sensor states",
    "heading",
    "magnetic field",
    "height by barometer",
)
# a velocity in vehicle axes that was measured forward, not supposed across
WHEEL_SPEED_NAME = "speed from wheel vibration"


def _none() -> NDArray[np.int64]:
    return np.empty(0, dtype=np.int64)


def _no_matrices() -> FloatArray:
    return np.empty((0, 3, 0))


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
    offset_state : (u, 3) ndarray of int
        For each component the place among the sensor states of an error that adds to what is
        measured (a Gauss-Markov error of GNSS, a barometer's bias); -1, and left out: none.
    matrix : (u,) ndarray of int
        Which of `matrices` belongs to a measurement of kind `LINEAR`; -1 elsewhere.
    matrices : (t, 3, m) ndarray
        G of the measurements z = G x + noise of the m sensor states x (true values), value z,
        `variance` of the noise. More than three rows are several measurements at one time;
        correlated noise has to be whitened before.
    """

    time: FloatArray
    kind: NDArray[np.int64]
    value: FloatArray
    variance: FloatArray
    lever_arm: FloatArray
    offset_state: NDArray[np.int64] = field(default_factory=_none)
    matrix: NDArray[np.int64] = field(default_factory=_none)
    matrices: FloatArray = field(default_factory=_no_matrices)

    def __post_init__(self) -> None:
        if self.offset_state.size == 0:
            object.__setattr__(self, "offset_state", np.full((self.size, 3), -1, dtype=np.int64))
        if self.matrix.size == 0:
            object.__setattr__(self, "matrix", np.full(self.size, -1, dtype=np.int64))

    @property
    def size(self) -> int:
        """Number of measurements."""
        return int(self.time.size)

    def table(self) -> NDArray[np.void]:
        """Return the measurements as rows of `AIDING_ROW`.

        Returns
        -------
        (u,) ndarray
            As the kernel wants them.
        """
        rows = np.zeros(self.size, dtype=AIDING_ROW)
        rows["time"], rows["kind"] = self.time, self.kind
        rows["value"], rows["variance"] = self.value, self.variance
        rows["lever"], rows["offset"] = self.lever_arm, self.offset_state
        rows["matrix"] = self.matrix
        return rows

    def select(self, keep: NDArray[np.bool_] | slice) -> AidingSchedule:
        """Return some of the measurements."""
        return replace(
            self,
            time=self.time[keep],
            kind=self.kind[keep],
            value=self.value[keep],
            variance=self.variance[keep],
            lever_arm=self.lever_arm[keep],
            offset_state=self.offset_state[keep],
            matrix=self.matrix[keep],
        )


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
        """Return one row an epoch."""
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
        """Return one row an epoch, none if the receiver gave no velocity."""
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
    """Sort several schedules into one and keep what falls inside the IMU's time."""
    time = np.concatenate([p.time for p in parts])
    order = np.argsort(time, kind="stable")
    order = order[(time[order] >= start) & (time[order] <= stop)]
    tables = [p.matrices for p in parts if p.matrices.size]
    before = np.cumsum([0, *(len(p.matrices) if p.matrices.size else 0 for p in parts)])
    matrix = [
        np.where(p.matrix >= 0, p.matrix + k, -1) for p, k in zip(parts, before, strict=False)
    ]
    return AidingSchedule(
        time=np.ascontiguousarray(time[order]),
        kind=np.concatenate([p.kind for p in parts])[order],
        value=np.concatenate([p.value for p in parts])[order],
        variance=np.concatenate([p.variance for p in parts])[order],
        lever_arm=np.concatenate([p.lever_arm for p in parts])[order],
        offset_state=np.concatenate([p.offset_state for p in parts])[order],
        matrix=np.concatenate(matrix)[order],
        matrices=np.concatenate(tables) if tables else _no_matrices(),
    )


def linear_measurements(
    time: ArrayLike, value: ArrayLike, matrix: ArrayLike, covariance: ArrayLike
) -> AidingSchedule:
    """Measure linear functions of the sensor states: z = G x + noise. Spec 7.5."""
    when = np.atleast_1d(np.asarray(time, dtype=np.float64))
    z = np.atleast_2d(np.asarray(value, dtype=np.float64))
    g = np.atleast_2d(np.asarray(matrix, dtype=np.float64))
    rows, count = g.shape[0], when.size
    if z.shape != (count, rows) or np.shape(covariance) != (rows, rows):
        raise InputError(
            f"values of shape {z.shape}, a matrix of {g.shape}, a covariance of "
            f"{np.shape(covariance)} at {count} times",
            expected="(times, r), (r, states) and (r, r)",
        )
    try:
        whiten = np.linalg.inv(np.linalg.cholesky(np.asarray(covariance, dtype=np.float64)))
    except np.linalg.LinAlgError as error:
        raise InputError(
            "the covariance of a linear measurement is not positive definite",
            expected="independent rows, each with noise",
        ) from error
    parts = -(-rows // 3)
    table, values = np.zeros((3 * parts, g.shape[1])), np.zeros((count, 3 * parts))
    variance = np.full((count, 3 * parts), np.inf)
    table[:rows], values[:, :rows], variance[:, :rows] = whiten @ g, z @ whiten.T, 1.0
    return AidingSchedule(
        time=np.repeat(when, parts),
        kind=np.full(count * parts, LINEAR, dtype=np.int64),
        value=values.reshape(-1, 3),
        variance=variance.reshape(-1, 3),
        lever_arm=np.zeros((count * parts, 3)),
        matrix=np.tile(np.arange(parts), count),
        matrices=table.reshape(parts, 3, -1),
    )


def require_overlap(gnss: GnssRecording, start: float, stop: float) -> None:
    """Raise when no GNSS epoch falls inside the time of the IMU."""
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
