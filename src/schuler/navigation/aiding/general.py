"""Measurements of a user's own: a model tells what is predicted, and by what it changes.

A source has times and a function `linearise`; nothing of this package has to know what it
measures. The filter asks it when it comes by, at the last sample before each measurement, so that
ranges, bearings and other equations that are not linear are linearised where the filter is. What
the state does between that sample and the measurement, and what other measurements at the same
time do to it, is followed by the derivatives (kernels/navigation/general_aiding.py).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import InputError
from schuler.navigation.aiding.schedule import GENERAL, AidingSchedule, PlacedAiding
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.types import FloatArray

MOST_COMPONENTS = 3


@dataclass(frozen=True, slots=True)
class AidingState:
    """A state that a source brings with it: an offset, a scale, a bias.

    Parameters
    ----------
    name : str
        For tables and reports.
    sd : float
        Standard deviation at the start, in the unit of the state.
    walk : float
        By which it changes, unit/sqrt(s); 0: a constant, or what its correlation time says.
    correlation_time : float
        Of a Gauss-Markov process of that standard deviation, s; infinite: none.

    Examples
    --------
    >>> from schuler import AidingState
    >>> AidingState("offset", sd=2.0, walk=0.01).correlation_time
    inf
    """

    name: str
    sd: float
    walk: float = 0.0
    correlation_time: float = float("inf")


@dataclass(frozen=True, slots=True, eq=False)
class AidedState:
    """What the filter knows when it asks for a measurement.

    Parameters
    ----------
    time : float
        Of the last sample, s.
    position, velocity : (3,) ndarray
        Latitude rad, longitude rad, height m; north, east, down m/s; of the IMU.
    rotation : (3, 3) ndarray
        C_nb.
    sensor_state : (m,) ndarray
        All sensor error states.
    own : (p,) ndarray
        Those of the source.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import AidedState
    >>> state = AidedState(0.0, np.zeros(3), np.zeros(3), np.eye(3), np.zeros(6), np.zeros(1))
    >>> state.own.size
    1
    """

    time: float
    position: FloatArray
    velocity: FloatArray
    rotation: FloatArray
    sensor_state: FloatArray
    own: FloatArray


@runtime_checkable
class MeasurementSource(Protocol):
    """What a source of one's own has to have; `states` may be left out.

    `name`: in tables and reports. `time` (k,): seconds on the axis of the IMU. `states`: a
    sequence of `AidingState`. `linearise(k, state)` returns, for measurement number k and an
    `AidedState`, three arrays for its r = 1 to 3 components: what the state predicts minus what
    was measured (r,); the derivatives of the prediction (r, 9 + p) by position north, east, down
    (m), velocity, attitude error psi (rad; a direction d = C u changes by d x psi) and the p own
    states, or by all m sensor states (r, 9 + m); and the variance of the noise, (r,) or (r, r).

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import AidedState, AidingState, MeasurementSource
    >>> class Altimeter(MeasurementSource):
    ...     name = "altimeter"
    ...     time = np.arange(10.0)
    ...     def linearise(self, k, state):
    ...         slope = np.zeros((1, 9 + state.sensor_state.size + state.own.size))
    ...         slope[0, 2] = -1.0
    ...         return np.array([520.0 - state.position[2]]), slope, np.array([[0.25]])
    >>> Altimeter().name
    'altimeter'
    """

    @property
    def name(self) -> str:
        """In tables and reports."""
        ...

    @property
    def time(self) -> ArrayLike:
        """Seconds on the axis of the IMU."""
        ...

    def linearise(self, k: int, state: AidedState) -> tuple[ArrayLike, ArrayLike, ArrayLike]:
        """Return residual, derivatives and variance of measurement k."""
        ...


@dataclass(frozen=True, slots=True, eq=False)
class GeneralAiding:
    """A source of a user's own, with the places of its states."""

    source: MeasurementSource  # checked
    states: tuple[AidingState, ...] = ()  # its own
    place: int = 0  # of the first of them among the sensor states

    @classmethod
    def of(cls, source: Any) -> GeneralAiding:
        """Take a source, or say what it lacks."""
        own = type(source).__name__
        for attribute, what in (
            ("name", "a text `name`"),
            ("time", "an array `time` of seconds"),
            ("linearise", "a function `linearise(k, state)`"),
        ):
            if not hasattr(source, attribute):
                raise InputError(f"aiding source {own} has no `{attribute}`", expected=what)
        if not (isinstance(source.name, str) and callable(source.linearise)):
            raise InputError(
                f"aiding source {own} with the name {source.name!r}",
                expected="a text as `name`, and a function `linearise(k, state)`",
            )
        time = np.asarray(source.time, dtype=np.float64)
        if time.ndim != 1 or not np.isfinite(time).all():
            raise InputError(
                f"aiding source '{source.name}' has times of shape {time.shape}",
                expected="a row of finite seconds",
            )
        states = getattr(source, "states", ())
        if not (isinstance(states, Sequence) and all(isinstance(s, AidingState) for s in states)):
            raise InputError(
                f"aiding source '{source.name}' has the states {states!r}",
                expected="a sequence of schuler.AidingState",
            )
        return cls(source, tuple(states))

    def placed(self, model: SensorErrorModel) -> tuple[SensorErrorModel, GeneralAiding]:
        """Return the model with the states of the source, and the source that knows them."""
        if not self.states:
            return model, self
        wider = model.with_states(
            [s.name for s in self.states],
            [s.sd for s in self.states],
            walk_density=[s.walk for s in self.states],
            correlation_time=[s.correlation_time for s in self.states],
        )
        return wider, GeneralAiding(self.source, self.states, model.size)

    def rows(self) -> AidingSchedule:
        """Return one row a measurement, to be filled in when the filter comes by."""
        time = np.array(self.source.time, dtype=np.float64)
        n = time.size
        return AidingSchedule(
            time,
            np.full(n, GENERAL, dtype=np.int64),
            np.zeros((n, 3)),
            np.full((n, 3), np.inf),
            np.zeros((n, 3)),
            matrix=np.arange(n),
            matrices=np.zeros((n, 3, 12 + self.place + len(self.states))),
            general=tuple(GeneralRow(self, k) for k in range(n)),
        )


