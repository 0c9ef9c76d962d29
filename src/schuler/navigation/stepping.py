"""One door to the filter kernel: a filter, and a stretch of samples through it.

Batch, streaming and the smoother that recomputes what was not stored differ in how they cut a
recording into stretches, and in nothing else.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Required, TypedDict

import numpy as np

from schuler.data import ImuRecording
from schuler.kernels.navigation.filter_data import (
    AidingOutputs,
    Filter,
    FilterState,
    Measurement,
    NodeOutputs,
    Rules,
    SampleOutputs,
    Samples,
    Schedule,
    Work,
)
from schuler.navigation.aiding.schedule import GENERAL, LINEAR, AidingSchedule
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.types import FloatArray

# steps longer than this are integrated in pieces (s)
LONGEST_STEP = 0.05
# refusals in a row of one kind before the gate lets the next one in
PATIENCE = 4
# a wheeled vehicle faster than this shows its mounting; one slower than this may stand (m/s)
ROLLING = 1.0
STANDING = 0.2

NO_SCALE = np.empty((0, 6))
NODE_INTERVAL = 0.25
"""Longest time between nodes, s."""


@dataclass(frozen=True, slots=True, eq=False)
class InitialState:
    """Where a run starts, at the first IMU sample.

    Parameters
    ----------
    position : (3,) ndarray
        Latitude rad, longitude rad, height m.
    velocity : (3,) ndarray
        North, east, down, m/s.
    rotation : (3, 3) ndarray
        C_nb.
    sensor_state : (m,) ndarray
        Sensor error states, SI.
    covariance : (9 + m, 9 + m) ndarray
        Of position (m), velocity (m/s), attitude (rad), sensor states.
    sensors_anew : bool
        Where a run begins anew: whether nothing that was learnt of the sensors holds any more.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import InitialState
    >>> place = (np.radians(48.1), np.radians(11.5), 520.0)
    >>> start = InitialState(np.array(place), np.zeros(3), np.eye(3), np.zeros(6), np.eye(15))
    >>> start.covariance.shape
    (15, 15)
    """

    position: FloatArray
    velocity: FloatArray
    rotation: FloatArray
    sensor_state: FloatArray
    covariance: FloatArray
    sensors_anew: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class VehicleStates:
    """Where the filter finds what it knows of the vehicle."""

    # place of the first of the vehicle's states among the sensor states; -1: there are none.
    first: int
    # (3, 3): vehicle (forward, right, down) from IMU, before the estimated correction
    mounting: FloatArray


NO_VEHICLE = VehicleStates(-1, np.eye(3))


class FilterOptions(TypedDict, total=False):
    """Keywords that everything takes that runs a filter; explained at `FilterStepper`."""

    gate: Required[FloatArray]
    robustness: FloatArray | None
    vehicle: VehicleStates
    node_interval: float


@dataclass(frozen=True, slots=True, eq=False)
class SensorStretches:
    """How sensor errors show, where that changes in the middle of a run."""

    # (b,): of the first sample of every stretch, s; the first stretch begins with the run.
    time: FloatArray
    # (b, p, 3): of the first p sensor states; the others are always as the model says.
    direction: FloatArray
    white: FloatArray  # (b, 2, 3, 3): covariance densities of the accelerometers and of the gyros

    def starts(self, time: FloatArray) -> dict[int, int]:
        """Stretch that begins at a sample, for those that the samples see."""
        begins = np.searchsorted(time, self.time - 1e-9)
        # the first step takes two samples
        begins[begins <= 1], begins[0] = 0, 0
        return {int(sample): row for row, sample in enumerate(begins) if sample < time.size}

    def enter(self, row: int, filter_: Filter) -> None:
        """Let a filter take samples of a stretch from now on."""
        model, work, shown = filter_.model, filter_.work, self.direction[row]
        model.direction[: len(shown)], model.white[:] = shown, self.white[row]
        work.shown[: len(shown)], work.white[:] = shown, self.white[row]


class FilterStepper:
    """A filter between two samples: its state, and what it needs to go on.

    Parameters
    ----------
    initial : InitialState
        At the first sample.
    model : SensorErrorModel
        Sensor error states and white noise.
    gate : (4,) ndarray
        See `gate_thresholds`.
    robustness : (9,) ndarray or None
        See `GnssWeighting`; None: a gate, and the noise that the receiver claims.
    vehicle : VehicleStates
        Of a wheeled vehicle.
    node_interval : float
        Longest time between nodes, s.
    accumulating : bool
        Whether the transition between nodes is kept, for a smoother.
    """

    __slots__ = ("kernel", "model", "rules", "state")

    def __init__(
        self,
        initial: InitialState,
        model: SensorErrorModel,
        *,
        gate: FloatArray,
        robustness: FloatArray | None = None,
        vehicle: VehicleStates = NO_VEHICLE,
        node_interval: float = NODE_INTERVAL,
        accumulating: bool = False,
    ) -> None:
        from schuler.kernels.navigation.filter import run_filter

        self.kernel: Callable[[Filter, int, int, int, bool], int] = run_filter
        self.model = model.layout()
        self.state = FilterState.empty(model.size, self.model.drift.shape[1], accumulating)
        self.restart(initial)
        self.rules = Rules(
            gate=np.array(gate, dtype=np.float64),
            robustness=np.zeros(9) if robustness is None else np.array(robustness),
            patience=PATIENCE,
            vehicle=vehicle.first,
            mounting=np.array(vehicle.mounting, dtype=np.float64, order="C"),
            rolling=ROLLING,
            standing=STANDING,
            longest_step=LONGEST_STEP,
            node_interval=node_interval,
        )

    def restart(self, initial: InitialState) -> None:
        """Forget what was filtered and begin here, in the same arrays."""
        from schuler.kernels.navigation.strapdown import rotation_from_quaternion
        from schuler.kernels.navigation.transition import reset_transition
        from schuler.rotations import quaternion_from_dcm

        state = self.state
        state.memory[:], state.counters[:] = 0.0, 0
        state.position[:], state.velocity[:] = initial.position, initial.velocity
        state.quaternion[:] = quaternion_from_dcm(initial.rotation)
        rotation_from_quaternion(state.quaternion, state.rotation)
        # a vehicle's rate is that of the first sample, no step has a transition yet
        state.rate_share[0], state.rate_noise[0], state.discretised[0] = 1.0, 1.0, -1.0
        state.time[0] = -np.inf
        state.sensor[:], state.covariance[:] = initial.sensor_state, initial.covariance
        if state.node_top.size:
            reset_transition(state.node_top, state.node_sensor, self.model.block)

    @property
    def size(self) -> int:
        """States s."""
        return len(self.state.covariance)

    @property
    def width(self) -> int:
        """States of the largest block w."""
        return int(self.model.drift.shape[1])

    @property
    def nodes_made(self) -> int:
        """Nodes since the start."""
        return int(self.state.nodes[0])

    @property
    def log_likelihood(self) -> float:
        """Of the accepted measurements so far."""
        return float(self.state.log_likelihood[0])

    def copies(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return position, velocity, rotation, sensor states and covariance as they are now."""
        s = self.state
        return (
            s.position.copy(),
            s.velocity.copy(),
            s.rotation.copy(),
            s.sensor.copy(),
            s.covariance.copy(),
        )

    def filter(
        self,
        samples: Samples,
        schedule: Schedule,
        outputs: SampleOutputs,
        aiding: AidingOutputs,
        nodes: NodeOutputs,
    ) -> Filter:
        """Return the filter with what it is to take, and where it is to write."""
        return Filter(
            state=self.state,
            model=self.model,
            rules=self.rules,
            samples=samples,
            schedule=schedule,
            work=Work.of(self.model),
            measurement=Measurement.empty(self.size),
            outputs=outputs,
            aiding=aiding,
            nodes=nodes,
        )

    def advance(
        self, filter_: Filter, begin: int, stop: int, updates: int, closing: bool = False
    ) -> int:
        """Take a stretch of samples; see `run_filter`."""
        return self.kernel(filter_, begin, stop, updates, closing)


