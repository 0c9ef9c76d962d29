"""`schuler faults`: faulty sensors among the IMUs of an array."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, TypeAlias

from cyclopts import Parameter

from schuler.cli.job import Job, Result, working
from schuler.cli.loading import load_array
from schuler.cli.options.files import Clocks, Files, Written
from schuler.cli.options.reading import ImuReading
from schuler.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Sequence

    from schuler.arrays.detection.fault_log import FaultRecord
    from schuler.arrays.detection.faults import FaultDetection
    from schuler.arrays.detection.lasting_faults import LastingFaults
    from schuler.cli.console import Screen

MOST_RECORDS = 12
Rows: TypeAlias = list[tuple[str, ...]]


@Parameter(name="*")
@dataclass(frozen=True)
class FaultOptions:
    """What counts as a fault.

    Parameters
    ----------
    calibration : Path, optional
        Calibration of the array as YAML, from `schuler calibrate`.
    healthy : tuple of Path
        Recordings of the same array without faults, each a file or a folder. With a calibration,
        offsets of the gyros over windows are then compared with what they are in motion of the
        same kind: for arrays that turn fast. Give --healthy once for each.
    window : float
        Length of these windows, s.
    false_alarm_rate : float, optional
        Probability that a sample (0.001), or a window (0.01), without fault counts as
        inconsistent.
    exclusions_per_hour : float
        Healthy sensors that may be taken out in an hour.
    scale_uncertainty : float
        What scale factors and misalignments leave, as a share of the motion (0.01: one percent).
    delay_uncertainty : float
        Timing between the sensors that is not known, s.
    learning : float
        Seconds at the beginning from which start values are taken.
    clocks : {"auto", "shared", "own"}
        Whether the files share a clock; "own": offset and rate of each are found.
    """

    calibration: Path | None = None
    healthy: Annotated[tuple[Path, ...], Parameter(negative=())] = ()
    window: float = 1.0
    false_alarm_rate: float | None = None
    exclusions_per_hour: float = 1e-3
    scale_uncertainty: float = 0.0
    delay_uncertainty: float = 0.0
    learning: float = 10.0
    clocks: Clocks = "auto"

    def rate(self, usual: float) -> float:
        """Return the false-alarm rate asked for, or the usual one."""
        return usual if self.false_alarm_rate is None else self.false_alarm_rate


def faults(
    files: Files,
    /,
    *,
    options: FaultOptions = FaultOptions(),
    written: Written = Written(),
    reading: ImuReading = ImuReading(),
) -> int:
    """Look for faulty sensors among the IMUs on one body; exit code 1 when there are any.

    Example: `schuler faults board/ --calibration board.yaml --report faults.html`

    Parameters
    ----------
    files : tuple of Path
        One file of several IMUs, several files, or a folder with imu1.*, imu2.*, ...
    """
    job = Job(written, inputs=(*files, *options.healthy, options.calibration))
    look = _in_motion if options.healthy else _sample_by_sample
    return job.finish(look(files, options, reading))


def _sample_by_sample(
    files: tuple[Path, ...], options: FaultOptions, reading: ImuReading
) -> Result:
    """Test every sample and its means against the noise."""
    from schuler.arrays.calibration.result import ArrayCalibration
    from schuler.arrays.detection.calibrated_parts import prepare_by_parts
    from schuler.arrays.detection.fault_settings import FaultSettings
    from schuler.arrays.detection.faults import detect_faults
    from schuler.arrays.tracking import OnlineSettings

    array = load_array(files, None, reading.options(), options.clocks)
    rate = options.rate(0.001)
    settings = FaultSettings(
        false_alarm_rate=rate,
        exclusions_per_hour=options.exclusions_per_hour,
        scale_uncertainty=options.scale_uncertainty,
        delay_uncertainty=options.delay_uncertainty,
        online=OnlineSettings(learning=options.learning),
    )
    with working("Looking for faults"):
        path = options.calibration
        board = None if path is None else ArrayCalibration.load(path)
        ready = prepare_by_parts(array, settings, calibration=board)
        found = detect_faults(ready.array, ready.settings)
        found = replace(found, limits=(*ready.notes, *found.limits))
    used = {
        "false_alarm_rate": rate,
        "exclusions_per_hour": options.exclusions_per_hour,
        "scale_uncertainty": options.scale_uncertainty,
        "delay_uncertainty_s": options.delay_uncertainty,
    }
    return _result(found, used)


def _in_motion(files: tuple[Path, ...], options: FaultOptions, reading: ImuReading) -> Result:
    """Learn from the healthy recordings, and look at the files."""
    from schuler.arrays.calibration.result import ArrayCalibration
    from schuler.arrays.detection.healthy_motion import LastingFaultSettings, learn_healthy_motion
    from schuler.arrays.detection.lasting_faults import detect_lasting_faults

    if options.calibration is None:
        raise InputError(
            "healthy recordings without a calibration of the array",
            expected="the file that schuler calibrate wrote",
            cure="give it with --calibration",
        )
    rate, window = options.rate(0.01), options.window
    settings = LastingFaultSettings(window=window, step=0.25 * window, false_alarm_rate=rate)
    board = ArrayCalibration.load(options.calibration)
    array = load_array(files, None, reading.options(), options.clocks)
    board.check_fits(array)
    others = [load_array((f,), None, reading.options(), options.clocks) for f in options.healthy]
    with working("Learning what is healthy"):
        normal = learn_healthy_motion(board, others, settings)
    with working("Looking for faults"):
        found = detect_lasting_faults(board, array, normal)
    return _result(found, {"window_s": window, "false_alarm_rate": rate})


def _result(found: FaultDetection | LastingFaults, used: dict[str, float]) -> Result:
    return Result(
        title=f"Faults of {len(found.names)} IMUs",
        sections=(found,),
        show=lambda screen: show_faults(screen, found),
        json=found.to_dict,
        settings=used,
        with_origin=True,
        passed=found.healthy,
    )


def show_records(screen: Screen, records: Sequence[FaultRecord]) -> None:
    """Print the first lines of a fault log."""
    from schuler.arrays.detection.fault_log import told_records

    screen.findings(told_records(records), most=MOST_RECORDS)


def show_faults(screen: Screen, found: FaultDetection | LastingFaults) -> None:
    """Print the log, and how often sensors disagreed or what could be found in which motion."""
    from schuler.arrays.detection.faults import FaultDetection

    detail, count = "", f"{len(found.names)} IMUs"
    if isinstance(found, FaultDetection):
        title, nothing, table = "Faults", "was taken out", _sample_rows(found)
    else:
        title, nothing = "Lasting faults of gyros", "is off for a window or longer"
        table = _motion_rows(found)
        detail = f", {found.statistic.size} windows of {found.normal.settings.window:g} s"
    screen.heading(title, count + detail)
    screen.findings(("info", line) for line in found.limits)
    if found.healthy:
        screen.finding("good", f"no sensor {nothing}")
    show_records(screen, found.records)
    screen.table(*table)


def _sample_rows(found: FaultDetection) -> tuple[tuple[str, ...], Rows]:
    from schuler.report.numbers import number, percent

    def share(value: float) -> str:
        return f"{number(100.0 * value)} %"

    rows: Rows = [
        (
            s.sensor,
            f"{share(s.exceedance())} of {share(s.settings.false_alarm_rate)}",
            f"{percent(s.exceedance(0.05))} of 5 %",
            str(sum(s.spikes.values())),
            percent(min(s.used_share.values())),
        )
        for s in found.sensors
    ]
    return ("sensor", "inconsistent", "inconsistent", "single spikes", "least used axis"), rows


def _motion_rows(found: LastingFaults) -> tuple[tuple[str, ...], Rows]:
    from schuler.report.sections.arrays.lasting_faults import motion_rows

    rows = [row[:4] for row in motion_rows(found)]
    return ("motion", "windows", "with an alarm", "found 95 times in 100"), rows
