"""The innovations of a drive by other parameters, without filtering the drive again.

What a search moves (noise, shares of GNSS errors, time offsets, the lever arm) hardly moves the
trajectory. The drive is filtered once and linearised about that run: steps from fix to fix, with
what the white noise of each channel adds to them, and measurements with their derivatives. The
rest is a linear filter of one step a fix (kernels/navigation/linear_filter.py), for all thinnings
of GNSS together.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.earth import metres_per_radian
from schuler.kernels.navigation.linear_filter import (
    LinearRows,
    LinearSteps,
    join_steps,
    linear_innovations,
    white_noise_parts,
)
from schuler.navigation.engine import FilterRun
from schuler.navigation.innovation_likelihood import RUN, InnovationSequence
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.stepping import InitialState
from schuler.navigation.tuning.likelihood import filtered, innovations, judging_rows, noise_scale
from schuler.navigation.tuning.linear_rows import RowTable
from schuler.navigation.tuning.scoring import LONGEST_SEARCH, Maximum, maximise
from schuler.types import BoolArray, FloatArray, IntArray

LONGEST_STEP = 2.0
"""Seconds: the noise that drives sensor errors enters at both ends of a step."""


def linearisable(setup: RunSetup, gnss: GnssRecording) -> bool:
    """Whether sensor errors are single states, white noise that of channels, the run one piece."""
    model = setup.model
    single = not model.blocks and bool(np.all(model.partner < 0) and np.all(model.scaled_by < 0))
    apart = np.array_equal(model.white_correlation, np.tile(np.eye(3), (2, 1, 1)))
    return single and apart and setup.stretches is None and not setup.restarts(gnss)


@dataclass(frozen=True, slots=True, eq=False)
class StepParts:
    """Nodes of a run, and the parts of samples between them."""

    time: FloatArray  # (k,): of the nodes, s
    # before, after: (k, m) sensor states there before and after their measurements
    before: FloatArray
    after: FloatArray
    # node, sample: (n,) node that a part leads to, and sample that it belongs to
    node: IntArray
    sample: IntArray
    span: FloatArray  # (n,): s

    @classmethod
    def of(cls, imu: ImuRecording, run: FilterRun) -> StepParts:
        """Cut the time of a run at samples and nodes."""
        nodes = run.nodes
        time = np.union1d(imu.time, nodes.time)
        time = time[(time >= nodes.time[0]) & (time <= nodes.time[-1])]
        return cls(
            nodes.time,
            nodes.sensor_state - nodes.error[:, 9:],
            nodes.sensor_state,
            np.searchsorted(nodes.time, time[1:] - 1e-9),
            np.searchsorted(imu.time, time[1:] - 1e-9).clip(0, imu.size - 1),
            np.diff(time),
        )

    def steps(self, imu: ImuRecording, run: FilterRun) -> LinearSteps:
        """Transitions from node to node, and what white noise adds to them."""
        steps = LinearSteps.zeros(self.time.size, 9 + self.after.shape[1])
        steps.top[:], steps.decay[:] = run.nodes.top, run.nodes.transition[:, :, 0]
        rotation = run.samples.rotation[self.sample]
        push = np.einsum("nij,nj->ni", rotation, imu.accel[self.sample]) * self.span[:, None]
        ahead = self.time[self.node] - self.time[0] - np.cumsum(self.span)
        once = np.cumsum(push, axis=0)
        twice = np.cumsum(push * (np.cumsum(self.span) - 0.5 * self.span)[:, None], axis=0)
        last = np.searchsorted(self.node, self.node, side="right") - 1
        force = np.empty((self.node.size, 2, 3))
        force[:, 0] = once[last] - once
        end = (self.time[self.node] - self.time[0])[:, None]
        force[:, 1] = end * force[:, 0] - (twice[last] - twice)
        white_noise_parts(self.node, self.span, ahead, rotation, force, steps.white)
        return steps

    def mean_scale(self, scale: FloatArray, edges: IntArray) -> FloatArray:
        """Mean over steps between nodes of what multiplies the densities of samples (n, 6)."""
        total = np.zeros((self.time.size, 6))
        first = np.searchsorted(self.node, np.arange(1, self.time.size))
        total[1:] = np.add.reduceat(
            np.take(scale, self.sample, axis=0) * self.span[:, None], first, axis=0
        )
        total = np.cumsum(total, axis=0)
        span = np.maximum(self.time[edges[1]] - self.time[edges[0]], 1e-9)
        return np.asarray((total[edges[1]] - total[edges[0]]) / span[:, None])


@dataclass(frozen=True, slots=True, eq=False)
class LinearDrive:
    """A drive about one run of the filter, GNSS thinned in several ways one behind the other.

    Parameters
    ----------
    imu, fixes, level
        As for `innovations`; `fixes` is all of GNSS.
    setup, initial
        Of the run, and its start.
    parts : StepParts
        Of the run.
    steps : LinearSteps
        Of all thinnings.
    edges : (2, k) ndarray of int
        Nodes of the run from which and to which they lead.
    table : RowTable
        Measurements of all thinnings.
    judges, keys : (q,) ndarray of int
        Rows that judge, and their names.
    seen, grown : dict
        Design and residuals by the offsets and the arm that were asked for last; variance of the
        sensor errors by a unit of noise, for how long what lasts was said to last.
    """

    imu: ImuRecording
    fixes: GnssRecording
    level: FloatArray | None
    setup: RunSetup
    initial: InitialState
    parts: StepParts
    steps: LinearSteps
    edges: IntArray
    table: RowTable
    judges: IntArray
    keys: IntArray
    seen: dict[tuple[object, ...], tuple[FloatArray, FloatArray]] = field(default_factory=dict)
    grown: dict[bytes, FloatArray] = field(default_factory=dict)

    @classmethod
    def about(
        cls,
        imu: ImuRecording,
        gnss: Sequence[GnssRecording],
        setup: RunSetup,
        level: FloatArray | None = None,
    ) -> LinearDrive:
        """Filter a drive with the first of `gnss`, and linearise it for all of them."""
        fixes = gnss[0]
        scale = noise_scale(imu, setup, level)
        schedule, run = filtered(imu, fixes, setup, scale, first=fixes, nodes=LONGEST_STEP)
        parts = StepParts.of(imu, run)
        table = RowTable.of(imu, fixes, setup, schedule, run)
        edges, picked, used, stops, judges, keys = [], [], [], [], [], []
        total = 0
        for number, kept in enumerate(gnss):
            taken = table.taken(np.isin(fixes.time, kept.time))
            nodes = _nodes_kept(parts.time, table.node, taken)
            rows = np.flatnonzero(np.isin(table.node, nodes))
            own, key = judging_rows(schedule.select(taken), kept, setup.offsets, imu)
            judges.append(total + np.searchsorted(rows, np.flatnonzero(taken)[own]))
            keys.append(key + number * RUN // 3)
            edges.append(np.stack([np.append(0, nodes[:-1]), nodes]))
            stops.append(total + np.searchsorted(table.node[rows], nodes, side="right"))
            picked.append(rows)
            used.append(taken[rows])
            total += rows.size
        edge = np.concatenate(edges, axis=1)
        steps = LinearSteps.zeros(edge.shape[1], len(run.final.covariance))
        first, last = np.ascontiguousarray(edge[0]), np.ascontiguousarray(edge[1])
        join_steps(parts.steps(imu, run), first, last, run.nodes.error, steps)
        steps.stop[:] = np.concatenate(stops)
        steps.begins[:] = last == 0
        return cls(
            imu,
            fixes,
            level,
            setup,
            setup.initial_state(imu, fixes),
            parts,
            steps,
            edge,
            table.select(np.concatenate(picked), np.concatenate(used)),
            np.concatenate(judges),
            np.concatenate(keys),
        )

    def innovations(self, setup: RunSetup) -> InnovationSequence:
        """What `innovations` would find with another setup of the same kind."""
        scale = noise_scale(self.imu, setup, self.level)
        asked = (setup.offsets, *setup.lever_arm.tolist())
        if asked not in self.seen:
            self.seen.clear()
            self.seen[asked] = self.table.seen(self.setup, setup)
        design, residual, variance = self.table.weighted(setup, *self.seen[asked], scale)
        scalar = np.zeros((*residual.shape, 2))
        rows = LinearRows(design, variance, residual, self.table.correction, scalar)
        initial = setup.initial_state(self.imu, self.fixes)
        self._write_steps(setup, scale)
        linear_innovations(self.steps, rows, initial.covariance, self._begin(initial))
        pairs = scalar[self.judges]
        used = pairs[..., 1] > 0.0
        time = np.repeat(self.table.time[self.judges, None], 3, axis=1)[used]
        key = (3 * self.keys[:, None] + np.arange(3))[used]
        return InnovationSequence(pairs[used, 0], pairs[used, 1], time, key)

    def _write_steps(self, setup: RunSetup, scale: FloatArray | None) -> None:
        """Noise of the setup, and how long what lasts of GNSS lasts by it."""
        model, steps, parts, (first, last) = setup.model, self.steps, self.parts, self.edges
        mean = 1.0 if scale is None else parts.mean_scale(scale, self.edges)
        steps.weight[:] = model.white_density**2 * mean
        rate = model.drift[:, 0]
        if rate.tobytes() not in self.grown:
            span = (parts.time[last] - parts.time[first])[:, None]
            lasting = rate == 0.0
            exponent = span * np.where(lasting, -1.0, rate)
            steps.decay[:] = np.where(lasting, 1.0, np.exp(exponent))
            grown = np.expm1(2.0 * exponent) / np.where(lasting, -2.0, 2.0 * rate)
            # the run moved its sensor states by its own model
            steps.shift[:, 9:] = parts.before[last] - steps.decay * parts.after[first]
            self.grown.clear()
            self.grown[rate.tobytes()] = np.where(lasting, span, grown)
        steps.noise[:] = model.diffusion[:, 0] * self.grown[rate.tobytes()]

    def _begin(self, initial: InitialState) -> FloatArray:
        """Error of the run's start, by another start."""
        north, east = metres_per_radian(self.initial.position)
        away = (self.initial.position - initial.position) * np.array([north, east, -1.0])
        moved = self.initial.velocity - initial.velocity
        sensors = initial.sensor_state - self.initial.sensor_state
        return np.concatenate([away, moved, np.zeros(3), sensors])


