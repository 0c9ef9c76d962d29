"""What is known of a sensor by its serial number: in plain files under a folder, or a database."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from schuler.data.imu_calibration import ImuCalibration
from schuler.errors import InputError
from schuler.fleet.database import FleetDatabase
from schuler.noise.noise_model import NoiseModel

FILES = {"model": "noise.yaml", "calibration": "calibration.yaml"}
"""What is known of a sensor, and the name of its file in the folder of the sensor."""
Known = TypeVar("Known")


@dataclass(frozen=True, slots=True, eq=False)
class KnownSensor:
    """What is known of one sensor, the newest of each.

    Parameters
    ----------
    serial : str
        Serial number.
    noise : NoiseModel or None
        With its temperature law (`effects`), where one was found.
    calibration : ImuCalibration or None
        Of the IMU.
    words : tuple of str
        What was found where, and what was not.
    """

    serial: str
    noise: NoiseModel | None
    calibration: ImuCalibration | None
    words: tuple[str, ...]


def known_sensor(where: Path, serial: str) -> KnownSensor:
    """Look a sensor up.

    Parameters
    ----------
    where : Path
        A database that `schuler batch` wrote; or a folder with one folder for each sensor, named
        by its serial number, that holds noise.yaml and calibration.yaml, or folders named by the
        date of measurement that hold them.
    serial : str
        Serial number.

    Returns
    -------
    KnownSensor
        The newest noise model and calibration.

    Raises
    ------
    InputError
        No such folder or database, or nothing known of this sensor.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from schuler import NoiseModel, WhiteNoise
    >>> from schuler.fleet import known_sensor
    >>> folder = Path(tempfile.mkdtemp())
    >>> (folder / "SN7" / "2026-01-01").mkdir(parents=True)
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> model.save(folder / "SN7" / "2026-01-01" / "noise.yaml")
    >>> known_sensor(folder, "SN7").words
    ('noise model of 2026-01-01', 'no temperature law', 'no calibration')
    """
    if where.is_dir():
        texts = {kind: _newest_file(where, serial, name) for kind, name in FILES.items()}
        others = sorted(p.name for p in where.iterdir() if p.is_dir())
    else:
        with FleetDatabase(where, create=False) as database:
            texts = {kind: database.newest(serial, kind) for kind in FILES}
            others = database.serials()
    noise = _read(NoiseModel.load, texts["model"])
    calibration = _read(ImuCalibration.load, texts["calibration"])
    if noise is None and calibration is None:
        raise InputError(
            f"nothing is known of sensor '{serial}'",
            expected=f"one of {', '.join(others[:8])}" if others else "a log of it lying still",
            where=str(where),
        )
    laws = [] if noise is None else sorted(c for c, effects in noise.effects.items() if effects)
    law = f"temperature law of {', '.join(laws)}" if laws else "no temperature law"
    words = [
        "no " + name if text is None else f"{name} of {text[0]}" if text[0] else name
        for name, text in (("noise model", texts["model"]), ("calibration", texts["calibration"]))
    ]
    return KnownSensor(serial, noise, calibration, (words[0], law, words[1]))


def _newest_file(where: Path, serial: str, name: str) -> tuple[str, str] | None:
    """Return date and content of the newest file of this name of a sensor."""
    own = where / serial
    if not serial or own.parent != where or not own.is_dir():
        return None
    for folder in (*sorted((p for p in own.iterdir() if p.is_dir()), reverse=True), own):
        if (folder / name).is_file():
            text = (folder / name).read_text(encoding="utf-8", errors="replace")
            return ("" if folder == own else folder.name), text
    return None


def _read(load: Callable[[Path], Known], text: tuple[str, str] | None) -> Known | None:
    if text is None:
        return None
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "kept.yaml")
        file.write_text(text[1], encoding="utf-8")
        return load(file)
