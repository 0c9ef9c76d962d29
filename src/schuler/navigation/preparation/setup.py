"""What has to be known before a filter can run: offsets of time, noise, the start.

Gathered in one frozen record, so that a run can be repeated exactly and a report can show it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from schuler.data import GnssRecording, ImuRecording
from schuler.navigation.aiding.gnss import GnssErrorModel, GnssPosition, GnssVelocity
from schuler.navigation.aiding.options import WHITE_ERRORS, MeasurementOptions
from schuler.navigation.aiding.schedule import (
    Aiding,
    AidingSchedule,
    for_states,
    merge_schedules,
)
from schuler.navigation.aiding.vehicle import VehicleConstraint, with_vehicle_states
from schuler.navigation.error_models.sensor_states import FILTER_CHANNELS, SensorErrorModel
from schuler.navigation.preparation.alignment import Alignment
from schuler.navigation.preparation.gaps import SOUND, DriveCondition
from schuler.navigation.settings import NavigationSettings
from schuler.navigation.stepping import NO_VEHICLE, InitialState, SensorStretches, VehicleStates
from schuler.navigation.tuning.vibration import VibrationResponse, vibration_level
from schuler.screening.screen import Finding
from schuler.types import FloatArray

CONSTANT_NOISE = VibrationResponse()
LONGEST = 2.0
"""Nepers, exponents or units of offsets by which parameters are moved: a normal law ends there."""


@dataclass(frozen=True, slots=True)
class TimeOffsets:
    """Seconds added to GNSS time to put position and velocity on the IMU's axis.

    Receivers filter velocity more than position, so the two may differ; a positive value means
    that the IMU's stamps are late.
    """

    position: float = 0.0
    velocity: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class NoiseFactors:
    """Multiples of a base model that a drive was found to need."""

    white: FloatArray  # (6,): on the white-noise densities, accelerometer x, y, z, gyro x, y, z
    # drive_accel, drive_gyro: on the standard deviation of the noise that drives the sensor error
    # states
    drive_accel: float = 1.0
    drive_gyro: float = 1.0
    # position_sd, velocity_sd: on the receiver's standard deviations
    position_sd: float = 1.0
    velocity_sd: float = 1.0

    @classmethod
    def none(cls) -> NoiseFactors:
        """Everything as the models say."""
        return cls(white=np.ones(6))

    def applied(self, model: SensorErrorModel) -> SensorErrorModel:
        """Return a sensor error model multiplied by the factors."""
        by_channel = np.array([self.drive_accel] * 3 + [self.drive_gyro] * 3 + [1.0])
        # states without a channel, -1, keep theirs
        drive = by_channel[model.channel]
        return model.with_noise(self.white, drive)


@dataclass(frozen=True, slots=True, eq=False)
class SensorStart:
    """What is known of the first sensor states at the first sample, instead of the model's word."""

    state: FloatArray  # (p,): estimates, SI
    covariance: FloatArray  # (p, p): of their errors


@dataclass(frozen=True, slots=True, eq=False)
class ParameterSpread:
    """How well parameters of a setup are known that a drive has told."""

    names: tuple[str, ...]  # as in tuning/tune.py
    covariance: FloatArray  # (p, p): in nepers, exponents and units of the search for offsets

    def columns(self) -> list[dict[str, float]]:
        """Return the columns of a square root of the covariance, none longer than allowed."""
        # shares of the receiver's claim are at their prior, or known well; an arm is carried
        # for itself
        kept = [k for k, n in enumerate(self.names) if not n.startswith(("gnss", "arm"))]
        square = self.covariance[np.ix_(kept, kept)]
        values, axes = np.linalg.eigh(square)
        root = axes * np.sqrt(np.maximum(values, 0.0))
        names = [self.names[k] for k in kept]
        root /= np.maximum(np.abs(root).max(axis=0) / LONGEST, 1.0)
        return [dict(zip(names, c.tolist(), strict=True)) for c in root.T]


