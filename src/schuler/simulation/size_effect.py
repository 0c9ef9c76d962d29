"""Accelerometers away from the centre of the body feel its rotation (size effect, spec 1.4)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from schuler.data import ImuRecording
from schuler.errors import InputError
from schuler.rotations import skew
from schuler.simulation.motions.profile import Profile
from schuler.types import FloatArray

NODES = 4
"""Gauss-Legendre nodes in each sampling interval."""
CHUNK = 4096
"""Sampling intervals worked on at a time."""


def arm_tensor(profile: Profile, time: ArrayLike) -> FloatArray:
    """Return what turns a lever arm into the specific force that rotation adds at its end."""
    stamps = np.asarray(time, dtype=np.float64)
    if stamps.ndim != 1 or stamps.size < 2:
        raise InputError(f"stamps of shape {stamps.shape}", expected="two or more in a row")
    dt = (stamps[-1] - stamps[0]) / (stamps.size - 1)
    edges = np.concatenate([[stamps[0] - dt], stamps])
    node, weight = np.polynomial.legendre.leggauss(NODES)
    tensor = np.empty((stamps.size, 3, 3))
    for first in range(0, stamps.size, CHUNK):
        ends = edges[first : first + CHUNK + 1]
        step = np.diff(ends)
        at_ends, _ = profile.rates(ends)
        angular_acceleration = np.diff(at_ends, axis=0) / step[:, None]
        instants = ends[:-1, None] + step[:, None] * 0.5 * (1.0 + node)
        w = profile.rates(instants.ravel())[0].reshape(step.size, NODES, 3)
        # [w x][w x] = w w' - |w|² I
        outer = np.einsum("k,nki,nkj->nij", 0.5 * weight, w, w)
        centripetal = outer - np.trace(outer, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        tensor[first : first + step.size] = skew(angular_acceleration) + centripetal
    return tensor


def add_size_effect(ideal: ImuRecording, tensor: FloatArray, position: ArrayLike) -> ImuRecording:
    """Return what accelerometers record that sit away from the centre."""
    arm = np.asarray(position, dtype=np.float64)
    if arm.shape not in ((3,), (3, 3)) or tensor.shape != (ideal.size, 3, 3):
        raise InputError(
            f"positions of shape {arm.shape} and a tensor of shape {tensor.shape}",
            expected=f"(3,) or (3, 3), and ({ideal.size}, 3, 3)",
        )
    rows = np.broadcast_to(arm, (3, 3))
    added = np.einsum("nij,ij->ni", tensor, rows)
    return replace(ideal, accel=ideal.accel + added, history=(*ideal.history, "size effect added"))
