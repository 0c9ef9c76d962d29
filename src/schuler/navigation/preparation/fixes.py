"""GNSS fixes that cannot belong to the motion that the others show.

Every step from one fix to the next is compared with the velocity: what is left must be within the
receiver's own uncertainty and what a vehicle can do between two fixes. Where it is not, the track
breaks; a short stretch between two breaks, across which the neighbours fit together, is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from schuler.data import GnssRecording
from schuler.types import FloatArray

SIGMAS = 10.0
"""Standard deviations of a step that a good fix may be off."""
SLACK = 3.0
"""Metres besides: receivers change their satellites and ambiguities."""
AGILITY = 10.0
"""Acceleration within which velocities of two epochs tell the way between them, m/s²."""
LONGEST_STRETCH = 5
"""Epochs of a wrong stretch; a longer one is a change of the receiver's mind."""
LONGEST_BRIDGE = 10.0
"""Seconds between neighbours that are still compared."""


@dataclass(frozen=True, slots=True, eq=False)
class FixScreening:
    """What was seen in the positions of a receiver.

    Parameters
    ----------
    wrong : (n,) ndarray of bool
        Epochs that fit neither the one before nor the one behind.
    away : (n,) ndarray
        How far they are from where their neighbours put them, m; zero for good ones.
    jumps : tuple of (float, float)
        Time (s) and size (m) of jumps that stay.
    """

    wrong: NDArray[np.bool_]
    away: FloatArray
    jumps: tuple[tuple[float, float], ...]


def screen_fixes(gnss: GnssRecording) -> FixScreening:
    """Look for fixes that are off by more than their uncertainty and any motion explain."""
    n = gnss.size
    wrong, away = np.zeros(n, dtype=bool), np.zeros(n)
    if n < 4:
        return FixScreening(wrong, away, ())
    track = _Track(gnss)
    index = np.arange(n - 1)
    left, allowed = track.misfit(index, index + 1)
    breaks = np.flatnonzero(left > allowed)
    if not breaks.size:
        return FixScreening(wrong, away, ())
    edges = np.concatenate([[0], breaks + 1, [n]])
    stretches = [(int(a), int(b)) for a, b in pairwise(edges)]
    jumps: list[tuple[float, float]] = []
    # the first long stretch is where the track is believed
    sizes = [b - a for a, b in stretches]
    start = int(np.argmax(np.array(sizes) > min(LONGEST_STRETCH, max(sizes) - 1)))
    for a, b in stretches[:start]:
        off, room = track.misfit_of(a, stretches[start][0])
        if off > room:
            wrong[a:b] = True
            away[a:b] = off
    last = stretches[start][1] - 1
    for a, b in stretches[start + 1 :]:
        off, room = track.misfit_of(last, a)
        if off > room and b - a <= LONGEST_STRETCH:
            wrong[a:b] = True
            away[a:b] = off
            continue
        if off > room and np.isfinite(room):
            jumps.append((float(gnss.time[a]), off))
        last = b - 1
    return FixScreening(wrong, away, tuple(jumps))


class _Track:
    """Positions in local metres, with velocities from the receiver or from the positions."""

    def __init__(self, gnss: GnssRecording) -> None:
        from schuler.earth import metres_per_radian

        # around a median: one fix may be anywhere on earth
        middle = np.median(gnss.position, axis=0)
        north, east = metres_per_radian(middle)
        turn = gnss.position - middle
        turn[:, 1] -= 2.0 * np.pi * np.round(turn[:, 1] / (2.0 * np.pi))
        self.time = gnss.time
        self.local = turn[:, :2] * np.array([float(north), float(east)])
        sd = np.full(gnss.size, np.nan)
        if gnss.position_sd is not None:
            sd = gnss.position_sd[:, :2].max(axis=1)
        self.sd = np.where(np.isfinite(sd), sd, 5.0)
        if gnss.velocity is not None:
            self.velocity = gnss.velocity[:, :2]
        else:
            self.velocity = _running_velocity(self.time, self.local)

    def misfit(self, i: NDArray[np.int64], j: NDArray[np.int64]) -> tuple[FloatArray, FloatArray]:
        """Metres that are left of the way from i to j, and how many may be."""
        span = self.time[j] - self.time[i]
        way = 0.5 * (self.velocity[i] + self.velocity[j]) * span[:, None]
        left = np.linalg.norm(self.local[j] - self.local[i] - way, axis=1)
        allowed = SLACK + SIGMAS * np.hypot(self.sd[i], self.sd[j]) + 0.5 * AGILITY * span**2
        return left, np.where(span > LONGEST_BRIDGE, np.inf, allowed)

    def misfit_of(self, i: int, j: int) -> tuple[float, float]:
        left, allowed = self.misfit(np.array([i]), np.array([j]))
        return float(left[0]), float(allowed[0])


def _running_velocity(time: FloatArray, local: FloatArray) -> FloatArray:
    """Median of five steps: one wrong fix moves two of them."""
    steps = np.diff(local, axis=0) / np.diff(time)[:, None]
    padded = np.concatenate([steps[:1].repeat(3, axis=0), steps, steps[-1:].repeat(3, axis=0)])
    windows = np.lib.stride_tricks.sliding_window_view(padded, 6, axis=0)
    return np.asarray(np.median(windows, axis=-1)[: time.size])
