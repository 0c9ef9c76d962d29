"""Grades of GNSS receivers, from one frequency and code alone to fixed ambiguities (spec 1.3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from schuler.data import GnssRecording
from schuler.simulation.gnss import simulate_gnss
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
    lever_arm: ArrayLike = (0.0, 0.0, 0.0),
    start: float | None = None,
    latency: float = 0.0,
    velocity_latency: float | None = None,
    claimed_scale: float = 1.0,
    outages: Sequence[tuple[float, float]] = (),
    outlier_rate: float = 0.0,
    outlier_size: float = 50.0,
    velocity: bool = True,
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
    lever_arm : (3,) array_like
        Of the antenna in the body, m.
    start : float, optional
        Time of the first fix, s.
    latency, velocity_latency : float
        Seconds that the stamps are late.
    claimed_scale : float
        Factor on the standard deviations that are told.
    outages : sequence of (start, seconds)
        Without fixes.
    outlier_rate, outlier_size : float
        Share of wrong fixes, and how wrong they are, m.
    velocity : bool
        Whether velocity is measured too.

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
    slow = any(grade.correlated_sd)
    recording = simulate_gnss(
        profile,
        rate,
        position_sd=grade.white_sd,
        velocity_sd=grade.velocity_sd if velocity else None,
        rng=rng,
        lever_arm=lever_arm,
        start=start,
        correlated_sd=grade.correlated_sd if slow else None,
        correlation_time=grade.correlation_time if slow else None,
        latency=latency,
        velocity_latency=velocity_latency,
        claimed_scale=claimed_scale,
        outages=outages,
        outlier_rate=outlier_rate,
        outlier_size=outlier_size,
        name=grade.name,
    )
    return replace(recording, quality=np.full(recording.size, grade.quality))
