"""What the stacked filter works on: k IMUs, each with a solution, and the body that ties them.

M sensor states of all IMUs one after the other, s = 9 k + M + 6 (k - 1) states in all: a block of
position (m), velocity (m/s), attitude (rad) and sensor states for each IMU, then the errors of the
attitude and lever arm of every further IMU against the first.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.navigation.filter_data import (
    Matrices3,
    Measurement,
    SensorModel,
    Vectors3,
    Work,
)
from schuler.kernels.structure_fields import (
    Counter,
    Cube,
    Flags,
    Matrix,
    Matrix3,
    Number,
    Places,
    Vector,
    Vector3,
    reals,
    seen,
    wholes,
)
from schuler.kernels.structures import carve, size_of, structure

Array = NDArray[np.float64]

Many3 = Annotated[Array, reals(None, None, 3)]


@structure
class StackState:
    """What the filter remembers: arrays with a row for each IMU.

    relative_quaternion, relative, arm: C_1i and the place of IMU i from the first in its axes,
    the first ones not used; earth to past as in `FilterState`; sensor (M,), transition and noise
    (M, w) of all sensor states; discretised: the step that these are made for; step: the sample
    before; refused: refusals in a row of either kind. Counted are measurements, constraint epochs
    among them (ties) and nodes so far.
    """

    position: Vectors3
    velocity: Vectors3
    quaternion: Annotated[Array, reals(None, 4)]
    rotation: Matrices3
    relative_quaternion: Annotated[Array, reals(None, 4)]
    relative: Matrices3
    arm: Vectors3
    sensor: Vector
    covariance: Matrix
    earth: Annotated[Array, reals(None, 10)]
    angle: Vectors3
    velocity_increment: Vectors3
    coning: Vectors3
    sculling: Vectors3
    past: Annotated[Array, reals(None, 3, 6)]
    transition: Matrix
    noise: Matrix
    discretised: Number
    step: Number
    log_likelihood: Number
    refused: Annotated[NDArray[np.int64], wholes(2)]
    aided: Counter
    ties: Counter
    nodes: Counter

    @classmethod
    def empty(cls, k: int, states: int, layout: tuple[int, ...]) -> StackState:
        """Room for k IMUs and so many states; `layout` is the shape of the sensors' drift."""
        three = ("position", "velocity", "arm", "angle", "velocity_increment", "coning", "sculling")
        made: dict[str, Any] = {name: np.zeros((k, 3)) for name in three}
        made |= {name: np.zeros((k, 4)) for name in ("quaternion", "relative_quaternion")}
        made |= {name: np.zeros((k, 3, 3)) for name in ("rotation", "relative")}
        made |= {name: np.zeros(layout) for name in ("transition", "noise")}
        made |= {name: np.zeros(1) for name in ("step", "log_likelihood")}
        made |= {name: np.zeros(1, np.int64) for name in ("aided", "ties", "nodes")}
        return cls(
            sensor=np.zeros(layout[0]),
            covariance=np.zeros((states, states)),
            earth=np.zeros((k, 10)),
            past=np.zeros((k, 3, 6)),
            discretised=np.full(1, -1.0),
            refused=np.zeros(2, np.int64),
            **made,
        )


@structure
class StackModel:
    """What is known of the IMUs and their body.

    sensors: error states of all IMUs, those of IMU i from first[i] to first[i + 1], its block in
    the state from offset[i] to offset[i + 1]; places in its blocks count within an IMU. white
    (k, 6): squared densities; lever (k, 3) from each IMU to the antenna and place (k, 3) from the
    body's origin to each IMU, in the axes of that IMU; weight (k,) with which the IMUs are
    compared with GNSS and averaged; creep (2,): squared densities of the walks of the relative
    poses; tie_variance (3,): noise of the constraints on attitude, position, velocity.
    """

    sensors: SensorModel
    first: Places
    offset: Places
    white: Matrix
    lever: Vectors3
    place: Vectors3
    weight: Vector
    creep: Annotated[Array, reals(2)]
    tie_variance: Vector3


@structure
class StackRules:
    """How the filter decides; fields as in `Rules`."""

    gate: Annotated[Array, reals(4)]
    patience: int
    longest_step: float


@structure
class StackSamples:
    """Samples of all IMUs in their axes: time (n,), gyro and accel (n, k, 3), white_scale (n, 6).

    The scale, of no rows where there is none, multiplies the variances of white noise.
    """

    time: Annotated[Array, seen(reals(None))]
    gyro: Annotated[Array, seen(reals(None, None, 3))]
    accel: Annotated[Array, seen(reals(None, None, 3))]
    white_scale: Annotated[Array, seen(reals(None, 6))]


@structure
class StackSchedule:
    """Measurements by time: kind 0 and 1 GNSS position and velocity, 2 the constraints."""

    time: Vector
    kind: Places
    value: Vectors3
    variance: Vectors3