@dataclass(frozen=True, slots=True, eq=False)
class GeneralRow:
    """One measurement of a source of a user's own."""

    aiding: GeneralAiding
    number: int

    @property
    def name(self) -> str:
        """Of the source."""
        return self.aiding.source.name

    def fill(
        self,
        schedule: AidingSchedule,
        u: int,
        time: float,
        state: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    ) -> None:
        """Write row u of a schedule for a state: position, velocity, rotation, sensor states."""
        position, velocity, rotation, sensor = (a.copy() for a in state)
        aiding = self.aiding
        own = sensor[aiding.place : aiding.place + len(aiding.states)]
        known = AidedState(time, position, velocity, rotation, sensor, own)
        residual, design, variance = self._checked(
            aiding.source.linearise(self.number, known), sensor.size
        )
        count = residual.size
        matrix = schedule.matrices[schedule.matrix[u]]
        matrix[:] = 0.0
        matrix[:, :3] = rotation
        matrix[:count, 3:12] = design[:, :9]
        first = 12 if design.shape[1] == 9 + sensor.size else 12 + aiding.place
        matrix[:count, first : first + design.shape[1] - 9] = design[:, 9:]
        schedule.lever_arm[u] = position
        schedule.value[u, :count] = (
            matrix[:count, 6:9] @ velocity + matrix[:count, 12:] @ sensor - residual
        )
        schedule.variance[u] = np.inf
        schedule.variance[u, :count] = variance

    def _checked(self, answer: Any, states: int) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Residual (r,), derivatives and variance (r,) of independent components."""
        name, own = self.name, len(self.aiding.states)
        where = f"measurement {self.number} of aiding source '{name}'"
        try:
            residual, design, noise = (np.asarray(a, dtype=np.float64) for a in answer)
        except (TypeError, ValueError) as error:
            raise InputError(
                f"{where} returns {answer!r}",
                expected="three arrays: residual, derivatives, variance",
            ) from error
        residual, design = np.atleast_1d(residual), np.atleast_2d(design)
        noise = np.atleast_1d(noise)
        r = residual.size
        if residual.ndim != 1 or not 1 <= r <= MOST_COMPONENTS:
            raise InputError(
                f"{where} has a residual of shape {residual.shape}",
                expected=f"1 to {MOST_COMPONENTS} components",
            )
        widths = sorted({9 + own, 9 + states})
        if design.shape[0] != r or design.shape[1] not in widths or design.ndim != 2:
            raise InputError(
                f"{where} has derivatives of shape {design.shape}",
                expected=" or ".join(f"({r}, {w})" for w in widths)
                + f": by position, velocity, attitude and {own} own states, or all sensor states",
            )
        if noise.shape not in ((r,), (r, r)):
            raise InputError(
                f"{where} has a variance of shape {noise.shape}", expected=f"({r},) or ({r}, {r})"
            )
        if not all(np.isfinite(a).all() for a in (residual, design, noise)):
            raise InputError(f"{where} is not finite", expected="finite numbers")
        if noise.ndim == 1:
            if not (noise > 0.0).all():
                raise InputError(f"{where} has the variance {noise}", expected="positive numbers")
            return residual, design, noise
        try:
            root = np.linalg.cholesky(noise)
        except np.linalg.LinAlgError as error:
            raise InputError(
                f"{where} has a covariance that is not positive definite",
                expected="independent components, each with noise",
            ) from error
        return np.linalg.solve(root, residual), np.linalg.solve(root, design), np.ones(r)


def placed_source(source: Any) -> PlacedAiding:
    """Return a source that can be placed: one of ours as it is, one of a user's own checked."""
    if hasattr(source, "placed") and hasattr(source, "rows"):
        return source  # type: ignore[no-any-return]
    return GeneralAiding.of(source)
