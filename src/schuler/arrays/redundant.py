"""One kind of sensor of an array as S002 (8) has it: measurements = A x + errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from schuler.arrays.geometry import check_rank
from schuler.data import ImuArray
from schuler.data._checks import median_step
from schuler.errors import InputError
from schuler.types import FloatArray

Sensor = Literal["gyro", "accel"]

TITLES = {"gyro": "gyros", "accel": "accelerometers"}
UNITS = {"gyro": "rad/s", "accel": "m/s²"}
SAME = 0.999
"""Share of equal rows from which two IMUs are one recorded twice."""
ROUNDING = 1e-9
"""Of the largest value: what turning leaves of equality."""
FEW = 200
"""Rows that are looked at first."""


@dataclass(frozen=True, slots=True, eq=False)
class RedundantSensors:
    """All gyros, or all accelerometers, of an array."""

    time: FloatArray  # (n,): s
    # (n, M): one column for each axis, in rad/s or m/s²; NaN where missing.
    measurements: FloatArray
    axes: FloatArray  # (M, 3): sensitive axes in the body, A
    unit: NDArray[np.int64]  # (M,): IMU of each axis, from 0, not decreasing
    arms: FloatArray  # (M, 3): where each sits in the body, m
    names: tuple[str, ...]  # "imu 1 x", ..
    unit_names: tuple[str, ...]  # of the IMUs
    sensor: Sensor  # which kind

    @property
    def count(self) -> int:
        """Number of axes M."""
        return int(self.axes.shape[0])

    @property
    def units(self) -> int:
        """Number of IMUs."""
        return len(self.unit_names)

    @property
    def step(self) -> float:
        """Median sampling interval, s."""
        return median_step(self.time)

    @property
    def spacing(self) -> float:
        """Largest distance of an axis from the origin of the body, m."""
        return float(np.linalg.norm(self.arms, axis=1).max())


def kinds_recorded(array: ImuArray) -> tuple[Sensor, ...]:
    """Return the kinds of sensor that an array recorded at all."""

    def there(values: FloatArray) -> bool:
        return bool(np.isfinite(values[0]).any() or np.isfinite(values).any())

    kinds: list[Sensor] = []
    if there(array.gyro):
        kinds.append("gyro")
    if there(array.accel):
        kinds.append("accel")
    return tuple(kinds)


def redundant_sensors(array: ImuArray, sensor: Sensor) -> RedundantSensors:
    """Return all gyros, or all accelerometers, of an array as S002 (8) has them.

    Parameters
    ----------
    array : ImuArray
        Two or more IMUs.
    sensor : {"gyro", "accel"}
        Which.

    Returns
    -------
    RedundantSensors
        Measurements (n, M) in rad/s or m/s², axes (M, 3), IMU and place of each.

    Raises
    ------
    InputError
        One IMU only, sensors that were not recorded, or one IMU recorded twice.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> gyro = np.random.default_rng(0).normal(size=(100, 2, 3))
    >>> array = schuler.ImuArray(
    ...     np.arange(100) / 100.0, gyro, np.full(gyro.shape, np.nan), schuler.Mounting.aligned(2)
    ... )
    >>> schuler.redundant_sensors(array, "gyro").measurements.shape
    (100, 6)
    """
    if array.count < 2:
        raise InputError(
            f"an array of one IMU ({array.names[0]})",
            expected="two or more: nothing is redundant",
            cure="use the recording as it is",
        )
    values = array.gyro if sensor == "gyro" else array.accel
    columns = values.reshape(array.size, -1)
    # most axes have a value in the first row: only the others need a look at all of them
    there = np.isfinite(columns[0])
    for m in np.flatnonzero(~there):
        there[m] = np.isfinite(columns[:, m]).any()
    recorded = np.flatnonzero(there)
    if recorded.size < columns.shape[1]:
        columns = np.ascontiguousarray(columns[:, recorded])
    axes = np.ascontiguousarray(np.swapaxes(array.mounting.rotation, 1, 2).reshape(-1, 3)[recorded])
    check_rank(axes)
    refuse_copies(array, (sensor,))
    # units are numbered without gaps
    unit = recorded // 3
    numbers, unit = np.unique(unit, return_inverse=True)
    return RedundantSensors(
        array.time,
        columns,
        axes,
        unit.astype(np.int64),
        np.repeat(array.mounting.position, 3, axis=0)[recorded],
        tuple(f"{array.names[m // 3]} {'xyz'[m % 3]}" for m in recorded.tolist()),
        tuple(array.names[i] for i in numbers.tolist()),
        sensor,
    )


def refuse_copies(array: ImuArray, kinds: Sequence[Sensor] = ("gyro", "accel")) -> None:
    """Raise when two IMUs hold the same numbers: they would count twice and hide their errors.

    In their own axes, or both turned into the body.
    """
    few = np.unique(np.linspace(0, array.size - 1, FEW).astype(int))
    for kind in kinds:
        values = array.gyro if kind == "gyro" else array.accel
        for i in range(array.count):
            for j in range(i):
                # a handful of rows clears nearly every pair
                if _share_equal(values[few], array, i, j) < SAME:
                    continue
                share = _share_equal(values, array, i, j)
                if share >= SAME:
                    raise InputError(
                        f"{array.names[i]} is a copy of {array.names[j]}: the {TITLES[kind]} are "
                        f"equal in {100.0 * share:.0f} % of the rows",
                        expected="IMUs with errors of their own",
                        cure=f"leave {array.names[i]} out, or check the columns",
                    )


def _share_equal(values: FloatArray, array: ImuArray, i: int, j: int) -> float:
    """Share of the rows that both have in which two IMUs show the same."""
    a, b = values[:, i], values[:, j]
    both = np.isfinite(a).all(axis=1) & np.isfinite(b).all(axis=1)
    if not both.any():
        return 0.0
    a, b = a[both], b[both]
    rotation = array.mounting.rotation
    near = ROUNDING * max(float(np.abs(a).max()), 1e-12)
    turned = np.abs(a @ rotation[i].T - b @ rotation[j].T).max(axis=1) <= near
    return float(np.mean((a == b).all(axis=1) | turned))
