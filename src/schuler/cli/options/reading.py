"""How to read the inputs, as options of the command line."""

from __future__ import annotations

from dataclasses import dataclass, fields
from math import radians
from pathlib import Path
from typing import Annotated, Any, Literal

from cyclopts import Parameter

from schuler.cli.options.groups import READING
from schuler.errors import InputError


def columns_of(pairs: tuple[str, ...], names: str | None) -> dict[str, Any] | list[str] | None:
    """Return what the user said about columns, as the readers want it."""
    if pairs and names is not None:
        raise InputError("--column and --columns together", expected="one of them")
    if names is not None:
        return [name.strip() for name in names.split(",")]
    mapping: dict[str, Any] = {}
    for pair in pairs:
        role, equals, name = pair.partition("=")
        if not (role and equals):
            raise InputError(f"column '{pair}' is not understood", expected="ROLE=NAME")
        mapping[role.strip()] = (int(name) if name.isdecimal() else name) or None
    return mapping or None


@Parameter(name="*", group=READING)
@dataclass(frozen=True)
class _FileReading:
    """How to read a file of any kind.

    Parameters
    ----------
    columns : str, optional
        Names of all columns of a text file without header, in order, with commas between.
    rate : float, optional
        Samples a second, for a file without time.
    time_unit : str, optional
        Such as s, ms, us, ns; or how dates are written, such as '%d.%m.%Y %H:%M:%S%.f'.
    time_offset : float
        Seconds added to the time.
    delimiter : str, optional
        Between columns of a text file; found out if not given.
    decimal : str, optional
        Decimal point or comma; found out if not given.
    comment : str, optional
        Beginning of lines to leave out; #, % and // if not given.
    skip_lines : int
        Lines left out at the beginning of a text file.
    no_header : bool
        The text file has no line of names.
    ros_topic : str, optional
        Topic to read from a ROS bag with several.
    clock : str, optional
        Time stamps of a ROS bag: of the headers, or of the recording.
    profile : Path, optional
        What was said about such files once, from `schuler read --save-profile`.
    """

    column: tuple[str, ...] = ()
    columns: str | None = None
    rate: float | None = None
    time_unit: str | None = None
    time_offset: float = 0.0
    delimiter: str | None = None
    decimal: Literal[".", ","] | None = None
    comment: str | None = None
    skip_lines: int = 0
    no_header: bool = False
    ros_topic: str | None = None
    clock: Literal["header", "bag"] | None = None
    profile: Path | None = None

    def _told(self, *, repair: bool) -> dict[str, Any]:
        """Return what was said of the file, whatever it holds."""
        return _given(
            columns=columns_of(self.column, self.columns),
            rate=self.rate,
            time_unit=self.time_unit,
            time_offset=self.time_offset or None,
            delimiter=self.delimiter,
            decimal=self.decimal,
            comment=self.comment,
            skip_lines=self.skip_lines or None,
            header=False if self.no_header else None,
            topic=self.ros_topic,
            clock=self.clock,
            repair=repair or None,
        )


@Parameter(name="*", group=READING)
@dataclass(frozen=True)
class ImuReading(_FileReading):
    """How to read an IMU file.

    Parameters
    ----------
    column : tuple of str
        A column by its role: ROLE=NAME with ROLE out of time, gyro_x, gyro_y, gyro_z,
        accel_x, accel_y, accel_z, temperature; ROLE= leaves it out. May be repeated.
    gyro_unit : str, optional
        Such as rad/s, deg/s, mdps, 'LSB 131/(deg/s)'.
    accel_unit : str, optional
        Such as m/s^2, g, mg, 'LSB 16384/g'.
    increments : bool, optional
        The columns hold increments of angle and velocity instead of rates.
    imu : int, optional
        Number of the IMU in a file of several.
    """

    gyro_unit: str | None = None
    accel_unit: str | None = None
    increments: bool | None = None
    imu: int | None = None

    def options(self, *, repair: bool = False) -> dict[str, Any]:
        """Return the arguments of `read_imu`."""
        return (
            _profiled(self.profile, "imu")
            | self._told(repair=repair)
            | _given(
                gyro_unit=self.gyro_unit,
                accel_unit=self.accel_unit,
                increments=self.increments,
                imu=self.imu,
            )
        )


