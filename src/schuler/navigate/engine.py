"""The door to the filter kernel: states and recordings in, stored runs out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.data import ImuRecording
from schuler.errors import NavigationError
from schuler.navigate.aiding import LINEAR, AidingSchedule
from schuler.navigate.sensor_states import SensorErrorModel

FloatArray = NDArray[np.float64]

# steps longer than this are integrated in pieces (s)
LONGEST_STEP = 0.05
# refusals in a row of one kind before the gate lets the next one in
PATIENCE = 4
# a wheeled vehicle faster than this shows its mounting; one slower than this may stand (m/s)
ROLLING = 1.0
STANDING = 0.2


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


@dataclass(frozen=True, slots=True, eq=False)
class SampleOutputs:
    """The filter's state at every IMU sample; arrays with n rows, as in `run_filter`."""

    position: FloatArray
    velocity: FloatArray
    rotation: FloatArray
    position_covariance: FloatArray
    velocity_sd: FloatArray
    attitude_sd: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class AidingOutputs:
    """What happened at every aiding measurement; arrays with u rows, as in `run_filter`."""

    residual: FloatArray
    deviation: FloatArray
    nis: FloatArray
    degrees: NDArray[np.int64]
    accepted: NDArray[np.bool_]
    row: FloatArray
    gain: FloatArray
    scalar: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class NodeOutputs:
    """What the smoother needs; arrays with k rows, as in `run_filter`."""

    time: FloatArray
    sensor_state: FloatArray
    sensor_sd: FloatArray
    covariance: FloatArray
    top: FloatArray
    transition: FloatArray
    error: FloatArray
    aid: NDArray[np.int64]

    @property
    def size(self) -> int:
        """Number of nodes."""
        return int(self.time.size)


