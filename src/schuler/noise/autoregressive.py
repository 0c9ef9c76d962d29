"""Autoregressive noise of any order, which exists at one sample interval."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.errors import ModelError
from schuler.noise._checks import not_negative, positive, positive_array, samples
from schuler.noise.base import Parameter, Process, StateSpace
from schuler.noise.lattice import (
    autocovariance_from_reflection,
    lags_alive,
    step_down,
    step_up,
)
from schuler.types import FloatArray

_WHOLE = 1e-6
_SUMMED_LAGS = 8192
_KALMAN_STEPS = 200_000


@dataclass(frozen=True, slots=True)
class Autoregressive(Process):
    """Autoregressive noise y(n) = -a_1 y(n-1) - ... - a_p y(n-p) + e(n), stationary.

    Parameters
    ----------
    coefficients : tuple of float
        a_1 .. a_p of A(z) = 1 + a_1 z^-1 + ... + a_p z^-p (spec 0).
    driving_variance : float
        Variance of the innovations e in u²: the mean squared one-step error.
    interval : float
        The sample interval in s that the coefficients belong to. Whole multiples of it can be
        asked for as well; nothing else exists (spec 12, mistake 4).

    Raises
    ------
    ModelError
        No coefficients, or a pole on or outside the unit circle.

    Notes
    -----
    Spec 3 and 7.3 (27AR of S004). Rounded coefficients are another process: those printed in
    S004 Table 2 are unstable in half of all cases (E-004-10).

    Examples
    --------
    >>> from schuler import Autoregressive
    >>> noise = Autoregressive((-0.95,), driving_variance=1e-6, interval=0.01)
    >>> round(float(noise.autocovariance(0.0)) * 1e5, 4)
    1.0256
    """

    coefficients: tuple[float, ...]
    driving_variance: float
    interval: float
    kind: ClassVar[str] = "autoregressive"
    meaning: ClassVar[str] = "a_1 .. a_p of 1 + a_1 z^-1 + ..., at one sample interval only"
    about: ClassVar[dict[str, Parameter]] = {
        "driving_variance": Parameter("size"),
        "interval": Parameter("given", "", "time"),
    }
    growth: ClassVar[float] = 1.0
    rank: ClassVar[float] = 8.0

    def __post_init__(self) -> None:
        numbers = tuple(float(a) for a in self.coefficients)
        object.__setattr__(self, "coefficients", numbers)
        object.__setattr__(
            self, "driving_variance", not_negative(self.driving_variance, "innovation variance")
        )
        object.__setattr__(self, "interval", positive(self.interval, "sample interval"))
        if not numbers:
            raise ModelError("an autoregressive process of order zero", cure="use WhiteNoise")
        if not all(math.isfinite(a) for a in numbers):
            raise ModelError("a coefficient is not finite", expected="finite numbers")
        if (np.abs(self.reflection) >= 1.0).any():
            modulus = float(np.abs(self.poles).max())
            raise ModelError(
                f"the autoregressive coefficients have a pole of modulus {modulus:.6g}",
                expected="all poles inside the unit circle",
                cure="fit by 'burg' or 'yule-walker', and keep all digits of the coefficients",
            )

    @property
    def order(self) -> int:
        """Number of coefficients p."""
        return len(self.coefficients)

    @property
    def parameters(self) -> dict[str, float]:
        """a_1 .. a_p, variance and dt."""
        named = {f"a_{k}": a for k, a in enumerate(self.coefficients, 1)}
        return {**named, "driving_variance": self.driving_variance, "interval": self.interval}

    @property
    def polynomial(self) -> FloatArray:
        """(1, a_1, .., a_p)."""
        return np.array([1.0, *self.coefficients])

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Roots of A(z) in z, largest first."""
        roots = np.asarray(np.roots(self.polynomial), dtype=np.complex128)
        return roots[np.argsort(-np.abs(roots))]

    @property
    def reflection(self) -> FloatArray:
        """Reflection coefficients gamma_1 .. gamma_p."""
        return step_down(np.array(self.coefficients))

    def _steps(self, time: ArrayLike, what: str) -> FloatArray:
        """Turn times into whole numbers of the own interval, or refuse."""
        ratio = np.asarray(time, dtype=np.float64) / self.interval
        whole = np.round(ratio)
        if not (np.abs(ratio - whole) <= _WHOLE * np.maximum(1.0, np.abs(whole))).all():
            raise ModelError(
                f"{what} is no whole multiple of the interval {self.interval:g} s of an "
                "autoregressive process",
                cure="fit the process again at the wanted rate",
            )
        return np.asarray(whole)

    def _multiple(self, dt: float) -> int:
        steps = int(self._steps(positive(dt, "dt"), f"the step {dt:g} s"))
        if steps < 1:
            raise ModelError(
                f"the step {dt:g} s is shorter than the interval {self.interval:g} s of an "
                "autoregressive process",
                cure="fit the process again at the wanted rate",
            )
        return steps

    def _autocovariances(self, count: int) -> FloatArray:
        """R(0) .. R(count - 1) at multiples of the own interval."""
        from scipy.signal import lfilter

        first = autocovariance_from_reflection(self.reflection, self.driving_variance)[0]
        out = np.zeros(max(count, self.order + 1))
        out[: self.order + 1] = first
        if out.size > self.order + 1:
            # R(k) + sum a_i R(k-i) = 0: the filter 1/A running on from the first p values
            past = first[: -self.order - 1 : -1] if self.order else first[:0]
            start = _filter_state(np.array(self.coefficients), past)
            lasting = lags_alive(self.poles, out.size - self.order - 1)
            tail = lfilter([1.0], self.polynomial, np.zeros(lasting), zi=start)[0]
            out[self.order + 1 : self.order + 1 + lasting] = tail
        return out[:count]

    def allan_variance(self, tau: ArrayLike) -> FloatArray:
        """Exact at multiples of dt: [4 V(m) - V(2m)]/(2 m²), V(m) the variance of a sum of m.

        Raises
        ------
        ModelError
            A cluster time that is no multiple of dt.
        """
        clusters = self._steps(positive_array(tau, "cluster time"), "a cluster time")
        if (clusters < 1).any():
            raise ModelError(f"a cluster time is shorter than the interval {self.interval:g} s")
        flat = clusters.ravel()
        twice = np.concatenate([flat, 2.0 * flat])
        unique, where = np.unique(twice, return_inverse=True)
        sums = self._variances_of_sums(unique)[where]
        variance = (4.0 * sums[: flat.size] - sums[flat.size :]) / (2.0 * flat**2)
        return np.asarray(variance.reshape(clusters.shape))

    def _variances_of_sums(self, lengths: FloatArray) -> FloatArray:
        """V(m) = m R(0) + 2 sum_{k<m} (m - k) R(k); long sums by the powers of the companion."""
        out = np.empty(lengths.size)
        short = lengths <= _SUMMED_LAGS
        top = int(lengths[short].max()) if short.any() else 1
        r = self._autocovariances(top)
        lags = np.arange(top)
        plain, weighted = np.cumsum(r), np.cumsum(lags * r)
        m = lengths[short].astype(np.int64)
        out[short] = 2.0 * (m * plain[m - 1] - weighted[m - 1]) - m * r[0]
        if (~short).any():
            space = self.state_space(self.interval)
            one = np.eye(self.order)
            resolvent = np.linalg.inv(one - space.transition)
            for j in np.flatnonzero(~short):
                m_long = int(lengths[j])
                power = np.linalg.matrix_power(space.transition, m_long)
                series = m_long * one - resolvent @ (one - power)
                total = space.transition @ resolvent @ series @ space.initial_covariance
                out[j] = m_long * r[0] + 2.0 * float(space.output @ total @ space.output)
        return out

    def psd(self, frequency: ArrayLike, *, onesided: bool) -> FloatArray:
        """Return variance dt/|A(exp(j 2 pi f dt))|² (two-sided); periodic past Nyquist."""
        cycles = np.asarray(frequency, dtype=np.float64) * self.interval
        return self.sampled_psd(cycles, self.interval) * self.interval * (2.0 if onesided else 1.0)

    def sampled_psd(self, cycles: ArrayLike, dt: float) -> FloatArray:
        """variance/|A|²; at a multiple of dt the mean over the aliases."""
        step = self._multiple(dt)
        wanted = np.asarray(cycles, dtype=np.float64)
        total = np.zeros(wanted.shape)
        for alias in range(step):
            angle = np.exp(-2j * np.pi * (wanted + alias) / step)
            total += self.driving_variance / np.abs(np.polyval(self.polynomial[::-1], angle)) ** 2
        return total / step

    def autocovariance(self, lag: ArrayLike) -> FloatArray:
        """R at whole multiples of dt.

        Raises
        ------
        ModelError
            A lag that is no multiple of dt.
        """
        steps = np.abs(self._steps(lag, "a lag")).astype(np.int64)
        values = self._autocovariances(int(steps.max(initial=0)) + 1)
        return np.asarray(values[steps])

    def state_space(self, dt: float) -> StateSpace:
        """Companion form, the newest sample last and as output; stationary at the start.

        At m times the own interval the companion is raised to the power m and the noise of the m
        steps is accumulated (spec 7.3).

        Raises
        ------
        ModelError
            `dt` is no whole multiple of the own interval.
        """
        steps = self._multiple(dt)
        p = self.order
        companion = np.zeros((p, p))
        companion[:-1, 1:] = np.eye(p - 1)
        companion[-1] = -np.array(self.coefficients)[::-1]
        transition, noise = np.eye(p), np.zeros((p, p))
        for _ in range(steps):
            noise = companion @ noise @ companion.T
            noise[-1, -1] += self.driving_variance
            transition = companion @ transition
        r = self._autocovariances(p)
        output = np.zeros(p)
        output[-1] = 1.0
        return StateSpace(
            dt=dt,
            transition=transition,
            noise_covariance=0.5 * (noise + noise.T),
            output=output,
            initial_covariance=r[np.abs(np.subtract.outer(np.arange(p), np.arange(p)))],
            white_density=0.0,
            drift=None,
            diffusion=None,
            names=(*(f"autoregressive, {k} before" for k in range(p - 1, 0, -1)), "autoregressive"),
        )

    def simulate(self, n: int, dt: float, rng: np.random.Generator) -> FloatArray:
        """Recursion from a stationary start: the first samples by predictors of order 0 .. p-1."""
        from scipy.signal import lfilter

        n, step = samples(n, dt), self._multiple(dt)
        if n == 0:
            return np.zeros(0)
        length = max((n - 1) * step + 1, self.order + 1)
        drive = rng.standard_normal(length)
        error = autocovariance_from_reflection(self.reflection, self.driving_variance)[1]
        rows = step_up(self.reflection)
        first = np.zeros(self.order)
        for k in range(self.order):
            foreseen = -rows[k - 1, :k] @ first[:k][::-1] if k else 0.0
            first[k] = foreseen + math.sqrt(error[k]) * drive[k]
        start = _filter_state(np.array(self.coefficients), first[::-1])
        rest = math.sqrt(self.driving_variance) * drive[self.order :]
        tail = lfilter([1.0], self.polynomial, rest, zi=start)[0]
        return np.concatenate([first, tail])[: (n - 1) * step + 1 : step].copy()

    def innovation_variance(self, dt: float) -> float:
        """The own variance; at a multiple of dt that of the steady Kalman filter."""
        if self._multiple(dt) == 1 or self.driving_variance == 0.0:
            return self.driving_variance
        space = self.state_space(dt)
        covariance, before = space.initial_covariance, math.inf
        for _ in range(_KALMAN_STEPS):
            now = float(covariance[-1, -1])
            if before - now <= 1e-15 * now:
                break
            before = now
            gain = covariance[:, -1] / now
            left = covariance - np.outer(gain, covariance[-1])
            covariance = space.transition @ left @ space.transition.T + space.noise_covariance
            covariance = 0.5 * (covariance + covariance.T)
        return before


def _filter_state(coefficients: FloatArray, past: FloatArray) -> FloatArray:
    """State of the filter 1/A behind outputs `past`, newest first (direct form II transposed)."""
    p = coefficients.size
    return np.array([-(coefficients[k:] @ past[: p - k]) for k in range(p)])
