"""What aids a filter: sources of measurements, their kinds, and one schedule of all of them.

A source turns what it knows into rows of a schedule; the filter kernel knows how each kind of row
is compared with the state (kernels/navigation/aiding.py). Kinds without an equation of their own
are `GENERAL`: their rows carry their derivatives (aiding/general.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import InputError
from schuler.kernels.navigation.filter_data import AIDING_ROW
from schuler.types import FloatArray

if TYPE_CHECKING:
    from schuler.navigation.aiding.general import GeneralRow
    from schuler.navigation.error_models.sensor_states import SensorErrorModel

POSITION = 0
VELOCITY = 1
VEHICLE_VELOCITY = 2
ZERO_VELOCITY = 3
ZERO_RATE = 4
LINEAR = 5
HEADING = 6
MAGNETIC_FIELD = 7
BAROMETER = 8
GENERAL = 9
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
    "general",
)
# a velocity in vehicle axes that was measured forward, not supposed across
WHEEL_SPEED_NAME = "speed from wheel vibration"


def _none() -> NDArray[np.int64]:
    return np.empty(0, dtype=np.int64)


def _no_matrices() -> FloatArray:
    return np.empty((0, 3, 0))


@dataclass(frozen=True, slots=True, eq=False)
class AidingSchedule:
    """Measurements in the order of their time."""

    time: FloatArray  # (u,): seconds on the IMU's axis
    kind: NDArray[np.int64]  # (u,): index into `KIND_NAMES`
    value: FloatArray  # (u, 3): in the units of the kind
    variance: FloatArray  # (u, 3): north, east, down; infinite where a component was not measured.
    lever_arm: FloatArray  # (u, 3): of the sensor from the IMU in the body frame, m
    # (u, 3): for each component the place among the sensor states of an error that adds to what is
    # measured (a Gauss-Markov error of GNSS, a barometer's bias); -1, and left out: none.
    offset_state: NDArray[np.int64] = field(default_factory=_none)
    # (u,): which of `matrices` belongs to a measurement of kind `LINEAR`; -1 elsewhere.
    matrix: NDArray[np.int64] = field(default_factory=_none)
    # (t, 3, 12 + m): of kinds `LINEAR` and `GENERAL`: the attitude C_nb that the derivatives belong
    # to, then those of what is predicted by position (m), velocity, attitude error and the m sensor
    # states. The position that they belong to is in `lever_arm`, and `value` is what is predicted
    # at it less the innovation there. More than three rows are several measurements at one time;
    # correlated noise has to be whitened before.
    matrices: FloatArray = field(default_factory=_no_matrices)
    # for each of `matrices` what fills it in when the filter comes by; None: it is full.
    general: tuple[GeneralRow | None, ...] = ()
    # (u, 3): by which that state is multiplied; one where left out.
    offset_scale: FloatArray = field(default_factory=lambda: np.empty((0, 3)))

    def __post_init__(self) -> None:
        if self.offset_state.size == 0:
            object.__setattr__(self, "offset_state", np.full((self.size, 3), -1, dtype=np.int64))
        if self.offset_scale.size == 0:
            object.__setattr__(self, "offset_scale", np.ones((self.size, 3)))
        if self.matrix.size == 0:
            object.__setattr__(self, "matrix", np.full(self.size, -1, dtype=np.int64))

    @property
    def size(self) -> int:
        """Number of measurements."""
        return int(self.time.size)

    def table(self) -> NDArray[np.void]:
        """Return the measurements as rows of `AIDING_ROW`, as the kernel wants them."""
        rows = np.zeros(self.size, dtype=AIDING_ROW)
        rows["time"], rows["kind"] = self.time, self.kind
        rows["value"], rows["variance"] = self.value, self.variance
        rows["lever"], rows["offset"] = self.lever_arm, self.offset_state
        rows["offset_scale"], rows["matrix"] = self.offset_scale, self.matrix
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
            offset_scale=self.offset_scale[keep],
        )


class Aiding(Protocol):
    """Anything that can tell the filter something about its state."""

    def rows(self) -> AidingSchedule:
        """Return its measurements; they need not be sorted."""
        ...


class PlacedAiding(Aiding, Protocol):
    """A source of measurements that may bring states of its own."""

    def placed(self, model: SensorErrorModel) -> tuple[SensorErrorModel, Self]:
        """Return the model with the states of the source, and the source that knows them."""
        ...


def merge_schedules(parts: Sequence[AidingSchedule], start: float, stop: float) -> AidingSchedule:
    """Sort several schedules into one and keep what falls inside the IMU's time."""
    time = np.concatenate([p.time for p in parts])
    order = np.argsort(time, kind="stable")
    order = order[(time[order] >= start) & (time[order] <= stop)]
    before = np.cumsum([0, *(len(p.matrices) for p in parts)])
    widest = max((p.matrices.shape[2] for p in parts if p.matrices.size), default=0)
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
        offset_scale=np.concatenate([p.offset_scale for p in parts])[order],
        matrices=np.concatenate([wider_matrices(p.matrices, widest) for p in parts]),
        general=tuple(g for p in parts for g in p.general or (None,) * len(p.matrices)),
    )


