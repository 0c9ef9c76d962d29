"""`schuler observability`: what a run shows of the state of its filter."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from schuler.cli.job import Job, Result, working
from schuler.cli.loading import load_array_drive, load_drive, load_noise
from schuler.cli.options.arrays import ArrayOptions
from schuler.cli.options.files import Run, Written
from schuler.cli.options.reading import DriveReading
from schuler.cli.options.running import RunOptions
from schuler.cli.parsing import title_of
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.navigation.observability_run import RunObservability


def observability(
    *,
    run: Run,
    written: Written = Written(),
    several: ArrayOptions = ArrayOptions(),
    known: RunOptions = RunOptions(),
    reading: DriveReading = DriveReading(),
) -> int:
    """Tell which parts of the state a run shows, and which it cannot.

    Ranks and singular values over the most different stretches of the run, information of all
    fixes against the prior, and what the filter learnt; in words. For an array the synthetic and
    the extended filter, without and with parity.

    Example: `schuler observability --imu imu.csv --gnss gnss.csv --report observability.html`

    """
    files = several.files(run.imu)
    job = Job(written, inputs=(*files, reading.calibration, run.gnss, run.noise))
    found = _observed(run, several, known, reading)
    return job.finish(
        Result(
            title=f"Observability of {title_of(files[0])}",
            sections=found,
            show=lambda screen: show_observability(screen, found),
            json=lambda: {"filters": [r.to_dict() for r in found]},
        )
    )


def _observed(
    run: Run, several: ArrayOptions, known: RunOptions, reading: DriveReading
) -> tuple[RunObservability, ...]:
    from schuler.navigation.aiding.options import PLAIN
    from schuler.navigation.mechanizations.array_preparation import prepare_array
    from schuler.navigation.observability_run import observe, observe_array
    from schuler.navigation.preparation.prepare import prepare
    from schuler.navigation.settings import NavigationSettings

    keywords = known.keywords() | {"aiding": ()}
    # slow errors of GNSS are hidden by what they are: what is asked is what hides of the sensors
    white = replace(keywords.get("measurements", PLAIN), correlated=None)
    keywords |= {"measurements": white}
    sensor = run.of.found()
    model = load_noise(run.noise, sensor)
    if run.imu is None:
        if sensor is not None:
            raise InputError("--sensor with --array", expected="one IMU (--imu)")
        array, fixes = load_array_drive(several, run.gnss, reading)
        with working("Observing") as shown:
            settings = NavigationSettings(**keywords)
            prepared = prepare_array(array, fixes, model, settings, shown.say)
            return observe_array(prepared, fixes)
    recording, fixes = load_drive(run.imu, run.gnss, reading, sensor)
    with working("Observing") as shown:
        cut, setup = prepare(recording, fixes, model, progress=shown.say, **keywords)
        return (observe("single IMU", cut, fixes, setup),)


def show_observability(screen: Screen, results: tuple[RunObservability, ...]) -> None:
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
