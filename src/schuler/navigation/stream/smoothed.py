"""The state some seconds ago, with what the stream has brought since."""

from __future__ import annotations

from dataclasses import fields

import numpy as np

from schuler.kernels.navigation.filter_data import AidingOutputs, NodeOutputs, SampleOutputs
from schuler.navigation.engine import NodeStretch
from schuler.navigation.lagged import lag_horizons, smooth_nodes_with_lag
from schuler.navigation.stepping import FilterStepper
from schuler.navigation.stream.buffers import SampleBuffer
from schuler.navigation.stream.state import FilterState


def smoothed_state(
    stepper: FilterStepper,
    samples: SampleBuffer,
    nodes: NodeOutputs,
    aiding: AidingOutputs,
    last: float,
    lag: float,
) -> FilterState | None:
    """State at the newest sample that is `lag` older than the last; None before there is one."""
    made = stepper.nodes_made
    rows = samples.count - samples.first
    row = int(np.searchsorted(samples.time[:rows], last - lag + 1e-9, "right")) - 1
    if row < 0 or made < 2:
        return None
    time = float(samples.time[row])
    places = nodes.size
    numbers = np.arange(max(made - places, 0), made)
    node_time = nodes.time[numbers % places]
    at = int(np.searchsorted(node_time, time, "right")) - 1
    if at < 0:
        return None
    horizon = lag_horizons(node_time, lag)[at]
    node = int(numbers[at])
    lagged = smooth_nodes_with_lag(
        NodeStretch(int(numbers[0]), made, nodes, aiding),
        stepper.model.block,
        node,
        np.array([numbers[horizon]]),
    )
    one = slice(row, row + 1)
    values = SampleOutputs(
        *(getattr(samples.outputs, f.name)[one].copy() for f in fields(SampleOutputs))
    )
    ahead = float(node_time[at + 1]) if at + 1 < node_time.size else np.inf
    share = np.array([min((time - float(node_time[at])) / (ahead - float(node_time[at])), 1.0)])
    found = lagged.corrected(values, np.zeros(1, dtype=np.int64), share)
    s = stepper.size
    covariance = np.zeros((s, s))
    covariance[:3, :3] = found.position_covariance[0]
    sd = np.concatenate([found.velocity_sd[0], found.attitude_sd[0], lagged.sd[0, 9:]])
    covariance[range(3, s), range(3, s)] = sd**2
    place = node % places
    return FilterState(
        time,
        found.position[0],
        found.velocity[0],
        found.rotation[0],
        nodes.sensor_state[place] + lagged.error[0, 9:],
        covariance,
    )
