"""The door to the stacked filter: a solution for every IMU, tied by the body.

Spec 7.6: the geometrically constrained mechanization of S002, with GNSS used once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from schuler.data import GnssRecording, Trajectory
from schuler.data.exportable import Exportable
from schuler.earth import geodetic_from_ned
from schuler.errors import InputError, NavigationError
from schuler.kernels.navigation.filter_data import Measurement, SensorModel
from schuler.kernels.navigation.stacked_data import (
    Stack,
    StackModel,
    StackOutputs,
    StackRules,
    StackSamples,
    StackSchedule,
    StackState,
    StackWork,
)
from schuler.navigation.aiding.options import WHITE_ERRORS
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.mechanizations.array_preparation import PreparedArray, own_factors
from schuler.navigation.stepping import LONGEST_STEP, PATIENCE
from schuler.rotations import quaternion_from_dcm, skew
from schuler.types import FloatArray

CONSTRAINT = 2
"""Kind of an epoch of constraints in the schedule of the stacked filter."""
OF_NODES = ("time", "sensor", "sensor_sd", "arm", "relative", "relative_sd")


@dataclass(frozen=True, slots=True)
class RigidBody(Exportable):
    """How well the IMUs are known to sit on one rigid body.

    Parameters
    ----------
    rotation_sd, position_sd : float
        Of the mounting of each IMU at the start, rad and m.
    rotation_walk, position_walk : float
        How it creeps, rad and m per square root of a second.
    attitude_sd, distance_sd, velocity_sd : float
        Noise of the pseudo-measurements, rad, m and m/s; never zero.
    interval : float
        Seconds between them: what they say is correlated in time.

    Examples
    --------
    >>> from schuler import RigidBody
    >>> RigidBody(position_sd=0.001).position_walk
    1e-05
    """

    rotation_sd: float = float(np.radians(0.3))
    position_sd: float = 5e-3
    rotation_walk: float = 1e-8
    position_walk: float = 1e-5
    attitude_sd: float = 1e-3
    distance_sd: float = 5e-3
    velocity_sd: float = 1e-2
    interval: float = 1.0

    def __post_init__(self) -> None:
        positive = (
            self.rotation_sd, self.position_sd, self.attitude_sd,
            self.distance_sd, self.velocity_sd, self.interval,
        )  # fmt: skip
        if not all(np.isfinite(v) and v > 0.0 for v in positive):
            raise InputError(
                "a constraint with a standard deviation or an interval that is not positive",
                expected="positive numbers: a constraint without noise makes a filter sure of "
                "what it does not know",
            )


@dataclass(frozen=True, slots=True, eq=False)
class StackedRun:
    """What the stacked filter left behind."""

    trajectories: tuple[Trajectory, ...]  # of each IMU, in its own axes
    outputs: StackOutputs  # at samples, measurements and nodes
    schedule: StackSchedule  # the measurements
    weight: FloatArray  # (k,): of the IMUs in their mean
    covariance: FloatArray  # (s, s): at the end
    log_likelihood: float  # of the accepted GNSS measurements


def run_stack(
    prepared: PreparedArray,
    gnss: GnssRecording,
    *,
    gate: FloatArray,
    rigid: RigidBody | None = None,
) -> StackedRun:
    """Run all IMUs of an array side by side in one filter."""
    from schuler.kernels.navigation.stacked import run_stacked

    array, rigid = prepared.array, rigid or RigidBody()
    model = stack_model(prepared, rigid)
    state = stack_start(prepared, gnss, rigid, model)
    schedule = _schedule(prepared, gnss, rigid.interval)
    size = len(state.covariance)
    stack = Stack(
        state=state,
        model=model,
        rules=StackRules(gate, PATIENCE, LONGEST_STEP),
        samples=StackSamples(
            np.ascontiguousarray(array.time),
            np.ascontiguousarray(array.gyro),
            np.ascontiguousarray(array.accel),
            _white_scale(prepared),
        ),
        schedule=schedule,
        work=StackWork.of(model, size),
        measurement=Measurement.empty(size),
        outputs=StackOutputs.empty(array.size, array.count, schedule.kind, state.sensor.size),
    )
    bad = run_stacked(stack)
    if bad >= 0:
        raise NavigationError(
            f"the stacked navigation state stopped being finite at {array.time[bad]:.3f} s",
            expected="bounded trajectories",
            cure="check units, axes and mounting of the IMUs and their noise models",
        )
    out, count = stack.outputs, int(state.nodes[0])
    nodes = {f"node_{name}": getattr(out, f"node_{name}")[:count] for name in OF_NODES}
    return StackedRun(
        trajectories=tuple(
            Trajectory(array.time, out.position[:, i], out.velocity[:, i], out.rotation[:, i])
            for i in range(array.count)
        ),
        outputs=replace(out, **nodes),
        schedule=schedule,
        weight=model.weight,
        covariance=state.covariance,
        log_likelihood=float(state.log_likelihood[0]),
    )


def stack_model(prepared: PreparedArray, rigid: RigidBody) -> StackModel:
    """What is known of the IMUs and their body, as the kernel wants it."""
    rotation, position = prepared.array.mounting.rotation, prepared.array.mounting.position
    models = [
        own_factors(prepared.setup, c).factors.applied(m)
        for m, c in zip(prepared.models, rotation, strict=True)
    ]
    first = np.concatenate([[0], np.cumsum([m.size for m in models])]).astype(np.int64)
    return StackModel(
        sensors=_all_sensors(models),
        first=first,
        offset=first + 9 * np.arange(first.size),
        white=np.stack([m.white_density**2 for m in models]),
        lever=np.einsum("kji,kj->ki", rotation, prepared.lever_arm - position),
        place=np.einsum("kji,kj->ki", rotation, position),
        weight=default_weight(prepared),
        creep=np.array([rigid.rotation_walk**2, rigid.position_walk**2]),
        tie_variance=np.array([rigid.attitude_sd**2, rigid.distance_sd**2, rigid.velocity_sd**2]),
    )


def _all_sensors(models: Sequence[SensorErrorModel]) -> SensorModel:
    """The sensor states of all IMUs one after the other, in blocks that count within an IMU."""
    layouts = [m.layout() for m in models]
    widest = max(layout.drift.shape[1] for layout in layouts)
    each = ("channel", "direction", "scaled_by", "block", "interval")
    joined: dict[str, Any] = {
        name: np.concatenate([getattr(x, name) for x in layouts]) for name in each
    }
    return replace(
        layouts[0],
        **joined,
        drift=np.concatenate([_wide(x.drift, widest) for x in layouts]),
        diffusion=np.concatenate([_wide(x.diffusion, widest) for x in layouts]),
    )


def default_weight(prepared: PreparedArray) -> FloatArray:
    """Weights (k,) of the IMUs: inverse mean square of the white noise of their gyros."""
    square = np.array([np.mean(m.white_density[3:] ** 2) for m in prepared.models])
    if not np.all(square > 0.0):
        return np.full(square.size, 1.0 / square.size)
    weight: FloatArray = (1.0 / square) / np.sum(1.0 / square)
    return weight


def stack_start(
    prepared: PreparedArray, gnss: GnssRecording, rigid: RigidBody, model: StackModel
) -> StackState:
    """Every IMU starts where the mounting puts it on the aligned body."""
    body = prepared.setup.initial_state(prepared.recording, gnss)
    sensors = prepared.sensor_start()
    mounting, k = prepared.array.mounting, prepared.array.count
    c_nb, arms = body.rotation, mounting.position - prepared.fusion.centre
    quaternion = np.stack([quaternion_from_dcm(c_nb @ c) for c in mounting.rotation])
    relative = np.stack(
        [quaternion_from_dcm(c.T @ mounting.rotation[0]) for c in mounting.rotation]
    )
    covariance = _start_covariance(prepared, c_nb, body.covariance[:9, :9], rigid, model)
    blocks = model.offset[:-1, None] + np.arange(9)
    places = np.setdiff1d(np.arange(model.offset[-1]), blocks)
    covariance[np.ix_(places, places)] += sensors.covariance
    state = StackState.empty(k, len(covariance), model.sensors.drift.shape)
    state.position[:] = [geodetic_from_ned(c_nb @ a, body.position) for a in arms]
    state.velocity[:] = body.velocity
    state.quaternion[:], state.rotation[:] = quaternion, _rotations(quaternion)
    state.relative_quaternion[:], state.relative[:] = relative, _rotations(relative)
    state.arm[:] = [mounting.rotation[0].T @ (a - arms[0]) for a in arms]
    state.sensor[:] = sensors.state
    state.covariance[:] = 0.5 * (covariance + covariance.T)
    return state


def _rotations(quaternions: FloatArray) -> FloatArray:
    """Rotation matrices as the kernel makes them."""
    from schuler.kernels.navigation.strapdown import rotation_from_quaternion

    rotation = np.empty((len(quaternions), 3, 3))
    for quaternion, matrix in zip(quaternions, rotation, strict=True):
        rotation_from_quaternion(quaternion, matrix)
    return rotation


def _start_covariance(
    prepared: PreparedArray,
    c_nb: FloatArray,
    of_body: FloatArray,
    rigid: RigidBody,
    model: StackModel,
) -> FloatArray:
    """Covariance of all blocks and relative poses from errors of the body and of the mountings."""
    mounting, k = prepared.array.mounting, prepared.array.count
    arms = mounting.position - prepared.fusion.centre
    tied = int(model.offset[-1])
    # causes: the body's errors (9), of each mounting (rotation 3 and position 3, in the body)
    spread = np.zeros((tied + 6 * (k - 1), 9 + 6 * k))
    for i, o in enumerate(model.offset[:-1].tolist()):
        mu, shift = 9 + 6 * i, 12 + 6 * i
        spread[o : o + 9, :9] = np.eye(9)
        spread[o : o + 3, 6:9] = skew(c_nb @ arms[i])
        spread[o : o + 3, shift : shift + 3] = c_nb
        spread[o + 6 : o + 9, mu : mu + 3] = c_nb
        if i == 0:
            continue
        at = tied + 6 * (i - 1)
        back = mounting.rotation[i].T
        spread[at : at + 3, 9:12], spread[at : at + 3, mu : mu + 3] = back, -back
        own = mounting.rotation[0].T
        spread[at + 3 : at + 6, shift : shift + 3] = own
        spread[at + 3 : at + 6, 12:15] = -own
        spread[at + 3 : at + 6, 9:12] = -own @ skew(arms[i] - arms[0])
    # the body is the mean of the IMUs: the errors of their mountings cancel in it
    apart = np.eye(k) - model.weight
    mount = np.diag(np.repeat([rigid.rotation_sd**2, rigid.position_sd**2], 3))
    causes = np.zeros((9 + 6 * k, 9 + 6 * k))
    causes[:9, :9] = of_body
    causes[9:, 9:] = np.kron(apart @ apart.T, mount)
    covariance: FloatArray = spread @ causes @ spread.T
    return covariance


def _schedule(prepared: PreparedArray, gnss: GnssRecording, interval: float) -> StackSchedule:
    """GNSS and, between its fixes, the constraints."""
    # this filter has no states for errors of GNSS that last
    setup = replace(prepared.setup, measurements=WHITE_ERRORS)
    fixes = setup.schedule(prepared.recording, gnss)
    start, stop = prepared.array.time[[0, -1]]
    when = np.arange(start + interval, stop, interval)
    time = np.concatenate([fixes.time, when])
    order = np.argsort(time, kind="stable")
    return StackSchedule(
        time=time[order],
        kind=np.concatenate([fixes.kind, np.full(when.size, CONSTRAINT)]).astype(np.int64)[order],
        value=np.concatenate([fixes.value, np.zeros((when.size, 3))])[order],
        variance=np.concatenate([fixes.variance, np.ones((when.size, 3))])[order],
    )


def _white_scale(prepared: PreparedArray) -> FloatArray:
    """Noise by vibration, and as many times as there are more IMUs than bring news of their own."""
    scale, table = prepared.setup.white_scale(prepared.recording), prepared.table
    out = table.units_out
    if scale is None and not out.any():
        return np.empty((0, 6))
    if scale is None:
        scale = np.ones((prepared.array.size, 6))
    # axes of the IMUs need not be those of the body: one level for each kind of sensor
    mean = np.stack([scale[:, :3].mean(axis=1), scale[:, 3:].mean(axis=1)], axis=1)
    more = out.shape[1] / (~out).sum(axis=1)[table.row_at(prepared.array.time)]
    return np.ascontiguousarray(np.repeat(mean * more[:, None], 3, axis=1))


def _wide(matrix: FloatArray, columns: int) -> FloatArray:
    wide = np.zeros((matrix.shape[0], columns))
    wide[:, : matrix.shape[1]] = matrix
    return wide
