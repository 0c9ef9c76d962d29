"""The verb `navigate_array`: several IMUs and one GNSS receiver, by any of the mechanizations.

S002 section III and spec 7.4 to 7.6: a single IMU; the synthetic IMU, fused before the filter; the
extended one, whose filter knows the errors of every sensor; the geometrically constrained one, in
which every IMU has a solution and the body ties them; and redundancy at system level.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from schuler.data import GnssRecording, ImuRecording, Innovations, NavigationSolution
from schuler.data.array import ImuArray
from schuler.errors import InputError, NavigationError
from schuler.navigation.aiding.options import PLAIN, MeasurementOptions
from schuler.navigation.aiding.schedule import KIND_NAMES
from schuler.navigation.engine import SMOOTHER_MEMORY, gate_thresholds
from schuler.navigation.error_models.sensor_error_model import TURN_ON_ACCEL, TURN_ON_GYRO
from schuler.navigation.error_models.sensor_states import SensorErrorModel
from schuler.navigation.mechanizations.array_model import Fusion, fused_model
from schuler.navigation.mechanizations.array_preparation import (
    PreparedArray,
    merged_start,
    prepare_array,
    sensor_start,
)
from schuler.navigation.mechanizations.array_solution import (
    at_lever_arm,
    mean_trajectory,
    solution_at_lever_arm,
)
from schuler.navigation.mechanizations.stacked import CONSTRAINT, RigidBody, StackedRun, run_stack
from schuler.navigation.mechanizations.system_level import Vote, vote
from schuler.navigation.navigate import check_smoothing, withhold
from schuler.navigation.preparation.prepare import prepare_drive
from schuler.navigation.preparation.setup import RunSetup
from schuler.navigation.run import run, run_record
from schuler.navigation.settings import FALSE_ALARM, NavigationSettings, Progress
from schuler.noise.noise_model import NoiseModel
from schuler.types import FloatArray

Mechanization = Literal["single", "synthetic", "extended", "constrained", "system"]
MECHANIZATIONS: tuple[Mechanization, ...] = get_args(Mechanization)

CONSTRAINT_NAMES = ("relative attitude", "relative position", "relative velocity")


@dataclass(frozen=True, slots=True, eq=False)
class ArrayNavigation:
    """A solution for the origin of the body, and what only arrays have.

    Parameters
    ----------
    mechanization : str
        One of `MECHANIZATIONS`.
    solution : NavigationSolution
        For the origin of the body, in its axes.
    prepared : PreparedArray
        The array as it was used.
    model : SensorErrorModel or None
        Sensor error states of the filter; None where each IMU has its own.
    stack : StackedRun or None
        Solutions of all IMUs, where they have one each.
    vote : Vote or None
        Who was outvoted when, at system level.
    """

    mechanization: Mechanization
    solution: NavigationSolution
    prepared: PreparedArray
    model: SensorErrorModel | None = None
    stack: StackedRun | None = None
    vote: Vote | None = None


def navigate_array(
    array: ImuArray,
    gnss: GnssRecording,
    noise_models: NoiseModel | Sequence[NoiseModel] | None = None,
    *,
    mechanization: Mechanization = "extended",
    parity: bool = True,
    imu: int = 0,
    rigid: RigidBody | None = None,
    outages: Sequence[tuple[float, float]] = (),
    smooth: bool | Literal["fixed-lag"] = False,
    lag: float = 5.0,
    lever_arm: ArrayLike = (0.0, 0.0, 0.0),
    heading: float | None = None,
    mounting: FloatArray | None = None,
    time_offset: Literal["estimate"] | float | tuple[float, float] = "estimate",
    tune_noise: bool | None = None,
    aiding: Sequence[str] = (),
    false_alarm: float = FALSE_ALARM,
    smoother_memory: float = SMOOTHER_MEMORY,
    turn_on_accel: float = TURN_ON_ACCEL,
    turn_on_gyro: float = TURN_ON_GYRO,
    measurements: MeasurementOptions = PLAIN,
    progress: Progress | None = None,
) -> ArrayNavigation:
    """Estimate the trajectory of a body that carries several IMUs and a GNSS antenna.

    Parameters
    ----------
    array : ImuArray
        Two IMUs or more, calibrated to each other, missing values as NaN.
    gnss : GnssRecording
        As for `navigate`.
    noise_models : NoiseModel, sequence of NoiseModel, or None
        One for all IMUs or one for each, in their own axes; None: a generic one, tuned.
    mechanization : {"single", "synthetic", "extended", "constrained", "system"}
        How the IMUs are used.
    parity : bool
        Whether the extended filter also takes the parity vector once a second, and what each gyro
        shows at rest, as measurements of the biases (spec 7.5); without them nothing tells the
        sensors apart, and the filter equals the synthetic one for equal sensors.
    imu : int
        Which one is used by "single".
    rigid : RigidBody or None
        How rigid the body is, for "constrained".
    outages, smooth, lag, heading, mounting, time_offset, tune_noise, aiding, false_alarm,
    smoother_memory, measurements
        As for `navigate`; the body takes the place of the IMU. Several solutions side by side
        ("constrained", "system") are causal and use GNSS alone.
    lever_arm : (3,) array_like
        GNSS antenna from the origin of the body, m.
    turn_on_accel, turn_on_gyro : float
        Of every sensor.
    progress : callable or None
        Called with a line of text now and then.

    Returns
    -------
    ArrayNavigation
        Its `solution` is for the origin of the body.

    Raises
    ------
    InputError
        One IMU only, a copy, sensors that are silent, a mechanization that does not exist or
        cannot do what is asked.
    NavigationError
        As `navigate`.
    """
    check_smoothing(smooth)
    settings = NavigationSettings(
        lever_arm=lever_arm,
        heading=heading,
        mounting=mounting,
        time_offset=time_offset,
        tune_noise=tune_noise,
        aiding=aiding,
        false_alarm=false_alarm,
        smoother_memory=smoother_memory,
        turn_on_accel=turn_on_accel,
        turn_on_gyro=turn_on_gyro,
        measurements=measurements,
    )
    check_mechanization(mechanization, settings, smooth=bool(smooth))
    used = withhold(gnss, outages) if outages else gnss
    prepared = prepare_array(array, used, noise_models, settings, progress)
    if progress is not None:
        progress(f"filtering, {mechanization}")
    result = run_mechanization(
        prepared,
        used,
        mechanization,
        parity=parity,
        imu=imu,
        rigid=rigid,
        smooth=smooth is True,
        lag=lag if smooth == "fixed-lag" else None,
    )
    result.solution.settings["outages"] = [list(w) for w in outages]
    return result


def check_mechanization(name: str, settings: NavigationSettings, *, smooth: bool) -> None:
    """Raise when a mechanization does not exist or cannot do what is asked."""
    if name not in MECHANIZATIONS:
        raise InputError(f"mechanization '{name}'", expected=" or ".join(MECHANIZATIONS))
    if name not in ("constrained", "system"):
        return
    asked = {
        "smoothing": smooth,
        "vehicle constraints": bool(settings.constraints),
        "other sensors, slow errors or weights of GNSS": settings.measurements is not PLAIN,
    }
    for what, given in asked.items():
        if given:
            raise InputError(
                f"{what} with the {name} mechanization",
                expected="a causal solution with GNSS alone",
                cure="take the synthetic or extended mechanization",
            )


def run_mechanization(
    prepared: PreparedArray,
    gnss: GnssRecording,
    mechanization: Mechanization,
    *,
    parity: bool = True,
    imu: int = 0,
    rigid: RigidBody | None = None,
    smooth: bool = False,
    lag: float | None = None,
) -> ArrayNavigation:
    """Run one mechanization on a prepared array. Parameters as for `navigate_array`."""
    check_mechanization(mechanization, prepared.settings, smooth=smooth or lag is not None)
    if mechanization in ("constrained", "system"):
        return _stacked(prepared, gnss, mechanization, rigid)
    told = _settings(prepared, mechanization)
    recording, place = prepared.recording, prepared.fusion.centre
    if mechanization == "single":
        recording, own = single_setup(prepared, gnss, imu)
        place = prepared.array.mounting.position[imu]
        told["imu_used"] = prepared.array.names[imu]
    elif mechanization == "synthetic":
        own = prepared.synthetic_setup()
    else:
        own = prepared.extended_setup(parity=parity)
        told["parity_update"] = parity
    done = run(recording, gnss, own, smooth=smooth, lag=lag)
    solution = solution_at_lever_arm(done.smoothed or done.lagged or done.causal, -place)
    solution.settings.update(told)
    return ArrayNavigation(mechanization, solution, prepared, own.model)


def single_recording(array: ImuArray, imu: int) -> ImuRecording:
    """Return one IMU of an array in the axes of the body."""
    recording, c_bs = array.imu(imu), array.mounting.rotation[imu]
    return replace(recording, gyro=recording.gyro @ c_bs.T, accel=recording.accel @ c_bs.T)


def single_setup(
    prepared: PreparedArray, gnss: GnssRecording, imu: int
) -> tuple[ImuRecording, RunSetup]:
    """One IMU in the axes of the body, with its own alignment and the offsets of the array."""
    array, setup = prepared.array, prepared.setup
    if not 0 <= imu < array.count:
        raise InputError(f"IMU {imu}", expected=f"a number from 0 to {array.count - 1}")
    place, vehicle, settings = array.mounting.position[imu], setup.vehicle, prepared.settings
    own = prepare_drive(
        single_recording(array, imu),
        gnss,
        prepared.noise_models[imu],
        replace(
            settings,
            lever_arm=prepared.lever_arm - place,
            time_offset=(setup.offsets.position, setup.offsets.velocity),
            tune_noise=False,
            mounting=settings.mounting if vehicle is None else vehicle.mounting,
        ),
    )
    c_bs = array.mounting.rotation[imu]
    alone = Fusion(c_bs, c_bs, c_bs.T, place)
    turned, merge = fused_model((prepared.models[imu],), alone)
    own_array = array.select([imu]).between(float(own.imu.time[0]), np.inf)
    start = sensor_start(own_array, (prepared.models[imu],), alone, own.setup.alignment)
    known = replace(
        own.setup,
        factors=setup.factors,
        vibration=setup.vibration,
        sensor_start=merged_start(start, merge),
    )
    return own.imu, known.with_sensors(turned)


def _stacked(
    prepared: PreparedArray,
    gnss: GnssRecording,
    mechanization: Mechanization,
    rigid: RigidBody | None,
) -> ArrayNavigation:
    """Several solutions side by side, tied by the body or averaged by a vote."""
    if not prepared.whole:
        raise NavigationError(
            "; ".join(f.message for f in prepared.setup.condition.findings if f.kind == "gap"),
            expected=f"an array recording without gaps for the {mechanization} mechanization",
            cure="take the synthetic or extended mechanization, or navigate the parts before and "
            "after by themselves",
        )
    constrained = mechanization == "constrained"
    stack = run_stack(
        prepared,
        gnss,
        constrained=constrained,
        gate=gate_thresholds(prepared.settings.false_alarm),
        weight=None if constrained else np.full(prepared.array.count, 1.0 / prepared.array.count),
        rigid=rigid,
    )
    mounting = prepared.array.mounting
    at_origin = [
        at_lever_arm(t, -(c.T @ place), c.T)
        for t, c, place in zip(
            stack.trajectories, mounting.rotation, mounting.position, strict=True
        )
    ]
    votes = None if constrained else vote(at_origin, stack.sd)
    weight = stack.weight if votes is None else votes.weight(stack.weight)
    innovations = _innovations(stack)
    record = run_record(prepared.recording, gnss, prepared.setup, innovations)
    settings = record | _settings(prepared, mechanization)
    if votes is not None:
        settings["share_outvoted"] = dict(
            zip(prepared.array.names, votes.share_outvoted.tolist(), strict=True)
        )
    # with fewer heard the noise of the mean grows as that of independent solutions would
    more = 1.0 if votes is None else prepared.array.count / votes.heard.sum(axis=1)
    grown = np.broadcast_to(more, (prepared.array.size,))
    solution = NavigationSolution(
        trajectory=mean_trajectory(at_origin, weight),
        position_covariance=stack.position_covariance * grown[:, None, None],
        velocity_sd=stack.velocity_sd * np.sqrt(grown)[:, None],
        attitude_sd=stack.attitude_sd * np.sqrt(grown)[:, None],
        sensor_error_time=stack.node_time,
        sensor_errors=stack.sensor_state,
        sensor_errors_sd=stack.sensor_sd,
        sensor_error_names=tuple(
            f"{name} {state}"
            for name, model in zip(prepared.array.names, prepared.models, strict=True)
            for state in model.names
        ),
        innovations=innovations,
        settings=settings,
        log_likelihood=stack.log_likelihood,
    )
    return ArrayNavigation(mechanization, solution, prepared, None, stack, votes)


def _innovations(stack: StackedRun) -> Innovations:
    """GNSS by every answer, and the constraints of every pair."""
    fixes = np.flatnonzero(stack.aid_kind != CONSTRAINT)
    ties = np.flatnonzero(stack.aid_kind == CONSTRAINT)
    answers, pairs = stack.nis.shape[1], stack.constraint_nis.shape[1] * int(ties.size > 0)
    time = np.concatenate([np.repeat(stack.aid_time[fixes], answers),
                           np.repeat(stack.aid_time[ties], 3 * pairs)])  # fmt: skip
    kind = [KIND_NAMES[q] for q in np.repeat(stack.aid_kind[fixes], answers)]
    kind += list(CONSTRAINT_NAMES) * (ties.size * pairs)
    tied = 3 * pairs * ties.size
    degrees = np.concatenate([np.repeat(stack.degrees[fixes], answers), np.full(tied, 3)])
    value = np.concatenate([stack.residual[fixes].reshape(-1, 3),
                            stack.constraint_residual.reshape(-1, 3)[:tied]])  # fmt: skip
    sd = np.concatenate([stack.deviation[fixes].reshape(-1, 3), np.full((tied, 3), np.nan)])
    order = np.argsort(time, kind="stable")
    return Innovations(
        time=time[order],
        kind=tuple(kind[q] for q in order),
        value=value[order],
        sd=sd[order],
        nis=np.concatenate([stack.nis[fixes].ravel(), stack.constraint_nis.ravel()[:tied]])[order],
        degrees=degrees[order].astype(np.int64),
        accepted=np.concatenate([stack.accepted[fixes].ravel(), np.ones(tied, bool)])[order],
    )


def _settings(prepared: PreparedArray, mechanization: Mechanization) -> dict[str, Any]:
    setup: RunSetup = prepared.setup
    return {
        "mechanization": mechanization,
        "imus": list(prepared.array.names),
        "array_notes": list(prepared.notes),
        "alignment": setup.alignment.method,
        "time_offset_position_s": setup.offsets.position,
        "time_offset_velocity_s": setup.offsets.velocity,
        "lever_arm_m": prepared.lever_arm.tolist(),
    }
