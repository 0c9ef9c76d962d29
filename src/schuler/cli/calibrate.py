"""`schuler calibrate`: the IMUs of an array against each other."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from schuler.cli.reading import ImuReading

if TYPE_CHECKING:
    from schuler.arrays.calibration.review import CalibrationReview
    from schuler.cli.console import Screen
    from schuler.cli.outputs import Outputs
    from schuler.data.imu import ImuRecording
    from schuler.data.imu_calibration import ImuCalibration


def calibrate(
    files: Annotated[tuple[Path, ...], Parameter(name="FILES", negative=())],
    /,
    *,
    out: Path | None = None,
    on: tuple[Path, ...] = (),
    report: Path | None = None,
    json: Path | None = None,
    clocks: Literal["auto", "shared", "own"] = "auto",
    model: Literal["matrix", "rotation"] = "matrix",
    timing: Literal["auto", "none", "constant", "polled"] = "auto",
    bandwidth: float | None = None,
    gravity: float = 9.80665,
    most: float | None = None,
    reading: Annotated[ImuReading | None, Parameter(name="*")] = None,
) -> int:
    """Calibrate one IMU by hand, or the IMUs of an array against each other.

    One IMU, laid down in 12 or more poses and turned by hand between them: bias, scale and
    misalignment against gravity. An array, lying in several poses and turned by hand about all
    axes: how the IMUs are turned, scale and misalignment, lever arms, biases, delays, and how far
    the sensors are apart before and after. Each with its standard error.

    Parameters
    ----------
    files : tuple of Path
        One file of several IMUs, several files, or a folder with imu1.*, imu2.*, ...
    out : Path, optional
        Write the calibration as YAML here.
    on : tuple of Path
        Another recording of the same array to judge the calibration on. May be repeated.
    report : Path, optional
        Write a self-contained HTML page here.
    json : Path, optional
        Write all results in SI here; - for standard output.
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
    reading : ImuReading, optional
        How to read the files.
    """
    from schuler.cli.console import Screen, say
    from schuler.cli.outputs import STDOUT, Outputs, json_text
    from schuler.cli.provenance import command_provenance
    from schuler.execution.progress import progress

    outputs = Outputs(out, report, json, inputs=(*files, *on))
    how = (reading or ImuReading()).options()
    if len(files) == 1 and not files[0].is_dir():
        from schuler.io import read_imus

        with progress(f"Reading {files[0].name}"):
            units = read_imus(files[0], **how)
        if len(units) == 1:
            return _one_imu(units[0], outputs, gravity, out, json)
    with progress(f"Reading {', '.join(f.name for f in files)}"):
        from schuler.arrays.read import read_array

        array = read_array(files if len(files) != 1 else files[0], clocks=clocks, **how)
        others = [(f.stem, read_array(f, clocks=clocks, **how)) for f in on]
    with progress("Calibrating"):
        from schuler.arrays.calibration.calibrate import calibrate_array
        from schuler.arrays.calibration.review import review_calibration

        found = calibrate_array(
            array, gyro_model=model, accel_model=model, timing=timing, bandwidth=bandwidth,
            gravity=gravity,
        )  # fmt: skip
        name = files[0].stem if len(files) == 1 else f"{len(files)} files"
        review = review_calibration(found, array, name, others, bandwidth=bandwidth)
    origin = command_provenance(
        inputs=(*files, *on), settings={"model": model, "timing": timing, "bandwidth": bandwidth}
    )
    if report is not None:
        from schuler.report import render_report

        page = render_report(review, title=f"Calibration of {name}", provenance=origin)
        outputs.text(report, lambda: page)
    outputs.text(out, found.to_yaml)
    outputs.text(json, lambda: json_text(_plain(review) | {"provenance": origin.to_dict()}))
    written = outputs.commit()
    show_calibration(Screen(json_on_stdout=json == STDOUT), review, written)
    worst = worst_of(review)
    if most is not None and not worst <= most:
        say(f"check failed: gyros disagree by {worst:.3g} deg/s rms, at most {most:g} wanted")
        return 1
    return 0


def _one_imu(
    imu: ImuRecording, outputs: Outputs, gravity: float, out: Path | None, json: Path | None
) -> int:
    """Calibrate a single unit and write what was found."""
    from schuler.arrays.calibration.single_imu import calibrate_imu
    from schuler.cli.console import Screen
    from schuler.cli.outputs import STDOUT, json_text
    from schuler.execution.progress import progress

    with progress("Calibrating"):
        found = calibrate_imu(imu, gravity=gravity)
    outputs.text(out, found.to_yaml)
    outputs.text(json, lambda: json_text(found.to_dict()))
    written = outputs.commit()
    screen = Screen(json_on_stdout=json == STDOUT)
    show_one(screen, found, written)
    return 0


def show_one(screen: Screen, found: ImuCalibration, written: tuple[Path, ...] = ()) -> None:
    """Print bias and scale of every axis with their errors."""
    import numpy as np

    screen.heading(f"Calibration of {found.name}", f"{found.poses} poses, {found.turns} turns")
    rows = []
    for sensor, unit, factor in (("accel", "m/s²", 1.0), ("gyro", "deg/s", np.degrees(1.0))):
        bias, bias_sd = getattr(found, f"{sensor}_bias"), getattr(found, f"{sensor}_bias_sd")
        matrix, sd = getattr(found, f"{sensor}_matrix"), getattr(found, f"{sensor}_matrix_sd")
        for i in range(3):
            across = [matrix[i, j] for j in range(3) if j != i]
            rows.append(
                (
                    f"{sensor} {'xyz'[i]}",
                    f"{factor * bias[i]:.4f} ± {factor * bias_sd[i]:.4f} {unit}",
                    f"{100.0 * (matrix[i, i] - 1.0):+.3f} ± {100.0 * sd[i, i]:.3f} %",
                    " ".join(f"{np.degrees(v):+.3f}" for v in across),
                )
            )
    screen.table(("sensor", "bias", "scale correction", "misalignment, deg"), rows)
    for text in found.findings:
        screen.finding("info", text)
    for path in written:
        screen.line(f"wrote {path}", "dim")


def worst_of(review: CalibrationReview) -> float:
    """Return the largest rms of the gyros in the slowest class of motion, deg/s."""
    import math

    slowest = [
        next((d.rms for d in j.calibrated if d.quantity == "gyro" and d.limit > 0.0), math.nan)
        for j in review.judgements
    ]
    return math.degrees(max(slowest))


def _plain(review: CalibrationReview) -> dict[str, Any]:
    from dataclasses import asdict

    return {
        "calibration": review.calibration.to_dict(),
        "judged": [
            {
                "name": j.name,
                "estimated_on_it": j.estimated,
                "nominal": [asdict(d) for d in j.nominal],
                "calibrated": [asdict(d) for d in j.calibrated],
                "sharpened": [asdict(d) for d in j.sharpened],
            }
            for j in review.judgements
        ],
    }


def show_calibration(
    screen: Screen, review: CalibrationReview, written: tuple[Path, ...] = ()
) -> None:
    """Print what was found and what it is worth."""
    import numpy as np

    from schuler.report.sections.calibration import calibration_rows

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
            factor = np.degrees(1.0) if d.quantity == "gyro" else 1.0
            before = nominal.get((d.quantity, d.condition))
            lines.append(
                (
                    "gyros, deg/s" if d.quantity == "gyro" else "accelerometers, m/s²",
                    d.condition,
                    "–" if before is None else f"{factor * before.rms:.3f}",
                    f"{factor * d.rms:.3f}",
                    f"{factor * d.robust:.3f}",
                )
            )
        screen.line(f"{judged.name}: sensor minus mean (estimated on it: {judged.estimated})")
        screen.table(("", "", "nominal rms", "rms", "1.48 MAD"), lines, words=2)
    for text in one.findings:
        screen.finding("info", text)
    for path in written:
        screen.line(f"wrote {path}", "dim")
