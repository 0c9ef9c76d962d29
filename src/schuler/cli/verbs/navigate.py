"""`schuler navigate`: IMU or array and GNSS in, a trajectory with uncertainty out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cyclopts import Parameter

from schuler.cli.console import say
from schuler.cli.job import Job, Result, working
from schuler.cli.loading import load_array_drive, load_drive, load_noise
from schuler.cli.options.arrays import ArrayOptions
from schuler.cli.options.files import Run, Written
from schuler.cli.options.outages import parse_windows
from schuler.cli.options.reading import DriveReading
from schuler.cli.options.running import RunOptions
from schuler.cli.options.sensors import SensorOptions
from schuler.cli.parsing import title_of
from schuler.cli.verbs.evaluate import Reference
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.data.trajectory import NavigationSolution
    from schuler.evaluation.mechanizations import MechanizationComparison
    from schuler.report import NavigationResults

ALL = "all"
SMOOTHING_SETTINGS = ("smoothing", "lag_s", "smoother_bytes")
"""What a smoothed solution says of how it was smoothed."""


@Parameter(name="*")
@dataclass(frozen=True)
class Answer:
    """Which data every moment uses, and where the trajectory goes.

    Parameters
    ----------
    smooth : bool
        Use all data for every moment (fixed-interval smoother).
    lag : float, optional
        Use data up to so many seconds after every moment (fixed-lag smoother).
    out : Path, optional
        Write the trajectory here, .parquet or .csv.
    truth : Path, optional
        A better trajectory, in any form that `schuler evaluate` reads: the answer is judged by it.
    """

    smooth: bool = False
    lag: float | None = None
    out: Path | None = None
    truth: Path | None = None


def navigate(
    *,
    run: Run,
    answer: Answer = Answer(),
    written: Written = Written(),
    several: ArrayOptions = ArrayOptions(),
    known: RunOptions = RunOptions(),
    sensors: SensorOptions = SensorOptions(),
    reading: DriveReading = DriveReading(),
    reference: Reference = Reference(),
) -> int:
    """Compute position, velocity and attitude of a drive, with their uncertainty.

    Aligns the IMU, finds time offsets, runs an error-state Kalman filter over IMU and GNSS, and
    smooths the result when asked.

    Example: `schuler navigate --imu imu.csv --gnss gnss.csv --noise noise.yaml --smooth`

    """
    from schuler.io.trajectory import check_trajectory_name

    files = several.files(run.imu)
    sensors.check()
    inputs = (*files, reading.calibration, run.gnss, run.noise, run.told.static)
    job = Job(written, answer.out, inputs=(*inputs, answer.truth, *sensors.files))
    if answer.out is not None:
        check_trajectory_name(answer.out)
    if run.imu is not None:
        result = _single(run.imu, run, answer, known, sensors, reading)
        return job.finish(_judged(result, answer.truth, reference))
    if run.told.model is not None:
        raise InputError("--model with --array", expected="one IMU (--imu)")
    if run.of.sensor is not None:
        raise InputError("--sensor with --array", expected="one IMU (--imu)")
    _require_for_arrays(several, answer, known, sensors)
    result = _array(run, answer, several, known, sensors, reading)
    return job.finish(_judged(result, answer.truth, reference))


def _judged(result: Result, truth: Path | None, reference: Reference) -> Result:
    """Add the errors against a reference, where there is one, to what becomes of a run."""
    if truth is None:
        return result
    from schuler.cli.verbs.evaluate import judged, show_evaluation
    from schuler.report import NavigationResults

    (results,) = result.sections
    assert isinstance(results, NavigationResults)
    found = [
        replace(judged(solution, truth, reference), name=name)
        for name, _, solution in results.solutions
    ]

    def show(screen: Screen) -> None:
        result.show(screen)
        for one in found:
            show_evaluation(screen, one)

    return replace(
        result,
        sections=(results, *found),
        show=show,
        json=lambda: result.json() | {"against_truth": {f.name: f.to_dict() for f in found}},
    )


def _single(
    imu: Path,
    run: Run,
    answer: Answer,
    known: RunOptions,
    sensors: SensorOptions,
    reading: DriveReading,
) -> Result:
    """Navigate with one IMU."""
    from schuler.navigation.preparation.prepare import prepare
    from schuler.navigation.run import run as navigate_run
    from schuler.navigation.run import run_error_model
    from schuler.report import NavigationResults

    keywords = known.keywords()
    sensor = run.of.found()
    recording, fixes = load_drive(imu, run.gnss, reading, sensor)
    keywords = sensors.keywords(keywords, recording.time, fixes, repair=reading.repair)
    with working("Navigating") as shown:
        chosen, model = run.told.found(load_noise(run.noise, sensor), recording.rate)
        cut, setup = prepare(recording, fixes, model, progress=shown.say, **keywords)
        shown.say("smoothing" if answer.smooth else "filtering")
        how: dict[str, Any] = {"smooth": answer.smooth, "lag": answer.lag}
        if chosen is None:
            done = navigate_run(cut, fixes, setup, **how)
        else:
            for note in chosen.cautions:
                say(f"{chosen.name}: {note}")
            seen = chosen.measured(recording)
            done = run_error_model(chosen, seen, cut, fixes, setup, **how)
    results = NavigationResults(done.causal, done.smoothed or done.lagged, fixes)
    return navigation_result(results, f"Navigation of {title_of(imu)}", answer.out)


def _array(
    run: Run,
    answer: Answer,
    several: ArrayOptions,
    known: RunOptions,
    sensors: SensorOptions,
    reading: DriveReading,
) -> Result:
    """Run one mechanization of an array, or compare them all."""
    from schuler.arrays.slow_axes import follow_axes
    from schuler.evaluation.mechanizations import compare_mechanizations
    from schuler.navigation.mechanizations.navigate_array import navigate_array
    from schuler.navigation.settings import NavigationSettings
    from schuler.report import NavigationResults

    windows = parse_windows(several.window)
    array, fixes = load_array_drive(several, run.gnss, reading)
    followed: tuple[str, ...] = ()
    if several.follow_axes:
        array, axes = follow_axes(array)
        followed = axes.lines
    keywords = sensors.keywords(known.keywords(), array.time, fixes, repair=reading.repair)
    model = load_noise(run.noise)
    title = f"{array.count} IMUs, {title_of(several.array[0])}"
    if several.mechanization == ALL:
        with working("Comparing mechanizations") as shown:
            comparison = compare_mechanizations(
                array, fixes, model, NavigationSettings(**keywords), parity=several.parity,
                outages=windows, progress=shown.say,
            )  # fmt: skip
        return _comparison_result(comparison, f"Mechanizations of {title}", followed)
    with working("Navigating") as shown:
        done = navigate_array(
            array,
            fixes,
            model,
            mechanization=several.mechanization,  # type: ignore[arg-type]
            parity=several.parity,
            faults=several.faults,
            weights=several.weights,  # type: ignore[arg-type]
            outages=windows,
            smooth=answer.smooth if answer.lag is None else "fixed-lag",
            lag=answer.lag or 0.0,
            progress=shown.say,
            **keywords,
        )
    spans = tuple((fixes.time[0] + a, fixes.time[0] + a + b) for a, b in windows)
    late = done.solution.smoothed
    causal, smoothed = (None, done.solution) if late else (done.solution, None)
    results = NavigationResults(causal, smoothed, fixes, outages=spans)
    title = f"Navigation with {title}, {several.mechanization}"
    notes = (*followed, *done.prepared.notes)
    done.solution.settings["array_notes"] = list(notes)
    done.solution.settings["sensor_faults"]["notes"][:0] = followed
    return navigation_result(results, title, answer.out, notes)


def _require_for_arrays(
    several: ArrayOptions, answer: Answer, known: RunOptions, sensors: SensorOptions
) -> None:
    """Raise for what an array cannot take, by the names of the options."""
    from schuler.navigation.mechanizations.navigate_array import MECHANIZATIONS

    if answer.smooth and answer.lag is not None:
        raise InputError("--smooth and --lag with --array", expected="one of them")
    names = (ALL, *MECHANIZATIONS)
    if several.mechanization not in names:
        raise InputError(f"mechanization '{several.mechanization}'", expected=" or ".join(names))
    given = {
        "--out": answer.out is not None,
        "--truth": answer.truth is not None,
        "--smooth": answer.smooth,
        "--lag": answer.lag is not None,
        "--aid": bool(known.aid),
        "--update, --adaptive or --gnss-correlated": known.weighs,
        "another sensor": bool(sensors.files),
    }
    for option in (name for name, there in given.items() if there and several.mechanization == ALL):
        raise InputError(
            f"{option} with --mechanization all", expected="one mechanization", cure="name it"
        )


def navigation_result(
    results: NavigationResults, title: str, out: Path | None, notes: Sequence[str] = ()
) -> Result:
    """Return what becomes of a run; one whose findings are errors is a failed check."""
    from schuler.io.trajectory import write_trajectory

    causal, smoothed, best = results.causal or results.best, results.smoothed, results.best

    def show(screen: Screen) -> None:
        for note in notes:
            screen.line(f"note: {note}")
        show_navigation(screen, results)

    return Result(
        title=title,
        sections=(results,),
        show=show,
        json=lambda: navigation_summary(causal, smoothed),
        settings=best.settings,
        files=((out, lambda path: write_trajectory(path, best, form=out.suffix if out else "")),),
        failed=tuple(f["message"] for f in causal.settings["findings"] if f["severity"] == "error"),
    )


def _comparison_result(
    comparison: MechanizationComparison, title: str, notes: tuple[str, ...] = ()
) -> Result:
    from schuler.report.sections.arrays.mechanizations import comparison_rows

    def show(screen: Screen) -> None:
        screen.heading("Mechanizations", f"{comparison.prepared.array.count} IMUs")
        screen.table(*comparison_rows(comparison))
        for note in (*notes, *comparison.prepared.notes):
            screen.line(f"note: {note}")

    return Result(
        title=title,
        sections=(comparison,),
        show=show,
        json=comparison.to_dict,
        settings=comparison.prepared.setup.to_dict(),
    )


def navigation_summary(
    causal: NavigationSolution, smoothed: NavigationSolution | None
) -> dict[str, Any]:
    """Return what a machine wants to know about a run."""
    time = causal.trajectory.time
    return {
        "samples": causal.trajectory.size,
        "start_s": float(time[0]),
        "duration_s": float(time[-1] - time[0]),
        "causal": _answer(causal),
        "smoothed": None if smoothed is None else _answer(smoothed),
        "updates": _updates(causal),
        "findings": causal.settings["findings"],
        "settings": {k: v for k, v in causal.settings.items() if k != "findings"},
    }


def _answer(solution: NavigationSolution) -> dict[str, Any]:
    import numpy as np

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


def _updates(solution: NavigationSolution) -> dict[str, dict[str, Any]]:
    updates = {}
    for kind in solution.innovations.kinds:
        part = solution.innovations.of_kind(kind)
        kept = part.accepted
        updates[kind] = {
            "updates": int(part.nis.size),
            "rejected": int((~kept).sum()),
            "mean_nis_per_degree": float(part.nis[kept].sum() / max(part.degrees[kept].sum(), 1)),
        }
    return updates


def show_navigation(screen: Screen, results: NavigationResults) -> None:
    """Print what the filter claims and whether its claims are honest."""
    import numpy as np

    from schuler.report.numbers import duration, number

    def middle(values: Any, unit: str) -> str:
        return f"{number(float(np.median(values)))} {unit}"

    filtered = results.causal or results.best
    time = filtered.trajectory.time
    screen.heading("Navigation", duration(float(time[-1] - time[0])))
    rows = []
    for name, _, solution in results.solutions:
        if "lag_s" in solution.settings:
            name = f"lag of {number(solution.settings['lag_s'])} s"
        tilt = np.degrees(solution.attitude_sd)
        rows.append(
            (
                name,
                middle(np.sqrt(np.sum(solution.position_sd[:, :2] ** 2, axis=1)), "m"),
                middle(solution.position_sd[:, 2], "m"),
                middle(np.linalg.norm(solution.velocity_sd, axis=1), "m/s"),
                middle(tilt[:, :2], "deg"),
                middle(tilt[:, 2], "deg"),
            )
        )
    columns = ("claimed sd (median)", "horizontal", "vertical", "velocity", "tilt", "heading")
    screen.table(columns, rows)
    counts = [
        (kind, str(u["updates"]), str(u["rejected"]), number(u["mean_nis_per_degree"]))
        for kind, u in _updates(filtered).items()
    ]
    screen.table(("measurement", "updates", "kept out", "mean NIS a degree (1 is honest)"), counts)
    show_gnss_errors(screen, filtered.settings)
    show_run_findings(screen, filtered.settings["findings"])


def show_gnss_errors(screen: Screen, settings: dict[str, Any]) -> None:
    """Say in a line what was found of the errors of GNSS."""
    if "gnss_errors" in settings:
        screen.line(f"errors of GNSS positions: {settings['gnss_errors']}")


def show_run_findings(screen: Screen, findings: Sequence[dict[str, Any]]) -> None:
    """Print what the filter saw on the way, each with its cure."""
    for finding in findings:
        cure = f"; {finding['cure']}" if finding["cure"] else ""
        screen.finding(finding["severity"], finding["message"] + cure)
