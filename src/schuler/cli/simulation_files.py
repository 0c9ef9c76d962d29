"""Files of `schuler simulate`: what it reads, and the folder it writes."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from schuler.cli.parsing import title_of
from schuler.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable

    from schuler.simulation.faults import Fault
    from schuler.simulation.gnss_faults import FixFault
    from schuler.simulation.motions.profile import Profile
    from schuler.simulation.scenario import Scenario, SimulatedDrive

    Texts = tuple[tuple[Path, Callable[[], str]], ...]
    Files = tuple[tuple[Path, Callable[[Path], None]], ...]

FAULTS = (
    "gap:START:SECONDS, hold:START:SECONDS, jump:START:STEP[:SECONDS], "
    "stuck:CHANNEL:START[:SECONDS], step:CHANNEL:START:SIZE[:SECONDS], "
    "ramp:CHANNEL:START:SLOPE[:SECONDS], noise:CHANNEL:START:SD[:SECONDS], fix:START:METRES or "
    "late:START:STEP[:SECONDS]"
)


def parse_faults(texts: tuple[str, ...]) -> tuple[tuple[Fault, ...], tuple[FixFault, ...]]:
    """Return faults of the IMU and of GNSS."""
    from schuler.simulation.gnss_faults import LateStamps, WrongFix

    imu: list[Fault] = []
    gnss: list[FixFault] = []
    for text in texts:
        fault = _parse_fault(text)
        if isinstance(fault, (WrongFix, LateStamps)):
            gnss.append(fault)
        else:
            imu.append(fault)
    return tuple(imu), tuple(gnss)


def _parse_fault(text: str) -> Fault | FixFault:
    from schuler.simulation import faults as f
    from schuler.simulation.gnss_faults import LateStamps, WrongFix

    kind, *rest = text.split(":")
    try:
        if kind in ("stuck", "step", "ramp", "noise"):
            channels = (rest[0],)
            numbers = [float(r) for r in rest[1:]]
            if kind == "stuck":
                return f.StuckFault(
                    start=numbers[0], channels=channels, duration=_lasting(numbers, 1)
                )
            start, size = numbers[:2]
            lasting = _lasting(numbers, 2)
            if kind == "step":
                return f.StepFault(start=start, channels=channels, size=size, duration=lasting)
            if kind == "ramp":
                return f.RampFault(start=start, channels=channels, slope=size, duration=lasting)
            return f.NoiseBurst(start=start, channels=channels, deviation=size, duration=lasting)
        numbers = [float(r) for r in rest]
        if kind in ("gap", "hold") and len(numbers) == 2:
            return f.DropOut(start=numbers[0], duration=numbers[1], hold=kind == "hold")
        if kind == "jump":
            return f.TimeJump(start=numbers[0], jump=numbers[1], duration=_lasting(numbers, 2))
        if kind == "late":
            return LateStamps(start=numbers[0], late=numbers[1], duration=_lasting(numbers, 2))
        if kind == "fix" and len(numbers) == 2:
            return WrongFix(start=numbers[0], north=numbers[1])
    except (ValueError, IndexError):
        pass
    raise InputError(f"fault '{text}' is not understood", expected=FAULTS)


def _lasting(numbers: list[float], place: int) -> float:
    if len(numbers) > place + 1:
        raise ValueError
    return numbers[place] if len(numbers) > place else float("inf")


def profile_of(
    waypoints: Path | None, track: Path | None, duration: float | None
) -> tuple[Profile, str]:
    """Return a motion from a file."""
    from schuler.simulation.motions.tracks import from_track

    if waypoints is not None and track is not None:
        raise InputError("--waypoints and --track together", expected="one of them")
    if duration is not None:
        raise InputError(
            "--duration with --waypoints or --track", expected="the duration that the file has"
        )
    if track is not None:
        from schuler.cli.loading import load_gnss

        return from_track(load_gnss(track, {})), f"track of {title_of(track)}"
    assert waypoints is not None
    return _waypoints(waypoints), f"way-points of {waypoints.name}"


def _waypoints(path: Path) -> Profile:
    import numpy as np
    import polars

    from schuler.io.tables.parquet_file import parquet_frame
    from schuler.simulation.motions.profile import from_waypoints

    if not path.is_file():
        raise InputError("there is no such file", where=str(path))
    try:
        table = parquet_frame(path) if path.suffix == ".parquet" else polars.read_csv(path)
    except (polars.exceptions.PolarsError, OSError) as error:
        raise InputError(
            f"is no table: {str(error).splitlines()[0]}",
            expected="CSV with a header, or Parquet",
            where=str(path),
        ) from None
    needed = ("time_s", "latitude_deg", "longitude_deg", "height_m")
    angles = ("roll_deg", "pitch_deg", "heading_deg")
    missing = [c for c in needed if c not in table.columns]
    if missing:
        raise InputError(
            f"has no {', '.join(missing)}",
            expected=f"columns {', '.join(needed)} and perhaps {', '.join(angles)}",
            where=str(path),
        )
    try:
        columns = {
            c: table[c].cast(polars.Float64).to_numpy()
            for c in table.columns
            if c in needed + angles
        }
    except polars.exceptions.PolarsError:
        raise InputError("holds text among its numbers", where=str(path)) from None
    position = np.column_stack(
        [
            np.radians(columns["latitude_deg"]),
            np.radians(columns["longitude_deg"]),
            columns["height_m"],
        ]
    )
    euler = None
    if all(a in columns for a in angles):
        euler = np.radians(np.column_stack([columns[a] for a in angles]))
    try:
        return from_waypoints(columns["time_s"], position, euler)
    except InputError as error:
        raise error.at(str(path)) from None


def make_folder(out: Path) -> None:
    """Make the folder that a simulation is written into."""
    if out.exists() and not out.is_dir():
        raise InputError("is a file", expected="a folder to write into", where=str(out))
    if not out.parent.is_dir():
        raise InputError("the folder above it does not exist", where=str(out))
    out.mkdir(exist_ok=True)


def drive_files(
    out: Path, drive: SimulatedDrive, scenario: Scenario, told: dict[str, Any], form: str
) -> tuple[Texts, Files]:
    """Return texts and tables of a folder: recordings, truth, noise model and description."""
    import yaml

    from schuler.data.mounting import MOUNTING_FILE, Mounting, mounting_yaml
    from schuler.io.trajectory import write_columns

    several = len(drive.imus) > 1
    tables = {f"imu{k + 1 if several else ''}": i.to_columns() for k, i in enumerate(drive.imus)}
    tables |= {"gnss": drive.gnss.to_columns(), "truth": drive.truth.to_columns()}
    files = tuple(
        (out / f"{name}.{form}", partial(write_columns, columns=columns, form=f".{form}"))
        for name, columns in tables.items()
    )
    texts: Texts = (
        (
            out / "simulation.yaml",
            lambda: yaml.safe_dump(told, sort_keys=False, allow_unicode=True),
        ),
    )
    if scenario.noise_model is not None:
        texts = (*texts, (out / "noise.yaml", scenario.noise_model.to_yaml))
    if scenario.array_rotations is not None and scenario.array_positions is not None:
        mounting = Mounting(scenario.array_rotations, scenario.array_positions)
        stems = [name for name in tables if name.startswith("imu")]
        texts = (*texts, (out / MOUNTING_FILE, lambda: mounting_yaml(mounting, stems)))
    return texts, files
