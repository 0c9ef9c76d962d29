"""The batch filter: states and recordings in, stored runs out.

What a smoother needs of every node may outgrow memory on long runs with many measurements. A run
then keeps the filter's memory at a few samples only, and computes the nodes between two of them
once more when the smoother comes by; the numbers are the same to the last bit.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from itertools import pairwise
from typing import Unpack, cast

import numpy as np
from numpy.typing import NDArray

from schuler.data import ImuRecording
from schuler.errors import NavigationError
from schuler.kernels.navigation.filter_data import AidingOutputs, Filter, NodeOutputs, SampleOutputs
from schuler.kernels.navigation.filter_data import FilterState as KernelState
from schuler.navigation.aiding.schedule import GENERAL, AidingSchedule
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.stepping import (
    NO_VEHICLE,
    NODE_INTERVAL,
    FilterOptions,
    FilterStepper,
    InitialState,
    SensorStretches,
    VehicleStates,
    kernel_samples,
    kernel_schedule,
)
from schuler.types import FloatArray

__all__ = [
    "NO_VEHICLE",
    "SMOOTHER_MEMORY",
    "AidingOutputs",
    "FilterRun",
    "InitialState",
    "NodeOutputs",
    "NodeStretch",
    "SampleOutputs",
    "VehicleStates",
    "gate_thresholds",
    "run_engine",
]


# bytes that nodes and measurements may take for the smoother before they are computed twice
SMOOTHER_MEMORY = 5e8
# two measurements closer than this share a node (s); no checkpoint comes between them
ONE_NODE = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class NodeStretch:
    """Neighbouring nodes with all that the smoother needs."""

    # first, stop: numbers of the first node and of the one behind the last
    first: int
    stop: int
    nodes: NodeOutputs  # node number k in row k modulo the number of rows of each array
    aiding: AidingOutputs  # of the measurements, rows of H and gains likewise


@dataclass(frozen=True, slots=True, eq=False)
class Checkpoints:
    """A run that can be computed once more, part by part."""

    stepper: FilterStepper  # of the run; its state is overwritten.
    filter: Filter  # the one of the run, with all that it took
    start: tuple[int, ...]  # first sample of every part, and the number of samples
    nodes: tuple[int, ...]  # nodes made before every part, and in all
    # memories, counters: of the filter's state before every part
    memories: tuple[FloatArray, ...]
    counters: tuple[NDArray[np.int64], ...]
    stretches: SensorStretches | None = None  # where it changes how sensor errors show

    @property
    def bytes(self) -> int:
        """Bytes of the stored memories."""
        return int(
            sum(m.nbytes + c.nbytes for m, c in zip(self.memories, self.counters, strict=True))
        )

    def part(self, p: int, aiding: AidingOutputs) -> NodeStretch:
        """Compute the nodes of one part once more."""
        stepper, state = self.stepper, self.stepper.state
        state.memory[:], state.counters[:] = self.memories[p], self.counters[p]
        begin, end = self.start[p], self.start[p + 1]
        first, stop = self.nodes[p], self.nodes[p + 1]
        due = self.filter.schedule.rows["time"]
        begun = int(state.aided[0])
        ended = begun + int(np.sum(due[begun:] <= self.filter.samples.time[end - 1]))
        rows = max(stop - first, 1)
        nodes = NodeOutputs.empty(rows, rows, stepper.size, stepper.width)
        kept = AidingOutputs.empty(0, max(ended - begun, 1), stepper.size)
        again = replace(
            self.filter,
            outputs=SampleOutputs.empty(0),
            aiding=replace(aiding, row=kept.row, gain=kept.gain),
            nodes=nodes,
        )
        entered = entered_at(self.stretches, self.filter.samples.time)
        before = [sample for sample in entered if sample < begin]
        if before:
            _enter(self.stretches, entered[max(before)], again)
        for a, b in pairwise(sorted({begin, end, *(s for s in entered if begin <= s < end)})):
            _enter(self.stretches, entered.get(a), again)
            stepper.advance(again, a, b, due.size, p + 2 == len(self.start) and b == end)
        return NodeStretch(first, stop, nodes, again.aiding)


@dataclass(frozen=True, slots=True, eq=False)
class FilterRun:
    """Everything that one pass of the filter left behind."""

    samples: SampleOutputs  # state at every sample, if kept
    aiding: AidingOutputs  # at every measurement
    # at every node; without what the smoother needs where that is computed once more.
    nodes: NodeOutputs
    log_likelihood: float  # of the accepted measurements
    final: InitialState  # the state at the end
    checkpoints: Checkpoints | None = None  # where to compute nodes from once more
    # runs that this one was joined from (navigation/segments.py), each kept by itself for the
    # smoother; usually empty.
    pieces: tuple[FilterRun, ...] = ()
    # transition of the sensor states between one piece and the next; of the navigation states
    # nothing comes across.
    breaks: tuple[FloatArray, ...] = ()

    @property
    def smoother_bytes(self) -> int:
        """Bytes kept for the smoother."""
        if self.pieces:
            return sum(piece.smoother_bytes for piece in self.pieces)
        if self.checkpoints is not None:
            return self.checkpoints.bytes
        nodes, aiding = self.nodes, self.aiding
        kept = (nodes.covariance, nodes.top, nodes.transition, nodes.error, aiding.row, aiding.gain)
        return int(sum(a.nbytes for a in kept))

    @property
    def smoothable(self) -> bool:
        """Whether the run kept what the smoother needs."""
        if self.pieces:
            return all(piece.smoothable for piece in self.pieces)
        kept = self.nodes.covariance.size > 0 or self.checkpoints is not None
        return kept and self.samples.position.size > 0

    def stretches(self, *, back: bool = False) -> Iterator[NodeStretch]:
        """Yield all nodes with what the smoother needs, in stretches, or from the last back."""
        if self.checkpoints is None:
            yield NodeStretch(0, self.nodes.size, self.nodes, self.aiding)
            return
        parts = range(len(self.checkpoints.memories))
        for p in reversed(parts) if back else parts:
            yield self.checkpoints.part(p, self.aiding)


def node_bytes(size: int, width: int) -> int:
    """Bytes that one node keeps for the smoother."""
    return 8 * (size * size + 9 * size + (size - 9) * width + size + 2)


def measurement_bytes(size: int) -> int:
    """Bytes that one measurement keeps for the smoother: rows of H and gains."""
    return 8 * 6 * size


def gate_thresholds(false_alarm: float) -> FloatArray:
    """Largest accepted normalised innovation squared for 0 to 3 degrees of freedom.

    Parameters
    ----------
    false_alarm : float
        Probability of refusing a good measurement; 0 switches the gate off.

    Returns
    -------
    (4,) ndarray
        Chi-square quantiles; Bar-Shalom, Estimation with Applications to Tracking and
        Navigation, section 5.4.

    Examples
    --------
    >>> from schuler import gate_thresholds
    >>> [round(float(limit), 1) for limit in gate_thresholds(0.001)[:3]]
    [0.0, 10.8, 13.8]
    """
    from scipy.special import gammaincinv

    if false_alarm <= 0.0:
        return np.array([0.0, np.inf, np.inf, np.inf])
    half = np.array([0.5, 1.0, 1.5])
    return np.concatenate([[0.0], 2.0 * gammaincinv(half, 1.0 - false_alarm)])


class EngineOptions(FilterOptions, total=False):
    """Keywords of a run over a recording: noise and sensors that change, and what is kept."""

    white_scale: FloatArray | None
    keep_samples: bool
    keep_nodes: bool
    smoother_memory: float
    stretches: SensorStretches | None


def run_engine(
    imu: ImuRecording,
    initial: InitialState,
    model: SensorErrorModel,
    schedule: AidingSchedule,
    **how: Unpack[EngineOptions],
) -> FilterRun:
    """Run the filter over a recording."""
    keep_samples, keep_nodes = how.pop("keep_samples", True), how.pop("keep_nodes", True)
    white_scale, stretches = how.pop("white_scale", None), how.pop("stretches", None)
    smoother_memory = how.pop("smoother_memory", SMOOTHER_MEMORY)
    stepper = FilterStepper(initial, model, accumulating=keep_nodes, **cast("FilterOptions", how))
    node_interval = how.get("node_interval", NODE_INTERVAL)
    n, u, s = imu.size, schedule.size, stepper.size
    k = u + int(imu.duration / node_interval) + 3
    needed = k * node_bytes(s, stepper.width) + u * measurement_bytes(s)
    whole = keep_nodes and needed <= smoother_memory
    filter_ = stepper.filter(
        kernel_samples(imu, white_scale),
        kernel_schedule(schedule, model.size),
        SampleOutputs.empty(n if keep_samples else 0),
        AidingOutputs.empty(u, u if whole else 0, s),
        NodeOutputs.empty(k, k if whole else 0, s, stepper.width),
    )
    state, starts = stepper.state, [0, n]
    if keep_nodes and not whole:
        memory = state.memory.nbytes + state.counters.nbytes
        starts = _parts(imu.time, schedule.time, node_interval, needed, memory, smoother_memory)
    kept: list[tuple[int, FloatArray, NDArray[np.int64]]] = []
    asked, entered = asked_at(imu.time, schedule), entered_at(stretches, imu.time)
    for first, stop in pairwise(sorted({*starts, *asked, *entered})):
        _enter(stretches, entered.get(first), filter_)
        for row in asked.get(first, ()):
            fill_row(schedule, row, filter_)
        if keep_nodes and not whole and first in starts:
            kept.append((stepper.nodes_made, state.memory.copy(), state.counters.copy()))
        bad = stepper.advance(filter_, first, stop, u, stop == n)
        if bad >= 0:
            raise diverged(imu, bad)
    count = stepper.nodes_made
    position, velocity, rotation, sensor_state, covariance = stepper.copies()
    likelihood, nodes = stepper.log_likelihood, filter_.nodes
    checkpoints = None
    if kept:
        before, memories, counters = zip(*kept, strict=True)
        checkpoints = Checkpoints(
            stepper, filter_, tuple(starts), (*before, count), memories, counters, stretches
        )
    return FilterRun(
        samples=filter_.outputs,
        aiding=filter_.aiding,
        nodes=NodeOutputs(**{f.name: getattr(nodes, f.name)[:count] for f in fields(nodes)}),
        log_likelihood=likelihood,
        final=InitialState(position, velocity, rotation, sensor_state, covariance),
        checkpoints=checkpoints,
    )


def entered_at(stretches: SensorStretches | None, time: FloatArray) -> dict[int, int]:
    """Stretches by the sample that they begin with."""
    return {} if stretches is None else stretches.starts(time)


def _enter(stretches: SensorStretches | None, row: int | None, filter_: Filter) -> None:
    if stretches is not None and row is not None:
        stretches.enter(row, filter_)


def asked_at(time: FloatArray, schedule: AidingSchedule) -> dict[int, list[int]]:
    """Measurements of a user's own by the sample before which their models are asked."""
    rows = np.flatnonzero(schedule.kind == GENERAL)
    samples = np.searchsorted(time, schedule.time[rows], side="left")
    found: dict[int, list[int]] = {}
    for u, sample in zip(rows.tolist(), samples.tolist(), strict=True):
        # the first step takes two samples
        found.setdefault(sample if sample > 1 else 0, []).append(u)
    return found