def kernel_samples(imu: ImuRecording, white_scale: FloatArray | None) -> Samples:
    """A recording as the kernel wants it."""
    return Samples(
        time=np.ascontiguousarray(imu.time, dtype=np.float64),
        gyro=np.ascontiguousarray(imu.gyro, dtype=np.float64),
        accel=np.ascontiguousarray(imu.accel, dtype=np.float64),
        white_scale=NO_SCALE if white_scale is None else np.ascontiguousarray(white_scale),
    )


def kernel_schedule(schedule: AidingSchedule, states: int) -> Schedule:
    """A sorted schedule as the kernel wants it, after a look at what it refers to.

    Raises NavigationError where a measurement refers to states or matrices that do not exist.
    """
    check_references(schedule, states)
    matrices = schedule.matrices if schedule.matrices.size else np.zeros((1, 3, 12 + states))
    return Schedule(rows=schedule.table(), matrices=np.ascontiguousarray(matrices))


def check_references(schedule: AidingSchedule, states: int) -> None:
    """Raise where measurements refer to what does not exist; the kernel does not look."""
    from schuler.errors import NavigationError

    linear = (schedule.kind == LINEAR) | (schedule.kind == GENERAL)
    if np.any(linear):
        count, _, width = schedule.matrices.shape
        if width != 12 + states:
            raise NavigationError(
                f"linear measurements of {width - 12} sensor states, the model has {states}",
                expected="a column for every sensor state",
            )
        if np.any((schedule.matrix[linear] < 0) | (schedule.matrix[linear] >= count)):
            raise NavigationError("a linear measurement refers to no matrix")
    if np.any(schedule.offset_state >= states):
        raise NavigationError(
            f"a measurement refers to sensor state {int(schedule.offset_state.max())}, "
            f"the model has {states}"
        )
