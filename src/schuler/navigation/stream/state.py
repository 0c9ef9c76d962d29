"""What goes into a stream beside samples, and what comes out: the receiver, the state."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from numpy.typing import ArrayLike

from schuler.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class FilterState:
    """The filter's state at one time.

    Parameters
    ----------
    time : float
        Seconds on the IMU's axis.
    position, velocity : (3,) ndarray
        Latitude rad, longitude rad, height m; north, east, down m/s.
    rotation : (3, 3) ndarray
        C_nb.
    sensor_state : (m,) ndarray
        Sensor error states, SI.
    covariance : (9 + m, 9 + m) ndarray
        Of position (m), velocity, attitude (rad), sensor states.

    Examples
    --------
    >>> from schuler import NavigationFilter, NoiseModel, Scenario, WhiteNoise
    >>> from schuler import prepare, simulate_drive
    >>> from schuler.simulation import RTK_FIXED
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> drive = simulate_drive(Scenario("car_urban", model, RTK_FIXED, duration=120.0), seed=1)
    >>> imu, gnss = drive.imus[0], drive.gnss
    >>> ready, setup = prepare(imu, gnss, model, time_offset=0.0, tune_noise=False)
    >>> stream = NavigationFilter.from_setup(setup, ready, gnss)
    >>> stream.state().position.shape
    (3,)
    """

    time: float
    position: FloatArray
    velocity: FloatArray
    rotation: FloatArray
    sensor_state: FloatArray
    covariance: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class GnssReceiver:
    """How fixes are used that a stream brings.

    Parameters
    ----------
    lever_arm : (3,) array_like
        Antenna from IMU in the body frame, m.
    position_offset, velocity_offset : float
        Seconds added to the time of a fix to put its position and velocity on the IMU's axis.
    position_factor, velocity_factor : float
        Multiply the receiver's standard deviations.
    offset_states : (3,) sequence of int
        Places of sensor states that add to what positions measure; -1: none.
    white_share, slow_share : float
        Of the claimed variances of position: what is noise, and what those states are seen with;
        see `GnssErrorModel`.

    Examples
    --------
    >>> from schuler import GnssReceiver
    >>> GnssReceiver(lever_arm=(0.0, 0.0, -1.2), position_offset=0.05).position_factor
    1.0
    """

    lever_arm: ArrayLike = (0.0, 0.0, 0.0)
    position_offset: float = 0.0
    velocity_offset: float = 0.0
    position_factor: float = 1.0
    velocity_factor: float = 1.0
    offset_states: Sequence[int] = (-1, -1, -1)
    white_share: float = 1.0
    slow_share: float = 0.0
