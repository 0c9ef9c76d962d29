"""Arrays of IMUs on the command line: `navigate --array` and `observability`."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from schuler.cli.reading import DriveReading
from schuler.cli.running import RunOptions
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.data.array import ImuArray, Mounting
    from schuler.data.gnss import GnssRecording
    from schuler.evaluation.mechanizations import MechanizationComparison
    from schuler.navigation.observability_run import RunObservability

ALL = "all"


@dataclass(frozen=True)
class ArrayOptions:
    """Several IMUs on one body instead of one.

    Parameters
    ----------
    array : tuple of Path
        Recording of an array: one file or folder with several IMUs, or a file for each. May be
        repeated; takes the place of --imu.
    mount : tuple of str
        ROLL,PITCH,YAW[,X,Y,Z] of an IMU, in the order of the array: deg that turn the axes of the
        body into those of the IMU, and its place on the body in m. Given once for each IMU; all
        are aligned with the body if left out.
    calibration : Path, optional
        Calibration of the array as YAML, from `schuler calibrate`; takes the place of --mount.
    mechanization : str
        single, synthetic, extended, constrained or system; all compares them.
    parity : bool
        Whether the extended filter learns the bias of every sensor from the differences between
        them.
    window : tuple of str
        START:SECONDS without GNSS, seconds after the first epoch, which then judges the
        mechanizations there. May be repeated.
    """

    array: Annotated[tuple[Path, ...], Parameter(negative=())] = ()
    mount: Annotated[tuple[str, ...], Parameter(negative=())] = ()
    calibration: Path | None = None
    mechanization: str = "extended"
    parity: bool = True
    window: Annotated[tuple[str, ...], Parameter(negative=())] = ()

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that are read."""
        return (*self.array, *((self.calibration,) if self.calibration else ()))


def load_array_drive(
    options: ArrayOptions, gnss: Path, reading: DriveReading
) -> tuple[ImuArray, GnssRecording]:
    """Read an array and the GNSS recording beside it."""
    from schuler.cli.loading import load_array, load_gnss
    from schuler.cli.navigate import require_deviations

    if options.mount and options.calibration is not None:
        raise InputError(
            "--mount and --calibration together", expected="one of them: both say how IMUs sit"
        )
    array = load_array(options.array, options.calibration, reading.imu_options())
    if options.mount:
        array = replace(array, mounting=parse_mounting(options.mount, array.count))
    fixes = load_gnss(gnss, reading.gnss_options())
    require_deviations(fixes, gnss)
    return array, fixes


def array_keywords(known: RunOptions) -> dict[str, Any]:
    """Return what is known of a run with an array."""
    keywords = known.keywords()
    if "measurements" in keywords:
        raise InputError(
            "--update, --adaptive or --gnss-correlated with --array",
            expected="the gate and the receiver's own deviations",
        )
    return keywords


def parse_mounting(texts: tuple[str, ...], count: int) -> Mounting:
    """Return the mounting of all IMUs."""
    import numpy as np

    from schuler.cli.loading import parse_numbers
    from schuler.data.array import Mounting
    from schuler.rotations import dcm_from_euler

    if len(texts) != count:
        raise InputError(
            f"{len(texts)} mountings for {count} IMUs", expected="--mount once for each IMU"
        )
    example = "--mount ROLL,PITCH,YAW or ROLL,PITCH,YAW,X,Y,Z (deg, m), such as 0,0,-1.8"
    rotations, positions = [], []
    for text in texts:
        size = 6 if text.count(",") > 2 else 3
        numbers = parse_numbers(text, size, example)
        roll, pitch, yaw = (radians(a) for a in numbers[:3])
        rotations.append(dcm_from_euler(roll, pitch, yaw))
        positions.append(numbers[3:] or (0.0, 0.0, 0.0))
    return Mounting(np.stack(rotations), np.array(positions))


