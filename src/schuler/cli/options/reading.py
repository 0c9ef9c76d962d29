"""How to read the inputs, as options of the command line."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, Literal

from cyclopts import Parameter

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
        if not (role and equals and name):
            raise InputError(f"column '{pair}' is not understood", expected="ROLE=NAME")
        mapping[role.strip()] = int(name) if name.isdecimal() else name
    return mapping or None


@Parameter(name="*")
@dataclass(frozen=True)
class ImuReading:
    """How to read an IMU file.

    Parameters
    ----------
    column : tuple of str
        A column by its role: ROLE=NAME with ROLE out of time, gyro_x, gyro_y, gyro_z, accel_x,
        accel_y, accel_z, temperature. May be repeated.
    columns : str, optional
        Names of all columns of a text file without header, in order, with commas between.
    rate : float, optional
        Samples a second, for a file without time.
    time_unit : str, optional
        Such as s, ms, us, ns.
    gyro_unit : str, optional
        Such as rad/s, deg/s, mdps.
    accel_unit : str, optional
        Such as m/s^2, g, mg.
    increments : bool, optional
        The columns hold increments of angle and velocity instead of rates.
    delimiter : str, optional
        Between columns of a text file; found out if not given.
    decimal : str, optional
        Decimal point or comma; found out if not given.
    skip_lines : int
        Lines left out at the beginning of a text file.
    imu : int, optional
        Number of the IMU in a file of several.
    ros_topic : str, optional
        Topic to read from a ROS bag with several.
    """

    column: tuple[str, ...] = ()
    columns: str | None = None
    rate: float | None = None
    time_unit: str | None = None
    gyro_unit: str | None = None
    accel_unit: str | None = None
    increments: bool | None = None
    delimiter: str | None = None
    decimal: Literal[".", ","] | None = None
    skip_lines: int = 0
    imu: int | None = None
    ros_topic: str | None = None

    def options(self, *, repair: bool = False) -> dict[str, Any]:
        """Return the arguments of `read_imu`."""
        return _given(
            columns=columns_of(self.column, self.columns),
            rate=self.rate,
            time_unit=self.time_unit,
            gyro_unit=self.gyro_unit,
            accel_unit=self.accel_unit,
            increments=self.increments,
            delimiter=self.delimiter,
            decimal=self.decimal,
            skip_lines=self.skip_lines or None,
            imu=self.imu,
            topic=self.ros_topic,
            repair=repair or None,
        )


@Parameter(name="*")
@dataclass(frozen=True)
class DriveReading:
    """How to read the two files of a drive.

    Parameters
    ----------
    imu_column : tuple of str
        A column of the IMU file by its role: ROLE=NAME, e.g. gyro_x=wx. May be repeated.
    imu_columns : str, optional
        Names of all columns of an IMU file without header, in order, with commas between.
    imu_rate : float, optional
        Samples a second, for an IMU file without time.
    imu_time_unit : str, optional
        Such as s, ms, us, ns.
    gyro_unit : str, optional
        Such as rad/s, deg/s.
    accel_unit : str, optional
        Such as m/s^2, g, mg.
    increments : bool, optional
        The IMU columns hold increments of angle and velocity instead of rates.
    imu_topic : str, optional
        Topic of the IMU in a ROS bag with several.
    gnss_column : tuple of str
        A column of the GNSS file by its role: ROLE=NAME, e.g. latitude=lat. May be repeated.
    gnss_columns : str, optional
        Names of all columns of a GNSS file without header, in order, with commas between.
    gnss_time_unit : str, optional
        Such as s, ms, us, ns.
    gnss_topic : str, optional
        Topic of the GNSS in a ROS bag with several.
    gnss_position_sd : float, optional
        Standard deviation of positions in m (vertical 1.5 times it), in place of the file's.
    gnss_velocity_sd : float, optional
        Standard deviation of velocities in m/s, in place of the file's.
    repair : bool
        Leave out rows that cannot be used (NaN, time that repeats or goes backwards, a last line
        that was cut off), and repair what the screening finds.
    flip : tuple of str
        Turn the sign of a channel (gyro_x, ..., accel_z) or of all three (gyro, accel): for logs
        with a wrong axis, or accelerometers that show gravity instead of specific force. May be
        repeated.
    """

    imu_column: tuple[str, ...] = ()
    imu_columns: str | None = None
    imu_rate: float | None = None
    imu_time_unit: str | None = None
    gyro_unit: str | None = None
    accel_unit: str | None = None
    increments: bool | None = None
    imu_topic: str | None = None
    gnss_column: tuple[str, ...] = ()
    gnss_columns: str | None = None
    gnss_time_unit: str | None = None
    gnss_topic: str | None = None
    gnss_position_sd: float | None = None
    gnss_velocity_sd: float | None = None
    repair: bool = False
    flip: Annotated[tuple[str, ...], Parameter(negative=())] = ()

    def imu_options(self) -> dict[str, Any]:
        """Return the arguments of `read_imu`."""
        return _given(
            columns=columns_of(self.imu_column, self.imu_columns),
            rate=self.imu_rate,
            time_unit=self.imu_time_unit,
            gyro_unit=self.gyro_unit,
            accel_unit=self.accel_unit,
            increments=self.increments,
            topic=self.imu_topic,
            repair=self.repair or None,
        )

    def gnss_options(self) -> dict[str, Any]:
        """Return the arguments of `read_gnss`."""
        return _given(
            columns=columns_of(self.gnss_column, self.gnss_columns),
            time_unit=self.gnss_time_unit,
            topic=self.gnss_topic,
            position_sd=self.gnss_position_sd,
            velocity_sd=self.gnss_velocity_sd,
            repair=self.repair or None,
        )


def _given(**options: Any) -> dict[str, Any]:
    return {name: value for name, value in options.items() if value is not None}