@dataclass(frozen=True, slots=True, eq=False)
class RunSetup:
    """Everything a run needs besides the recordings."""

    model: SensorErrorModel  # with factors already applied
    factors: NoiseFactors  # for the record, and for the receiver's standard deviations
    offsets: TimeOffsets  # of GNSS
    alignment: Alignment  # attitude at the first sample
    lever_arm: FloatArray  # (3,): antenna from IMU in the body frame, m
    vibration: VibrationResponse = CONSTANT_NOISE  # how the white noise follows vibration
    # what is known of the vehicle; its states are then the last of the model's.
    vehicle: VehicleConstraint | None = None
    # of the first states of the model; None: from model and alignment.
    sensor_start: SensorStart | None = None
    sources: tuple[Aiding, ...] = ()  # measurements besides GNSS and vehicle: parity, for instance
    condition: DriveCondition = SOUND  # what the drive suffers from, and how the filter copes
    # how GNSS is weighted, and other sensors; their states are among the model's.
    measurements: MeasurementOptions = WHITE_ERRORS
    settings: NavigationSettings = field(default_factory=NavigationSettings)  # what the user said
    stretches: SensorStretches | None = None  # where it changes how the sensors of an array show
    spread: ParameterSpread | None = None  # how well the drive tells what was tuned
    # (3, 3): of a lever arm that the drive has told, m²; None: it was told.
    arm_covariance: FloatArray | None = None

    @property
    def vehicle_states(self) -> VehicleStates:
        """Where the filter finds what it knows of the vehicle."""
        return NO_VEHICLE if self.vehicle is None else self.vehicle.states

    def telling(self, *more: Finding) -> RunSetup:
        """Return the same setup with more to say of the drive."""
        findings = (*self.condition.findings, *more)
        return replace(self, condition=replace(self.condition, findings=findings))

    def with_sensors(self, base: SensorErrorModel) -> RunSetup:
        """Return the same setup with other sensors: noise factors, then states of all aiding."""
        # errors of GNSS as the drive has found them, where it was asked already
        told = replace(self.settings.measurements, correlated=self.measurements.correlated)
        model, placed = told.placed(self.factors.applied(base))
        vehicle = self.vehicle
        if vehicle is not None and vehicle.first_state >= 0:
            vehicle = replace(vehicle, first_state=model.size)
            model = with_vehicle_states(model, vehicle.constraints)
        return replace(self, model=model, measurements=placed, vehicle=vehicle)

    def white_scale(self, imu: ImuRecording) -> FloatArray | None:
        """Return what multiplies the squared white-noise densities sample by sample."""
        scale = None
        if self.vibration.active:
            scale = self.vibration.white_scale(vibration_level(imu))
        return self.condition.noise_scale(imu.time, scale, self.model.white_density)

    def aiding(self, imu: ImuRecording, gnss: GnssRecording) -> list[Aiding]:
        """Return all sources of measurements."""
        gnss = self.condition.usable(gnss)
        arm, offsets, factors = self.lever_arm, self.offsets, self.factors
        slow = self.measurements.correlated
        sources: list[Aiding] = [
            GnssPosition(gnss, arm, offsets.position, factors.position_sd, slow),
            GnssVelocity(gnss, arm, offsets.velocity, factors.velocity_sd),
            *self.sources,
            *self.measurements.placed_sources,
        ]
        if self.vehicle is not None:
            sources += self.vehicle.sources(imu, self.model.white_density[3:])
        return sources

    def schedule(self, imu: ImuRecording, gnss: GnssRecording) -> AidingSchedule:
        """Return all measurements that fall inside the IMU's time."""
        rows = [source.rows() for source in self.aiding(imu, gnss)]
        merged = merge_schedules(rows, float(imu.time[0]), float(imu.time[-1]))
        for restart in self.condition.restarts:
            between = (merged.time > restart.begin) & (merged.time < restart.time)
            merged = merged.select(~between)
        return for_states(merged, self.model.size)

    def initial_state(self, imu: ImuRecording, gnss: GnssRecording) -> InitialState:
        """Return the state and covariance at the first sample."""
        return self._state_at(float(imu.time[0]), self.alignment, gnss)

    def restarts(self, gnss: GnssRecording) -> list[tuple[float, InitialState]]:
        """Return where the filter begins anew, and with what."""
        return [
            (r.time, self._state_at(r.time, r.alignment, gnss, anew=r.knocked))
            for r in self.condition.restarts
        ]

    def _state_at(
        self, time: float, start: Alignment, gnss: GnssRecording, *, anew: bool = False
    ) -> InitialState:
        """Position of the nearest fix, the rest from an alignment."""
        gnss, model = self.condition.usable(gnss), self.model
        near = int(np.argmin(np.abs(gnss.time + self.offsets.position - time)))
        away = abs(float(gnss.time[near] + self.offsets.position - time))
        speed = float(np.linalg.norm(start.velocity))
        assert gnss.position_sd is not None
        sd = np.where(np.isfinite(gnss.position_sd[near]), gnss.position_sd[near], 10.0)
        slow = self.measurements.correlated
        if isinstance(slow, GnssErrorModel):
            sd = sd * np.sqrt(max(slow.white + slow.slow, 1.0))
        position_sd = 3.0 * sd + 0.1 + float(np.linalg.norm(self.lever_arm)) + speed * away
        velocity_sd = 0.1 if start.rest is not None else 1.0
        attitude_sd = [start.tilt_sd, start.tilt_sd, start.heading_sd]
        covariance = np.zeros((9 + model.size, 9 + model.size))
        np.fill_diagonal(
            covariance[:9, :9],
            np.concatenate([position_sd, np.full(3, velocity_sd), attitude_sd]) ** 2,
        )
        covariance[9:, 9:] = model.initial_covariance
        state = np.zeros(model.size)
        if self.sensor_start is not None and not anew:
            known = self.sensor_start.state.size
            state[:known] = self.sensor_start.state
            covariance[9 : 9 + known, 9 : 9 + known] = self.sensor_start.covariance
        elif start.gyro_bias_sd is not None:
            for axis in range(3):
                for j in model.constant_states(3 + axis)[:1]:
                    state[j] = start.gyro_bias[axis]
                    covariance[9 + j, 9 + j] = start.gyro_bias_sd**2
        return InitialState(
            position=gnss.position[near].copy(),
            velocity=start.velocity.copy(),
            rotation=start.rotation,
            sensor_state=state,
            covariance=covariance,
            sensors_anew=anew,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for reports and JSON."""
        model, start = self.model, self.alignment
        constant = {c: j[0] for c in range(6) if (j := model.constant_states(c)).size}
        vehicle: dict[str, Any] = {}
        if self.vehicle is not None:
            vehicle = {"aiding": list(self.vehicle.constraints)}
            if self.vehicle.first_state >= 0:
                vehicle |= {
                    "constraint_sd_right_m_s": self.vehicle.lateral_sd,
                    "constraint_sd_down_m_s": self.vehicle.vertical_sd,
                }
        slow = self.measurements.correlated
        errors = {"gnss_errors": "taken for white noise"} if slow is None else slow.to_dict()
        return (
            vehicle
            | errors
            | {
                "time_offset_position_s": self.offsets.position,
                "time_offset_velocity_s": self.offsets.velocity,
                "lever_arm_m": self.lever_arm.tolist(),
                "alignment": start.method,
                "gnss_update": self.measurements.weighting.update,
                "gnss_noise_adapts": self.measurements.weighting.adaptive,
                "initial_heading_sd_deg": float(np.degrees(start.heading_sd)),
                "gnss_position_sd_factor": self.factors.position_sd,
                "gnss_velocity_sd_factor": self.factors.velocity_sd,
                "vibration_exponent_accel": self.vibration.accel,
                "vibration_exponent_gyro": self.vibration.gyro,
                "white_noise_density": dict(
                    zip(FILTER_CHANNELS, model.white_density.tolist(), strict=True)
                ),
                "bias_walk_density": {
                    FILTER_CHANNELS[c]: float(np.sqrt(model.diffusion[j, 0]))
                    for c, j in constant.items()
                },
                "sensor_error_states": list(model.names),
                "left_out": list(model.ignored),
            }
        )
