"""The verb `navigate`: an IMU and a GNSS recording in, a trajectory with honest uncertainty out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.data import (
    GnssRecording,
    ImuRecording,
    Innovations,
    NavigationSolution,
    Trajectory,
)
from schuler.errors import InputError, NavigationError
from schuler.navigate.aiding import KIND_NAMES, VELOCITY, AidingSchedule, require_overlap
from schuler.navigate.alignment import align
from schuler.navigate.engine import (
    NO_VEHICLE,
    FilterRun,
    SampleOutputs,
    gate_thresholds,
    run_engine,
)
from schuler.navigate.error_model import SensorErrorModel, sensor_error_model
from schuler.navigate.likelihood import slower_imu
from schuler.navigate.mounting import estimate_mounting
from schuler.navigate.rest import find_initial_rest
from schuler.navigate.setup import NoiseFactors, RunSetup, TimeOffsets
from schuler.navigate.smoother import smooth_run
from schuler.navigate.timing import find_time_offset, velocity_lag
from schuler.navigate.tuning import tune
from schuler.navigate.vehicle import VehicleConstraint, check_constraints, with_vehicle_states
from schuler.processes.noise_model import NoiseModel

FloatArray = NDArray[np.float64]
Progress = Callable[[str], None]

# probability of refusing a good measurement
FALSE_ALARM = 1e-6
# switch-on constants of consumer MEMS: 30 mg, 0.5 deg/s
TURN_ON_ACCEL = 0.3
TURN_ON_GYRO = float(np.radians(0.5))


@dataclass(frozen=True, slots=True, eq=False)
class NavigationRun:
    """A causal solution, its smoothed twin if asked for, and the setup of both."""

    causal: NavigationSolution
    smoothed: NavigationSolution | None
    setup: RunSetup


def generic_noise_model() -> NoiseModel:
    """Where tuning starts when nobody says anything about the sensor: a consumer MEMS in a car.

    Returns
    -------
    NoiseModel
        White noise with vibration and a random walk on every channel.
    """
    from schuler.processes import RandomWalk, WhiteNoise

    accel = WhiteNoise(5e-3) + RandomWalk(5e-4)
    gyro = WhiteNoise(1e-3) + RandomWalk(2e-5)
    processes = {f"{s}_{a}": p for s, p in (("gyro", gyro), ("accel", accel)) for a in "xyz"}
    return NoiseModel(processes=processes, source="generic consumer MEMS, to be tuned")


def withhold(gnss: GnssRecording, windows: Sequence[tuple[float, float]]) -> GnssRecording:
    """Return the recording without the epochs of the given windows.

    Parameters
    ----------
    gnss : GnssRecording
        All epochs.
    windows : sequence of (start, seconds)
        Start in seconds after the first epoch; an epoch at the very end of a window is kept.

    Returns
    -------
    GnssRecording
        What a receiver with these outages would have given.

    Raises
    ------
    InputError
        A window is negative, or nothing is left.
    """
    since = gnss.time - gnss.time[0]
    keep = np.ones(gnss.size, dtype=bool)
    for start, seconds in windows:
        if not (seconds > 0.0 and start >= 0.0):
            raise InputError(
                f"outage of {seconds:g} s at {start:g} s", expected="START >= 0 and SECONDS > 0"
            )
        keep &= ~((since >= start - 1e-6) & (since < start + seconds - 1e-6))
    if not keep.any():
        raise InputError("the outages leave no GNSS at all", expected="some epochs outside them")
    return gnss.select(keep)


def prepare(
    imu: ImuRecording,
    gnss: GnssRecording,
    noise_model: NoiseModel | None = None,
    *,
    lever_arm: ArrayLike = (0.0, 0.0, 0.0),
    heading: float | None = None,
    mounting: FloatArray | None = None,
    time_offset: Literal["estimate"] | float | tuple[float, float] = "estimate",
    tune_noise: bool | None = None,
    aiding: Sequence[str] = (),
    turn_on_accel: float = TURN_ON_ACCEL,
    turn_on_gyro: float = TURN_ON_GYRO,
    progress: Progress | None = None,
) -> tuple[ImuRecording, RunSetup]:
    """Align, find time offsets, noise and mounting. Parameters as for `navigate`.

    Returns
    -------
    tuple of ImuRecording and RunSetup
        The recording cut to where it can be used, and everything a run needs.
    """
    say = progress or (lambda _: None)
    constraints = check_constraints(aiding)
    _check_inputs(imu, gnss)
    arm = np.asarray(lever_arm, dtype=np.float64)
    imu = _from_first_fix(imu, gnss)
    tuned = noise_model is None if tune_noise is None else tune_noise
    base = sensor_error_model(
        noise_model or generic_noise_model(),
        turn_on_accel=turn_on_accel,
        turn_on_gyro=turn_on_gyro,
    )
    estimate = time_offset == "estimate"
    offsets = _given_offsets(time_offset, gnss)
    say("aligning")
    start = align(imu, gnss, velocity_offset=offsets.velocity, heading=heading, mounting=mounting)
    setup = RunSetup(base, NoiseFactors.none(), offsets, start, arm)
    if not (estimate or tuned):
        return imu, _aided(imu, gnss, setup, constraints, mounting, say)
    if estimate:
        say("looking for the time offset")
        rough = _rough(base) if tuned else base
        shift = find_time_offset(
            slower_imu(imu), gnss, RunSetup(rough, NoiseFactors.none(), offsets, start, arm)
        )
        offsets = TimeOffsets(offsets.position + shift, offsets.velocity + shift)
        start = align(
            imu, gnss, velocity_offset=offsets.velocity, heading=heading, mounting=mounting
        )
    say("tuning noise and time offsets" if tuned else "refining the time offsets")
    found = tune(
        imu,
        gnss,
        base,
        offsets=offsets,
        alignment=start,
        lever_arm=arm,
        tune_noise=tuned,
        tune_offsets=estimate,
        progress=progress,
    )
    return imu, _aided(imu, gnss, found.setup, constraints, mounting, say)


def _aided(
    imu: ImuRecording,
    gnss: GnssRecording,
    setup: RunSetup,
    constraints: tuple[str, ...],
    mounting: FloatArray | None,
    say: Progress,
) -> RunSetup:
    """Add what the vehicle tells; where it has to, a first pass without it finds the mounting."""
    if not constraints:
        return setup
    if "nhc" not in constraints:
        return replace(setup, vehicle=VehicleConstraint(constraints, np.eye(3), -1))
    if mounting is None:
        say("looking for the mounting of the IMU in the vehicle")
        found = estimate_mounting(run(imu, gnss, setup).causal.trajectory)
        if found is None:
            raise NavigationError(
                "the drive does not tell how the IMU is mounted in the vehicle",
                expected="ten seconds of driving straight at 3 m/s or faster, with GNSS",
                cure="give the mounting (roll, pitch, yaw), or leave nhc out",
                where=imu.name,
            )
        mounting = found.rotation
    vehicle = VehicleConstraint(constraints, np.asarray(mounting), setup.model.size)
    return replace(setup, model=with_vehicle_states(setup.model), vehicle=vehicle)


def run(
    imu: ImuRecording,
    gnss: GnssRecording,
    setup: RunSetup,
    *,
    smooth: bool = False,
    false_alarm: float = FALSE_ALARM,
    white_scale: FloatArray | None = None,
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
        Whether to smooth as well.
    false_alarm : float
        Of the innovation gate.
    white_scale : (n, 6) ndarray or None
        See `run_engine`; None: as the setup found the noise to follow vibration.

    Returns
    -------
    NavigationRun
        Causal and perhaps smoothed solution.
    """
    schedule = setup.schedule(imu, gnss)
    result = run_engine(
        imu,
        setup.initial_state(imu, gnss),
        setup.model,
        schedule,
        gate=gate_thresholds(false_alarm),
        white_scale=setup.white_scale(imu) if white_scale is None else white_scale,
        vehicle=NO_VEHICLE if setup.vehicle is None else setup.vehicle.states,
        keep_nodes=smooth,
    )
    settings = setup.to_dict() | {
        "imu": imu.name,
        "gnss": gnss.name,
        "gnss_epochs_used": gnss.size,
        "gate_false_alarm": false_alarm,
        "nis_over_degrees": result.mean_nis,
        "updates_refused": int((~result.aiding.accepted & (result.aiding.degrees > 0)).sum()),
    }
    innovations = _innovations(schedule, result)
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
    if not smooth:
        return NavigationRun(causal=causal, smoothed=None, setup=setup)
    back = smooth_run(result, setup.model, imu.time)
    smoothed = _solution(
        imu,
        back.samples,
        setup.model,
        nodes.time,
        back.sensor_state,
        back.sensor_sd,
        innovations,
        settings,
        result.log_likelihood,
        smoothed=True,
    )
    return NavigationRun(causal=causal, smoothed=smoothed, setup=setup)


