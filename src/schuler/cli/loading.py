"""Reading the inputs of a command, with progress, and the one line about compiling."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from schuler.cli.console import say
from schuler.errors import InputError, SchulerError
from schuler.execution.progress import progress

if TYPE_CHECKING:
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


def title_of(path: Path) -> str:
    """Return how people would name a recording: its folder and its file."""
    whole = path.resolve()
    return whole.name if whole.is_dir() else f"{whole.parent.name}/{whole.stem}".lstrip("/")


def parse_numbers(text: str, count: int, what: str, separator: str = ",") -> tuple[float, ...]:
    """Return the numbers of an option such as ``0.1,0,-0.3``."""
    try:
        numbers = tuple(float(part) for part in text.split(separator))
    except ValueError:
        numbers = ()
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise InputError(f"'{text}' is not understood", expected=what)
    return numbers
