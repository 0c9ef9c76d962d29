"""Speed of a vehicle from its wheels: an odometer with scale, slip and delay as states.

It measures how fast the vehicle goes, not where to: the speed along its path, which needs no
mounting (an IMU a few degrees off the forward axis changes it by a thousandth). Before use it is
held against GNSS, which tells wrong units, another clock and counters that stick.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from schuler.data import GnssRecording
from schuler.data.exportable import Exportable
from schuler.errors import InputError
from schuler.navigation.aiding.general import AidedState, AidingState
from schuler.navigation.aiding.schedule import checked_series
from schuler.types import BoolArray, FloatArray

INTERVAL = 0.2
"""Seconds over which faster odometers are averaged: speed changes little in it."""
SLOWEST = 0.5
"""m/s below which the direction of motion is not known well enough."""
_MOVING, _FEWEST = 1.0, 10
_CORRELATED, _LARGEST_LAG, _SEARCH = 0.8, 1.0, 5.0
_LARGEST_SCALE = 0.15
_STUCK, _CHANGED = 3.0, 1.0
_UNITS = {"km/h": 3.6, "mph": 2.23694, "kn": 1.94384, "ft/s": 3.28084}


@dataclass(frozen=True, slots=True, eq=False)
class Odometer(Exportable):
    """Speeds of a vehicle over ground, by its wheels.

    Parameters
    ----------
    time : (k,) array_like
        Seconds on the axis of the IMU.
    speed : (k,) array_like
        m/s; its sign does not matter.
    sd : float
        White noise of each, m/s.
    scale_sd : float
        Standard deviation of the scale error (circumference of the wheels), which is estimated.
    slip_sd, slip_time : float
        Standard deviation of what is wrong for longer than a moment, m/s, and for how long, s.
    delay_sd : float
        Standard deviation of the delay of the stamps, s, which is estimated.
    name : str
        In tables and reports.
    growth : (k,) ndarray
        How fast the speeds grow, m/s², from themselves.

    Raises
    ------
    InputError
        Lengths that differ, numbers that are not finite.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import Odometer
    >>> Odometer(np.arange(0.0, 60.0, 0.1), np.full(600, 8.0)).time.size
    300
    """

    time: ArrayLike
    speed: ArrayLike
    sd: float = 0.05
    scale_sd: float = 0.03
    slip_sd: float = 0.03
    slip_time: float = 20.0
    delay_sd: float = 0.1
    name: str = "odometer"
    growth: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        time, speed = checked_series(self.time, self.speed, 1, "odometer speeds")
        time, speed, count = _averaged(time, np.abs(speed))
        growth = np.gradient(speed, time) if time.size > 1 else np.zeros(time.size)
        rolling = speed >= SLOWEST
        for name, values in (("time", time), ("speed", speed), ("growth", growth)):
            object.__setattr__(self, name, values[rolling])
        object.__setattr__(self, "sd", self.sd / np.sqrt(count))

    @property
    def states(self) -> tuple[AidingState, ...]:
        """Scale error, slip and delay."""
        return (
            AidingState("odometer scale error", self.scale_sd),
            AidingState("odometer slip", self.slip_sd, correlation_time=self.slip_time),
            AidingState("odometer delay", self.delay_sd),
        )

    def linearise(self, k: int, state: AidedState) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return residual, derivatives and variance of one speed."""
        size = float(np.linalg.norm(state.velocity))
        design = np.zeros((1, 9 + state.own.size))
        if size < SLOWEST:
            return np.zeros(1), design, np.full(1, 1e6)
        scale, slip, delay = state.own
        growth = self.growth[k]
        design[0, 3:6] = (1.0 + scale) * state.velocity / size
        design[0, 9:] = size, 1.0, -growth
        predicted = (1.0 + scale) * size + slip - delay * growth
        return np.array([predicted - np.asarray(self.speed)[k]]), design, np.array([self.sd**2])


def _averaged(time: FloatArray, speed: FloatArray) -> tuple[FloatArray, FloatArray, int]:
    """Average what comes faster than the filter needs it; return how many went into each."""
    if time.size < 3:
        return time, speed, 1
    count = max(1, round(INTERVAL / float(np.median(np.diff(time)))))
    whole = time.size // count * count
    means = [v[:whole].reshape(-1, count).mean(axis=1) for v in (time, speed)]
    return means[0], means[1], count