def for_states(schedule: AidingSchedule, states: int) -> AidingSchedule:
    """Give measurements that carry their derivatives a column for every sensor state."""
    narrow = schedule.matrices.size and schedule.matrices.shape[2] < 12 + states
    if not narrow:
        return schedule
    return replace(schedule, matrices=wider_matrices(schedule.matrices, 12 + states))


def wider_matrices(matrices: FloatArray, width: int) -> FloatArray:
    """Add columns for states that the measurements do not depend on."""
    wide = np.zeros((len(matrices), 3, width))
    wide[:, :, : matrices.shape[2]] = matrices
    return wide


def schedule_rows(
    time: FloatArray,
    kind: int,
    value: FloatArray,
    variance: ArrayLike,
    *,
    lever_arm: ArrayLike = (0.0, 0.0, 0.0),
    offset_state: ArrayLike = -1,
) -> AidingSchedule:
    """Lay out measurements of one kind; what is the same for all is given once."""
    shape = (time.size, 3)
    return AidingSchedule(
        time=time,
        kind=np.full(time.size, kind, dtype=np.int64),
        value=value,
        variance=np.array(np.broadcast_to(np.asarray(variance, dtype=np.float64), shape)),
        lever_arm=np.array(np.broadcast_to(np.asarray(lever_arm, dtype=np.float64), shape)),
        offset_state=np.array(np.broadcast_to(np.asarray(offset_state, dtype=np.int64), shape)),
    )


def checked_series(
    time: ArrayLike, value: ArrayLike, columns: int, what: str
) -> tuple[FloatArray, FloatArray]:
    """Return times (k,) and values (k,) or (k, columns) of a source, or say what is wrong."""
    t, v = np.asarray(time, dtype=np.float64), np.asarray(value, dtype=np.float64)
    shape = (t.size,) if columns == 1 else (t.size, columns)
    if t.ndim != 1 or v.shape != shape:
        raise InputError(f"{what} of shape {v.shape} at {t.shape} times", expected=f"{shape}")
    if not (np.isfinite(t).all() and np.isfinite(v).all()):
        raise InputError(f"{what} or their times are not finite", expected="finite numbers")
    return t, v


def checked_deviations(sd: ArrayLike, count: int, what: str) -> FloatArray:
    """Return a standard deviation for each measurement of a source."""
    try:
        values = np.broadcast_to(np.asarray(sd, dtype=np.float64), (count,))
    except ValueError:
        values = np.zeros(1)
    if not (values > 0.0).all():
        raise InputError(
            f"standard deviation of {what}", expected=f"one positive number, or {count}"
        )
    return np.asarray(values)


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
    table, values = np.zeros((3 * parts, 12 + g.shape[1])), np.zeros((count, 3 * parts))
    variance = np.full((count, 3 * parts), np.inf)
    table[:rows, 12:], values[:, :rows], variance[:, :rows] = whiten @ g, z @ whiten.T, 1.0
    return AidingSchedule(
        time=np.repeat(when, parts),
        kind=np.full(count * parts, LINEAR, dtype=np.int64),
        value=values.reshape(-1, 3),
        variance=variance.reshape(-1, 3),
        lever_arm=np.zeros((count * parts, 3)),
        matrix=np.tile(np.arange(parts), count),
        matrices=table.reshape(parts, 3, -1),
    )
