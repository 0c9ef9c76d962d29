"""Grades of GNSS receivers, from one frequency and code alone to fixed ambiguities (spec 1.3)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Unpack

import numpy as np

from schuler.data import GnssRecording
from schuler.keywords import refuse_unknown
from schuler.simulation.gnss import ReceiverOptions, simulate_gnss
from schuler.simulation.motions.profile import Profile


@dataclass(frozen=True, slots=True)
class GnssGrade:
    """How good a kind of receiver is.

    Parameters
    ----------
    name : str
        For people.
    quality : int
        RTKLIB's number: 1 fixed, 4 differential, 5 single.
    white_sd : tuple of float
        White part of the position noise north, east, down, m.
    correlated_sd : tuple of float
        Part with a correlation time (orbits, clocks, ionosphere, multipath), m.
    correlation_time : float
        Seconds.
    velocity_sd : tuple of float
        White noise of the velocity north, east, down, m/s.

    Examples
    --------
    >>> from schuler.simulation import RTK_FIXED
    >>> RTK_FIXED.name, RTK_FIXED.quality
    ('RTK fixed', 1)
    """

    name: str
    quality: int
    white_sd: tuple[float, float, float]
    correlated_sd: tuple[float, float, float]
    correlation_time: float
    velocity_sd: tuple[float, float, float]

    @property
    def position_sd(self) -> tuple[float, float, float]:
        """Standard deviation of both parts together, m."""
        north, east, down = np.hypot(self.white_sd, self.correlated_sd)
        return float(north), float(east), float(down)


L1_CODE = GnssGrade("L1 code", 5, (0.6, 0.6, 0.9), (1.9, 1.9, 2.85), 60.0, (0.05, 0.05, 0.08))
"""2.0 m horizontal, 3.0 m vertical, most of it slow."""
DIFFERENTIAL_CODE = GnssGrade(
    "differential code", 4, (0.4, 0.4, 0.6), (0.5, 0.5, 0.75), 60.0, (0.05, 0.05, 0.08)
)
"""0.64 m horizontal: what the base station shares is gone, multipath stays."""
RTK_FIXED = GnssGrade(
    "RTK fixed", 1, (0.015, 0.015, 0.03), (0.02, 0.02, 0.04), 60.0, (0.03, 0.03, 0.05)
)
"""0.025 m horizontal, 0.05 m vertical."""


def simulate_receiver(
    profile: Profile,
    grade: GnssGrade,
    rate: float = 1.0,
    *,
    rng: np.random.Generator,
    velocity: bool = True,
    **options: Unpack[ReceiverOptions],
) -> GnssRecording:
    """Return what a receiver of some grade records on a known motion.

    Parameters
    ----------
    profile : Profile
        True motion.
    grade : GnssGrade
        How good the receiver is.
    rate : float
        Fixes a second, Hz.
    rng : numpy.random.Generator
        Source of randomness.
    velocity : bool
        Whether velocity is measured too.
    **options
        lever_arm, start, latency, velocity_latency, claimed_scale, outages, outlier_rate,
        outlier_size and name, as for `simulate_gnss`; the name is that of the grade.

    Returns
    -------
    GnssRecording
        Latitude and longitude in rad, height in m, velocity north, east, down in m/s.

    Raises
    ------
    InputError
        A rate or outages outside the motion.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> sd = (1.0, 1.0, 2.0)
    >>> grade = schuler.GnssGrade("code", 5, sd, sd, 60.0, (0.1, 0.1, 0.1))
    >>> ride = schuler.motorcycle(120.0)
    >>> schuler.simulate_receiver(ride, grade, rng=np.random.default_rng(0)).time.size > 100
    True
    """
    refuse_unknown(simulate_receiver, options, ReceiverOptions)
    slow = any(grade.correlated_sd)
    recording = simulate_gnss(
        profile,
        rate,
        position_sd=grade.white_sd,
        velocity_sd=grade.velocity_sd if velocity else None,
        rng=rng,
        correlated_sd=grade.correlated_sd if slow else None,
        correlation_time=grade.correlation_time if slow else None,
        **({"name": grade.name} | options),
    )
    return replace(recording, quality=np.full(recording.size, grade.quality))
