"""One run of filter and smoother with everything known, and the solutions it leaves."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from schuler.data import (
    GnssRecording,
    ImuRecording,
    Innovations,
    NavigationSolution,
    Trajectory,
)
from schuler.navigation.aiding.gnss import GnssErrorModel
from schuler.navigation.aiding.schedule import (
    GENERAL,
    KIND_NAMES,
    VEHICLE_VELOCITY,
    VELOCITY,
    WHEEL_SPEED_NAME,
    AidingSchedule,
    merge_schedules,
)
from schuler.navigation.aiding.wheel import find_wheel_speeds
from schuler.navigation.engine import FilterRun, SampleOutputs, gate_thresholds
from schuler.navigation.error_models.catalogue import ErrorModel
from schuler.navigation.lagged import smooth_run_with_lag
from schuler.navigation.parameter_uncertainty import missing_covariance, with_arm_uncertainty
from schuler.navigation.preparation.mounting import estimate_mounting
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.run_findings import causes, findings_of_run
from schuler.navigation.segments import RunSegment, run_in_segments, split_at_restarts
from schuler.navigation.smoother import SmoothedRun, smooth_run
from schuler.screening.screen import Finding
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class NavigationRun:
    """A causal solution, its smoothed twins if asked for, and the setup of all."""

    causal: NavigationSolution  # of the filter
    smoothed: NavigationSolution | None  # by the whole recording
    setup: RunSetup  # of all
    filter: FilterRun  # what the filter left behind
    lagged: NavigationSolution | None = None  # by measurements up to a fixed lag after each sample


def run_error_model(
    model: ErrorModel,
    measured: ImuRecording,
    prepared: ImuRecording,
    gnss: GnssRecording,
    setup: RunSetup,
    *,
    smooth: bool = False,
    lag: float | None = None,
) -> NavigationRun:
    """Run with an error model of the catalogue, on a drive that was prepared with another.

    `measured` is the whole recording as the model wants it; what preparation cut off is cut off.
    """
    if measured.time[0] != prepared.time[0]:
        measured = measured.between(float(prepared.time[0]), np.inf)
    imu = prepared if model.denoising is None else measured
    told = setup.settings
    sensors = model.sensor_model(told.turn_on_accel, told.turn_on_gyro, 1.0 / prepared.rate)
    scale = model.white_scale(prepared)
    scale = None if scale is None else scale[: imu.size]
    done = run(imu, gnss, setup.with_sensors(sensors), smooth=smooth, lag=lag, white_scale=scale)
    for solution in (done.causal, done.smoothed, done.lagged):
        if solution is not None:
            solution.settings["error_model"] = model.to_dict()
    return done


def run(
    imu: ImuRecording,
    gnss: GnssRecording,
    setup: RunSetup,
    *,
    smooth: bool = False,
    lag: float | None = None,
    keep_nodes: bool = False,
    white_scale: FloatArray | None = None,
) -> NavigationRun:
    """Filter, and smooth, with everything known."""
    scale = setup.white_scale(imu) if white_scale is None else white_scale
    initial, restarts = setup.initial_state(imu, gnss), setup.restarts(gnss)
    schedule, wheel = setup.schedule(imu, gnss), dict[str, Any]()
    if setup.vehicle is not None and "wheel" in setup.vehicle.constraints:
        parts = split_at_restarts(imu, initial, restarts, schedule, scale)
        schedule, wheel = _with_wheel_speeds(imu, parts, schedule, setup)
    result = run_in_segments(
        imu,
        initial,
        restarts,
        setup.model,
        schedule,
        gate=gate_thresholds(setup.settings.false_alarm),
        robustness=setup.measurements.weighting.array(),
        white_scale=scale,
        vehicle=setup.vehicle_states,
        keep_nodes=keep_nodes or smooth or lag is not None,
        smoother_memory=setup.settings.smoother_memory,
        stretches=setup.stretches,
    )
    innovations = _innovations(schedule, result)
    seen = causes(innovations, imu.time, result.samples)
    settings = setup.to_dict() | wheel | run_record(imu, gnss, setup, innovations, seen)
    causal = _solution(imu, setup, result, innovations, settings)

    def smoothed_solution(back: SmoothedRun, how: dict[str, Any]) -> NavigationSolution:
        told = settings | {"smoother_bytes": result.smoother_bytes} | how
        return _solution(imu, setup, result, innovations, told, back)

    smoothed, lagged = None, None
    if smooth:
        slow = setup.measurements.correlated
        place = slow.place if isinstance(slow, GnssErrorModel) else -1
        back = smooth_run(result, setup.model, imu.time, place)
        causal = replace(causal, gnss_error_covariance=back.lasting_before)
        smoothed = smoothed_solution(back, {"smoothing": "fixed interval"})
    missing = missing_covariance(imu, gnss, setup, smooth=smooth)
    if missing is not None:
        causal = missing[0].added(causal)
        smoothed = missing[1].added(smoothed) if smoothed and missing[1] else smoothed
    if lag is not None:
        back = smooth_run_with_lag(result, setup.model, imu.time, lag)
        lagged = smoothed_solution(back, {"smoothing": "fixed lag", "lag_s": lag})
        lagged = missing[0].added(lagged) if missing is not None else lagged
    arm = setup.arm_covariance
    if arm is None and (off := [f.value for f in seen if f.kind == "lever arm" and f.value]):
        # who told the arm keeps it, but not the claim that it is right
        arm = np.eye(3) * off[0] ** 2 / 3.0
    causal = with_arm_uncertainty(causal, arm)
    smoothed = smoothed and with_arm_uncertainty(smoothed, arm)
    lagged = lagged and with_arm_uncertainty(lagged, arm)
    return NavigationRun(causal, smoothed, setup, result, lagged)


def _with_wheel_speeds(
    imu: ImuRecording, parts: list[RunSegment], schedule: AidingSchedule, setup: RunSetup
) -> tuple[AidingSchedule, dict[str, Any]]:
    """Add the speeds that a first run of the filter finds in the vibration of the wheels."""
    gate = gate_thresholds(setup.settings.false_alarm)
    found = [
        find_wheel_speeds(part, setup.model, setup.vehicle_states, gate=gate) for part in parts
    ]
    rows = [schedule, *(speeds.rows() for speeds in found)]
    merged = merge_schedules(rows, float(imu.time[0]), float(imu.time[-1]))
    return merged, {
        "wheel_turns_per_metre": found[0].order,
        "wheel_speeds": sum(speeds.time.size for speeds in found),
    }


def run_record(
    imu: ImuRecording,
    gnss: GnssRecording,
    setup: RunSetup,
    innovations: Innovations,
    seen: tuple[Finding, ...] = (),
) -> dict[str, Any]:
    """What a run says of itself; `seen`: what its innovations depend on."""
    split = setup.measurements.correlated is not None
    findings = (*setup.condition.findings, *findings_of_run(innovations, split=split), *seen)
    return {
        "imu": imu.name,
        "gnss": gnss.name,
        "gnss_epochs_used": gnss.size,
        "gate_false_alarm": setup.settings.false_alarm,
        "nis_over_degrees": innovations.gnss.mean_nis,
        "updates_refused": int((~innovations.accepted & (innovations.degrees > 0)).sum()),
        "findings": [f.to_dict() for f in findings],
    }


def _innovations(schedule: AidingSchedule, result: FilterRun) -> Innovations:
    """All measurements but the constraints that did not apply where they were due."""
    aiding = result.aiding
    due = (schedule.kind <= VELOCITY) | (aiding.degrees > 0)
    return Innovations(
        time=schedule.time[due],
        kind=tuple(_name(schedule, u) for u in np.flatnonzero(due).tolist()),
        value=aiding.residual[due],
        sd=aiding.deviation[due],
        nis=aiding.nis[due],
        degrees=aiding.degrees[due],
        accepted=aiding.accepted[due],
    )


def _name(schedule: AidingSchedule, u: int) -> str:
    """Of the kind of a measurement, for people."""
    kind = int(schedule.kind[u])
    if kind == VEHICLE_VELOCITY and np.isfinite(schedule.variance[u, 0]):
        return WHEEL_SPEED_NAME
    row = schedule.general[int(schedule.matrix[u])] if kind == GENERAL else None
    return KIND_NAMES[kind] if row is None else row.name


def _solution(
    imu: ImuRecording,
    setup: RunSetup,
    result: FilterRun,
    innovations: Innovations,
    settings: dict[str, Any],
    back: SmoothedRun | None = None,
) -> NavigationSolution:
    """The causal solution of a run, or the smoothed one."""
    samples: SampleOutputs = result.samples if back is None else back.samples
    sensors = result.nodes if back is None else back
    trajectory = Trajectory(
        time=imu.time,
        position=samples.position,
        velocity=samples.velocity,
        rotation=samples.rotation,
    )
    mount = estimate_mounting(trajectory)
    found: dict[str, Any] = {"smoothed": back is not None}
    if mount is not None:
        found["mounting_deg"] = np.degrees(mount.angles).tolist()
        found["mounting_sd_deg"] = np.degrees(mount.sd).tolist()
    return NavigationSolution(
        trajectory=trajectory,
        position_covariance=samples.position_covariance,
        velocity_sd=samples.velocity_sd,
        attitude_sd=samples.attitude_sd,
        sensor_error_time=result.nodes.time,
        sensor_errors=sensors.sensor_state,
        sensor_errors_sd=sensors.sensor_sd,
        sensor_error_names=setup.model.names,
        innovations=innovations,
        settings=settings | found,
        smoothed=back is not None,
        log_likelihood=result.log_likelihood,
        gnss_error_covariance=None if back is None else back.lasting,
    )
