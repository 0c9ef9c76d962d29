"""One run of filter and smoother with everything known, and the solutions it leaves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from schuler.data import (
    GnssRecording,
    ImuRecording,
    Innovations,
    NavigationSolution,
    Trajectory,
)
from schuler.navigation.aiding.gnss import (
    KIND_NAMES,
    VEHICLE_VELOCITY,
    VELOCITY,
    WHEEL_SPEED_NAME,
    AidingSchedule,
    merge_schedules,
)
from schuler.navigation.aiding.wheel_speed import find_wheel_speeds
from schuler.navigation.engine import (
    NO_VEHICLE,
    SMOOTHER_MEMORY,
    FilterRun,
    SampleOutputs,
    gate_thresholds,
)
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.lagged import smooth_run_with_lag
from schuler.navigation.preparation.mounting import estimate_mounting
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.run_findings import findings_of_run
from schuler.navigation.segments import pieces_of, run_in_pieces
from schuler.navigation.smoother import SmoothedRun, smooth_run
from schuler.types import FloatArray

# probability of refusing a good measurement
FALSE_ALARM = 1e-6


@dataclass(frozen=True, slots=True, eq=False)
class NavigationRun:
    """A causal solution, its smoothed twins if asked for, and the setup of all.

    Parameters
    ----------
    causal : NavigationSolution
        Of the filter.
    smoothed : NavigationSolution or None
        By the whole recording.
    setup : RunSetup
        Of all.
    lagged : NavigationSolution or None
        By measurements up to a fixed lag after each sample.
    """

    causal: NavigationSolution
    smoothed: NavigationSolution | None
    setup: RunSetup
    lagged: NavigationSolution | None = None


def run(
    imu: ImuRecording,
    gnss: GnssRecording,
    setup: RunSetup,
    *,
    smooth: bool = False,
    lag: float | None = None,
    false_alarm: float = FALSE_ALARM,
    white_scale: FloatArray | None = None,
    smoother_memory: float = SMOOTHER_MEMORY,
) -> NavigationRun:
    """Filter, and smooth, with everything known.

    Parameters
    ----------
    imu : ImuRecording
        From `prepare`.
    gnss : GnssRecording
        Epochs to use.
    setup : RunSetup
        From `prepare`.
    smooth : bool
        Whether to smooth by the whole recording as well.
    lag : float or None
        Seconds of later measurements that a fixed-lag solution may use; None: no such solution.
    false_alarm : float
        Of the innovation gate.
    white_scale : (n, 6) ndarray or None
        See `run_engine`; None: as the setup found the noise to follow vibration.
    smoother_memory : float
        Bytes that may be kept for smoothing, see `run_engine`.

    Returns
    -------
    NavigationRun
        Causal and perhaps smoothed solutions.
    """
    schedule = setup.schedule(imu, gnss)
    initial, gate = setup.initial_state(imu, gnss), gate_thresholds(false_alarm)
    vehicle = NO_VEHICLE if setup.vehicle is None else setup.vehicle.states
    scale = setup.white_scale(imu) if white_scale is None else white_scale
    wheel: dict[str, Any] = {}
    if setup.vehicle is not None and "wheel" in setup.vehicle.constraints:
        heard = [
            find_wheel_speeds(
                piece.imu,
                piece.start,
                setup.model,
                piece.schedule,
                vehicle,
                gate=gate,
                white_scale=piece.white_scale,
            )
            for piece in pieces_of(imu, initial, setup.restarts(gnss), schedule, scale)
        ]
        schedule = merge_schedules(
            [schedule, *(h.rows(setup.model) for h in heard)],
            float(imu.time[0]),
            float(imu.time[-1]),
        )
        wheel = {
            "wheel_turns_per_metre": heard[0].order,
            "wheel_speeds": sum(h.time.size for h in heard),
        }
    result = run_in_pieces(
        imu,
        initial,
        setup.restarts(gnss),
        setup.model,
        schedule,
        gate=gate,
        robustness=setup.measurements.weighting.array(),
        white_scale=scale,
        vehicle=vehicle,
        keep_nodes=smooth or lag is not None,
        smoother_memory=smoother_memory,
    )
    innovations = _innovations(schedule, result)
    settings = (
        setup.to_dict()
        | wheel
        | {
            "imu": imu.name,
            "gnss": gnss.name,
            "gnss_epochs_used": gnss.size,
            "gate_false_alarm": false_alarm,
            "nis_over_degrees": innovations.gnss.mean_nis,
            "updates_refused": int((~result.aiding.accepted & (result.aiding.degrees > 0)).sum()),
            "findings": [
                f.to_dict() for f in (*setup.condition.findings, *findings_of_run(innovations))
            ],
        }
    )
    nodes = result.nodes
    causal = _solution(
        imu,
        result.samples,
        setup.model,
        nodes.time,
        nodes.sensor_state,
        nodes.sensor_sd,
        innovations,
        settings,
        result.log_likelihood,
        smoothed=False,
    )

    def smoothed_solution(back: SmoothedRun, how: dict[str, Any]) -> NavigationSolution:
        return _solution(
            imu,
            back.samples,
            setup.model,
            nodes.time,
            back.sensor_state,
            back.sensor_sd,
            innovations,
            settings | {"smoother_bytes": result.smoother_bytes} | how,
            result.log_likelihood,
            smoothed=True,
        )

    smoothed, lagged = None, None
    if smooth:
        back = smooth_run(result, setup.model, imu.time)
        smoothed = smoothed_solution(back, {"smoothing": "fixed interval"})
    if lag is not None:
        back = smooth_run_with_lag(result, setup.model, imu.time, lag)
        lagged = smoothed_solution(back, {"smoothing": "fixed lag", "lag_s": lag})
    return NavigationRun(causal=causal, smoothed=smoothed, setup=setup, lagged=lagged)


def _innovations(schedule: AidingSchedule, result: FilterRun) -> Innovations:
    """All measurements but the constraints that did not apply where they were due."""
    aiding = result.aiding
    due = (schedule.kind <= VELOCITY) | (aiding.degrees > 0)
    ahead = (schedule.kind == VEHICLE_VELOCITY) & np.isfinite(schedule.variance[:, 0])
    return Innovations(
        time=schedule.time[due],
        kind=tuple(
            WHEEL_SPEED_NAME if wheel else KIND_NAMES[k]
            for k, wheel in zip(schedule.kind[due], ahead[due], strict=True)
        ),
        value=aiding.residual[due],
        sd=aiding.deviation[due],
        nis=aiding.nis[due],
        degrees=aiding.degrees[due],
        accepted=aiding.accepted[due],
    )


def _solution(
    imu: ImuRecording,
    samples: SampleOutputs,
    model: SensorErrorModel,
    node_time: FloatArray,
    sensor_state: FloatArray,
    sensor_sd: FloatArray,
    innovations: Innovations,
    settings: dict[str, Any],
    likelihood: float,
    *,
    smoothed: bool,
) -> NavigationSolution:
    trajectory = Trajectory(
        time=imu.time,
        position=samples.position,
        velocity=samples.velocity,
        rotation=samples.rotation,
    )
    mount = estimate_mounting(trajectory)
    found: dict[str, Any] = {"smoothed": smoothed}
    if mount is not None:
        found["mounting_deg"] = np.degrees(mount.angles).tolist()
        found["mounting_sd_deg"] = np.degrees(mount.sd).tolist()
    return NavigationSolution(
        trajectory=trajectory,
        position_covariance=samples.position_covariance,
        velocity_sd=samples.velocity_sd,
        attitude_sd=samples.attitude_sd,
        sensor_error_time=node_time,
        sensor_errors=sensor_state,
        sensor_errors_sd=sensor_sd,
        sensor_error_names=model.names,
        innovations=innovations,
        settings=settings | found,
        smoothed=smoothed,
        log_likelihood=likelihood,
    )
