"""The magnetic field in the axes of the IMU, with the hard iron of the vehicle."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.navigation.aiding.schedule import (
    MAGNETIC_FIELD,
    AidingSchedule,
    checked_deviations,
    checked_series,
    schedule_rows,
)
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Magnetometer(Exportable):
    """Magnetic field in the axes of the IMU, with the hard iron of the vehicle as states.

    Parameters
    ----------
    time : (k,) array_like
        Seconds on the axis of the IMU.
    field : (k, 3) array_like
        As measured, in any unit.
    reference : (3,) array_like
        Field of the earth there, north, east, down, in the same unit; see `earth_field`.
    sd : float or (k,) array_like
        White noise of each component: sensor, soft iron, passing traffic.
    hard_iron_sd : float
        Standard deviation of the constant field of the vehicle in each axis.
    hard_iron_walk : float
        By which it changes, unit/sqrt(s).
    place : int
        Of the first of its three states; -1: not placed, and no hard iron.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import Magnetometer, earth_field
    >>> field = earth_field(0.05, 1.1, 48.0)
    >>> Magnetometer(np.arange(3.0), np.tile(field, (3, 1)), field, sd=0.5).hard_iron_sd
    0.0
    """

    time: ArrayLike
    field: ArrayLike
    reference: ArrayLike
    sd: ArrayLike
    hard_iron_sd: float = 0.0
    hard_iron_walk: float = 0.0
    place: int = -1

    def placed(self, model: SensorErrorModel) -> tuple[SensorErrorModel, Magnetometer]:
        """Return the model with the hard iron, if there is any, and this source with its place."""
        if self.hard_iron_sd == 0.0:
            return model, self
        wider = model.with_states(
            [f"hard iron {axis}" for axis in "xyz"],
            [self.hard_iron_sd] * 3,
            walk_density=[self.hard_iron_walk] * 3,
        )
        return wider, replace(self, place=model.size)

    def rows(self) -> AidingSchedule:
        """Return one row a measurement."""
        time, value = checked_series(self.time, self.field, 3, "fields")
        sd = checked_deviations(self.sd, time.size, "field")
        reference = np.asarray(self.reference, dtype=np.float64)
        if reference.shape != (3,) or not np.isfinite(reference).all():
            raise InputError(f"reference field {self.reference!r}", expected="three numbers")
        return schedule_rows(
            time,
            MAGNETIC_FIELD,
            value,
            np.repeat(sd[:, None] ** 2, 3, axis=1),
            lever_arm=reference,
            offset_state=self.place + np.arange(3) if self.place >= 0 else -1,
        )


def earth_field(declination: float, inclination: float, intensity: float) -> FloatArray:
    """Return the magnetic field of the earth in north, east, down.

    Parameters
    ----------
    declination : float
        Of magnetic from true north, growing to the east, rad.
    inclination : float
        Below the horizontal, rad.
    intensity : float
        Of the whole field, any unit.

    Returns
    -------
    (3,) ndarray
        In the unit of the intensity.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import earth_field
    >>> np.round(earth_field(0.0, np.radians(60.0), 50.0), 1)
    array([25. ,  0. , 43.3])
    """
    level = intensity * np.cos(inclination)
    return np.array(
        [
            level * np.cos(declination),
            level * np.sin(declination),
            intensity * np.sin(inclination),
        ]
    )