def navigate(
    imu: ImuRecording,
    gnss: GnssRecording,
    noise_model: NoiseModel | None = None,
    *,
    outages: Sequence[tuple[float, float]] = (),
    smooth: bool = False,
    lever_arm: ArrayLike = (0.0, 0.0, 0.0),
    heading: float | None = None,
    mounting: FloatArray | None = None,
    time_offset: Literal["estimate"] | float | tuple[float, float] = "estimate",
    tune_noise: bool | None = None,
    aiding: Sequence[str] = (),
    false_alarm: float = FALSE_ALARM,
    turn_on_accel: float = TURN_ON_ACCEL,
    turn_on_gyro: float = TURN_ON_GYRO,
    progress: Progress | None = None,
) -> NavigationSolution:
    """Estimate the trajectory of an IMU with loosely coupled GNSS. Spec 7.1 to 7.3, 7.8.

    Parameters
    ----------
    imu : ImuRecording
        All six channels.
    gnss : GnssRecording
        Positions, velocities if there are any, with standard deviations, on a time axis that
        differs from the IMU's by at most a second.
    noise_model : NoiseModel or None
        Of the sensor, usually from a static log; None: a generic one, tuned on the drive.
    outages : sequence of (start, seconds)
        GNSS that is withheld from everything, alignment and tuning included; start in seconds
        after the first GNSS epoch.
    smooth : bool
        Return the smoothed solution instead of the causal one.
    lever_arm : (3,) array_like
        GNSS antenna from IMU, in IMU axes, m.
    heading : float or None
        Heading of the IMU's x axis at the start, rad; None: found from GNSS.
    mounting : (3, 3) ndarray or None
        Vehicle (forward, right, down) from IMU, where known.
    time_offset : "estimate", float or (float, float)
        Seconds to add to GNSS time to get IMU time, one for both or position and velocity.
    tune_noise : bool or None
        Whether to scale noise and receiver standard deviations by the likelihood of the drive;
        None: only when no noise model is given.
    aiding : sequence of str
        What is known of the vehicle: "nhc", it has wheels and rolls along its forward axis
        (mounting, place and slip of the rear axle, and pitch of the springs become states);
        "zupt", it does not move while the IMU feels no motion.
    false_alarm : float
        Probability with which the innovation gate refuses a good measurement; 0: no gate.
    turn_on_accel, turn_on_gyro : float
        Standard deviations of the constants at switch-on, m/s² and rad/s.
    progress : callable or None
        Called with a line of text now and then.

    Returns
    -------
    NavigationSolution
        At the rate of the IMU, with every setting used.

    Raises
    ------
    InputError
        Recordings without what is needed.
    NavigationError
        No overlap, no heading, no mounting where it is needed, or a run that diverges.
    """
    used = withhold(gnss, outages) if outages else gnss
    cut, setup = prepare(
        imu,
        used,
        noise_model,
        lever_arm=lever_arm,
        heading=heading,
        mounting=mounting,
        time_offset=time_offset,
        tune_noise=tune_noise,
        aiding=aiding,
        turn_on_accel=turn_on_accel,
        turn_on_gyro=turn_on_gyro,
        progress=progress,
    )
    if progress is not None:
        progress("filtering")
    done = run(cut, used, setup, smooth=smooth, false_alarm=false_alarm)
    solution = done.smoothed if smooth and done.smoothed is not None else done.causal
    solution.settings["outages"] = [list(w) for w in outages]
    solution.settings["noise_model"] = (noise_model or generic_noise_model()).source
    return solution


