"""The questions that every stochastic process answers, alone or in a sum."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from schuler.types import FloatArray

if TYPE_CHECKING:
    from schuler.noise.sums import ProcessSum


@dataclass(frozen=True, slots=True, eq=False)
class StateSpace:
    """A process in states, discretised exactly for one step.

    The process is output @ x plus white noise; x(k+1) = transition @ x(k) + w(k).

    Parameters
    ----------
    dt : float
        Step in s.
    transition : (s, s) ndarray
        Transition over one step.
    noise_covariance : (s, s) ndarray
        Covariance of w over one step.
    output : (s,) ndarray
        How the states add up to the process.
    initial_covariance : (s, s) ndarray
        Covariance of the states at the start: stationary where that exists, else as given.
    white_density : float
        Density N of the white part, (unit)/sqrt(Hz); its sample variance is N²/dt.
    drift : (s, s) ndarray or None
        F of dx/dt = F x + u in 1/s, block-diagonal with blocks of size 1 (decay or constant) or 2
        (ramp, oscillation); None for processes that exist only in discrete time (quantisation,
        AR, ARMA).
    diffusion : (s, s) ndarray or None
        Density of u, (unit)²/s.
    names : tuple of str
        A name for every state, e.g. "Gauss-Markov", "random walk".
    """

    dt: float
    transition: FloatArray
    noise_covariance: FloatArray
    output: FloatArray
    initial_covariance: FloatArray
    white_density: float
    drift: FloatArray | None
    diffusion: FloatArray | None
    names: tuple[str, ...]

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
    """

    __slots__ = ()

    kind: ClassVar[str] = "process"
    """Name in files and in the keys of parameters, e.g. "gauss_markov"."""

    @property
    def parameters(self) -> dict[str, float]:
        """The numbers that define the process, in SI, by field name."""
        values = {f.name: getattr(self, f.name) for f in fields(self)}  # type: ignore[arg-type]
        return {name: float(v) for name, v in values.items() if v is not None}

    @property
    def components(self) -> tuple[Process, ...]:
        """The independent parts; a single process is its own only part."""
        return (self,)

    @abstractmethod
    def allan_variance(self, tau: ArrayLike) -> FloatArray:
        """Allan variance at cluster times `tau` (s), in u². Spec 2.3."""

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
        from schuler.noise.innovation import kolmogorov_szego

        return kolmogorov_szego(self, dt)

    def __add__(self, other: Process) -> ProcessSum:
        """Sum of independent processes."""
        from schuler.noise.sums import ProcessSum

        return ProcessSum((*self.components, *other.components))
