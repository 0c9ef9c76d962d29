"""An array made ready for a filter: every sensor at every sample, and the fused recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from schuler.arrays.common_axes import require_common_axes
from schuler.arrays.lever_arms import turning_tensor
from schuler.arrays.redundant import refuse_copies
from schuler.data import ImuRecording
from schuler.data.array import ImuArray
from schuler.errors import InputError
from schuler.navigation.mechanizations.array_model import Fusion
from schuler.types import FloatArray

LONGEST_GAP = 1.0
"""A sensor that is silent for longer (s) is left out of the filter altogether."""
LARGEST_LOSS = 0.2
"""So is one that lacks more than this share of its samples."""


def complete_array(array: ImuArray) -> tuple[ImuArray, tuple[str, ...]]:
    """Leave out IMUs that fall silent and fill the short gaps of the others.

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
        reason = _why_left_out(array.time, missing[:, i])
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
    require_common_axes(kept)
    filled, count = _fill(kept)
    if count:
        notes.append(f"{count} missing samples filled by what the other IMUs said")
    return filled, tuple(notes)


def _why_left_out(time: FloatArray, missing: NDArray[np.bool_]) -> str:
    if not missing.any():
        return ""
    there = np.flatnonzero(~missing)
    if there.size < 2:
        return "has no whole sample"
    edges = np.concatenate([[time[0]], time[there], [time[-1]]])
    gap = np.diff(edges)
    worst = int(np.argmax(gap))
    if gap[worst] > LONGEST_GAP:
        return f"is silent from {edges[worst]:.2f} to {edges[worst + 1]:.2f} s"
    share = float(missing.mean())
    return f"lacks {100.0 * share:.0f} % of its samples" if share > LARGEST_LOSS else ""


def _fill(array: ImuArray) -> tuple[ImuArray, int]:
    gaps = np.isnan(np.concatenate([array.gyro, array.accel], axis=2)).any(axis=2)
    if not gaps.any():
        return array, 0
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
    return replace(array, gyro=whole_gyro, accel=whole_accel), int(gaps.sum())


def fused_recording(array: ImuArray, fusion: Fusion) -> ImuRecording:
    """Return the IMU that the array makes in the body frame. Spec 6.2, S002 (6)."""
    n = array.size
    gyro = array.gyro.reshape(n, -1) @ fusion.gyro.T
    accel = array.accel.reshape(n, -1) @ fusion.accel.T
    arms = array.mounting.position - fusion.centre
    # share of a force in the body that the fused one takes from each IMU
    share = np.stack(
        [fusion.accel[:, 3 * i : 3 * i + 3] @ fusion.axes[3 * i : 3 * i + 3]
         for i in range(array.count)]
    )  # fmt: skip
    first_moment = np.einsum("kab,kc->abc", share, arms)
    if np.abs(first_moment).max() > 1e-9:
        accel = accel - rotation_force(array.time, gyro, first_moment)
    return ImuRecording(
        time=array.time,
        gyro=gyro,
        accel=accel,
        name=" + ".join(array.names) if array.count < 5 else f"{array.count} IMUs",
        history=(*array.history, f"{array.count} IMUs fused by least squares"),
    )


def rotation_force(time: FloatArray, gyro: FloatArray, moment: FloatArray) -> FloatArray:
    """What rotation adds to the fused force: sum of W_i (w' x l_i + w x (w x l_i)). Spec 1.4."""
    tensor = turning_tensor(time, gyro, causal=False).reshape(-1, 3, 3)
    force: FloatArray = np.einsum("nbc,abc->na", tensor, moment)
    return force


def arm_forces(array: ImuArray, fusion: Fusion) -> FloatArray:
    """What rotation adds to each accelerometer, in its own axes. Spec 1.4."""
    arms = array.mounting.position - fusion.centre
    if not arms.any():
        return np.zeros((array.size, 3 * array.count))
    gyro = array.gyro.reshape(array.size, -1) @ fusion.gyro.T
    tensor = turning_tensor(array.time, gyro, causal=False).reshape(-1, 3, 3)
    body = np.einsum("nbc,kc->nkb", tensor, arms)
    own = np.einsum("kba,nkb->nka", array.mounting.rotation, body)
    return np.asarray(own.reshape(array.size, -1))
