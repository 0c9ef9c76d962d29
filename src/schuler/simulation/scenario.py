"""A whole drive out of one description: motion, IMU or array, receiver, faults, and the truth.

Everything random comes from one seed; motion, shaking, IMU and receiver have a child each, so that
another receiver does not change what the IMU recorded. The description and what was done are
plain values, to be written beside the recordings.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from schuler.data import GnssRecording, ImuRecording, Trajectory
from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.simulation.array import simulate_array
from schuler.simulation.effects import TemperatureDrift, warm_up
from schuler.simulation.faults import Fault, inject_faults
from schuler.simulation.gnss_faults import FixFault, inject_fix_faults
from schuler.simulation.imu import TriadErrors, ideal_imu, simulate_imu
from schuler.simulation.motions.cars import car_mixed, car_urban
from schuler.simulation.motions.flying import drone
from schuler.simulation.motions.profile import Profile, static
from schuler.simulation.motions.riding import motorcycle
from schuler.simulation.motions.skiing import ski
from schuler.simulation.motions.walking import walk
from schuler.simulation.receivers import GnssGrade, simulate_receiver
from schuler.simulation.shaking import shaken
from schuler.simulation.stamps import StampErrors, restamp
from schuler.types import FloatArray

if TYPE_CHECKING:
    from schuler.noise.noise_model import NoiseModel


SKI_RUN = 60.0
"""Seconds of a ski run; what is longer is spent standing at the start."""


def _ski(duration: float, rng: np.random.Generator) -> Profile:
    return ski(max(duration - SKI_RUN, 10.0), min(SKI_RUN, duration - 10.0), rng)


MOTIONS: dict[str, tuple[float, Callable[[float, np.random.Generator], Profile]]] = {
    "static": (600.0, lambda duration, _: static(duration)),
    "car_urban": (1038.0, car_urban),
    "car_mixed": (903.0, car_mixed),
    "motorcycle": (600.0, motorcycle),
    "ski": (210.0, _ski),
    "walk": (600.0, walk),
    "drone": (300.0, drone),
}
"""Usual duration in s, and what makes the motion, by name."""


@dataclass(frozen=True, slots=True, eq=False)
class SensorFaults:
    """What is wrong with every triad besides its noise, drawn anew for each IMU."""

    scale_factor: float = 0.0  # standard deviation of the scale factors (1e-3: 1000 ppm)
    misalignment: float = 0.0  # of each angle between an axis and where it should be, rad
    # of each term that the gyros show of the specific force, rad/s per m/s²
    g_sensitivity: float = 0.0
    # gyro_range, accel_range: largest magnitude delivered, rad/s and m/s²
    gyro_range: float = float("inf")
    accel_range: float = float("inf")
    # gyro_step, accel_step: rounding, rad/s and m/s²; zero: none.
    gyro_step: float = 0.0
    accel_step: float = 0.0
    warming: float = 0.0  # kelvin by which the device warms up, with a time constant of ten minutes
    # gyro_drift, accel_drift: standard deviation of the change of bias a kelvin, rad/s and m/s²
    gyro_drift: float = 2e-5
    accel_drift: float = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class Scenario:
    """What is to be simulated.

    Parameters
    ----------
    motion : str
        Out of `MOTIONS`, or a name for `profile`.
    noise_model : NoiseModel or None
        Of every IMU; None: ideal sensors.
    receiver : GnssGrade
        Of GNSS.
    duration : float or None
        Seconds; None: the usual one of the motion.
    profile : Profile or None
        A motion of its own.
    rate : float
        Of the IMU, Hz.
    mounting : (3, 3) ndarray
        Vehicle (forward, right, down) from IMU.
    lever_arm : (3,) ndarray
        Antenna from IMU, in the axes of the IMU, m.
    vibration : float
        Level of what shakes the vehicle; see `shaken`.
    sensor : SensorFaults
        Besides the noise.
    stamps : StampErrors
        Of the IMU's clock and log.
    array_rotations, array_positions : (k, 3, 3) and (k, 3) ndarray or None
        Several IMUs in the body that `mounting` mounts; None: one.
    gnss_rate : float
        Hz.
    latency, velocity_latency : float
        By which stamps are later than what they belong to, s.
    claimed_scale : float
        Claimed over real standard deviations of GNSS.
    outages : tuple of (float, float)
        Start and length without GNSS, s.
    outlier_rate, outlier_size : float
        Share of fixes that are off, and by how much, m.
    velocity : bool
        Whether the receiver gives velocities.
    faults : tuple of Fault
        Of the (first) IMU.
    fix_faults : tuple of FixFault
        Of GNSS.

    Examples
    --------
    >>> from schuler import NoiseModel, Scenario, WhiteNoise
    >>> from schuler.simulation import RTK_FIXED
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> Scenario("car_urban", model, RTK_FIXED, duration=60.0).rate
    100.0
    """

    motion: str
    noise_model: NoiseModel | None
    receiver: GnssGrade
    duration: float | None = None
    profile: Profile | None = None
    rate: float = 100.0
    mounting: FloatArray = field(default_factory=lambda: np.eye(3))
    lever_arm: FloatArray = field(default_factory=lambda: np.zeros(3))
    vibration: float = 0.0
    sensor: SensorFaults = field(default_factory=SensorFaults)
    stamps: StampErrors = field(default_factory=StampErrors)
    array_rotations: FloatArray | None = None
    array_positions: FloatArray | None = None
    gnss_rate: float = 1.0
    latency: float = 0.0
    velocity_latency: float = 0.0
    claimed_scale: float = 1.0
    outages: tuple[tuple[float, float], ...] = ()
    outlier_rate: float = 0.0
    outlier_size: float = 50.0
    velocity: bool = True
    faults: tuple[Fault, ...] = ()
    fix_faults: tuple[FixFault, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class SimulatedDrive(Exportable):
    """What was recorded, and what really happened.

    Parameters
    ----------
    imus : tuple of ImuRecording
        One, or those of an array.
    gnss : GnssRecording
        Of the antenna.
    truth : Trajectory
        Of the IMU (of the centre of an array, in the axes of the body it sits on), at the true
        times of the samples.
    log : dict
        What was drawn and what was done, plain values.

    Examples
    --------
    >>> from schuler import NoiseModel, Scenario, WhiteNoise, simulate_drive
    >>> from schuler.simulation import RTK_FIXED
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> made = simulate_drive(Scenario("car_urban", model, RTK_FIXED, duration=120.0), seed=1)
    >>> made.truth.position.shape[1]
    3
    """

    imus: tuple[ImuRecording, ...]
    gnss: GnssRecording
    truth: Trajectory
    log: dict[str, Any]


def simulate_drive(scenario: Scenario, seed: int) -> SimulatedDrive:
    """Simulate a drive from a description.

    Parameters
    ----------
    scenario : Scenario
        The description.
    seed : int
        Of everything random; the same seed gives the same arrays on any machine.

    Returns
    -------
    SimulatedDrive
        Recordings and truth.

    Raises
    ------
    InputError
        An unknown motion, or numbers that cannot be.

    Examples
    --------
    >>> from schuler import NoiseModel, Scenario, WhiteNoise, simulate_drive
    >>> from schuler.simulation import RTK_FIXED
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> made = simulate_drive(Scenario("car_urban", model, RTK_FIXED, duration=120.0), seed=1)
    >>> made.imus[0].size, made.gnss.size
    (12000, 121)
    """
    motion_rng, shake_rng, imu_rng, gnss_rng, sensor_rng, stamp_rng = np.random.default_rng(
        seed
    ).spawn(6)
    profile = scenario.profile or _motion(scenario, motion_rng)
    ideal = ideal_imu(profile, scenario.rate)
    moved = shaken(ideal, profile, scenario.motion, scenario.vibration, shake_rng)
    log: dict[str, Any] = {"duration_s": profile.duration}
    imus = _imus(scenario, profile, moved, imu_rng, sensor_rng, log)
    children = stamp_rng.spawn(len(imus))
    if scenario.stamps != StampErrors():
        imus = tuple(restamp(i, scenario.stamps, c) for i, c in zip(imus, children, strict=True))
    first, entries = inject_faults(imus[0], scenario.faults)
    imus = (first, *imus[1:])
    gnss = simulate_receiver(
        profile,
        scenario.receiver,
        scenario.gnss_rate,
        rng=gnss_rng,
        lever_arm=scenario.mounting @ scenario.lever_arm,
        latency=scenario.latency,
        velocity_latency=scenario.velocity_latency,
        claimed_scale=scenario.claimed_scale,
        outages=scenario.outages,
        outlier_rate=scenario.outlier_rate,
        outlier_size=scenario.outlier_size,
        velocity=scenario.velocity,
    )
    gnss, fixes = inject_fix_faults(gnss, scenario.fix_faults)
    log["faults"] = [entry.text for entry in entries] + list(fixes)
    truth = profile.trajectory(ideal.time)
    truth = replace(truth, rotation=truth.rotation @ scenario.mounting)
    speed = np.linalg.norm(truth.velocity, axis=1)
    log["distance_m"] = float(np.sum(0.5 * (speed[1:] + speed[:-1]) * np.diff(truth.time)))
    log["highest_speed_m_s"] = float(speed.max())
    return SimulatedDrive(imus, gnss, truth, log)


def _motion(scenario: Scenario, rng: np.random.Generator) -> Profile:
    if scenario.motion not in MOTIONS:
        raise InputError(f"no motion '{scenario.motion}'", expected=f"one of {', '.join(MOTIONS)}")
    usual, make = MOTIONS[scenario.motion]
    duration = usual if scenario.duration is None else scenario.duration
    if not 1.0 <= duration <= 1e6:
        raise InputError(f"a duration of {duration:g} s", expected="between 1 and 1e6 s")
    return make(duration, rng)


def _imus(
    scenario: Scenario,
    profile: Profile,
    moved: ImuRecording,
    rng: np.random.Generator,
    sensor_rng: np.random.Generator,
    log: dict[str, Any],
) -> tuple[ImuRecording, ...]:
    """Record the motion of the vehicle with one IMU or several."""
    count = 1 if scenario.array_rotations is None else len(scenario.array_rotations)
    drawn = [_draw(scenario.sensor, child) for child in sensor_rng.spawn(count)]
    log["sensors"] = [_described(d) for d in drawn]
    # row vectors: C_sb v is v C_bs
    seen = replace(
        moved, gyro=moved.gyro @ scenario.mounting, accel=moved.accel @ scenario.mounting
    )
    if scenario.sensor.warming:
        seen = replace(seen, temperature=warm_up(seen.time, rise=scenario.sensor.warming))
    if scenario.array_rotations is not None:
        assert scenario.array_positions is not None
        if scenario.sensor.warming or scenario.sensor.g_sensitivity:
            raise InputError(
                "temperature or g-sensitivity of an array", expected="one IMU for these effects"
            )
        return simulate_array(
            profile,
            scenario.array_rotations,
            scenario.array_positions,
            scenario.noise_model,
            scenario.rate,
            rng,
            gyro_errors=[d.gyro for d in drawn],
            accel_errors=[d.accel for d in drawn],
            motion=seen,
            body=scenario.mounting,
        )
    errors = drawn[0]
    return (
        simulate_imu(
            seen,
            scenario.noise_model,
            rng,
            gyro_errors=errors.gyro,
            accel_errors=errors.accel,
            g_sensitivity=errors.g_sensitivity,
            temperature_drift=errors.drift if scenario.sensor.warming else None,
            name="simulated IMU",
        ),
    )


@dataclass(frozen=True, slots=True, eq=False)
class _Drawn:
    """Errors of one IMU."""

    gyro: TriadErrors
    accel: TriadErrors
    g_sensitivity: FloatArray
    drift: TemperatureDrift


def _draw(sensor: SensorFaults, rng: np.random.Generator) -> _Drawn:
    def matrix() -> FloatArray:
        values = sensor.misalignment * rng.standard_normal((3, 3))
        np.fill_diagonal(values, sensor.scale_factor * rng.standard_normal(3))
        return np.asarray(values)

    gyro, accel = matrix(), matrix()
    warm = 1.0 if sensor.warming else 0.0
    return _Drawn(
        TriadErrors(matrix=gyro, saturation=sensor.gyro_range, quantization_step=sensor.gyro_step),
        TriadErrors(
            matrix=accel, saturation=sensor.accel_range, quantization_step=sensor.accel_step
        ),
        sensor.g_sensitivity * rng.standard_normal((3, 3)),
        TemperatureDrift(
            gyro_linear=warm * sensor.gyro_drift * rng.standard_normal(3),
            accel_linear=warm * sensor.accel_drift * rng.standard_normal(3),
        ),
    )


def _described(drawn: _Drawn) -> dict[str, Any]:
    """What was drawn, without what is zero."""
    values = {
        "gyro_matrix": drawn.gyro.matrix,
        "accel_matrix": drawn.accel.matrix,
        "g_sensitivity": drawn.g_sensitivity,
        "gyro_drift_rad_s_per_kelvin": drawn.drift.gyro_linear,
        "accel_drift_m_s2_per_kelvin": drawn.drift.accel_linear,
    }
    return {name: np.asarray(v).tolist() for name, v in values.items() if np.any(v)}
