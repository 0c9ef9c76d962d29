"""`schuler demo`: the whole way, from a static log and a drive to a report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.cli.console import Screen
    from schuler.data.gnss import GnssRecording
    from schuler.data.imu import ImuRecording
    from schuler.data.trajectory import Trajectory
    from schuler.noise.noise_model import NoiseModel
    from schuler.report.provenance import Provenance

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


def demo(*, data: Path | None = None, out: Path = Path("schuler-demo")) -> int:
    """Go the whole way once: static log and drive in, noise model, trajectory and report out.

    Without options the material is simulated: two hours of a MEMS sensor lying still, and ten
    minutes of it driving through a town with GNSS.

    Parameters
    ----------
    data : Path, optional
        Folder with recordings: static.* and/or imu.* with gnss.*; or with folders that hold
        them.
    out : Path
        Folder for the report and the other files; made when missing.
    """
    from schuler.cli.console import Screen
    from schuler.cli.loading import say_when_compiling
    from schuler.cli.outputs import Outputs

    if out.exists() and not out.is_dir():
        raise InputError("is a file", expected="a folder for the results", where=str(out))
    material = find_recordings(data) if data is not None else simulated()
    say_when_compiling()
    existed = out.exists()
    out.mkdir(parents=True, exist_ok=True)
    try:
        outputs = Outputs(inputs=material.inputs)
        screen = Screen()
        sections: list[object] = []
        model = None
        if material.static is not None:
            model = _static_part(screen, material, sections, outputs, out)
        if material.imu is not None and material.gnss is not None:
            _drive_part(screen, material, model, sections, outputs, out)
        page = _page(material, sections)
        outputs.text(out / "report.html", lambda: page)
        written = outputs.commit()
    finally:
        if not existed and not any(out.iterdir()):
            out.rmdir()
    for path in sorted(written):
        screen.line(f"wrote {path}", "dim")
    screen.console.print()
    screen.line(f"Open {out / 'report.html'} in a browser: it needs no network.", "bold")
    return 0


def simulated() -> Material:
    """Return the embedded example."""
    from schuler.cli.example import SEEDS, example_drive, example_static
    from schuler.execution.progress import progress

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
    from schuler.cli.loading import load_gnss, load_imu

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


def _static_part(
    screen: Screen, material: Material, sections: list[object], outputs: Any, out: Path
) -> NoiseModel:
    from schuler.cli.characterize import show_characterization
    from schuler.estimation.characterization import characterize_imu
    from schuler.execution.progress import progress
    from schuler.io.kalibr import kalibr_yaml
    from schuler.screening.screen import repair
    from schuler.screening.screen import screen as look

    assert material.static is not None
    with progress("Static log: screening and fitting the noise"):
        screening = look(material.static)
        screening.require_usable()
        recording = repair(material.static, screening, close_up=True)
        result = characterize_imu(recording)
    show_characterization(screen, result, screening, repaired=True)
    sections += [result, screening, recording]
    model = result.noise_model
    kalibr = kalibr_yaml(model, rate=recording.rate, topic="/imu0")
    outputs.text(out / "noise.yaml", model.to_yaml)
    outputs.text(out / "imu.yaml", lambda: kalibr)
    return model


def _drive_part(
    screen: Screen,
    material: Material,
    model: NoiseModel | None,
    sections: list[object],
    outputs: Any,
    out: Path,
) -> None:
    from schuler.cli.navigate import show_navigation
    from schuler.cli.outages import show_outages
    from schuler.cli.outputs import json_text
    from schuler.evaluation.outages import evaluate_outages
    from schuler.execution.progress import progress
    from schuler.io.trajectory import write_trajectory
    from schuler.navigation.preparation.prepare import prepare
    from schuler.navigation.run import run
    from schuler.report import NavigationResults
    from schuler.report.sections.outages import OutageResults

    assert material.imu is not None
    assert material.gnss is not None
    noise = model if material.same_sensor else None
    if model is not None and noise is None:
        screen.line("The static log is of another sensor: the drive's noise comes from its data.")
    with progress("Drive") as shown:
        cut, setup = prepare(material.imu, material.gnss, noise, progress=shown.say)
        done = run(cut, material.gnss, setup, smooth=True)
    causal, smoothed = done.causal, done.smoothed
    assert smoothed is not None
    with progress("Drive without GNSS") as shown:
        evaluation = evaluate_outages(
            material.imu, material.gnss, noise, sweep=OUTAGES, progress=shown.say
        )
    show_navigation(screen, causal, smoothed)
    show_outages(screen, evaluation)
    sections += [NavigationResults(causal, smoothed, material.gnss, material.truth)]
    sections.append(OutageResults(evaluation, material.gnss))
    path = out / "trajectory.parquet"
    outputs.file(path, lambda temporary: write_trajectory(temporary, smoothed, ".parquet"))
    outputs.text(out / "outages.json", lambda: json_text(evaluation.to_dict()))


def _page(material: Material, sections: list[object]) -> str:
    from schuler.report import render_report

    return render_report(*sections, title=material.title, provenance=_provenance(material))


def _provenance(material: Material) -> Provenance:
    from schuler.cli.provenance import command_provenance

    return command_provenance(
        inputs=material.inputs,
        seeds=material.seeds,
        settings={"outages": {"seconds": OUTAGES[0], "every": OUTAGES[1]}},
    )
