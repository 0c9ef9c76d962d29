"""The clocks of several recordings: offset and rate of each, found from the motion they share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from schuler.arrays.calibration.rotation import align_rates
from schuler.arrays.clocks.coarse import first_offset
from schuler.arrays.clocks.delays import solve_seen
from schuler.arrays.clocks.resampling import rate_of_change, resample
from schuler.data import ImuRecording
from schuler.errors import EstimationError, InputError
from schuler.rotations import dcm_from_rotation_vector, skew
from schuler.types import FloatArray

WINDOW = 10.0
"""Seconds in which an offset is measured once."""
FASTEST = 1e-3
"""Largest rate error of a clock that is believed; a tenth of that is much for a quartz."""
ROUNDS = 6
"""Of shifting and measuring again within a window."""
TURNS = 3
"""Of measuring the windows and turning the axes by what all of them say together."""
SIDE = 3
"""Windows on each side of a jump that are compared."""
CLEAR = 0.6
"""Of a step: medians that differ by less are no jump."""
STEEPEST = 2.5
"""Steps by which the offset may move from one window to the next."""


@dataclass(frozen=True, slots=True)
class ClockFit:
    """The clock of one recording against that of the reference."""

    name: str  # of the recording
    epoch: float  # stamp of the recording for which the offset holds, s
    offset: float  # seconds to add to a stamp at the epoch to reach the reference's time
    # seconds that the clock gains each second against the reference (100 ppm: 1e-4)
    rate_error: float
    # offset_sd, rate_error_sd: standard deviations, from how the windows scatter
    offset_sd: float
    rate_error_sd: float
    correlation: float  # of the rate norms where the first offset was found
    jumps: tuple[tuple[float, int], ...]  # stamp from which samples are off by so many more steps
    windows: int  # windows that the fit rests on
    scatter: float  # standard deviation of the windows around the fit, s

    def to_reference(self, time: FloatArray, step: float = 0.0) -> FloatArray:
        """Return stamps of the recording on the reference's time."""
        moved = time + self.offset - self.rate_error * (time - self.epoch)
        for start, samples in self.jumps:
            moved = moved + np.where(time >= start, samples * step, 0.0)
        return np.asarray(moved)


def fit_clock(
    reference: ImuRecording, other: ImuRecording, *, window: float = WINDOW
) -> tuple[ClockFit, FloatArray]:
    """Estimate offset and rate of a recording's clock from the rates that both IMUs feel."""
    for one in (reference, other):
        if np.isnan(one.gyro).any():
            raise InputError(
                f"recording '{one.name}' lacks a gyro axis",
                expected="three axes of angular rate to compare clocks by",
            )
    start, middle, correlation = first_offset(reference, other)
    rotation = _rotation_at(reference, other, start, middle)
    slope = rate_of_change(reference.time, reference.gyro)
    for _ in range(TURNS):
        times, offsets, deviations = _march(
            reference, other, rotation, slope, start, middle + start, window
        )
        if times.size < 2:
            break
        rotation = _turned_on(reference, other, slope, rotation, times, offsets, window)
    if times.size < 2:
        raise EstimationError(
            f"the offset of '{other.name}' against '{reference.name}' can be measured in "
            f"{times.size} window of {window:g} s only",
            expected="lively motion in at least two",
            cure="record longer, or move more",
        )
    own = times - offsets
    line, steps = _line_and_steps(own, offsets, deviations, 1.0 / other.rate)
    clock = ClockFit(
        other.name, line.epoch, line.offset, -line.slope, line.offset_sd, line.slope_sd,
        correlation, steps, times.size, line.scatter,
    )  # fmt: skip
    return clock, rotation


def _rotation_at(
    reference: ImuRecording, other: ImuRecording, offset: float, middle: float
) -> FloatArray:
    """Rotation from the seconds around a stamp of the other, refined with the offset."""
    part = reference.between(middle + offset - 30.0, middle + offset + 30.0)
    near = other.between(part.time[0] - offset - 1.0, part.time[-1] - offset + 1.0)
    slope = rate_of_change(part.time, part.gyro)
    rotation = np.eye(3)
    for _ in range(3):
        turned = resample(near.time, near.gyro, part.time - offset).values
        rotation = align_rates(part.gyro, turned).rotation
        change = _step(part.time, part.gyro, slope, turned @ rotation.T)[0]
        if np.isfinite(change):
            offset += change
    return rotation


