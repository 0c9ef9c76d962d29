"""Fixed-interval smoothing of a filter run: every sample sees the whole recording. Spec 7.8.

Algebraically the Rauch-Tung-Striebel smoother, computed in the modified Bryson-Frazier form (see
kernels/navigation/smoother.py). Between nodes, a quarter of a second apart at most, the estimated
error of the filter is interpolated linearly.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from schuler.earth import metres_per_radian
from schuler.errors import NavigationError
from schuler.navigation.engine import FilterRun, SampleOutputs
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.rotations import dcm_from_rotation_vector
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class SmoothedRun:
    """A smoothed run."""

    samples: SampleOutputs  # state at every IMU sample
    # sensor_state, sensor_sd: (k, m) sensor error states at the nodes and their standard deviations
    sensor_state: FloatArray
    sensor_sd: FloatArray
    # lasting, lasting_before: (k, 3, 3) covariance of position with errors of GNSS that last,
    # smoothed and of the filter
    lasting: FloatArray | None = None
    lasting_before: FloatArray | None = None


def smooth_run(
    run: FilterRun, model: SensorErrorModel, time: FloatArray, lasting: int = -1
) -> SmoothedRun:
    """Smooth a run that kept its samples and nodes.

    `lasting`: the first of three sensor states, errors of GNSS that last; -1: none.
    """
    from schuler.kernels.navigation.smoother import Adjoint, Smoothed, smooth_nodes

    nodes = run.nodes
    if not run.smoothable:
        raise NavigationError("the run kept no nodes or samples", expected="a run kept whole")
    count, s = nodes.size, 9 + model.size
    first = 9 + lasting if lasting >= 0 else -1
    whole, fed_back = Smoothed.zeros(count, s, first), np.empty((count, 9))
    filtered = np.empty_like(whole.lasting)
    adjoint = Adjoint.zero(s)
    block = model.layout().block
    pieces = run.pieces or (run,)
    begins = np.cumsum([0, *(piece.nodes.size for piece in pieces)])
    for p in range(len(pieces) - 1, -1, -1):
        piece, begin = pieces[p], begins[p]
        smoothed = Smoothed(
            whole.error[begin:],
            whole.position[begin:],
            whole.variance[begin:],
            whole.lasting[begin:],
            first,
        )
        for part in piece.stretches(back=True):
            smooth_nodes(part.first, part.stop, part.nodes, part.aiding, block, adjoint, smoothed)
            own = np.arange(part.first, part.stop)
            if first >= 0:
                covariance = part.nodes.covariance[own % len(part.nodes.covariance)]
                filtered[begin + own] = covariance[:, :3, first : first + 3]
            fed_back[begin + own] = part.nodes.error[own % len(part.nodes.error), :9]
        if p > 0:
            _back_over_break(adjoint.vector, adjoint.matrix, run.breaks[p - 1])
    error, position, sd = whole.error, whole.position, np.sqrt(whole.variance)
    before = np.clip(np.searchsorted(nodes.time, time, side="right") - 1, 0, count - 2)
    span = nodes.time[before + 1] - nodes.time[before]
    share = np.clip((time - nodes.time[before]) / span, 0.0, 1.0)[:, None]
    # the error of the state just before the next node's correction was fed back
    ahead = error[1:, :9] + fed_back[1:]
    at_end = (time >= nodes.time[-1])[:, None]
    left = np.where(
        at_end, error[-1, :9], error[before, :9] * (1.0 - share) + ahead[before] * share
    )

    def between(values: FloatArray) -> FloatArray:
        weight = share if values.ndim == 2 else share[:, :, None]
        mixed: FloatArray = values[before]
        mixed *= 1.0 - weight
        ahead = values[before + 1]
        ahead *= weight
        mixed += ahead
        return mixed

    return SmoothedRun(
        samples=corrected_samples(
            run.samples, left, between(position), between(sd[:, 3:6]), between(sd[:, 6:9])
        ),
        sensor_state=nodes.sensor_state + error[:, 9:],
        sensor_sd=sd[:, 9:],
        lasting=whole.lasting if first >= 0 else None,
        lasting_before=filtered if first >= 0 else None,
    )


def _back_over_break(adjoint: FloatArray, information: FloatArray, sensor: FloatArray) -> None:
    """Take the adjoint variables over a break, in place: only the sensor states come across."""
    adjoint[:9] = 0.0
    adjoint[9:] = sensor.T @ adjoint[9:]
    information[:9], information[:, :9] = 0.0, 0.0
    information[9:, 9:] = sensor.T @ information[9:, 9:] @ sensor


def corrected_samples(
    samples: SampleOutputs,
    error: FloatArray,
    position_covariance: FloatArray,
    velocity_sd: FloatArray,
    attitude_sd: FloatArray,
) -> SampleOutputs:
    """Take errors out of the filter's states."""
    north, east = metres_per_radian(samples.position)
    position = samples.position.copy()
    position[:, 0] -= error[:, 0] / north
    position[:, 1] -= error[:, 1] / east
    position[:, 2] += error[:, 2]
    return SampleOutputs(
        position=position,
        velocity=samples.velocity - error[:, 3:6],
        rotation=dcm_from_rotation_vector(error[:, 6:9]) @ samples.rotation,
        position_covariance=position_covariance,
        velocity_sd=np.ascontiguousarray(velocity_sd),
        attitude_sd=np.ascontiguousarray(attitude_sd),
    )
