"""`schuler tune`: by how much a drive inflates the noise of a static log."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from schuler.cli.job import Job, Result, working
from schuler.cli.loading import load_drive
from schuler.cli.options.files import Written
from schuler.cli.options.reading import DriveReading
from schuler.cli.options.running import RunOptions
from schuler.cli.parsing import title_of

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.navigation.tuning.inflation import NoiseTuning


def tune(
    *,
    imu: Path,
    gnss: Path,
    noise: Path,
    noise_out: Path | None = None,
    written: Written = Written(),
    known: RunOptions = RunOptions(),
    reading: DriveReading = DriveReading(),
) -> int:
    """Find by how much to inflate the noise of a static log for a filter, from a drive.

    Maximum likelihood of the innovations of GNSS, all of it and thinned to one fix in 2, 5 and
    10 s, over one factor each on white noise and bias walk of accelerometers and gyros, with 95 %
    intervals, and what the common factors 1, 3, 10, 30 and 100 would cost.

    Example: `schuler tune --imu imu.csv --gnss gnss.csv --noise noise.yaml --noise-out tuned.yaml`

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
    """
    from schuler.navigation.tuning.inflation import tune_noise
    from schuler.noise import NoiseModel

    job = Job(written, noise_out, inputs=(imu, gnss, noise, reading.calibration))
    keywords = known.keywords()
    keywords.pop("tune_noise")
    recording, fixes = load_drive(imu, gnss, reading)
    model = NoiseModel.load(noise)
    with working("Tuning") as shown:
        found = tune_noise(recording, fixes, model, progress=shown.say, **keywords)
    return job.finish(
        Result(
            title=f"Noise of a drive against a static log: {title_of(imu)}",
            sections=(found,),
            show=lambda screen: show_tuning(screen, found),
            json=found.to_dict,
            settings=found.setup.to_dict(),
            texts=((noise_out, found.noise_model.to_yaml),),
            with_origin=True,
        )
    )


def show_tuning(screen: Screen, found: NoiseTuning) -> None:
    """Print factors with their intervals, and what others would cost."""
    from schuler.report.numbers import number
    from schuler.report.sections.navigation.tuning import inflation_rows, loss_rows

    screen.heading("Tuning", "how much the drive inflates the static numbers")
    screen.table(*inflation_rows(found))
    screen.heading("Log-likelihood lost", "with a factor held and everything else at its best")
    screen.table(*loss_rows(found))
    screen.line(
        f"NIS a degree (1 is honest): {number(found.nis_before)} with the static numbers, "
        f"{number(found.nis_after)} tuned"
    )