def _nodes_kept(time: FloatArray, node: IntArray, taken: BoolArray) -> IntArray:
    """Nodes at which a thinned drive measures, and others where its steps would be too long."""
    cell = np.floor((time - time[0]) / LONGEST_STEP)
    kept = np.append(True, np.diff(cell) > 0.0)
    kept[node[taken]] = True
    return np.flatnonzero(kept)


HOLDS = 0.5
"""By how much the gain of a search may differ from the filter's where the linear drive holds."""


def _all(found: InnovationSequence) -> InnovationSequence:
    return found


@dataclass(frozen=True, slots=True, eq=False)
class DriveLikelihood:
    """Innovations of a drive as a function of parameters.

    Parameters
    ----------
    imu, gnss
        As for `innovations`.
    setup_at : callable
        The setup at some parameters.
    offsets : (p,) ndarray of bool
        Which of them are time offsets: they move the ends of the linear steps.
    level : (n, 6) ndarray or None
        As for `innovations`.
    judged : callable
        Picks the innovations that judge.
    """

    imu: ImuRecording
    gnss: Sequence[GnssRecording]
    setup_at: Callable[[FloatArray], RunSetup]
    offsets: BoolArray
    level: FloatArray | None = None
    judged: Callable[[InnovationSequence], InnovationSequence] = _all

    def filtered(self, x: FloatArray) -> InnovationSequence:
        """By the filter itself."""
        return self.judged(innovations(self.imu, self.gnss, self.setup_at(x), self.level))

    def about(self, x: FloatArray) -> Callable[[FloatArray], InnovationSequence]:
        """Linearised about some parameters, where that can be."""
        setup = self.setup_at(x)
        if not linearisable(setup, self.gnss[0]):
            return self.filtered
        drive = LinearDrive.about(self.imu, self.gnss, setup, self.level)
        return lambda y: self.judged(drive.innovations(self.setup_at(y)))

    def maximise(
        self, x: FloatArray, prior: FloatArray, floor: FloatArray, longest: int = LONGEST_SEARCH
    ) -> Maximum:
        """Search from some parameters; see `scoring.maximise`."""

        def value(found: InnovationSequence, at: FloatArray) -> float:
            return found.log_likelihood - 0.5 * float(at @ (prior * at))

        linear = self.about(x)
        found = maximise(linear, x, prior, floor, longest)
        # the whole of GNSS is what the drive was linearised with
        first = value((linear if len(self.gnss) == 1 else self.filtered)(x), x)
        best = value(self.filtered(found.x), found.x)
        if abs(best - first - found.gain) < HOLDS:
            return replace(found, log_likelihood=best, gain=best - first)
        begin = found.x if best > first else x
        found = maximise(self.filtered, begin, prior, floor, longest, self.about, self.offsets)
        return replace(found, gain=found.log_likelihood - first)