@structure
class Tie:
    """What ties two IMUs, see `constraint_model`."""

    residual: Annotated[Array, reals(9)]
    by_first: Annotated[Array, reals(9, 9)]
    by_second: Annotated[Array, reals(9, 9)]
    by_relative: Annotated[Array, reals(9, 6)]
    by_gyro: Matrix3

    @classmethod
    def empty(cls) -> Tie:
        """Zeros."""
        return cls(np.zeros(9), np.zeros((9, 9)), np.zeros((9, 9)), np.zeros((9, 6)), np.eye(3))


@structure
class StackWork:
    """What a step writes and forgets.

    of_filter: rows and shares of a step; transport (3,): see `navigation_rows`; white (k, 6):
    noise in this sample; body_rate, residual, rate_noise (k, 3): of each IMU; density (2, 3, 3):
    of the gyros of one IMU; design (3 s,): H of one IMU; mean (3, s) and spread (3, 3): of the
    body's origin by the errors, its covariance.
    """

    of_filter: Work
    transport: Vector3
    white: Matrix
    body_rate: Vectors3
    residual: Vectors3
    rate_noise: Vectors3
    density: Annotated[Array, reals(2, 3, 3)]
    design: Vector
    mean: Matrix
    spread: Matrix3
    tie: Tie

    @classmethod
    def of(cls, model: StackModel, size: int) -> StackWork:
        """Work for a model with so many states."""
        k = len(model.white)
        vectors = ("body_rate", "residual", "rate_noise")
        shapes: dict[str, tuple[int, ...]] = dict.fromkeys(vectors, (k, 3))
        shapes |= {"transport": (3,), "white": (k, 6), "density": (2, 3, 3)}
        shapes |= {"design": (3 * size,), "mean": (3, size), "spread": (3, 3)}
        views: Mapping[str, Any] = carve(shapes, np.zeros(size_of(shapes)))
        work = cls(of_filter=Work.of(model.sensors), tie=Tie.empty(), **views)
        work.white[:] = model.white
        return work


@structure
class StackOutputs:
    """What the filter leaves behind.

    At n samples: position, velocity (n, k, 3), rotation (n, k, 3, 3) and standard deviations
    sd (n, k, 9) of each IMU; of the weighted mean of what they say of the body's origin
    position_covariance (n, 3, 3), velocity_sd and attitude_sd (n, 3). At u measurements residual,
    deviation (u, 3), nis, degrees, accepted (u,); at the epochs of constraints tie_residual,
    tie_deviation (c, k - 1, 9) and tie_nis (c, k - 1, 3). At nodes, one for every measurement:
    time, sensor states and relative poses with their standard deviations.
    """

    position: Many3
    velocity: Many3
    rotation: Annotated[Array, reals(None, None, 3, 3)]
    sd: Cube
    position_covariance: Matrices3
    velocity_sd: Vectors3
    attitude_sd: Vectors3
    residual: Vectors3
    deviation: Vectors3
    nis: Vector
    degrees: Places
    accepted: Flags
    tie_residual: Cube
    tie_deviation: Cube
    tie_nis: Cube
    node_time: Vector
    node_sensor: Matrix
    node_sensor_sd: Matrix
    node_arm: Many3
    node_relative: Annotated[Array, reals(None, None, 3, 3)]
    node_relative_sd: Matrix

    @classmethod
    def empty(cls, n: int, k: int, kind: NDArray[np.int64], sensors: int) -> StackOutputs:
        """For n samples of k IMUs and measurements of these kinds."""
        u, ties = kind.size, int((kind == 2).sum())
        return cls(
            position=np.empty((n, k, 3)),
            velocity=np.empty((n, k, 3)),
            rotation=np.empty((n, k, 3, 3)),
            sd=np.empty((n, k, 9)),
            position_covariance=np.empty((n, 3, 3)),
            velocity_sd=np.empty((n, 3)),
            attitude_sd=np.empty((n, 3)),
            residual=np.full((u, 3), np.nan),
            deviation=np.full((u, 3), np.nan),
            nis=np.zeros(u),
            degrees=np.zeros(u, dtype=np.int64),
            accepted=np.zeros(u, dtype=np.bool_),
            tie_residual=np.zeros((ties, k - 1, 9)),
            tie_deviation=np.zeros((ties, k - 1, 9)),
            tie_nis=np.zeros((ties, k - 1, 3)),
            node_time=np.zeros(u + 2),
            node_sensor=np.zeros((u + 2, sensors)),
            node_sensor_sd=np.zeros((u + 2, sensors)),
            node_arm=np.zeros((u + 2, k, 3)),
            node_relative=np.zeros((u + 2, k, 3, 3)),
            node_relative_sd=np.zeros((u + 2, 6 * (k - 1))),
        )


@structure
class Stack:
    """A stacked filter, the samples and measurements it takes, and where it writes."""

    state: StackState
    model: StackModel
    rules: StackRules
    samples: StackSamples
    schedule: StackSchedule
    work: StackWork
    measurement: Measurement
    outputs: StackOutputs
