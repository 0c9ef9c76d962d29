"""Fixed-lag smoothing: every sample sees measurements up to a given time after it. Spec 10.

For near real time: what a vehicle did five seconds ago is known much better than what it does
now. Every node is smoothed from the last node within its lag, by the same recursion as over the
whole interval (kernels/navigation/smoother.py).
"""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from schuler.errors import InputError, NavigationError
from schuler.kernels.navigation.filter_data import NodeOutputs, SampleOutputs
from schuler.navigation.engine import FilterRun, NodeStretch
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.smoother import SmoothedRun, corrected_samples
from schuler.types import FloatArray, IntArray


def lag_horizons(node_time: FloatArray, lag: float) -> IntArray:
    """Return for every node the last node whose measurements it may use."""
    return np.searchsorted(node_time, node_time + lag + 1e-9, side="right") - 1


@dataclass(frozen=True, slots=True, eq=False)
class LaggedNodes:
    """Neighbouring nodes smoothed each under its own horizon, with the node that follows each."""

    # (k,): False where the horizon is the node itself: nothing was smoothed
    moved: NDArray[np.bool_]
    # error, ahead: (k, s) error left in the filter's state at the node, and at the next one before
    # its correction
    error: FloatArray
    ahead: FloatArray
    # position, position_ahead: (k, 3, 3) covariances of position, m²
    position: FloatArray
    position_ahead: FloatArray
    # sd, sd_ahead: (k, s) standard deviations
    sd: FloatArray
    sd_ahead: FloatArray

    def corrected(self, samples: SampleOutputs, node: IntArray, share: FloatArray) -> SampleOutputs:
        """Correct samples that follow nodes."""
        w = share[:, None]
        w3 = w[:, :, None]
        error = self.error[node, :9] * (1.0 - w) + self.ahead[node, :9] * w
        position = self.position[node] * (1.0 - w3) + self.position_ahead[node] * w3
        sd = self.sd[node, :9] * (1.0 - w) + self.sd_ahead[node, :9] * w
        still = ~self.moved[node]
        error[still] = 0.0
        position[still] = samples.position_covariance[still]
        sd[still, 3:6], sd[still, 6:9] = samples.velocity_sd[still], samples.attitude_sd[still]
        return corrected_samples(samples, error, position, sd[:, 3:6], sd[:, 6:9])


def smooth_nodes_with_lag(
    stretch: NodeStretch,
    block: IntArray,
    first: int,
    horizon: IntArray,
) -> LaggedNodes:
    """Smooth nodes each under its own horizon."""
    from schuler.kernels.navigation.smoother import Adjoint, Smoothed, smooth_with_lag

    nodes, k = stretch.nodes, horizon.size
    s = nodes.covariance.shape[1]
    here, later = Smoothed.zeros(k, s), Smoothed.zeros(k, s)
    smooth_with_lag(horizon, first, nodes, stretch.aiding, block, Adjoint.zero(s), here, later)
    moved = horizon > first + np.arange(k)
    following = (first + 1 + np.flatnonzero(moved)) % len(nodes.error)
    ahead = later.error
    ahead[moved] += nodes.error[following]
    return LaggedNodes(
        moved=moved,
        error=here.error,
        ahead=ahead,
        position=here.position,
        position_ahead=later.position,
        sd=np.sqrt(here.variance),
        sd_ahead=np.sqrt(later.variance),
    )


def smooth_run_with_lag(
    run: FilterRun, model: SensorErrorModel, time: FloatArray, lag: float
) -> SmoothedRun:
    """Smooth a run with measurements up to `lag` seconds after each node."""
    if not lag > 0.0:
        raise InputError(f"a lag of {lag} s", expected="a positive number of seconds")
    if not run.smoothable:
        raise NavigationError("the run kept no nodes or samples", expected="a run kept whole")
    if run.pieces:
        return _piece_by_piece(run, model, time, lag)
    node_time = run.nodes.time
    horizon = lag_horizons(node_time, lag)
    block = model.layout().block
    parts: list[LaggedNodes] = []
    later: list[NodeStretch] = []
    for stretch in run.stretches(back=True):
        later = [stretch, *(s for s in later if s.first <= horizon[stretch.stop - 1])]
        own = horizon[stretch.first : stretch.stop]
        held = stretch if len(later) == 1 else _joined(later, int(own[-1]) + 1)
        parts.insert(0, smooth_nodes_with_lag(held, block, stretch.first, own))
    whole = LaggedNodes(
        *(np.concatenate([getattr(p, f) for p in parts]) for f in LaggedNodes.__dataclass_fields__)
    )
    count = node_time.size
    before = np.clip(np.searchsorted(node_time, time, side="right") - 1, 0, count - 1)
    span = np.append(np.diff(node_time), np.inf)[before]
    share = np.clip((time - node_time[before]) / span, 0.0, 1.0)
    return SmoothedRun(
        samples=whole.corrected(run.samples, before, share),
        sensor_state=run.nodes.sensor_state + whole.error[:, 9:],
        sensor_sd=whole.sd[:, 9:],
    )


def _piece_by_piece(
    run: FilterRun, model: SensorErrorModel, time: FloatArray, lag: float
) -> SmoothedRun:
    """Each piece of a run by itself: of navigation nothing comes across a restart."""
    edges = np.cumsum([0, *(len(p.samples.position) for p in run.pieces)])
    own = [
        smooth_run_with_lag(piece, model, time[a:b], lag)
        for piece, a, b in zip(run.pieces, edges[:-1], edges[1:], strict=True)
    ]
    return SmoothedRun(
        samples=SampleOutputs(
            *(
                np.concatenate([getattr(s.samples, f.name) for s in own])
                for f in fields(SampleOutputs)
            )
        ),
        sensor_state=np.concatenate([s.sensor_state for s in own]),
        sensor_sd=np.concatenate([s.sensor_sd for s in own]),
    )


def _joined(stretches: list[NodeStretch], stop: int) -> NodeStretch:
    """Stretches that follow each other in one, up to node stop - 1."""
    first = stretches[0].first
    count = stop - first
    numbers = [np.arange(s.first, min(s.stop, stop)) for s in stretches]

    def rows(field: str) -> FloatArray:
        parts = [getattr(s.nodes, field) for s in stretches]
        out = np.empty((count, *parts[0].shape[1:]), dtype=parts[0].dtype)
        for part, n in zip(parts, numbers, strict=True):
            out[n % count] = part[n % len(part)]
        return out

    aid: IntArray = rows("aid")  # type: ignore[assignment]
    low, high = int(aid[first % count, 0]), int(aid[(stop - 1) % count, 1])
    kept = max(high - low, 1)
    row, gain = np.zeros((2, kept, *stretches[0].aiding.row.shape[1:]))
    for s, n in zip(stretches, numbers, strict=True):
        used = np.arange(aid[n[0] % count, 0], aid[n[-1] % count, 1])
        rows_there = used % len(s.aiding.row)
        row[used % kept] = s.aiding.row[rows_there]
        gain[used % kept] = s.aiding.gain[rows_there]
    nodes = NodeOutputs(
        time=np.empty(0),
        sensor_state=np.empty((0, 0)),
        sensor_sd=np.empty((0, 0)),
        covariance=rows("covariance"),
        top=rows("top"),
        transition=rows("transition"),
        error=rows("error"),
        aid=aid,
    )
    return NodeStretch(first, stop, nodes, replace(stretches[0].aiding, row=row, gain=gain))
