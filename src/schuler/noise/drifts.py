"""Processes that wander or stand: random walk, ramp, turn-on bias, sinusoid."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import ModelError
from schuler.noise._checks import finite, not_negative, positive, positive_array, samples
from schuler.noise.base import Parameter, Process, StateSpace
from schuler.noise.elements import Elements
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True)
class RandomWalk(Process):
    """Integrated white noise: rate random walk of a gyro, its likeness in an accelerometer.

    Parameters
    ----------
    density : float
        K in u/sqrt(s): the variance grows by K² a second.
    initial_sd : float
        Standard deviation at the start, in u.

    Examples
    --------
    >>> from schuler import RandomWalk
    >>> round(float(RandomWalk(2e-5).allan_variance(300.0)) ** 0.5, 6)
    0.0002
    """

    density: float
    initial_sd: float = 0.0
    kind: ClassVar[str] = "random_walk"
    meaning: ClassVar[str] = "bias random walk K"
    label: ClassVar[str] = "random walk"
    about: ClassVar[dict[str, Parameter]] = {
        "density": Parameter("size", "random walk K", "{} random walk"),
        "initial_sd": Parameter("given", "", "{} bias"),
    }
    likelihood: ClassVar[bool] = True
    penalty: ClassVar[float] = 8.0
    rank: ClassVar[float] = 4.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "density", not_negative(self.density, "random walk density"))
        object.__setattr__(self, "initial_sd", not_negative(self.initial_sd, "initial sd"))

    def allan_variance(self, tau: ArrayLike) -> FloatArray:
        """K² tau/3."""
        return np.asarray(self.density**2 * positive_array(tau, "cluster time") / 3.0)

    def sampled_allan_variance(self, clusters: NDArray[np.int64], dt: float) -> FloatArray:
        """K² dt (2 m² + 1)/(6 m): half more than that of averages at one sample."""
        m = np.asarray(clusters, dtype=np.float64)
        return np.asarray(self.density**2 * dt * (2.0 * m * m + 1.0) / (6.0 * m))

    def psd(self, frequency: ArrayLike, *, onesided: bool) -> FloatArray:
        """K²/(2 pi f)² (two-sided)."""
        turn = 2.0 * np.pi * positive_array(frequency, "frequency of a random walk")
        return np.asarray(self.density**2 * (2.0 if onesided else 1.0) / turn**2)

    def sampled_psd(self, cycles: ArrayLike, dt: float) -> FloatArray:
        """K² dt/(2 sin(pi cycles))²."""
        sine = np.sin(np.pi * positive_array(cycles, "frequency of a random walk"))
        return np.asarray(self.density**2 * positive(dt, "dt") / (2.0 * sine) ** 2)

    def autocovariance(self, lag: ArrayLike) -> FloatArray:
        """Refuse: a random walk is not stationary."""
        raise ModelError(
            "a random walk has no autocovariance that depends on the lag alone",
            expected="a stationary process",
            cure="its variance after t seconds is initial_sd**2 + density**2 * t",
        )

    def state_space(self, dt: float) -> StateSpace:
        """One integrating state."""
        variance = self.density**2
        return StateSpace(
            dt=positive(dt, "dt"),
            transition=np.ones((1, 1)),
            noise_covariance=np.array([[variance * dt]]),
            output=np.ones(1),
            initial_covariance=np.array([[self.initial_sd**2]]),
            white_density=0.0,
            drift=np.zeros((1, 1)),
            diffusion=np.array([[variance]]),
            names=("random walk",),
        )

    def simulate(self, n: int, dt: float, rng: np.random.Generator) -> FloatArray:
        """Cumulative sum of steps, from a draw of the initial law."""
        steps = rng.standard_normal(samples(n, dt))
        steps[1:] *= self.density * math.sqrt(dt)
        steps[:1] *= self.initial_sd
        return np.asarray(np.cumsum(steps, out=steps))

    def innovation_variance(self, dt: float) -> float:
        """K² dt."""
        return float(self.density**2 * positive(dt, "dt"))

    def elements(self, dt: float, duration: float = 0.0) -> Elements:
        """Steps of variance K² dt."""
        return Elements(walk=self.density**2 * dt)

    def half_mean_squared_difference(self, steps: FloatArray, dt: float) -> FloatArray:
        """Half of what the walk goes in so many steps."""
        return np.asarray(0.5 * self.density**2 * steps * dt)

    def scaled(self, factor: float) -> Self:
        """The walk and its start, times a factor."""
        return type(self)(abs(factor) * self.density, abs(factor) * self.initial_sd)

    @classmethod
    def combined(cls, members: Sequence[tuple[Self, float]]) -> list[Process]:
        """One walk; where only its start is left, a turn-on bias."""
        parts = [walk.scaled(share) for walk, share in members]
        density = math.hypot(*(p.density for p in parts))
        start = math.hypot(*(p.initial_sd for p in parts))
        if density > 0.0:
            return [cls(density, start)]
        return [TurnOnBias(start)] if start > 0.0 else []


class _Line(Process):
    """A process without innovation: its spectrum has lines only, which `psd` leaves out."""

    __slots__ = ()
    random: ClassVar[bool] = False

    def psd(self, frequency: ArrayLike, *, onesided: bool) -> FloatArray:
        """Zero: all power is in lines, which have no density."""
        return np.zeros(np.shape(frequency))

    def sampled_psd(self, cycles: ArrayLike, dt: float) -> FloatArray:
        """Zero: all power is in lines."""
        return np.zeros(np.shape(cycles))

    def innovation_variance(self, dt: float) -> float:
        """Zero: it can be foreseen from its past."""
        positive(dt, "dt")
        return 0.0


@dataclass(frozen=True, slots=True)
class RateRamp(_Line):
    """A steady drift, as of warming up.

    Parameters
    ----------
    slope : float
        u/s, with its sign; a filter takes |slope| as the standard deviation of an unknown one.

    Examples
    --------
    >>> from schuler import RateRamp
    >>> round(float(RateRamp(1e-6).allan_variance(100.0)) ** 0.5, 6)
    7.1e-05
    """

    slope: float
    kind: ClassVar[str] = "rate_ramp"
    meaning: ClassVar[str] = "steady drift"
    label: ClassVar[str] = "ramp"
    about: ClassVar[dict[str, Parameter]] = {"slope": Parameter("size", "ramp", "{} ramp")}
    penalty: ClassVar[float] = 12.0
    rank: ClassVar[float] = 5.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "slope", finite(self.slope, "ramp slope"))

    def allan_variance(self, tau: ArrayLike) -> FloatArray:
        """slope² tau²/2."""
        return np.asarray(0.5 * (self.slope * positive_array(tau, "cluster time")) ** 2)

    def autocovariance(self, lag: ArrayLike) -> FloatArray:
        """Refuse: a ramp is not stationary."""
        raise ModelError("a ramp has no autocovariance", expected="a stationary process")

    def state_space(self, dt: float) -> StateSpace:
        """Two states: value (zero at the start) and slope."""
        return StateSpace(
            dt=positive(dt, "dt"),
            transition=np.array([[1.0, dt], [0.0, 1.0]]),
            noise_covariance=np.zeros((2, 2)),
            output=np.array([1.0, 0.0]),
            initial_covariance=np.diag([0.0, self.slope**2]),
            white_density=0.0,
            drift=np.array([[0.0, 1.0], [0.0, 0.0]]),
            diffusion=np.zeros((2, 2)),
            names=("ramp", "ramp slope"),
        )

    def half_mean_squared_difference(self, steps: FloatArray, dt: float) -> FloatArray:
        """Half the squared rise."""
        return np.asarray(0.5 * (self.slope * steps * dt) ** 2)

    def simulate(self, n: int, dt: float, rng: np.random.Generator) -> FloatArray:
        """Slope times time since the first sample; nothing is drawn."""
        return np.asarray(np.arange(samples(n, dt)) * (self.slope * dt), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class TurnOnBias(_Line):
    """A constant that is new at every start.

    Parameters
    ----------
    sigma : float
        Standard deviation from run to run, in u.

    Examples
    --------
    >>> from schuler import TurnOnBias
    >>> float(TurnOnBias(0.3).autocovariance(100.0))
    0.09
    """

    sigma: float
    kind: ClassVar[str] = "turn_on_bias"
    meaning: ClassVar[str] = "constant, new at every start"
    label: ClassVar[str] = "turn-on bias"
    about: ClassVar[dict[str, Parameter]] = {"sigma": Parameter("given", "turn-on bias", "{} bias")}
    likelihood: ClassVar[bool] = True
    rank: ClassVar[float] = 7.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "sigma", not_negative(self.sigma, "turn-on bias sigma"))

    def allan_variance(self, tau: ArrayLike) -> FloatArray:
        """Zero: Allan differences do not see a constant."""
        return np.zeros(np.shape(positive_array(tau, "cluster time")))

    def autocovariance(self, lag: ArrayLike) -> FloatArray:
        """sigma² at every lag (over runs)."""
        return np.full(np.shape(lag), self.sigma**2)

    def state_space(self, dt: float) -> StateSpace:
        """One constant state."""
        return StateSpace(
            dt=positive(dt, "dt"),
            transition=np.ones((1, 1)),
            noise_covariance=np.zeros((1, 1)),
            output=np.ones(1),
            initial_covariance=np.array([[self.sigma**2]]),
            white_density=0.0,
            drift=np.zeros((1, 1)),
            diffusion=np.zeros((1, 1)),
            names=("turn-on bias",),
        )

    @classmethod
    def size_name(cls) -> str:
        """It grows with its sigma, though no curve shows that."""
        return "sigma"

    def half_mean_squared_difference(self, steps: FloatArray, dt: float) -> FloatArray:
        """Nothing: it stays."""
        return np.zeros(steps.shape)

    def simulate(self, n: int, dt: float, rng: np.random.Generator) -> FloatArray:
        """One draw, held."""
        return np.full(samples(n, dt), self.sigma * rng.standard_normal())


@dataclass(frozen=True, slots=True)
class Sinusoid(_Line):
    """A periodic error, as of a fan or the day.

    Parameters
    ----------
    amplitude : float
        A in u.
    frequency : float
        Hz, above zero.
    phase : float, optional
        rad at the first sample; None draws it anew for every simulation.

    Examples
    --------
    >>> from schuler import Sinusoid
    >>> round(float(Sinusoid(amplitude=0.01, frequency=2.0).autocovariance(0.5)), 8)
    5e-05
    """

    amplitude: float
    frequency: float
    phase: float | None = None
    kind: ClassVar[str] = "sinusoid"
    meaning: ClassVar[str] = "periodic error"
    about: ClassVar[dict[str, Parameter]] = {
        "amplitude": Parameter("size", "sinusoid amplitude", "{} bias"),
        "frequency": Parameter("given", "sinusoid frequency", "frequency"),
        "phase": Parameter("given", "", "angle"),
    }
    rank: ClassVar[float] = 6.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "amplitude", not_negative(self.amplitude, "amplitude"))
        object.__setattr__(self, "frequency", positive(self.frequency, "frequency"))
        if self.phase is not None:
            object.__setattr__(self, "phase", finite(self.phase, "phase"))

    def allan_variance(self, tau: ArrayLike) -> FloatArray:
        """A² sin⁴(pi f tau)/(pi f tau)²."""
        turn = np.pi * self.frequency * positive_array(tau, "cluster time")
        return np.asarray((self.amplitude * np.sin(turn) ** 2 / turn) ** 2)

    def sampled_allan_variance(self, clusters: NDArray[np.int64], dt: float) -> FloatArray:
        """(A sin²(m w)/(m sin w))², w = pi f dt: a line above half the rate shows as its alias."""
        turn = math.pi * (self.frequency * dt - round(self.frequency * dt))
        m = np.asarray(clusters, dtype=np.float64)
        if turn == 0.0:
            return np.zeros(m.shape)
        return np.asarray((self.amplitude * np.sin(m * turn) ** 2 / (m * math.sin(turn))) ** 2)

    def autocovariance(self, lag: ArrayLike) -> FloatArray:
        """(A²/2) cos(2 pi f lag), over phases."""
        turn = 2.0 * np.pi * self.frequency * np.asarray(lag, dtype=np.float64)
        return np.asarray(0.5 * self.amplitude**2 * np.cos(turn))

    def state_space(self, dt: float) -> StateSpace:
        """Two states that turn: the sinusoid and its quadrature."""
        rate = 2.0 * math.pi * self.frequency
        c, s = math.cos(rate * positive(dt, "dt")), math.sin(rate * dt)
        return StateSpace(
            dt=dt,
            transition=np.array([[c, s], [-s, c]]),
            noise_covariance=np.zeros((2, 2)),
            output=np.array([1.0, 0.0]),
            initial_covariance=0.5 * self.amplitude**2 * np.eye(2),
            white_density=0.0,
            drift=np.array([[0.0, rate], [-rate, 0.0]]),
            diffusion=np.zeros((2, 2)),
            names=("sinusoid", "sinusoid quadrature"),
        )

    def simulate(self, n: int, dt: float, rng: np.random.Generator) -> FloatArray:
        """A sin(2 pi f t + phase), t from the first sample."""
        phase = rng.uniform(0.0, 2.0 * math.pi) if self.phase is None else self.phase
        time = np.arange(samples(n, dt)) * dt
        return np.asarray(self.amplitude * np.sin(2.0 * math.pi * self.frequency * time + phase))
