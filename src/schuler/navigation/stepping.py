"""One door to the filter kernel: a filter in a flat memory, and a stretch of samples through it.

Batch, streaming and the smoother that recomputes what was not stored differ in how they cut a
recording into stretches, and in nothing else.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from schuler.navigation.aiding.schedule import GENERAL, LINEAR, AidingSchedule
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.outputs import AidingOutputs, NodeOutputs, SampleOutputs
from schuler.types import FloatArray, IntArray

# steps longer than this are integrated in pieces (s)
LONGEST_STEP = 0.05
# refusals in a row of one kind before the gate lets the next one in
PATIENCE = 4
# a wheeled vehicle faster than this shows its mounting; one slower than this may stand (m/s)
ROLLING = 1.0
STANDING = 0.2

NO_SCALE = np.empty((0, 6))


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
    """

    position: FloatArray
    velocity: FloatArray
    rotation: FloatArray
    sensor_state: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class VehicleStates:
    """Where the filter finds what it knows of the vehicle.

    Parameters
    ----------
    first : int
        Place of the first of the vehicle's states among the sensor states; -1: there are none.
    mounting : (3, 3) ndarray
        Vehicle (forward, right, down) from IMU, before the estimated correction.
    """

    first: int
    mounting: FloatArray


NO_VEHICLE = VehicleStates(-1, np.eye(3))


class FilterStepper:
    """A filter between two samples: its memory, and what it needs to go on.

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

    __slots__ = (
        "_after",
        "_kernel",
        "_model",
        "counters",
        "memory",
        "node_interval",
        "scratch",
        "size",
        "width",
    )

    def __init__(
        self,
        initial: InitialState,
        model: SensorErrorModel,
        *,
        gate: FloatArray,
        robustness: FloatArray | None = None,
        vehicle: VehicleStates = NO_VEHICLE,
        node_interval: float = 0.25,
        accumulating: bool = False,
    ) -> None:
        from schuler.kernels import memory as places
        from schuler.kernels.filter import run_filter
        from schuler.kernels.strapdown import rotation_from_quaternion
        from schuler.kernels.transition import reset_transition
        from schuler.rotations import quaternion_from_dcm

        # a type checker counts every tuple as one argument at least
        self._kernel: Callable[..., int] = run_filter
        layout = model.layout()
        m, widest = model.size, layout.drift.shape[1]
        self.size, self.width = 9 + m, widest
        self.node_interval = node_interval
        self.memory = np.zeros(places.memory_size(m, widest, accumulating))
        self.scratch = np.zeros(places.scratch_size(m, widest))
        self.counters = np.zeros(places.COUNTERS + m, dtype=np.int64)
        position, velocity, quaternion, rotation, *_, habits = places.carve_navigation(self.memory)
        position[:], velocity[:] = initial.position, initial.velocity
        quaternion[:] = quaternion_from_dcm(initial.rotation)
        rotation_from_quaternion(quaternion, rotation)
        # a vehicle's rate is that of the first sample, no step has a transition yet
        habits[6:9] = 1.0, 1.0, -1.0
        habits[10] = -np.inf
        sensor, *_, covariance = places.carve_sensors(self.memory, m, widest)
        sensor[:], covariance[:] = initial.sensor_state, initial.covariance
        if accumulating:
            reset_transition(*places.carve_total(self.memory, m, widest), layout.block)
        self._model: tuple[Any, ...] = (
            layout.channel,
            layout.direction,
            layout.scaled_by,
            layout.block,
            layout.interval,
            layout.drift,
            layout.diffusion,
            model.white_covariance,
        )
        self._after: tuple[Any, ...] = (
            np.ascontiguousarray(gate),
            np.zeros(9) if robustness is None else np.ascontiguousarray(robustness),
            PATIENCE,
            LONGEST_STEP,
            vehicle.first,
            np.ascontiguousarray(vehicle.mounting),
            ROLLING,
            STANDING,
        )

    @property
    def block(self) -> IntArray:
        """Blocks of the sensor states, see kernels/transition.py."""
        block: IntArray = self._model[3]
        return block

    @property
    def samples_taken(self) -> int:
        """Samples since the start."""
        return int(self.counters[0])

    @property
    def nodes_made(self) -> int:
        """Nodes since the start."""
        return int(self.counters[2])

    @property
    def time(self) -> float:
        """Time of the last sample, s; minus infinity before the first."""
        return float(self.memory[72])

    @property
    def log_likelihood(self) -> float:
        """Of the accepted measurements so far."""
        return float(self.memory[71])

    def views(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return the state as it is in memory.

        Returns
        -------
        tuple of ndarray
            Position (3,), velocity (3,), rotation (3, 3), sensor states (m,) and covariance
            (s, s); they change with the next sample.
        """
        m, s = self.size - 9, self.size
        first = 80 + m + 4 * m * self.width
        return (
            self.memory[0:3],
            self.memory[3:6],
            self.memory[10:19].reshape(3, 3),
            self.memory[80 : 80 + m],
            self.memory[first : first + s * s].reshape(s, s),
        )

    def tail(
        self,
        measurements: tuple[Any, ...],
        samples: tuple[FloatArray, ...],
        aiding: tuple[Any, ...],
        nodes: tuple[Any, ...],
    ) -> tuple[Any, ...]:
        """Return what `advance` passes on behind the samples; the same for many stretches.

        Parameters
        ----------
        measurements : tuple
            From `measurement_arrays`.
        samples, aiding, nodes : tuple of ndarray
            From `sample_arrays`, `aiding_arrays` and `node_arrays`.

        Returns
        -------
        tuple
            In the order of the kernel.
        """
        return (
            *self._model,
            *measurements,
            *self._after,
            *samples,
            *aiding,
            self.node_interval,
            *nodes,
        )

    def advance(
        self,
        time: FloatArray,
        gyro: FloatArray,
        accel: FloatArray,
        white_scale: FloatArray,
        closing: bool,
        tail: tuple[Any, ...],
        out_first: int = 0,
    ) -> int:
        """Take a stretch of samples; see `kernels.filter.run_filter`.

        Parameters
        ----------
        time, gyro, accel : ndarray
            (n,), (n, 3) and (n, 3); at least two samples at the start.
        white_scale : (n, 6) or (0, 6) ndarray
            Factors on the squared noise densities.
        closing : bool
            Whether the last sample makes a node.
        tail : tuple
            From `tail`.
        out_first : int
            Row of the sample outputs that the first sample is written to.

        Returns
        -------
        int
            Sample of the stretch at which the state was no longer finite, or -1.
        """
        return self._kernel(
            self.memory,
            self.counters,
            self.scratch,
            time,
            gyro,
            accel,
            white_scale,
            closing,
            out_first,
            *tail,
        )


