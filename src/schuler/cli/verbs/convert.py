"""`schuler convert`: recordings, trajectories and noise models in the forms of other programs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from schuler.cli.options.reading import AnyReading
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.cli.outputs import Outputs
    from schuler.data import GnssRecording, ImuRecording


def convert(
    source: Path,
    target: Path,
    /,
    *,
    to: str | None = None,
    kind: Annotated[Literal["imu", "gnss"] | None, Parameter(name=("--as",))] = None,
    topic: str = "/imu0",
    reading: AnyReading = AnyReading(),
) -> int:
    """Write a recording, a trajectory or a noise model in another form.

    Example: `schuler convert drive.bag imu.csv --as imu`

    Parameters
    ----------
    source : Path
        Recording in any format that is read, trajectory of `schuler navigate --out`, or noise
        model (.yaml).
    target : Path
        File to write.
    to : str, optional
        Form to write, out of `schuler formats`; by default the ending of the target says it.
    kind : {"imu", "gnss"}, optional
        Which recording, of a file that holds both.
    topic : str
        Name of the ROS topic in files for ROS.
    reading : AnyReading, optional
        How to read a recording.
    """
    from schuler.cli.console import Screen
    from schuler.cli.outputs import Outputs
    from schuler.io.tracks import trajectory_columns

    outputs = Outputs(target, inputs=reading.inputs(source))
    if source.suffix.lower() in {".yaml", ".yml"}:
        _noise(outputs, source, target, to, reading.rate, topic)
    else:
        track = trajectory_columns(source)
        if track is not None and kind is None:
            _write_track(outputs, track, target, to)
        else:
            _recording(outputs, source, target, to, kind, reading)
    screen = Screen()
    for path in outputs.commit():
        screen.line(f"wrote {path}", "dim")
    return 0


def _noise(
    outputs: Outputs, source: Path, target: Path, to: str | None, rate: float | None, topic: str
) -> None:
    from schuler.io.format import NoiseRequest
    from schuler.io.registry import noise_format
    from schuler.noise import NoiseModel

    if to is None:
        raise InputError(
            "which form of a noise model",
            expected="--to with a form out of `schuler formats`, such as --to kalibr",
        )
    writer = noise_format(to).write_noise
    assert writer is not None
    content = writer(NoiseModel.load(source), NoiseRequest(rate, topic))
    data = content.encode() if isinstance(content, str) else content
    outputs.file(target, lambda path: _bytes(path, data))


def _bytes(path: Path, data: bytes) -> None:
    path.write_bytes(data)


def _write_track(outputs: Outputs, track: dict[str, Any], target: Path, to: str | None) -> None:
    from schuler.io.registry import trajectory_format

    form = trajectory_format(to or target.suffix)
    write, beside = form.write_trajectory, form.beside
    assert write is not None
    outputs.file(target, lambda path: write(path, track))
    if beside is not None:
        text = beside(track)
        outputs.file(
            target.with_name(target.name + ".origin.json"),
            lambda path: _bytes(path, text.encode()),
        )


def _recording(
    outputs: Outputs,
    source: Path,
    target: Path,
    to: str | None,
    kind: Literal["imu", "gnss"] | None,
    reading: AnyReading,
) -> None:
    from schuler.cli.loading import load_gnss, load_imu
    from schuler.io.folder import file_in_folder
    from schuler.io.registry import format_of, recording_format

    form = recording_format(to or target.suffix)
    file = source if not source.is_dir() else file_in_folder(source, kind or "imu")
    holds = format_of(file).holds
    chosen = kind or ("imu" if "imu" in holds else "gnss")
    options = reading.of(chosen)
    recording: ImuRecording | GnssRecording
    try:
        if chosen == "imu":
            recording = load_imu(source, options, calibration=reading.calibration)
        else:
            recording = load_gnss(source, options)
    except InputError:
        if kind is not None or not {"imu", "gnss"} <= set(holds):
            raise
        chosen = "gnss"
        try:
            recording = load_gnss(source, reading.of(chosen))
        except InputError:
            recording = load_imu(source, options, calibration=reading.calibration)
    write = form.write_recording
    assert write is not None
    outputs.file(target, lambda path: write(path, recording))
