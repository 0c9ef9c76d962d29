"""Reading the inputs of a command, with progress, and the one line about compiling."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from schuler.cli.console import say
from schuler.errors import InputError, SchulerError
from schuler.execution.progress import progress

if TYPE_CHECKING:
    from schuler.cli.options.arrays import ArrayOptions
    from schuler.cli.options.reading import DriveReading
    from schuler.data.array import ImuArray
    from schuler.data.gnss import GnssRecording
    from schuler.data.imu import ImuRecording
    from schuler.noise.noise_model import NoiseModel


def load_imu(path: Path, how: dict[str, Any]) -> ImuRecording:
    """Read an IMU recording."""
    from schuler.io import read_imu

    with progress(f"Reading {path.name}"):
        return read_imu(path, **how)


def load_gnss(path: Path, how: dict[str, Any]) -> GnssRecording:
    """Read a GNSS recording."""
    from schuler.io import read_gnss

    with progress(f"Reading {path.name}"):
        return read_gnss(path, **how)


def load_array(
    files: tuple[Path, ...],
    calibration: Path | None,
    how: dict[str, Any],
    clocks: Literal["auto", "shared", "own"] = "auto",
) -> ImuArray:
    """Read an array, calibrated when a calibration is given."""
    from schuler.arrays.calibration.result import ArrayCalibration
    from schuler.arrays.read import read_array

    if not files:
        raise InputError("no file of an array", expected="at least one")
    with progress(f"Reading {', '.join(f.name for f in files)}"):
        array = read_array(files if len(files) != 1 else files[0], clocks=clocks, **how)
        if calibration is not None:
            try:
                array = ArrayCalibration.load(calibration).apply(array)
            except SchulerError as error:
                if str(calibration) in str(error):
                    raise
                raise error.at(str(calibration)) from None
    return array


def load_noise(path: Path | None) -> NoiseModel | None:
    """Read a noise model, when one is given."""
    if path is None:
        return None
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


def load_drive(imu: Path, gnss: Path, reading: DriveReading) -> tuple[ImuRecording, GnssRecording]:
    """Read IMU and GNSS of a drive, repaired when asked."""
    from schuler.data.imu import CHANNELS
    from schuler.navigation.aiding.gnss import require_overlap
    from schuler.screening.screen import repair, screen

    recording = load_imu(imu, reading.imu_options())
    fixes = load_gnss(gnss, reading.gnss_options())
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
    if reading.repair:
        recording = repair(recording, screening)
    if reading.flip:
        from schuler.navigation.preparation.diagnosis import check_flip, flipped

        recording = flipped(recording, check_flip(reading.flip))
    return recording, fixes


def load_array_drive(
    options: ArrayOptions, gnss: Path, reading: DriveReading
) -> tuple[ImuArray, GnssRecording]:
    """Read an array and the GNSS recording beside it."""
    if options.mount and options.calibration is not None:
        raise InputError(
            "--mount and --calibration together", expected="one of them: both say how IMUs sit"
        )
    array = load_array(options.array, options.calibration, reading.imu_options())
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