def _check_inputs(imu: ImuRecording, gnss: GnssRecording) -> None:
    if not imu.complete:
        raise InputError(
            f"recording '{imu.name}' has only {', '.join(imu.channels)}",
            expected="three gyros and three accelerometers",
        )
    for name in imu.channels:
        if not np.any(imu.channel(name)):
            raise InputError(
                f"{name} of '{imu.name}' is zero throughout",
                expected="a sensor that is connected",
                cure="check the columns of the file",
            )
    require_overlap(gnss, float(imu.time[0]), float(imu.time[-1]))


def _from_first_fix(imu: ImuRecording, gnss: GnssRecording) -> ImuRecording:
    """Cut what comes before GNSS, unless it is rest, which tells level and biases."""
    if imu.time[0] >= gnss.time[0] - 2.0:
        return imu
    rest = find_initial_rest(imu, gnss)
    if rest is not None and rest[1] >= gnss.time[0] - 2.0:
        return imu
    cut = imu.between(float(gnss.time[0]) - 1.0, np.inf)
    if cut.size < 100:
        raise NavigationError(
            f"only {cut.size} IMU samples after the first GNSS fix", expected="at least 100"
        )
    return cut


def _given_offsets(
    time_offset: Literal["estimate"] | float | tuple[float, float], gnss: GnssRecording
) -> TimeOffsets:
    if isinstance(time_offset, str):
        # a velocity that lags was true earlier than its stamp says
        return TimeOffsets(0.0, -velocity_lag(gnss))
    if isinstance(time_offset, tuple):
        return TimeOffsets(float(time_offset[0]), float(time_offset[1]))
    return TimeOffsets(float(time_offset), float(time_offset))


def _rough(base: SensorErrorModel) -> SensorErrorModel:
    """Noise that forgives anything, for a first search."""
    return NoiseFactors(white=np.full(6, 2.0)).applied(base)


def _innovations(schedule: AidingSchedule, result: FilterRun) -> Innovations:
    """All measurements but the constraints that did not apply where they were due."""
    aiding = result.aiding
    due = (schedule.kind <= VELOCITY) | (aiding.degrees > 0)
    return Innovations(
        time=schedule.time[due],
        kind=tuple(KIND_NAMES[k] for k in schedule.kind[due]),
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
