"""What one inertial measurement unit recorded."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from schuler.data._checks import check_finite, check_time, frozen, median_step
from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.types import FloatArray

CHANNELS = ("gyro_x", "gyro_y", "gyro_z", "accel_x", "accel_y", "accel_z")

_LARGEST = 1e9
"""No inertial sensor measures more, in rad/s or m/s²; what does was not read rightly."""


@dataclass(frozen=True, slots=True, eq=False)
class ImuRecording(Exportable):
    """Angular rate and specific force of one IMU, in its own axes.

    A sample stamped t is the mean over the interval that ends at t (as a sensor that integrates
    or low-passes delivers it); half a sample of delay in other sensors is part of their time
    offset.

    Parameters
    ----------
    time : (n,) ndarray
        Seconds, strictly increasing.
    gyro : (n, 3) ndarray
        Angular rate in rad/s. A column of NaN throughout is a channel that was not recorded.
    accel : (n, 3) ndarray
        Specific force in m/s²; NaN throughout as above.
    name : str
        Name shown to people.
    temperature : (n,) ndarray or None
        Degrees Celsius.
    history : tuple of str
        What was done to the data since the file, oldest first.
    assumptions : tuple of str
        What was taken for granted on reading: units, rates and axes that nobody named, rows left
        out, columns not used.

    Raises
    ------
    InputError
        Wrong shapes, fewer than two samples, time not increasing, values not finite.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import ImuRecording
    >>> still = np.tile((0.0, 0.0, -9.81), (200, 1))
    >>> imu = ImuRecording(np.arange(200) / 100.0, np.zeros((200, 3)), still)
    >>> imu.size, round(imu.rate, 6)
    (200, 100.0)
    """

    time: FloatArray
    gyro: FloatArray
    accel: FloatArray
    name: str = "imu"
    temperature: FloatArray | None = None
    history: tuple[str, ...] = field(default=())
    assumptions: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        time = frozen(self.time, "IMU time", (None,))
        n = time.size
        if n < 2:
            raise InputError(
                f"IMU recording '{self.name}' has {n} sample{'' if n == 1 else 's'}",
                expected="at least 2",
                cure="check that the file is complete",
            )
        check_time(time, "IMU")
        gyro = frozen(self.gyro, "gyro", (n, 3))
        accel = frozen(self.accel, "accel", (n, 3))
        for array, sensor in ((gyro, "gyro"), (accel, "accel")):
            # NaN makes both comparisons false
            if float(array.min()) >= -_LARGEST and float(array.max()) <= _LARGEST:
                continue
            if np.isnan(array).all():
                continue
            for j, axis in enumerate("xyz"):
                column = array[:, j]
                low, high = float(column.min()), float(column.max())
                if not (low >= -_LARGEST and high <= _LARGEST) and not np.isnan(column).all():
                    check_finite(column, f"{sensor}_{axis}")
                    raise InputError(
                        f"{sensor}_{axis} holds numbers from {low:.3g} to {high:.3g}",
                        expected="rad/s and m/s²",
                        cure="check the unit or the reading of the file",
                    )
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "gyro", gyro)
        object.__setattr__(self, "accel", accel)
        if self.temperature is not None:
            object.__setattr__(self, "temperature", frozen(self.temperature, "temperature", (n,)))

    @property
    def size(self) -> int:
        """Number of samples."""
        return int(self.time.size)

    @property
    def duration(self) -> float:
        """Seconds from the first sample to the last."""
        return float(self.time[-1] - self.time[0])

    @property
    def rate(self) -> float:
        """Samples a second: the inverse of the median step."""
        return 1.0 / median_step(self.time)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the channels that were recorded, out of `CHANNELS`."""
        values = np.concatenate([self.gyro[0], self.accel[0]])
        return tuple(c for c, v in zip(CHANNELS, values, strict=True) if not np.isnan(v))

    @property
    def complete(self) -> bool:
        """True when all six channels were recorded."""
        return len(self.channels) == 6

    def channel(self, name: str) -> FloatArray:
        """Return one channel by its name.

        Parameters
        ----------
        name : str
            One of `CHANNELS`.

        Returns
        -------
        (n,) ndarray
            rad/s or m/s².

        Raises
        ------
        InputError
            The channel does not exist or was not recorded.
        """
        if name not in self.channels:
            raise InputError(
                f"recording '{self.name}' has no channel '{name}'",
                expected=f"one of {', '.join(self.channels)}",
            )
        k = CHANNELS.index(name)
        return self.gyro[:, k] if k < 3 else self.accel[:, k - 3]

    def signals(self) -> FloatArray:
        """Return the recorded channels side by side.

        Returns
        -------
        (n, m) ndarray
            Columns in the order of `channels`.
        """
        return np.column_stack([self.channel(c) for c in self.channels])

    def between(self, start: float, stop: float) -> ImuRecording:
        """Return the samples with start <= time < stop.

        Parameters
        ----------
        start, stop : float
            Seconds on the recording's own time axis.

        Returns
        -------
        ImuRecording
            The part, with a line of history.
        """
        a, b = np.searchsorted(self.time, [start, stop], side="left")
        return replace(
            self,
            time=self.time[a:b],
            gyro=self.gyro[a:b],
            accel=self.accel[a:b],
            temperature=None if self.temperature is None else self.temperature[a:b],
            history=(*self.history, f"cut to {start:.3f} .. {stop:.3f} s"),
        )

    def to_columns(self) -> dict[str, FloatArray]:
        """Return named columns that `read_imu` understands.

        Returns
        -------
        dict of str to (n,) ndarray
            Units are in the names.
        """
        unit = {"g": "rad_s", "a": "m_s2"}
        columns = {"time_s": self.time}
        columns |= {f"{c}_{unit[c[0]]}": self.channel(c) for c in self.channels}
        if self.temperature is not None:
            columns["temperature_degc"] = self.temperature
        return columns