def odometer_checked(
    time: FloatArray, speed: FloatArray, gnss: GnssRecording, *, counts: bool = False
) -> tuple[FloatArray, FloatArray, tuple[str, ...]]:
    """Hold an odometer against GNSS, and leave out where it sticks.

    Parameters
    ----------
    time, speed : (k,) ndarray
        On the axis of the IMU; m/s, or counts of a wheel a second.
    gnss : GnssRecording
        Of the same drive.
    counts : bool
        The speeds are counts a second: how far one count goes is taken from GNSS.

    Returns
    -------
    time, speed : ndarray
        What can be used, m/s.
    remarks : tuple of str
        What was found and done.

    Raises
    ------
    InputError
        Another unit, another clock, or a speed that is not that of GNSS.
    """
    order = np.argsort(time, kind="stable")
    time, speed = time[order], np.abs(speed[order])
    step = np.diff(time, prepend=-np.inf) > 0.0
    time, speed = time[step], speed[step]
    at, truth = _speeds(gnss)
    inside = (at > time[0] + _SEARCH) & (at < time[-1] - _SEARCH)
    at, truth = at[inside], truth[inside]
    moving = truth > _MOVING
    if np.count_nonzero(moving) < _FEWEST:
        if counts:
            raise InputError(
                "counts of a wheel, and no motion in which GNSS tells how far one goes",
                expected="speeds in m/s, or a drive with GNSS",
            )
        return time, speed, ("GNSS sees too little motion to check the odometer",)
    lag = _lag(time, speed, at, truth)
    near = np.interp(at + lag, time, speed)
    alike = float(np.corrcoef(near, truth)[0, 1]) if near.std() > 0.0 else 0.0
    if truth.std() > 0.5 and alike < _CORRELATED:
        raise InputError(
            f"the odometer does not follow the speed of GNSS (correlation {alike:.2f})",
            expected="speed over ground by the clock of the IMU",
            cure="check its column and its time",
        )
    if abs(lag) > _LARGEST_LAG:
        raise InputError(
            f"the odometer is {abs(lag):.1f} s {'behind' if lag > 0 else 'ahead of'} GNSS",
            expected="stamps by the clock of the IMU",
            cure=f"add {-lag:.2f} s to its times",
        )
    going = moving & (near > 0.0)
    factor = float(np.median(near[going] / truth[going])) if going.any() else 0.0
    remarks: list[str] = []
    if counts:
        remarks.append(f"one count of the odometer is {1.0 / factor:.5g} m, by GNSS")
        speed, factor = speed / factor, 1.0
    _require_metres(factor)
    stuck = _stuck(time, speed, at, truth)
    if stuck.any():
        remarks.append(f"the odometer sticks in {int(stuck.sum())} of {stuck.size} samples: unused")
    return time[~stuck], speed[~stuck], tuple(remarks)


def _speeds(gnss: GnssRecording) -> tuple[FloatArray, FloatArray]:
    """Return times and ground speeds, of velocities or else of the positions."""
    if gnss.velocity is not None:
        return gnss.time, np.linalg.norm(gnss.velocity[:, :2], axis=1)
    from schuler.earth import ned_from_geodetic

    place = ned_from_geodetic(gnss.position, gnss.position[0])[:, :2]
    step = np.diff(gnss.time)
    return 0.5 * (gnss.time[1:] + gnss.time[:-1]), (
        np.linalg.norm(np.diff(place, axis=0), axis=1) / step
    )


def _lag(time: FloatArray, speed: FloatArray, at: FloatArray, truth: FloatArray) -> float:
    """Return by how much the odometer is late, by the best correlation."""
    lags = np.arange(-_SEARCH, _SEARCH + 0.01, 0.1)
    if truth.std() < 0.5:
        return 0.0
    alike = []
    for lag in lags:
        near = np.interp(at + lag, time, speed)
        alike.append(np.corrcoef(near, truth)[0, 1] if near.std() > 0.0 else -1.0)
    return float(lags[int(np.argmax(alike))])


def _require_metres(factor: float) -> None:
    for unit, times in _UNITS.items():
        if abs(factor / times - 1.0) < 0.05:
            raise InputError(
                f"the odometer shows {factor:.2f} times the speed of GNSS: it is in {unit}",
                expected="m/s",
                cure=f"say its unit, {unit}",
            )
    if abs(factor - 1.0) > _LARGEST_SCALE:
        raise InputError(
            f"the odometer shows {factor:.3g} times the speed of GNSS",
            expected=f"within {100.0 * _LARGEST_SCALE:.0f} %",
            cure="correct its unit or the circumference of its wheels",
        )


def _stuck(time: FloatArray, speed: FloatArray, at: FloatArray, truth: FloatArray) -> BoolArray:
    """Return which speeds stay the same, to the bit, while GNSS sees them change."""
    stuck = np.zeros(time.size, dtype=bool)
    edges = np.flatnonzero(np.diff(speed) != 0.0)
    starts, stops = np.r_[0, edges + 1], np.r_[edges, time.size - 1]
    for a, b in zip(starts.tolist(), stops.tolist(), strict=True):
        if time[b] - time[a] >= _STUCK:
            seen = truth[(at >= time[a]) & (at <= time[b])]
            stuck[a : b + 1] = seen.size > 1 and np.abs(seen - speed[a]).max() > _CHANGED
    return stuck
