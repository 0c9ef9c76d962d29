"""Sensors beside IMU and GNSS, from files: options that `navigate` and `outages` share."""

from __future__ import annotations

from dataclasses import dataclass, replace
from math import radians
from pathlib import Path
from typing import TYPE_CHECKING, Any

from cyclopts import Parameter

from schuler.cli.options.groups import SENSORS
from schuler.cli.parsing import parse_numbers
from schuler.errors import InputError

if TYPE_CHECKING:
    from schuler.data.gnss import GnssRecording
    from schuler.io.sensors import SensorKind, SensorSeries
    from schuler.navigation.aiding.general import MeasurementSource
    from schuler.navigation.aiding.odometer import Odometer
    from schuler.navigation.aiding.schedule import PlacedAiding
    from schuler.types import FloatArray

MICROTESLA = 1e-6


@Parameter(name="*", group=SENSORS)
@dataclass(frozen=True)
class SensorOptions:
    """Heading, barometer, magnetometer and odometer, stamped by the clock of the IMU.

    Parameters
    ----------
    heading_file : Path, optional
        Headings of two antennas or a compass from true north: columns such as time_s, heading_deg,
        sd_deg, in text, Parquet or NPZ.
    heading_sd : float, optional
        Standard deviation of headings in deg, in place of the file's.
    heading_baseline : str
        X,Y,Z: the direction whose heading it is, in the axes of the IMU.
    heading_offset_sd : float
        Standard deviation of a constant error of the headings in deg, which then is estimated.
    heading_unit : str, optional
        deg or rad, where the name of the column does not tell.
    barometer : Path, optional
        Heights or air pressures: columns such as time_s, height_m, sd_m, or pressure_hPa, sd_hPa.
        Their offset from the height of GNSS is estimated.
    barometer_sd : float, optional
        Standard deviation of the heights in m, in place of the file's.
    barometer_unit : str, optional
        Such as hPa, Pa, m.
    magnetometer : Path, optional
        Magnetic field in the axes of the IMU: columns such as time_s, mag_x_uT, mag_y_uT,
        mag_z_uT, sd_uT.
    magnetometer_sd : float, optional
        Standard deviation of each component in uT, in place of the file's.
    magnetometer_unit : str, optional
        Such as uT, nT, gauss.
    earth_field : str, optional
        DECLINATION,INCLINATION,INTENSITY of the earth's field there in deg, deg, uT.
    hard_iron_sd : float
        Standard deviation of the vehicle's own constant field in each axis in uT, which is
        estimated; 0 for a magnetometer that has been calibrated.
    odometer : Path, optional
        Speed over ground by the wheels: columns such as time_s, speed_m_s, or left_speed_m_s and
        right_speed_m_s, or ticks (counted from the start; GNSS tells how far one goes). Scale,
        slip and delay are estimated.
    odometer_sd : float
        Standard deviation of the white noise of each speed in m/s.
    odometer_unit : str, optional
        Such as m/s, km/h, where the name of the column does not tell.
    """

    heading_file: Path | None = None
    heading_sd: float | None = None
    heading_baseline: str = "1,0,0"
    heading_offset_sd: float = 0.0
    heading_unit: str | None = None
    barometer: Path | None = None
    barometer_sd: float | None = None
    barometer_unit: str | None = None
    magnetometer: Path | None = None
    magnetometer_sd: float | None = None
    magnetometer_unit: str | None = None
    earth_field: str | None = None
    hard_iron_sd: float = 10.0
    odometer: Path | None = None
    odometer_sd: float = 0.05
    odometer_unit: str | None = None

    @property
    def files(self) -> tuple[Path, ...]:
        """Files that are read."""
        given = (self.heading_file, self.barometer, self.magnetometer, self.odometer)
        return tuple(f for f in given if f is not None)

    def check(self) -> None:
        """Raise when options do not go together, before anything is read."""
        plain = SensorOptions()
        for file, option, names in (
            (self.heading_file, "--heading-file", ("sd", "baseline", "offset_sd", "unit")),
            (self.barometer, "--barometer", ("sd", "unit")),
            (self.magnetometer, "--magnetometer", ("sd", "unit")),
            (self.odometer, "--odometer", ("sd", "unit")),
        ):
            stem = option.removeprefix("--").removesuffix("-file")
            for name in (f"{stem}_{n}" for n in names):
                if file is None and getattr(self, name) != getattr(plain, name):
                    raise _without(name, option)
        if self.magnetometer is None:
            for name in ("earth_field", "hard_iron_sd"):
                if getattr(self, name) != getattr(plain, name):
                    raise _without(name, "--magnetometer")
        elif self.earth_field is None:
            raise InputError(
                "--magnetometer without the field of the earth",
                expected="--earth-field DECLINATION,INCLINATION,INTENSITY (deg, deg, uT), such as "
                "4,63,48",
            )
        for name in ("heading_sd", "barometer_sd", "magnetometer_sd", "odometer_sd"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < float("inf"):
                raise InputError(f"{_option(name)} {value:g}", expected="a number above zero")
        for name in ("heading_offset_sd", "hard_iron_sd"):
            if not 0.0 <= getattr(self, name) < float("inf"):
                raise InputError(
                    f"{_option(name)} {getattr(self, name):g}", expected="zero or more"
                )

    def keywords(
        self, known: dict[str, Any], time: FloatArray, gnss: GnssRecording, *, repair: bool = False
    ) -> dict[str, Any]:
        """Read the files and put their measurements beside what is known of the run."""
        if not self.files:
            return known
        from schuler.navigation.aiding.options import PLAIN

        told = known.get("measurements", PLAIN)
        return known | {"measurements": replace(told, sources=self._sources(time, gnss, repair))}

    def _sources(
        self, time: FloatArray, gnss: GnssRecording, repair: bool
    ) -> tuple[PlacedAiding | MeasurementSource, ...]:
        from schuler.io.sensors import BAROMETERS, HEADINGS, MAGNETOMETERS, ODOMETERS
        from schuler.navigation.aiding.barometer import (
            Barometer,
            height_of_pressure,
            pressure_per_height,
        )
        from schuler.navigation.aiding.heading import Heading
        from schuler.navigation.aiding.magnetometer import Magnetometer, earth_field

        sources: list[PlacedAiding | MeasurementSource] = []
        if self.heading_file is not None:
            text = "--heading-baseline X,Y,Z, such as 1,0,0"
            baseline = parse_numbers(self.heading_baseline, 3, text)
            seen = _read(self.heading_file, HEADINGS, self.heading_unit, time, repair)
            given = None if self.heading_sd is None else radians(self.heading_sd)
            sd = _deviation(seen, given, self.heading_file, "--heading-sd DEG")
            offset = radians(self.heading_offset_sd)
            sources.append(Heading(seen.time, seen.values, sd, baseline, offset))
        if self.barometer is not None:
            seen = _read(self.barometer, BAROMETERS, self.barometer_unit, time, repair)
            if seen.quantity == "pressure":
                if not (seen.values > 0.0).all():
                    raise InputError("pressures that are not above zero", where=str(self.barometer))
                slope = pressure_per_height(seen.values)
                height = height_of_pressure(seen.values)
                seen = replace(seen, values=height, sd=None if seen.sd is None else seen.sd / slope)
            sd = _deviation(seen, self.barometer_sd, self.barometer, "--barometer-sd M")
            sources.append(Barometer(seen.time, seen.values, sd))
        if self.magnetometer is not None:
            assert self.earth_field is not None
            text = "--earth-field DECLINATION,INCLINATION,INTENSITY (deg, deg, uT), such as 4,63,48"
            declination, inclination, intensity = parse_numbers(self.earth_field, 3, text)
            field = earth_field(radians(declination), radians(inclination), intensity * MICROTESLA)
            seen = _read(self.magnetometer, MAGNETOMETERS, self.magnetometer_unit, time, repair)
            given = None if self.magnetometer_sd is None else self.magnetometer_sd * MICROTESLA
            sd = _deviation(seen, given, self.magnetometer, "--magnetometer-sd MICROTESLA")
            iron = self.hard_iron_sd * MICROTESLA
            sources.append(Magnetometer(seen.time, seen.values, field, sd, iron))
        if self.odometer is not None:
            seen = _read(self.odometer, ODOMETERS, self.odometer_unit, time, repair)
            sources.append(_odometer(seen, gnss, self.odometer, self.odometer_sd))
        return tuple(sources)


def _odometer(seen: SensorSeries, gnss: GnssRecording, path: Path, sd: float) -> Odometer:
    import numpy as np

    from schuler.cli.console import say
    from schuler.navigation.aiding.odometer import Odometer, odometer_checked

    time, speed = seen.time, seen.values
    if speed.ndim > 1:
        speed = speed.mean(axis=1)
    if seen.quantity == "ticks":
        ahead = np.diff(speed)
        time, speed = time[1:], np.maximum(ahead, 0.0) / np.diff(time)
        time, speed = time[ahead >= 0.0], speed[ahead >= 0.0]
    try:
        counted = seen.quantity == "ticks"
        time, speed, remarks = odometer_checked(time, speed, gnss, counts=counted)
    except InputError as error:
        raise error.at(str(path)) from None
    for remark in remarks:
        say(f"{path.name}: {remark}")
    return Odometer(time, speed, sd)


def _read(
    path: Path, kind: SensorKind, unit: str | None, time: FloatArray, repair: bool
) -> SensorSeries:
    """Read a file; raise when nothing of it falls into the time of the IMU."""
    from schuler.execution.progress import progress
    from schuler.io import read_sensor

    with progress(f"Reading {path.name}"):
        seen = read_sensor(path, kind, unit=unit, repair=repair)
    if not ((seen.time >= time[0]) & (seen.time <= time[-1])).any():
        raise InputError(
            f"no {kind.name} in the time of the IMU, {time[0]:.3f} to {time[-1]:.3f} s: the file "
            f"goes from {seen.time.min():.3f} to {seen.time.max():.3f} s",
            expected="stamps by the clock of the IMU",
            where=str(path),
        )
    return seen


def _deviation(
    seen: SensorSeries, given: float | None, path: Path, option: str
) -> FloatArray | float:
    if given is not None:
        return given
    if seen.sd is None:
        raise InputError(
            "the file has no standard deviations",
            expected="a column sd",
            cure=f"give one for all with {option}",
            where=str(path),
        )
    return seen.sd


def _without(name: str, option: str) -> InputError:
    return InputError(f"{_option(name)} without {option}", expected="both")


def _option(name: str) -> str:
    return "--" + name.replace("_", "-")
