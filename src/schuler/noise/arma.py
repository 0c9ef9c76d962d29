"""Autoregressive moving-average noise: a process of samples, at one sample interval only."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import ModelError
from schuler.noise._checks import finite, not_negative, positive, positive_array, samples
from schuler.noise.base import Parameter, Process, StateSpace
from schuler.noise.lattice import lags_alive
from schuler.types import FloatArray

_LONGEST_MEMORY = 10_000_000
_UNIT_ROOT = 1e-12


def poles_of(phi: Sequence[float] | FloatArray) -> NDArray[np.complex128]:
    """Poles of 1/(1 - phi_1 z^-1 - ... - phi_p z^-p), slowest first."""
    roots = np.roots(np.concatenate([[1.0], -np.asarray(phi, dtype=np.float64)]))
    # roots at the origin are dropped by nothing: trailing zeros of phi are poles at 0
    return np.asarray(roots[np.argsort(-np.abs(roots), kind="stable")], dtype=np.complex128)


def zeros_of(theta: Sequence[float] | FloatArray) -> NDArray[np.complex128]:
    """Zeros of 1 + theta_1 z^-1 + ... + theta_q z^-q, slowest first."""
    return poles_of(-np.asarray(theta, dtype=np.float64))


def within(phi: FloatArray | Sequence[float], limit: float = 1.0) -> bool:
    """Whether all poles lie within a circle, by Schur and Cohn: no reflection reaches one.

    Much cheaper than the poles themselves, and asked at every step of a search.
    """
    rest = [-float(c) / limit**k for k, c in enumerate(phi, 1)]
    while rest:
        last = rest.pop()
        if not abs(last) < 1.0:
            return False
        rest = [(c - last * d) / (1.0 - last * last) for c, d in zip(rest, rest[::-1], strict=True)]
    return True


def harvey_form(phi: FloatArray, theta: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Coefficients padded to s = max(p, q + 1) states: phi and (1, theta)."""
    s = max(phi.size, theta.size + 1)
    padded, gain = np.zeros(s), np.zeros(s)
    padded[: phi.size] = phi
    gain[0] = 1.0
    gain[1 : theta.size + 1] = theta
    return padded, gain


def stationary_covariance(padded: FloatArray, gain: FloatArray) -> FloatArray:
    """Covariance P = T P T' + R R' of Harvey's states for unit driving noise."""
    s = padded.size
    transition = np.zeros((s, s))
    transition[:, 0] = padded
    transition[np.arange(s - 1), np.arange(1, s)] = 1.0
    noise = np.outer(gain, gain)
    # vec(T P T') with row-major vec is kron(T, T) vec(P)
    system = np.eye(s * s) - np.einsum("ij,kl->ikjl", transition, transition).reshape(s * s, s * s)
    try:
        solution = np.linalg.solve(system, noise.ravel()).reshape(s, s)
    except np.linalg.LinAlgError:
        # poles on the circle but for rounding: a variance that no number can hold
        solution = np.linalg.lstsq(system, noise.ravel())[0].reshape(s, s)
    return np.asarray(0.5 * (solution + solution.T))


