"""GNSS fixes that cannot belong to the motion that the others show.

Every step from one fix to the next is compared with the velocity: what is left must be within the
receiver's own uncertainty and what a vehicle can do between two fixes. Where it is not, the track
breaks; a short stretch between two breaks, across which the neighbours fit together, is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from schuler.data import GnssRecording, ImuRecording
from schuler.types import FloatArray

SIGMAS = 10.0
"""Standard deviations of a step that a good fix may be off, ..."""
DETOUR_SIGMAS = 5.0
"""... and where another step leads back."""
SLACK = 3.0
"""Metres besides: receivers change their satellites and ambiguities."""
AGILITY = 10.0
"""Acceleration within which velocities of two epochs tell the way between them, m/s²."""
LONGEST_STRETCH = 5
"""Epochs of a wrong stretch; a longer one is a change of the receiver's mind."""
LONGEST_BRIDGE = 10.0
"""Seconds between neighbours that are still compared."""
LONGEST_DETOUR = 90.0
"""Seconds after which a receiver that jumped may still jump back to where its velocities lead."""
DRIFT = 0.2
"""Errors of velocities that add up on such a way, m/s."""
FEWEST_HELD = 3
"""Epochs with exactly the same position."""


@dataclass(frozen=True, slots=True, eq=False)
class FixScreening:
    """What was seen in the positions of a receiver."""

    # (n,): epochs that fit neither the one before nor the one behind, or only repeat a fix
    wrong: NDArray[np.bool_]
    # (n,): how far they are from where their neighbours put them, m; zero for good ones.
    away: FloatArray
    # jumps, height_jumps: time (s) and size (m) of jumps that stay
    jumps: tuple[tuple[float, float], ...]
    height_jumps: tuple[tuple[float, float], ...] = ()


def screen_fixes(gnss: GnssRecording) -> FixScreening:
    """Look for fixes that are off by more than their uncertainty and any motion explain."""
    away = _held(gnss)
    free = np.flatnonzero(away == 0.0)
    rest = gnss.select(away == 0.0)
    away[free] = _screen(_Track(rest, slice(0, 2)), DETOUR_SIGMAS, only_detours=True)[0]
    free = np.flatnonzero(away == 0.0)
    rest = gnss.select(away == 0.0)
    away[free], jumps = _screen(_Track(rest, slice(0, 2)), SIGMAS)
    inner = gnss.select(away == 0.0)
    return FixScreening(away > 0.0, away, jumps, _screen(_Track(inner, slice(2, 3)), SIGMAS)[1])


def _held(gnss: GnssRecording) -> FloatArray:
    """Return how far the vehicle is from a fix that a receiver held while it had none, (n,).

    A receiver that holds its fix at rest goes on from there; one that lost its satellites jumps.
    """
    away = np.zeros(gnss.size)
    fresh = np.ones(gnss.size, dtype=bool)
    fresh[1:] = (gnss.position[1:] != gnss.position[:-1]).any(axis=1)
    starts = np.append(np.flatnonzero(fresh), gnss.size)
    runs = [(a, b) for a, b in pairwise(starts.tolist()) if b - a >= FEWEST_HELD and b < gnss.size]
    if not runs:
        return away
    track = _Track(gnss, slice(0, 2))
    for a, b in runs:
        speed = max(np.linalg.norm(track.velocity[k]) for k in (max(a - 1, 0), b))
        # the first that is not held may be a wrong one
        after = track.local[b : b + LONGEST_STRETCH + 1]
        off = float(np.linalg.norm(after - track.local[a], axis=1).min())
        if off > SLACK + SIGMAS * track.sd[b] + 2.0 * speed * (gnss.time[b] - gnss.time[b - 1]):
            away[a + 1 : b] = off
    return away


