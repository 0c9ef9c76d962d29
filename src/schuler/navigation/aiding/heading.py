"""Headings of a direction of the body: two GNSS antennas, a compass, a gyrocompass."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.navigation.aiding.schedule import (
    HEADING,
    AidingSchedule,
    checked_deviations,
    checked_series,
    schedule_rows,
)
from schuler.navigation.error_models.sensor_states import SensorErrorModel


@dataclass(frozen=True, slots=True, eq=False)
class Heading(Exportable):
    """Headings of a direction of the body: two GNSS antennas, a compass, a gyrocompass.

    Parameters
    ----------
    time : (k,) array_like
        Seconds on the axis of the IMU.
    heading : (k,) array_like
        From true north, growing to the east, rad.
    sd : float or (k,) array_like
        Standard deviation of each, rad.
    baseline : (3,) array_like
        The direction in the axes of the IMU, from the main antenna to the second.
    offset_sd : float
        Standard deviation of a constant error (antennas mounted askew), rad; zero: none.
    place : int
        Of its state; -1: not placed.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import Heading
    >>> Heading(np.arange(10.0), np.zeros(10), np.full(10, 0.02), offset_sd=0.01).heading.size
    10
    """

    time: ArrayLike
    heading: ArrayLike
    sd: ArrayLike
    baseline: ArrayLike = (1.0, 0.0, 0.0)
    offset_sd: float = 0.0
    place: int = -1

    def placed(self, model: SensorErrorModel) -> tuple[SensorErrorModel, Heading]:
        """Return the model with the offset, if there is one, and this source with its place."""
        if self.offset_sd == 0.0:
            return model, self
        wider = model.with_states(["heading offset"], [self.offset_sd])
        return wider, replace(self, place=model.size)

    def rows(self) -> AidingSchedule:
        """Return one row a heading."""
        time, value = checked_series(self.time, self.heading, 1, "headings")
        sd = checked_deviations(self.sd, time.size, "heading")
        arm = np.asarray(self.baseline, dtype=np.float64)
        if arm.shape != (3,) or not np.linalg.norm(arm) > 0.0:
            raise InputError(f"baseline {self.baseline!r}", expected="three numbers, not all zero")
        return schedule_rows(
            time,
            HEADING,
            np.column_stack([value, np.zeros((time.size, 2))]),
            np.column_stack([sd**2, np.full((time.size, 2), np.inf)]),
            lever_arm=arm / np.linalg.norm(arm),
            offset_state=(self.place, -1, -1),
        )
