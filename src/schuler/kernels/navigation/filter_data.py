"""What the filter works on: its state, the sensor model, samples, measurements, what it leaves.

m sensor states in blocks of at most w, s = 9 + m states in all; error states are position (m),
velocity (m/s), attitude (rad), sensor states. Rows of `ROW` places keep arrays of the covariance
step apart, see kernels/navigation/covariance.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.structure_fields import (
    ArrayField,
    Counter,
    Cube,
    Flags,
    Matrix,
    Matrix3,
    Number,
    Places,
    Places3,
    Vector,
    Vector3,
    reals,
    seen,
    wholes,
)
from schuler.kernels.structures import carve, size_of, structure
from schuler.kernels.types import FloatArray, IntArray

# places of a row of work
ROW = 264
# kinds of aiding measurements that there may be
KINDS = 16

AIDING_ROW = np.dtype(
    [
        ("time", np.float64),
        ("kind", np.int64),
        # order of measurements of one time in a stream
        ("rank", np.int64),
        ("value", np.float64, (3,)),
        ("variance", np.float64, (3,)),
        ("lever", np.float64, (3,)),
        ("offset", np.int64, (3,)),
        ("offset_scale", np.float64, (3,)),
        ("matrix", np.int64),
    ],
    align=True,
)
"""One measurement, the fields as in `AidingSchedule`."""

Vectors3 = Annotated[FloatArray, reals(None, 3)]
Matrices3 = Annotated[FloatArray, reals(None, 3, 3)]


def _state_shapes(m: int, widest: int, accumulating: bool) -> dict[str, tuple[int, ...]]:
    """Shapes of all that a state remembers in real numbers, in the order of memory."""
    return {
        "position": (3,),
        "velocity": (3,),
        "quaternion": (4,),
        "rotation": (3, 3),
        "earth": (10,),
        "transport": (3,),
        "angle": (3,),
        "velocity_increment": (3,),
        "coning": (3,),
        "sculling": (3,),
        "past": (3, 6),
        "mean_force": (3,),
        "mean_rate": (3,),
        "rate_share": (1,),
        "rate_noise": (1,),
        "discretised": (1,),
        "log_likelihood": (1,),
        "time": (1,),
        "step": (1,),
        "node_time": (1,),
        "adapted": (4,),
        "sensor": (m,),
        "transition": (m, widest),
        "noise": (m, widest),
        "power": (m, widest),
        "power_noise": (m, widest),
        "covariance": (9 + m, 9 + m),
        "node_sensor": (m, widest) if accumulating else (0, widest),
        "node_top": (9 * ROW,) if accumulating else (0,),
    }


def _counter_shapes(m: int) -> dict[str, tuple[int, ...]]:
    return {
        "samples": (1,),
        "aided": (1,),
        "nodes": (1,),
        "moved": (1,),
        "refused": (KINDS,),
        "steps": (m,),
    }


@structure
class FilterState:
    """All that the filter remembers from one sample to the next.

    The fields are views into `memory` and `counters`, so that a run can stop after any sample, be
    copied, and go on later or once more from there.

    earth (10,) and transport (3,): of the last step, see `strapdown_step` and `navigation_rows`;
    angle, velocity_increment, coning, sculling: increments of the last sample; past (3, 6): rate
    and specific force of the samples before it, newest first; mean_force, mean_rate: those of a
    vehicle, smoothed, with the weight of a new sample in the rate and the noise of that rate;
    discretised: the step that `transition` and `noise` are made for; time and step: of the last
    sample; node_time: of the last node; adapted (4,): see `scale_noise`; power, power_noise:
    blocks of one interval raised to a sample's steps; node_top and node_sensor: the transition
    since the last node, of no size where no smoother needs it.

    Counted are samples, measurements (aided) and nodes so far, whether the blocks of one interval
    are set to move, refusals in a row of each kind, and the steps of each state.
    """

    memory: Vector
    counters: Places
    position: Vector3
    velocity: Vector3
    quaternion: Annotated[FloatArray, reals(4)]
    rotation: Matrix3
    earth: Annotated[FloatArray, reals(10)]
    transport: Vector3
    angle: Vector3
    velocity_increment: Vector3
    coning: Vector3
    sculling: Vector3
    past: Annotated[FloatArray, reals(3, 6)]
    mean_force: Vector3
    mean_rate: Vector3
    rate_share: Number
    rate_noise: Number
    discretised: Number
    log_likelihood: Number
    time: Number
    step: Number
    node_time: Number
    adapted: Annotated[FloatArray, reals(4)]
    sensor: Vector
    transition: Matrix
    noise: Matrix
    power: Matrix
    power_noise: Matrix
    covariance: Matrix
    node_sensor: Matrix
    node_top: Vector
    samples: Counter
    aided: Counter
    nodes: Counter
    moved: Counter
    refused: Annotated[IntArray, wholes(KINDS)]
    steps: Places

    @classmethod
    def empty(cls, m: int, widest: int, accumulating: bool) -> FilterState:
        """Zeros for m sensor states in blocks of at most `widest`.

        `accumulating`: whether the transition between nodes is kept, for a smoother.
        """
        memory = np.zeros(size_of(_state_shapes(m, widest, accumulating)))
        counters = np.zeros(size_of(_counter_shapes(m)), dtype=np.int64)
        return cls.of(m, widest, accumulating, memory, counters)

    @classmethod
    def of(
        cls, m: int, widest: int, accumulating: bool, memory: FloatArray, counters: IntArray
    ) -> FilterState:
        """The state that is kept in these arrays."""
        views: Mapping[str, Any] = {
            **carve(_state_shapes(m, widest, accumulating), memory),
            **carve(_counter_shapes(m), counters),
        }
        return cls(memory, counters, **views)

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy has views of its own memory."""
        m, widest = self.transition.shape
        made_for = (m, widest, self.node_top.size > 0)
        return FilterState.of, (*made_for, self.memory, self.counters)


