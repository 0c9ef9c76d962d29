"""Aiding beside GNSS: heading, barometer, magnetometer, and slow errors of GNSS itself.

Each source is a small object of arrays; those whose sensor has an error of its own (a barometer's
offset, a magnetometer's hard iron, a compass that is mounted askew) bring a state for it. A source
with states is placed once the sensor error model is known: `placed` returns the model with its
states at the end, and the source that knows where they are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import InputError
from schuler.navigation.aiding.gnss import BAROMETER, HEADING, MAGNETIC_FIELD, AidingSchedule
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.types import FloatArray

LEAST_WHITE = 0.02
"""Share of a receiver's variance that is white noise at least."""


class StatefulAiding(Protocol):
    """A source of measurements that may bring states of its own."""

    def placed(self, model: SensorErrorModel) -> tuple[SensorErrorModel, Self]:
        """Return the model with the states of the source, and the source that knows them."""
        ...

    def rows(self) -> AidingSchedule:
        """Return the measurements; they need not be sorted."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class Heading:
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
        """Return one row a heading.

        Returns
        -------
        AidingSchedule
            Kind `HEADING`.

        Raises
        ------
        InputError
            Arrays that do not fit together, or a baseline of no length.
        """
        time, value = _series(self.time, self.heading, 1, "headings")
        sd = _deviations(self.sd, time.size, "heading")
        arm = np.asarray(self.baseline, dtype=np.float64)
        if arm.shape != (3,) or not np.linalg.norm(arm) > 0.0:
            raise InputError(f"baseline {self.baseline!r}", expected="three numbers, not all zero")
        variance = np.column_stack([sd**2, np.full((time.size, 2), np.inf)])
        values = np.column_stack([value, np.zeros((time.size, 2))])
        offset = np.full((time.size, 3), -1, dtype=np.int64)
        offset[:, 0] = self.place
        return AidingSchedule(
            time,
            np.full(time.size, HEADING, dtype=np.int64),
            values,
            variance,
            np.tile(arm / np.linalg.norm(arm), (time.size, 1)),
            offset,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Barometer:
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
        """Return one row a height.

        Returns
        -------
        AidingSchedule
            Kind `BAROMETER`.

        Raises
        ------
        InputError
            Arrays that do not fit together.
        """
        time, value = _series(self.time, self.height, 1, "heights")
        sd = _deviations(self.sd, time.size, "height")
        n = time.size
        offset = np.full((n, 3), -1, dtype=np.int64)
        offset[:, 2] = self.place
        return AidingSchedule(
            time,
            np.full(n, BAROMETER, dtype=np.int64),
            np.column_stack([np.zeros((n, 2)), value]),
            np.column_stack([np.full((n, 2), np.inf), sd**2]),
            np.zeros((n, 3)),
            offset,
        )


@dataclass(frozen=True, slots=True, eq=False)
class Magnetometer:
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
        """Return one row a measurement.

        Returns
        -------
        AidingSchedule
            Kind `MAGNETIC_FIELD`.

        Raises
        ------
        InputError
            Arrays that do not fit together.
        """
        time, value = _series(self.time, self.field, 3, "fields")
        sd = _deviations(self.sd, time.size, "field")
        n = time.size
        offset = np.full((n, 3), -1, dtype=np.int64)
        if self.place >= 0:
            offset[:] = self.place + np.arange(3)
        reference = np.asarray(self.reference, dtype=np.float64)
        if reference.shape != (3,) or not np.isfinite(reference).all():
            raise InputError(f"reference field {self.reference!r}", expected="three numbers")
        return AidingSchedule(
            time,
            np.full(n, MAGNETIC_FIELD, dtype=np.int64),
            value,
            np.repeat(sd[:, None] ** 2, 3, axis=1),
            np.tile(reference, (n, 1)),
            offset,
        )


@dataclass(frozen=True, slots=True)
class CorrelatedGnss:
    """Errors of GNSS positions that last: multipath, orbits, ambiguities held a little wrong.

    Parameters
    ----------
    sigma : float
        Horizontal standard deviation of the slow part, m; the vertical is 1.5 times it.
    correlation_time : float
        Seconds.
    place : int
        Of the first of its three states (north, east, down); -1: not placed.

    Notes
    -----
    A receiver's own deviation is taken as that of both parts together: what is left for the white
    part is its square less that of the slow part, and at least 2 % of it.
    """

    sigma: float
    correlation_time: float
    place: int = -1

    def placed(self, model: SensorErrorModel) -> tuple[SensorErrorModel, CorrelatedGnss]:
        """Return the model with the three states, and this with their place.

        Raises
        ------
        InputError
            Numbers that are not positive.
        """
        if not (self.sigma > 0.0 and self.correlation_time > 0.0):
            raise InputError(
                f"slow errors of {self.sigma:g} m over {self.correlation_time:g} s",
                expected="two positive numbers",
            )
        wider = model.with_states(
            [f"GNSS error {d}" for d in ("north", "east", "down")],
            self.sigma * np.array([1.0, 1.0, 1.5]),
            correlation_time=self.correlation_time,
        )
        return wider, replace(self, place=model.size)

    def applied(self, schedule: AidingSchedule) -> AidingSchedule:
        """Return positions whose slow part is a state and whose noise is the rest.

        Parameters
        ----------
        schedule : AidingSchedule
            Of positions.

        Returns
        -------
        AidingSchedule
            The same measurements.
        """
        slow = (self.sigma * np.array([1.0, 1.0, 1.5])) ** 2
        white = np.maximum(schedule.variance - slow, LEAST_WHITE * schedule.variance)
        offset = np.tile(self.place + np.arange(3), (schedule.size, 1))
        return replace(schedule, variance=white, offset_state=offset)


def earth_field(declination: float, inclination: float, intensity: float) -> FloatArray:
    """Return the magnetic field of the earth in north, east, down."""
    level = intensity * np.cos(inclination)
    return np.array(
        [
            level * np.cos(declination),
            level * np.sin(declination),
            intensity * np.sin(inclination),
        ]
    )


def height_of_pressure(pressure: ArrayLike, reference: float = 101325.0) -> FloatArray:
    """Return heights in the standard atmosphere."""
    ratio = np.asarray(pressure, dtype=np.float64) / reference
    return np.asarray(44330.77 * (1.0 - ratio**0.190263))


def pressure_per_height(pressure: ArrayLike, reference: float = 101325.0) -> FloatArray:
    """Return by how much pressure falls with height in the standard atmosphere."""
    ratio = np.asarray(pressure, dtype=np.float64) / reference
    return np.asarray(reference * ratio**0.809737 / (44330.77 * 0.190263))


def _series(
    time: ArrayLike, value: ArrayLike, columns: int, what: str
) -> tuple[FloatArray, FloatArray]:
    t, v = np.asarray(time, dtype=np.float64), np.asarray(value, dtype=np.float64)
    shape = (t.size,) if columns == 1 else (t.size, columns)
    if t.ndim != 1 or v.shape != shape:
        raise InputError(f"{what} of shape {v.shape} at {t.shape} times", expected=f"{shape}")
    if not (np.isfinite(t).all() and np.isfinite(v).all()):
        raise InputError(f"{what} or their times are not finite", expected="finite numbers")
    return t, v


def _deviations(sd: ArrayLike, count: int, what: str) -> FloatArray:
    try:
        values = np.broadcast_to(np.asarray(sd, dtype=np.float64), (count,))
    except ValueError:
        values = np.zeros(1)
    if not (values > 0.0).all():
        raise InputError(
            f"standard deviation of {what}", expected=f"one positive number, or {count}"
        )
    return np.asarray(values)
