"""`schuler outages`: how far it drifts when GNSS is gone, and whether it knows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from schuler.cli.error_models import compare, comparison_result
from schuler.cli.job import Job, Result, working
from schuler.cli.loading import load_drive, load_noise
from schuler.cli.options.error_models import ModelOptions
from schuler.cli.options.files import Drive, Written
from schuler.cli.options.outages import OutageOptions
from schuler.cli.options.reading import DriveReading
from schuler.cli.options.running import RunOptions
from schuler.cli.options.sensors import SensorOptions
from schuler.cli.parsing import title_of
from schuler.cli.verbs.navigate import show_gnss_errors, show_run_findings
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.data.gnss import GnssRecording
    from schuler.evaluation.outages import OutageEvaluation

MOST_ROWS = 12


def outages(
    *,
    drive: Drive,
    lost: OutageOptions = OutageOptions(),
    written: Written = Written(),
    told: ModelOptions = ModelOptions(),
    known: RunOptions = RunOptions(),
    sensors: SensorOptions = SensorOptions(),
    reading: DriveReading = DriveReading(),
) -> int:
    """Withhold GNSS in parts of a drive and measure the error against it.

    Time offsets, mounting and noise are taken from the data outside the windows only.

    Example: `schuler outages --imu imu.csv --gnss gnss.csv --sweep 30:60 --report outages.html`

    """
    from schuler.evaluation.outages import evaluate_outages

    sensors.check()
    inputs = (drive.imu, drive.gnss, drive.noise, reading.calibration, told.static, *sensors.files)
    job = Job(written, inputs=inputs)
    which, keywords, models = lost.keywords(), known.keywords(), told.names
    if lost.lag is not None and models:
        raise InputError("--lag with --models", expected="one of them")
    sensor = drive.of.found()
    recording, fixes = load_drive(drive.imu, drive.gnss, reading, sensor)
    keywords = which | sensors.keywords(keywords, recording.time, fixes, repair=reading.repair)
    model, name = load_noise(drive.noise, sensor), title_of(drive.imu)
    if models:
        comparison = compare(recording, fixes, model, told, keywords)
        title = f"Error models in GNSS outages on {name}"
        settings = which | {"models": models, "shared": comparison.settings}
        failed = lost.failed(comparison.results[0].all_causal.mean_of_max_m)
        return job.finish(comparison_result(comparison, title, settings, failed))
    with working("Evaluating outages") as shown:
        found = evaluate_outages(
            recording, fixes, model, lag=lost.lag, progress=shown.say, **keywords
        )
    failed = lost.failed(found.causal.mean_of_max_m)
    return job.finish(outage_result(found, fixes, f"GNSS outages on {name}", which, failed))


def outage_result(
    found: OutageEvaluation,
    fixes: GnssRecording,
    title: str,
    which: dict[str, Any],
    failed: tuple[str, ...] = (),
) -> Result:
    """Return what becomes of an evaluation."""
    from schuler.report.sections.navigation.outages import OutageResults

    return Result(
        title=title,
        sections=(found, OutageResults(found, fixes).first_run),
        show=lambda screen: show_outages(screen, found),
        json=found.to_dict,
        settings=which | {"runs": found.runs},
        failed=failed,
    )


def show_outages(screen: Screen, evaluation: OutageEvaluation) -> None:
    """Print causal against smoothed, claimed against real."""
    from schuler.report.numbers import number, percent
    from schuler.report.sections.navigation.outages import answers

    windows = evaluation.causal.windows
    screen.heading("Outages", f"{len(windows)} windows, horizontal error in m")
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
        for name, _, s in answers(evaluation)
    ]
    columns = ("answer", "mean of maxima", "median", "worst", "CEP 95 %")
    screen.table((*columns, "inside 2 sigma", "claimed/real"), rows)
    each = [
        (
            number(c.start_s, 4),
            number(c.duration_s),
            number(c.max_m),
            number(c.claimed_sd_m),
            number(s.max_m),
            number(s.claimed_sd_m),
        )
        for c, s in zip(windows, evaluation.smoothed.windows, strict=True)
    ]
    headings = ("start s", "length s", "causal max", "claimed sd", "smoothed max", "claimed sd")
    screen.table(headings, each[:MOST_ROWS], words=0)
    screen.more(len(each) - MOST_ROWS)
    if evaluation.runs:
        show_gnss_errors(screen, evaluation.runs[0])
    findings = evaluation.runs[0]["findings"] if evaluation.runs else []
    show_run_findings(screen, [f for f in findings if f["kind"] != "GNSS outage"])
