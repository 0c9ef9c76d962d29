"""The WGS-84 earth: radii, gravity, rates, and the change between coordinates.

A position is latitude (rad), longitude (rad) and height above the ellipsoid (m); vectors are
north, east, down. Sources: NIMA TR8350.2 (constants, normal gravity); Groves, *Principles of GNSS,
Inertial, and Multisensor Integrated Navigation Systems*, 2nd ed. (chapter 2 and 5); Titterton &
Weston, *Strapdown Inertial Navigation Technology*, 2nd ed. (chapter 3).
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import InputError
from schuler.types import FloatArray

SEMI_MAJOR_AXIS: Final = 6378137.0
"""Equatorial radius a, m."""
FLATTENING: Final = 1.0 / 298.257223563
"""Flattening f = (a - b) / a."""
SEMI_MINOR_AXIS: Final = SEMI_MAJOR_AXIS * (1.0 - FLATTENING)
"""Polar radius b, m."""
ECCENTRICITY_SQUARED: Final = FLATTENING * (2.0 - FLATTENING)
"""First eccentricity squared e² = (a² - b²) / a²."""
EARTH_RATE: Final = 7.292115e-5
"""Rotation of the earth in inertial space, rad/s."""
GRAVITATIONAL_CONSTANT: Final = 3.986004418e14
"""GM of the earth with its atmosphere, m³/s²."""
EQUATORIAL_GRAVITY: Final = 9.7803253359
"""Normal gravity on the ellipsoid at the equator, m/s²."""
POLAR_GRAVITY: Final = 9.8321849379
"""Normal gravity on the ellipsoid at the poles, m/s²."""
STANDARD_GRAVITY: Final = 9.80665
"""The unit g, m/s²; not the gravity of any place."""


def _positions(values: ArrayLike, what: str = "position") -> FloatArray:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim < 1 or array.shape[-1] != 3:
        raise InputError(f"{what} has shape {array.shape}", expected="(..., 3)")
    return array


def radii(latitude: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return the radii of curvature of the ellipsoid."""
    w2 = 1.0 - ECCENTRICITY_SQUARED * np.sin(np.asarray(latitude, dtype=np.float64)) ** 2
    transverse = SEMI_MAJOR_AXIS / np.sqrt(w2)
    meridian = transverse * (1.0 - ECCENTRICITY_SQUARED) / w2
    return np.asarray(meridian), np.asarray(transverse)


