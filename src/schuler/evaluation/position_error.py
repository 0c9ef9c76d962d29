"""What a residual sensor error does to position: the simple laws, and where they stop holding.

S003 turns the mean square of a one-step prediction error into metres after an hour with the first
two laws (tables 1 and 2), as if that error were a constant and the earth flat. It is neither: a
prediction error is white, and Schuler's pendulum bounds what a constant does (E-003-5).
"""

from __future__ import annotations

import math

from schuler.earth import SEMI_MAJOR_AXIS
from schuler.errors import InputError

# what S003 took, m/s²
GRAVITY = 9.81


def position_error_of_accel_bias(bias: float, time: float) -> float:
    """Position error of a constant accelerometer error on a flat earth, b t²/2.

    Parameters
    ----------
    bias : float
        m/s².
    time : float
        Seconds.

    Returns
    -------
    float
        m.

    Notes
    -----
    The position columns of S003 Tables 1 and 2; beyond some minutes Schuler's pendulum bounds it,
    see `schuler_factor`.

    Examples
    --------
    >>> import schuler
    >>> round(schuler.position_error_of_accel_bias(1.0, 10.0), 3)
    50.0
    """
    return 0.5 * bias * _passed(time) ** 2


def position_error_of_gyro_bias(bias: float, time: float, gravity: float = GRAVITY) -> float:
    """Position error of a constant gyro error on a flat earth, g b t³/6.

    Parameters
    ----------
    bias : float
        rad/s.
    time : float
        Seconds.
    gravity : float
        m/s².

    Returns
    -------
    float
        m.

    Notes
    -----
    The position columns of S003 Tables 1 and 2; beyond some minutes Schuler's pendulum bounds it,
    see `schuler_factor`.

    Examples
    --------
    >>> import schuler
    >>> round(schuler.position_error_of_gyro_bias(1e-3, 10.0), 3)
    1.635
    """
    return gravity * bias * _passed(time) ** 3 / 6.0


def schuler_factor(sensor: str, time: float, gravity: float = GRAVITY) -> float:
    """Share of the flat-earth law that is left when the level platform swings back.

    For an accelerometer 2 (1 - cos x)/x², for a gyro 6 (x - sin x)/x³, with x = t sqrt(g/R).

    Parameters
    ----------
    sensor : {"accel", "gyro"}
        Whose constant error.
    time : float
        Seconds.
    gravity : float
        m/s².

    Returns
    -------
    float
        1 at the start, 0.125 (accel) and 0.37 (gyro) after an hour.

    Raises
    ------
    InputError
        Another sensor.

    Notes
    -----
    Titterton and Weston, 2nd ed., table 12.1.

    Examples
    --------
    >>> import schuler
    >>> round(schuler.schuler_factor("accel", 3600.0), 3)
    0.125
    """
    x = _passed(time) * math.sqrt(gravity / SEMI_MAJOR_AXIS)
    if sensor not in ("accel", "gyro"):
        raise InputError(f"sensor '{sensor}'", expected="accel or gyro")
    if x < 1e-3:
        return 1.0
    if sensor == "accel":
        return 2.0 * (1.0 - math.cos(x)) / x**2
    return 6.0 * (x - math.sin(x)) / x**3


def position_sd_of_white_acceleration(sample_sd: float, interval: float, time: float) -> float:
    """Standard deviation of position from white acceleration errors, sd sqrt(dt t³/3).

    Parameters
    ----------
    sample_sd : float
        Of one sample, m/s².
    interval : float
        Between samples, s.
    time : float
        Seconds.

    Returns
    -------
    float
        m.

    Notes
    -----
    What a one-step prediction error does to position; erratum E-003-5 of S003.

    Examples
    --------
    >>> import schuler
    >>> round(schuler.position_sd_of_white_acceleration(5e-9**0.5, 0.005, 3600.0), 2)
    0.62
    """
    return sample_sd * math.sqrt(_passed(interval) * _passed(time) ** 3 / 3.0)


def _passed(time: float) -> float:
    if not time >= 0.0:
        raise InputError(f"a time of {time:g} s", expected="a time that is not negative")
    return time
