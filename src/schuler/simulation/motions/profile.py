"""Smooth motion over the WGS-84 earth, known exactly together with what a perfect IMU would feel.

A profile is one quintic spline of six columns: north, east and up of an origin (its own metres:
latitude, longitude and height scaled by constants, so that no digits are lost), roll, pitch and
yaw. Its fourth derivatives are continuous, so specific force and angular rate have no steps in
their first derivative. Velocity, rate and force follow from the spline by closed formulas.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from schuler import earth
from schuler.data import Trajectory
from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.rotations import dcm_from_euler
from schuler.types import FloatArray

if TYPE_CHECKING:
    from scipy.interpolate import BSpline


DEGREE = 5


@dataclass(frozen=True, slots=True, eq=False)
class Motion:
    """Position and attitude with their derivatives at some times."""

    position: FloatArray  # (n, 3): latitude rad, longitude rad, height m
    velocity: FloatArray  # (n, 3): north, east, down over the earth, m/s
    velocity_rate: FloatArray  # (n, 3): derivative of these three numbers with time, m/s²
    euler: FloatArray  # (n, 3): roll, pitch, yaw, rad, continuous (not wrapped)
    euler_rate: FloatArray  # (n, 3): their derivatives, rad/s


@dataclass(frozen=True, slots=True, eq=False)
class Profile(Exportable):
    """The true motion of an IMU; make one with `static`, `drive`, `car_urban`, `from_waypoints`.

    Parameters
    ----------
    origin : (3,) ndarray
        Latitude rad, longitude rad, height m that the spline counts from.
    start, stop : float
        Seconds between which the motion is known.
    splines : tuple of BSpline
        Six columns: latitude and longitude minus the origin's, times the origin's metres per
        radian; height minus the origin's; roll, pitch, yaw in rad. Then the first and the second
        derivative.

    Examples
    --------
    >>> from schuler import motorcycle
    >>> ride = motorcycle(120.0)
    >>> round(ride.stop - ride.start)
    120
    """

    origin: FloatArray
    start: float
    stop: float
    splines: tuple[BSpline, BSpline, BSpline]

    @property
    def duration(self) -> float:
        """Seconds from start to stop."""
        return self.stop - self.start

    def motion(self, time: ArrayLike) -> Motion:
        """Return position, velocity, attitude and their derivatives."""
        t = np.atleast_1d(np.asarray(time, dtype=np.float64))
        tolerance = 1e-9 * (1.0 + abs(self.stop))
        if t.size and not (t.min() >= self.start - tolerance and t.max() <= self.stop + tolerance):
            raise InputError(
                f"time {t.min():.3f} .. {t.max():.3f} s is outside the profile",
                expected=f"{self.start:.3f} .. {self.stop:.3f} s",
            )
        value, first, second = (spline(t) for spline in self.splines)
        scale = np.array([*earth.metres_per_radian(self.origin), 1.0])
        position = self.origin + value[:, :3] / scale
        rate, acceleration = first[:, :3] / scale, second[:, :3] / scale
        velocity, velocity_rate = _velocity_and_rate(position, rate, acceleration)
        return Motion(position, velocity, velocity_rate, value[:, 3:], first[:, 3:])

    def trajectory(self, time: ArrayLike) -> Trajectory:
        """Return the truth as a trajectory."""
        t = np.atleast_1d(np.asarray(time, dtype=np.float64))
        m = self.motion(t)
        return Trajectory(t, m.position, m.velocity, dcm_from_euler(*m.euler.T))

    def rates(self, time: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return what a perfect IMU feels at an instant."""
        m = self.motion(time)
        w_ie = earth.earth_rate_ned(m.position[:, 0])
        w_en = earth.transport_rate_ned(m.position, m.velocity)
        force = m.velocity_rate + np.cross(2.0 * w_ie + w_en, m.velocity)
        force[:, 2] -= earth.gravity(m.position[:, 0], m.position[:, 2])
        both = _into_body(m.euler, np.stack([w_ie + w_en, force]))
        return _rate_from_euler_rate(m.euler, m.euler_rate) + both[0], both[1]


