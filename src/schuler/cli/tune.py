"""`schuler tune`: by how much a drive inflates the noise of a static log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from schuler.cli.reading import DriveReading
from schuler.cli.running import RunOptions

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.navigation.tuning.inflation import NoiseTuning


def tune(
    *,
    imu: Path,
    gnss: Path,
    noise: Path,
    noise_out: Path | None = None,
    report: Path | None = None,
    json: Path | None = None,
    known: Annotated[RunOptions | None, Parameter(name="*")] = None,
    reading: Annotated[DriveReading | None, Parameter(name="*")] = None,
) -> int:
    """Find by how much to inflate the noise of a static log for a filter, from a drive.

    Maximum likelihood of the innovations of GNSS, all of it and thinned to one fix in 2, 5 and
    10 s, over one factor each on white noise and bias walk of accelerometers and gyros, with 95 %
    intervals, and what the common factors 1, 3, 10, 30 and 100 would cost.

    Parameters
    ----------
    imu : Path
        IMU recording: CSV, text, Parquet, NPZ, ROS bag, or a folder with imu.* in it.
    gnss : Path
        GNSS recording: the same formats, or RTKLIB .pos.
    noise : Path
        Noise model as YAML, from `schuler characterize --noise-out`.
    noise_out : Path, optional
        Write the inflated model as YAML here, for `schuler navigate --noise`.
    report : Path, optional
        Write a self-contained HTML page here.
    json : Path, optional
        Write all results in SI here; - for standard output.
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
    from schuler.navigation.tuning.inflation import tune_noise
    from schuler.report import render_report

    inputs = (imu, gnss, noise)
    outputs = Outputs(noise_out, report, json, inputs=inputs)
    keywords = (known or RunOptions()).keywords()
    keywords.pop("tune_noise")
    recording, fixes = load_drive(imu, gnss, reading or DriveReading())
    model = load_noise(noise)
    assert model is not None
    say_when_compiling()
    with progress("Tuning") as shown:
        found = tune_noise(recording, fixes, model, progress=shown.say, **keywords)
    origin = command_provenance(inputs=inputs, settings=found.setup.to_dict())
    if report is not None:
        title = f"Noise of a drive against a static log: {title_of(imu)}"
        page = render_report(found, title=title, provenance=origin)
        outputs.text(report, lambda: page)
    outputs.text(noise_out, found.noise_model.to_yaml)
    outputs.text(json, lambda: json_text(found.to_dict() | {"provenance": origin.to_dict()}))
    written = outputs.commit()
    show_tuning(Screen(json_on_stdout=json == STDOUT), found, written)
    return 0


def show_tuning(screen: Screen, found: NoiseTuning, written: tuple[Path, ...] = ()) -> None:
    """Print factors with their intervals, and what others would cost."""
    from schuler.report.numbers import number
    from schuler.report.sections.tuning import inflation_rows, loss_rows

    screen.heading("Tuning", "how much the drive inflates the static numbers")
    columns, rows = inflation_rows(found)
    screen.table(columns, rows)
    screen.heading("Log-likelihood lost", "with a factor held and everything else at its best")
    columns, rows = loss_rows(found)
    screen.table(columns, rows)
    screen.line(
        f"NIS a degree (1 is honest): {number(found.nis_before)} with the static numbers, "
        f"{number(found.nis_after)} tuned"
    )
    for path in written:
        screen.line(f"wrote {path}", "dim")