@dataclass(frozen=True, slots=True, eq=False)
class FilterRun:
    """Everything that one pass of the filter left behind."""

    samples: SampleOutputs
    aiding: AidingOutputs
    nodes: NodeOutputs
    log_likelihood: float


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
    """
    from scipy.special import gammaincinv

    if false_alarm <= 0.0:
        return np.array([0.0, np.inf, np.inf, np.inf])
    half = np.array([0.5, 1.0, 1.5])
    return np.concatenate([[0.0], 2.0 * gammaincinv(half, 1.0 - false_alarm)])


def run_engine(
    imu: ImuRecording,
    initial: InitialState,
    model: SensorErrorModel,
    schedule: AidingSchedule,
    *,
    gate: FloatArray,
    white_scale: FloatArray | None = None,
    vehicle: VehicleStates = NO_VEHICLE,
    keep_samples: bool = True,
    keep_nodes: bool = True,
    node_interval: float = 0.25,
) -> FilterRun:
    """Run the filter over a recording.

    Parameters
    ----------
    imu : ImuRecording
        All six channels.
    initial : InitialState
        At the first sample.
    model : SensorErrorModel
        Sensor error states and white noise.
    schedule : AidingSchedule
        Sorted measurements inside the time of the IMU.
    gate : (4,) ndarray
        See `gate_thresholds`.
    white_scale : (n, 6) ndarray or None
        Multiplies the squared white-noise densities sample by sample (accelerometers first).
    vehicle : VehicleStates
        Needed where the schedule has constraints of a vehicle.
    keep_samples, keep_nodes : bool
        Whether to store the state at every sample, and what the smoother needs.
    node_interval : float
        Longest time between nodes, s.

    Returns
    -------
    FilterRun
        Outputs; arrays that were not kept have no rows.

    Raises
    ------
    NavigationError
        The state stopped being finite, or a measurement refers to states that do not exist.
    """
    from schuler.kernels.filter import run_filter
    from schuler.rotations import quaternion_from_dcm

    layout = model.layout()
    _check_schedule(schedule, model)
    n, m, u = imu.size, model.size, schedule.size
    s = 9 + m
    rows = n if keep_samples else 0
    samples = SampleOutputs(
        position=np.empty((rows, 3)),
        velocity=np.empty((rows, 3)),
        rotation=np.empty((rows, 3, 3)),
        position_covariance=np.empty((rows, 3, 3)),
        velocity_sd=np.empty((rows, 3)),
        attitude_sd=np.empty((rows, 3)),
    )
    k = u + int(imu.duration / node_interval) + 3
    kept, used = (k, u) if keep_nodes else (0, 0)
    aiding = AidingOutputs(
        residual=np.full((u, 3), np.nan),
        deviation=np.full((u, 3), np.nan),
        nis=np.zeros(u),
        degrees=np.zeros(u, dtype=np.int64),
        accepted=np.zeros(u, dtype=np.bool_),
        row=np.zeros((used, 3, s)),
        gain=np.zeros((used, 3, s)),
        scalar=np.zeros((u, 3, 2)),
    )
    nodes = NodeOutputs(
        time=np.zeros(k),
        sensor_state=np.zeros((k, m)),
        sensor_sd=np.zeros((k, m)),
        covariance=np.empty((kept, s, s)),
        top=np.empty((kept, 9, s)),
        transition=np.empty((kept, m, layout.drift.shape[1])),
        error=np.empty((kept, s)),
        aid=np.zeros((kept, 2), dtype=np.int64),
    )
    likelihood, count, bad = run_filter(
        imu.time,
        imu.gyro,
        imu.accel,
        initial.position.copy(),
        initial.velocity.copy(),
        np.ascontiguousarray(quaternion_from_dcm(initial.rotation)),
        initial.sensor_state.copy(),
        initial.covariance.copy(),
        layout.channel,
        layout.direction,
        layout.scaled_by,
        layout.block,
        layout.interval,
        layout.drift,
        layout.diffusion,
        model.white_covariance,
        np.empty((0, 6)) if white_scale is None else white_scale,
        schedule.time,
        schedule.kind,
        schedule.value,
        schedule.variance,
        schedule.lever_arm,
        schedule.offset_state,
        schedule.matrix,
        schedule.matrices if schedule.matrices.size else np.zeros((1, 3, m)),
        gate,
        PATIENCE,
        LONGEST_STEP,
        samples.position,
        samples.velocity,
        samples.rotation,
        samples.position_covariance,
        samples.velocity_sd,
        samples.attitude_sd,
        aiding.residual,
        aiding.deviation,
        aiding.nis,
        aiding.degrees,
        aiding.accepted,
        node_interval,
        nodes.time,
        nodes.sensor_state,
        nodes.sensor_sd,
        nodes.covariance,
        nodes.top,
        nodes.transition,
        nodes.error,
        nodes.aid,
        aiding.row,
        aiding.gain,
        aiding.scalar,
        vehicle.first,
        np.ascontiguousarray(vehicle.mounting),
        ROLLING,
        STANDING,
    )
    if bad >= 0:
        raise NavigationError(
            f"the navigation state stopped being finite at {imu.time[bad]:.3f} s",
            expected="a bounded trajectory",
            cure="check units and axes of the IMU and the noise model",
            where=imu.name,
        )
    nodes = NodeOutputs(
        **{name: getattr(nodes, name)[:count] for name in NodeOutputs.__dataclass_fields__}
    )
    return FilterRun(samples=samples, aiding=aiding, nodes=nodes, log_likelihood=likelihood)


def _check_schedule(schedule: AidingSchedule, model: SensorErrorModel) -> None:
    """The kernel does not look whether a measurement refers to states that exist."""
    linear = schedule.kind == LINEAR
    if np.any(linear):
        count, _, width = schedule.matrices.shape
        if width != model.size:
            raise NavigationError(
                f"linear measurements of {width} sensor states, the model has {model.size}",
                expected="a column for every sensor state",
            )
        if np.any((schedule.matrix[linear] < 0) | (schedule.matrix[linear] >= count)):
            raise NavigationError("a linear measurement refers to no matrix")
    if np.any(schedule.offset_state >= model.size):
        raise NavigationError(
            f"a measurement refers to sensor state {int(schedule.offset_state.max())}, "
            f"the model has {model.size}"
        )
