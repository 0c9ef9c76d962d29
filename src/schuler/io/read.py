"""One door for all formats: `read_imu`, `read_imus`, `read_gnss`, `read_sensor`."""

from __future__ import annotations

from dataclasses import fields
from functools import partial
from os import PathLike
from pathlib import Path
from typing import Any, Literal

from schuler.data import GnssRecording, ImuRecording
from schuler.data.imu_calibration import ImuCalibration
from schuler.errors import InputError, SchulerError
from schuler.io.folder import file_in_folder
from schuler.io.format import What
from schuler.io.gnss import gnss_recording
from schuler.io.imu import imu_recordings
from schuler.io.options import ReadOptions
from schuler.io.registry import format_of, open_with
from schuler.io.sensors import SensorKind, SensorSeries, sensor_series
from schuler.io.source import Source
from schuler.io.tables.arrays import source_of_table

Kind = Literal["imu", "gnss"]


def read_imu(path: Any, *, calibration: str | Path | None = None, **how: Any) -> ImuRecording:
    """Read the recording of one IMU.

    Parameters
    ----------
    path : str, Path or table
        CSV or other text, Parquet, NPZ, a ROS 1 or ROS 2 bag, or a folder with one such file
        named imu.*; or a table in memory: a DataFrame of pandas or polars, a Dataset of xarray,
        a mapping from names to arrays.
    columns : mapping or sequence, optional
        Which column is what. A mapping from role to name or number (from 0) of the column:
        ``{"time": "t", "gyro": ("wx", "wy", "wz"), "accel_x": 4}``; or the names of all columns
        of a text file without header, in order, ``""`` for those not wanted. Roles: time, week,
        gyro_x.., accel_x.., angle_step_x.., velocity_step_x.., temperature, imu.
    time_unit, gyro_unit, accel_unit : str, optional
        Units, such as ``"ms"``, ``"deg/s"``, ``"mg"``; they count more than those in the file.
    time_offset : float, optional
        Seconds added to the time, to bring IMU and GNSS onto one axis.
    rate : float, optional
        Sampling rate in Hz for files without time; a column of time is then not used.
    increments : bool, optional
        True: the columns hold increments of angle (rad) and velocity (m/s) over the sample. By
        default the names and units tell.
    delimiter, decimal, comment : str, optional
        Layout of text, found out by default. ``"whitespace"``: any number of blanks.
    skip_lines : int, optional
        Lines to leave out at the beginning of a text file.
    header : bool, optional
        False: the text file has no line of names.
    imu : int, optional
        Number of the IMU in a file of several; the first by default.
    topic : str, optional
        Topic of a ROS bag; the only one by default.
    clock : {"header", "bag"}, optional
        Time stamps of a ROS bag.
    repair : bool, optional
        Leave out rows with NaN, rows whose time repeats or goes backwards, and a last line that
        was cut off; `history` says how many.
    calibration : str or Path, optional
        Calibration of this IMU as YAML (`calibrate_imu`), which is applied.
    missing : bool, optional
        Leave out rows with NaN and nothing else: what one IMU of several lacks.
    name : str, optional
        Name of the recording.

    Returns
    -------
    ImuRecording
        In SI units; `history` tells every conversion.

    Raises
    ------
    InputError
        Anything wrong with the file: one line with file, place, what was expected, what to do.
    UnitError
        A unit that is not known or does not fit.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from schuler import read_imu
    >>> header = "time [s],gx [rad/s],gy [rad/s],gz [rad/s],ax [m/s^2],ay [m/s^2],az [m/s^2]"
    >>> rows = [f"{k / 100:.2f},0.001,0.002,{k % 3 * 1e-3},0.1,0.2,-9.8{k % 5}" for k in range(300)]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "log.csv"
    ...     _ = path.write_text(chr(10).join([header, *rows]), encoding="utf-8")
    ...     print(read_imu(path).size)
    300

    A table in memory is read like a file, units in its names or told:

    >>> import numpy as np
    >>> rng = np.random.default_rng(1)
    >>> table = {"time_s": np.arange(300) / 100.0, "gyro": rng.normal(0.0, 0.1, (300, 3))}
    >>> table["accel"] = rng.normal((0.0, 0.0, -1.0), 1e-3, (300, 3))
    >>> round(float(read_imu(table, gyro_unit="deg/s", accel_unit="g").accel[:, 2].mean()), 2)
    -9.81
    """
    options = _options(how, "imu")
    source = _open(path, "imu", options)
    recordings: tuple[ImuRecording, ...] = _located(source, imu_recordings, source, options, True)
    if calibration is None:
        return recordings[0]
    return ImuCalibration.load(calibration).apply(recordings[0])


