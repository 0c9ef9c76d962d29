"""An array made ready for a filter: every sensor at every sample, and the fused recording."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from schuler.arrays.lever_arms import turning_tensor
from schuler.arrays.redundant import refuse_copies
from schuler.data import ImuRecording
from schuler.data.array import ImuArray
from schuler.errors import InputError
from schuler.navigation.mechanizations.sensor_table import SensorTable
from schuler.types import BoolArray, FloatArray

LONGEST_GAP = 1.0
"""A sensor that is silent for longer (s) is not used until it is back."""
LARGEST_LOSS = 0.2
"""One that lacks more than this share of its samples in short gaps is left out altogether."""


@dataclass(frozen=True, slots=True, eq=False)
class CompleteArray:
    """An array with a value for every sensor at every sample."""

    array: ImuArray  # with gaps filled
    # when an IMU is silent for so long that it must not count, s
    silences: tuple[tuple[int, float, float], ...]
    notes: tuple[str, ...]  # what was done, in words


def complete_array(array: ImuArray) -> CompleteArray:
    """Fill the gaps of IMUs, and say where they are too long to be filled.

    A missing value is what the other sensors say of it, plus the difference to them that was seen
    around the gap: it brings no news, and the bias that a filter has found stays as it is.
    """
    if array.count < 2:
        raise InputError(
            f"an array of one IMU ({array.names[0]})",
            expected="at least two IMUs",
            cure="navigate with this IMU alone: schuler navigate --imu FILE",
        )
    notes = []
    keep = np.ones(array.count, dtype=bool)
    values = np.concatenate([array.gyro, array.accel], axis=2)
    missing = np.isnan(values).any(axis=2)
    for i, name in enumerate(array.names):
        spans = _silences(array.time, missing[:, i])
        silent = sum(int(np.diff(np.searchsorted(array.time, span))[0]) for span in spans)
        reason = _why_left_out(missing[:, i], silent)
        if reason:
            keep[i] = False
            notes.append(f"{name} {reason}: left out")
    if keep.sum() < 2:
        raise InputError(
            f"{int(keep.sum())} of {array.count} IMUs lasted through the recording "
            f"({'; '.join(notes)})",
            expected="at least two",
            cure="cut the recording to where they are there",
        )
    kept = array if keep.all() else array.select(keep)
    refuse_copies(kept)
    missing = missing[:, keep]
    silences = tuple(
        (i, *span) for i in range(kept.count) for span in _silences(array.time, missing[:, i])
    )
    filled, count = _fill(kept, missing), int(missing.sum())
    for i, start, stop in silences:
        notes.append(f"{kept.names[i]} is silent from {start:.2f} to {stop:.2f} s: not used then")
        count -= int(np.diff(np.searchsorted(array.time, [start, stop]))[0])
    if count:
        notes.append(f"{count} missing samples filled by what the other IMUs said")
    return CompleteArray(filled, silences, tuple(notes))


def _why_left_out(missing: BoolArray, silent: int) -> str:
    if np.count_nonzero(~missing) < 2:
        return "has no whole sample"
    share = (np.count_nonzero(missing) - silent) / max(missing.size - silent, 1)
    return f"lacks {100.0 * share:.0f} % of its samples" if share > LARGEST_LOSS else ""


def _silences(time: FloatArray, missing: BoolArray) -> list[tuple[float, float]]:
    """From the first missing sample to the first that is there again, of the long gaps."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], missing, [False]]).astype(int)))
    spans = []
    for a, b in edges.reshape(-1, 2):
        stop = float(time[b]) if b < time.size else float(np.nextafter(time[-1], np.inf))
        if stop - time[a] > LONGEST_GAP:
            spans.append((float(time[a]), stop))
    return spans


def filled_array(array: ImuArray, table: SensorTable) -> ImuArray:
    """Return an array in which IMUs of which a sensor is out show what the others say."""
    if not table.out.any():
        return array
    return _fill(array, table.units_out[table.row_at(array.time)])


