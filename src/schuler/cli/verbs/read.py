"""`schuler read`, `formats` and `view`: what is in a file, what can be read, a whole folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import Parameter

from schuler.cli.options.reading import AnyReading

if TYPE_CHECKING:
    from schuler.data import GnssRecording, ImuRecording
    from schuler.io.format import Format

Browser = Annotated[bool, Parameter(negative="--no-browser")]
_HELD = {"imu": "IMU", "gnss": "GNSS", "sensor": "sensors"}


def read(
    file: Path,
    /,
    *,
    kind: Annotated[Literal["imu", "gnss"] | None, Parameter(name=("--as",))] = None,
    save_profile: Path | None = None,
    json: Path | None = None,
    reading: AnyReading = AnyReading(),
) -> int:
    """Read a file and say what is in it and what was taken for granted.

    Example: `schuler read log.csv`

    Parameters
    ----------
    file : Path
        Recording in any format that is read; see `schuler formats`.
    kind : {"imu", "gnss"}, optional
        What to read of a file that can hold both; by default the IMU where there is one.
    save_profile : Path, optional
        Write the options of this call and the units found to a profile, for --profile of other
        commands.
    json : Path, optional
        Write what was found here; - for standard output.
    reading : AnyReading, optional
        How to read the file.
    """
    from schuler.cli.console import Screen
    from schuler.cli.outputs import STDOUT, Outputs, json_text
    from schuler.io.folder import file_in_folder
    from schuler.io.profile import save_profile as write_profile
    from schuler.io.registry import format_of

    how = reading
    outputs = Outputs(json, inputs=reading.inputs(file))
    place = file_in_folder(file, kind or "imu") if file.is_dir() else file
    form = format_of(place)
    chosen, recording = _read(file, form.holds, kind, how)
    if save_profile is not None:
        write_profile(save_profile, chosen, how.of(chosen), recording)
    found = _summary(chosen, form.title, recording)
    outputs.text(json, lambda: json_text(found))
    written = outputs.commit()
    screen = Screen(json_on_stdout=json == STDOUT)
    screen.heading(f"{recording.name}", f"{form.title}, read as {chosen}")
    for name, value in found["facts"].items():
        screen.line(f"{name}: {value}")
    for line in recording.history[1:]:
        if line not in recording.assumptions:
            screen.finding("info", line)
    for path in (*written, *((save_profile,) if save_profile else ())):
        screen.line(f"wrote {path}", "dim")
    for severity, text in found["findings"]:
        screen.finding(severity, text)
    return 0


def _read(
    file: Path, holds: tuple[str, ...], kind: Literal["imu", "gnss"] | None, how: AnyReading
) -> tuple[Literal["imu", "gnss"], ImuRecording | GnssRecording]:
    """Read what was asked for, or the IMU of a file, or its GNSS where it has no IMU."""
    from schuler.cli.loading import load_gnss, load_imu
    from schuler.errors import InputError

    if kind == "gnss" or (kind is None and "imu" not in holds):
        return "gnss", load_gnss(file, how.of("gnss"))
    try:
        return "imu", load_imu(file, how.of("imu"), calibration=how.calibration)
    except InputError as error:
        if kind is not None or "gnss" not in holds:
            raise
        try:
            return "gnss", load_gnss(file, how.of("gnss"))
        except InputError as other:
            # the one that found its columns knows what is wrong with the file
            missing = "no column for"
            raise (
                other if missing in str(error) and missing not in str(other) else error
            ) from None


def _summary(kind: str, title: str, recording: ImuRecording | GnssRecording) -> dict[str, Any]:
    import numpy as np

    from schuler.data import ImuRecording
    from schuler.screening.screen import first_look

    facts: dict[str, Any] = {"rows": recording.size, "duration_s": recording.duration}
    if isinstance(recording, ImuRecording):
        facts |= {"rate_hz": recording.rate, "channels": ", ".join(recording.channels)}
        if recording.complete:
            facts["median_specific_force_m_s2"] = float(
                np.median(np.linalg.norm(recording.accel, axis=1))
            )
    else:
        facts["latitude_deg"], facts["longitude_deg"] = map(
            float, np.degrees(recording.position[0, :2])
        )
        facts["height_m"] = float(recording.position[0, 2])
        facts["velocity"] = "yes" if recording.velocity is not None else "no"
    findings = first_look(recording) if isinstance(recording, ImuRecording) else ()
    return {
        "kind": kind,
        "findings": [(f.severity, f.message) for f in findings],
        "format": title,
        "name": recording.name,
        "facts": facts,
        "assumptions": list(recording.assumptions),
        "history": list(recording.history),
    }


def formats(*, json: Path | None = None) -> int:
    """List the formats of files that are read and written.

    Example: `schuler formats`

    Parameters
    ----------
    json : Path, optional
        Write the list here; - for standard output.
    """
    from schuler.cli.console import Screen
    from schuler.cli.outputs import STDOUT, Outputs, json_text
    from schuler.io.registry import formats as known

    found = known()
    outputs = Outputs(json)
    outputs.text(json, lambda: json_text({"formats": [_entry(f) for f in found]}))
    written = outputs.commit()
    screen = Screen(json_on_stdout=json == STDOUT)
    rows = [
        (
            one.name,
            one.title,
            " ".join(one.suffixes),
            ", ".join(_HELD[h] for h in one.holds),
            ", ".join(_written(one)),
            f"pip install 'schuler[{one.extra}]'" if one.extra else "",
        )
        for one in found
    ]
    screen.table(("format", "what", "endings", "read as", "written", "needs"), rows, words=6)
    screen.line("Files are recognised by their content, whatever their names.", "dim")
    for path in written:
        screen.line(f"wrote {path}", "dim")
    return 0


def _written(one: Format) -> list[str]:
    kinds = (
        ("trajectory", one.write_trajectory),
        ("recording", one.write_recording),
        ("noise", one.write_noise),
    )
    return [word for word, writer in kinds if writer is not None]


def _entry(one: Format) -> dict[str, Any]:
    return {
        "name": one.name,
        "title": one.title,
        "endings": list(one.suffixes),
        "reads": list(one.holds),
        "writes": _written(one),
        "extra": one.extra,
    }


def view(folder: Path = Path(), /, *, port: int = 0, browser: Browser = True) -> int:
    """Look at the recordings and results of a folder in the browser, and work on them there.

    Only this machine can open the window, and only with the address that is printed. It needs
    `pip install 'schuler[view]'`, and runs until Ctrl-C.

    Example: `schuler view recordings/`

    Parameters
    ----------
    folder : Path
        Folder of recordings; the current one if left out.
    port : int
        Where to listen; 0: any that is free.
    browser : bool
        Open the browser; --no-browser prints the address only.
    """
    from schuler.cli.console import in_options, say
    from schuler.view import serve

    def told(address: str) -> None:
        say("the window is open until Ctrl-C; keep its address to yourself")
        print(address, flush=True)

    serve(folder, port=port, browser=browser, told=told, words=in_options)
    return 0
