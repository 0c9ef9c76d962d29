"""GNSS recordings of a known motion: an antenna on a lever arm, noise, latency and outages."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike

from schuler import earth
from schuler.data import GnssRecording
from schuler.errors import InputError
from schuler.keywords import refuse_unknown
from schuler.rotations import dcm_from_euler
from schuler.simulation.motions.profile import Profile
from schuler.types import FloatArray

VERTICAL_FACTOR = 1.5
"""Vertical standard deviation over horizontal, where one number is given."""


class ReceiverOptions(TypedDict, total=False):
    """Keywords of all simulated receivers; explained at `simulate_gnss`."""

    lever_arm: ArrayLike
    start: float | None
    latency: float
    velocity_latency: float | None
    claimed_scale: float
    outages: Sequence[tuple[float, float]]
    outlier_rate: float
    outlier_size: float
    name: str


@dataclass(frozen=True, slots=True, eq=False)
class _Receiver:
    """How a receiver sees a motion, besides its noise; the values of `ReceiverOptions`."""

    lever_arm: ArrayLike = (0.0, 0.0, 0.0)
    start: float | None = None
    latency: float = 0.0
    velocity_latency: float | None = None
    claimed_scale: float = 1.0
    outages: Sequence[tuple[float, float]] = ()
    outlier_rate: float = 0.0
    outlier_size: float = 50.0
    name: str = "simulated"

    @property
    def late(self) -> float:
        """Seconds by which velocities are late."""
        return self.latency if self.velocity_latency is None else self.velocity_latency

    def epochs(self, profile: Profile, rate: float) -> FloatArray:
        """Stamps of all epochs, those of the outages too, s."""
        if not 0.0 < rate <= 1e4 or not self.claimed_scale > 0.0:
            raise InputError(
                f"a rate of {rate:g} Hz and a scale of {self.claimed_scale:g}",
                expected="positive numbers",
            )
        first = self.start
        if first is None:
            first = profile.start + max(self.latency, self.late, 0.0)
        last = profile.stop + min(self.latency, self.late, 0.0)
        count = int(np.floor((last - first) * rate + 1e-9)) + 1
        if count < 1:
            raise InputError("no GNSS epoch within the profile", expected="a start before its end")
        return np.asarray(first + np.arange(count) / rate)

    def received(self, recording: GnssRecording) -> GnssRecording:
        """Return the recording without the epochs of the outages."""
        time = recording.time
        missing = np.zeros(time.size, dtype=bool)
        for begin, seconds in self.outages:
            missing |= (time >= begin) & (time < begin + seconds)
        return recording.select(~missing) if missing.any() else recording


def antenna_motion(
    profile: Profile, time: ArrayLike, lever_arm: ArrayLike
) -> tuple[FloatArray, FloatArray]:
    """Return the true position and velocity of an antenna."""
    motion = profile.motion(time)
    c_nb = dcm_from_euler(*motion.euler.T)
    lever = np.asarray(lever_arm, dtype=np.float64)
    w_ib, _ = profile.rates(time)
    w_ie = earth.earth_rate_ned(motion.position[:, 0])
    w_eb = w_ib - np.einsum("nji,nj->ni", c_nb, w_ie)
    position = earth.geodetic_from_ned(c_nb @ lever, motion.position)
    # The inverse tangent wraps longitudes; keep those of the profile.
    turn = 2.0 * np.pi
    position[:, 1] += turn * np.round((motion.position[:, 1] - position[:, 1]) / turn)
    velocity = motion.velocity + np.einsum("nij,nj->ni", c_nb, np.cross(w_eb, lever))
    return position, velocity


def simulate_gnss(
    profile: Profile,
    rate: float = 1.0,
    *,
    position_sd: ArrayLike,
    velocity_sd: ArrayLike | None,
    rng: np.random.Generator,
    correlation_time: float | None = None,
    correlated_sd: ArrayLike | None = None,
    **options: Unpack[ReceiverOptions],
) -> GnssRecording:
    """Return what a GNSS receiver records on a known motion.

    Parameters
    ----------
    profile : Profile
        True motion of the IMU.
    rate : float
        Epochs a second.
    position_sd : float or (3,) array_like
        Standard deviation of the position noise in m: horizontal (the vertical is 1.5 times it),
        or north, east, down.
    velocity_sd : float or (3,) array_like or None
        Likewise of the velocity, m/s; None: no velocity is recorded.
    rng : numpy.random.Generator
        Every component draws from its own child of it.
    correlation_time : float, optional
        Seconds: position noise becomes a Gauss-Markov process of the same standard deviation.
        White if not given. The velocity noise is white.
    correlated_sd : float or (3,) array_like, optional
        Like `position_sd`, of a part with the correlation time beside a white part of
        `position_sd`.
    lever_arm : (3,) array_like, default (0, 0, 0)
        From the IMU to the antenna in the body, m.
    start : float or None, default None
        Stamp of the first epoch, s; the start of the profile, after the longest latency, if not
        given.
    latency : float, default 0
        Seconds by which positions are late: the one stamped t belongs to t - latency.
    velocity_latency : float or None, default None
        Likewise of velocities; that of the positions if not given.
    claimed_scale : float, default 1
        The receiver reports this times the true standard deviations (of both parts together).
    outages : sequence of (start, seconds), default ()
        Epochs with start <= time < start + seconds are missing.
    outlier_rate : float, default 0
        Share of the epochs whose position is far off.
    outlier_size : float, default 50
        How far, m, in a direction drawn at random in space. The receiver does not notice.
    name : str, default "simulated"
        Name of the recording.

    Returns
    -------
    GnssRecording
        Position and velocity of the antenna. Source: spec 1.3.

    Raises
    ------
    InputError
        Rate, standard deviations, correlation time or scale not positive, a share of outliers
        that is none, a correlated part without a time, or no epoch is left.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import motorcycle, simulate_gnss
    >>> ride, rng = motorcycle(120.0), np.random.default_rng(1)
    >>> simulate_gnss(ride, 1.0, position_sd=0.5, velocity_sd=0.05, rng=rng).size
    121
    """
    refuse_unknown(simulate_gnss, options, ReceiverOptions)
    receiver = _Receiver(**options)
    time = receiver.epochs(profile, rate)
    count = time.size
    sd = _deviations(position_sd, "position")
    children = rng.spawn(6)
    position, _ = antenna_motion(profile, time - receiver.latency, receiver.lever_arm)
    whole = correlation_time if correlated_sd is None else None
    noise = sd * _unit_noises(count, 1.0 / rate, whole, children[:3])
    if correlated_sd is not None:
        if correlation_time is None:
            raise InputError("a correlated part of the noise", expected="a correlation time for it")
        slow_sd = _deviations(correlated_sd, "correlated position")
        noise += slow_sd * _unit_noises(count, 1.0 / rate, correlation_time, rng.spawn(3))
        sd = np.hypot(sd, slow_sd)
    if receiver.outlier_rate != 0.0:
        noise += _outliers(count, receiver.outlier_rate, receiver.outlier_size, rng.spawn(1)[0])
    north, east = earth.metres_per_radian(position)
    position = position + noise / np.stack([north, east, -np.ones(count)], axis=-1)
    velocity = speed_sd = None
    if velocity_sd is not None:
        speed_sd = _deviations(velocity_sd, "velocity")
        _, velocity = antenna_motion(profile, time - receiver.late, receiver.lever_arm)
        velocity = velocity + speed_sd * np.stack(
            [child.standard_normal(count) for child in children[3:]], axis=-1
        )
    scale = receiver.claimed_scale
    recording = GnssRecording(
        time,
        position,
        np.tile(scale * sd, (count, 1)),
        velocity,
        None if speed_sd is None else np.tile(scale * speed_sd, (count, 1)),
        name=receiver.name,
        history=(f"simulated at {rate:g} Hz",),
    )
    return receiver.received(recording)


def _deviations(values: ArrayLike, what: str) -> FloatArray:
    sd = np.asarray(values, dtype=np.float64)
    if sd.ndim == 0:
        sd = sd * np.array([1.0, 1.0, VERTICAL_FACTOR])
    if sd.shape != (3,) or not np.all(sd > 0.0):
        raise InputError(
            f"GNSS {what} standard deviation {sd}",
            expected="one positive number, or three: north, east, down",
        )
    return sd


def _outliers(count: int, share: float, size: float, rng: np.random.Generator) -> FloatArray:
    """Displacements north, east, down, most of them zero."""
    if not (0.0 <= share <= 1.0 and size > 0.0):
        raise InputError(
            f"a share of {share:g} of outliers of {size:g} m",
            expected="a share between 0 and 1 and a positive size",
        )
    chosen = rng.random(count) < share
    direction = rng.standard_normal((count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    return np.asarray(chosen[:, None] * size * direction)


def _unit_noises(
    count: int,
    dt: float,
    correlation_time: float | None,
    children: Sequence[np.random.Generator],
) -> FloatArray:
    return np.stack([_unit_noise(count, dt, correlation_time, c) for c in children], axis=-1)


def _unit_noise(
    count: int, dt: float, correlation_time: float | None, rng: np.random.Generator
) -> FloatArray:
    """White or stationary Gauss-Markov noise of variance one."""
    white = rng.standard_normal(count)
    if correlation_time is None:
        return white
    if not correlation_time > 0.0:
        raise InputError(
            f"a correlation time of {correlation_time:g} s", expected="a positive time"
        )
    from scipy.signal import lfilter

    phi = np.exp(-dt / correlation_time)
    white[1:] *= np.sqrt(-np.expm1(-2.0 * dt / correlation_time))
    return np.asarray(lfilter([1.0], [1.0, -phi], white))
