"""The questions that every stochastic process answers, alone or in a sum.

All that the rest of the house knows of a kind of process stands in its class: what a fit may
change and on which scale, units, words, how it is written, what the covariance kernels see in it,
and how several sensors' parts are summed. A process defined in a user's own file is one of the
family as soon as it has been imported.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import ModelError
from schuler.noise._checks import positive, samples
from schuler.noise.elements import Elements, imitation
from schuler.noise.innovation import kolmogorov_szego
from schuler.noise.registry import check_answers, enrol
from schuler.types import FloatArray

Role = Literal["size", "time", "shape", "given"]


@dataclass(frozen=True, slots=True)
class Parameter:
    """What is known of one number of a process."""

    # "size": a fit finds it, and the process grows with it (see `Process.growth`); "time": a fit
    # finds it between the sample interval and twenty record lengths; "shape": a fit finds it, above
    # zero; "given": it stays as it is.
    role: Role = "shape"
    words: str = ""  # for tables, e.g. "white noise N"; empty: not shown.
    # kind of quantity as of `schuler.units`, "{}" standing for gyro or accel; empty: a plain
    # number, or SI.
    unit: str = ""


@dataclass(frozen=True, slots=True, eq=False)
class StateSpace:
    """A process in states, discretised exactly for one step.

    The process is output @ x plus white noise; x(k+1) = transition @ x(k) + w(k).
    """

    dt: float  # step in s
    transition: FloatArray  # (s, s): transition over one step
    noise_covariance: FloatArray  # (s, s): covariance of w over one step
    output: FloatArray  # (s,): how the states add up to the process
    # (s, s): covariance of the states at the start: stationary where that exists, else as given
    initial_covariance: FloatArray
    # density N of the white part, (unit)/sqrt(Hz); its sample variance is N²/dt.
    white_density: float
    # (s, s): F of dx/dt = F x + u in 1/s, block-diagonal with blocks of size 1 (decay or constant)
    # or 2 (ramp, oscillation); None for processes that exist only in discrete time (quantisation,
    # AR, ARMA).
    drift: FloatArray | None
    diffusion: FloatArray | None  # (s, s): density of u, (unit)²/s
    names: tuple[str, ...]  # a name for every state, e.g. "Gauss-Markov", "random walk".

    @property
    def size(self) -> int:
        """Number of states."""
        return int(self.output.size)

    @property
    def blocks(self) -> tuple[slice, ...]:
        """The diagonal blocks of the transition, in order."""
        coupled = (self.transition != 0.0) | (self.transition.T != 0.0)
        if self.drift is not None:
            coupled |= (self.drift != 0.0) | (self.drift.T != 0.0)
        starts, k = [], 0
        while k < self.size:
            starts.append(k)
            stop = k + 1
            while stop < self.size and coupled[k:stop, stop:].any():
                stop += 1
            k = stop
        return tuple(slice(a, b) for a, b in zip(starts, [*starts[1:], self.size], strict=True))


class Process(ABC):
    """A zero-mean stochastic sensor error, or a sum of independent ones.

    Units: if the signal is in u (m/s² or rad/s), densities are in u/sqrt(Hz), random walks in
    u/sqrt(s), ramps in u/s.

    A subclass is a frozen dataclass of its numbers that answers the abstract questions; all class
    attributes below have defaults that work. Without `about`, every number is free in a fit,
    written in SI, and shown under its own name.

    Examples
    --------
    >>> from schuler import Process, WhiteNoise
    >>> isinstance(WhiteNoise(1e-3) + WhiteNoise(2e-3), Process)
    True
    """

    __slots__ = ()

    kind: ClassVar[str] = "process"
    """Name in files and in the keys of parameters, e.g. "gauss_markov"."""
    meaning: ClassVar[str] = ""
    """A comment for readers of noise model files."""
    label: ClassVar[str] = ""
    """Name in legends; empty: the kind."""
    about: ClassVar[Mapping[str, Parameter]] = {}
    """What is known of its numbers, by field."""
    growth: ClassVar[float] = 2.0
    """The variance grows with this power of the size: 2 for deviations, 1 for variances."""
    random: ClassVar[bool] = True
    """False where nothing is random from sample to sample: constants, ramps, lines."""
    likelihood: ClassVar[bool] = False
    """Whether `elements` is all there is to it, so that the exact likelihood may use it."""
    penalty: ClassVar[float] = math.inf
    """What it must take off the misfit to be chosen; infinite: only fitted when asked for."""
    rank: ClassVar[float] = 50.0
    """Place in tables, smallest first."""

    def __init_subclass__(cls, **more: object) -> None:
        super().__init_subclass__(**more)
        enrol(cls)

    @property
    def parameters(self) -> dict[str, float]:
        """The numbers that define the process, in SI, by field name."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}  # type: ignore[arg-type]
        return {name: float(v) for name, v in values.items() if v is not None}

    @classmethod
    def described(cls, name: str) -> Parameter:
        """What is known of one number."""
        if cls.about:
            return cls.about.get(name, Parameter("given"))
        return Parameter("shape", f"{cls.kind} {name}".replace("_", " "))

    @property
    def free(self) -> tuple[str, ...]:
        """Names of the numbers that a fit finds, the size first."""
        if type(self).about:
            return tuple(n for n, p in type(self).about.items() if p.role != "given")
        values = {f.name: getattr(self, f.name) for f in fields(self)}  # type: ignore[arg-type]
        return tuple(n for n, v in values.items() if isinstance(v, float) and v > 0.0)

    @classmethod
    def size_name(cls) -> str:
        """Name of the number that the process grows with; empty if it has none."""
        return next((n for n, p in cls.about.items() if p.role == "size"), "")

    @property
    def size(self) -> float:
        """That number."""
        return abs(float(getattr(self, self.size_name())))

    def with_size(self, size: float) -> Self:
        """The process with another size."""
        return replace(self, **{self.size_name(): size})  # type: ignore[type-var]

    def scaled(self, factor: float) -> Self:
        """The process of the signal times a factor."""
        if not self.size_name():
            raise ModelError(
                f"a {self.kind} process cannot be scaled",
                expected=f"a parameter with the role 'size' in {type(self).__name__}.about",
            )
        return self.with_size(self.size * abs(factor) ** (2.0 / self.growth))

    @classmethod
    def combined(cls, members: Sequence[tuple[Self, float]]) -> list[Process]:
        """Processes of the weighted sum of independent ones of this kind, with their shares."""
        sums: dict[Process, float] = {}
        for process, share in members:
            amplitude = process.scaled(share)
            if amplitude.size > 0.0:
                key = process.with_size(1.0)
                sums[key] = sums.get(key, 0.0) + amplitude.size**cls.growth
        return [key.with_size(total ** (1.0 / cls.growth)) for key, total in sums.items()]

    @property
    def components(self) -> tuple[Process, ...]:
        """The independent parts; a single process is its own only part."""
        return (self,)

    @abstractmethod
    def allan_variance(self, tau: ArrayLike) -> FloatArray:
        """Allan variance at cluster times `tau` (s), in u². Spec 2.3."""

    def sampled_allan_variance(self, clusters: NDArray[np.int64], dt: float) -> FloatArray:
        """Allan variance of point samples `dt` seconds apart, in clusters of so many.

        `allan_variance` is that of averages over the clusters; the two differ for whatever moves
        within a sample interval. By default they are taken to be the same.
        """
        return self.allan_variance(np.asarray(clusters, dtype=np.float64) * dt)

    @abstractmethod
    def psd(self, frequency: ArrayLike, *, onesided: bool) -> FloatArray:
        """Power spectral density at `frequency` (Hz), in u²/Hz. Spec 2.2."""

    @abstractmethod
    def sampled_psd(self, cycles: ArrayLike, dt: float) -> FloatArray:
        """Spectrum of the samples `dt` seconds apart, at `cycles` per sample (0 to 1/2).

        Two-sided; its integral from -1/2 to 1/2 is the sample variance, in u². Lines (constants,
        ramps, sinusoids) are left out.
        """

    @abstractmethod
    def autocovariance(self, lag: ArrayLike) -> FloatArray:
        """Autocovariance at `lag` (s), in u².

        Raises
        ------
        ModelError
            The process is not stationary, or is white noise of infinite variance in continuous
            time (ask for its `state_space`).
        """

    def wavelet_variance(self, scale: ArrayLike) -> FloatArray:
        """Haar wavelet variance at `scale` (s): half the Allan variance. Spec 10."""
        return np.asarray(0.5 * self.allan_variance(scale), dtype=np.float64)

    @abstractmethod
    def state_space(self, dt: float) -> StateSpace:
        """Exact discretisation for steps of `dt` seconds."""

    @abstractmethod
    def simulate(self, n: int, dt: float, rng: np.random.Generator) -> FloatArray:
        """Draw `n` samples `dt` seconds apart, with a stationary start. Spec 1.1."""

    def innovation_variance(self, dt: float) -> float:
        """Smallest one-step prediction error variance at step `dt`, in u². Spec 3."""
        return kolmogorov_szego(self.sampled_psd, dt)

    def elements(self, dt: float, duration: float = 0.0) -> Elements:
        """What the kernels of covariances see: white noise, walks, exponential correlations.

        By default the sum of white and Gauss-Markov noises with nearly the same Allan variance.
        For a record of a `duration` in s a simpler form may do; 0 asks for the exact one.
        """
        return imitation(self.allan_variance, dt) if self.random else Elements()

    def coarser(self, fastest: float) -> tuple[Process, ...]:
        """Nearly the same process in fewer states, for times from `fastest` s on."""
        return (self,)

    def half_mean_squared_difference(self, steps: FloatArray, dt: float) -> FloatArray:
        """Half the mean squared difference of samples so many steps apart (variogram)."""
        covariance = self.autocovariance(np.concatenate([[0.0], steps * dt]))
        return np.asarray(covariance[0] - covariance[1:])

    def __add__(self, other: Process) -> ProcessSum:
        """Sum of independent processes."""
        return ProcessSum((*self.components, *other.components))


