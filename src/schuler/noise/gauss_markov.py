"""First-order Gauss-Markov noise, and bias instability as a sum of it."""

from __future__ import annotations

import math
import warnings
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import ModelError
from schuler.noise._checks import not_negative, positive, positive_array, samples
from schuler.noise.base import Parameter, Process, StateSpace, stack_state_spaces
from schuler.noise.elements import Elements
from schuler.noise.white import WhiteNoise
from schuler.types import FloatArray

ALLAN_PEAK_POSITION = 1.8926178
"""tau/Tc at which the Allan deviation of Gauss-Markov noise is highest (spec 2.3)."""
ALLAN_PEAK_HEIGHT = 0.6173643
"""Height of that peak in units of sigma."""
FLICKER_LEVEL = math.sqrt(2.0 * math.log(2.0) / math.pi)
"""Allan deviation of flicker noise of level B, in units of B: 0.66428."""


def gauss_markov_allan_shape(x: ArrayLike) -> FloatArray:
    """Allan variance of unit Gauss-Markov noise at x = tau/Tc.

    (2/x) [1 - (3 - 4 exp(-x) + exp(-2x))/(2x)], by its series below x = 0.1 where the bracket
    cancels (spec 2.3).
    """
    from schuler.kernels.noise.gauss_markov import averaged_shape

    ratio = np.asarray(x, dtype=np.float64)
    return averaged_shape(ratio.ravel()).reshape(ratio.shape)


@dataclass(frozen=True, slots=True)
class GaussMarkov(Process):
    """First-order Gauss-Markov noise: exponentially correlated.

    Parameters
    ----------
    sigma : float
        Stationary standard deviation in u.
    correlation_time : float
        Tc in s: R(lag) = sigma² exp(-|lag|/Tc).

    Examples
    --------
    >>> from schuler import GaussMarkov, WhiteNoise
    >>> error = WhiteNoise(7.5e-4) + GaussMarkov(sigma=1.4e-3, correlation_time=4.6)
    >>> round(float(error.allan_variance(10.0)) ** 0.5, 6)
    0.000894
    """

    sigma: float
    correlation_time: float
    kind: ClassVar[str] = "gauss_markov"
    meaning: ClassVar[str] = "exponentially correlated bias"
    label: ClassVar[str] = "Gauss-Markov"
    about: ClassVar[dict[str, Parameter]] = {
        "sigma": Parameter("size", "Gauss-Markov sigma", "{} bias"),
        "correlation_time": Parameter("time", "Gauss-Markov T", "correlation time"),
    }
    likelihood: ClassVar[bool] = True
    penalty: ClassVar[float] = 16.0
    rank: ClassVar[float] = 2.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "sigma", not_negative(self.sigma, "Gauss-Markov sigma"))
        time = positive(self.correlation_time, "correlation time")
        object.__setattr__(self, "correlation_time", time)

    @classmethod
    def through_plateau(cls, level: float, centre: float) -> GaussMarkov:
        """Put one Gauss-Markov peak through a flat part of an Allan curve.

        Parameters
        ----------
        level : float
            Bias instability B in u, the flat part divided by 0.66428.
        centre : float
            Cluster time of the middle of the flat part in s.

        Returns
        -------
        GaussMarkov
            sigma = 1.076 B, Tc = centre/1.8926 (spec 2.4 c).
        """
        return cls(FLICKER_LEVEL * level / ALLAN_PEAK_HEIGHT, centre / ALLAN_PEAK_POSITION)

    def allan_variance(self, tau: ArrayLike) -> FloatArray:
        """Closed form of spec 2.3, without cancellation at short tau."""
        ratio = positive_array(tau, "cluster time") / self.correlation_time
        return np.asarray(self.sigma**2 * gauss_markov_allan_shape(ratio))

    def sampled_allan_variance(self, clusters: NDArray[np.int64], dt: float) -> FloatArray:
        """Closed form of the samples; sigma² (1 - exp(-dt/Tc)) in clusters of one."""
        from schuler.kernels.noise.gauss_markov import sampled_shape

        m = np.asarray(clusters, dtype=np.float64)
        return self.sigma**2 * sampled_shape(m.ravel(), dt / self.correlation_time).reshape(m.shape)

    def psd(self, frequency: ArrayLike, *, onesided: bool) -> FloatArray:
        """2 sigma² Tc/(1 + (2 pi f Tc)²) (two-sided)."""
        turn = 2.0 * np.pi * np.asarray(frequency, dtype=np.float64) * self.correlation_time
        level = 2.0 * self.sigma**2 * self.correlation_time * (2.0 if onesided else 1.0)
        return np.asarray(level / (1.0 + turn**2))

    def sampled_psd(self, cycles: ArrayLike, dt: float) -> FloatArray:
        """Spectrum of the AR(1) that the samples are."""
        step = positive(dt, "dt") / self.correlation_time
        loss, phi = -math.expm1(-step), math.exp(-step)
        sine = np.sin(np.pi * np.asarray(cycles, dtype=np.float64))
        drive = -(self.sigma**2) * math.expm1(-2.0 * step)
        return np.asarray(drive / (loss**2 + 4.0 * phi * sine**2))

    def autocovariance(self, lag: ArrayLike) -> FloatArray:
        """sigma² exp(-|lag|/Tc)."""
        ratio = np.abs(np.asarray(lag, dtype=np.float64)) / self.correlation_time
        return np.asarray(self.sigma**2 * np.exp(-ratio))

    def state_space(self, dt: float) -> StateSpace:
        """One decaying state, stationary at the start."""
        step = positive(dt, "dt") / self.correlation_time
        variance = self.sigma**2
        return StateSpace(
            dt=dt,
            transition=np.array([[math.exp(-step)]]),
            noise_covariance=np.array([[-variance * math.expm1(-2.0 * step)]]),
            output=np.ones(1),
            initial_covariance=np.array([[variance]]),
            white_density=0.0,
            drift=np.array([[-1.0 / self.correlation_time]]),
            diffusion=np.array([[2.0 * variance / self.correlation_time]]),
            names=("Gauss-Markov",),
        )

    def simulate(self, n: int, dt: float, rng: np.random.Generator) -> FloatArray:
        """AR(1) recursion whose first sample has the stationary law (spec 1.1)."""
        from scipy.signal import lfilter

        n = samples(n, dt)
        if n == 0 or self.sigma == 0.0:
            return np.zeros(n)
        if self.correlation_time <= dt:
            warnings.warn(
                f"Gauss-Markov noise with Tc {self.correlation_time:g} s cannot be told from "
                f"white noise in samples {dt:g} s apart",
                stacklevel=2,
            )
        step = dt / self.correlation_time
        drive = rng.standard_normal(n)
        drive[0] *= self.sigma
        drive[1:] *= self.sigma * math.sqrt(-math.expm1(-2.0 * step))
        return np.asarray(lfilter([1.0], [1.0, -math.exp(-step)], drive))

    def innovation_variance(self, dt: float) -> float:
        """sigma² (1 - exp(-2 dt/Tc))."""
        return -(self.sigma**2) * math.expm1(-2.0 * positive(dt, "dt") / self.correlation_time)

    def elements(self, dt: float, duration: float = 0.0) -> Elements:
        """Itself."""
        if self.sigma == 0.0:
            return Elements()
        return Elements(gauss_markovs=((self.sigma**2, self.correlation_time),))