def _screen(
    track: _Track, sigmas: float, *, only_detours: bool = False
) -> tuple[FloatArray, tuple[tuple[float, float], ...]]:
    """Return how far off the wrong epochs of a track are, and the jumps that stay."""
    n = track.time.size
    away = np.zeros(n)
    if n < 4:
        return away, ()
    index = np.arange(n - 1)
    left, allowed = track.misfit(index, index + 1, sigmas)
    breaks = np.flatnonzero(left > allowed)
    if not breaks.size:
        return away, ()
    edges = np.concatenate([[0], breaks + 1, [n]])
    stretches = [(int(a), int(b)) for a, b in pairwise(edges)]
    jumps: list[tuple[float, float]] = []
    # the first long stretch is where the track is believed
    sizes = [b - a for a, b in stretches]
    start = int(np.argmax(np.array(sizes) > min(LONGEST_STRETCH, max(sizes) - 1)))
    for a, b in stretches[:start]:
        off, room = track.misfit_of(a, stretches[start][0], sigmas)
        if off > room and not only_detours:
            away[a:b] = off
    last, back = stretches[start][1] - 1, 0
    for k, (a, b) in enumerate(stretches[start + 1 :], start + 1):
        off, room = track.misfit_of(last, a, sigmas)
        if off > room and a >= back:
            later = (c for c, _ in stretches[k + 1 :])
            back = next((c for c in later if track.comes_back(last, c, off)), back)
        if off > room and (a < back or (b - a <= LONGEST_STRETCH and not only_detours)):
            away[a:b] = off
            continue
        if off > room and np.isfinite(room):
            jumps.append((float(track.time[a]), off))
        last = b - 1
    return away, tuple(jumps)


class _Track:
    """Positions in local metres, with velocities from the receiver or from the positions."""

    def __init__(self, gnss: GnssRecording, axes: slice) -> None:
        from schuler.earth import metres_per_radian

        # around a median: one fix may be anywhere on earth
        middle = np.median(gnss.position, axis=0)
        north, east = metres_per_radian(middle)
        turn = gnss.position - middle
        turn[:, 1] -= 2.0 * np.pi * np.round(turn[:, 1] / (2.0 * np.pi))
        self.time = gnss.time
        self.local = (turn * np.array([float(north), float(east), -1.0]))[:, axes]
        sd = np.full(gnss.size, np.nan)
        if gnss.position_sd is not None:
            sd = gnss.position_sd[:, axes].max(axis=1)
        self.sd = np.where(np.isfinite(sd), sd, 5.0)
        # share of a t² that a way may differ from that by the mean of both velocities
        self.unseen = 0.5 if gnss.velocity is None else 0.25
        if gnss.velocity is not None:
            self.velocity = gnss.velocity[:, axes]
        else:
            self.velocity = _running_velocity(self.time, self.local)

    def misfit(
        self, i: NDArray[np.int64], j: NDArray[np.int64], sigmas: float
    ) -> tuple[FloatArray, FloatArray]:
        """Metres that are left of the way from i to j, and how many may be."""
        span = self.time[j] - self.time[i]
        way = 0.5 * (self.velocity[i] + self.velocity[j]) * span[:, None]
        left = np.linalg.norm(self.local[j] - self.local[i] - way, axis=1)
        allowed = SLACK + sigmas * np.hypot(self.sd[i], self.sd[j])
        allowed += self.unseen * AGILITY * span**2
        return left, np.where(span > LONGEST_BRIDGE, np.inf, allowed)

    def misfit_of(self, i: int, j: int, sigmas: float) -> tuple[float, float]:
        left, allowed = self.misfit(np.array([i]), np.array([j]), sigmas)
        return float(left[0]), float(allowed[0])

    def comes_back(self, i: int, j: int, off: float) -> bool:
        """Whether velocities lead from i to j, though what lies between is off by some metres."""
        span = self.time[j] - self.time[i]
        if span > LONGEST_DETOUR:
            return False
        steps = np.diff(self.time[i : j + 1])[:, None]
        way = (0.5 * (self.velocity[i:j] + self.velocity[i + 1 : j + 1]) * steps).sum(axis=0)
        left = float(np.linalg.norm(self.local[j] - self.local[i] - way))
        sd = float(np.hypot(self.sd[i], self.sd[j]))
        return left < min(0.3 * off, SLACK + 3.0 * sd + DRIFT * float(span))


