"""Motion that an IMU did not see: gaps, and axes that stood still while the vehicle did not.

What is missing is interpolated between what was felt just before and just after. How wrong that
is, the rest of the recording tells: the same interpolation is tried over stretches of the same
length where the motion was seen. The filter gets its variance as noise of that time, so that its
covariance opens up by what can have happened, and closes again with the aiding after it.

A filter is linear in small attitude errors: beyond `BRIDGED_TURN` it stops at the last sample
before a gap and is aligned anew behind it, like at the beginning of a recording.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from schuler.data import GnssRecording, ImuRecording
from schuler.errors import NavigationError
from schuler.navigation.preparation.alignment import Alignment
from schuler.screening.screen import Finding
from schuler.types import FloatArray

SHORTEST_GAP = 0.1
"""Seconds; a few lost samples are no missing motion."""
SHORTEST_GAP_STEPS = 5.0
"""Steps."""
EDGE = 0.1
"""Seconds before and after, the means of which are interpolated."""
MOST_TRIALS = 400
FEWEST_TRIALS = 8
# what may have happened where the recording is too short to tell: rad/s and m/s² of an agile car
ROUGH_RATE = 0.3
ROUGH_FORCE = 2.0


@dataclass(frozen=True, slots=True, eq=False)
class DataGap:
    """A stretch in which some or all axes saw nothing."""

    # start, stop: last time before and first time after at which everything was seen, s
    start: float
    stop: float
    channels: NDArray[np.bool_]  # (6,): which axes, accelerometers first
    # (6,): of the interpolated increment over the whole stretch, (m/s)² and rad², in IMU axes; zero
    # for the others.
    variance: FloatArray
    gap: bool  # whether the samples are missing altogether

    @property
    def seconds(self) -> float:
        """How long it lasts."""
        return self.stop - self.start

    @property
    def attitude_sd(self) -> float:
        """Root of the sum of the three variances of the turn, rad."""
        return float(np.sqrt(self.variance[3:].sum()))


def find_gaps(imu: ImuRecording) -> list[tuple[float, float]]:
    """Return times of the last sample before and the first after each gap that matters."""
    step = np.diff(imu.time)
    usual = float(np.median(step))
    gaps = np.flatnonzero(step > max(SHORTEST_GAP, SHORTEST_GAP_STEPS * usual))
    return [(float(imu.time[k]), float(imu.time[k + 1])) for k in gaps]


def interpolation_variance(
    imu: ImuRecording, seconds: float, gaps: Sequence[tuple[float, float]]
) -> FloatArray:
    """Mean square of what an interpolation over a time misses, tried where the motion was seen."""
    time = imu.time
    values = np.concatenate([imu.accel, imu.gyro], axis=1)
    step = np.diff(time)[:, None]
    areas = 0.5 * (values[1:] + values[:-1]) * step
    total = np.concatenate([np.zeros((1, 6)), np.cumsum(areas, axis=0)])

    def at(t: FloatArray) -> FloatArray:
        k = np.clip(np.searchsorted(time, t, side="right") - 1, 0, time.size - 2)
        share = ((t - time[k]) / (time[k + 1] - time[k]))[:, None]
        return np.asarray(total[k] + share * (total[k + 1] - total[k]))

    length = seconds
    while True:
        room = imu.duration - length - 2.0 * EDGE
        if room > 0.0:
            count = int(min(MOST_TRIALS, max(4.0 * room / length, FEWEST_TRIALS)))
            begin = time[0] + EDGE + np.linspace(0.0, room, count)
            clear = np.ones(count, dtype=bool)
            for a, b in gaps:
                clear &= (begin - EDGE > b) | (begin + length + EDGE < a)
            begin = begin[clear]
            if begin.size >= FEWEST_TRIALS:
                break
        length *= 0.5
        if length < 2.0 * EDGE:
            rough = np.repeat([ROUGH_FORCE, ROUGH_RATE], 3) * seconds
            return np.asarray(rough**2)
    first, last = at(begin), at(begin + length)
    before = (first - at(begin - EDGE)) / EDGE
    after = (at(begin + length + EDGE) - last) / EDGE
    missed = last - first - 0.5 * length * (before + after)
    return np.asarray(np.mean(missed**2, axis=0) * (seconds / length) ** 2)


def bridged(imu: ImuRecording, gaps: Sequence[DataGap]) -> ImuRecording:
    """Return a recording whose gaps are bridged by straight lines."""
    if not gaps:
        return imu
    accel, gyro = imu.accel.copy(), imu.gyro.copy()
    time = imu.time
    added: list[FloatArray] = []
    values: list[FloatArray] = []
    step = 1.0 / imu.rate
    for part in gaps:
        a = int(np.searchsorted(time, part.start, side="right"))
        b = int(np.searchsorted(time, part.stop, side="left"))
        width = max(round(EDGE * imu.rate), 1)
        whole = np.concatenate([imu.accel, imu.gyro], axis=1)
        before, after = whole[max(a - width, 0) : a].mean(axis=0), whole[b : b + width].mean(axis=0)
        count = max(round(part.seconds / step) - 1, 1) if part.gap else b - a
        if part.gap:
            stamps = part.start + part.seconds * np.arange(1, count + 1) / (count + 1)
        else:
            stamps = time[a:b]
        share = ((stamps - part.start) / part.seconds)[:, None]
        line = before + share * (after - before)
        if part.gap:
            added.append(stamps)
            values.append(line)
        else:
            for c in np.flatnonzero(part.channels):
                (accel if c < 3 else gyro)[a:b, c % 3] = line[:, c]
    history = (*imu.history, *(_said(p) for p in gaps))
    if not added:
        return replace(imu, accel=accel, gyro=gyro, history=history)
    stamps = np.concatenate([time, *added])
    order = np.argsort(stamps, kind="stable")
    rows = np.concatenate([np.concatenate([accel, gyro], axis=1), *values])[order]
    return replace(
        imu,
        time=stamps[order],
        accel=rows[:, :3],
        gyro=rows[:, 3:],
        temperature=None,
        history=history,
    )


def _said(part: DataGap) -> str:
    what = "gap" if part.gap else "stuck axes"
    return f"{what} from {part.start:.3f} to {part.stop:.3f} s bridged by straight lines"


def gap_noise_density(time: FloatArray, gaps: Sequence[DataGap]) -> FloatArray | None:
    """Squared noise densities that gaps add, sample by sample."""
    if not gaps:
        return None
    added = np.zeros((time.size, 6))
    begin = np.concatenate([[2.0 * time[0] - time[1]], time[:-1]])
    for part in gaps:
        a = int(np.searchsorted(time, part.start, side="right"))
        b = int(np.searchsorted(begin, part.stop, side="left"))
        rows = slice(a, b)
        covered = np.minimum(time[rows], part.stop) - np.maximum(begin[rows], part.start)
        share = covered / (time[rows] - begin[rows])
        added[rows] += share[:, None] * part.variance / part.seconds
    return added


@dataclass(frozen=True, slots=True, eq=False)
class Restart:
    """A moment at which the filter begins anew, with the sensor errors it knows."""

    begin: float  # last moment before, s; what is measured in between is not used.
    time: float  # first sample of what follows, s
    alignment: Alignment  # attitude and velocity there
    knocked: bool = False  # whether the IMU is another one from there on


@dataclass(frozen=True, slots=True, eq=False)
class WorseStretch:
    """Time on the axis of GNSS in which its positions are no better than some sd (3,), m."""

    begin: float
    end: float
    sd: FloatArray  # north, east, down


@dataclass(frozen=True, slots=True, eq=False)
class DriveCondition:
    """What a drive suffers from, and how the filter copes."""

    findings: tuple[Finding, ...] = ()  # for people
    gaps: tuple[DataGap, ...] = ()  # stretches that were bridged
    restarts: tuple[Restart, ...] = ()  # in order of time
    # (k,): times of GNSS epochs that are left out, on the axis of GNSS, s
    wrong_fixes: FloatArray | None = None
    worse: tuple[WorseStretch, ...] = ()
    knocks: tuple[float, ...] = ()  # moments at which the IMU became another one, s
    no_down: bool = False  # vertical velocity is zero throughout, as one that was not measured

    @property
    def first_break(self) -> float:
        """Last moment before the first restart, s; infinite where there is none."""
        return self.restarts[0].begin if self.restarts else float("inf")

    def usable(self, gnss: GnssRecording) -> GnssRecording:
        """Return the epochs that may be used, with what they can be believed to."""
        if self.wrong_fixes is not None and self.wrong_fixes.size:
            gnss = gnss.select(~np.isin(gnss.time, self.wrong_fixes))
        for part in self.worse:
            assert gnss.position_sd is not None
            inside = (gnss.time >= part.begin) & (gnss.time <= part.end)
            sd = np.where(inside[:, None], np.maximum(gnss.position_sd, part.sd), gnss.position_sd)
            gnss = replace(gnss, position_sd=sd)
        if self.no_down:
            assert gnss.velocity_sd is not None
            gnss = replace(gnss, velocity_sd=gnss.velocity_sd * [1.0, 1.0, np.inf])
        return gnss

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


BRIDGED_TURN = np.radians(10.0)
"""Standard deviation of a turn up to which it is bridged, rad."""
SHORTEST_SEGMENT = 5.0
"""Seconds; what is shorter between two breaks is left out."""


def knock_gap(moment: float, unsure: float) -> DataGap:
    """The stretch before a knock was noticed, after which the filter begins anew."""
    return DataGap(moment - unsure, moment, np.ones(6, dtype=bool), np.full(6, np.inf), True)


def split_at_gaps(
    imu: ImuRecording, gaps: Sequence[DataGap]
) -> tuple[list[ImuRecording], tuple[DataGap, ...]]:
    """Bridge what is short and cut where it is not."""
    last = float(imu.time[-1])
    short = tuple(u for u in gaps if u.attitude_sd <= BRIDGED_TURN and u.stop < last)
    # an axis that is stuck to the end cannot be bridged: nothing is known behind it
    long = [u for u in gaps if not any(u is s for s in short)]
    segments = []
    begin = float(imu.time[0])
    for part in long:
        segments.append(imu.between(begin, part.start + 1e-9))
        begin = part.stop
    if not long or long[-1].stop < last:
        segments.append(imu.between(begin, np.inf))
    kept = []
    for segment in segments:
        if segment.time.size > 1 and segment.duration >= SHORTEST_SEGMENT:
            inside = [u for u in short if segment.time[0] <= u.start and u.stop <= segment.time[-1]]
            kept.append(bridged(segment, inside))
    if not kept:
        raise NavigationError(
            "no stretch of the IMU is whole for five seconds",
            expected="a recording without so many gaps or stuck axes",
            where=imu.name,
        )
    if not long:
        kept[0] = replace(kept[0], history=(*imu.history, *kept[0].history[len(imu.history) + 1 :]))
    return kept, short


def align_segments(
    segments: Sequence[ImuRecording],
    align_one: Callable[[ImuRecording, bool], Alignment],
    condition: DriveCondition,
) -> tuple[ImuRecording, Alignment, DriveCondition]:
    """Align every segment; those that cannot be aligned are left out and said."""
    used: list[ImuRecording] = []
    restarts: list[Restart] = []
    findings = list(condition.findings)
    start: Alignment | None = None
    failure: NavigationError | None = None
    for k, segment in enumerate(segments):
        begin, end = float(segment.time[0]), float(segment.time[-1])
        try:
            found = align_one(segment, k == 0)
        except NavigationError as error:
            failure = failure or error
            if len(segments) > 1:
                findings.append(_left_out(begin, end, error))
            continue
        if start is None:
            start = found
        else:
            before = float(used[-1].time[-1])
            knocked = any(before < t <= begin for t in condition.knocks)
            restarts.append(Restart(before, begin, found, knocked))
            findings.append(_started_anew(begin, found, knocked=knocked))
        used.append(segment)
    if start is None:
        assert failure is not None
        raise failure
    done = replace(condition, findings=tuple(findings), restarts=tuple(restarts))
    return _joined(used), start, done


def _left_out(begin: float, end: float, error: NavigationError) -> Finding:
    return Finding(
        "left out",
        "warning",
        f"{begin:.3f} to {end:.3f} s cannot be navigated: {error.found}",
        (),
        ((begin, end),),
        end - begin,
        cure=error.cure,
    )


def _started_anew(begin: float, found: Alignment, *, knocked: bool) -> Finding:
    sensor = (
        "what it knew of the sensor is gone" if knocked else "what it knows of the sensor goes on"
    )
    return Finding(
        "new start",
        "info",
        f"the filter starts anew at {begin:.3f} s, {found.method}; heading within "
        f"{np.degrees(found.heading_sd):.1f} deg; {sensor}",
        (),
        ((begin, begin),),
    )


def _joined(segments: Sequence[ImuRecording]) -> ImuRecording:
    if len(segments) == 1:
        return segments[0]
    return replace(
        segments[0],
        time=np.concatenate([p.time for p in segments]),
        gyro=np.concatenate([p.gyro for p in segments]),
        accel=np.concatenate([p.accel for p in segments]),
        temperature=None,
    )
