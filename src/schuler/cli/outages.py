"""`schuler outages`: how far it drifts when GNSS is gone, and whether it knows."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from schuler.cli.outage_models import ModelOptions
from schuler.cli.reading import DriveReading
from schuler.cli.running import RunOptions
from schuler.cli.sensors import SensorOptions
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.data.gnss import GnssRecording
    from schuler.evaluation.outages import OutageEvaluation

MOST_ROWS = 12


def outages(
    *,
    imu: Path,
    gnss: Path,
    noise: Path | None = None,
    window: tuple[str, ...] = (),
    sweep: str | None = None,
    limit: float | None = None,
    lag: float | None = None,
    report: Path | None = None,
    json: Path | None = None,
    told: Annotated[ModelOptions | None, Parameter(name="*")] = None,
    known: Annotated[RunOptions | None, Parameter(name="*")] = None,
    sensors: Annotated[SensorOptions | None, Parameter(name="*")] = None,
    reading: Annotated[DriveReading | None, Parameter(name="*")] = None,
) -> int:
    """Withhold GNSS in parts of a drive and measure the error against it.

    Time offsets, mounting and noise are taken from the data outside the windows only.

    Parameters
    ----------
    imu : Path
        IMU recording: CSV, text, Parquet, NPZ, ROS bag, or a folder with imu.* in it.
    gnss : Path
        GNSS recording: the same formats, or RTKLIB .pos.
    noise : Path, optional
        Noise model as YAML, from `schuler characterize --noise-out`.
    window : tuple of str
        START:SECONDS, with START in seconds after the first GNSS epoch. May be repeated.
    sweep : str, optional
        SECONDS:EVERY, windows of that length beginning every so many seconds; those that
        overlap are dealt into several runs.
    limit : float, optional
        Exit with code 1 when the causal mean of the largest errors (of the first error model) is
        above so many m.
    lag : float, optional
        Judge the fixed-lag smoother as well, which uses data up to so many seconds after every
        moment.
    report : Path, optional
        Write a self-contained HTML page here.
    json : Path, optional
        Write all results here; - for standard output.
    told : ModelOptions, optional
        Which error models to compare.
    known : RunOptions, optional
        What is known about the run.
    sensors : SensorOptions, optional
        Other sensors.
    reading : DriveReading, optional
        How to read the files.
    """
    from schuler.cli.console import Screen
    from schuler.cli.loading import load_noise, say_when_compiling, title_of
    from schuler.cli.navigate import load_drive
    from schuler.cli.outage_models import compare, comparison_json, show_comparison
    from schuler.cli.outputs import STDOUT, Outputs, json_text
    from schuler.cli.provenance import command_provenance
    from schuler.evaluation.outages import evaluate_outages
    from schuler.execution.progress import progress
    from schuler.report import render_report

    options, beside = told or ModelOptions(), sensors or SensorOptions()
    beside.check()
    inputs = tuple(f for f in (imu, gnss, noise, options.static, *beside.files) if f is not None)
    outputs = Outputs(report, json, inputs=inputs)
    which = parse_windows(window, sweep)
    keywords = (known or RunOptions()).keywords()
    models = options.names
    if lag is not None and not lag > 0.0:
        raise InputError(f"--lag {lag:g}", expected="seconds, above zero")
    if lag is not None and models:
        raise InputError("--lag with --models", expected="one of them")
    how = reading or DriveReading()
    recording, fixes = load_drive(imu, gnss, how)
    keywords = beside.keywords(keywords, recording.time, repair=how.repair)
    model = load_noise(noise)
    say_when_compiling()
    if models:
        comparison = compare(recording, fixes, model, options, keywords | which)
        settings = which | {"models": models, "shared": comparison.settings}
        origin = command_provenance(inputs=inputs, settings=settings)
        title = f"Error models in GNSS outages on {title_of(imu)}"
        if report is not None:
            text = render_report(comparison, title=title, provenance=origin)
            outputs.text(report, lambda: text)
        outputs.text(
            json, lambda: json_text(comparison_json(comparison) | {"provenance": origin.to_dict()})
        )
        show_comparison(Screen(json_on_stdout=json == STDOUT), comparison, outputs.commit())
        return _judge(comparison.results[0].all_causal.mean_of_max_m, limit)
    with progress("Evaluating outages") as shown:
        evaluation = evaluate_outages(
            recording, fixes, model, lag=lag, progress=shown.say, **keywords, **which
        )
    if report is not None:
        page = _page(evaluation, fixes, title_of(imu), inputs, which)
        outputs.text(report, lambda: page)
    outputs.text(json, lambda: json_text(evaluation.to_dict()))
    written = outputs.commit()
    show_outages(Screen(json_on_stdout=json == STDOUT), evaluation, written)
    return _judge(evaluation.causal.mean_of_max_m, limit)


def _judge(mean: float, limit: float | None) -> int:
    from schuler.cli.console import say

    if limit is not None and not mean <= limit:
        say(f"check failed: mean of the largest errors {mean:.3g} m is above {limit:g} m")
        return 1
    return 0


def parse_windows(window: tuple[str, ...], sweep: str | None) -> dict[str, Any]:
    """Return the windows as `evaluate_outages` wants them."""
    from schuler.cli.loading import parse_numbers

    if bool(window) == (sweep is not None):
        raise InputError(
            "which outages" if not window else "--window and --sweep together",
            expected="--window START:SECONDS (may be repeated) or --sweep SECONDS:EVERY",
        )
    if sweep is not None:
        example = "--sweep SECONDS:EVERY, both above zero, such as 30:10"
        numbers = parse_numbers(sweep, 2, example, ":")
        if min(numbers) <= 0.0:
            raise InputError(f"'{sweep}' is not understood", expected=example)
        return {"sweep": numbers}
    windows = []
    for text in window:
        example = "--window START:SECONDS with SECONDS above zero, such as 120:30"
        start, seconds = parse_numbers(text, 2, example, ":")
        if seconds <= 0.0:
            raise InputError(f"'{text}' is not understood", expected=example)
        windows.append((start, seconds))
    return {"windows": tuple(windows)}


def _page(
    evaluation: OutageEvaluation,
    gnss: GnssRecording,
    name: str,
    inputs: tuple[Path, ...],
    which: dict[str, Any],
) -> str:
    from schuler.cli.provenance import command_provenance
    from schuler.report import render_report
    from schuler.report.sections.outages import OutageResults

    results = OutageResults(evaluation, gnss)
    return render_report(
        evaluation,
        results.first_run,
        title=f"GNSS outages on {name}",
        provenance=command_provenance(inputs=inputs, settings=which | {"runs": evaluation.runs}),
    )


def show_outages(
    screen: Screen, evaluation: OutageEvaluation, written: tuple[Path, ...] = ()
) -> None:
    """Print causal against smoothed, claimed against real."""
    from schuler.cli.navigate import show_findings
    from schuler.report.numbers import number, percent

    answers = [("causal", evaluation.causal), ("smoothed", evaluation.smoothed)]
    if evaluation.lagged is not None:
        answers.insert(1, (f"lag of {number(evaluation.lag or 0.0)} s", evaluation.lagged))
    count = len(evaluation.causal.windows)
    screen.heading("Outages", f"{count} windows, horizontal error in m")
    rows = [
        (
            name,
            number(s.mean_of_max_m),
            number(s.median_of_max_m),
            number(s.worst_m),
            number(s.circular_error_m(0.95)),
            percent(s.within_2_sigma),
            number(s.claimed_over_real),
        )
        for name, s in answers
    ]
    overall = (
        "answer",
        "mean of maxima",
        "median",
        "worst",
        "CEP 95 %",
        "inside 2 sigma",
        "claimed/real",
    )
    screen.table(overall, rows)
    each = [
        (
            number(c.start_s, 4),
            number(c.duration_s),
            number(c.max_m),
            number(c.claimed_sd_m),
            number(s.max_m),
            number(s.claimed_sd_m),
        )
        for c, s in zip(evaluation.causal.windows, evaluation.smoothed.windows, strict=True)
    ]
    columns = ("start s", "length s", "causal max", "claimed sd", "smoothed max", "claimed sd")
    screen.table(columns, each[:MOST_ROWS], words=0)
    if len(each) > MOST_ROWS:
        screen.line(f"... and {len(each) - MOST_ROWS} more (--json or --report has all)", "dim")
    findings = evaluation.runs[0]["findings"] if evaluation.runs else []
    show_findings(screen, [f for f in findings if f["kind"] != "GNSS outage"])
    for path in written:
        screen.line(f"wrote {path}", "dim")