def navigate_arrays(
    options: ArrayOptions,
    gnss: Path,
    noise: Path | None,
    smooth: bool,
    files: tuple[Path | None, Path | None, Path | None],
    known: RunOptions,
    reading: DriveReading,
) -> int:
    """Run one mechanization, or compare them all. Arguments as for `schuler navigate`."""
    from schuler.cli.console import Screen
    from schuler.cli.loading import load_noise, say_when_compiling, title_of
    from schuler.cli.navigate import navigation_summary, show_navigation
    from schuler.cli.outages import parse_windows
    from schuler.cli.outputs import STDOUT, Outputs, json_text
    from schuler.cli.provenance import command_provenance
    from schuler.execution.progress import progress
    from schuler.io.trajectory import check_trajectory_name, write_trajectory
    from schuler.navigation.mechanizations.navigate_array import MECHANIZATIONS, navigate_array
    from schuler.report import NavigationResults, render_report

    out, report, json = files
    inputs = (*options.files, gnss, *((noise,) if noise else ()))
    outputs = Outputs(out, report, json, inputs=inputs)
    if out is not None:
        check_trajectory_name(out)
    names = (ALL, *MECHANIZATIONS)
    if options.mechanization not in names:
        raise InputError(f"mechanization '{options.mechanization}'", expected=" or ".join(names))
    windows = parse_windows(options.window, None)["windows"] if options.window else ()
    keywords = array_keywords(known)
    array, fixes = load_array_drive(options, gnss, reading)
    model = load_noise(noise)
    say_when_compiling()
    screen = Screen(json_on_stdout=json == STDOUT)
    title = f"{array.count} IMUs, {title_of(options.array[0])}"
    if options.mechanization == ALL:
        return _compare(
            array, fixes, model, options, windows, keywords, smooth, outputs, files, title, screen
        )
    with progress("Navigating") as shown:
        done = navigate_array(
            array,
            fixes,
            model,
            mechanization=options.mechanization,  # type: ignore[arg-type]
            parity=options.parity,
            outages=windows,
            smooth=smooth,
            progress=shown.say,
            **keywords,
        )
    causal = None if smooth else done.solution
    smoothed = done.solution if smooth else None
    if report is not None:
        spans = tuple((fixes.time[0] + a, fixes.time[0] + a + b) for a, b in windows)
        page = render_report(
            NavigationResults(causal, smoothed, fixes, outages=spans),
            title=f"Navigation with {title}, {options.mechanization}",
            provenance=command_provenance(inputs=inputs, settings=done.solution.settings),
        )
        outputs.text(report, lambda: page)
    if out is not None:
        outputs.file(out, lambda path: write_trajectory(path, done.solution, form=out.suffix))
    outputs.text(json, lambda: json_text(navigation_summary(done.solution, smoothed)))
    for note in done.prepared.notes:
        screen.line(f"note: {note}")
    show_navigation(screen, done.solution, None, outputs.commit())
    return 0


def _compare(
    array: ImuArray,
    fixes: GnssRecording,
    model: Any,
    options: ArrayOptions,
    windows: tuple[tuple[float, float], ...],
    keywords: dict[str, Any],
    smooth: bool,
    outputs: Any,
    files: tuple[Path | None, Path | None, Path | None],
    title: str,
    screen: Screen,
) -> int:
    """All mechanizations from one preparation, side by side."""
    from schuler.cli.outputs import json_text
    from schuler.cli.provenance import command_provenance
    from schuler.evaluation.mechanizations import compare_mechanizations
    from schuler.execution.progress import progress
    from schuler.navigation.settings import NavigationSettings
    from schuler.report import render_report

    out, report, json = files
    refused = {"--out": out is not None, "--smooth": smooth, "--aid": bool(keywords["aiding"])}
    for name, given in refused.items():
        if given:
            raise InputError(
                f"{name} with --mechanization all", expected="one mechanization", cure="name it"
            )
    told = NavigationSettings(**keywords)
    with progress("Comparing mechanizations") as shown:
        comparison = compare_mechanizations(
            array, fixes, model, told, parity=options.parity, outages=windows, progress=shown.say
        )
    if report is not None:
        page = render_report(
            comparison,
            title=f"Mechanizations of {title}",
            provenance=command_provenance(
                inputs=options.files, settings=comparison.prepared.setup.to_dict()
            ),
        )
        outputs.text(report, lambda: page)
    outputs.text(json, lambda: json_text(comparison.to_dict()))
    show_mechanizations(screen, comparison, outputs.commit())
    return 0


def show_mechanizations(
    screen: Screen, comparison: MechanizationComparison, written: tuple[Path, ...] = ()
) -> None:
    """Print the mechanizations side by side."""
    from schuler.report.sections.mechanizations import comparison_rows

    columns, rows = comparison_rows(comparison)
    screen.heading("Mechanizations", f"{comparison.prepared.array.count} IMUs")
    screen.table(columns, rows)
    for note in comparison.prepared.notes:
        screen.line(f"note: {note}")
    for path in written:
        screen.line(f"wrote {path}", "dim")


