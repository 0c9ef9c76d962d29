"""`schuler navigate`: IMU and GNSS in, a trajectory with uncertainty out."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from schuler.cli.arrays import ArrayOptions, navigate_arrays, require_one
from schuler.cli.reading import DriveReading
from schuler.cli.running import RunOptions
from schuler.cli.sensors import SensorOptions
from schuler.errors import InputError, SchulerError

# what a smoothed solution says of how it was smoothed
SMOOTHING_SETTINGS = ("smoothing", "lag_s", "smoother_bytes")

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.data.gnss import GnssRecording
    from schuler.data.imu import ImuRecording
    from schuler.data.trajectory import NavigationSolution


def navigate(
    *,
    gnss: Path,
    imu: Path | None = None,
    noise: Path | None = None,
    smooth: bool = False,
    lag: float | None = None,
    out: Path | None = None,
    report: Path | None = None,
    json: Path | None = None,
    several: Annotated[ArrayOptions | None, Parameter(name="*")] = None,
    known: Annotated[RunOptions | None, Parameter(name="*")] = None,
    sensors: Annotated[SensorOptions | None, Parameter(name="*")] = None,
    reading: Annotated[DriveReading | None, Parameter(name="*")] = None,
) -> int:
    """Compute position, velocity and attitude of a drive, with their uncertainty.

    Aligns the IMU, finds time offsets, runs an error-state Kalman filter over IMU and GNSS, and
    smooths the result when asked.

    Parameters
    ----------
    gnss : Path
        GNSS recording: CSV, text, Parquet, NPZ, ROS bag, or RTKLIB .pos.
    imu : Path, optional
        IMU recording: the same formats, or a folder with imu.* in it.
    noise : Path, optional
        Noise model as YAML, from `schuler characterize --noise-out`.
    smooth : bool
        Use all data for every moment (fixed-interval smoother).
    lag : float, optional
        Use data up to so many seconds after every moment (fixed-lag smoother).
    out : Path, optional
        Write the trajectory here, .parquet or .csv.
    report : Path, optional
        Write a self-contained HTML page here.
    json : Path, optional
        Write a summary here; - for standard output.
    several : ArrayOptions, optional
        An array of IMUs instead of one.
    known : RunOptions, optional
        What is known about the run.
    sensors : SensorOptions, optional
        Other sensors.
    reading : DriveReading, optional
        How to read the files.
    """
    from schuler.cli.console import Screen, say
    from schuler.cli.loading import load_noise, say_when_compiling, title_of
    from schuler.cli.outputs import STDOUT, Outputs, json_text
    from schuler.cli.provenance import command_provenance
    from schuler.execution.progress import progress
    from schuler.io.trajectory import check_trajectory_name, write_trajectory
    from schuler.navigation.preparation.prepare import prepare
    from schuler.navigation.run import run

    options = several or ArrayOptions()
    require_one(imu, options)
    beside = sensors or SensorOptions()
    beside.check()
    if imu is None:
        if beside.files:
            raise InputError(
                f"{beside.files[0]} with --array",
                expected="other sensors beside a single --imu",
            )
        told, how = known or RunOptions(), reading or DriveReading()
        return navigate_arrays(options, gnss, noise, smooth, (out, report, json), told, how)
    inputs = (imu, gnss, *((noise,) if noise else ()), *beside.files)
    outputs = Outputs(out, report, json, inputs=inputs)
    if out is not None:
        check_trajectory_name(out)
    keywords, how = (known or RunOptions()).keywords(), reading or DriveReading()
    recording, fixes = load_drive(imu, gnss, how)
    keywords = beside.keywords(keywords, recording.time, repair=how.repair)
    model = load_noise(noise)
    say_when_compiling()
    with progress("Navigating") as shown:
        cut, setup = prepare(recording, fixes, model, progress=shown.say, **keywords)
        shown.say("smoothing" if smooth else "filtering")
        done = run(cut, fixes, setup, smooth=smooth, lag=lag)
    causal, smoothed = done.causal, done.smoothed or done.lagged
    best = smoothed or causal
    if report is not None:
        from schuler.report import NavigationResults, render_report

        page = render_report(
            NavigationResults(causal, smoothed, fixes),
            title=f"Navigation of {title_of(imu)}",
            provenance=command_provenance(inputs=inputs, settings=best.settings),
        )
        outputs.text(report, lambda: page)
    if out is not None:
        outputs.file(out, lambda path: write_trajectory(path, best, form=out.suffix))
    outputs.text(json, lambda: json_text(navigation_summary(causal, smoothed)))
    written = outputs.commit()
    show_navigation(Screen(json_on_stdout=json == STDOUT), causal, smoothed, written)
    doubts = [f for f in causal.settings["findings"] if f["severity"] == "error"]
    for doubt in doubts:
        say(f"check failed: {doubt['message']}")
    return 1 if doubts else 0


def load_drive(imu: Path, gnss: Path, reading: DriveReading) -> tuple[ImuRecording, GnssRecording]:
    """Read IMU and GNSS of a drive, repaired when asked."""
    from schuler.cli.loading import load_gnss, load_imu
    from schuler.data.imu import CHANNELS
    from schuler.navigation.aiding.gnss import require_overlap
    from schuler.screening.screen import repair, screen

    recording = load_imu(imu, reading.imu_options())
    fixes = load_gnss(gnss, reading.gnss_options())
    try:
        require_overlap(fixes, float(recording.time[0]), float(recording.time[-1]))
    except SchulerError as error:
        raise error.at(str(gnss)) from None
    require_deviations(fixes, gnss)
    missing = [c for c in CHANNELS if c not in recording.channels]
    if missing:
        raise InputError(
            f"has no {', '.join(missing)}",
            expected="three gyros and three accelerometers",
            cure="name the columns with --imu-column ROLE=NAME",
            where=str(imu),
        )
    screening = screen(recording)
    screening.require_usable()
    if reading.repair:
        recording = repair(recording, screening)
    if reading.flip:
        from schuler.navigation.preparation.diagnosis import check_flip, flipped

        recording = flipped(recording, check_flip(reading.flip))
    return recording, fixes


def require_deviations(fixes: GnssRecording, path: Path) -> None:
    """Raise when GNSS has no standard deviations."""
    import numpy as np

    for what, values in (("position", fixes.position_sd), ("velocity", fixes.velocity_sd)):
        unknown = 0 if values is None else int(np.isnan(values).any(axis=1).sum())
        if unknown:
            raise InputError(
                f"GNSS {what} has no standard deviation in {unknown} of {fixes.size} epochs",
                expected="one for every epoch",
                cure=f"give one for all with --gnss-{what}-sd",
                where=str(path),
            )


def navigation_summary(
    causal: NavigationSolution, smoothed: NavigationSolution | None
) -> dict[str, Any]:
    """Return what a machine wants to know about a run."""
    import numpy as np

    def answer(solution: NavigationSolution) -> dict[str, Any]:
        how = {k: solution.settings[k] for k in SMOOTHING_SETTINGS if k in solution.settings}
        return how | {
            "position_sd_median_m": np.median(solution.position_sd, axis=0),
            "velocity_sd_median_m_s": np.median(solution.velocity_sd, axis=0),
            "attitude_sd_median_rad": np.median(solution.attitude_sd, axis=0),
            "last_position_rad_m": solution.trajectory.position[-1],
            "last_sensor_errors": dict(
                zip(solution.sensor_error_names, solution.sensor_errors[-1], strict=True)
            ),
        }

    updates = {}
    for kind in causal.innovations.kinds:
        part = causal.innovations.of_kind(kind)
        kept = part.accepted
        updates[kind] = {
            "updates": int(part.nis.size),
            "rejected": int(np.count_nonzero(~kept)),
            "mean_nis_per_degree": float(part.nis[kept].sum() / max(part.degrees[kept].sum(), 1)),
        }
    time = causal.trajectory.time
    return {
        "samples": causal.trajectory.size,
        "start_s": float(time[0]),
        "duration_s": float(time[-1] - time[0]),
        "causal": answer(causal),
        "smoothed": None if smoothed is None else answer(smoothed),
        "updates": updates,
        "findings": causal.settings["findings"],
        "settings": {k: v for k, v in causal.settings.items() if k != "findings"},
    }


def show_navigation(
    screen: Screen,
    causal: NavigationSolution,
    smoothed: NavigationSolution | None,
    written: tuple[Path, ...] = (),
) -> None:
    """Print what the filter claims and whether its claims are honest."""
    import numpy as np

    from schuler.report.numbers import duration, number

    time = causal.trajectory.time
    screen.heading("Navigation", duration(float(time[-1] - time[0])))
    rows = []
    for name, solution in (("causal", causal), ("smoothed", smoothed)):
        if solution is None:
            continue
        if "lag_s" in solution.settings:
            name = f"lag of {number(solution.settings['lag_s'])} s"
        horizontal = np.sqrt(np.sum(solution.position_sd[:, :2] ** 2, axis=1))
        tilt = np.degrees(solution.attitude_sd)
        rows.append(
            (
                name,
                f"{number(float(np.median(horizontal)))} m",
                f"{number(float(np.median(solution.position_sd[:, 2])))} m",
                f"{number(float(np.median(np.linalg.norm(solution.velocity_sd, axis=1))))} m/s",
                f"{number(float(np.median(tilt[:, :2])))} deg",
                f"{number(float(np.median(tilt[:, 2])))} deg",
            )
        )
    columns = ("claimed sd (median)", "horizontal", "vertical", "velocity", "tilt", "heading")
    screen.table(columns, rows)
    updates = navigation_summary(causal, None)["updates"]
    counts = [
        (kind, str(u["updates"]), str(u["rejected"]), number(u["mean_nis_per_degree"]))
        for kind, u in updates.items()
    ]
    screen.table(("measurement", "updates", "kept out", "mean NIS a degree (1 is honest)"), counts)
    show_findings(screen, causal.settings["findings"])
    for path in written:
        screen.line(f"wrote {path}", "dim")


def show_findings(screen: Screen, findings: Sequence[dict[str, Any]]) -> None:
    """Print what the filter saw on the way, each with its cure."""
    for finding in findings:
        cure = f"; {finding['cure']}" if finding["cure"] else ""
        screen.finding(finding["severity"], finding["message"] + cure)