def radii_slopes(latitude: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives of the radii of curvature with latitude."""
    lat = np.asarray(latitude, dtype=np.float64)
    w2 = 1.0 - ECCENTRICITY_SQUARED * np.sin(lat) ** 2
    common = ECCENTRICITY_SQUARED * np.sin(lat) * np.cos(lat) / w2
    meridian, transverse = radii(lat)
    return np.asarray(3.0 * common * meridian), np.asarray(common * transverse)


def metres_per_radian(position: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return how many metres north and east a radian of latitude and longitude is."""
    p = _positions(position)
    meridian, transverse = radii(p[..., 0])
    north = meridian + p[..., 2]
    return np.asarray(north), np.asarray((transverse + p[..., 2]) * np.cos(p[..., 0]))


def gravity(latitude: ArrayLike, height: ArrayLike) -> FloatArray:
    """Return normal gravity, which points down."""
    lat = np.asarray(latitude, dtype=np.float64)
    h = np.asarray(height, dtype=np.float64)
    sin2 = np.sin(lat) ** 2
    a, b = SEMI_MAJOR_AXIS, SEMI_MINOR_AXIS
    on_ellipsoid = (a * EQUATORIAL_GRAVITY * (1.0 - sin2) + b * POLAR_GRAVITY * sin2) / np.sqrt(
        a * a * (1.0 - sin2) + b * b * sin2
    )
    centrifugal = EARTH_RATE**2 * a * a * b / GRAVITATIONAL_CONSTANT
    first = 2.0 / a * (1.0 + FLATTENING + centrifugal - 2.0 * FLATTENING * sin2)
    return np.asarray(on_ellipsoid * (1.0 - first * h + 3.0 * (h / a) ** 2))


def earth_rate_ned(latitude: ArrayLike) -> FloatArray:
    """Return the rotation of the earth in inertial space."""
    lat = np.asarray(latitude, dtype=np.float64)
    rate = np.zeros((*lat.shape, 3))
    rate[..., 0] = EARTH_RATE * np.cos(lat)
    rate[..., 2] = -EARTH_RATE * np.sin(lat)
    return rate


def transport_rate_ned(position: ArrayLike, velocity: ArrayLike) -> FloatArray:
    """Return the rotation of the local level frame over the earth."""
    p, v = _positions(position), _positions(velocity, "velocity")
    meridian, transverse = radii(p[..., 0])
    rate = np.empty(np.broadcast_shapes(p.shape, v.shape))
    rate[..., 0] = v[..., 1] / (transverse + p[..., 2])
    rate[..., 1] = -v[..., 0] / (meridian + p[..., 2])
    rate[..., 2] = -rate[..., 0] * np.tan(p[..., 0])
    return rate


def ecef_from_geodetic(position: ArrayLike) -> FloatArray:
    """Return earth-centred earth-fixed coordinates."""
    p = _positions(position)
    lat, lon, h = p[..., 0], p[..., 1], p[..., 2]
    _, transverse = radii(lat)
    from_axis = (transverse + h) * np.cos(lat)
    z = (transverse * (1.0 - ECCENTRICITY_SQUARED) + h) * np.sin(lat)
    return np.stack([from_axis * np.cos(lon), from_axis * np.sin(lon), z], axis=-1)


def geodetic_from_ecef(ecef: ArrayLike) -> FloatArray:
    """Return latitude, longitude and height."""
    r = _positions(ecef, "ECEF position")
    a, b, e2 = SEMI_MAJOR_AXIS, SEMI_MINOR_AXIS, ECCENTRICITY_SQUARED
    from_axis, z = np.hypot(r[..., 0], r[..., 1]), r[..., 2]
    parametric = np.arctan2(a * z, b * from_axis)
    latitude = parametric
    for _ in range(5):
        latitude = np.arctan2(
            z + e2 / (1.0 - e2) * b * np.sin(parametric) ** 3,
            from_axis - e2 * a * np.cos(parametric) ** 3,
        )
        parametric = np.arctan2(b * np.sin(latitude), a * np.cos(latitude))
    height = (
        from_axis * np.cos(latitude)
        + z * np.sin(latitude)
        - a * np.sqrt(1.0 - e2 * np.sin(latitude) ** 2)
    )
    return np.stack([latitude, np.arctan2(r[..., 1], r[..., 0]), height], axis=-1)


def ned_from_ecef_rotation(latitude: ArrayLike, longitude: ArrayLike) -> FloatArray:
    """Return C_ne, which takes earth-fixed vectors into north, east, down."""
    lat, lon = np.broadcast_arrays(
        np.asarray(latitude, dtype=np.float64), np.asarray(longitude, dtype=np.float64)
    )
    s_lat, c_lat, s_lon, c_lon = np.sin(lat), np.cos(lat), np.sin(lon), np.cos(lon)
    zero = np.zeros(lat.shape)
    rows = (
        np.stack([-s_lat * c_lon, -s_lat * s_lon, c_lat], axis=-1),
        np.stack([-s_lon, c_lon, zero], axis=-1),
        np.stack([-c_lat * c_lon, -c_lat * s_lon, -s_lat], axis=-1),
    )
    return np.stack(rows, axis=-2)


def ned_from_geodetic(position: ArrayLike, origin: ArrayLike) -> FloatArray:
    """Return coordinates in the plane that touches the earth at an origin.

    Parameters
    ----------
    position : (..., 3) array_like
        Latitude rad, longitude rad, height m.
    origin : (3,) array_like
        The same of the origin.

    Returns
    -------
    (..., 3) ndarray
        North, east, down, m.

    Notes
    -----
    Through earth-centred coordinates of WGS 84, exact at any distance.

    Examples
    --------
    >>> import schuler
    >>> schuler.ned_from_geodetic([0.8, 0.1, 310.0], [0.8, 0.1, 300.0]).round(6) + 0.0
    array([  0.,   0., -10.])
    """
    o = _positions(origin, "origin")
    line = ecef_from_geodetic(position) - ecef_from_geodetic(o)
    rotation = ned_from_ecef_rotation(o[..., 0], o[..., 1])
    return np.asarray((rotation @ line[..., None])[..., 0])


def geodetic_from_ned(ned: ArrayLike, origin: ArrayLike) -> FloatArray:
    """Return the position of a point given in the plane that touches the earth at an origin."""
    vector, o = _positions(ned, "local position"), _positions(origin, "origin")
    rotation = np.swapaxes(ned_from_ecef_rotation(o[..., 0], o[..., 1]), -1, -2)
    return geodetic_from_ecef(ecef_from_geodetic(o) + (rotation @ vector[..., None])[..., 0])