@dataclass(frozen=True, slots=True)
class ARMA(Process):
    """x(t) = sum phi_i x(t-i) + e(t) + sum theta_j e(t-j), e white and Gaussian.

    Parameters
    ----------
    phi : tuple of float
        Autoregressive coefficients, S000's alpha: minus those of the polynomial A(z).
    theta : tuple of float
        Moving-average coefficients, S000's beta.
    driving_variance : float
        Variance of e in u².
    interval : float
        The sample interval in s. The process exists at this interval only.

    Raises
    ------
    ModelError
        Not stationary, or not finite.

    Notes
    -----
    Spec 5.1, S000 (10).

    Examples
    --------
    >>> from schuler import ARMA
    >>> noise = ARMA(phi=(-0.9,), theta=(0.4,), driving_variance=1e-6, interval=0.01)
    >>> round(float(noise.innovation_variance(0.01)), 9)
    1e-06
    """

    phi: tuple[float, ...]
    theta: tuple[float, ...]
    driving_variance: float
    interval: float
    kind: ClassVar[str] = "arma"
    meaning: ClassVar[str] = (
        "phi and theta as in x = phi x + e + theta e, at one sample interval only"
    )
    about: ClassVar[dict[str, Parameter]] = {
        "driving_variance": Parameter("size"),
        "interval": Parameter("given", "", "time"),
    }
    growth: ClassVar[float] = 1.0
    rank: ClassVar[float] = 9.0

    def __post_init__(self) -> None:
        for name in ("phi", "theta"):
            given = np.atleast_1d(np.asarray(getattr(self, name), dtype=np.float64))
            values = tuple(finite(v, f"coefficient of {name}") for v in given.tolist())
            object.__setattr__(self, name, values)
        variance = not_negative(self.driving_variance, "innovation variance")
        object.__setattr__(self, "driving_variance", variance)
        object.__setattr__(self, "interval", positive(self.interval, "sample interval"))
        slowest = float(np.abs(self.poles).max(initial=0.0))
        if slowest > 1.0 - _UNIT_ROOT:
            raise ModelError(
                f"ARMA process with a pole of modulus {slowest:.9g}",
                expected="all poles inside the unit circle",
                cure="use coefficients in full precision, or model a random walk as such",
            )

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Poles in the z plane, slowest first."""
        return poles_of(self.phi)

    @property
    def zeros(self) -> NDArray[np.complex128]:
        """Zeros in the z plane, slowest first."""
        return zeros_of(self.theta)

    @property
    def parameters(self) -> dict[str, float]:
        """phi_1, ..., theta_1, ..., the driving variance and the interval."""
        return {
            **{f"phi_{i}": v for i, v in enumerate(self.phi, 1)},
            **{f"theta_{j}": v for j, v in enumerate(self.theta, 1)},
            "driving_variance": self.driving_variance,
            "interval": self.interval,
        }

    def _check_interval(self, dt: float) -> None:
        if abs(positive(dt, "dt") / self.interval - 1.0) > 1e-6:
            raise ModelError(
                f"ARMA process of samples {self.interval:g} s apart was asked for {dt:g} s",
                expected="its own sample interval",
                cure="change it to a sum of Gauss-Markov noises (arma_to_gauss_markov_sum)",
            )

    def _steps(self, time: FloatArray, what: str) -> NDArray[np.int64]:
        ratio = np.abs(time) / self.interval
        steps = np.round(ratio)
        if (np.abs(ratio - steps) > 1e-6 * np.maximum(steps, 1.0)).any():
            raise ModelError(
                f"{what} between the samples of an ARMA process",
                expected=f"multiples of its interval {self.interval:g} s",
            )
        return steps.astype(np.int64)

    def _covariances(self, count: int) -> FloatArray:
        """Autocovariances at lags 0 .. count - 1, by the recursion of the process itself."""
        from scipy.signal import lfilter

        padded, gain = harvey_form(np.array(self.phi), np.array(self.theta))
        first = self.driving_variance * stationary_covariance(padded, gain)[:, 0]
        # lag k is the first state after k steps without noise, from cov(state, x)
        if count <= 1 or (padded.size == 1 and padded[0] == 0.0):
            return np.asarray(np.concatenate([first[:1], np.zeros(max(count - 1, 0))])[:count])
        start = padded * first[0] + np.append(first[1:], 0.0)
        lags = max(len(self.phi), len(self.theta))
        alive = min(lags_alive(self.poles, count - 1) + lags, count - 1)
        forward = np.zeros(count - 1)
        forward[:alive] = lfilter(
            np.concatenate([[1.0], np.zeros(lags)]),
            np.concatenate([[1.0], -padded[: len(self.phi)]]),
            np.zeros(alive),
            zi=start[:lags],
        )[0]
        return np.concatenate([first[:1], forward])

    def autocovariance(self, lag: ArrayLike) -> FloatArray:
        """Exact, at multiples of the interval."""
        steps = self._steps(np.asarray(lag, dtype=np.float64), "lag")
        table = self._covariances(int(steps.max(initial=0)) + 1)
        return np.asarray(table[steps])

    def allan_variance(self, tau: ArrayLike) -> FloatArray:
        """Exact, at multiples m of the interval: (4 V(m) - V(2m))/(2 m²), V(m) = var of m sums."""
        times = positive_array(tau, "cluster time")
        steps = np.maximum(self._steps(times, "cluster time"), 1)
        longest = 2 * int(steps.max(initial=1))
        slowest = float(np.abs(self.poles).max(initial=0.0))
        memory = 50.0 / max(-math.log(max(slowest, 1e-300)), 1e-300) + len(self.theta) + 2.0
        count = int(min(longest, memory, _LONGEST_MEMORY)) + 1
        covariance = self._covariances(count)
        # V(m) = m R(0) + 2 sum_(k<m) (m - k) R(k); what lies beyond the memory is zero
        weight = np.cumsum(covariance[1:])
        moment = np.cumsum(np.arange(1, count) * covariance[1:])

        def of_sums(m: NDArray[np.int64]) -> FloatArray:
            last = np.minimum(m - 1, count - 1) - 1
            reach = np.where(last >= 0, m * weight[last] - moment[last], 0.0)
            return np.asarray(m * covariance[0] + 2.0 * reach)

        variance = (4.0 * of_sums(steps) - of_sums(2 * steps)) / (2.0 * steps.astype(float) ** 2)
        return np.asarray(variance)

    def psd(self, frequency: ArrayLike, *, onesided: bool) -> FloatArray:
        """Spectrum of the samples times the interval; means something up to half the rate."""
        cycles = np.asarray(frequency, dtype=np.float64) * self.interval
        factor = self.interval * (2.0 if onesided else 1.0)
        return np.asarray(factor * self.sampled_psd(cycles, self.interval))

    def sampled_psd(self, cycles: ArrayLike, dt: float) -> FloatArray:
        """Driving variance times |theta(z)/phi(z)|², by its poles and zeros."""
        self._check_interval(dt)
        sine = np.sin(np.pi * np.asarray(cycles, dtype=np.float64))
        back = 2.0 * sine * (sine + 1j * np.cos(np.pi * np.asarray(cycles, dtype=np.float64)))
        density = np.full(np.shape(sine), self.driving_variance)
        # 1 - r z^-1 = (1 - r) + r (1 - z^-1): keeps its digits where r and z are both near one
        for zero in self.zeros:
            density = density * np.abs((1.0 - zero) + zero * back) ** 2
        for pole in self.poles:
            density = density / np.abs((1.0 - pole) + pole * back) ** 2
        return np.asarray(density)

    def state_space(self, dt: float) -> StateSpace:
        """Harvey's form, max(p, q + 1) states; exists in discrete time only."""
        self._check_interval(dt)
        padded, gain = harvey_form(np.array(self.phi), np.array(self.theta))
        s = padded.size
        transition = np.zeros((s, s))
        transition[:, 0] = padded
        transition[np.arange(s - 1), np.arange(1, s)] = 1.0
        return StateSpace(
            dt=dt,
            transition=transition,
            noise_covariance=self.driving_variance * np.outer(gain, gain),
            output=np.eye(s)[0],
            initial_covariance=self.driving_variance * stationary_covariance(padded, gain),
            white_density=0.0,
            drift=None,
            diffusion=None,
            names=tuple(f"ARMA {k}" for k in range(1, s + 1)),
        )

    def simulate(self, n: int, dt: float, rng: np.random.Generator) -> FloatArray:
        """Recursion from a stationary start."""
        self._check_interval(dt)
        n = samples(n, dt)
        if n == 0:
            return np.zeros(0)
        padded, gain = harvey_form(np.array(self.phi), np.array(self.theta))
        covariance = stationary_covariance(padded, gain)
        values, vectors = np.linalg.eigh(covariance)
        root = vectors * np.sqrt(np.maximum(values, 0.0))
        state = root @ rng.standard_normal(padded.size)
        innovations = rng.standard_normal(n - 1)
        out = np.concatenate([state[:1], self._filter(innovations, padded, state)])
        return np.asarray(out * math.sqrt(self.driving_variance))

    def _filter(self, innovations: FloatArray, padded: FloatArray, state: FloatArray) -> FloatArray:
        from scipy.signal import lfilter

        lags = max(len(self.phi), len(self.theta))
        if lags == 0:
            return innovations
        start = (padded * state[0] + np.append(state[1:], 0.0))[:lags]
        numerator, denominator = np.zeros(lags + 1), np.zeros(lags + 1)
        numerator[0] = denominator[0] = 1.0
        numerator[1 : len(self.theta) + 1] = self.theta
        denominator[1 : len(self.phi) + 1] = -np.array(self.phi)
        return np.asarray(lfilter(numerator, denominator, innovations, zi=start)[0])

    def respond_to(self, innovations: ArrayLike) -> FloatArray:
        """Signal that given innovations drive, from rest.

        Parameters
        ----------
        innovations : (n,) array_like
            In u, for instance conditionally heteroskedastic ones.

        Returns
        -------
        (n,) ndarray
            Not stationary before the slowest pole has died out: drop the first part.
        """
        padded, _ = harvey_form(np.array(self.phi), np.array(self.theta))
        values = np.asarray(innovations, dtype=np.float64)
        return self._filter(values, padded, np.zeros(padded.size))

    def innovation_variance(self, dt: float) -> float:
        """The driving variance; zeros outside the unit circle raise it to their mirror's."""
        self._check_interval(dt)
        outside = np.maximum(np.abs(self.zeros), 1.0)
        return float(self.driving_variance * np.prod(outside**2))