def read_imus(path: Any, **how: Any) -> tuple[ImuRecording, ...]:
    """Read the recordings of all IMUs in a file.

    Several IMUs stand side by side in columns ``imuK_gyro_x_rad_s``, or below each other with a
    column ``imu`` that holds their number.

    Parameters
    ----------
    path : str, Path or table
        As in `read_imu`.
    **how
        As in `read_imu`.

    Returns
    -------
    tuple of ImuRecording
        In the order of their numbers; one for a file of a single IMU.

    Raises
    ------
    InputError
        As in `read_imu`.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import read_imus
    >>> rng, roles = np.random.default_rng(1), ("gyro", "accel")
    >>> log = {f"{r}_{a}": rng.standard_normal(99) for r in roles for a in "xyz"}
    >>> read = read_imus(log, rate=100.0, gyro_unit="deg/s", accel_unit="m/s^2")
    >>> len(read)
    1
    """
    options = _options(how, "imu")
    source = _open(path, "imu", options)
    recordings: tuple[ImuRecording, ...] = _located(source, imu_recordings, source, options, False)
    return recordings


def read_gnss(path: Any, **how: Any) -> GnssRecording:
    """Read the recording of a GNSS receiver.

    Parameters
    ----------
    path : str, Path or table
        CSV or other text, Parquet, NPZ, RTKLIB .pos, a ROS 1 or ROS 2 bag, or a folder with one
        such file named gnss.* or gps.*; or a table in memory, as in `read_imu`.
    columns : mapping or sequence, optional
        As in `read_imu`. Roles: time, week, latitude, longitude, height; or ecef_x, ecef_y,
        ecef_z; or north, east, down (or up) with `origin`; velocity_north, velocity_east,
        velocity_down (or velocity_up); speed, course; position_sd_north.., velocity_sd_north..,
        position_sd, velocity_sd, horizontal_accuracy, vertical_accuracy; quality.
    time_unit, angle_unit : str, optional
        Units of time and of latitude and longitude (default: degrees).
    time_offset : float, optional
        Seconds added to the time, to bring IMU and GNSS onto one axis.
    rate : float, optional
        Rate in Hz for files without time.
    delimiter, decimal, comment, skip_lines, header : optional
        Layout of text, as in `read_imu`.
    topic, clock : str, optional
        Of ROS bags, as in `read_imu`.
    origin : sequence of 3 floats, optional
        Latitude rad, longitude rad, height m of the point that local coordinates count from;
        without it they are put at 45 deg north, 0 deg east, and the history says so.
    position_sd, velocity_sd : float, optional
        Standard deviations in m and m/s in place of those of the file (vertical position 1.5
        times it).
    repair : bool, optional
        Leave out epochs without position and those whose time repeats or goes backwards.
    name : str, optional
        Name of the recording.

    Returns
    -------
    GnssRecording
        In SI units and radians; `history` tells every conversion. A velocity without a down
        component has 0 there, with infinite standard deviation.

    Raises
    ------
    InputError
        Anything wrong with the file: one line with file, place, what was expected, what to do.
    UnitError
        A unit that is not known or does not fit.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from schuler import read_gnss
    >>> header = "time [s],latitude [deg],longitude [deg],height [m]"
    >>> rows = [f"{k},{48.1 + k * 1e-5:.7f},11.5,520.0" for k in range(30)]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "gnss.csv"
    ...     _ = path.write_text(chr(10).join([header, *rows]), encoding="utf-8")
    ...     print(read_gnss(path).size)
    30
    """
    options = _options(how, "gnss")
    source = _open(path, "gnss", options)
    recording: GnssRecording = _located(source, gnss_recording, source, options)
    return recording


def read_sensor(
    path: str | Path, kind: SensorKind, *, unit: str | None = None, repair: bool = False
) -> SensorSeries:
    """Read what a heading sensor, barometer or magnetometer measured."""
    path = Path(path)
    if "sensor" not in format_of(path).holds:
        raise InputError(
            f"no file of a {kind.name}",
            expected="text, Parquet or NPZ with columns such as " + kind.example,
            where=str(path),
        )
    source = _open(path, "sensor", ReadOptions(repair=repair))
    built: SensorSeries = _located(
        source, partial(sensor_series, unit=unit, repair=repair), source, kind
    )
    return built


_ONLY_IMU = {"gyro_unit", "accel_unit", "increments", "imu", "missing"}
_ONLY_GNSS = {"angle_unit", "velocity_unit", "origin", "position_sd", "velocity_sd"}


def _options(how: dict[str, Any], kind: Kind) -> ReadOptions:
    known = {f.name for f in fields(ReadOptions)} - (_ONLY_GNSS if kind == "imu" else _ONLY_IMU)
    wrong = sorted(set(how) - known)
    if wrong:
        raise InputError(
            f"read_{kind} has no option '{wrong[0]}'", expected=f"out of {', '.join(sorted(known))}"
        )
    return ReadOptions(**how)


def _open(given: Any, what: What, options: ReadOptions) -> Source:
    """Find the file, detect its format and open it; a table in memory is open already."""
    if not isinstance(given, str | PathLike):
        return source_of_table(given)
    path = Path(given)
    if path.is_dir():
        path = file_in_folder(path, what)
    return open_with(format_of(path), path, what, options)


def _located(source: Source, build: Any, *arguments: Any) -> Any:
    """Call a builder; an error that does not name the file gets it in front."""
    try:
        return build(*arguments)
    except SchulerError as error:
        if str(source.path) in str(error):
            raise
        raise error.at(str(source.path)) from None
