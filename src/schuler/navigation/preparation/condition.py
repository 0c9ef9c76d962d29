"""What was found out about a drive before the filter ran, and what becomes of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schuler.data import GnssRecording
from schuler.navigation.preparation.alignment import Alignment
from schuler.navigation.preparation.gaps import DataGap, gap_noise_density
from schuler.screening.screen import Finding
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Restart:
    """A moment at which the filter begins anew, with the sensor errors it knows.

    Parameters
    ----------
    begin : float
        Last moment before, s; what is measured in between is not used.
    time : float
        First sample of what follows, s.
    alignment : Alignment
        Attitude and velocity there.
    """

    begin: float
    time: float
    alignment: Alignment


@dataclass(frozen=True, slots=True, eq=False)
class DriveCondition:
    """What a drive suffers from, and how the filter copes.

    Parameters
    ----------
    findings : tuple of Finding
        For people.
    gaps : tuple of DataGap
        Stretches that were bridged.
    restarts : tuple of Restart
        In order of time.
    wrong_fixes : (k,) ndarray
        Times of GNSS epochs that are left out, on the axis of GNSS, s.
    """

    findings: tuple[Finding, ...] = ()
    gaps: tuple[DataGap, ...] = ()
    restarts: tuple[Restart, ...] = ()
    wrong_fixes: FloatArray | None = None

    @property
    def first_break(self) -> float:
        """Last moment before the first restart, s; infinite where there is none."""
        return self.restarts[0].begin if self.restarts else float("inf")

    def usable(self, gnss: GnssRecording) -> GnssRecording:
        """Return the epochs that may be used."""
        if self.wrong_fixes is None or not self.wrong_fixes.size:
            return gnss
        return gnss.select(~np.isin(gnss.time, self.wrong_fixes))

    def noise_scale(
        self, time: FloatArray, scale: FloatArray | None, white_density: FloatArray
    ) -> FloatArray | None:
        """Add gaps to what multiplies the squared white-noise densities."""
        added = gap_noise_density(time, self.gaps)
        if added is None:
            return scale
        relative: FloatArray = added / np.maximum(white_density, 1e-12) ** 2
        return 1.0 + relative if scale is None else scale + relative


SOUND = DriveCondition()
