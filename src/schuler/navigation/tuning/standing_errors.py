"""What a receiver's positions do beside a vehicle that stands: a least size of errors that last.

Innovations of a drive hardly see errors that change slowly, and filters of receivers make them
smoother than any model of a few states. A vehicle that stands shows them bare: by how much the
last fix of a stand is off the first one. The lasting share of the claim is not left below what
all stands together are sure to need.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.earth import ned_from_geodetic
from schuler.navigation.aiding.standstill import detect_standstill
from schuler.navigation.preparation.standing import BEGINS_ANEW
from schuler.types import FloatArray

SHORTEST = 8.0
"""Seconds of a stand that is looked at."""
EDGE = 0.5
"""Seconds of its ends that are left out."""
STILL = 0.1
"""Median speed of GNSS, m/s, above which a vehicle creeps."""
SURE = 0.999
"""Probability that errors as small as supposed would have wandered less."""


@dataclass(frozen=True, slots=True, eq=False)
class Wander:
    """Of every stand: seconds (k,), how far fixes went north and east (k, 2), claimed sd (k, 2)."""

    seconds: FloatArray
    way: FloatArray
    sd: FloatArray

    def least_slow(self, white: float, time: float, most: float, sure: float = SURE) -> float:
        """Least lasting share of the claimed variance that the stands allow, up to a limit."""
        from scipy.stats import chi2

        if not self.seconds.size:
            return 0.0
        square = self.way**2 / (2.0 * self.sd**2)
        gone = 1.0 - np.exp(-self.seconds[:, None] / time)
        limit = float(chi2.ppf(sure, square.size))
        for slow in (0.0, *np.geomspace(0.01, most, 100).tolist()):
            if float(np.sum(square / (white + slow * gone))) <= limit:
                return float(slow)
        return most


def wander_at_stands(imu: ImuRecording, gnss: GnssRecording, offset: float) -> Wander:
    """Look at all stands; `offset`: of GNSS, s. None without velocities, which tell creeping."""
    found = []
    rest = detect_standstill(imu).time
    if gnss.velocity is not None and rest.size:
        assert gnss.position_sd is not None
        time = gnss.time + offset
        local = ned_from_geodetic(gnss.position, gnss.position[0])[:, :2]
        for stand in np.split(rest, np.flatnonzero(np.diff(rest) > BEGINS_ANEW) + 1):
            i, j = np.searchsorted(time, [stand[0] + EDGE, stand[-1] - EDGE])
            j -= 1
            if j <= i or time[j] - time[i] < SHORTEST:
                continue
            speed = gnss.velocity[i : j + 1, :2]
            if np.median(np.linalg.norm(speed, axis=1)) > STILL:
                continue
            way = local[j] - local[i]
            # what creeping may have done of it is not the receiver's
            crept = np.diff(time[i : j + 1]) @ (0.5 * (speed[1:] + speed[:-1]))
            way = np.where(np.abs(way - crept) < np.abs(way), way - crept, way)
            found.append([time[j] - time[i], *way, *gnss.position_sd[[i, j], :2].max(axis=0)])
    table = np.array(found).reshape(-1, 5)
    table = table[np.isfinite(table).all(axis=1)]
    return Wander(table[:, 0], table[:, 1:3], table[:, 3:])