def _running_velocity(time: FloatArray, local: FloatArray) -> FloatArray:
    """Median of five steps: one wrong fix moves two of them."""
    steps = np.diff(local, axis=0) / np.diff(time)[:, None]
    padded = np.concatenate([steps[:1].repeat(3, axis=0), steps, steps[-1:].repeat(3, axis=0)])
    windows = np.lib.stride_tricks.sliding_window_view(padded, 6, axis=0)
    return np.asarray(np.median(windows, axis=-1)[: time.size])


BLOCK_RATE = 10.0
"""Blocks a second into which the IMU is averaged."""
DOWN_MEMORY = 4.0
"""Seconds over which the direction of down is averaged."""
SLOWEST = 4.0
"""Below this speed a course is mostly noise and lever arm, m/s."""
SPAN = 1.0
"""Turns are compared over about this time, s."""
REACH = 3.0
LAG_STEP = 0.1
"""Lags that are tried, s."""
LEAST_TURN = np.radians(180.0)
"""Sum of the turns of the course that tells anything."""
RELATED = 0.8
"""Correlation at which IMU and course are taken to turn together."""
FEWEST = 20
"""Turns."""
CONVINCING = 30.0
"""Gain of log-likelihood at which two lags are believed instead of one."""
LARGEST_TURN = 0.3
"""Misfit of a turn beyond which it counts no more, rad."""
LEAST_JUMP = 0.4
"""Seconds: antennas ahead of the rear axle make the course early by up to this."""


@dataclass(frozen=True, slots=True)
class LagChange:
    """One lag before, another one after."""

    time: float  # IMU time at which it changed, about, s
    # before, after: seconds that the IMU's stamps are late against GNSS
    before: float
    after: float


@dataclass(frozen=True, slots=True)
class TurnComparison:
    """Turns of the IMU about the vertical against turns of the course."""

    # at the best lag; negative where they turn against each other; NaN where too little turns.
    correlation: float
    slope: float  # turn of the course for one of the IMU
    lag: float  # seconds that the IMU's stamps are late against GNSS
    seconds: float  # time that was compared
    change: LagChange | None = None  # where two lags fit much better than one
    # of the turns at the best single lag, wild ones clipped; for comparing stamps.
    log_likelihood: float = float("nan")

    @property
    def together(self) -> bool:
        """Whether the IMU turns as the course does, or exactly against it."""
        return bool(abs(self.correlation) > RELATED and 0.6 < abs(self.slope) < 1.6)


NOTHING_TOLD = TurnComparison(float("nan"), float("nan"), float("nan"), 0.0)


def compare_turns(imu: ImuRecording, gnss: GnssRecording) -> TurnComparison:
    """Compare turns over a second each, for every lag within three seconds."""
    if gnss.velocity is None or imu.duration < 4.0 * REACH:
        return NOTHING_TOLD
    time, angle = turned_about_down(imu)
    first, second, course = _turns_of_course(gnss)
    room = gnss.time[first] > time[0] + REACH
    room &= gnss.time[second] < time[-1] - REACH
    first, second, course = first[room], second[room], course[room]
    if first.size < FEWEST or np.abs(course).sum() < LEAST_TURN:
        return NOTHING_TOLD
    span = gnss.time[second] - gnss.time[first]
    lags = np.arange(-REACH, REACH + 0.5 * LAG_STEP, LAG_STEP)
    felt = np.stack(
        [
            np.interp(gnss.time[second] + lag, time, angle)
            - np.interp(gnss.time[first] + lag, time, angle)
            for lag in lags
        ]
    )
    # course = slope felt + bias span, for every lag
    along = felt - (felt @ span / (span @ span))[:, None] * span
    seen = course - (course @ span / (span @ span)) * span
    power, total = np.einsum("li,li->l", along, along), float(seen @ seen)
    if total <= 0.0 or power.min() <= 0.0:
        return NOTHING_TOLD
    product = along @ seen
    relation = product / np.sqrt(power * total)
    best = int(np.argmax(np.abs(relation)))
    found = TurnComparison(
        correlation=float(relation[best]),
        slope=float(product[best] / power[best]),
        lag=float(lags[best]),
        seconds=float(span.sum()),
    )
    left = (seen - np.sign(found.slope) * along) ** 2
    change = _change_of_lag(left, lags, gnss.time[first])
    spread = float(np.mean(np.minimum(left[best], LARGEST_TURN**2)))
    return replace(found, change=change, log_likelihood=-0.5 * first.size * np.log(spread))


