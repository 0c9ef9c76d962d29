"""`schuler batch`: many logs into one database, and what they say of the fleet."""

from __future__ import annotations

import sys
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from cyclopts import Parameter

from schuler.cli.job import Job, Result, working
from schuler.cli.options.files import Written
from schuler.cli.parsing import parse_numbers
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.fleet.batch import BatchReport
    from schuler.fleet.database import Measurement
    from schuler.fleet.summary import FleetSummary

MOST = 12


@Parameter(name="*")
@dataclass(frozen=True)
class Workforce:
    """Who does the work.

    Parameters
    ----------
    processes : int, optional
        Processes of this machine; one for each core if not given. The numbers are the same.
    scheduler : str, optional
        Address of a Dask scheduler that does the work, such as tcp://10.0.0.5:8786.
    """

    processes: int | None = None
    scheduler: str | None = None


@Parameter(name="*")
@dataclass(frozen=True)
class Treatment:
    """How every log is treated.

    Parameters
    ----------
    model : str
        Which processes to fit to static logs, as for `schuler characterize`.
    repair : bool
        Repair what the screening finds.
    sweep : str
        LENGTH:EVERY of the outages by which drives are judged, s.
    aid : tuple of str
        What is known of the vehicle: nhc, zupt, wheel.
    gnss_position_sd, gnss_velocity_sd : float, optional
        Standard deviations of receivers that state none, m and m/s.
    profile : Path, optional
        How the files are read (rate, units, columns), from `schuler read --save-profile`, for
        logs whose row of the table names no other.
    """

    model: str = "auto"
    repair: bool = False
    sweep: str = "30:60"
    aid: tuple[str, ...] = ()
    gnss_position_sd: float | None = None
    gnss_velocity_sd: float | None = None
    profile: Path | None = None


def batch(
    logs: Path,
    /,
    *,
    out: Path,
    retry: bool = False,
    sensor: str | None = None,
    treatment: Treatment = Treatment(),
    workforce: Workforce = Workforce(),
    written: Written = Written(),
) -> int:
    """Measure every log of a folder or a table, and compare the sensors.

    Static logs become noise coefficients with errors, drives (rows with a `gnss` file, or folders
    with imu.* and gnss.*) are judged by GNSS outages. Everything is kept in one SQLite database;
    what is in it already is not done again, and a log that cannot be used is listed and does not
    stop the rest. `--sensor SERIAL --registry DATABASE` then gives other verbs the noise model and
    the calibration of a sensor.

    Example: `schuler batch logs.csv --out fleet.sqlite --report fleet.html`

    Parameters
    ----------
    logs : Path
        Folder, or CSV or Parquet table with a column file and, where known, sensor, serial,
        date, temperature (degrees Celsius), gnss, noise, calibration and profile.
    out : Path
        Database; made, or gone on with.
    retry : bool
        Do the logs that failed again.
    sensor : str, optional
        Show all that was measured of this serial number, by date, instead of the fleet.
    """
    if "numpy" not in sys.modules:
        from schuler.execution import one_thread

        one_thread()
    from schuler.execution import workers
    from schuler.fleet import BatchSettings, FleetDatabase, list_logs, run_batch, summarise_fleet
    from schuler.navigation.aiding.vehicle import check_constraints

    job = Job(written, inputs=(logs,))
    sweep = parse_numbers(treatment.sweep, 2, "--sweep LENGTH:EVERY, such as 30:60", ":")
    settings = BatchSettings(
        checked(treatment.model),
        treatment.repair,
        (sweep[0], sweep[1]),
        check_constraints(treatment.aid),
        treatment.gnss_position_sd,
        treatment.gnss_velocity_sd,
    )
    entries, remarks = list_logs(logs)
    entries = tuple(replace(e, profile=e.profile or treatment.profile) for e in entries)
    crew = workers(workforce.processes, workforce.scheduler)
    with FleetDatabase(out) as database:
        if retry:
            database.forget_failed()
        with working(f"{len(entries)} logs by {crew.words}") as shown:
            done = run_batch(
                entries,
                database,
                settings,
                executor=crew,
                told=lambda file, k, n: shown.tell(f"{k} of {n}: {Path(file).name}", k / n),
            )
        summary = summarise_fleet(database)
        history = () if sensor is None else tuple(database.measurements(sensor))
        if sensor is not None and not history:
            raise InputError(
                f"nothing is known of sensor '{sensor}'",
                expected=f"one of {', '.join(database.serials()[:8])}",
                where=str(out),
            )
    return job.finish(
        Result(
            title=f"Fleet of {logs.stem}",
            sections=(summary,),
            show=lambda screen: (
                show_history(screen, history)
                if history
                else show_fleet(screen, summary, done, remarks)
            ),
            json=lambda: (
                summary.to_dict()
                | {"remarks": list(remarks)}
                | ({"history": [asdict(m) for m in history]} if history else {})
            ),
            settings={"database": out.name},
            with_origin=True,
            passed=not done.failures,
        )
    )


def show_history(screen: Screen, history: tuple[Measurement, ...]) -> None:
    """Print what was measured of one sensor over time."""
    from schuler.report.sections.fleet import history_rows

    screen.heading(f"Sensor {history[0].serial}", history[0].sensor)
    columns, rows = history_rows(history)
    screen.table(columns, rows, words=3)


def checked(model: str) -> str:
    """Return the structure, or raise for one that does not exist."""
    from schuler.estimation.parts import checked_model

    return str(checked_model(model))


def show_fleet(
    screen: Screen, fleet: FleetSummary, done: BatchReport, remarks: tuple[str, ...]
) -> None:
    """Print what was done, the pooled values, and who stands out."""
    from schuler.report.sections.fleet import drive_rows, outlier_rows, parameter_rows, trend_rows

    screen.heading(
        "Fleet", f"{done.done} logs done, {done.known} known before, {len(done.failures)} failed"
    )
    screen.findings((("info", text) for text in remarks), most=MOST)
    screen.findings((("warning", why) for _, why in done.failures), most=MOST)
    for columns, rows in (
        parameter_rows(fleet), outlier_rows(fleet), trend_rows(fleet), drive_rows(fleet)
    ):  # fmt: skip
        if rows:
            screen.table(columns, rows[: 3 * MOST], words=3)
            screen.more(len(rows) - 3 * MOST)