@structure
class SensorModel:
    """The sensor error states as the kernels want them.

    channel (m,), direction (m, 3), scaled_by (m,): see `channel_rows` and `scale_directions`;
    block (m, 2): start and size of the block of each state; interval (m,): of discrete blocks, s,
    0 for states in continuous time; drift, diffusion (m, w): rows of the blocks' matrices, rates
    and noise densities, or transition and noise covariance over one interval; white (2, 3, 3):
    covariance densities of the accelerometers and of the gyros. `discrete`: there are blocks of
    one interval; `modulated`: some states show in proportion to what is measured.
    """

    channel: Places
    direction: Vectors3
    scaled_by: Places
    block: Annotated[IntArray, wholes(None, 2)]
    interval: Vector
    drift: Matrix
    diffusion: Matrix
    white: Annotated[FloatArray, reals(2, 3, 3)]
    discrete: bool
    modulated: bool


@structure
class Rules:
    """How the filter decides.

    gate (4,): largest normalised innovation squared accepted for 0 to 3 degrees of freedom; after
    `patience` refusals in a row of one kind the next one is let in. robustness (9,): see
    robust.py. vehicle: place of the vehicle's states among the sensor states (-1: none),
    mounting (3, 3) the nominal one; rolling, standing: see `constraint_applies`. Steps longer than
    `longest_step` are integrated in pieces. Nodes are made at least every `node_interval`.
    """

    gate: Annotated[FloatArray, reals(4)]
    robustness: Annotated[FloatArray, reals(9)]
    patience: int
    vehicle: int
    mounting: Matrix3
    rolling: float
    standing: float
    longest_step: float
    node_interval: float


@structure
class Samples:
    """IMU samples: time (n,), gyro and accel (n, 3), white_scale (n, 6) or (0, 6).

    The scale multiplies the variances of white noise sample by sample, accelerometers first.
    """

    time: Annotated[FloatArray, seen(reals(None))]
    gyro: Annotated[FloatArray, seen(reals(None, 3))]
    accel: Annotated[FloatArray, seen(reals(None, 3))]
    white_scale: Annotated[FloatArray, seen(reals(None, 6))]


