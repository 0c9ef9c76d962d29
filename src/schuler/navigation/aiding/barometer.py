"""Heights by air pressure, with an offset that follows the weather."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from schuler.data.exportable import Exportable
from schuler.navigation.aiding.schedule import (
    BAROMETER,
    AidingSchedule,
    checked_deviations,
    checked_series,
    schedule_rows,
)
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Barometer(Exportable):
    """Heights by air pressure, off by an amount that changes with the weather.

    Parameters
    ----------
    time : (k,) array_like
        Seconds on the axis of the IMU.
    height : (k,) array_like
        By the standard atmosphere or any other, m; see `height_of_pressure`.
    sd : float or (k,) array_like
        White noise of each, m.
    offset_sd : float
        Standard deviation of the offset at the start, m.
    offset_walk : float
        By which it changes, m/sqrt(s): 0.03 is 2 m in an hour.
    place : int
        Of its state; -1: not placed, and the heights are taken as they are.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import Barometer
    >>> Barometer(np.arange(10.0), np.full(10, 520.0), sd=0.5).offset_sd
    100.0
    """

    time: ArrayLike
    height: ArrayLike
    sd: ArrayLike = 0.5
    offset_sd: float = 100.0
    offset_walk: float = 0.03
    place: int = -1

    def placed(self, model: SensorErrorModel) -> tuple[SensorErrorModel, Barometer]:
        """Return the model with the offset, and this source with its place."""
        wider = model.with_states(
            ["barometer offset, down"], [self.offset_sd], walk_density=[self.offset_walk]
        )
        return wider, replace(self, place=model.size)

    def rows(self) -> AidingSchedule:
        """Return one row a height."""
        time, value = checked_series(self.time, self.height, 1, "heights")
        sd = checked_deviations(self.sd, time.size, "height")
        n = time.size
        return schedule_rows(
            time,
            BAROMETER,
            np.column_stack([np.zeros((n, 2)), value]),
            np.column_stack([np.full((n, 2), np.inf), sd**2]),
            offset_state=(-1, -1, self.place),
        )


def height_of_pressure(pressure: ArrayLike, reference: float = 101325.0) -> FloatArray:
    """Return heights in the standard atmosphere.

    Parameters
    ----------
    pressure : array_like
        Pa.
    reference : float
        Pressure at height zero, Pa.

    Returns
    -------
    ndarray
        m; ICAO standard atmosphere below 11 km, 44330.77 (1 - (p / p0)^0.190263).

    Examples
    --------
    >>> from schuler import height_of_pressure
    >>> round(float(height_of_pressure(89874.6)))
    1000
    """
    ratio = np.asarray(pressure, dtype=np.float64) / reference
    return np.asarray(44330.77 * (1.0 - ratio**0.190263))


def pressure_per_height(pressure: ArrayLike, reference: float = 101325.0) -> FloatArray:
    """Return by how much pressure falls with height in the standard atmosphere."""
    ratio = np.asarray(pressure, dtype=np.float64) / reference
    return np.asarray(reference * ratio**0.809737 / (44330.77 * 0.190263))
