"""Standing and creeping told apart: by the speed that a drive shows, and by how much it shakes.

An IMU feels no motion in a vehicle that stands, nor in one that creeps steadily. A smoothed run
without constraints knows the speed at all such moments. Where it is not zero on average, a limit
on the shaking is looked for below which the vehicle stands; where none is, nothing is known of
standing, and zero velocities are not used.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.data import ImuRecording, NavigationSolution
from schuler.navigation.aiding.standstill import (
    REST_VELOCITY_SD,
    StandingJudgement,
    detect_standstill,
    shaking,
)
from schuler.navigation.stepping import STANDING
from schuler.screening.screen import Finding
from schuler.types import FloatArray

ALLOWED = (2.0 * REST_VELOCITY_SD) ** 2
"""Mean square of speed that zero velocities forgive, (m/s)²."""
FAST = (3.0 * REST_VELOCITY_SD) ** 2
SLOW = STANDING + 3.0
"""Speed at which a filter without GNSS may take a vehicle for one that stands, m/s."""
MOST_FAST = 0.03
"""Square of a speed of which no more than a few stands may be, beyond three standard deviations."""
SURE = 2.0
"""Standard errors by which it has to be more."""
FEWEST_STANDS = 4
"""Stands below a limit that show that it holds."""
BEGINS_ANEW = 1.6
"""Seconds between two moments of different stands."""


@dataclass(frozen=True, slots=True, eq=False)
class _Stands:
    """Of every stand: excess of the squared speed over its variance, shaking, moments."""

    excess: FloatArray
    variance: FloatArray
    shaking: FloatArray
    moments: FloatArray

    def moves(self, which: NDArray[np.bool_]) -> bool:
        """Whether these stands are sure to hold more speed than zero velocities forgive."""
        excess, weight = self.excess[which], self.moments[which]
        if not excess.size:
            return False
        mean = float(np.average(excess, weights=weight))
        share = weight / weight.sum()
        error = float(np.sqrt(np.sum((share * (excess - mean)) ** 2)))
        fast = excess > FAST + 9.0 * self.variance[which]
        return mean > ALLOWED + SURE * error or float(share[fast].sum()) > MOST_FAST


def judge_standing(
    imu: ImuRecording, smoothed: NavigationSolution
) -> tuple[StandingJudgement | None, Finding | None]:
    """Say at which moments without felt motion a vehicle stands; None, None: at all of them."""
    found = detect_standstill(imu)
    if not found.time.size:
        return None, None
    shaken = shaking(imu, found.time)
    at = np.clip(np.searchsorted(smoothed.trajectory.time, found.time), 0, imu.size - 1)
    speed = smoothed.trajectory.velocity[at, :2]
    variance = smoothed.velocity_sd[at, :2] ** 2
    variance = variance.sum(axis=1)
    square = (speed**2).sum(axis=1)
    slow = square < SLOW**2
    if not slow.any():
        return None, None
    found, shaken = found.select(slow), shaken[slow]
    variance = variance[slow]
    excess = square[slow] - variance
    edges = np.flatnonzero(np.diff(found.time) > BEGINS_ANEW) + 1
    groups = np.split(np.arange(found.time.size), edges)
    stands = _Stands(
        np.array([excess[g].mean() for g in groups]),
        np.array([variance[g].mean() for g in groups]),
        np.array([shaken[g].mean() for g in groups]),
        np.array([float(g.size) for g in groups]),
    )
    everywhere = np.ones(len(groups), dtype=bool)
    if not stands.moves(everywhere):
        return None, None
    order = np.sort(stands.shaking)
    for limit in 0.5 * (order[1:] + order[:-1])[::-1]:
        below = stands.shaking <= limit
        if below.sum() >= FEWEST_STANDS and not stands.moves(below):
            standing = np.repeat(below, [g.size for g in groups]) & (shaken <= limit)
            left = float(np.mean(~standing))
            text = (
                f"the vehicle creeps at {100.0 * left:.0f} % of the moments at which the IMU feels "
                "no motion: zero velocities (zupt) are used where it shakes as little as when it "
                "stands"
            )
            told = Finding("zupt", "info", text, value=left)
            return StandingJudgement(found.time, standing, float(limit)), told
    fast = float(np.sqrt(max(np.average(stands.excess, weights=stands.moments), 0.0)))
    text = (
        "zero velocities (zupt) are switched off: where the IMU feels no motion the vehicle still "
        f"moves, by {fast:.2f} m/s on average, and shaking does not tell standing from creeping"
    )
    none = StandingJudgement(found.time, np.zeros(found.time.size, dtype=bool), -np.inf)
    return none, Finding("zupt", "warning", text, value=fast)
