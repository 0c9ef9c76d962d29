"""Files that most verbs read and write, as options of the command line."""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from schuler.cli.options.error_models import OneModel
from schuler.cli.options.groups import NOISE, RESULTS
from schuler.errors import InputError, SchulerError

if TYPE_CHECKING:
    from schuler.fleet.registry import KnownSensor
    from schuler.noise import NoiseModel

Texts = tuple[tuple[Path | None, Callable[[], str]], ...]
"""Files, and what returns the text of each."""

Files = Annotated[tuple[Path, ...], Parameter(name="FILES", negative=())]
"""The recordings of an array."""
Clocks = Literal["auto", "shared", "own"]


@Parameter(name="*", group=RESULTS)
@dataclass(frozen=True)
class Written:
    """Files with the whole result.

    Parameters
    ----------
    report : Path, optional
        Write a self-contained HTML page here.
    json : Path, optional
        Write all results in SI here; - for standard output.
    figures : Path, optional
        Write every figure of the page into this folder, in the size of a column or a page of a
        journal; needs matplotlib.
    figure_format : {"pdf", "svg", "png"}
        Form of these figures; fonts are embedded.
    """

    report: Path | None = None
    json: Path | None = None
    figures: Path | None = None
    figure_format: Literal["pdf", "svg", "png"] = "pdf"


@Parameter(name="*", group=RESULTS)
@dataclass(frozen=True)
class ModelFiles:
    """Files with the noise model.

    Parameters
    ----------
    noise_out : Path, optional
        Write the noise model as YAML here, for `schuler navigate --noise`.
    kalibr : Path, optional
        Write imu.yaml for Kalibr and its relatives here.
    topic : str
        Name of the ROS topic in the Kalibr file.
    """

    noise_out: Path | None = None
    kalibr: Path | None = None
    topic: str = "/imu0"

    @property
    def wanted(self) -> bool:
        """Whether there is a file to write."""
        return self.noise_out is not None or self.kalibr is not None

    def texts(self, model: NoiseModel, rate: float) -> tuple[Texts, tuple[str, ...]]:
        """Return the files with what stands in them, and why some cannot be written."""
        from schuler.io.kalibr import kalibr_yaml

        texts: Texts = ((self.noise_out, model.to_yaml),)
        if self.kalibr is None:
            return texts, ()
        try:
            kalibr = kalibr_yaml(model, rate=rate, topic=self.topic)
        except SchulerError as error:
            return texts, (f"{self.kalibr.name} was not written: {error}",)
        return (*texts, (self.kalibr, lambda: kalibr)), ()


@Parameter(name="*", group=NOISE)
@dataclass(frozen=True)
class OfSensor:
    """The sensor that recorded a run, and where it is known.

    Parameters
    ----------
    sensor : str, optional
        Serial number of the IMU: its newest noise model, with its temperature law, and its
        calibration are taken from --registry, unless they are given.
    registry : Path, optional
        Database of `schuler batch`, or a folder with a folder for each serial number that holds
        noise.yaml and calibration.yaml, or folders by date that do; $SCHULER_REGISTRY if not
        given.
    """

    sensor: str | None = None
    registry: Path | None = None

    def found(self) -> KnownSensor | None:
        """Look the sensor up, and say what is known of it."""
        from schuler.cli.console import say
        from schuler.fleet.registry import known_sensor

        if self.sensor is None:
            if self.registry is not None:
                raise InputError("--registry without --sensor", expected="both")
            return None
        beside = os.environ.get("SCHULER_REGISTRY", "")
        where = self.registry or (Path(beside) if beside else None)
        if where is None:
            raise InputError(
                f"--sensor {self.sensor} without a place to look it up",
                expected="--registry FOLDER_OR_DATABASE, or $SCHULER_REGISTRY",
            )
        known = known_sensor(where, self.sensor)
        say(f"sensor {self.sensor}: {', '.join(known.words)} ({where.name})")
        return known


@Parameter(name="*")
@dataclass(frozen=True)
class Drive:
    """Recordings of a run with one IMU.

    Parameters
    ----------
    imu : Path
        IMU recording: CSV, text, Parquet, NPZ, ROS bag, or a folder with imu.* in it.
    gnss : Path
        GNSS recording: the same formats, or RTKLIB .pos.
    noise : Path, optional
        Noise model as YAML, from `schuler characterize --noise-out`, or DATABASE#SERIAL, what
        `schuler batch` found of a sensor.
    of : OfSensor
        Whose noise model and calibration are looked up in their place.
    """

    imu: Path
    gnss: Path
    noise: Path | None = None
    of: OfSensor = field(default_factory=OfSensor)


@Parameter(name="*")
@dataclass(frozen=True)
class Run:
    """Recordings of a run with one IMU or an array.

    Parameters
    ----------
    gnss : Path
        GNSS recording: CSV, text, Parquet, NPZ, ROS bag, or RTKLIB .pos.
    imu : Path, optional
        IMU recording: the same formats, or a folder with imu.* in it.
    noise : Path, optional
        Noise model as YAML, from `schuler characterize --noise-out`, or DATABASE#SERIAL, what
        `schuler batch` found of a sensor.
    told : OneModel
        An error model in its place.
    of : OfSensor
        Whose noise model and calibration are looked up in their place.
    """

    gnss: Path
    imu: Path | None = None
    noise: Path | None = None
    told: OneModel = field(default_factory=OneModel)
    of: OfSensor = field(default_factory=OfSensor)
