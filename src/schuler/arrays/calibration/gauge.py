"""The gauge of an array: its axes are the mean of what its IMUs say, never those of the first.

Differences between sensors do not see what all have in common. A common turn, scale or offset is
therefore a choice, and the choice is that the deviations average to zero over the IMUs.
"""

from __future__ import annotations

import numpy as np

from schuler.arrays.calibration.rotation import align_rates
from schuler.rotations import dcm_from_rotation_vector, rotation_vector_from_dcm
from schuler.types import FloatArray

FAR = np.radians(20.0)
"""A declared mounting that rates contradict by more than this is not believed."""
SNAP = np.radians(15.0)
"""A turn this close to quarter turns is taken as quarter turns that are a little off."""
THINNED = 20_000
"""Rows that are enough to find how IMUs are mounted."""


def start_rotations(rates: FloatArray, declared: FloatArray) -> FloatArray:
    """Return how the IMUs are mounted, roughly."""
    thin = max(1, rates.shape[0] // THINNED)
    speed = np.nan_to_num(np.linalg.norm(rates, axis=2)).mean(axis=1)
    chosen = np.argsort(-speed)[: max(rates.shape[0] // thin, 10)]
    sample = rates[np.sort(chosen)]
    result = np.array(declared, copy=True)
    agree = True
    for i in range(1, rates.shape[1]):
        found = align_rates(sample[:, 0] @ declared[0].T, sample[:, i])
        turn = rotation_vector_from_dcm(found.rotation @ declared[i].T)
        # a turn about an axis that is not seen contradicts nothing
        for axis in found.unseen:
            turn = turn - (turn @ axis) * axis
        agree &= bool(np.linalg.norm(turn) < FAR)
        result[i] = found.rotation if not found.unseen.size else declared[i]
    if agree:
        return declared
    return np.array([_snapped(c @ declared[0].T) @ declared[0] for c in result])


def _snapped(rotation: FloatArray) -> FloatArray:
    quarter = np.zeros((3, 3))
    largest = np.abs(rotation).argmax(axis=1)
    quarter[np.arange(3), largest] = np.sign(rotation[np.arange(3), largest])
    if np.unique(largest).size < 3 or np.linalg.det(quarter) < 0.0:
        return rotation
    off = np.linalg.norm(rotation_vector_from_dcm(rotation @ quarter.T))
    return quarter if off < SNAP else rotation


def to_mean(rotations: FloatArray, start: FloatArray) -> FloatArray:
    """Turn all rotations alike, so that they average to those of the start."""
    small = rotation_vector_from_dcm(rotations @ np.swapaxes(start, 1, 2))
    return np.asarray(dcm_from_rotation_vector(-small.mean(axis=0)) @ rotations)