def _block_diagonal(blocks: Sequence[FloatArray]) -> FloatArray:
    size = sum(len(b) for b in blocks)
    out, k = np.zeros((size, size)), 0
    for block in blocks:
        out[k : k + len(block), k : k + len(block)] = block
        k += len(block)
    return out


def stack_state_spaces(dt: float, parts: Sequence[StateSpace]) -> StateSpace:
    """Put independent state spaces of one step side by side."""
    drifts = [p.drift for p in parts if p.drift is not None]
    diffusions = [p.diffusion for p in parts if p.diffusion is not None]
    continuous = len(drifts) == len(diffusions) == len(parts)
    return StateSpace(
        dt=positive(dt, "dt"),
        transition=_block_diagonal([p.transition for p in parts]),
        noise_covariance=_block_diagonal([p.noise_covariance for p in parts]),
        output=np.concatenate([np.zeros(0), *(p.output for p in parts)]),
        initial_covariance=_block_diagonal([p.initial_covariance for p in parts]),
        white_density=math.hypot(0.0, *(p.white_density for p in parts)),
        drift=_block_diagonal(drifts) if continuous else None,
        diffusion=_block_diagonal(diffusions) if continuous else None,
        names=tuple(name for p in parts for name in p.names),
    )


@dataclass(frozen=True, slots=True)
class ProcessSum(Process):
    """A sum of independent processes; write `WhiteNoise(...) + GaussMarkov(...)`.

    Parameters
    ----------
    parts : tuple of Process
        Sums among them are opened up. At least one.

    Examples
    --------
    >>> from schuler import GaussMarkov, WhiteNoise
    >>> [part.kind for part in (WhiteNoise(1e-3) + GaussMarkov(1e-3, 5.0)).parts]
    ['white_noise', 'gauss_markov']
    """

    parts: tuple[Process, ...]
    kind: ClassVar[str] = "sum"

    def __post_init__(self) -> None:
        flat = tuple(leaf for part in self.parts for leaf in part.components)
        if not flat:
            raise ModelError("a sum of no processes", expected="at least one process")
        for leaf in flat:
            check_answers(leaf)
        object.__setattr__(self, "parts", flat)

    @property
    def components(self) -> tuple[Process, ...]:
        """The independent parts."""
        return self.parts

    @property
    def names(self) -> tuple[str, ...]:
        """A name for every part: its kind, numbered where a kind occurs more than once."""
        kinds = [p.kind for p in self.parts]
        return tuple(
            kind if kinds.count(kind) == 1 else f"{kind}_{kinds[: k + 1].count(kind)}"
            for k, kind in enumerate(kinds)
        )

    @property
    def parameters(self) -> dict[str, float]:
        """All numbers in SI, keys such as "gauss_markov.sigma" or "gauss_markov_2.sigma"."""
        return {
            f"{name}.{key}": value
            for name, part in zip(self.names, self.parts, strict=True)
            for key, value in part.parameters.items()
        }

    def allan_variance(self, tau: ArrayLike) -> FloatArray:
        """Sum of the parts."""
        return np.asarray(sum(p.allan_variance(tau) for p in self.parts))

    def sampled_allan_variance(self, clusters: NDArray[np.int64], dt: float) -> FloatArray:
        """Sum of the parts."""
        return np.asarray(sum(p.sampled_allan_variance(clusters, dt) for p in self.parts))

    def psd(self, frequency: ArrayLike, *, onesided: bool) -> FloatArray:
        """Sum of the parts."""
        return np.asarray(sum(p.psd(frequency, onesided=onesided) for p in self.parts))

    def sampled_psd(self, cycles: ArrayLike, dt: float) -> FloatArray:
        """Sum of the parts."""
        return np.asarray(sum(p.sampled_psd(cycles, dt) for p in self.parts))

    def autocovariance(self, lag: ArrayLike) -> FloatArray:
        """Sum of the parts; each must have one."""
        return np.asarray(sum(p.autocovariance(lag) for p in self.parts))

    def state_space(self, dt: float) -> StateSpace:
        """The states of the parts, one after the other."""
        return stack_state_spaces(dt, [p.state_space(dt) for p in self.parts])

    def elements(self, dt: float, duration: float = 0.0) -> Elements:
        """Elements of all parts together."""
        return Elements.together([p.elements(dt, duration) for p in self.parts])

    def coarser(self, fastest: float) -> tuple[Process, ...]:
        """The parts, each coarser."""
        return tuple(q for p in self.parts for q in p.coarser(fastest))

    def half_mean_squared_difference(self, steps: FloatArray, dt: float) -> FloatArray:
        """Sum of the parts."""
        return np.asarray(sum(p.half_mean_squared_difference(steps, dt) for p in self.parts))

    def simulate(self, n: int, dt: float, rng: np.random.Generator) -> FloatArray:
        """Sum of independent draws, each with a child of `rng`."""
        total = np.zeros(samples(n, dt))
        for part, child in zip(self.parts, rng.spawn(len(self.parts)), strict=True):
            total += part.simulate(n, dt, child)
        return total