def _step(
    time: FloatArray, rates: FloatArray, slope: FloatArray, turned: FloatArray
) -> tuple[float, float]:
    """Return the correction of an offset and its standard deviation; NaN without motion."""
    own = rate_of_change(time, turned)
    good = np.isfinite(own).all(axis=1) & np.isfinite(slope).all(axis=1)
    if np.count_nonzero(good) < 20:
        return float("nan"), float("nan")
    s, o = slope[good], own[good]
    r = (turned - rates)[good]
    s, o, r = s - s.mean(axis=0), o - o.mean(axis=0), r - r.mean(axis=0)
    energy = float(np.sum(s * o))
    if energy <= 0.0:
        return float("nan"), float("nan")
    change = float(np.sum(s * r)) / energy
    score = np.sum(s * (r - change * o), axis=1)
    block = max(1, int(0.25 / float(np.median(np.diff(time)))))
    sums = np.add.reduceat(score, np.arange(0, score.size, block))
    return change, float(np.sqrt(np.sum(sums**2))) / energy


def _march(
    reference: ImuRecording,
    other: ImuRecording,
    rotation: FloatArray,
    slope: FloatArray,
    offset: float,
    middle: float,
    window: float,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Measure the offset in windows from the middle outward, each predicted by those before."""
    step = 1.0 / other.rate
    count_before = int((middle - reference.time[0]) // window) + 1
    count_after = int((reference.time[-1] - middle) // window) + 1
    found: dict[int, tuple[float, float, float]] = {}
    for direction, count in ((1, count_after), (-1, count_before)):
        nearest = min(found) if found else -1
        here = found[nearest][1] if found else offset
        recent = [found[nearest][:2]] if found else []
        for k in range(count):
            w = k if direction > 0 else -1 - k
            begin = middle + (w - 0.5) * window
            a, b = np.searchsorted(reference.time, [begin, begin + window])
            if b - a < 30:
                continue
            centre = begin + 0.5 * window
            predicted = _predict(recent, centre, here)
            value, deviation = _measure(
                reference.time[a:b], reference.gyro[a:b], slope[a:b], other, rotation, predicted
            )
            if not deviation < 0.25 * step or abs(value - predicted) > STEEPEST * step:
                continue
            found[w] = (centre, value, deviation)
            recent.append((centre, value))
            here = value
    rows = np.array([found[w] for w in sorted(found)]).reshape(-1, 3)
    return rows[:, 0], rows[:, 1], rows[:, 2]


def _predict(recent: list[tuple[float, float]], at: float, last: float) -> float:
    if len(recent) < 4:
        return last
    t, o = np.array(recent[-12:]).T
    slopes = np.diff(o) / np.diff(t)
    slope = float(np.clip(np.median(slopes), -FASTEST, FASTEST))
    return float(last + slope * (at - t[-1]))


def _measure(
    time: FloatArray,
    rates: FloatArray,
    slope: FloatArray,
    other: ImuRecording,
    rotation: FloatArray,
    offset: float,
) -> tuple[float, float]:
    a, b = np.searchsorted(other.time, [time[0] - offset - 1.0, time[-1] - offset + 1.0])
    if b - a < 20:
        return float("nan"), float("nan")
    stamps, values = other.time[a:b], other.gyro[a:b]
    deviation = float("nan")
    for _ in range(ROUNDS):
        turned = resample(stamps, values, time - offset).values @ rotation.T
        change, deviation = _step(time, rates, slope, turned)
        if not np.isfinite(change):
            return change, change
        offset += change
        if abs(change) < 0.01 * deviation:
            break
    return offset, deviation


def _turned_on(
    reference: ImuRecording,
    other: ImuRecording,
    slope: FloatArray,
    rotation: FloatArray,
    times: FloatArray,
    offsets: FloatArray,
    window: float,
) -> FloatArray:
    """Return the rotation of least squares, each window with an offset and biases of its own.

    A wrong rotation and a wrong offset can look alike (in curves w x dw/dt has one sign for
    long), so neither may be held while the other is sought.
    """
    normal, right = np.zeros((3, 3)), np.zeros(3)
    for centre, offset in zip(times, offsets, strict=True):
        a, b = np.searchsorted(reference.time, [centre - 0.5 * window, centre + 0.5 * window])
        c, d = np.searchsorted(
            other.time, [reference.time[a] - offset - 1.0, reference.time[b - 1] - offset + 1.0]
        )
        instants = reference.time[a:b] - offset
        turned = resample(other.time[c:d], other.gyro[c:d], instants).values @ rotation.T
        good = np.isfinite(turned).all(axis=1) & np.isfinite(slope[a:b]).all(axis=1)
        turned, s = turned[good], slope[a:b][good]
        residual = turned - reference.gyro[a:b][good]
        design = skew(turned)
        design, s = design - design.mean(axis=0), s - s.mean(axis=0)
        residual = residual - residual.mean(axis=0)
        shared = np.einsum("nij,ni->j", design, s)
        energy = float(np.sum(s**2))
        normal += np.einsum("nij,nik->jk", design, design) - np.outer(shared, shared) / energy
        right += np.einsum("nij,ni->j", design, residual) - shared * np.sum(s * residual) / energy
    small = solve_seen(normal, right[None])[0]
    return np.asarray(dcm_from_rotation_vector(small) @ rotation)


@dataclass(frozen=True, slots=True)
class _Line:
    epoch: float
    offset: float
    slope: float
    offset_sd: float
    slope_sd: float
    scatter: float


def _line_and_steps(
    time: FloatArray, offset: FloatArray, deviation: FloatArray, step: float
) -> tuple[_Line, tuple[tuple[float, int], ...]]:
    """Fit a line; whole steps between neighbouring windows are taken out as jumps first."""
    slope = float(np.clip(np.median(np.diff(offset) / np.diff(time)), -FASTEST, FASTEST))
    flat = offset - slope * time
    # the median of the windows on both sides of each boundary: one bad window is no jump
    rise = np.array(
        [np.median(flat[k : k + SIDE]) - np.median(flat[max(k - SIDE, 0) : k])
         for k in range(1, time.size)]
    )  # fmt: skip
    jumps: list[tuple[float, int]] = []
    level = np.zeros(time.size)
    for k in np.argsort(-np.abs(rise)):
        samples = round(float(rise[k]) / step)
        far = all(abs(float(k) - other) > SIDE for other, _ in jumps)
        inside = 2 <= k + 1 <= time.size - 2
        if samples == 0 or abs(rise[k]) < CLEAR * step or not (far and inside):
            continue
        jumps.append((float(k), samples))
        level[k + 1 :] += samples
    line = _line(time, offset - level * step, deviation)
    dated = tuple(
        (float(0.5 * (time[int(k)] + time[int(k) + 1])), samples) for k, samples in sorted(jumps)
    )
    return line, dated


def _line(time: FloatArray, offset: FloatArray, deviation: FloatArray) -> _Line:
    """Weighted least squares with Tukey's biweight; errors grow where windows scatter more."""
    # no window is believed to better than a third of the usual one
    sd = np.maximum(deviation, 0.3 * float(np.median(deviation)))
    weight = 1.0 / sd**2
    robust = np.ones(time.size)
    for _ in range(10):
        w = weight * robust
        epoch = float(w @ time / w.sum())
        design = np.column_stack([np.ones(time.size), time - epoch])
        covariance = np.linalg.inv(design.T @ (w[:, None] * design))
        value, slope = covariance @ (design.T @ (w * offset))
        residual = (offset - value - slope * (time - epoch)) / sd
        spread = max(1.4826 * float(np.median(np.abs(residual))), 1e-12)
        limit = 4.685 * max(spread, 1.0)
        robust = np.where(np.abs(residual) < limit, (1.0 - (residual / limit) ** 2) ** 2, 0.0)
    freedom = max(float(robust.sum()) - 2.0, 1.0)
    excess = max(1.0, float(np.sum(robust * residual**2)) / freedom)
    sds = np.sqrt(excess * np.diagonal(covariance))
    scatter = float(np.sqrt(np.sum(robust * (residual * sd) ** 2) / robust.sum()))
    return _Line(epoch, float(value), float(slope), float(sds[0]), float(sds[1]), scatter)


def check_recordings(recordings: Sequence[ImuRecording]) -> None:
    """Raise when there are fewer than two recordings to bring together."""
    if len(recordings) < 2:
        raise InputError(
            f"{len(recordings)} recording: there is no other clock to compare",
            expected="at least two recordings of one body",
            cure="name the files of the other IMUs too",
        )