def _velocity_and_rate(
    position: FloatArray, rate: FloatArray, acceleration: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Velocity north, east, down and its derivative from those of latitude, longitude, height."""
    latitude, height = position[:, 0], position[:, 2]
    meridian, transverse = earth.radii(latitude)
    meridian_slope, transverse_slope = earth.radii_slopes(latitude)
    cosine, sine = np.cos(latitude), np.sin(latitude)
    north, east = meridian + height, (transverse + height) * cosine
    north_rate = meridian_slope * rate[:, 0] + rate[:, 2]
    east_rate = (transverse_slope * rate[:, 0] + rate[:, 2]) * cosine
    east_rate -= (transverse + height) * sine * rate[:, 0]
    velocity = np.stack([north * rate[:, 0], east * rate[:, 1], -rate[:, 2]], axis=-1)
    velocity_rate = np.stack(
        [
            north * acceleration[:, 0] + north_rate * rate[:, 0],
            east * acceleration[:, 1] + east_rate * rate[:, 1],
            -acceleration[:, 2],
        ],
        axis=-1,
    )
    return velocity, velocity_rate


def _into_body(euler: FloatArray, vector: FloatArray) -> FloatArray:
    """C_bn times north-east-down vectors (..., n, 3), by three plane rotations."""
    sine, cosine = np.sin(euler), np.cos(euler)
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    x, y = cosine[:, 2] * x + sine[:, 2] * y, cosine[:, 2] * y - sine[:, 2] * x
    x, z = cosine[:, 1] * x - sine[:, 1] * z, cosine[:, 1] * z + sine[:, 1] * x
    y, z = cosine[:, 0] * y + sine[:, 0] * z, cosine[:, 0] * z - sine[:, 0] * y
    return np.stack([x, y, z], axis=-1)


def _rate_from_euler_rate(euler: FloatArray, euler_rate: FloatArray) -> FloatArray:
    """w_nb in the body, rad/s. Source: Titterton & Weston, 2nd ed., 3.6 (Euler angle rates)."""
    roll, pitch = euler[:, 0], euler[:, 1]
    roll_rate, pitch_rate, yaw_rate = euler_rate.T
    level = yaw_rate * np.cos(pitch)
    return np.stack(
        [
            roll_rate - yaw_rate * np.sin(pitch),
            pitch_rate * np.cos(roll) + level * np.sin(roll),
            level * np.cos(roll) - pitch_rate * np.sin(roll),
        ],
        axis=-1,
    )


def fit_profile(
    time: ArrayLike, position: ArrayLike, euler: ArrayLike, origin: ArrayLike | None = None
) -> Profile:
    """Return the profile that runs smoothly through given positions and attitudes."""
    t, p = np.asarray(time, dtype=np.float64), np.asarray(position, dtype=np.float64)
    origin_ = p[0] if origin is None else np.asarray(origin, dtype=np.float64)
    local = (p - origin_) * np.array([*earth.metres_per_radian(origin_), 1.0])
    return fit_local_profile(t, local, np.asarray(euler, dtype=np.float64), origin_)


def fit_local_profile(
    time: FloatArray, local: FloatArray, euler: FloatArray, origin: FloatArray
) -> Profile:
    """Return the profile through positions that are counted from an origin in its own metres."""
    from scipy.interpolate import make_interp_spline

    n = time.size
    if n <= DEGREE or local.shape != (n, 3) or euler.shape != (n, 3):
        raise InputError(
            f"{n} times, positions of shape {local.shape}, angles of shape {euler.shape}",
            expected=f"at least {DEGREE + 1} times and (n, 3) of both",
        )
    columns = np.hstack([local, euler])
    if not (np.isfinite(columns).all() and np.isfinite(time).all() and np.all(np.diff(time) > 0)):
        raise InputError(
            "waypoints that are not finite, or times that do not increase",
            expected="finite rows in the order of time",
        )
    spline = make_interp_spline(time, columns, k=DEGREE)
    return Profile(
        np.array(origin, dtype=np.float64),
        float(time[0]),
        float(time[-1]),
        (spline, spline.derivative(1), spline.derivative(2)),
    )


def from_waypoints(time: ArrayLike, position: ArrayLike, euler: ArrayLike | None = None) -> Profile:
    """Return a smooth profile through waypoints."""
    t, p = np.asarray(time, dtype=np.float64), np.asarray(position, dtype=np.float64)
    if euler is not None:
        return fit_profile(t, p, euler)
    path = fit_profile(t, p, np.zeros((t.size, 3)))
    dense = np.linspace(t[0], t[-1], 8 * (t.size - 1) + 1)
    motion = path.motion(dense)
    velocity = motion.velocity
    ground_speed = np.hypot(velocity[:, 0], velocity[:, 1])
    if ground_speed.min() < 0.1:
        raise InputError(
            f"the path all but stops at {dense[np.argmin(ground_speed)]:.1f} s, "
            "where the course says nothing about the attitude",
            expected="a ground speed above 0.1 m/s throughout",
            cure="give roll, pitch and yaw at the waypoints",
        )
    yaw = np.unwrap(np.arctan2(velocity[:, 1], velocity[:, 0]))
    pitch = np.arctan2(-velocity[:, 2], ground_speed)
    return fit_profile(
        dense, motion.position, np.stack([np.zeros(dense.size), pitch, yaw], axis=-1), p[0]
    )


def static(
    duration: float,
    *,
    position: ArrayLike = (np.pi / 4, 0.13, 250.0),
    roll: float = 0.0,
    pitch: float = 0.0,
    yaw: float = 0.0,
) -> Profile:
    """Return a profile that stands still."""
    if not duration > 0.0:
        raise InputError(f"duration {duration:g} s", expected="a positive duration")
    n = DEGREE + 1
    return fit_profile(
        np.linspace(0.0, duration, n),
        np.tile(np.asarray(position, dtype=np.float64), (n, 1)),
        np.tile([roll, pitch, yaw], (n, 1)),
    )
