"""`schuler characterize`: a static log in, a noise model with errors out."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from schuler.cli.reading import ImuReading

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.estimation.characterization import ImuCharacterization
    from schuler.screening.screen import Screening

MOST_FINDINGS = 8
NARROW = 110
"""Columns below which errors are written in brackets."""


def characterize(
    file: Path,
    /,
    *,
    report: Path | None = None,
    json: Path | None = None,
    noise_out: Path | None = None,
    kalibr: Path | None = None,
    topic: str = "/imu0",
    repair: bool = False,
    strict: bool = False,
    method: tuple[str, ...] = (),
    model: str = "auto",
    rest: bool = False,
    reading: Annotated[ImuReading | None, Parameter(name="*")] = None,
) -> int:
    """Find the noise model of an IMU from a log of it lying still.

    Reads the log, screens it, computes the Allan deviation with its confidence, fits white
    noise, Gauss-Markov, random walk and what else the data support, and says how far the
    numbers can be trusted.

    Parameters
    ----------
    file : Path
        Static log: CSV, text, Parquet, NPZ, ROS 1 or ROS 2 bag, or a folder with imu.* in it.
    report : Path, optional
        Write a self-contained HTML page here.
    json : Path, optional
        Write all results in SI here; - for standard output.
    noise_out : Path, optional
        Write the noise model as YAML here, for `schuler navigate --noise`.
    kalibr : Path, optional
        Write imu.yaml for Kalibr and its relatives here.
    topic : str
        Name of the ROS topic in the Kalibr file.
    repair : bool
        Repair what the screening finds (knocks, outliers, repeated rows) before fitting.
    strict : bool
        Exit with code 1 when the screening finds something to watch that was not repaired.
    method : tuple of str
        How to find the noise: allan (the usual one), slope, psd, autocorrelation, gmwm,
        gmwm-robust, ml, ar, ar-covariance, ar-yule-walker, arma, fos, garch, or all. Given more
        than once, the methods are compared; noise model and Kalibr file come from the first.
    model : str
        Which processes to fit: auto (chosen by the data), classical (W+B+K), or letters such as
        W+G+K: W white noise, Q quantisation, B bias instability, G Gauss-Markov (up to three),
        K random walk, R ramp.
    rest : bool
        Use only the longest rest of a log in which the sensor was moved.
    reading : ImuReading, optional
        How to read the file.
    """
    from schuler.cli.console import Screen, say
    from schuler.cli.loading import load_imu, say_when_compiling, title_of
    from schuler.cli.methods import MethodFiles, add_kalibr, chosen_methods, compare_and_write
    from schuler.cli.outputs import STDOUT, Outputs, json_text
    from schuler.cli.provenance import command_provenance
    from schuler.estimation.parts import checked_model
    from schuler.execution.progress import progress
    from schuler.screening.screen import longest_rest, repair_until_clean, screen

    outputs = Outputs(report, json, noise_out, kalibr, inputs=(file,))
    methods = chosen_methods(method, needs_model=noise_out is not None or kalibr is not None)
    model = str(checked_model(model))
    imu = load_imu(file, (reading or ImuReading()).options(repair=repair))
    say_when_compiling()
    with progress("Screening"):
        screening = screen(imu)
        screening.require_usable()
        if rest:
            imu = longest_rest(imu, screening)
            screening = screen(imu)
        if repair:
            imu = repair_until_clean(imu, screening)
    if methods:
        return compare_and_write(
            imu, screening, methods, MethodFiles(file, report, json, noise_out, kalibr, topic),
            outputs, strict=strict and not repair, model=model,
        )  # fmt: skip
    with progress("Fitting the noise of every channel"):
        from schuler.estimation.characterization import characterize_imu

        result = characterize_imu(imu, model)
    origin = command_provenance(inputs=(file,), settings={"repair": repair, "model": model})
    if report is not None:
        from schuler.report import render_report

        page = render_report(
            result,
            screening,
            imu,
            title=f"Noise of {title_of(file)}",
            provenance=origin,
        )
        outputs.text(report, lambda: page)
    more = {"screening": screening.to_dict(), "provenance": origin.to_dict()}
    outputs.text(json, lambda: json_text(result.to_dict() | more))
    outputs.text(noise_out, result.noise_model.to_yaml)
    refused = add_kalibr(outputs, kalibr, result.noise_model, imu.rate, topic)
    written = outputs.commit()
    terminal = Screen(json_on_stdout=json == STDOUT)
    show_characterization(terminal, result, screening, written, repaired=repair)
    if refused:
        say(refused)
        return 1
    watch = sum(f.severity != "info" for f in screening.findings)
    if strict and watch and not repair:
        say(f"check failed: {watch} finding{'' if watch == 1 else 's'} to watch")
        return 1
    return 0


def show_characterization(
    screen: Screen,
    result: ImuCharacterization,
    screening: Screening,
    written: tuple[Path, ...] = (),
    *,
    repaired: bool = False,
) -> None:
    """Print the noise model and what to think of it."""
    from schuler.report.sections.ieee952 import ieee952_rows, plateau_note
    from schuler.report.sections.parameters import parameter_rows

    screen.heading(f"Noise of {result.recording_name}")
    if not screening.static:
        screen.finding("warning", moved_words(screening))
    narrow = screen.console.width < NARROW
    columns, rows = parameter_rows(result.noise_model, "datasheet", short=True, compact=narrow)
    screen.table(columns, rows, words=2)
    coefficients = {c: found.ieee952 for c, found in result.channels.items()}
    columns, rows = ieee952_rows(coefficients, "datasheet", compact=narrow)
    screen.table(columns, rows, words=2)
    if note := plateau_note(coefficients):
        screen.line(note, "dim")
    for text in result.findings:
        screen.finding("info", text)
    serious = [f for f in screening.findings if f.severity != "info"]
    for finding in serious[:MOST_FINDINGS]:
        screen.finding(finding.severity, finding.message)
    if len(serious) > MOST_FINDINGS:
        screen.line(f"... and {len(serious) - MOST_FINDINGS} more (see the report)", "dim")
    if screening.disturbed and not repaired:
        screen.line("--repair cuts out knocks and outliers before the fit.", "dim")
    for path in written:
        screen.line(f"wrote {path}", "dim")


def moved_words(screening: Screening) -> str:
    """Say that a log is not one at rest, and what helps."""
    from schuler.estimation.record import spell_duration

    longest = max((b - a for a, b in screening.rest), default=0.0)
    if longest <= 0.0:
        return "the sensor does not lie still: these numbers hold motion as well as noise"
    return (
        "the sensor was moved: these numbers hold motion as well as noise; --rest takes only its "
        f"longest rest, {spell_duration(longest)}"
    )