@Parameter(name="*", group=READING)
@dataclass(frozen=True)
class TrackReading(_FileReading):
    """How to read a file of positions: of a receiver, or a trajectory.

    Parameters
    ----------
    column : tuple of str
        A column by its role: ROLE=NAME with ROLE such as time, latitude, longitude, height,
        north, east, down, velocity_north, position_sd; ROLE= leaves it out. May be repeated.
    angle_unit : str, optional
        Of latitude and longitude, such as deg, rad, '1e-7 deg'.
    velocity_unit : str, optional
        Of velocities, such as m/s, km/h, kn, mm/s.
    origin : str, optional
        Latitude deg, longitude deg, height m, with commas between, that local coordinates
        count from.
    position_sd : float, optional
        Standard deviation of positions in m (vertical 1.5 times it), in place of the
        file's.
    velocity_sd : float, optional
        Standard deviation of velocities in m/s, in place of the file's.
    repair : bool
        Leave out rows that cannot be used (NaN, time that repeats or goes backwards, a last
        line that was cut off), and repair what the screening finds.
    """

    angle_unit: str | None = None
    velocity_unit: str | None = None
    origin: str | None = None
    position_sd: float | None = None
    velocity_sd: float | None = None
    repair: bool = False

    def positions(self) -> dict[str, Any]:
        """Return the arguments of `read_gnss` and `read_track`."""
        return (
            _profiled(self.profile, "gnss")
            | self._told(repair=self.repair)
            | _given(
                angle_unit=self.angle_unit,
                velocity_unit=self.velocity_unit,
                origin=_origin(self.origin),
                position_sd=self.position_sd,
                velocity_sd=self.velocity_sd,
            )
        )


@Parameter(name="*", group=READING)
@dataclass(frozen=True)
class AnyReading(ImuReading, TrackReading):
    """How to read a file of an IMU or of a receiver.

    Parameters
    ----------
    column : tuple of str
        A column by its role: ROLE=NAME with ROLE such as time, gyro_x, accel_z, temperature,
        latitude, velocity_north; ROLE= leaves it out. May be repeated.
    calibration : Path, optional
        Calibration of the IMU as YAML, from `schuler calibrate`; applied to what is read.
    """

    calibration: Path | None = None

    def inputs(self, file: Path) -> tuple[Path, ...]:
        """Return all files that are read."""
        return (file,) if self.calibration is None else (file, self.calibration)

    def of(self, kind: Literal["imu", "gnss"]) -> dict[str, Any]:
        """Return the arguments of `read_imu` or `read_gnss`, the calibration apart."""
        if kind == "gnss" and self.calibration is not None:
            raise InputError("--calibration with a GNSS recording", expected="an IMU recording")
        return self.options(repair=self.repair) if kind == "imu" else self.positions()


