"""`schuler demo`: the whole way, from a static log and a drive to a report."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from schuler.cli.console import MANNERS
from schuler.cli.job import Job, Result, working
from schuler.cli.loading import load_gnss, load_imu
from schuler.cli.options.files import ModelFiles, Written
from schuler.cli.outputs import json_text
from schuler.errors import InputError
from schuler.execution.progress import progress

if TYPE_CHECKING:
    from schuler.data.gnss import GnssRecording
    from schuler.data.imu import ImuRecording
    from schuler.data.trajectory import Trajectory
    from schuler.noise.noise_model import NoiseModel

OUT = Path("schuler-demo")
FILES = ("noise.yaml", "imu.yaml", "trajectory.parquet", "outages.json")
DRIVE_SECONDS = 600.0
OUTAGES = (30.0, 60.0)
"""Length of the windows and seconds from one to the next."""


@dataclass(frozen=True, slots=True)
class Material:
    """What the demo works on.

    Parameters
    ----------
    title : str
        Title of the report.
    static : ImuRecording or None
        Log of the sensor lying still.
    imu : ImuRecording or None
        Drive.
    gnss : GnssRecording or None
        Receiver on the drive.
    truth : Trajectory or None
        What really happened.
    same_sensor : bool
        The static log is of the sensor of the drive, so its noise model counts there.
    inputs : tuple of Path
        Files.
    seeds : dict
        Seeds of what was drawn.
    """

    title: str
    static: ImuRecording | None
    imu: ImuRecording | None
    gnss: GnssRecording | None
    truth: Trajectory | None = None
    same_sensor: bool = True
    inputs: tuple[Path, ...] = ()
    seeds: dict[str, int] | None = None


def demo(*, data: Path | None = None, out: Path = OUT) -> int:
    """Go the whole way once: static log and drive in, noise model, trajectory and report out.

    Without options the material is simulated: two hours of a MEMS sensor lying still, and ten
    minutes of it driving through a town with GNSS.

    Example: `schuler demo --out first-look`

    Parameters
    ----------
    data : Path, optional
        Folder with recordings: static.* and/or imu.* with gnss.*; or with folders that hold
        them.
    out : Path
        Folder for the report and the other files; made when missing. What an earlier demo left
        in the usual one is written over.
    """
    MANNERS.force |= out == OUT
    if out.exists() and not out.is_dir():
        raise InputError("is a file", expected="a folder for the results", where=str(out))
    material = find_recordings(data) if data is not None else simulated()
    existed = out.exists()
    out.mkdir(parents=True, exist_ok=True)
    try:
        files = (out / name for name in FILES)
        job = Job(Written(report=out / "report.html"), *files, inputs=material.inputs)
        code = job.finish(_whole_way(job, material, out))
    finally:
        if not existed and not any(out.iterdir()):
            out.rmdir()
    job.screen.console.print()
    job.screen.line(f"Open {out / 'report.html'} in a browser: it needs no network.", "bold")
    return code


def _whole_way(job: Job, material: Material, out: Path) -> Result:
    """Do the static log and the drive, each shown when it is done, and put them together."""
    parts: list[Result] = []

    def done(part: Result) -> None:
        part.show(job.screen)
        parts.append(part)

    model = None
    if material.static is not None:
        model, part = _static_part(material.static, out)
        done(part)
    if material.imu is not None and material.gnss is not None:
        if model is not None and not material.same_sensor:
            model = None
            job.screen.line(
                "The static log is of another sensor: the drive's noise comes from its data."
            )
        done(_drive(material, material.imu, material.gnss, model, out))
        done(_outages(material.imu, material.gnss, model, out))
    return Result(
        title=material.title,
        sections=tuple(s for part in parts for s in part.sections),
        settings={"outages": {"seconds": OUTAGES[0], "every": OUTAGES[1]}},
        seeds=material.seeds,
        texts=tuple(t for part in parts for t in part.texts),
        files=tuple(f for part in parts for f in part.files),
    )


def _static_part(static: ImuRecording, out: Path) -> tuple[NoiseModel, Result]:
    from schuler.cli.verbs.characterize import characterization_result, screened
    from schuler.estimation.characterization import characterize_imu

    with working("Static log: screening and fitting the noise"):
        recording, screening = screened(static, repair=True)
        found = characterize_imu(recording)
    files = ModelFiles(out / "noise.yaml", out / "imu.yaml")
    result = characterization_result(found, screening, recording, files, repaired=True)
    return found.noise_model, result


def _drive(
    material: Material, imu: ImuRecording, gnss: GnssRecording, noise: NoiseModel | None, out: Path
) -> Result:
    from schuler.cli.verbs.navigate import navigation_result
    from schuler.navigation.preparation.prepare import prepare
    from schuler.navigation.run import run
    from schuler.report import NavigationResults

    with working("Drive") as shown:
        cut, setup = prepare(imu, gnss, noise, progress=shown.say)
        done = run(cut, gnss, setup, smooth=True)
    results = NavigationResults(done.causal, done.smoothed, gnss, material.truth)
    return navigation_result(results, "Drive", out / "trajectory.parquet")


def _outages(imu: ImuRecording, gnss: GnssRecording, noise: NoiseModel | None, out: Path) -> Result:
    from schuler.cli.verbs.outages import outage_result
    from schuler.evaluation.outages import evaluate_outages
    from schuler.report.sections.navigation.outages import OutageResults

    with working("Drive without GNSS") as shown:
        found = evaluate_outages(imu, gnss, noise, sweep=OUTAGES, progress=shown.say)
    result = outage_result(found, gnss, "Outages", {})
    text = (out / "outages.json", lambda: json_text(found.to_dict()))
    return replace(result, sections=(OutageResults(found, gnss),), texts=(text,))


def simulated() -> Material:
    """Return the embedded example."""
    from schuler.cli.example import SEEDS, example_drive, example_static

    with progress("Simulating a static log and a drive"):
        static, drive = example_static(), example_drive(DRIVE_SECONDS)
    return Material(
        "Demonstration on simulated recordings",
        static,
        drive.imu,
        drive.gnss,
        drive.truth,
        seeds=SEEDS,
    )


def find_recordings(folder: Path) -> Material:
    """Find a static log and a drive in a folder or in folders within it."""
    if not folder.is_dir():
        raise InputError("no such folder", where=str(folder))
    static, drive = _static_file(folder), _drive_folder(folder)
    if static is None and drive is None:
        raise InputError(
            "no recordings found",
            expected="static.*, or imu.* and gnss.*, in it or in a folder within it",
            where=str(folder),
        )
    inputs = ([static] if static else []) + (_drive_files(drive) if drive else [])
    return Material(
        f"Recordings in {folder.resolve().name}",
        load_imu(static, {}) if static else None,
        load_imu(drive, {}) if drive else None,
        load_gnss(drive, {}) if drive else None,
        same_sensor=static is not None and drive is not None and static.parent == drive,
        inputs=tuple(inputs),
    )


def _files(folder: Path, stem: str) -> list[Path]:
    return sorted(p for p in folder.glob(f"{stem}.*") if p.is_file())


def _drive_files(folder: Path) -> list[Path]:
    fixes = _files(folder, "gnss") or _files(folder, "gps")
    return [*_files(folder, "imu")[:1], *fixes[:1]]


def _static_file(folder: Path) -> Path | None:
    """Return the log beside the drive, or the first file of the first folder named static."""
    here = _files(folder, "static")
    if here:
        return here[0]
    for inner in sorted(p for p in folder.iterdir() if p.is_dir() and "static" in p.name):
        logs = [p for p in sorted(inner.iterdir()) if p.suffix.lower() not in {".md", ".txt"}]
        if logs:
            return logs[0]
    return None


def _drive_folder(folder: Path) -> Path | None:
    """Return the folder with IMU and GNSS, one named after a drive before others."""
    inner = sorted(p for p in folder.iterdir() if p.is_dir())
    inner.sort(key=lambda p: "drive" not in p.name)
    return next((p for p in (folder, *inner) if len(_drive_files(p)) == 2), None)
