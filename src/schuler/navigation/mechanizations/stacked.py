"""The door to the stacked filter: an IMU's own solution each, tied by constraints or not at all.

Spec 7.6: the geometrically constrained mechanization of S002, with GNSS used once. Without ties
and with gains of their own the same filter is redundancy at system level.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from schuler.data import GnssRecording, Trajectory
from schuler.errors import InputError, NavigationError
from schuler.navigation.aiding.schedule import VELOCITY
from schuler.navigation.mechanizations.array_preparation import PreparedArray, own_factors
from schuler.navigation.stepping import LONGEST_STEP, PATIENCE, InitialState
from schuler.rotations import quaternion_from_dcm, skew
from schuler.types import FloatArray

CONSTRAINT = 2
"""Kind of an epoch of constraints in the schedule of the stacked filter."""


@dataclass(frozen=True, slots=True)
class RigidBody:
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
    """What the stacked filter left behind.

    Parameters
    ----------
    trajectories : tuple of Trajectory
        Of each IMU, in its own axes.
    position_covariance, velocity_sd, attitude_sd : (n, 3, 3), (n, 3), (n, 3) ndarray
        Of the weighted mean of what all say of the body.
    sd : (n, k, 9) ndarray
        Standard deviations of position, velocity and attitude of each IMU.
    weight : (k,) ndarray
        The weights of that mean.
    aid_time, aid_kind : (u,) ndarray
        Measurements; kind as in `KIND_NAMES`, or `CONSTRAINT`.
    residual, deviation : (u, a, 3) ndarray
        Of GNSS, one answer of the stack or one of each IMU.
    nis, degrees, accepted : (u, a), (u,), (u, a) ndarray
        As in `AidingOutputs`.
    constraint_nis : (c, k - 1, 3) ndarray
        Normalised squares of the attitude, position and velocity constraints of every pair.
    constraint_residual : (c, k - 1, 9) ndarray
        Their residuals.
    node_time : (j,) ndarray
        Times at which sensor states are kept, s.
    sensor_state, sensor_sd : (j, m) ndarray
        Of all IMUs, in the order of `extended_model`.
    relative_rotation, relative_position : (j, k, 3, 3), (j, k, 3) ndarray
        C_1i and the place of IMU i from IMU 1 in its axes; none without constraints.
    relative_sd : (j, 6 (k - 1)) ndarray
        Their standard deviations, rad and m.
    covariance : (s, s) ndarray
        At the end.
    log_likelihood : float
        Of the accepted GNSS measurements.
    """

    trajectories: tuple[Trajectory, ...]
    position_covariance: FloatArray
    velocity_sd: FloatArray
    attitude_sd: FloatArray
    sd: FloatArray
    weight: FloatArray
    aid_time: FloatArray
    aid_kind: NDArray[np.int64]
    residual: FloatArray
    deviation: FloatArray
    nis: FloatArray
    degrees: NDArray[np.int64]
    accepted: NDArray[np.bool_]
    constraint_nis: FloatArray
    constraint_residual: FloatArray
    node_time: FloatArray
    sensor_state: FloatArray
    sensor_sd: FloatArray
    relative_rotation: FloatArray
    relative_position: FloatArray
    relative_sd: FloatArray
    covariance: FloatArray
    log_likelihood: float


@dataclass(frozen=True, slots=True, eq=False)
class StackedStart:
    """State and covariance of the stack at the first sample.

    Parameters
    ----------
    position, velocity, quaternion : (k, 3), (k, 3), (k, 4) ndarray
        Of each IMU.
    relative_quaternion, arm : (k, 4), (k, 3) ndarray
        C_1i and the place of IMU i from IMU 1 in its axes.
    sensor_state : (m,) ndarray
        Of all IMUs.
    covariance : (s, s) ndarray
        Blocks of all IMUs, then the relative poses (6 for each IMU but the first), if any.
    """

    position: FloatArray
    velocity: FloatArray
    quaternion: FloatArray
    relative_quaternion: FloatArray
    arm: FloatArray
    sensor_state: FloatArray
    covariance: FloatArray


def run_stack(
    prepared: PreparedArray,
    gnss: GnssRecording,
    *,
    constrained: bool,
    gate: FloatArray,
    weight: FloatArray | None = None,
    rigid: RigidBody | None = None,
    start: StackedStart | None = None,
) -> StackedRun:
    """Run all IMUs of an array side by side in one filter.

    Parameters
    ----------
    prepared : PreparedArray
        From `prepare_array`.
    gnss : GnssRecording
        Epochs to use.
    constrained : bool
        True: tied by constraints, GNSS used once. False: every IMU by itself with all of GNSS,
        the covariance between them kept.
    gate : (4,) ndarray
        See `gate_thresholds`.
    weight : (k,) ndarray or None
        With which the IMUs are compared with GNSS and averaged; they add up to one. None: the
        inverse of the white noise of their gyros.
    rigid : RigidBody or None
        How rigid the body is; None: the defaults.
    start : StackedStart or None
        None: from the preparation.

    Returns
    -------
    StackedRun
        Solutions of all IMUs and of their mean.

    Raises
    ------
    NavigationError
        The state stopped being finite.
    """
    from schuler.kernels.navigation.stacked import run_stacked

    rigid = rigid or RigidBody()
    array, setup = prepared.array, prepared.setup
    if setup.vehicle is not None:
        raise InputError(
            "constraints of a vehicle with several solutions side by side",
            expected="GNSS alone",
            cure="use the synthetic or extended mechanization for them",
        )
    k, n = array.count, array.size
    models = [
        own_factors(setup, c).factors.applied(m)
        for m, c in zip(prepared.models, array.mounting.rotation, strict=True)
    ]
    share = default_weight(prepared) if weight is None else np.asarray(weight, dtype=np.float64)
    begin = start or stacked_start(prepared, gnss, rigid, share, constrained=constrained)
    state = replace(begin, **{f: getattr(begin, f).copy() for f in _STATE})
    first = np.concatenate([[0], np.cumsum([m.size for m in models])]).astype(np.int64)
    layouts = [m.layout() for m in models]
    widest = max(layout.drift.shape[1] for layout in layouts)
    time, kind, value, variance = _schedule(prepared, gnss, rigid.interval, constrained)
    u, answers = time.size, 1 if constrained else k
    epochs = int((kind == CONSTRAINT).sum())
    rotation, position = array.mounting.rotation, array.mounting.position
    lever = np.einsum("kji,kj->ki", rotation, prepared.lever_arm - position)
    place = np.einsum("kji,kj->ki", rotation, position)
    out = {
        "position": np.empty((n, k, 3)), "velocity": np.empty((n, k, 3)),
        "rotation": np.empty((n, k, 3, 3)), "sd": np.empty((n, k, 9)),
        "covariance": np.empty((n, 3, 3)),
        "velocity_sd": np.empty((n, 3)), "attitude_sd": np.empty((n, 3)),
    }  # fmt: skip
    residual, deviation = np.full((u, answers, 3), np.nan), np.full((u, answers, 3), np.nan)
    nis, degrees = np.zeros((u, answers)), np.zeros(u, dtype=np.int64)
    accepted = np.zeros((u, answers), dtype=np.bool_)
    con_residual, con_nis = np.zeros((epochs, k - 1, 9)), np.zeros((epochs, k - 1, 3))
    node = {
        "time": np.zeros(u + 2), "sensor": np.zeros((u + 2, first[-1])),
        "sd": np.zeros((u + 2, first[-1])), "arm": np.zeros((u + 2, k, 3)),
        "relative": np.zeros((u + 2, k, 3, 3)), "relative_sd": np.zeros((u + 2, 6 * (k - 1))),
    }  # fmt: skip
    likelihood, count, bad = run_stacked(
        array.time,
        np.ascontiguousarray(array.gyro),
        np.ascontiguousarray(array.accel),
        state.position,
        state.velocity,
        state.quaternion,
        state.sensor_state,
        first,
        state.relative_quaternion,
        state.arm,
        state.covariance,
        np.concatenate([x.channel for x in layouts]),
        np.concatenate([x.direction for x in layouts]),
        np.concatenate([x.block for x in layouts]),
        np.concatenate([_wide(x.drift, widest) for x in layouts]),
        np.concatenate([_wide(x.diffusion, widest) for x in layouts]),
        np.stack([m.white_density**2 for m in models]),
        _white_scale(prepared),
        np.array([rigid.rotation_walk**2, rigid.position_walk**2]),
        share,
        np.ascontiguousarray(lever),
        np.ascontiguousarray(place),
        not constrained,
        time,
        kind,
        value,
        variance,
        np.array([rigid.attitude_sd**2, rigid.distance_sd**2, rigid.velocity_sd**2]),
        gate,
        PATIENCE,
        LONGEST_STEP,
        out["position"],
        out["velocity"],
        out["rotation"],
        out["sd"],
        out["covariance"],
        out["velocity_sd"],
        out["attitude_sd"],
        residual,
        deviation,
        nis,
        degrees,
        accepted,
        con_residual,
        con_nis,
        node["time"],
        node["sensor"],
        node["sd"],
        node["arm"],
        node["relative"],
        node["relative_sd"],
    )
    if bad >= 0:
        raise NavigationError(
            f"the stacked navigation state stopped being finite at {array.time[bad]:.3f} s",
            expected="bounded trajectories",
            cure="check units, axes and mounting of the IMUs and their noise models",
        )
    tied = count if constrained else 0
    return StackedRun(
        trajectories=tuple(
            Trajectory(array.time, *(out[f][:, i] for f in ("position", "velocity", "rotation")))
            for i in range(k)
        ),
        position_covariance=out["covariance"],
        velocity_sd=out["velocity_sd"],
        attitude_sd=out["attitude_sd"],
        sd=out["sd"],
        weight=share,
        aid_time=time,
        aid_kind=kind,
        residual=residual,
        deviation=deviation,
        nis=nis,
        degrees=degrees,
        accepted=accepted,
        constraint_nis=con_nis,
        constraint_residual=con_residual,
        node_time=node["time"][:count],
        sensor_state=node["sensor"][:count],
        sensor_sd=node["sd"][:count],
        relative_rotation=node["relative"][:tied],
        relative_position=node["arm"][:tied],
        relative_sd=node["relative_sd"][:tied],
        covariance=state.covariance,
        log_likelihood=likelihood,
    )


_STATE = (
    "position", "velocity", "quaternion", "relative_quaternion", "arm", "sensor_state",
    "covariance",
)  # fmt: skip


def default_weight(prepared: PreparedArray) -> FloatArray:
    """Weights of the IMUs: inverse mean square of the white noise of their gyros.

    Parameters
    ----------
    prepared : PreparedArray
        For its models.

    Returns
    -------
    (k,) ndarray
        They add up to one.
    """
    square = np.array([np.mean(m.white_density[3:] ** 2) for m in prepared.models])
    if not np.all(square > 0.0):
        return np.full(square.size, 1.0 / square.size)
    weight: FloatArray = (1.0 / square) / np.sum(1.0 / square)
    return weight


def stacked_start(
    prepared: PreparedArray,
    gnss: GnssRecording,
    rigid: RigidBody,
    weight: FloatArray,
    *,
    constrained: bool,
) -> StackedStart:
    """Every IMU starts where the mounting puts it on the aligned body.

    Their errors are those of the body, common to all, and those of their mountings: the covariance
    between the blocks starts as large as it is. What is body and what is mounting error nobody
    can say; the axes and the origin of the body are the mean of what the mountings say of them.

    Parameters
    ----------
    prepared : PreparedArray
        Alignment and mounting.
    gnss : GnssRecording
        Its first epoch gives the position.
    rigid : RigidBody
        How well the mounting is known.
    weight : (k,) ndarray
        Of that mean.
    constrained : bool
        Whether relative poses are states.

    Returns
    -------
    StackedStart
        For `run_stack`.
    """
    body = prepared.setup.initial_state(prepared.recording, gnss)
    sensors = prepared.sensor_start()
    return stack_start(
        prepared, body, sensors.state, sensors.covariance, rigid, weight, constrained
    )


def stack_start(
    prepared: PreparedArray,
    body: InitialState,
    sensor_state: FloatArray,
    sensor_covariance: FloatArray,
    rigid: RigidBody,
    weight: FloatArray,
    constrained: bool,
) -> StackedStart:
    """Spread a state of the fused IMU over the stack. Parameters as in `stacked_start`."""
    from schuler.earth import geodetic_from_ned

    mounting, k = prepared.array.mounting, prepared.array.count
    c_nb = body.rotation
    arms = mounting.position - prepared.fusion.centre
    rotations = [c_nb @ c for c in mounting.rotation]
    sizes = [m.size for m in prepared.models]
    offset = np.concatenate([[0], np.cumsum([9 + m for m in sizes])]).astype(int)
    first = np.concatenate([[0], np.cumsum(sizes)]).astype(int)
    size = int(offset[-1]) + (6 * (k - 1) if constrained else 0)
    # causes: the body's errors (9), of each mounting (rotation 3 and position 3, in the body)
    spread = np.zeros((size, 9 + 6 * k))
    for i in range(k):
        o, mu, shift = offset[i], 9 + 6 * i, 12 + 6 * i
        spread[o : o + 9, :9] = np.eye(9)
        spread[o : o + 3, 6:9] = skew(c_nb @ arms[i])
        spread[o : o + 3, shift : shift + 3] = c_nb
        spread[o + 6 : o + 9, mu : mu + 3] = c_nb
        if not constrained or i == 0:
            continue
        at = int(offset[-1]) + 6 * (i - 1)
        back = mounting.rotation[i].T
        spread[at : at + 3, 9:12], spread[at : at + 3, mu : mu + 3] = back, -back
        own = mounting.rotation[0].T
        spread[at + 3 : at + 6, shift : shift + 3] = own
        spread[at + 3 : at + 6, 12:15] = -own
        spread[at + 3 : at + 6, 9:12] = -own @ skew(arms[i] - arms[0])
    # the body is the mean of the IMUs: the errors of their mountings cancel in it
    apart = np.eye(k) - weight
    mount = np.diag(np.repeat([rigid.rotation_sd**2, rigid.position_sd**2], 3))
    causes = np.zeros((9 + 6 * k, 9 + 6 * k))
    causes[:9, :9] = body.covariance[:9, :9]
    causes[9:, 9:] = np.kron(apart @ apart.T, mount)
    covariance = spread @ causes @ spread.T
    places = np.concatenate([offset[i] + 9 + np.arange(sizes[i]) for i in range(k)]).astype(int)
    covariance[np.ix_(places, places)] += sensor_covariance
    assert places.size == first[-1]
    relative = [mounting.rotation[i].T @ mounting.rotation[0] for i in range(k)]
    return StackedStart(
        position=np.stack([geodetic_from_ned(c_nb @ a, body.position) for a in arms]),
        velocity=np.tile(body.velocity, (k, 1)),
        quaternion=np.stack([quaternion_from_dcm(c) for c in rotations]),
        relative_quaternion=np.stack([quaternion_from_dcm(c) for c in relative]),
        arm=np.stack([mounting.rotation[0].T @ (a - arms[0]) for a in arms]),
        sensor_state=sensor_state.copy(),
        covariance=0.5 * (covariance + covariance.T),
    )


def _schedule(
    prepared: PreparedArray, gnss: GnssRecording, interval: float, constrained: bool
) -> tuple[FloatArray, NDArray[np.int64], FloatArray, FloatArray]:
    """GNSS and, between its fixes, the constraints."""
    fixes = prepared.setup.schedule(prepared.recording, gnss)
    keep = fixes.kind <= VELOCITY
    time, kind = fixes.time[keep], fixes.kind[keep]
    value, variance = fixes.value[keep], fixes.variance[keep]
    if constrained:
        start, stop = prepared.array.time[[0, -1]]
        when = np.arange(start + interval, stop, interval)
        time = np.concatenate([time, when])
        kind = np.concatenate([kind, np.full(when.size, CONSTRAINT)])
        value = np.concatenate([value, np.zeros((when.size, 3))])
        variance = np.concatenate([variance, np.ones((when.size, 3))])
    order = np.argsort(time, kind="stable")
    return (
        np.ascontiguousarray(time[order]),
        np.ascontiguousarray(kind[order].astype(np.int64)),
        np.ascontiguousarray(value[order]),
        np.ascontiguousarray(variance[order]),
    )


def _white_scale(prepared: PreparedArray) -> FloatArray:
    scale = prepared.setup.white_scale(prepared.recording)
    if scale is None:
        return np.empty((0, 6))
    # axes of the IMUs need not be those of the body: one level for each kind of sensor
    mean = np.stack([scale[:, :3].mean(axis=1), scale[:, 3:].mean(axis=1)], axis=1)
    return np.ascontiguousarray(np.repeat(mean, 3, axis=1))


def _wide(matrix: FloatArray, columns: int) -> FloatArray:
    wide = np.zeros((matrix.shape[0], columns))
    wide[:, : matrix.shape[1]] = matrix
    return wide