@dataclass(frozen=True, slots=True)
class BiasInstability(Process):
    """Flicker noise between two time constants, as a sum of Gauss-Markov noises.

    Between `shortest` and `longest` the Allan deviation is 0.66428 B within 2 % (one a decade)
    or 0.4 % (two a decade), away from the ends. Spec 1.1 and 2.4 (d).

    Parameters
    ----------
    level : float
        B in u: the flat part of the Allan deviation is 0.66428 B.
    shortest, longest : float
        Correlation times in s of the first and the last Gauss-Markov noise.
    per_decade : int
        Gauss-Markov noises a decade.

    Examples
    --------
    >>> from schuler import BiasInstability
    >>> flicker = BiasInstability(level=2e-5, shortest=1.0, longest=1e4)
    >>> round(float(flicker.allan_variance(100.0)) ** 0.5 / 2e-5, 2)
    0.66
    """

    level: float
    shortest: float
    longest: float
    per_decade: int = 1
    kind: ClassVar[str] = "bias_instability"
    meaning: ClassVar[str] = "flicker B, as a sum of Gauss-Markov noises"
    label: ClassVar[str] = "bias instability"
    about: ClassVar[dict[str, Parameter]] = {
        "level": Parameter("size", "bias instability B", "{} bias instability"),
        "shortest": Parameter("given", "", "correlation time"),
        "longest": Parameter("given", "", "correlation time"),
        "per_decade": Parameter("given"),
    }
    likelihood: ClassVar[bool] = True
    penalty: ClassVar[float] = 8.0
    rank: ClassVar[float] = 3.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "level", not_negative(self.level, "bias instability B"))
        object.__setattr__(self, "shortest", positive(self.shortest, "shortest time"))
        object.__setattr__(self, "longest", positive(self.longest, "longest time"))
        if self.longest < self.shortest:
            raise ModelError(
                f"longest time {self.longest:g} s is below the shortest {self.shortest:g} s"
            )
        if self.per_decade < 1 or int(self.per_decade) != self.per_decade:
            raise ModelError(f"per_decade is {self.per_decade}", expected="1, 2, ...")
        object.__setattr__(self, "per_decade", int(self.per_decade))

    @classmethod
    def of_samples(cls, level: float, dt: float, duration: float) -> BiasInstability:
        """Flicker of a record: within 1.2 % of exact flicker of samples in any clusters.

        Two Gauss-Markov noises a decade, from 0.43 sample intervals to ten record lengths.
        """
        return cls(level, 0.43 * dt, 10.0 * duration, 2)

    def coarser(self, fastest: float) -> tuple[Process, ...]:
        """One noise a decade from `fastest` on; what is faster acts as white noise."""
        if self.per_decade == 1 or self.longest <= 10.0 * fastest:
            return (self,)
        slow = BiasInstability(self.level, max(fastest, self.shortest), self.longest, 1)
        fast = [g for g in self.gauss_markovs if g.correlation_time < 0.5 * slow.shortest]
        power = math.fsum(2.0 * g.sigma**2 * g.correlation_time for g in fast)
        return (slow, WhiteNoise(math.sqrt(power))) if power > 0.0 else (slow,)

    @property
    def gauss_markovs(self) -> tuple[GaussMarkov, ...]:
        """The noises it is made of, shortest first; each has variance B² ln(10)/(pi m)."""
        decades = math.log10(self.longest / self.shortest)
        count = round(decades * self.per_decade) + 1
        times = np.geomspace(self.shortest, self.longest, count) if count > 1 else [self.shortest]
        # the true spacing replaces 1/m where the span is no whole number of steps
        spacing = decades / (count - 1) if count > 1 else 1.0 / self.per_decade
        sigma = self.level * math.sqrt(math.log(10.0) * spacing / math.pi)
        return tuple(GaussMarkov(sigma, float(time)) for time in times)

    def allan_variance(self, tau: ArrayLike) -> FloatArray:
        """Sum over the Gauss-Markov noises."""
        return np.asarray(sum(g.allan_variance(tau) for g in self.gauss_markovs))

    def sampled_allan_variance(self, clusters: NDArray[np.int64], dt: float) -> FloatArray:
        """Sum over the Gauss-Markov noises."""
        unit = _flicker_of_samples(
            self.shortest, self.longest, self.per_decade, tuple(np.asarray(clusters).tolist()), dt
        )
        return self.level**2 * unit

    def elements(self, dt: float, duration: float = 0.0) -> Elements:
        """The Gauss-Markov noises, or plain flicker where they cover a record."""
        if duration and self.shortest <= dt and self.longest >= 3.0 * duration:
            return Elements(flicker=self.level**2 / math.pi)
        return Elements.together([g.elements(dt, duration) for g in self.gauss_markovs])

    def psd(self, frequency: ArrayLike, *, onesided: bool) -> FloatArray:
        """Sum over the Gauss-Markov noises; about B²/(2 pi f) inside their band (two-sided)."""
        return np.asarray(sum(g.psd(frequency, onesided=onesided) for g in self.gauss_markovs))

    def sampled_psd(self, cycles: ArrayLike, dt: float) -> FloatArray:
        """Sum over the Gauss-Markov noises."""
        return np.asarray(sum(g.sampled_psd(cycles, dt) for g in self.gauss_markovs))

    def autocovariance(self, lag: ArrayLike) -> FloatArray:
        """Sum over the Gauss-Markov noises."""
        return np.asarray(sum(g.autocovariance(lag) for g in self.gauss_markovs))

    def state_space(self, dt: float) -> StateSpace:
        """One state for every Gauss-Markov noise."""
        parts = [g.state_space(dt) for g in self.gauss_markovs]
        return stack_state_spaces(dt, parts)

    def simulate(self, n: int, dt: float, rng: np.random.Generator) -> FloatArray:
        """Sum of independent draws, each with a child of `rng`."""
        total = np.zeros(samples(n, dt))
        with warnings.catch_warnings():
            # times below dt are part of a flicker sum on purpose
            warnings.simplefilter("ignore")
            for part, child in zip(
                self.gauss_markovs, rng.spawn(len(self.gauss_markovs)), strict=True
            ):
                total += part.simulate(n, dt, child)
        return total


@lru_cache(maxsize=64)
def _flicker_of_samples(
    shortest: float, longest: float, per_decade: int, clusters: tuple[int, ...], dt: float
) -> FloatArray:
    """Allan variance of samples of a flicker sum of unit level: asked for again in every fit."""
    m = np.array(clusters, dtype=np.int64)
    unit = BiasInstability(1.0, shortest, longest, per_decade)
    total = np.asarray(sum(g.sampled_allan_variance(m, dt) for g in unit.gauss_markovs))
    total.flags.writeable = False
    return total
