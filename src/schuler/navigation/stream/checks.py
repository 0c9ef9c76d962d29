"""What a stream refuses before it changes anything: samples and fixes that cannot be true."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import InputError
from schuler.navigation.aiding.gnss import LEAST_POSITION_SD, LEAST_VELOCITY_SD, NEAREST_POLE
from schuler.navigation.aiding.schedule import AidingSchedule
from schuler.types import FloatArray

LONGEST_GAP = 10.0
"""Seconds between two samples that a stream bridges; what is longer is a jump of the clock, or a
pause after which nothing is known."""
FARTHEST_AHEAD = 60.0
"""Seconds that a fix may be ahead of the samples."""
FASTEST_TURN = 1e3
"""Rad/s beyond what any gyro measures."""
STRONGEST_PUSH = 1e5
"""The same of accelerometers, m/s²."""
HEIGHTS = (-2e4, 1e8)


def checked_time(time: float, what: str) -> float:
    """Return a time that is a finite number."""
    try:
        value = float(time)
    except (TypeError, ValueError):
        value = math.nan
    if not math.isfinite(value):
        raise InputError(f"a {what} at the time {time!r}", expected="a finite time in seconds")
    return value


def _three(values: ArrayLike, what: str, places: int = 3) -> FloatArray:
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.empty(0)
    if array.shape != (places,):
        shape = getattr(values, "shape", None)
        found = repr(values) if shape is None else f"an array of shape {shape}"
        raise InputError(f"{what} is {found}", expected=f"{places} numbers")
    return array


def checked_stamp(time: float, last: float) -> float:
    """Return the time of a sample that may come after one at the time `last`."""
    time = checked_time(time, "sample")
    if not time > last:
        raise InputError(
            f"a sample at {time:.6f} s after one at {last:.6f} s", expected="time that increases"
        )
    if time - last > LONGEST_GAP and last != -math.inf:
        raise InputError(
            f"the IMU's clock jumped by {time - last:.6g} s, from {last:.3f} to {time:.3f} s",
            expected=f"samples at most {LONGEST_GAP:g} s apart",
            cure="leave such a sample out; take jumps of the clock out of the stamps, and start a "
            "new filter after a pause",
        )
    return time


def checked_sample(
    time: float, gyro: ArrayLike, accel: ArrayLike, last: float
) -> tuple[float, FloatArray, FloatArray]:
    """Return a sample that may come after one at the time `last`."""
    time = checked_time(time, "sample")
    rate, force = _three(gyro, "the gyros' sample"), _three(accel, "the accelerometers' sample")
    for values, most, what in (
        (rate, FASTEST_TURN, "the gyros show"),
        (force, STRONGEST_PUSH, "the accelerometers show"),
    ):
        x, y, z = values.tolist()
        if not (abs(x) < most and abs(y) < most and abs(z) < most):
            raise InputError(
                f"{what} ({x:g}, {y:g}, {z:g}) at {time:.6f} s",
                expected=f"finite numbers within {most:g} in SI units",
                cure="leave this sample out; the next one bridges the gap",
            )
    return checked_stamp(time, last), rate, force


def checked_scale(white_scale: ArrayLike) -> FloatArray:
    """Return factors on the noise densities."""
    scale = _three(white_scale, "white_scale", 6)
    if not (np.isfinite(scale).all() and (scale >= 0.0).all()):
        raise InputError(f"white_scale is {scale}", expected="finite numbers of zero or more")
    return scale


def checked_fix(
    value: ArrayLike, sd: ArrayLike, what: str, least_sd: float
) -> tuple[FloatArray, FloatArray]:
    """Return position or velocity and its standard deviations; infinite: not measured."""
    values = _three(value, f"the {what}")
    deviation = sd if np.ndim(sd) else np.full(3, sd)
    deviation = _three(deviation, f"the standard deviation of the {what}")
    measured = np.isfinite(deviation)
    if not (deviation >= least_sd).all() or not measured.any():
        raise InputError(
            f"the standard deviation of the {what} is {deviation}",
            expected=f"{least_sd:g} or more, infinite where not measured, not all infinite",
        )
    if not np.isfinite(values[measured]).all():
        raise InputError(
            f"the {what} is {values}",
            expected="finite numbers",
            cure="give no position or velocity where the receiver has none",
        )
    return values, deviation


def checked_position(value: ArrayLike, sd: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return a position on earth, in radians and metres, and its standard deviations."""
    place, deviation = checked_fix(value, sd, "position", LEAST_POSITION_SD)
    latitude, longitude, height = place.tolist()
    if abs(latitude) > 0.5 * math.pi or abs(longitude) > 2.0 * math.pi:
        raise InputError(
            f"a position at latitude {latitude:.6g}, longitude {longitude:.6g}",
            expected="radians, latitude within +-pi/2",
            cure="convert degrees with numpy.radians",
        )
    if abs(latitude) > NEAREST_POLE:
        raise InputError(
            f"a position at latitude {math.degrees(latitude):.6f} deg: at a pole north and east do "
            "not exist",
            expected=f"latitudes within +-{math.degrees(NEAREST_POLE):.2f} deg",
        )
    if height < HEIGHTS[0] or height > HEIGHTS[1]:
        raise InputError(f"a height of {height:.6g} m", expected="metres above the ellipsoid")
    return place, deviation


def checked_velocity(value: ArrayLike, sd: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return a velocity and its standard deviations."""
    return checked_fix(value, sd, "velocity", LEAST_VELOCITY_SD)


def check_ahead(time: float, last: float) -> None:
    """Refuse what is stamped far ahead of the samples: another clock."""
    if time - last > FARTHEST_AHEAD and last != -math.inf:
        raise InputError(
            f"a measurement at {time:.3f} s, {time - last:.6g} s ahead of the IMU",
            expected=f"the time axis of the IMU, at most {FARTHEST_AHEAD:g} s ahead",
            cure="convert the receiver's stamps to the clock of the IMU",
        )


def check_measurements(measurements: AidingSchedule, last: float) -> None:
    """Refuse rows of which one cannot be used."""
    used = np.isfinite(measurements.variance)
    if not np.isfinite(measurements.time).all():
        raise InputError("a measurement without a time", expected="a finite time in seconds")
    if not np.isfinite(np.where(used, measurements.value, 0.0)).all():
        raise InputError("a measurement that is not finite", expected="finite numbers")
    if np.isnan(measurements.variance).any() or (measurements.variance <= 0.0).any():
        raise InputError(
            "a variance that is zero, negative or not a number",
            expected="positive, infinite where not measured",
        )
    if measurements.size:
        check_ahead(float(measurements.time.max()), last)