@structure
class Schedule:
    """Aiding measurements sorted by time, number u in row u modulo the rows there are.

    rows (r,) of `AIDING_ROW`; matrices (t, 3, m): of linear measurements, see `linear_model`.
    """

    rows: Annotated[NDArray[np.void], ArrayField(AIDING_ROW, (None,), seen=True)]
    matrices: Annotated[FloatArray, seen(reals(None, 3, None))]


@structure
class Measurement:
    """The measurement at hand: as in its row, then what the filter makes of it.

    residual (3,): predicted minus measured, design (3, s): H, noise_variance (3,) and deviation
    (3,): of the innovation, as claimed; error (s,): what is to be fed back, gain (s,): of the last
    component; body_rate (3,): against the earth, in the body.
    """

    value: Vector3
    variance: Vector3
    lever: Vector3
    offset: Places3
    offset_scale: Vector3
    residual: Vector3
    design: Matrix
    noise_variance: Vector3
    deviation: Vector3
    error: Vector
    gain: Vector
    body_rate: Vector3

    @classmethod
    def empty(cls, size: int) -> Measurement:
        """Work for `size` states."""
        v = (np.zeros(3) for _ in range(7))
        value, variance, lever, residual, noise, deviation, rate = v
        return cls(
            value=value,
            variance=variance,
            lever=lever,
            offset=np.full(3, -1, dtype=np.int64),
            offset_scale=np.ones(3),
            residual=residual,
            design=np.zeros((3, size)),
            noise_variance=noise,
            deviation=deviation,
            error=np.zeros(size),
            gain=np.zeros(size),
            body_rate=rate,
        )


@structure
class VehicleWork:
    """What vehicle axes see, see `vehicle_velocity_model`.

    rate, its variance, acceleration: of the body, in its axes; mount, jacobian (3, 3): the
    mounting and its left Jacobian; turning (3,): 1 for axes that turn, else 0; here, turn, force
    (3,): velocity, rate and acceleration in vehicle axes, u (3,) the velocity at the point that
    does not slip; by_slip, by_pitch: how the velocity ahead shows in those across; by_rate (3, 3)
    and turned (3, 3): derivatives by the rate and by a turn of the mounting; shown (3,): work.
    """

    rate: Vector3
    rate_variance: Vector3
    acceleration: Vector3
    mount: Matrix3
    jacobian: Matrix3
    turning: Vector3
    here: Vector3
    turn: Vector3
    force: Vector3
    u: Vector3
    by_slip: Number
    by_pitch: Number
    by_rate: Matrix3
    turned: Matrix3
    shown: Vector3

    @classmethod
    def empty(cls) -> VehicleWork:
        """Zeros."""
        vectors = ("rate", "rate_variance", "acceleration", "turning", "here", "turn", "force")
        shapes: dict[str, tuple[int, ...]] = dict.fromkeys((*vectors, "u", "shown"), (3,))
        shapes |= dict.fromkeys(("mount", "jacobian", "by_rate", "turned"), (3, 3))
        shapes |= dict.fromkeys(("by_slip", "by_pitch"), (1,))
        views: Mapping[str, Any] = carve(shapes, np.zeros(size_of(shapes)))
        return cls(**views)


@structure
class Work:
    """What a step writes and forgets.

    rows: rows of `ROW` places in one array, see `work_rows`; blocks: as many as the largest block
    has states; sensor (m,);
    shown (m, 3): how states show in this sample; angle to sculling: shares of a sample that fall
    on one step; white (2, 3, 3) and root (6,): noise in this sample.
    """

    rows: Annotated[FloatArray, reals(33 * ROW)]
    blocks: Vector
    sensor: Vector
    shown: Vectors3
    angle: Vector3
    velocity_increment: Vector3
    coning: Vector3
    sculling: Vector3
    white: Annotated[FloatArray, reals(2, 3, 3)]
    root: Annotated[FloatArray, reals(6)]
    vehicle: VehicleWork

    @classmethod
    def of(cls, model: SensorModel) -> Work:
        """Work for a model."""
        m, widest = model.drift.shape
        shapes = {
            "rows": (33 * ROW,),
            "blocks": (widest * ROW,),
            "sensor": (m,),
            "shown": (m, 3),
            "angle": (3,),
            "velocity_increment": (3,),
            "coning": (3,),
            "sculling": (3,),
            "white": (2, 3, 3),
            "root": (6,),
        }
        views: Mapping[str, Any] = carve(shapes, np.zeros(size_of(shapes)))
        work = cls(**views, vehicle=VehicleWork.empty())
        work.shown[:], work.white[:] = model.direction, model.white
        return work


