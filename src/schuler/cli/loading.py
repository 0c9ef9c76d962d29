"""Reading the inputs of a command, with progress, and the one line about compiling."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from schuler.cli.console import in_options, say
from schuler.errors import InputError, SchulerError
from schuler.execution.progress import progress

if TYPE_CHECKING:
    from schuler.cli.options.arrays import ArrayOptions
    from schuler.cli.options.reading import DriveReading
    from schuler.data.array import ImuArray
    from schuler.data.gnss import GnssRecording
    from schuler.data.imu import ImuRecording
    from schuler.fleet.registry import KnownSensor
    from schuler.noise.noise_model import NoiseModel
    from schuler.screening.screen import Screening


_MOST = 12
"""Assumptions of one file that are shown."""
_assumed: list[str] = []


def forget_assumptions() -> None:
    """Begin a command: nothing has been taken for granted yet."""
    _assumed.clear()


def assumptions() -> tuple[str, ...]:
    """Return what was taken for granted on reading the inputs of this command."""
    return tuple(_assumed)


@contextmanager
def reading_file(name: str, place: str) -> Iterator[None]:
    """Show that a file is read; errors name the options of this program."""
    with progress(f"Reading {name}"), _naming_options(place):
        yield


@contextmanager
def _naming_options(place: str) -> Iterator[None]:
    try:
        yield
    except SchulerError as error:
        words = (in_options(t, place) for t in (error.found, error.expected, error.cure))
        found, expected, cure = words
        raise type(error)(found, expected=expected, cure=cure, where=error.where) from None


def tell_assumptions(name: str, lines: Iterable[str], place: str) -> None:
    """Say what was taken for granted about a file, once."""
    told = [f"{name}: {in_options(line, place)}" for line in lines]
    new = [line for line in told if line not in _assumed]
    _assumed.extend(new)
    for line in new[:_MOST]:
        say(f"assumed: {line}")
    if len(new) > _MOST:
        say(f"assumed: {name}: and {len(new) - _MOST} more (see the JSON)")


def load_imu(
    path: Path, how: dict[str, Any], place: str = "one", *, calibration: Path | None = None
) -> ImuRecording:
    """Read an IMU recording, calibrated when a calibration is given."""
    from schuler.io import read_imu

    with reading_file(path.name, place):
        recording = read_imu(path, calibration=calibration, **how)
    tell_assumptions(path.name, recording.assumptions, place)
    return recording


def load_imu_pieces(path: Path, how: dict[str, Any]) -> Iterator[ImuRecording]:
    """Read an IMU recording piece by piece."""
    from schuler.io.pieces import read_imu_pieces

    with _naming_options("one"):
        yield from read_imu_pieces(path, **how)


def load_gnss(path: Path, how: dict[str, Any], place: str = "gnss") -> GnssRecording:
    """Read a GNSS recording."""
    from schuler.io import read_gnss

    with reading_file(path.name, place):
        recording = read_gnss(path, **how)
    tell_assumptions(path.name, recording.assumptions, place)
    return recording


def load_array(
    files: tuple[Path, ...],
    calibration: Path | None,
    how: dict[str, Any],
    clocks: Literal["auto", "shared", "own"] = "auto",
    place: str = "one",
) -> ImuArray:
    """Read an array, calibrated when a calibration is given."""
    from schuler.arrays.calibration.result import ArrayCalibration
    from schuler.arrays.read import read_array

    if not files:
        raise InputError("no file of an array", expected="at least one")
    name = ", ".join(f.name for f in files)
    with reading_file(name, place):
        array = read_array(files if len(files) != 1 else files[0], clocks=clocks, **how)
        if calibration is not None:
            try:
                array = ArrayCalibration.load(calibration).apply(array)
            except SchulerError as error:
                if str(calibration) in str(error):
                    raise
                raise error.at(str(calibration)) from None
    tell_assumptions(name, array.assumptions, place)
    return array


def load_noise(path: Path | None, known: KnownSensor | None = None) -> NoiseModel | None:
    """Read a noise model, when one is given; DATABASE#SERIAL is that of a sensor of a fleet."""
    if path is None:
        return None if known is None else known.noise
    database, mark, serial = str(path).rpartition("#")
    if mark and not path.is_file():
        from schuler.fleet.registry import known_sensor

        return known_sensor(Path(database), serial).noise
    from schuler.noise import NoiseModel

    return NoiseModel.load(path)


