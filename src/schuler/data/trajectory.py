"""What was solved or is true: a trajectory, and a navigation solution with its uncertainty."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from schuler.data._checks import check_finite, check_time, frozen
from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.rotations import euler_from_dcm
from schuler.types import FloatArray

DIRECTIONS = ("north", "east", "down")


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory(Exportable):
    """Position, velocity and attitude of the IMU over time.

    Parameters
    ----------
    time : (n,) ndarray
        Seconds, strictly increasing.
    position : (n, 3) ndarray
        Latitude rad, longitude rad, height m (WGS-84).
    velocity : (n, 3) ndarray
        North, east, down in m/s.
    rotation : (n, 3, 3) ndarray
        C_nb, takes body vectors into north-east-down.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import Trajectory
    >>> place = np.tile((np.radians(48.1), np.radians(11.5), 520.0), (3, 1))
    >>> still = Trajectory(np.arange(3.0), place, np.zeros((3, 3)), np.tile(np.eye(3), (3, 1, 1)))
    >>> still.time.size
    3
    """

    time: FloatArray
    position: FloatArray
    velocity: FloatArray
    rotation: FloatArray

    def __post_init__(self) -> None:
        time = frozen(self.time, "trajectory time", (None,))
        check_time(time, "trajectory")
        n = time.size
        set_ = object.__setattr__
        set_(self, "time", time)
        for what, shape in (
            ("position", (n, 3)),
            ("velocity", (n, 3)),
            ("rotation", (n, 3, 3)),
        ):
            array = frozen(getattr(self, what), f"trajectory {what}", shape)
            check_finite(array, f"trajectory {what}")
            set_(self, what, array)

    @property
    def size(self) -> int:
        """Number of samples."""
        return int(self.time.size)

    def to_columns(self) -> dict[str, FloatArray]:
        """Return named columns, in the units of their names; attitude as angles.

        Returns
        -------
        dict of str to (n,) ndarray
            Those of a file of `schuler navigate --out`.
        """
        columns = {
            "time_s": self.time,
            "latitude_deg": np.degrees(self.position[:, 0]),
            "longitude_deg": np.degrees(self.position[:, 1]),
            "height_m": self.position[:, 2],
        }
        for k, direction in enumerate(DIRECTIONS):
            columns[f"vel_{direction}_m_s"] = self.velocity[:, k]
        angles = zip(("roll", "pitch", "heading"), euler_from_dcm(self.rotation), strict=True)
        return columns | {f"{name}_deg": np.degrees(angle) for name, angle in angles}


@dataclass(frozen=True, slots=True, eq=False)
class Innovations(Exportable):
    """Every aiding update of a run: what was measured minus what was predicted.

    Parameters
    ----------
    time : (u,) ndarray
        Seconds.
    kind : tuple of str
        Name of the measurement of each update, e.g. "gnss position".
    value : (u, 3) ndarray
        Predicted minus measured; NaN for components not measured.
    sd : (u, 3) ndarray
        Claimed standard deviation of each component, NaN as above.
    nis : (u,) ndarray
        Normalised innovation squared of the whole vector.
    degrees : (u,) ndarray of int
        Its degrees of freedom.
    accepted : (u,) ndarray of bool
        False where the gate kept the update out.

    Examples
    --------
    >>> from schuler import NoiseModel, Scenario, WhiteNoise, navigate, simulate_drive
    >>> from schuler.simulation import RTK_FIXED
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> drive = simulate_drive(Scenario("car_urban", model, RTK_FIXED, duration=120.0), seed=1)
    >>> solution = navigate(drive.imus[0], drive.gnss, model, time_offset=0.0, tune_noise=False)
    >>> bool(solution.innovations.accepted.mean() > 0.99)
    True
    """

    time: FloatArray
    kind: tuple[str, ...]
    value: FloatArray
    sd: FloatArray
    nis: FloatArray
    degrees: NDArray[np.int64]
    accepted: NDArray[np.bool_]
    AXES: ClassVar[str] = "north east down"

    def of_kind(self, kind: str) -> Innovations:
        """Return the updates of one kind.

        Parameters
        ----------
        kind : str
            As in `kind`.

        Returns
        -------
        Innovations
            The part, perhaps empty.
        """
        return self._picked(np.array([k == kind for k in self.kind], dtype=bool))

    @property
    def gnss(self) -> Innovations:
        """The updates by GNSS, without those by what is known of the vehicle."""
        return self._picked(np.array([k.startswith("GNSS") for k in self.kind], dtype=bool))

    @property
    def mean_nis(self) -> float:
        """Normalised innovation squared over its degrees of freedom, accepted updates only."""
        degrees = int(self.degrees[self.accepted].sum())
        return float(self.nis[self.accepted].sum()) / degrees if degrees else float("nan")

    def _picked(self, pick: NDArray[np.bool_]) -> Innovations:
        return Innovations(
            time=self.time[pick],
            kind=tuple(k for k, keep in zip(self.kind, pick, strict=True) if keep),
            value=self.value[pick],
            sd=self.sd[pick],
            nis=self.nis[pick],
            degrees=self.degrees[pick],
            accepted=self.accepted[pick],
        )

    @property
    def kinds(self) -> tuple[str, ...]:
        """Names of the kinds that occur, in order of first use."""
        return tuple(dict.fromkeys(self.kind))


@dataclass(frozen=True, slots=True, eq=False)
class NavigationSolution(Exportable):
    """A trajectory with what the filter claims to know about it.

    Parameters
    ----------
    trajectory : Trajectory
        At the rate of the IMU.
    position_covariance : (n, 3, 3) ndarray
        North, east, down, m².
    velocity_sd : (n, 3) ndarray
        North, east, down, m/s.
    attitude_sd : (n, 3) ndarray
        Small angles about north, east, down, rad.
    sensor_error_time : (m,) ndarray
        Seconds.
    sensor_errors : (m, s) ndarray
        Estimated sensor error states, SI.
    sensor_errors_sd : (m, s) ndarray
        Their standard deviations.
    sensor_error_names : tuple of str
        E.g. "accel_x random walk".
    innovations : Innovations
        Every update.
    settings : dict
        Everything the run depended on, as plain JSON values.
    smoothed : bool
        True when future data were used.
    log_likelihood : float
        Of the accepted innovations.
    gnss_error_covariance : (m, 3, 3) ndarray or None
        Covariance of position with the states of GNSS errors that last, at `sensor_error_time`;
        known of runs that were smoothed.

    Examples
    --------
    >>> from schuler import NoiseModel, Scenario, WhiteNoise, navigate, simulate_drive
    >>> from schuler.simulation import RTK_FIXED
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> drive = simulate_drive(Scenario("car_urban", model, RTK_FIXED, duration=120.0), seed=1)
    >>> solution = navigate(drive.imus[0], drive.gnss, model, time_offset=0.0, tune_noise=False)
    >>> solution.smoothed, solution.attitude_sd.shape[1]
    (False, 3)
    """

    trajectory: Trajectory
    position_covariance: FloatArray
    velocity_sd: FloatArray
    attitude_sd: FloatArray
    sensor_error_time: FloatArray
    sensor_errors: FloatArray
    sensor_errors_sd: FloatArray
    sensor_error_names: tuple[str, ...]
    innovations: Innovations
    settings: dict[str, Any] = field(default_factory=dict)
    smoothed: bool = False
    log_likelihood: float = float("nan")
    gnss_error_covariance: FloatArray | None = None

    def __post_init__(self) -> None:
        n = self.trajectory.size
        if self.position_covariance.shape != (n, 3, 3):
            raise InputError(
                f"position covariance has shape {self.position_covariance.shape}",
                expected=f"({n}, 3, 3)",
            )

    @property
    def position_sd(self) -> FloatArray:
        """Standard deviations of position north, east, down, m, (n, 3)."""
        diagonal = np.diagonal(self.position_covariance, axis1=1, axis2=2)
        sd: FloatArray = np.sqrt(np.maximum(diagonal, 0.0))
        return sd

    @property
    def findings(self) -> list[dict[str, Any]]:
        """What the run has to say: kind, severity, message, value and cure of each finding."""
        return list(self.settings.get("findings", ()))

    def to_columns(self) -> dict[str, FloatArray]:
        """Return named columns, in the units of their names, with standard deviations.

        Returns
        -------
        dict of str to (n,) ndarray
            Those of a file of `schuler navigate --out`.
        """
        columns = self.trajectory.to_columns()
        for name, sd in (
            ("pos_std_{}_m", self.position_sd),
            ("vel_std_{}_m_s", self.velocity_sd),
            ("att_std_{}_deg", np.degrees(self.attitude_sd)),
        ):
            columns |= {name.format(d): sd[:, k] for k, d in enumerate(DIRECTIONS)}
        return columns
