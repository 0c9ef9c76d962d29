"""Where a stream keeps its latest samples and measurements."""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.kernels.navigation.filter_data import AIDING_ROW, SampleOutputs
from schuler.types import FloatArray

ROOM = 8
"""Times what is kept, that there is room for: moved up rarely, few samples wait for it."""


@dataclass(slots=True, eq=False)
class SampleBuffer:
    """The latest samples of a stream, in a row: what came, and what the filter made of it."""

    places: int
    keep_outputs: bool
    time: FloatArray = field(init=False)
    gyro: FloatArray = field(init=False)
    accel: FloatArray = field(init=False)
    scale: FloatArray = field(init=False)
    outputs: SampleOutputs = field(init=False)
    first: int = 0
    count: int = 0

    def __post_init__(self) -> None:
        rows = ROOM * self.places
        # written to now: memory that nobody has touched costs the first sample that does
        self.time, self.scale = np.full(rows, 0.0), np.ones((rows, 6))
        self.gyro, self.accel = np.full((rows, 3), 0.0), np.full((rows, 3), 0.0)
        self.outputs = SampleOutputs.empty(rows if self.keep_outputs else 0)

    def add(self, time: float, gyro: ArrayLike, accel: ArrayLike) -> int:
        """Append one; its row."""
        row = self.count - self.first
        if row == len(self.time):
            self._move_up()
            row = self.places
        self.time[row] = time
        self.gyro[row] = gyro
        self.accel[row] = accel
        self.count += 1
        return row

    def _move_up(self) -> None:
        """Forget all but the latest."""
        kept: list[FloatArray] = [self.time, self.gyro, self.accel, self.scale]
        if self.keep_outputs:
            kept += [getattr(self.outputs, f.name) for f in fields(self.outputs)]
        for values in kept:
            values[: self.places] = values[-self.places :]
        self.first += len(self.time) - self.places


@dataclass(frozen=True, slots=True, eq=False)
class LinearRows:
    """Linear functions of the sensor states at one time, whitened, three by three.

    value, variance (p, 3): infinite where there is none; matrix (p, 3, 12 + m).
    """

    time: float
    value: FloatArray
    variance: FloatArray
    matrix: FloatArray


class RowBuffer:
    """Rows of `AIDING_ROW`, and the same bytes as real numbers, which are quicker to copy."""

    __slots__ = ("bytes", "first", "table", "value", "variance")

    def __init__(self, table: NDArray[np.void]) -> None:
        self.table = table
        self.bytes = table.view(np.float64).reshape(table.size, -1)
        # of the first row, where a fix is put together
        self.first, self.value, self.variance = (
            self.bytes[0],
            table["value"][0],
            table["variance"][0],
        )

    def __reduce__(self) -> tuple[type[RowBuffer], tuple[NDArray[np.void]]]:
        return RowBuffer, (self.table,)

    @classmethod
    def blank(cls, rows: int) -> RowBuffer:
        """Rows that are never due."""
        table = np.zeros(rows, dtype=AIDING_ROW)
        table["time"], table["offset"], table["matrix"] = np.inf, -1, -1
        table["offset_scale"] = 1.0
        return cls(table)

    @classmethod
    def of_antenna(cls, kind: int, lever: FloatArray, offset: ArrayLike) -> RowBuffer:
        """One row with all that is the same for every fix."""
        one = cls.blank(1)
        one.table["kind"], one.table["rank"] = kind, kind
        one.table["lever"], one.table["offset"] = lever, offset
        return one
