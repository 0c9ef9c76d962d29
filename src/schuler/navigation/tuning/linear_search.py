"""The maximum of the likelihood of a drive, looked for on the drive linearised.

A search asks for the innovations a hundred times. A drive about one run of the filter answers at a
tenth of the cost (linear_drive.py). Whether it told the truth is seen where the search ends, by the
filter itself: if not, the search goes on with innovations of the filter, and the linear drive gives
only their derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

from schuler.data import GnssRecording, ImuRecording
from schuler.navigation.innovation_likelihood import InnovationSequence
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.tuning.likelihood import innovations
from schuler.navigation.tuning.linear_drive import LinearDrive, linearisable
from schuler.navigation.tuning.scoring import LONGEST_SEARCH, Maximum, maximise
from schuler.types import BoolArray, FloatArray

HOLDS = 0.5
"""By how much the gain of a search may differ from the filter's where the linear drive holds."""


def _all(found: InnovationSequence) -> InnovationSequence:
    return found


@dataclass(frozen=True, slots=True, eq=False)
class DriveLikelihood:
    """Innovations of a drive as a function of parameters.

    Parameters
    ----------
    imu, gnss
        As for `innovations`.
    setup_at : callable
        The setup at some parameters.
    offsets : (p,) ndarray of bool
        Which of them are time offsets: they move the ends of the linear steps.
    level : (n, 6) ndarray or None
        As for `innovations`.
    judged : callable
        Picks the innovations that judge.
    """

    imu: ImuRecording
    gnss: Sequence[GnssRecording]
    setup_at: Callable[[FloatArray], RunSetup]
    offsets: BoolArray
    level: FloatArray | None = None
    judged: Callable[[InnovationSequence], InnovationSequence] = _all

    def filtered(self, x: FloatArray) -> InnovationSequence:
        """By the filter itself."""
        return self.judged(innovations(self.imu, self.gnss, self.setup_at(x), self.level))

    def about(self, x: FloatArray) -> Callable[[FloatArray], InnovationSequence]:
        """Linearised about some parameters, where that can be."""
        setup = self.setup_at(x)
        if not linearisable(setup, self.gnss[0]):
            return self.filtered
        drive = LinearDrive.about(self.imu, self.gnss, setup, self.level)
        return lambda y: self.judged(drive.innovations(self.setup_at(y)))

    def maximise(
        self, x: FloatArray, prior: FloatArray, floor: FloatArray, longest: int = LONGEST_SEARCH
    ) -> Maximum:
        """Search from some parameters; see `scoring.maximise`."""

        def value(found: InnovationSequence, at: FloatArray) -> float:
            return found.log_likelihood - 0.5 * float(at @ (prior * at))

        linear = self.about(x)
        found = maximise(linear, x, prior, floor, longest)
        # the whole of GNSS is what the drive was linearised with
        first = value((linear if len(self.gnss) == 1 else self.filtered)(x), x)
        best = value(self.filtered(found.x), found.x)
        if abs(best - first - found.gain) < HOLDS:
            return replace(found, log_likelihood=best, gain=best - first)
        begin = found.x if best > first else x
        found = maximise(self.filtered, begin, prior, floor, longest, self.about, self.offsets)
        return replace(found, gain=found.log_likelihood - first)