def observability(
    *,
    gnss: Path,
    imu: Path | None = None,
    noise: Path | None = None,
    report: Path | None = None,
    json: Path | None = None,
    several: Annotated[ArrayOptions | None, Parameter(name="*")] = None,
    known: Annotated[RunOptions | None, Parameter(name="*")] = None,
    reading: Annotated[DriveReading | None, Parameter(name="*")] = None,
) -> int:
    """Tell which parts of the state a run shows, and which it cannot.

    Ranks and singular values over the most different stretches of the run, information of all
    fixes against the prior, and what the filter learnt; in words. For an array the synthetic and
    the extended filter, without and with parity.

    Parameters
    ----------
    gnss : Path
        GNSS recording.
    imu : Path, optional
        Recording of a single IMU.
    noise : Path, optional
        Noise model as YAML, from `schuler characterize --noise-out`.
    report : Path, optional
        Write a self-contained HTML page here.
    json : Path, optional
        Write all results here; - for standard output.
    several : ArrayOptions, optional
        An array instead of a single IMU.
    known : RunOptions, optional
        What is known about the run.
    reading : DriveReading, optional
        How to read the files.
    """
    from schuler.cli.console import Screen
    from schuler.cli.loading import load_noise, say_when_compiling, title_of
    from schuler.cli.navigate import load_drive
    from schuler.cli.outputs import STDOUT, Outputs, json_text
    from schuler.cli.provenance import command_provenance
    from schuler.execution.progress import progress
    from schuler.navigation.mechanizations.array_preparation import prepare_array
    from schuler.navigation.observability_run import observe, observe_array
    from schuler.navigation.preparation.prepare import prepare
    from schuler.navigation.settings import NavigationSettings
    from schuler.report import render_report

    options = several or ArrayOptions()
    require_one(imu, options)
    files = options.files if imu is None else (imu,)
    inputs = (*files, gnss, *((noise,) if noise else ()))
    outputs = Outputs(report, json, inputs=inputs)
    told = known or RunOptions()
    keywords = (array_keywords(told) if imu is None else told.keywords()) | {"aiding": ()}
    how = reading or DriveReading()
    model = load_noise(noise)
    results: tuple[RunObservability, ...]
    if imu is None:
        array, fixes = load_array_drive(options, gnss, how)
        say_when_compiling()
        with progress("Observing") as shown:
            settings = NavigationSettings(**keywords)
            prepared = prepare_array(array, fixes, model, settings, shown.say)
            results = observe_array(prepared, fixes)
    else:
        recording, fixes = load_drive(imu, gnss, how)
        say_when_compiling()
        with progress("Observing") as shown:
            cut, setup = prepare(recording, fixes, model, progress=shown.say, **keywords)
            results = (observe("single IMU", cut, fixes, setup),)
    if report is not None:
        page = render_report(
            *results,
            title=f"Observability of {title_of(files[0])}",
            provenance=command_provenance(inputs=inputs, settings={}),
        )
        outputs.text(report, lambda: page)
    outputs.text(json, lambda: json_text({"filters": [r.to_dict() for r in results]}))
    show_observability(Screen(json_on_stdout=json == STDOUT), results, outputs.commit())
    return 0


def require_one(imu: Path | None, options: ArrayOptions) -> None:
    """Raise unless there is either an IMU or an array."""
    if (imu is None) == (not options.array):
        raise InputError(
            "no IMU" if imu is None else "--imu and --array together",
            expected="--imu FILE, or --array FILE (may be repeated)",
        )
    if imu is not None and options.calibration is not None:
        raise InputError("--calibration without --array", expected="both")


def show_observability(
    screen: Screen, results: tuple[RunObservability, ...], written: tuple[Path, ...] = ()
) -> None:
    """Print ranks and sentences."""
    screen.heading("Observability")
    rows = [
        (
            r.title,
            str(len(r.matrix.names)),
            str(r.matrix.rank),
            str(r.matrix.practical_rank),
            f"{r.matrix.relative[r.matrix.rank - 1]:.1g}",
            str(r.information.learnt),
        )
        for r in results
    ]
    columns = ("filter", "states", "seen", "seen well", "weakest", "learnt beyond the prior")
    screen.table(columns, rows)
    for result in results:
        screen.line(f"{result.title}:")
        for sentence in result.sentences():
            screen.line(f"  {sentence}")
    for path in written:
        screen.line(f"wrote {path}", "dim")