@Parameter(name="*", group=READING)
@dataclass(frozen=True)
class DriveReading:
    """How to read the two files of a drive.

    Parameters
    ----------
    imu_column : tuple of str
        A column of the IMU file by its role: ROLE=NAME, e.g. gyro_x=wx; ROLE= leaves it
        out. May be repeated.
    imu_columns : str, optional
        Names of all columns of an IMU file without header, in order, with commas between.
    imu_rate : float, optional
        Samples a second, for an IMU file without time.
    imu_time_unit : str, optional
        Such as s, ms, us, ns; or how dates are written, such as '%d.%m.%Y %H:%M:%S%.f'.
    imu_time_offset : float
        Seconds added to the time of the IMU.
    gyro_unit : str, optional
        Such as rad/s, deg/s, mdps, 'LSB 131/(deg/s)'.
    accel_unit : str, optional
        Such as m/s^2, g, mg, 'LSB 16384/g'.
    increments : bool, optional
        The columns hold increments of angle and velocity instead of rates.
    imu_delimiter : str, optional
        Between columns of the IMU text file; found out if not given.
    imu_decimal : str, optional
        Decimal point or comma; found out if not given.
    imu_comment : str, optional
        Beginning of lines to leave out; #, % and // if not given.
    imu_skip_lines : int
        Lines left out at the beginning of the IMU text file.
    imu_no_header : bool
        The text file has no line of names.
    imu_number : int, optional
        Number of the IMU in a file of several.
    imu_topic : str, optional
        Topic of the IMU in a ROS bag with several.
    imu_clock : str, optional
        Time stamps of a ROS bag: of the headers, or of the recording.
    gnss_column : tuple of str
        A column of the GNSS file by its role: ROLE=NAME, e.g. latitude=lat; ROLE= leaves it
        out. May be repeated.
    gnss_columns : str, optional
        Names of all columns of a GNSS file without header, in order, with commas between.
    gnss_rate : float, optional
        Epochs a second, for a GNSS file without time.
    gnss_time_unit : str, optional
        Such as s, ms, us, ns; or how dates are written, such as '%d.%m.%Y %H:%M:%S%.f'.
    gnss_time_offset : float
        Seconds added to the time of the GNSS.
    gnss_angle_unit : str, optional
        Of latitude and longitude, such as deg, rad, '1e-7 deg'.
    gnss_velocity_unit : str, optional
        Of velocities, such as m/s, km/h, kn, mm/s.
    gnss_origin : str, optional
        Latitude deg, longitude deg, height m, with commas between, that local coordinates
        count from.
    gnss_position_sd : float, optional
        Standard deviation of positions in m (vertical 1.5 times it), in place of the
        file's.
    gnss_velocity_sd : float, optional
        Standard deviation of velocities in m/s, in place of the file's.
    gnss_delimiter : str, optional
        Between columns of the GNSS text file; found out if not given.
    gnss_decimal : str, optional
        Decimal point or comma; found out if not given.
    gnss_comment : str, optional
        Beginning of lines to leave out; #, % and // if not given.
    gnss_skip_lines : int
        Lines left out at the beginning of the GNSS text file.
    gnss_no_header : bool
        The text file has no line of names.
    gnss_topic : str, optional
        Topic of the GNSS in a ROS bag with several.
    gnss_clock : str, optional
        Time stamps of a ROS bag: of the headers, or of the recording.
    calibration : Path, optional
        Calibration of the IMU, or of the array, as YAML, from `schuler calibrate`; that of an array
        takes the place of --mount.
    profile : Path, optional
        What was said about such files once, from `schuler read --save-profile`.
    repair : bool
        Leave out rows that cannot be used (NaN, time that repeats or goes backwards, a last
        line that was cut off), and repair what the screening finds.
    flip : tuple of str
        Turn the sign of a channel (gyro_x, ..., accel_z) or of all three (gyro, accel): for
        logs with a wrong axis, or accelerometers that show gravity instead of specific
        force. May be repeated.
    """

    imu_column: tuple[str, ...] = ()
    imu_columns: str | None = None
    imu_rate: float | None = None
    imu_time_unit: str | None = None
    imu_time_offset: float = 0.0
    gyro_unit: str | None = None
    accel_unit: str | None = None
    increments: bool | None = None
    imu_delimiter: str | None = None
    imu_decimal: Literal[".", ","] | None = None
    imu_comment: str | None = None
    imu_skip_lines: int = 0
    imu_no_header: bool = False
    imu_number: int | None = None
    imu_topic: str | None = None
    imu_clock: Literal["header", "bag"] | None = None
    gnss_column: tuple[str, ...] = ()
    gnss_columns: str | None = None
    gnss_rate: float | None = None
    gnss_time_unit: str | None = None
    gnss_time_offset: float = 0.0
    gnss_angle_unit: str | None = None
    gnss_velocity_unit: str | None = None
    gnss_origin: str | None = None
    gnss_position_sd: float | None = None
    gnss_velocity_sd: float | None = None
    gnss_delimiter: str | None = None
    gnss_decimal: Literal[".", ","] | None = None
    gnss_comment: str | None = None
    gnss_skip_lines: int = 0
    gnss_no_header: bool = False
    gnss_topic: str | None = None
    gnss_clock: Literal["header", "bag"] | None = None
    calibration: Path | None = None
    profile: Path | None = None
    repair: bool = False
    flip: Annotated[tuple[str, ...], Parameter(negative=())] = ()

    def imu_options(self) -> dict[str, Any]:
        """Return the arguments of `read_imu`."""
        own = ("gyro_unit", "accel_unit", "increments")
        return self._of("imu", {n: getattr(self, n) for n in own}).of("imu")

    def gnss_options(self) -> dict[str, Any]:
        """Return the arguments of `read_gnss`."""
        return self._of("gnss", {}).of("gnss")

    def _of(self, kind: Literal["imu", "gnss"], own: dict[str, Any]) -> AnyReading:
        """Options of one file, under the names that they have where there is one file alone."""
        names = {f"{kind}_topic": "ros_topic", "imu_number": "imu"}
        told = {
            names.get(f.name, f.name.removeprefix(f"{kind}_")): getattr(self, f.name)
            for f in fields(self)
            if f.name.startswith(f"{kind}_")
        }
        return AnyReading(**told, **own, profile=self.profile, repair=self.repair)


def _given(**options: Any) -> dict[str, Any]:
    return {name: value for name, value in options.items() if value is not None}


def _profiled(profile: Path | None, kind: Literal["imu", "gnss"]) -> dict[str, Any]:
    """Return the options of a profile; those of the command go before them."""
    if profile is None:
        return {}
    from schuler.io.profile import load_profile

    return load_profile(profile, kind)


def _origin(text: str | None) -> tuple[float, float, float] | None:
    if text is None:
        return None
    try:
        latitude, longitude, height = (float(x) for x in text.split(","))
    except ValueError:
        raise InputError(
            f"origin '{text}' is not understood", expected="LATITUDE,LONGITUDE,HEIGHT in deg and m"
        ) from None
    return radians(latitude), radians(longitude), height
