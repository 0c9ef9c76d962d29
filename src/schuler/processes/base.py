"""The questions that every stochastic process answers, alone or in a sum."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from schuler.processes.sums import ProcessSum

FloatArray = NDArray[np.float64]


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
        F of dx/dt = F x + u, block-diagonal with blocks of size 1 or 2 (each either 1x1 decay,
        or 2x2); None for processes that exist only in discrete time (AR, ARMA).
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


class Process(ABC):
    """A zero-mean stochastic sensor error, or a sum of independent ones.

    Units: if the signal is in u (m/s² or rad/s), densities are in u/sqrt(Hz), random walks in
    u/sqrt(s), ramps in u/s.
    """

    __slots__ = ()

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

    @abstractmethod
    def innovation_variance(self, dt: float) -> float:
        """Smallest one-step prediction error variance at step `dt`. Spec 3."""

    def __add__(self, other: Process) -> ProcessSum:
        """Sum of independent processes."""
        from schuler.processes.sums import ProcessSum

        return ProcessSum((*self.components, *other.components))