def _fill(array: ImuArray, gaps: BoolArray) -> ImuArray:
    """Give IMUs values where they have a gap, (n, k)."""
    if not gaps.any():
        return array
    if gaps.all(axis=1).any():
        row = int(np.argmax(gaps.all(axis=1)))
        raise InputError(
            f"at {array.time[row]:.3f} s no IMU has a whole sample",
            expected="at least one at every stamp",
            cure="drop the stamps at which all are missing",
        )
    filled = []
    rotation = array.mounting.rotation
    for values in (array.gyro, array.accel):
        body = np.einsum("kij,nkj->nki", rotation, values)
        body[gaps] = np.nan
        with np.errstate(invalid="ignore"):
            mean = np.nanmean(body, axis=1)
        out = body.copy()
        for i in range(array.count):
            gone = gaps[:, i]
            if not gone.any():
                continue
            difference = body[:, i] - mean
            # a level around the gap, not the noise of its last sample
            width = max(round(0.5 * array.rate), 1)
            whole = np.flatnonzero(~gone)
            if not whole.size:
                out[:, i] = mean
                continue
            total = np.concatenate([np.zeros((1, 3)), np.cumsum(difference[whole], axis=0)])
            lower = np.maximum(np.arange(whole.size) - width, 0)
            upper = np.minimum(np.arange(whole.size) + width + 1, whole.size)
            level = (total[upper] - total[lower]) / (upper - lower)[:, None]
            for axis in range(3):
                out[gone, i, axis] = mean[gone, axis] + np.interp(
                    array.time[gone], array.time[whole], level[:, axis]
                )
        filled.append(np.einsum("kji,nkj->nki", rotation, out))
    whole_gyro = np.where(gaps[:, :, None], filled[0], array.gyro)
    whole_accel = np.where(gaps[:, :, None], filled[1], array.accel)
    return replace(array, gyro=whole_gyro, accel=whole_accel)


def fused_recording(array: ImuArray, table: SensorTable) -> ImuRecording:
    """Return the IMU that the array makes in the body frame. Spec 6.2, S002 (6)."""
    n = array.size
    return ImuRecording(
        time=array.time,
        gyro=fused(array.gyro.reshape(n, -1), table, 1, array),
        accel=fused(array.accel.reshape(n, -1) - arm_forces(array, table), table, 0, array),
        name=" + ".join(array.names) if array.count < 5 else f"{array.count} IMUs",
        history=(*array.history, f"{array.count} IMUs fused by least squares"),
    )


def fused(values: FloatArray, table: SensorTable, kind: int, array: ImuArray) -> FloatArray:
    """Return pi of what all axes of one kind show, row by row of the table."""
    out = np.empty((array.size, 3))
    for part, row in table.pieces(array.time):
        out[part] = values[part] @ table.fusions[row].of(3 * kind).T
    return out


def arm_forces(array: ImuArray, table: SensorTable) -> FloatArray:
    """What rotation adds to each accelerometer, in its own axes. Spec 1.4."""
    arms = array.mounting.position - table.fusions[0].centre
    if np.abs(arms).max() < 1e-12:
        return np.zeros((array.size, 3 * array.count))
    gyro = fused(array.gyro.reshape(array.size, -1), table, 1, array)
    tensor = turning_tensor(array.time, gyro, causal=False).reshape(-1, 3, 3)
    body = np.einsum("nbc,kc->nkb", tensor, arms)
    own = np.einsum("kba,nkb->nka", array.mounting.rotation, body)
    return np.asarray(own.reshape(array.size, -1))


def bias_jumps(array: ImuArray, table: SensorTable) -> FloatArray:
    """What the fused bias changes by from row to row, against the first, (b, 6).

    Of the mean differences between the sensors where most of them are in use. A filter with one
    bias for the fused IMU, as in the preparation, must not see them.
    """
    jumps = np.zeros((table.rows, 6))
    if table.constant:
        return jumps
    used = ~table.out
    most = int(np.argmax(used.sum(axis=(1, 2))))
    alike = np.flatnonzero((used == used[most]).all(axis=(1, 2)))
    rows = np.isin(table.row_at(array.time), alike)
    values = (array.accel.reshape(array.size, -1) - arm_forces(array, table), array.gyro)
    for kind, seen in enumerate(values):
        mean = seen.reshape(array.size, -1)[rows].mean(axis=0)
        reference = table.fusions[most]
        difference = mean - reference.axes @ (reference.of(3 * kind) @ mean)
        for row, fusion in enumerate(table.fusions):
            jumps[row, 3 * kind : 3 * kind + 3] = fusion.of(3 * kind) @ difference
    jumps -= jumps[0]
    return jumps
