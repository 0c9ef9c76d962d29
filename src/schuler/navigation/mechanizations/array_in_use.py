"""How the sensors of an array that are in use are fused, and what they say of one another."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from schuler.arrays.lever_arms import arm_coefficients
from schuler.navigation.aiding.parity import Parity, axis_rows
from schuler.navigation.mechanizations.array_preparation import PreparedArray
from schuler.navigation.mechanizations.sensor_table import Absence, sensor_table, spans
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.stepping import SensorStretches
from schuler.navigation.stream.buffers import LinearRows
from schuler.types import BoolArray, FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class ArrayInUse:
    """A fusion without some sensors."""

    out: BoolArray  # (2, 3 k): accelerometers and gyros that are not used
    pi: FloatArray  # (2, 3, 3 k): of both
    # (9, 3): what rotation adds to the fused force; zero where the middle of those in use stays.
    moment: FloatArray
    stretch: SensorStretches  # how sensor errors show
    # (3 p, 2 x 3 k): what is measured of the means of all sensors, whitened for one second
    seen: FloatArray
    matrix: FloatArray  # (p, 3, 12 + m): how sensor states show in it

    def parity(self, time: float, mean: FloatArray, seconds: float) -> LinearRows:
        """What the means (2, 3 k) over some seconds say the sensors differ by."""
        there = self.seen.any(axis=1)
        value = self.seen @ mean.ravel()
        variance = np.where(there, 1.0 / seconds, np.inf)
        return LinearRows(time, value.reshape(-1, 3), variance.reshape(-1, 3), self.matrix)


@dataclass(slots=True, eq=False)
class FusionsInUse:
    """The fusions that a stream came to use; sensors come and go, mostly the same."""

    prepared: PreparedArray
    setup: RunSetup
    _known: dict[bytes, ArrayInUse] = field(default_factory=dict)

    def without(self, out: BoolArray, silent: BoolArray) -> ArrayInUse:
        """Fuse without faulty (2, 3 k) and silent (k,) sensors.

        Where those that are left do not measure every direction, faulty ones are used as well.
        """
        mute, axes = np.repeat(silent, 3), self.prepared.fusion.axes
        left_out = np.stack([own | mute if spans(axes[~(own | mute)]) else mute for own in out])
        key = left_out.tobytes()
        if key not in self._known:
            self._known[key] = self._made(left_out)
        return self._known[key]

    def _made(self, out: BoolArray) -> ArrayInUse:
        ready, states = self.prepared, self.setup.model.size
        absences = [
            Absence(kind, tuple(np.flatnonzero(out[kind]).tolist()), -np.inf, np.inf)
            for kind in (0, 1)
            if out[kind].any()
        ]
        mounting = ready.array.mounting
        table = sensor_table(np.array([-1e300, 1e300]), mounting, ready.models, absences)
        fusion = table.fusions[0]
        arms = np.repeat(mounting.position - ready.fusion.centre, 3, axis=0)
        moment = arm_coefficients(ready.fusion.axes, arms) @ fusion.accel.T
        parity = Parity(ready.array, table, ready.models, states)
        wide = out.shape[1]
        seen, matrices = [np.zeros((0, 2 * wide))], [np.zeros((0, 12 + states))]
        for kind in (0, 1):
            shown = axis_rows(ready.models, kind, states)
            found = parity.measured(kind, 0, np.eye(wide), shown)
            if found is None:
                continue
            columns, matrix, noise = found
            whiten = np.linalg.inv(np.linalg.cholesky(noise))
            padded = -(-len(whiten) // 3) * 3
            rows, states_seen = np.zeros((padded, 2 * wide)), np.zeros((padded, 12 + states))
            rows[: len(whiten), kind * wide : (kind + 1) * wide] = whiten @ columns.T
            states_seen[: len(whiten), 12:] = whiten @ matrix
            seen.append(rows)
            matrices.append(states_seen)
        return ArrayInUse(
            out,
            np.ascontiguousarray(np.stack([fusion.accel, fusion.gyro])),
            np.where(np.abs(moment) > 1e-12, moment, 0.0),
            table.stretches(ready.models, self.setup.factors),
            np.concatenate(seen),
            np.concatenate(matrices).reshape(-1, 3, 12 + states),
        )
