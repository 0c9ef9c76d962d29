"""Variances of all sensors of an array through time: who counts how much, and who is out.

A fault is a sensor with infinite variance, and noise that changes is a finite one. Every row of
the table has its own fusion, with the directions in which sensor states show, the fused white
noise and the axes of the parity; the kernel of the filter takes stretches and does not change.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from schuler.data import Mounting
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.mechanizations.array_model import (
    Fusion,
    body_directions,
    fused_white,
    fusion_of,
    left_inverse,
    white_variances,
)
from schuler.navigation.preparation.setup import NoiseFactors
from schuler.navigation.stepping import SensorStretches
from schuler.types import BoolArray, FloatArray


@dataclass(frozen=True, slots=True)
class Absence:
    """A stretch of time without some sensors."""

    kind: int  # 0 accelerometers, 1 gyros
    axes: tuple[int, ...]  # columns of the fusion
    # start, stop: s; not used from `start` on, used again from `stop` on.
    start: float
    stop: float


@dataclass(frozen=True, slots=True, eq=False)
class SensorTable:
    """Squared white-noise densities of all sensors, constant in pieces."""

    # (b,): of the first sample of every row, s; the first is that of the recording.
    time: FloatArray
    variance: FloatArray  # (b, 2, 3 k): accelerometers and gyros; infinite where a sensor is out.
    # of every row; all about the centre of the first, so that nothing jumps.
    fusions: tuple[Fusion, ...]

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.time.size

    @property
    def out(self) -> BoolArray:
        """Which sensors are out, (b, 2, 3 k)."""
        return np.isinf(self.variance)

    @property
    def units_out(self) -> BoolArray:
        """IMUs of which some sensor is out, (b, k)."""
        return np.asarray(self.out.reshape(self.rows, 2, -1, 3).any(axis=(1, 3)))

    @property
    def constant(self) -> bool:
        """Whether nothing changes."""
        return self.rows == 1

    @property
    def set_changes(self) -> FloatArray:
        """When sensors come or go, s."""
        out = self.out
        changed = np.any(out[1:] != out[:-1], axis=(1, 2))
        return self.time[1:][changed]

    def row_at(self, time: FloatArray) -> np.ndarray:
        """Row that holds at some times."""
        row = np.searchsorted(self.time, np.asarray(time) + 1e-9, side="right") - 1
        return np.asarray(np.maximum(row, 0))

    def pieces(self, time: FloatArray) -> Iterator[tuple[slice, int]]:
        """Samples of every row that they see."""
        edges = np.searchsorted(time, self.time - 1e-9)
        edges[0] = 0
        for row, (a, b) in enumerate(pairwise([*edges.tolist(), time.size])):
            if b > a:
                yield slice(a, b), row

    def stretches(
        self, models: Sequence[SensorErrorModel], factors: NoiseFactors
    ) -> SensorStretches:
        """Return how the states of all sensors show, and the fused white noise, in every row."""
        scale = factors.white.reshape(2, 3)
        spread = scale[:, :, None] * scale[:, None, :]
        shown = [
            np.concatenate([body_directions(m, fusion, i) for i, m in enumerate(models)])
            for fusion in self.fusions
        ]
        white = [
            spread * fused_white(fusion, own)
            for fusion, own in zip(self.fusions, self.variance, strict=True)
        ]
        return SensorStretches(self.time, np.stack(shown), np.stack(white))


def sensor_table(
    time: FloatArray,
    mounting: Mounting,
    models: Sequence[SensorErrorModel],
    absences: Sequence[Absence] = (),
    noise: tuple[FloatArray, FloatArray] | None = None,
) -> SensorTable:
    """Join what is out and how noise changes; `noise` is time (q,) and variances (q, 2, 3 k).

    A row in which the sensors that are left do not measure every direction keeps all of its kind.
    """
    centre = fusion_of(mounting, models)
    edges = {float(time[0])}
    edges |= {t for a in absences for t in (a.start, a.stop) if time[0] < t < time[-1]}
    if noise is not None:
        edges |= {float(t) for t in noise[0] if time[0] < t < time[-1]}
    stamps = np.unique(time[np.searchsorted(time, sorted(edges))])
    if noise is None:
        variance = np.repeat(white_variances(models)[None], stamps.size, axis=0)
    else:
        row = np.maximum(np.searchsorted(noise[0], stamps + 1e-9, side="right") - 1, 0)
        variance = noise[1][row].copy()
    for a in absences:
        rows = (stamps >= a.start - 1e-9) & (stamps < a.stop - 1e-9)
        before = variance[rows, a.kind].copy()
        variance[np.ix_(np.flatnonzero(rows), np.array([a.kind]), np.array(a.axes))] = np.inf
        for place, was in zip(np.flatnonzero(rows), before, strict=True):
            if not spans(centre.axes[np.isfinite(variance[place, a.kind])]):
                variance[place, a.kind] = was
    fusions = tuple(
        replace(
            centre, accel=left_inverse(centre.axes, own[0]), gyro=left_inverse(centre.axes, own[1])
        )
        for own in variance
    )
    return SensorTable(stamps, variance, fusions)


def spans(axes: FloatArray) -> bool:
    """Whether axes measure every direction, none of them by a hair only."""
    return len(axes) >= 3 and float(np.linalg.svd(axes, compute_uv=False)[2]) > 0.3