@structure
class SampleOutputs:
    """The filter's state at every IMU sample: n rows, or none."""

    position: Vectors3
    velocity: Vectors3
    rotation: Matrices3
    position_covariance: Matrices3
    velocity_sd: Vectors3
    attitude_sd: Vectors3

    @classmethod
    def empty(cls, rows: int) -> SampleOutputs:
        """Uninitialised; no rows to write none."""
        return cls(
            position=np.empty((rows, 3)),
            velocity=np.empty((rows, 3)),
            rotation=np.empty((rows, 3, 3)),
            position_covariance=np.empty((rows, 3, 3)),
            velocity_sd=np.empty((rows, 3)),
            attitude_sd=np.empty((rows, 3)),
        )


@structure
class AidingOutputs:
    """What happened at every aiding measurement: u rows.

    residual, deviation (u, 3): innovation and its claimed standard deviation; nis, degrees (u,);
    accepted (u,); scalar (u, 3, 2): innovation and its variance of every component that was used;
    row and gain (.., 3, s): of H and the gains, kept for a smoother, or no rows.
    """

    residual: Vectors3
    deviation: Vectors3
    nis: Vector
    degrees: Places
    accepted: Flags
    row: Cube
    gain: Cube
    scalar: Annotated[FloatArray, reals(None, 3, 2)]

    @classmethod
    def empty(cls, rows: int, kept: int, size: int) -> AidingOutputs:
        """For so many measurements, `kept` of them for a smoother, and s = `size` states."""
        return cls(
            residual=np.full((rows, 3), np.nan),
            deviation=np.full((rows, 3), np.nan),
            nis=np.zeros(rows),
            degrees=np.zeros(rows, dtype=np.int64),
            accepted=np.zeros(rows, dtype=np.bool_),
            row=np.zeros((kept, 3, size)),
            gain=np.zeros((kept, 3, size)),
            scalar=np.zeros((rows, 3, 2)),
        )


@structure
class NodeOutputs:
    """What the smoother needs: k rows.

    time (k,), sensor_state and sensor_sd (k, m) of all nodes; then, where a smoother will come,
    covariance (.., s, s), top (.., 9, s) and transition (.., m, w) from the node before, error
    (.., s) the correction fed back there, aid (.., 2) the range of measurements used there.
    """

    time: Vector
    sensor_state: Matrix
    sensor_sd: Matrix
    covariance: Cube
    top: Cube
    transition: Cube
    error: Matrix
    aid: Annotated[IntArray, wholes(None, 2)]

    @property
    def size(self) -> int:
        """Number of nodes."""
        return int(self.time.size)

    @classmethod
    def empty(cls, rows: int, kept: int, size: int, width: int) -> NodeOutputs:
        """For so many nodes, `kept` for a smoother, s = `size`, w = `width`."""
        m = size - 9
        return cls(
            time=np.zeros(rows),
            sensor_state=np.zeros((rows, m)),
            sensor_sd=np.zeros((rows, m)),
            covariance=np.empty((kept, size, size)),
            top=np.empty((kept, 9, size)),
            transition=np.empty((kept, m, width)),
            error=np.empty((kept, size)),
            aid=np.zeros((kept, 2), dtype=np.int64),
        )


@structure
class Filter:
    """A filter, the samples and measurements it is to take, and where it writes.

    Measurement and node number i are in row i modulo the rows there are, so that a stream may keep
    the latest only; the same holds for what is written about them.
    """

    state: FilterState
    model: SensorModel
    rules: Rules
    samples: Samples
    schedule: Schedule
    work: Work
    measurement: Measurement
    outputs: SampleOutputs
    aiding: AidingOutputs
    nodes: NodeOutputs
