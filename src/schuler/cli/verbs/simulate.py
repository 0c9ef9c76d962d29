"""`schuler simulate`: a drive with known truth, as files that the other verbs read."""

from __future__ import annotations

from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from schuler.cli.job import Job, Result
from schuler.cli.options.files import Written
from schuler.cli.options.simulation import MotionOptions, ReceiverOptions, SensorOptions
from schuler.cli.parsing import parse_numbers
from schuler.cli.simulation_files import drive_files, make_folder, parse_faults, profile_of
from schuler.errors import InputError
from schuler.execution.progress import progress

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.simulation.scenario import Scenario, SimulatedDrive


def simulate(
    out: Path,
    *,
    moved: MotionOptions = MotionOptions(),
    form: Annotated[Literal["parquet", "csv"], Parameter(name="--format")] = "parquet",
    written: Written = Written(),
    sensor: SensorOptions = SensorOptions(),
    receiver: ReceiverOptions = ReceiverOptions(),
) -> int:
    """Simulate a drive: IMU, GNSS and truth, in a folder that the other commands read by name.

    Example: `schuler simulate drive --duration 600 --outage 300:30`

    Parameters
    ----------
    out : Path
        Folder to write into; it is made if it does not exist.
    form : str
        parquet or csv.
    """
    from schuler.report.sections.navigation.simulation import SimulationResults
    from schuler.simulation.scenario import simulate_drive

    job = Job(written, inputs=(moved.waypoints, moved.track, sensor.noise))
    if moved.seed < 0:
        raise InputError(f"--seed {moved.seed}", expected="a number of zero or more")
    scenario = scenario_of(moved, sensor, receiver)
    with progress("Simulating") as shown:
        shown.say(scenario.motion)
        drive = simulate_drive(scenario, moved.seed)
    told = description(scenario, drive, moved, sensor, receiver)
    texts, files = drive_files(out, drive, scenario, told, form)
    make_folder(out)
    return job.finish(
        Result(
            title=f"Simulation: {told['motion']}",
            sections=(SimulationResults(drive, told), drive.imus[0]),
            show=lambda screen: show_simulation(screen, drive, told),
            json=lambda: told,
            settings=told,
            seeds={"everything": moved.seed},
            texts=texts,
            files=files,
        )
    )


def scenario_of(moved: MotionOptions, sensor: SensorOptions, gnss: ReceiverOptions) -> Scenario:
    """Return the description of a drive from the options of the command."""
    import numpy as np

    from schuler.rotations import dcm_from_euler
    from schuler.simulation.scenario import Scenario
    from schuler.simulation.stamps import StampErrors

    profile, motion = None, str(moved.motion)
    if moved.waypoints is not None or moved.track is not None:
        profile, motion = profile_of(moved.waypoints, moved.track, moved.duration)
    text = "--mounting ROLL,PITCH,YAW in deg, such as 180,0,90"
    angles = [radians(a) for a in parse_numbers(sensor.mounting, 3, text)]
    arm = parse_numbers(gnss.lever_arm, 3, "--lever-arm X,Y,Z in m, such as 0,-0.05,0")
    late, velocity_late = gnss.latencies()
    outlier_rate, outlier_size = gnss.wrong_fixes()
    outages = gnss.outages()
    faults, fixes = parse_faults(moved.fault)
    places = sensor.places()
    return Scenario(
        motion=motion,
        noise_model=sensor.noise_model(),
        receiver=gnss.grade(),
        duration=moved.duration,
        profile=profile,
        rate=sensor.rate,
        mounting=dcm_from_euler(*angles),
        lever_arm=np.array(arm),
        vibration=sensor.vibration,
        sensor=sensor.errors(),
        stamps=StampErrors(
            rate_error=1e-6 * sensor.clock, jitter=1e-3 * sensor.jitter, repeated=sensor.repeated
        ),
        array_rotations=None if places is None else places.rotation,
        array_positions=None if places is None else places.position,
        gnss_rate=gnss.gnss_rate,
        latency=late,
        velocity_latency=velocity_late,
        claimed_scale=gnss.claimed_scale,
        outages=outages,
        outlier_rate=outlier_rate,
        outlier_size=outlier_size,
        velocity=gnss.velocity,
        faults=faults,
        fix_faults=fixes,
    )


def description(
    scenario: Scenario,
    drive: SimulatedDrive,
    moved: MotionOptions,
    sensor: SensorOptions,
    gnss: ReceiverOptions,
) -> dict[str, Any]:
    """Return what was simulated as plain values: the options given, and what was drawn."""
    from dataclasses import asdict

    from schuler.data.to_dict import plain

    noise = scenario.noise_model
    return {
        "motion": scenario.motion,
        "seed": moved.seed,
        "imu": plain(asdict(sensor)),
        "gnss": plain(asdict(gnss)),
        "faults_asked_for": list(moved.fault),
        "noise_model": None if noise is None else noise.source,
        "outcome": plain(drive.log),
        "samples": [imu.size for imu in drive.imus],
        "fixes": drive.gnss.size,
        "files": "imu*: what the IMU recorded; gnss: what the receiver recorded; truth: position, "
        "velocity and attitude of the IMU at the true times of its samples (of the centre of an "
        "array); noise.yaml: the noise model that was drawn from; mounting.yaml: how the IMUs of "
        "an array sit on the body",
    }


def show_simulation(screen: Screen, drive: SimulatedDrive, told: dict[str, Any]) -> None:
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
    screen.findings(("info", fault) for fault in drive.log["faults"])