def turned_about_down(imu: ImuRecording) -> tuple[FloatArray, FloatArray]:
    """Angle that an IMU has turned about the vertical, by its own gravity."""
    group = max(int(imu.rate / BLOCK_RATE), 1)
    count = (imu.size - 1) // group
    stop = count * group + 1
    step = np.diff(imu.time[:stop])
    time = imu.time[:stop:group]
    force = imu.accel[1:stop].reshape(count, group, 3).mean(axis=1)
    turn = (imu.gyro[1:stop] * step[:, None]).reshape(count, group, 3).sum(axis=1)
    half = max(round(0.5 * DOWN_MEMORY * imu.rate / group), 1)
    total = np.concatenate([np.zeros((1, 3)), np.cumsum(force, axis=0)])
    rows = np.arange(count)
    mean = total[np.minimum(rows + half, count)] - total[np.maximum(rows - half, 0)]
    down = -mean / np.maximum(np.linalg.norm(mean, axis=1, keepdims=True), 1e-12)
    angle = np.concatenate([[0.0], np.cumsum(np.einsum("ij,ij->i", turn, down))])
    return time, angle


def _turns_of_course(
    gnss: GnssRecording,
) -> tuple[NDArray[np.int64], NDArray[np.int64], FloatArray]:
    """Pairs of epochs about a second apart, and by how much the course turned between them."""
    assert gnss.velocity is not None
    step = max(1, round(SPAN / float(np.median(np.diff(gnss.time))))) if gnss.size > 1 else 1
    first = np.arange(0, gnss.size - step, step)
    second = first + step
    fast = np.linalg.norm(gnss.velocity[:, :2], axis=1) > SLOWEST
    span = gnss.time[second] - gnss.time[first]
    good = fast[first] & fast[second] & (span < 3.0 * SPAN)
    first, second = first[good], second[good]
    course = gnss.velocity[:, 0] + 1j * gnss.velocity[:, 1]
    return first, second, np.angle(course[second] * np.conj(course[first]))


def _change_of_lag(left: FloatArray, lags: FloatArray, time: FloatArray) -> LagChange | None:
    """Best split of the turns into two stretches with a lag each. `left` (lags, turns): squares."""
    count = time.size
    # one wild turn is no proof
    limit = 9.0 * float(np.median(left[int(np.argmin(left.sum(axis=1)))])) / 0.455
    total = np.cumsum(np.minimum(left, max(limit, 1e-12)), axis=1)
    whole = total[:, -1].min()
    before = total.min(axis=0)
    after = (total[:, -1:] - total).min(axis=0)
    margin = FEWEST // 2
    if count < 4 * margin:
        return None
    both = (before + after)[margin - 1 : count - margin]
    k = int(np.argmin(both)) + margin - 1
    gain = 0.5 * count * np.log(whole / max(before[k] + after[k], 1e-300))
    one = lags[int(np.argmin(total[:, k]))]
    two = lags[int(np.argmin(total[:, -1] - total[:, k]))]
    if gain < CONVINCING or abs(two - one) < LEAST_JUMP:
        return None
    return LagChange(float(time[k + 1]), float(one), float(two))
