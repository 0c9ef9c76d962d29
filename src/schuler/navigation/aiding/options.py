"""What a user may say about measurements: how GNSS is weighted, its slow errors, other sensors."""

from __future__ import annotations

from dataclasses import dataclass

from schuler.navigation.aiding.general import MeasurementSource, placed_source
from schuler.navigation.aiding.gnss import CorrelatedGnss
from schuler.navigation.aiding.schedule import PlacedAiding
from schuler.navigation.aiding.weighting import CLAIMED, GnssWeighting
from schuler.navigation.error_models.sensor_states import SensorErrorModel


@dataclass(frozen=True, slots=True, eq=False)
class MeasurementOptions:
    """How measurements are used.

    Parameters
    ----------
    weighting : GnssWeighting
        Gate, Huber or Student-t; adaptive noise.
    correlated : CorrelatedGnss or None
        Slow errors of GNSS positions as states; None: what a receiver says is white noise. The
        default is none, as a receiver's deviations do not tell how long its errors last, and the
        innovations of a filter that is sure of itself hardly do.
    sources : tuple of PlacedAiding or MeasurementSource
        Heading, barometer, magnetometer, and measurements of one's own: any object with `name`,
        `time` and `linearise`, see `MeasurementSource`.
    """

    weighting: GnssWeighting = CLAIMED
    correlated: CorrelatedGnss | None = None
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