def measurement_arrays(schedule: AidingSchedule, states: int) -> tuple[Any, ...]:
    """Return what the kernel takes of a schedule, after a look at what it refers to.

    Parameters
    ----------
    schedule : AidingSchedule
        Sorted.
    states : int
        Number of sensor states m.

    Returns
    -------
    tuple
        Number of measurements, then arrays.

    Raises
    ------
    NavigationError
        A measurement refers to states or matrices that do not exist.
    """
    check_references(schedule, states)
    return (
        schedule.size,
        schedule.time,
        schedule.kind,
        schedule.value,
        schedule.variance,
        schedule.lever_arm,
        schedule.offset_state,
        schedule.matrix,
        schedule.matrices if schedule.matrices.size else np.zeros((1, 3, 12 + states)),
    )


def check_references(schedule: AidingSchedule, states: int) -> None:
    """Raise where measurements refer to what does not exist; the kernel does not look.

    Parameters
    ----------
    schedule : AidingSchedule
        Measurements.
    states : int
        Number of sensor states m.

    Raises
    ------
    NavigationError
        A state or matrix that is not there.
    """
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


def sample_arrays(samples: SampleOutputs) -> tuple[FloatArray, ...]:
    """Fields of sample outputs in the order of the kernel."""
    return (
        samples.position,
        samples.velocity,
        samples.rotation,
        samples.position_covariance,
        samples.velocity_sd,
        samples.attitude_sd,
    )


def aiding_arrays(aiding: AidingOutputs) -> tuple[Any, ...]:
    """Fields of aiding outputs in the order of the kernel."""
    return (
        aiding.residual,
        aiding.deviation,
        aiding.nis,
        aiding.degrees,
        aiding.accepted,
        aiding.scalar,
        aiding.row,
        aiding.gain,
    )


def node_arrays(nodes: NodeOutputs) -> tuple[Any, ...]:
    """Fields of node outputs in the order of the kernel."""
    return (
        nodes.time,
        nodes.sensor_state,
        nodes.sensor_sd,
        nodes.covariance,
        nodes.top,
        nodes.transition,
        nodes.error,
        nodes.aid,
    )
