"""`schuler fuse` and `schuler faults`: several IMUs made one, and watched."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from schuler.cli.reading import ImuReading

if TYPE_CHECKING:
    from schuler.arrays.detection.fault_log import FaultRecord
    from schuler.arrays.detection.faults import FaultDetection
    from schuler.arrays.detection.lasting_faults import LastingFaults
    from schuler.arrays.synthesis.synthetic import SyntheticImu
    from schuler.cli.console import Screen
    from schuler.data import ImuArray

# lines of a fault log on the terminal
MOST_RECORDS = 12

Files = Annotated[tuple[Path, ...], Parameter(name="FILES", negative=())]
Clocks = Literal["auto", "shared", "own"]
WeightName = Literal[
    "auto", "equal", "inverse_variance", "averaged_volatility", "ewma", "garch", "wavelet"
]


def fuse(
    files: Files,
    /,
    *,
    weights: WeightName = "auto",
    calibration: Path | None = None,
    without_faults: bool = False,
    time_constant: float = 2.0,
    learning: float = 10.0,
    clocks: Clocks = "auto",
    out: Path | None = None,
    noise_out: Path | None = None,
    report: Path | None = None,
    json: Path | None = None,
    reading: Annotated[ImuReading | None, Parameter(name="*")] = None,
) -> int:
    """Make one better IMU out of several on one body.

    Weighs every sensor by what redundancy shows of its noise, with the past alone, and says how
    much better the result is.

    Parameters
    ----------
    files : tuple of Path
        One file of several IMUs, several files, or a folder with imu1.*, imu2.*, ...
    weights : str
        How to weigh: auto follows the noise of every sensor (ewma); equal; inverse_variance;
        averaged_volatility; garch; wavelet, for long outages, with the array at rest.
    calibration : Path, optional
        Calibration of the array as YAML, from `schuler calibrate`.
    without_faults : bool
        Look for faulty sensors too and do without them.
    time_constant : float
        Memory of the noise of each sensor, s.
    learning : float
        Seconds at the beginning from which start values are taken.
    clocks : {"auto", "shared", "own"}
        Whether the files share a clock; "own": offset and rate of each are found.
    out : Path, optional
        Write the synthetic IMU here, .parquet; the other verbs read it.
    noise_out : Path, optional
        Write its noise model as YAML here.
    report : Path, optional
        Write a self-contained HTML page here.
    json : Path, optional
        Write all results in SI here; - for standard output.
    reading : ImuReading, optional
        How to read the files.
    """
    from schuler.cli.console import Screen
    from schuler.cli.loading import load_array, say_when_compiling
    from schuler.cli.outputs import STDOUT, Outputs, json_text
    from schuler.cli.provenance import command_provenance
    from schuler.execution.progress import progress

    inputs = (*files, *((calibration,) if calibration else ()))
    outputs = Outputs(out, noise_out, report, json, inputs=inputs)
    array = load_array(files, calibration, (reading or ImuReading()).options(), clocks)
    say_when_compiling()
    with progress("Fusing"):
        from schuler.arrays.detection.fault_settings import FaultSettings
        from schuler.arrays.synthesis.synthetic import synthesize
        from schuler.arrays.tracking import OnlineSettings

        how = OnlineSettings(time_constant=time_constant, learning=learning)
        done = synthesize(
            array,
            weights,
            settings=how,
            faults=FaultSettings(online=how) if without_faults else None,
        )
    origin = command_provenance(
        inputs=inputs, settings={"weights": done.weights, "time_constant_s": time_constant}
    )
    if report is not None:
        from schuler.report import render_report

        page = render_report(done, title=f"{array.count} IMUs made one", provenance=origin)
        outputs.text(report, lambda: page)
    outputs.file(out, done.imu.to_parquet)
    outputs.text(noise_out, done.noise_model.to_yaml)
    outputs.text(json, lambda: json_text(done.to_dict() | {"provenance": origin.to_dict()}))
    written = outputs.commit()
    show_synthetic(Screen(json_on_stdout=json == STDOUT), array, done, written)
    return 0


def faults(
    files: Files,
    /,
    *,
    calibration: Path | None = None,
    healthy: Annotated[tuple[Path, ...], Parameter(negative=())] = (),
    window: float = 1.0,
    false_alarm_rate: float | None = None,
    exclusions_per_hour: float = 1e-3,
    scale_uncertainty: float = 0.0,
    delay_uncertainty: float = 0.0,
    learning: float = 10.0,
    clocks: Clocks = "auto",
    report: Path | None = None,
    json: Path | None = None,
    reading: Annotated[ImuReading | None, Parameter(name="*")] = None,
) -> int:
    """Look for faulty sensors among the IMUs on one body; exit code 1 when there are any.

    Parameters
    ----------
    files : tuple of Path
        One file of several IMUs, several files, or a folder with imu1.*, imu2.*, ...
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
    report : Path, optional
        Write a self-contained HTML page here.
    json : Path, optional
        Write all results in SI here; - for standard output.
    reading : ImuReading, optional
        How to read the files.
    """
    from schuler.cli.console import Screen
    from schuler.cli.loading import load_array, say_when_compiling
    from schuler.cli.outputs import STDOUT, Outputs, json_text
    from schuler.cli.provenance import command_provenance
    from schuler.execution.progress import progress

    inputs = (*files, *healthy, *((calibration,) if calibration else ()))
    outputs = Outputs(report, json, inputs=inputs)
    found: FaultDetection | LastingFaults
    if healthy:
        found, used = _faults_in_motion(
            files, healthy, calibration, window, false_alarm_rate, clocks, reading
        )
    else:
        from schuler.arrays.calibration.result import ArrayCalibration
        from schuler.arrays.detection.fault_settings import FaultSettings
        from schuler.arrays.tracking import OnlineSettings

        array = load_array(files, None, (reading or ImuReading()).options(), clocks)
        rate = 0.001 if false_alarm_rate is None else false_alarm_rate
        settings = FaultSettings(
            false_alarm_rate=rate,
            exclusions_per_hour=exclusions_per_hour,
            scale_uncertainty=scale_uncertainty,
            delay_uncertainty=delay_uncertainty,
            online=OnlineSettings(learning=learning),
        )
        say_when_compiling()
        with progress("Looking for faults"):
            from schuler.arrays.detection.faults import detect_faults
            from schuler.arrays.detection.preparation import prepare_detection

            board = None if calibration is None else ArrayCalibration.load(calibration)
            ready = prepare_detection(array, settings, calibration=board)
            found = detect_faults(ready.array, ready.settings)
            found = replace(found, limits=(*ready.notes, *found.limits))
        used = {
            "false_alarm_rate": rate,
            "exclusions_per_hour": exclusions_per_hour,
            "scale_uncertainty": scale_uncertainty,
            "delay_uncertainty_s": delay_uncertainty,
        }
    origin = command_provenance(inputs=inputs, settings=used)
    if report is not None:
        from schuler.report import render_report

        page = render_report(found, title=f"Faults of {len(found.names)} IMUs", provenance=origin)
        outputs.text(report, lambda: page)
    outputs.text(json, lambda: json_text(found.to_dict() | {"provenance": origin.to_dict()}))
    written = outputs.commit()
    screen = Screen(json_on_stdout=json == STDOUT)
    _show_either(screen, found, written)
    return 0 if found.healthy else 1


def _show_either(
    screen: Screen, found: FaultDetection | LastingFaults, written: tuple[Path, ...]
) -> None:
    from schuler.arrays.detection.faults import FaultDetection

    if isinstance(found, FaultDetection):
        show_faults(screen, found, written)
    else:
        show_lasting_faults(screen, found, written)


def _faults_in_motion(
    files: tuple[Path, ...],
    healthy: tuple[Path, ...],
    calibration: Path | None,
    window: float,
    false_alarm_rate: float | None,
    clocks: Clocks,
    reading: ImuReading | None,
) -> tuple[LastingFaults, dict[str, Any]]:
    """Learn from the healthy recordings, and look at the files."""
    from schuler.arrays.calibration.result import ArrayCalibration
    from schuler.arrays.detection.healthy_motion import LastingFaultSettings, learn_healthy_motion
    from schuler.arrays.detection.lasting_faults import detect_lasting_faults
    from schuler.cli.loading import load_array
    from schuler.errors import InputError
    from schuler.execution.progress import progress

    if calibration is None:
        raise InputError(
            "healthy recordings without a calibration of the array",
            expected="the file that schuler calibrate wrote",
            cure="give it with --calibration",
        )
    rate = 0.01 if false_alarm_rate is None else false_alarm_rate
    settings = LastingFaultSettings(window=window, step=0.25 * window, false_alarm_rate=rate)
    board = ArrayCalibration.load(calibration)
    how = (reading or ImuReading()).options()
    array = load_array(files, None, how, clocks)
    board.check_fits(array)
    others = [load_array((one,), None, how, clocks) for one in healthy]
    with progress("Learning what is healthy"):
        normal = learn_healthy_motion(board, others, settings)
    with progress("Looking for faults"):
        found = detect_lasting_faults(board, array, normal)
    return found, {"window_s": window, "false_alarm_rate": rate}


def _show_records(screen: Screen, records: Sequence[FaultRecord]) -> None:
    for record in records[:MOST_RECORDS]:
        screen.finding("info" if record.kind == "missing" else "warning", record.text)
    if len(records) > MOST_RECORDS:
        left = len(records) - MOST_RECORDS
        screen.line(f"... and {left} more (--json or --report has all)", "dim")


def show_synthetic(
    screen: Screen, array: ImuArray, done: SyntheticImu, written: tuple[Path, ...] = ()
) -> None:
    """Print how much better one is than several."""
    from schuler.report.numbers import duration, number, percent
    from schuler.units import scale

    screen.heading(
        f"{array.count} IMUs made one", f"{duration(array.duration)}, weights {done.weights}"
    )
    rows: list[tuple[str, ...]] = []
    for fused in (done.gyro, done.accel):
        if fused is None:
            continue
        gyros = fused.sensors.sensor == "gyro"
        unit = scale("deg/s", "angular rate") if gyros else 1.0
        share = fused.weight.mean(axis=0)
        for u, name in enumerate(fused.sensors.unit_names):
            mine = fused.sensors.unit == u
            noise = " ".join(number(v / unit) for v in fused.mean_deviation[mine])
            rows.append((fused.sensors.sensor, name, noise, percent(float(share[mine].sum()))))
        mean = fused.mean_covariance.diagonal() ** 0.5
        together = " ".join(number(float(v) / unit) for v in mean)
        rows.append((fused.sensors.sensor, "together", together, percent(1.0)))
        screen_line = f"{percent(fused.reduction)} less noise than the mean of the sensors"
        rows.append(("", screen_line, "", ""))
    screen.table(("sensor", "IMU", "noise x y z (deg/s, m/s²)", "weight"), rows, words=3)
    if done.faults is not None:
        _show_records(screen, done.faults.records)
    for path in written:
        screen.line(f"wrote {path}")


def show_faults(screen: Screen, found: FaultDetection, written: tuple[Path, ...] = ()) -> None:
    """Print the log, and how often the sensors disagreed."""
    from schuler.report.numbers import number, percent

    screen.heading("Faults", f"{len(found.names)} IMUs")
    for line in found.limits:
        screen.finding("info", line)
    if not found.records:
        screen.finding("good", "no sensor was taken out")
    _show_records(screen, found.records)
    rows: list[tuple[str, ...]] = []
    for s in found.sensors:
        rate: Any = s.settings.false_alarm_rate
        used = min(s.used_share.values())
        rows.append(
            (
                s.sensor,
                f"{number(100.0 * s.exceedance())} % of {number(100.0 * rate)} %",
                f"{percent(s.exceedance(0.05))} of 5 %",
                str(sum(s.spikes.values())),
                percent(used),
            )
        )
    columns = ("sensor", "inconsistent", "inconsistent", "single spikes", "least used axis")
    screen.table(columns, rows)
    for path in written:
        screen.line(f"wrote {path}")


def show_lasting_faults(
    screen: Screen, found: LastingFaults, written: tuple[Path, ...] = ()
) -> None:
    """Print the log of lasting faults, and what could be found in which motion."""
    from schuler.arrays.detection.lasting_faults import TITLES
    from schuler.report.numbers import number
    from schuler.units import format_value

    windows = found.statistic.size
    length = found.normal.settings.window
    screen.heading(
        "Lasting faults of gyros", f"{len(found.names)} IMUs, {windows} windows of {length:g} s"
    )
    for line in found.limits:
        screen.finding("info", line)
    if not found.records:
        screen.finding("good", "no sensor is off for a window or longer")
    _show_records(screen, found.records)
    rows: list[tuple[str, ...]] = []
    for motion, title in enumerate(TITLES):
        inside = found.motion == motion
        smallest = found.smallest_fault(motion)
        if smallest is None:
            continue
        rows.append(
            (
                title,
                str(int(inside.sum())),
                f"{number(100.0 * float(found.alarm[inside].mean()))} %",
                format_value(smallest, "angular rate", digits=2),
            )
        )
    screen.table(("motion", "windows", "with an alarm", "found 95 times in 100"), rows)
    for path in written:
        screen.line(f"wrote {path}")
