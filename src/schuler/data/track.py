"""A trajectory of any program: positions, and as much of the rest as its file holds."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from schuler.data._checks import check_finite, check_time, frozen
from schuler.data.exportable import Exportable
from schuler.data.trajectory import DIRECTIONS, NavigationSolution, Trajectory
from schuler.errors import InputError
from schuler.rotations import euler_from_dcm
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Track(Exportable):
    """Positions over time, on the earth or in local axes whose place nobody knows.

    Parameters
    ----------
    time : (n,) ndarray
        Seconds, strictly increasing.
    position : (n, 3) ndarray
        Latitude rad, longitude rad, height m; or north, east, down in m where `local`.
    velocity : (n, 3) ndarray or None
        North, east, down in m/s.
    rotation : (n, 3, 3) ndarray or None
        C_nb, takes body vectors into north-east-down.
    position_sd : (n, 3) ndarray or None
        Claimed standard deviations north, east, down in m.
    local : bool
        The position counts from an unknown point, along axes that may be turned.
    name : str
        Name shown to people.
    history : tuple of str
        What was taken for granted on reading.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import Track
    >>> east = np.column_stack([np.zeros(3), np.arange(3.0), np.zeros(3)])
    >>> Track(np.arange(3.0), east, local=True, name="odometry").size
    3
    """

    time: FloatArray
    position: FloatArray
    velocity: FloatArray | None = None
    rotation: FloatArray | None = None
    position_sd: FloatArray | None = None
    local: bool = False
    name: str = "trajectory"
    history: tuple[str, ...] = field(default=())

    def __post_init__(self) -> None:
        time = frozen(self.time, f"time of {self.name}", (None,))
        n = time.size
        if n < 2:
            raise InputError(f"{self.name} has {n} positions", expected="at least 2")
        check_time(time, self.name)
        object.__setattr__(self, "time", time)
        for what, shape in (
            ("position", (n, 3)), ("velocity", (n, 3)), ("rotation", (n, 3, 3)),
            ("position_sd", (n, 3)),
        ):  # fmt: skip
            values = getattr(self, what)
            if values is not None:
                array = frozen(values, f"{what} of {self.name}", shape)
                if what != "position_sd":
                    check_finite(array, f"{what} of {self.name}")
                object.__setattr__(self, what, array)

    @property
    def size(self) -> int:
        """Number of positions."""
        return int(self.time.size)

    @classmethod
    def of(cls, result: NavigationSolution | Trajectory | Track) -> Track:
        """Return a trajectory or a solution as a track."""
        if isinstance(result, Track):
            return result
        path = result if isinstance(result, Trajectory) else result.trajectory
        sd = result.position_sd if isinstance(result, NavigationSolution) else None
        return cls(path.time, path.position, path.velocity, path.rotation, sd)

    def to_columns(self) -> dict[str, FloatArray]:
        """Return named columns, in the units of their names.

        Returns
        -------
        dict of str to (n,) ndarray
            Without what the track does not hold.
        """
        columns = {"time_s": self.time}
        if self.local:
            columns |= {f"{d}_m": self.position[:, k] for k, d in enumerate(DIRECTIONS)}
        else:
            columns["latitude_deg"], columns["longitude_deg"] = np.degrees(self.position[:, :2]).T
            columns["height_m"] = self.position[:, 2]
        for name, values in (("vel_{}_m_s", self.velocity), ("pos_std_{}_m", self.position_sd)):
            if values is not None:
                columns |= {name.format(d): values[:, k] for k, d in enumerate(DIRECTIONS)}
        if self.rotation is not None:
            angles = zip(("roll", "pitch", "heading"), euler_from_dcm(self.rotation), strict=True)
            columns |= {f"{name}_deg": np.degrees(angle) for name, angle in angles}
        return columns
