"""What a user may say about measurements: how GNSS is weighted, its slow errors, other sensors."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from schuler.errors import InputError
from schuler.navigation.aiding.general import MeasurementSource, placed_source
from schuler.navigation.aiding.gnss import CorrelatedGnss, GnssErrorModel
from schuler.navigation.aiding.schedule import PlacedAiding
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.types import FloatArray

Update = Literal["gate", "huber", "student-t"]
UPDATES: tuple[str, ...] = get_args(Update)

DOUBTED_SHARE = 0.05
"""Share of good measurements that are doubted: Huber's weight falls, adapted noise clips them."""
STUDENT_FREEDOM = 4.0
"""Degrees of freedom of Student's distribution: tails of real receivers."""
MEMORY = 60.0
"""Updates over which the noise is averaged that adapts itself."""
OWN_WORD = 10.0
"""Updates that the receiver's own word counts for at the start."""
LEAST, MOST = 0.2, 100.0
"""Factor on the receiver's variances: they are never believed to be much too large, as innovations
do not see slow errors, but they may be far too small."""


@dataclass(frozen=True, slots=True)
class GnssWeighting:
    """How GNSS measurements are weighted.

    Parameters
    ----------
    update : {"gate", "huber", "student-t"}
        "gate" refuses what is too far off; "huber" and "student-t" refuse nothing and give
        little weight to it, Student's less than Huber's.
    adaptive : bool
        Whether the variances of position and velocity, one factor each, follow the innovations.
    freedom : float
        Of Student's distribution.
    memory : float
        Updates over which adapted noise is averaged.

    Raises
    ------
    InputError
        Another kind of update, or numbers that cannot be.

    Examples
    --------
    >>> from schuler import GnssWeighting, MeasurementOptions
    >>> MeasurementOptions(weighting=GnssWeighting(update="huber")).weighting.update
    'huber'
    """

    update: Update = "gate"
    adaptive: bool = False
    freedom: float = STUDENT_FREEDOM
    memory: float = MEMORY

    def __post_init__(self) -> None:
        if self.update not in UPDATES:
            raise InputError(f"no update '{self.update}'", expected=", ".join(UPDATES))
        if not (self.freedom > 2.0 and self.memory > 5.0):
            raise InputError(
                f"{self.freedom:g} degrees of freedom, a memory of {self.memory:g} updates",
                expected="more than 2, and more than 5",
            )

    def array(self) -> FloatArray:
        """Return the numbers that kernels/navigation/robust.py wants, (9,)."""
        from scipy.special import gammaincinv

        numbers = np.zeros(9)
        numbers[0] = UPDATES.index(self.update)
        numbers[1:4] = 2.0 * gammaincinv([0.5, 1.0, 1.5], 1.0 - DOUBTED_SHARE)
        numbers[8] = self.freedom
        if self.adaptive:
            numbers[4:8] = 1.0 - 1.0 / self.memory, OWN_WORD, LEAST, MOST
        return numbers


CLAIMED = GnssWeighting()
USUAL_ERRORS = GnssErrorModel()
"""Part of what a receiver claims lasts; how much, the drive decides."""


@dataclass(frozen=True, slots=True, eq=False)
class MeasurementOptions:
    """How measurements are used.

    Parameters
    ----------
    weighting : GnssWeighting
        Gate, Huber or Student-t; adaptive noise.
    correlated : CorrelatedGnss, GnssErrorModel or None
        Slow errors of GNSS positions as states: as shares of what the receiver claims, which the
        drive decides on, or of a given size. None: what a receiver says is white noise, which it
        never quite is, so that what is claimed then is too sure.
    sources : tuple of PlacedAiding or MeasurementSource
        Heading, barometer, magnetometer, and measurements of one's own: any object with `name`,
        `time` and `linearise`, see `MeasurementSource`.

    Examples
    --------
    >>> from schuler import CorrelatedGnss, MeasurementOptions
    >>> MeasurementOptions(correlated=CorrelatedGnss(sigma=1.5, correlation_time=60.0)).sources
    ()
    """

    weighting: GnssWeighting = CLAIMED
    correlated: CorrelatedGnss | GnssErrorModel | None = USUAL_ERRORS
    sources: tuple[PlacedAiding | MeasurementSource, ...] = ()

    @property
    def placed_sources(self) -> tuple[PlacedAiding, ...]:
        """The sources, all of which can be placed."""
        return tuple(placed_source(source) for source in self.sources)

    def placed(self, model: SensorErrorModel) -> tuple[SensorErrorModel, MeasurementOptions]:
        """Append the states of all that has any.

        Parameters
        ----------
        model : SensorErrorModel
            Of the IMU.

        Returns
        -------
        tuple of SensorErrorModel and MeasurementOptions
            The model with the new states at its end, and options that know their places.
        """
        correlated = self.correlated
        if correlated is not None:
            model, correlated = correlated.placed(model)
        placed: list[PlacedAiding] = []
        for source in self.placed_sources:
            model, known = source.placed(model)
            placed.append(known)
        return model, MeasurementOptions(self.weighting, correlated, tuple(placed))


PLAIN = MeasurementOptions()
WHITE_ERRORS = MeasurementOptions(correlated=None)
"""Receivers taken by their word, and their errors for white noise."""