def say_when_compiling() -> None:
    """Tell once, when the first kernel is compiled on this machine, so that the wait is understood.

    Nothing is said when all kernels come from the cache, or when the input turns out to be bad
    before any kernel is needed.
    """
    from numba.core import event

    import schuler.kernels.compile  # noqa: F401  decides where compiled kernels are kept

    class Watch(event.Listener):  # type: ignore[misc]
        def on_start(self, event: object) -> None:
            if not _told:
                _told.append(True)
                say("first run on this machine: compiling the kernels once, about half a minute")

        def on_end(self, event: object) -> None:
            pass

    if not _told:
        event.register("numba:compile", Watch())


_told: list[bool] = []


def load_drive(
    imu: Path, gnss: Path, reading: DriveReading, known: KnownSensor | None = None
) -> tuple[ImuRecording, GnssRecording]:
    """Read IMU and GNSS of a drive, calibrated as told or as is known, repaired when asked."""
    from schuler.data.imu import CHANNELS
    from schuler.navigation.aiding.gnss import require_overlap
    from schuler.screening.clocks import check_clocks
    from schuler.screening.screen import repair, screen

    how = reading.imu_options()
    recording = load_imu(imu, how, "imu", calibration=reading.calibration)
    if known is not None and known.calibration is not None and reading.calibration is None:
        recording = known.calibration.apply(recording)
    fixes = load_gnss(gnss, reading.gnss_options())
    check_clocks(recording, fixes)
    try:
        require_overlap(fixes, float(recording.time[0]), float(recording.time[-1]))
    except SchulerError as error:
        raise error.at(str(gnss)) from None
    _require_deviations(fixes, gnss)
    missing = [c for c in CHANNELS if c not in recording.channels]
    if missing:
        raise InputError(
            f"has no {', '.join(missing)}",
            expected="three gyros and three accelerometers",
            cure="name the columns with --imu-column ROLE=NAME",
            where=str(imu),
        )
    screening = screen(recording)
    screening.require_usable()
    _require_units(screening, imu)
    if reading.repair:
        recording = repair(recording, screening)
    if reading.flip:
        from schuler.navigation.preparation.diagnosis import check_flip, flipped

        recording = flipped(recording, check_flip(reading.flip))
    return recording, fixes


def _require_units(screening: Screening, path: Path) -> None:
    """Raise where the screening knows the unit that was meant: no filter could start with it."""
    for finding in screening.of_kind("units"):
        if "say so with" in finding.message:
            raise InputError(in_options(finding.message, "imu"), where=str(path))


def load_array_drive(
    options: ArrayOptions, gnss: Path, reading: DriveReading
) -> tuple[ImuArray, GnssRecording]:
    """Read an array and the GNSS recording beside it."""
    if options.mount and reading.calibration is not None:
        raise InputError(
            "--mount and --calibration together", expected="one of them: both say how IMUs sit"
        )
    array = load_array(options.array, reading.calibration, reading.imu_options(), place="imu")
    mounting = options.mounting(array.count)
    if mounting is not None:
        array = replace(array, mounting=mounting)
    fixes = load_gnss(gnss, reading.gnss_options())
    _require_deviations(fixes, gnss)
    return array, fixes


def _require_deviations(fixes: GnssRecording, path: Path) -> None:
    import numpy as np

    for what, values in (("position", fixes.position_sd), ("velocity", fixes.velocity_sd)):
        unknown = 0 if values is None else int(np.isnan(values).any(axis=1).sum())
        if unknown:
            raise InputError(
                f"GNSS {what} has no standard deviation in {unknown} of {fixes.size} epochs",
                expected="one for every epoch",
                cure=f"give one for all with --gnss-{what}-sd",
                where=str(path),
            )
