"""`schuler fuse`: several IMUs made one."""

from __future__ import annotations

from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from cyclopts import Parameter

from schuler.cli.job import Job, Result, working
from schuler.cli.loading import load_array
from schuler.cli.options.files import Clocks, Files, Written
from schuler.cli.options.reading import ImuReading
from schuler.cli.verbs.faults import show_records

if TYPE_CHECKING:
    from schuler.arrays.synthesis.synthetic import SyntheticImu
    from schuler.cli.console import Screen
    from schuler.data import ImuArray

WeightName = Literal[
    "auto", "equal", "inverse_variance", "averaged_volatility", "ewma", "garch", "wavelet"
]


@Parameter(name="*")
@dataclass(frozen=True)
class FusionOptions:
    """How to fuse.

    Parameters
    ----------
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
    gyro_range : float, optional
        Full scale of the gyros, deg/s: beyond it the rate comes from the accelerometers of four or
        more IMUs at known places. Found where values pile up at one end if left out.
    clocks : {"auto", "shared", "own"}
        Whether the files share a clock; "own": offset and rate of each are found.
    """

    weights: WeightName = "auto"
    calibration: Path | None = None
    without_faults: bool = False
    time_constant: float = 2.0
    learning: float = 10.0
    gyro_range: float | None = None
    clocks: Clocks = "auto"


def fuse(
    files: Files,
    /,
    *,
    options: FusionOptions = FusionOptions(),
    out: Path | None = None,
    noise_out: Path | None = None,
    written: Written = Written(),
    reading: ImuReading = ImuReading(),
) -> int:
    """Make one better IMU out of several on one body.

    Weighs every sensor by what redundancy shows of its noise, with the past alone, and says how
    much better the result is.

    Example: `schuler fuse board/ --calibration board.yaml --out fused.parquet`

    Parameters
    ----------
    files : tuple of Path
        One file of several IMUs, several files, or a folder with imu1.*, imu2.*, ...
    out : Path, optional
        Write the synthetic IMU here, .parquet; the other verbs read it.
    noise_out : Path, optional
        Write its noise model as YAML here.
    """
    from schuler.arrays.detection.fault_settings import FaultSettings
    from schuler.arrays.synthesis.synthetic import synthesize
    from schuler.arrays.tracking import OnlineSettings

    job = Job(written, out, noise_out, inputs=(*files, options.calibration))
    array = load_array(files, options.calibration, reading.options(), options.clocks)
    how = OnlineSettings(time_constant=options.time_constant, learning=options.learning)
    with working("Fusing"):
        done = synthesize(
            array,
            options.weights,
            settings=how,
            faults=FaultSettings(online=how) if options.without_faults else None,
            gyro_range=None if options.gyro_range is None else radians(options.gyro_range),
        )
    return job.finish(
        Result(
            title=f"{array.count} IMUs made one",
            sections=(done,),
            show=lambda screen: show_synthetic(screen, array, done),
            json=done.to_dict,
            settings={"weights": done.weights, "time_constant_s": options.time_constant},
            files=((out, done.imu.to_parquet),),
            texts=((noise_out, done.noise_model.to_yaml),),
            with_origin=True,
        )
    )


def show_synthetic(screen: Screen, array: ImuArray, done: SyntheticImu) -> None:
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
        sensor = fused.sensors.sensor
        unit = scale("deg/s", "angular rate") if sensor == "gyro" else 1.0
        share = fused.weight.mean(axis=0)
        for u, name in enumerate(fused.sensors.unit_names):
            mine = fused.sensors.unit == u
            noise = " ".join(number(v / unit) for v in fused.mean_deviation[mine])
            rows.append((sensor, name, noise, percent(float(share[mine].sum()))))
        mean = fused.mean_covariance.diagonal() ** 0.5
        together = " ".join(number(float(v) / unit) for v in mean)
        rows.append((sensor, "together", together, percent(1.0)))
        gain = f"{percent(fused.reduction)} less noise than the mean of the sensors"
        rows.append(("", gain, "", ""))
    screen.table(("sensor", "IMU", "noise x y z (deg/s, m/s²)", "weight"), rows, words=3)
    if done.beyond is not None:
        degree, b = scale("deg/s", "angular rate"), done.beyond
        bound = " ".join(number(float(v) / degree) for v in b.bound)
        screen.line(
            f"{b.samples} samples beyond {number(b.gyro_range / degree)} deg/s: in {b.found} of "
            "them the rate is that of accelerometers and gyros in range together (Cramér-Rao bound "
            f"x y z: {bound} deg/s)"
        )
    if done.faults is not None:
        show_records(screen, done.faults.records)
