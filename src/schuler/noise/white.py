"""Processes without memory: white noise, and the quantisation of increments."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import ModelError
from schuler.noise._checks import not_negative, positive, positive_array, samples
from schuler.noise.base import Parameter, Process, StateSpace
from schuler.noise.elements import Elements
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True)
class WhiteNoise(Process):
    """White noise: angle random walk of a gyro, velocity random walk of an accelerometer.

    Parameters
    ----------
    density : float
        N in u/sqrt(Hz): (rad/s)/sqrt(Hz) or (m/s²)/sqrt(Hz). A sample has variance N²/dt.

    Examples
    --------
    >>> from schuler import WhiteNoise
    >>> float(WhiteNoise(7.5e-4).allan_variance(1.0)) ** 0.5
    0.00075
    """

    density: float
    kind: ClassVar[str] = "white_noise"
    meaning: ClassVar[str] = "noise density N: angle or velocity random walk"
    label: ClassVar[str] = "white noise"
    about: ClassVar[dict[str, Parameter]] = {
        "density": Parameter("size", "white noise N", "{} white noise")
    }
    likelihood: ClassVar[bool] = True
    penalty: ClassVar[float] = 4.0
    rank: ClassVar[float] = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "density", not_negative(self.density, "white noise density"))

    def allan_variance(self, tau: ArrayLike) -> FloatArray:
        """N²/tau."""
        return np.asarray(self.density**2 / positive_array(tau, "cluster time"))

    def psd(self, frequency: ArrayLike, *, onesided: bool) -> FloatArray:
        """N² (two-sided)."""
        level = self.density**2 * (2.0 if onesided else 1.0)
        return np.full(np.shape(frequency), level)

    def sampled_psd(self, cycles: ArrayLike, dt: float) -> FloatArray:
        """N²/dt at every frequency."""
        return np.full(np.shape(cycles), self.density**2 / positive(dt, "dt"))

    def autocovariance(self, lag: ArrayLike) -> FloatArray:
        """Refuse: in continuous time the variance is infinite."""
        raise ModelError(
            "white noise has no autocovariance in continuous time",
            expected="a process of finite variance",
            cure="its samples are independent with variance density**2/dt",
        )

    def state_space(self, dt: float) -> StateSpace:
        """No state: white output only."""
        positive(dt, "dt")
        none, empty = np.zeros((0, 0)), np.zeros(0)
        return StateSpace(dt, none, none, empty, none, self.density, none, none, ())

    def elements(self, dt: float, duration: float = 0.0) -> Elements:
        """All of it is white."""
        return Elements(white=self.density**2 / dt)

    def half_mean_squared_difference(self, steps: FloatArray, dt: float) -> FloatArray:
        """The variance of a sample, from one step on."""
        return np.where(steps > 0.0, self.density**2 / dt, 0.0)

    def simulate(self, n: int, dt: float, rng: np.random.Generator) -> FloatArray:
        """N/sqrt(dt) times standard normal numbers."""
        return np.asarray(rng.standard_normal(samples(n, dt)) * (self.density / np.sqrt(dt)))


@dataclass(frozen=True, slots=True)
class Quantization(Process):
    """White noise on the integral of the signal, as the rounding of increments leaves it.

    The sample is (q_k - q_{k-1})/dt with white q of standard deviation Q. (The rounding of
    *values* with a step s adds white noise of variance s²/12 instead.)

    Parameters
    ----------
    step_density : float
        Q in u·s: rad or m/s. Increments rounded to a step have Q = step/sqrt(12).
    interval : float, optional
        Sample interval in s; the spectrum depends on it. Only `psd` and `autocovariance` need it.

    Examples
    --------
    >>> from schuler import Quantization
    >>> round(float(Quantization(1e-6).allan_variance(0.1)) ** 0.5, 8)
    1.732e-05
    """

    step_density: float
    interval: float | None = None
    kind: ClassVar[str] = "quantization"
    meaning: ClassVar[str] = "rounding of increments, Q"
    label: ClassVar[str] = "quantisation"
    about: ClassVar[dict[str, Parameter]] = {
        "step_density": Parameter("size", "quantisation Q", "{} quantization"),
        "interval": Parameter("given", "", "time"),
    }
    penalty: ClassVar[float] = 10.0
    rank: ClassVar[float] = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "step_density", not_negative(self.step_density, "quantisation Q"))
        if self.interval is not None:
            object.__setattr__(self, "interval", positive(self.interval, "interval"))

    def _interval(self) -> float:
        if self.interval is None:
            raise ModelError(
                "the spectrum of quantisation depends on the sample interval",
                cure="give Quantization(step_density, interval=dt)",
            )
        return self.interval

    def allan_variance(self, tau: ArrayLike) -> FloatArray:
        """3 Q²/tau²."""
        return np.asarray(3.0 * self.step_density**2 / positive_array(tau, "cluster time") ** 2)

    def psd(self, frequency: ArrayLike, *, onesided: bool) -> FloatArray:
        """(4 Q²/dt) sin²(pi f dt) (two-sided)."""
        dt = self._interval()
        cycles = np.asarray(frequency, dtype=np.float64) * dt
        return self.sampled_psd(cycles, dt) * dt * (2.0 if onesided else 1.0)

    def sampled_psd(self, cycles: ArrayLike, dt: float) -> FloatArray:
        """(4 Q²/dt²) sin²(pi cycles)."""
        sine = np.sin(np.pi * np.asarray(cycles, dtype=np.float64))
        return np.asarray((2.0 * self.step_density / positive(dt, "dt") * sine) ** 2)

    def autocovariance(self, lag: ArrayLike) -> FloatArray:
        """2 Q²/dt² at lag 0, -Q²/dt² at one interval, nothing beyond."""
        dt = self._interval()
        steps = np.abs(np.asarray(lag, dtype=np.float64)) / dt
        shape = np.where(steps < 0.5, 2.0, np.where(np.abs(steps - 1.0) < 0.5, -1.0, 0.0))
        return np.asarray(shape * (self.step_density / dt) ** 2)

    def state_space(self, dt: float) -> StateSpace:
        """Two states, this q and the one before; exists in discrete time only."""
        positive(dt, "dt")
        variance = self.step_density**2
        return StateSpace(
            dt=dt,
            transition=np.array([[0.0, 0.0], [1.0, 0.0]]),
            noise_covariance=np.diag([variance, 0.0]),
            output=np.array([1.0, -1.0]) / dt,
            initial_covariance=np.diag([variance, variance]),
            white_density=0.0,
            drift=None,
            diffusion=None,
            names=("quantisation", "quantisation before"),
        )

    def elements(self, dt: float, duration: float = 0.0) -> Elements:
        """White noise of the running sum."""
        return Elements(quantization=self.step_density**2 / dt**2)

    def half_mean_squared_difference(self, steps: FloatArray, dt: float) -> FloatArray:
        """Samples are differences of neighbouring errors of the increments, over dt."""
        power = (self.step_density / dt) ** 2
        return np.where(steps == 0.0, 0.0, np.where(steps == 1.0, 3.0, 2.0)) * power

    def simulate(self, n: int, dt: float, rng: np.random.Generator) -> FloatArray:
        """Differences of white noise."""
        q = rng.standard_normal(samples(n, dt) + 1) * (self.step_density / dt)
        return np.diff(q)

    def innovation_variance(self, dt: float) -> float:
        """Q²/dt²: the newest q cannot be foreseen, the one before is known."""
        return float((self.step_density / positive(dt, "dt")) ** 2)
