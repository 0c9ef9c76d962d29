"""What a GNSS receiver recorded."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from schuler.data._checks import check_finite, check_time, frozen
from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class GnssRecording(Exportable):
    """Position and velocity of the antenna, with their standard deviations.

    Parameters
    ----------
    time : (n,) ndarray
        Seconds on the time axis of the IMU, strictly increasing.
    position : (n, 3) ndarray
        Latitude rad, longitude rad, height m.
    position_sd : (n, 3) ndarray or None
        North, east, down in m. NaN: not known; infinite: component not measured.
    velocity : (n, 3) ndarray or None
        North, east, down in m/s.
    velocity_sd : (n, 3) ndarray or None
        As `position_sd`, in m/s.
    quality : (n,) ndarray of int or None
        RTKLIB's numbers: 1 fixed, 2 float, 4 differential, 5 single; 0 unknown.
    name : str
        Name shown to people.
    history : tuple of str
        What was done to the data since the file, oldest first.
    assumptions : tuple of str
        What was taken for granted on reading: units, rates and axes that nobody named, rows left
        out, columns not used.

    Raises
    ------
    InputError
        Wrong shapes, no epoch, time not increasing, latitude out of range, standard deviations
        that are zero or negative.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import GnssRecording
    >>> place = np.tile((np.radians(48.1), np.radians(11.5), 520.0), (3, 1))
    >>> gnss = GnssRecording(np.arange(3.0), place, position_sd=np.full((3, 3), 1.5))
    >>> gnss.size
    3
    """

    time: FloatArray
    position: FloatArray
    position_sd: FloatArray | None = None
    velocity: FloatArray | None = None
    velocity_sd: FloatArray | None = None
    quality: NDArray[np.int64] | None = None
    name: str = "gnss"
    history: tuple[str, ...] = field(default=())
    assumptions: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        time = frozen(self.time, "GNSS time", (None,))
        n = time.size
        if n < 1:
            raise InputError(f"GNSS recording '{self.name}' is empty", expected="at least 1 epoch")
        check_time(time, "GNSS")
        position = frozen(self.position, "GNSS position", (n, 3))
        check_finite(position, "GNSS position")
        if np.abs(position[:, 0]).max() > np.pi / 2 or np.abs(position[:, 1]).max() > 2 * np.pi:
            raise InputError(
                "latitude or longitude is out of range",
                expected="radians, latitude within +-pi/2",
                cure="name the unit of these columns",
            )
        set_ = object.__setattr__
        set_(self, "time", time)
        set_(self, "position", position)
        set_(self, "position_sd", self._deviations(self.position_sd, "position"))
        if self.velocity is not None:
            velocity = frozen(self.velocity, "GNSS velocity", (n, 3))
            check_finite(velocity, "GNSS velocity")
            set_(self, "velocity", velocity)
            set_(self, "velocity_sd", self._deviations(self.velocity_sd, "velocity"))
        elif self.velocity_sd is not None:
            set_(self, "velocity_sd", None)
        if self.quality is not None:
            quality = np.array(self.quality, dtype=np.int64)
            if quality.shape != (n,):
                raise InputError(f"quality has shape {quality.shape}", expected=f"({n},)")
            quality.flags.writeable = False
            set_(self, "quality", quality)

    def _deviations(self, values: FloatArray | None, what: str) -> FloatArray:
        n = self.time.size
        if values is None:
            return frozen(np.full((n, 3), np.nan), what, (n, 3))
        sd = frozen(values, f"{what} standard deviation", (n, 3))
        bad = np.flatnonzero((sd <= 0.0).any(axis=1))
        if bad.size:
            raise InputError(
                f"GNSS {what} standard deviation is zero or negative in {bad.size} of {n} "
                f"epochs, the first at {self.time[bad[0]]:.3f} s",
                expected="positive values",
                cure=f"give one for all with --gnss-{what}-sd",
            )
        return sd

    @property
    def size(self) -> int:
        """Number of epochs."""
        return int(self.time.size)

    @property
    def duration(self) -> float:
        """Seconds from the first epoch to the last."""
        return float(self.time[-1] - self.time[0])

    def select(self, keep: NDArray[np.bool_] | NDArray[np.int64]) -> GnssRecording:
        """Return the epochs chosen by a mask or by indices.

        Parameters
        ----------
        keep : (n,) ndarray of bool, or ndarray of int
            Which epochs.

        Returns
        -------
        GnssRecording
            The part.
        """
        return replace(
            self,
            time=self.time[keep],
            position=self.position[keep],
            position_sd=None if self.position_sd is None else self.position_sd[keep],
            velocity=None if self.velocity is None else self.velocity[keep],
            velocity_sd=None if self.velocity_sd is None else self.velocity_sd[keep],
            quality=None if self.quality is None else self.quality[keep],
        )

    def with_standard_deviations(
        self, position: float | None = None, velocity: float | None = None
    ) -> GnssRecording:
        """Return the recording with one standard deviation for all epochs.

        Components that were not measured (infinite) stay so.

        Parameters
        ----------
        position : float or None
            Horizontal standard deviation of a position in m; the vertical is 1.5 times it.
        velocity : float or None
            Standard deviation of each velocity component in m/s.

        Returns
        -------
        GnssRecording
            A copy with a line of history.
        """
        changed = self
        if position is not None:
            sd = np.tile([position, position, 1.5 * position], (self.size, 1))
            changed = replace(
                changed,
                position_sd=sd,
                history=(*changed.history, f"position standard deviation set to {position:g} m"),
            )
        if velocity is not None and self.velocity is not None:
            assert self.velocity_sd is not None
            sd = np.where(np.isinf(self.velocity_sd), np.inf, velocity)
            changed = replace(
                changed,
                velocity_sd=sd,
                history=(*changed.history, f"velocity standard deviation set to {velocity:g} m/s"),
            )
        return changed

    def to_columns(self) -> dict[str, FloatArray]:
        """Return named columns that `read_gnss` understands.

        Returns
        -------
        dict of str to (n,) ndarray
            Units are in the names.
        """
        columns = {
            "time_s": self.time,
            "latitude_deg": np.degrees(self.position[:, 0]),
            "longitude_deg": np.degrees(self.position[:, 1]),
            "height_m": self.position[:, 2],
        }
        for k, axis in enumerate(("north", "east", "down")):
            if self.position_sd is not None:
                columns[f"pos_std_{axis}_m"] = self.position_sd[:, k]
            if self.velocity is not None and self.velocity_sd is not None:
                columns[f"vel_{axis}_m_s"] = self.velocity[:, k]
                columns[f"vel_std_{axis}_m_s"] = self.velocity_sd[:, k]
        if self.quality is not None:
            columns["fix_quality"] = self.quality.astype(np.float64)
        return columns
