"""Inertial recordings of a known motion: error-free, and as a real sensor would deliver them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, TypedDict, Unpack

import numpy as np
from numpy.typing import ArrayLike

from schuler.data import CHANNELS, ImuRecording
from schuler.errors import InputError
from schuler.keywords import refuse_unknown
from schuler.simulation.effects import ManoeuvreNoise, TemperatureDrift
from schuler.simulation.motions.profile import Profile, static
from schuler.types import FloatArray

if TYPE_CHECKING:
    from schuler.noise.noise_model import NoiseModel


NODES = 4
"""Gauss-Legendre nodes in each sampling interval."""
CHUNK = 4096
"""Sampling intervals worked on at a time."""


@dataclass(frozen=True, slots=True, eq=False)
class TriadErrors:
    """What is wrong with three sensors besides their noise.

    Measured = (I + matrix) truth + bias + noise, then limited to +-saturation, then rounded.
    """

    bias: ArrayLike = (0.0, 0.0, 0.0)  # (3,): constant bias, rad/s or m/s²
    # (3, 3): scale factor errors on the diagonal, misalignment beside it
    matrix: ArrayLike = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    saturation: float = float("inf")  # largest magnitude the sensor delivers, rad/s or m/s²
    # step to whose multiples values are rounded, rad/s or m/s²; zero: not rounded.
    quantization_step: float = 0.0

    def __post_init__(self) -> None:
        if np.shape(self.bias) != (3,) or np.shape(self.matrix) != (3, 3):
            raise InputError(
                f"bias of shape {np.shape(self.bias)}, matrix of shape {np.shape(self.matrix)}",
                expected="(3,) and (3, 3)",
            )
        if not (self.saturation > 0.0 and self.quantization_step >= 0.0):
            raise InputError(
                f"saturation {self.saturation:g}, quantization step {self.quantization_step:g}",
                expected="a positive saturation and a step of zero or more",
            )


def ideal_imu(profile: Profile, rate: float, *, name: str = "ideal") -> ImuRecording:
    """Return what an IMU without errors records on a known motion.

    Parameters
    ----------
    profile : Profile
        True motion.
    rate : float
        Samples a second, Hz.

    Returns
    -------
    ImuRecording
        Mean rates and specific forces over every interval, rad/s and m/s².

    Raises
    ------
    InputError
        A rate that is not positive.

    Examples
    --------
    >>> import schuler
    >>> round(schuler.ideal_imu(schuler.motorcycle(120.0), 50.0).rate, 6)
    50.0
    """
    n = _count(profile.duration, rate)
    node, weight = np.polynomial.legendre.leggauss(NODES)
    gyro, accel = np.empty((n, 3)), np.empty((n, 3))
    for first in range(0, n, CHUNK):
        k = np.arange(first, min(first + CHUNK, n))
        instants = profile.start + (k[:, None] + 0.5 * (1.0 + node)) / rate
        for mean, values in zip((gyro, accel), profile.rates(instants.ravel()), strict=True):
            mean[k] = 0.5 * (weight @ values.reshape(k.size, NODES, 3))
    time = profile.start + np.arange(1, n + 1) / rate
    history = (f"simulated without errors at {rate:g} Hz",)
    return ImuRecording(time, gyro, accel, name=name, history=history)


_FASTEST = 1e6
"""No inertial sensor delivers more samples a second."""


def _count(duration: float, rate: float) -> int:
    if not 0.0 < rate <= _FASTEST:
        raise InputError(
            f"a rate of {rate:g} Hz", expected=f"a positive rate up to {_FASTEST:g} Hz"
        )
    n = int(np.floor(duration * rate * (1.0 + 1e-12) + 1e-9))
    if n < 2:
        raise InputError(
            f"{duration:g} s at {rate:g} Hz", expected="at least two samples", cure="last longer"
        )
    return n


def simulate_imu(
    ideal: ImuRecording,
    noise_model: NoiseModel | None,
    rng: np.random.Generator,
    *,
    gyro_errors: TriadErrors | None = None,
    accel_errors: TriadErrors | None = None,
    g_sensitivity: ArrayLike | None = None,
    temperature_drift: TemperatureDrift | None = None,
    manoeuvre_noise: ManoeuvreNoise | None = None,
    name: str = "simulated",
) -> ImuRecording:
    """Return an error-free recording with the errors of a sensor added.

    What the body does besides its profile (`add_vibration`, `add_size_effect`) is added before;
    what the device does with its samples (`box_car`, `restamp`) comes after.

    Parameters
    ----------
    ideal : ImuRecording
        From `ideal_imu`, evenly sampled.
    noise_model : NoiseModel or None
        The stochastic errors of each axis; None: none. A model without a process for some
        channel leaves it free of noise.
    rng : numpy.random.Generator
        Every channel draws from its own child of it, in the order of `CHANNELS`: a channel
        keeps its noise when the process of another changes.
    gyro_errors, accel_errors : TriadErrors, optional
        Bias, scale factor, misalignment, saturation and rounding.
    g_sensitivity : (3, 3) array_like, optional
        What the gyros show of the true specific force, rad/s per m/s²; row: gyro, column: force.
    temperature_drift : TemperatureDrift, optional
        Needs a recording with temperatures (`dataclasses.replace(ideal, temperature=...)`).
    manoeuvre_noise : ManoeuvreNoise, optional
        White noise that follows the true motion.
    name : str
        Name of the recording.

    Returns
    -------
    ImuRecording
        At the same times. Source: spec 0 (measurement = truth + bias + noise) and 1.1.

    Raises
    ------
    InputError
        The recording is not evenly sampled, or there are no temperatures to follow.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import NoiseModel, WhiteNoise, simulate_imu, simulate_static
    >>> ideal = simulate_static(None, 10.0, 100.0, np.random.default_rng(1))
    >>> model = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
    >>> simulate_imu(ideal, model, np.random.default_rng(2)).size
    1000
    """
    dt = _even_step(ideal)
    added_gyro, added_accel = np.zeros((ideal.size, 3)), np.zeros((ideal.size, 3))
    children = rng.spawn(len(CHANNELS))
    for k, channel in enumerate(CHANNELS):
        if noise_model is not None and channel in noise_model.processes:
            noise = noise_model.process(channel).simulate(ideal.size, dt, children[k])
            (added_gyro if k < 3 else added_accel)[:, k % 3] += noise
    if g_sensitivity is not None:
        added_gyro += ideal.accel @ _square(g_sensitivity).T
    if temperature_drift is not None:
        drifts = temperature_drift.biases(_temperature(ideal))
        added_gyro, added_accel = added_gyro + drifts[0], added_accel + drifts[1]
    if manoeuvre_noise is not None:
        extra = manoeuvre_noise.draw(ideal, dt, rng.spawn(1)[0])
        added_gyro, added_accel = added_gyro + extra[0], added_accel + extra[1]
    return replace(
        ideal,
        gyro=_measured(ideal.gyro, added_gyro, gyro_errors or TriadErrors()),
        accel=_measured(ideal.accel, added_accel, accel_errors or TriadErrors()),
        name=name,
        history=(*ideal.history, "sensor errors added"),
    )


def _even_step(ideal: ImuRecording) -> float:
    steps = np.diff(ideal.time)
    dt = ideal.duration / (ideal.size - 1)
    if np.abs(steps - dt).max() > 1e-3 * dt:
        raise InputError(
            f"steps between {steps.min():.6g} and {steps.max():.6g} s",
            expected="an evenly sampled recording to add noise to",
        )
    return dt


def _square(matrix: ArrayLike) -> FloatArray:
    values = np.asarray(matrix, dtype=np.float64)
    if values.shape != (3, 3):
        raise InputError(f"g-sensitivity of shape {values.shape}", expected="(3, 3)")
    return values


def _temperature(ideal: ImuRecording) -> FloatArray:
    if ideal.temperature is None:
        raise InputError(
            f"recording '{ideal.name}' has no temperature for the drift to follow",
            expected="one for each sample",
            cure="set it with dataclasses.replace(recording, temperature=warm_up(recording.time))",
        )
    return ideal.temperature


def _measured(truth: FloatArray, added: FloatArray, errors: TriadErrors) -> FloatArray:
    matrix = np.asarray(errors.matrix, dtype=np.float64)
    bias = np.asarray(errors.bias, dtype=np.float64)
    turned = truth + truth @ matrix.T if matrix.any() else truth
    return _digitize(turned + bias + added, errors)


def _digitize(values: FloatArray, errors: TriadErrors) -> FloatArray:
    limited = values
    if np.isfinite(errors.saturation):
        limited = np.clip(values, -errors.saturation, errors.saturation)
    if errors.quantization_step > 0.0:
        limited = errors.quantization_step * np.round(limited / errors.quantization_step)
    return np.asarray(limited)


class SensorErrors(TypedDict, total=False):
    """Keywords of `simulate_imu` that make sense at rest."""

    gyro_errors: TriadErrors | None
    accel_errors: TriadErrors | None
    g_sensitivity: ArrayLike | None
    name: str


def simulate_static(
    noise_model: NoiseModel | None,
    duration: float,
    rate: float,
    rng: np.random.Generator,
    *,
    position: ArrayLike = (np.pi / 4, 0.13, 250.0),
    attitude: tuple[float, float, float] = (0.0, 0.0, 0.0),
    **errors: Unpack[SensorErrors],
) -> ImuRecording:
    """Return the recording of a sensor that lies still.

    Parameters
    ----------
    noise_model : NoiseModel or None
        As in `simulate_imu`.
    duration : float
        Seconds.
    rate : float
        Samples a second.
    rng : numpy.random.Generator
        As in `simulate_imu`.
    position : (3,) array_like
        Latitude rad, longitude rad, height m.
    attitude : tuple of float
        Roll, pitch, yaw, rad.
    **errors
        gyro_errors, accel_errors, g_sensitivity and name, as for `simulate_imu`.

    Returns
    -------
    ImuRecording
        Earth rate and the reaction to gravity, with the errors of the sensor.

    Raises
    ------
    InputError
        The rate is not positive, or there are fewer than two samples.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import simulate_static
    >>> imu = simulate_static(None, 10.0, 100.0, np.random.default_rng(1))
    >>> imu.accel.mean(axis=0).round(2)
    array([ 0.  ,  0.  , -9.81])
    """
    refuse_unknown(simulate_static, errors, SensorErrors)
    n = _count(duration, rate)
    roll, pitch, yaw = attitude
    still = static(duration, position=position, roll=roll, pitch=pitch, yaw=yaw)
    angular_rate, force = still.rates(0.5 * duration)
    ideal = ImuRecording(
        np.arange(1, n + 1) / rate,
        np.broadcast_to(angular_rate, (n, 3)),
        np.broadcast_to(force, (n, 3)),
        history=(f"simulated at rest at {rate:g} Hz",),
    )
    return simulate_imu(ideal, noise_model, rng, **({"name": "static"} | errors))
