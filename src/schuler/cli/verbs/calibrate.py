"""`schuler calibrate`: one IMU by hand, or the IMUs of an array against each other."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from cyclopts import Parameter

from schuler.cli.job import Job, Result, working
from schuler.cli.loading import load_array
from schuler.cli.options.files import Clocks, Files, Written
from schuler.cli.options.reading import ImuReading

if TYPE_CHECKING:
    from schuler.arrays.calibration.review import CalibrationReview
    from schuler.cli.console import Screen
    from schuler.data.imu import ImuRecording
    from schuler.data.imu_calibration import ImuCalibration


@Parameter(name="*")
@dataclass(frozen=True)
class CalibrationOptions:
    """How to calibrate.

    Parameters
    ----------
    clocks : {"auto", "shared", "own"}
        Whether the files share a clock; "own": offset and rate of each are found.
    model : {"matrix", "rotation"}
        All nine elements of each triad, or turns alone, for poor motion.
    timing : {"auto", "none", "constant", "polled"}
        Delays between the IMUs.
    bandwidth : float, optional
        Low-pass everything to this first, Hz, where vibration is not shared.
    gravity : float
        Local gravity, m/s^2.
    most : float, optional
        Exit with code 1 when the gyros disagree by more than this on any judged recording, rms in
        deg/s in the slowest class of motion.
    """

    clocks: Clocks = "auto"
    model: Literal["matrix", "rotation"] = "matrix"
    timing: Literal["auto", "none", "constant", "polled"] = "auto"
    bandwidth: float | None = None
    gravity: float = 9.80665
    most: float | None = None


def calibrate(
    files: Files,
    /,
    *,
    out: Path | None = None,
    on: tuple[Path, ...] = (),
    written: Written = Written(),
    options: CalibrationOptions = CalibrationOptions(),
    reading: ImuReading = ImuReading(),
) -> int:
    """Calibrate one IMU by hand, or the IMUs of an array against each other.

    One IMU: laid down in 12 or more poses and turned by hand between them; bias, scale and
    misalignment against gravity. An array: from a recording of it lying in several poses and
    being turned by hand about all axes:
    how the IMUs are turned, scale and misalignment, lever arms, biases, delays, each with its
    standard error, and how far the sensors are apart before and after.

    Example: `schuler calibrate board.csv --out board.yaml --report board.html`

    Parameters
    ----------
    files : tuple of Path
        A recording of one IMU, or one file of several IMUs, several files, or a folder with
        imu1.*, imu2.*, ...
    out : Path, optional
        Write the calibration as YAML here.
    on : tuple of Path
        Another recording of the same array to judge the calibration on. May be repeated.
    """
    from schuler.arrays.calibration.calibrate import calibrate_array
    from schuler.arrays.calibration.review import review_calibration

    job = Job(written, out, inputs=(*files, *on))
    if len(files) == 1 and not files[0].is_dir():
        from schuler.io import read_imus

        units = read_imus(files[0], **reading.options())
        if len(units) == 1:
            return job.finish(_one_imu(units[0], options.gravity, out))
    array = load_array(files, None, reading.options(), options.clocks)
    others = [(f.stem, load_array((f,), None, reading.options(), options.clocks)) for f in on]
    with working("Calibrating"):
        found = calibrate_array(
            array,
            gyro_model=options.model,
            accel_model=options.model,
            timing=options.timing,
            bandwidth=options.bandwidth,
            gravity=options.gravity,
        )
        name = files[0].stem if len(files) == 1 else f"{len(files)} files"
        review = review_calibration(found, array, name, others, bandwidth=options.bandwidth)
    return job.finish(
        Result(
            title=f"Calibration of {name}",
            sections=(review,),
            show=lambda screen: show_calibration(screen, review),
            json=lambda: _plain(review),
            settings={k: getattr(options, k) for k in ("model", "timing", "bandwidth")},
            texts=((out, found.to_yaml),),
            with_origin=True,
            failed=_failed(worst_of(review), options.most),
        )
    )


def _one_imu(imu: ImuRecording, gravity: float, out: Path | None) -> Result:
    """Calibrate a single unit."""
    from schuler.arrays.calibration.single_imu import calibrate_imu
    from schuler.report import Section, Table
    from schuler.report.makers import spoken

    with working("Calibrating"):
        found = calibrate_imu(imu, gravity=gravity)
    title = f"Calibration of {found.name}"
    head = f"{found.poses} poses, {found.turns} turns"
    columns = ("sensor", "bias", "scale correction", "leans to the other axes, deg")
    rows = _unit_rows(found)
    table = Table(head, columns, rows)

    def show(screen: Screen) -> None:
        screen.heading(title, head)
        screen.table(columns, rows)
        screen.findings(("info", text) for text in found.findings)

    return Result(
        title=title,
        sections=(Section(title, (table,), tuple(map(spoken, found.findings))), imu),
        show=show,
        json=found.to_dict,
        settings={"gravity": gravity},
        texts=((out, found.to_yaml),),
        with_origin=True,
    )


def _unit_rows(found: ImuCalibration) -> tuple[tuple[str, ...], ...]:
    """Bias and scale of every axis with their errors."""
    rows = []
    for sensor, unit, factor in (("accel", "m/s²", 1.0), ("gyro", "deg/s", math.degrees(1.0))):
        bias, bias_sd = getattr(found, f"{sensor}_bias"), getattr(found, f"{sensor}_bias_sd")
        matrix, sd = getattr(found, f"{sensor}_matrix"), getattr(found, f"{sensor}_matrix_sd")
        for i in range(3):
            across = (f"{'xyz'[j]} {math.degrees(matrix[i, j]):+.3f}" for j in range(3) if j != i)
            rows.append(
                (
                    f"{sensor} {'xyz'[i]}",
                    f"{factor * bias[i]:.4f} ± {factor * bias_sd[i]:.4f} {unit}".replace("-", "−"),
                    f"{100.0 * (matrix[i, i] - 1.0):+.3f} ± {100.0 * sd[i, i]:.3f} %".replace(
                        "-", "−"
                    ),
                    ", ".join(across).replace("-", "−"),
                )
            )
    return tuple(rows)


def _failed(worst: float, most: float | None) -> tuple[str, ...]:
    if most is None or worst <= most:
        return ()
    return (f"gyros disagree by {worst:.3g} deg/s rms, at most {most:g} wanted",)


def worst_of(review: CalibrationReview) -> float:
    """Return the largest rms of the gyros in the slowest class of motion, deg/s."""
    slowest = [
        next((d.rms for d in j.calibrated if d.quantity == "gyro" and d.limit > 0.0), math.nan)
        for j in review.judgements
    ]
    return math.degrees(max(slowest))


def _plain(review: CalibrationReview) -> dict[str, Any]:
    return {
        "calibration": review.calibration.to_dict(),
        "judged": [
            {"name": j.name, "estimated_on_it": j.estimated}
            | {
                k: [asdict(d) for d in getattr(j, k)]
                for k in ("nominal", "calibrated", "sharpened")
            }
            for j in review.judgements
        ],
    }


def show_calibration(screen: Screen, review: CalibrationReview) -> None:
    """Print what was found and what it is worth."""
    from schuler.report.sections.arrays.calibration import calibration_rows

    one = review.calibration
    screen.heading(f"Calibration of {one.count} IMUs", f"{one.rests} static poses")
    columns, rows = calibration_rows(one)
    # biases are for the page: a terminal has no room for them
    shown = [0, 1, 2, 3, 4, 5, -1]
    screen.table([columns[k] for k in shown], [[r[k] for k in shown] for r in rows], words=2)
    for judged in review.judgements:
        nominal = {(d.quantity, d.condition): d for d in judged.nominal}
        lines = []
        for d in judged.calibrated:
            gyro = d.quantity == "gyro"
            factor = math.degrees(1.0) if gyro else 1.0
            before = nominal.get((d.quantity, d.condition))
            values = (before.rms if before else None, d.rms, d.robust)
            cells = ("–" if v is None else f"{factor * v:.3f}" for v in values)
            lines.append(("gyros, deg/s" if gyro else "accelerometers, m/s²", d.condition, *cells))
        screen.line(f"{judged.name}: sensor minus mean (estimated on it: {judged.estimated})")
        screen.table(("", "", "nominal rms", "rms", "1.48 MAD"), lines, words=2)
    screen.findings(("info", text) for text in one.findings)
