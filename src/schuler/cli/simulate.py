"""`schuler simulate`: a drive with known truth, as files that the other verbs read."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.data.imu import ImuRecording
    from schuler.noise.noise_model import NoiseModel
    from schuler.simulation.motions.profile import Profile
    from schuler.simulation.receivers import GnssGrade
    from schuler.simulation.scenario import Scenario, SensorFaults, SimulatedDrive

Motion = Literal["static", "car_urban", "car_mixed", "motorcycle", "ski", "walk", "drone"]


@dataclass(frozen=True)
class SensorOptions:
    """The IMU.

    Parameters
    ----------
    grade : str
        Typical sensor: phone, consumer, industrial, tactical, or none for an ideal one.
    noise : Path, optional
        Noise model as YAML, from `schuler characterize --noise-out`, instead of a grade.
    rate : float
        Samples a second.
    mounting : str
        ROLL,PITCH,YAW in deg that turn the vehicle's axes (forward, right, down) into those of
        the IMU.
    vibration : float
        Engine, wheels and road of a car or motorcycle, rotors of a drone: 1 as usual, 0 none.
    scale_factor : float
        Standard deviation of the scale factors, ppm.
    misalignment : float
        Standard deviation of the angles between the axes and where they should be, deg.
    g_sensitivity : float
        Standard deviation of what the gyros show of the force, deg/s per g.
    gyro_range : float, optional
        Largest rate delivered, deg/s.
    accel_range : float, optional
        Largest force delivered, g.
    gyro_step : float
        Rounding of the rates, deg/s.
    accel_step : float
        Rounding of the forces, mg.
    warming : float
        Kelvin by which the device warms up, biases with it.
    jitter : float
        Standard deviation of the time stamps, ms.
    clock : float
        Error of the rate of its clock, ppm.
    repeated : float
        Share of rows that repeat the row before.
    array : str, optional
        Several IMUs: tetrahedron, tetrahedron:RADIUS in m, or a number of IMUs side by side.
    """

    grade: str = "consumer"
    noise: Path | None = None
    rate: float = 100.0
    mounting: str = "0,0,0"
    vibration: float = 0.0
    scale_factor: float = 0.0
    misalignment: float = 0.0
    g_sensitivity: float = 0.0
    gyro_range: float | None = None
    accel_range: float | None = None
    gyro_step: float = 0.0
    accel_step: float = 0.0
    warming: float = 0.0
    jitter: float = 0.0
    clock: float = 0.0
    repeated: float = 0.0
    array: str | None = None


@dataclass(frozen=True)
class ReceiverOptions:
    """GNSS.

    Parameters
    ----------
    gnss : str
        Receiver: code (one frequency), differential, or rtk (fixed).
    gnss_rate : float
        Fixes a second.
    lever_arm : str
        X,Y,Z from the IMU to the antenna in m, in the axes of the IMU.
    latency : str
        Seconds by which stamps are late: one number, or POSITION,VELOCITY.
    claimed_scale : float
        Claimed over real standard deviations.
    outage : tuple of str
        START:SECONDS without GNSS. May be repeated.
    outliers : str, optional
        SHARE:METRES of fixes that are off.
    velocity : bool
        Whether the receiver gives velocities.
    """

    gnss: Literal["code", "differential", "rtk"] = "rtk"
    gnss_rate: float = 1.0
    lever_arm: str = "0,0,0"
    latency: str = "0"
    claimed_scale: float = 1.0
    outage: Annotated[tuple[str, ...], Parameter(negative=())] = ()
    outliers: str | None = None
    velocity: Annotated[bool, Parameter(negative="--no-velocity")] = True


def simulate(
    out: Path,
    *,
    motion: Motion = "car_urban",
    duration: float | None = None,
    waypoints: Path | None = None,
    track: Path | None = None,
    seed: int = 0,
    fault: Annotated[tuple[str, ...], Parameter(negative=())] = (),
    form: Annotated[Literal["parquet", "csv"], Parameter(name="--format")] = "parquet",
    report: Path | None = None,
    json: Path | None = None,
    sensor: Annotated[SensorOptions | None, Parameter(name="*")] = None,
    receiver: Annotated[ReceiverOptions | None, Parameter(name="*")] = None,
) -> int:
    """Simulate a drive: IMU, GNSS and truth, in a folder that the other commands read by name.

    Parameters
    ----------
    out : Path
        Folder to write into; it is made if it does not exist.
    motion : str
        What moves.
    duration : float, optional
        Seconds; the usual one of the motion if not given.
    waypoints : Path, optional
        CSV or Parquet with time_s, latitude_deg, longitude_deg, height_m (and roll_deg,
        pitch_deg, heading_deg): the motion goes smoothly through them.
    track : Path, optional
        GNSS recording: a smooth motion that it could have come from.
    seed : int
        Of everything random; the same seed gives the same files on any machine.
    fault : tuple of str
        gap:START:SECONDS, hold:START:SECONDS, jump:START:STEP[:SECONDS],
        stuck:CHANNEL:START[:SECONDS], step:CHANNEL:START:SIZE[:SECONDS],
        ramp:CHANNEL:START:SLOPE[:SECONDS], noise:CHANNEL:START:SD[:SECONDS],
        fix:START:METRES (one wrong position), late:START:STEP[:SECONDS] (stamps of GNSS). SI
        units. May be repeated.
    form : str
        parquet or csv.
    report : Path, optional
        Write a self-contained HTML page here.
    json : Path, optional
        Write the description here as well; - for standard output.
    sensor : SensorOptions, optional
        The IMU.
    receiver : ReceiverOptions, optional
        GNSS.
    """
    from schuler.cli.console import Screen
    from schuler.cli.outputs import STDOUT, Outputs, json_text
    from schuler.cli.simulate_files import description, make_folder, write_drive
    from schuler.execution.progress import progress
    from schuler.simulation.scenario import simulate_drive

    options, gnss = sensor or SensorOptions(), receiver or ReceiverOptions()
    inputs = [p for p in (waypoints, track, options.noise) if p is not None]
    outputs = Outputs(report, json, inputs=inputs)
    if seed < 0:
        raise InputError(f"--seed {seed}", expected="a number of zero or more")
    scenario = scenario_of(motion, duration, waypoints, track, fault, options, gnss)
    with progress("Simulating") as shown:
        shown.say(scenario.motion)
        drive = simulate_drive(scenario, seed)
    told = description(scenario, drive, seed, options, gnss, fault)
    if report is not None:
        page = _page(drive, told, tuple(inputs), seed)
        outputs.text(report, lambda: page)
    outputs.text(json, lambda: json_text(told))
    make_folder(out)
    files = write_drive(out, drive, scenario, told, form)
    show_simulation(Screen(json_on_stdout=json == STDOUT), drive, told, (*files, *outputs.commit()))
    return 0


def scenario_of(
    motion: str,
    duration: float | None,
    waypoints: Path | None,
    track: Path | None,
    fault: tuple[str, ...],
    sensor: SensorOptions,
    gnss: ReceiverOptions,
) -> Scenario:
    """Return the description of a drive from the options of the command."""
    from math import radians

    import numpy as np

    from schuler.cli.loading import parse_numbers
    from schuler.cli.simulate_files import parse_faults, profile_of
    from schuler.rotations import dcm_from_euler
    from schuler.simulation.scenario import Scenario
    from schuler.simulation.stamps import StampErrors

    profile: Profile | None = None
    if waypoints is not None or track is not None:
        profile, motion = profile_of(waypoints, track, duration)
    text = "--mounting ROLL,PITCH,YAW in deg, such as 180,0,90"
    angles = [radians(a) for a in parse_numbers(sensor.mounting, 3, text)]
    arm = parse_numbers(gnss.lever_arm, 3, "--lever-arm X,Y,Z in m, such as 0,-0.05,0")
    both = "," in gnss.latency
    late = parse_numbers(gnss.latency, 2 if both else 1, "--latency SECONDS or POSITION,VELOCITY")
    outliers = (0.0, 50.0)
    if gnss.outliers is not None:
        share, size = parse_numbers(gnss.outliers, 2, "--outliers SHARE:METRES, as 0.02:50", ":")
        outliers = share, size
    example = "--outage START:SECONDS, such as 120:30"
    outages = [parse_numbers(o, 2, example, ":") for o in gnss.outage]
    faults, fixes = parse_faults(fault)
    rotations, positions = _array(sensor.array)
    return Scenario(
        motion=motion,
        noise_model=_noise(sensor),
        receiver=_grade(gnss.gnss),
        duration=duration,
        profile=profile,
        rate=sensor.rate,
        mounting=dcm_from_euler(*angles),
        lever_arm=np.array(arm),
        vibration=sensor.vibration,
        sensor=_sensor(sensor),
        stamps=StampErrors(
            rate_error=1e-6 * sensor.clock, jitter=1e-3 * sensor.jitter, repeated=sensor.repeated
        ),
        array_rotations=rotations,
        array_positions=positions,
        gnss_rate=gnss.gnss_rate,
        latency=late[0],
        velocity_latency=late[-1],
        claimed_scale=gnss.claimed_scale,
        outages=tuple((a, b) for a, b in outages),
        outlier_rate=outliers[0],
        outlier_size=outliers[1],
        velocity=gnss.velocity,
        faults=faults,
        fix_faults=fixes,
    )


def _noise(sensor: SensorOptions) -> NoiseModel | None:
    from schuler.cli.loading import load_noise
    from schuler.simulation.grades import grade_noise

    if sensor.noise is not None:
        return load_noise(sensor.noise)
    return None if sensor.grade == "none" else grade_noise(sensor.grade)


def _grade(name: str) -> GnssGrade:
    from schuler.simulation.receivers import DIFFERENTIAL_CODE, L1_CODE, RTK_FIXED

    return {"code": L1_CODE, "differential": DIFFERENTIAL_CODE, "rtk": RTK_FIXED}[name]


def _sensor(options: SensorOptions) -> SensorFaults:
    from math import radians

    from schuler.simulation.scenario import SensorFaults
    from schuler.units import STANDARD_GRAVITY

    infinite = float("inf")
    return SensorFaults(
        scale_factor=1e-6 * options.scale_factor,
        misalignment=radians(options.misalignment),
        g_sensitivity=radians(options.g_sensitivity) / STANDARD_GRAVITY,
        gyro_range=infinite if options.gyro_range is None else radians(options.gyro_range),
        accel_range=infinite
        if options.accel_range is None
        else options.accel_range * STANDARD_GRAVITY,
        gyro_step=radians(options.gyro_step),
        accel_step=1e-3 * options.accel_step * STANDARD_GRAVITY,
        warming=options.warming,
    )


def _array(text: str | None) -> Any:
    """Rotations and positions of the IMUs of an array, None for one IMU."""
    if text is None:
        return None, None
    from schuler.arrays.geometry import orthogonal_mounting, tetrahedron_mounting

    name, _, radius = text.partition(":")
    expected = "--array tetrahedron, tetrahedron:RADIUS in m, or a number of IMUs such as 4"
    try:
        if name == "tetrahedron":
            mounting = tetrahedron_mounting(float(radius or 0.0))
        else:
            count = int(text)
            if not 2 <= count <= 64:
                raise ValueError
            mounting = orthogonal_mounting(count)
    except ValueError:
        raise InputError(f"--array {text}", expected=expected) from None
    return mounting.rotation, mounting.position


def _page(drive: SimulatedDrive, told: dict[str, Any], inputs: tuple[Path, ...], seed: int) -> str:
    from schuler.cli.provenance import command_provenance
    from schuler.report import render_report
    from schuler.report.sections.simulation import SimulationResults

    return render_report(
        SimulationResults(drive, told),
        *_shown(drive.imus),
        title=f"Simulation: {told['motion']}",
        provenance=command_provenance(inputs=inputs, seeds={"everything": seed}, settings=told),
    )


def _shown(imus: tuple[ImuRecording, ...]) -> tuple[ImuRecording, ...]:
    return imus[:1]


def show_simulation(
    screen: Screen, drive: SimulatedDrive, told: dict[str, Any], written: tuple[Path, ...]
) -> None:
    """Print what was simulated."""
    from schuler.report.numbers import duration, number

    imu = drive.imus[0]
    screen.heading("Simulation", f"{told['motion']}, seed {told['seed']}")
    rows = [
        ("duration", duration(float(drive.log["duration_s"]))),
        ("distance", f"{number(drive.log['distance_m'] / 1000.0)} km"),
        ("highest speed", f"{number(drive.log['highest_speed_m_s'])} m/s"),
        ("IMUs", str(len(drive.imus))),
        ("samples of each", f"{imu.size} at {number(imu.rate, 4)} Hz"),
        ("GNSS fixes", str(drive.gnss.size)),
    ]
    screen.table(("quantity", "value"), rows)
    for fault in drive.log["faults"]:
        screen.finding("info", fault)
    for path in written:
        screen.line(f"wrote {path}", "dim")