def ask_model(schedule: AidingSchedule, u: int, state: KernelState) -> None:
    """Ask the model of a measurement where the filter is, and write its answer into row u."""
    row = schedule.general[int(schedule.matrix[u])]
    if row is not None:
        where = (state.position, state.velocity, state.rotation, state.sensor)
        row.fill(schedule, u, float(state.time[0]), where)


def fill_row(schedule: AidingSchedule, u: int, filter_: Filter) -> None:
    """Ask the model of a measurement, and tell a filter that takes the same schedule."""
    ask_model(schedule, u, filter_.state)
    told, place = filter_.schedule.rows, int(schedule.matrix[u])
    told["value"][u], told["variance"][u] = schedule.value[u], schedule.variance[u]
    told["lever"][u] = schedule.lever_arm[u]
    filter_.schedule.matrices[place] = schedule.matrices[place]


def diverged(imu: ImuRecording, sample: int) -> NavigationError:
    """Return what to raise where the state of a filter stopped being finite."""
    return NavigationError(
        f"the navigation state stopped being finite at {imu.time[sample]:.3f} s",
        expected="a bounded trajectory",
        cure="check units and axes of the IMU and the noise model",
        where=imu.name,
    )


def _parts(
    time: FloatArray,
    measured: FloatArray,
    node_interval: float,
    needed: float,
    memory: int,
    allowed: float,
) -> list[int]:
    """First samples of parts with about as many nodes each, and the number of samples.

    With p parts the checkpoints take p memories and the part at hand needed / p bytes: as few
    parts as fit, and never more than the number that makes their sum least.
    """
    least = np.sqrt(needed / memory)
    half = 0.25 * allowed**2 - needed * memory
    fits = (0.5 * allowed - np.sqrt(half)) / memory if half > 0.0 else least
    count = int(np.clip(np.ceil(fits), 1, max(time.size // 10, 1)))
    nodes = np.searchsorted(measured, time, side="right") + (time - time[0]) / node_interval
    wanted = nodes[-1] * np.arange(1, count) / count
    inner = np.searchsorted(nodes, wanted, side="right")
    # not where the next measurement might share the node of the last one
    ahead = np.searchsorted(measured, time[np.minimum(inner, time.size - 1) - 1], side="right")
    following = np.append(measured, np.inf)[ahead]
    clear = following - time[np.minimum(inner, time.size - 1) - 1] > ONE_NODE
    good = np.unique(inner[clear & (inner > 1) & (inner < time.size - 1)])
    return [0, *good.tolist(), time.size]
