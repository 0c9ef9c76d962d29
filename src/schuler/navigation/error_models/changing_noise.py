"""White noise whose density changes: from the variance of a sample, given those before it.

A filter wants the density of every sample before it has seen it. What it sees of the noise while
the vehicle moves are second differences, in which motion below a tenth of the sample rate is all
but gone. Their squares drive a GARCH recursion or an exponential average (spec 5.2, 5.3, issue of
S000: averaged volatility and GARCH, on line).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from schuler.data import CHANNELS, ImuRecording
from schuler.errors import InputError, ModelError
from schuler.navigation.error_models.sensor_error_model import FILTER_CHANNELS
from schuler.types import FloatArray

# of the second difference of white noise: 1 + 4 + 1
SECOND_DIFFERENCE_POWER = 6.0
# scales are believed within this factor of the constant one, squared
LARGEST_RATIO = 1e4
DEFAULT_MEMORY = 1.0


@dataclass(frozen=True, slots=True)
class VarianceRecursion:
    """GARCH(1, 1) of a white noise, by its persistence: h = (1 - a - b) s² + a e² + b h."""

    # alpha, beta: weights of the last square and of the last variance; their sum at most one. A sum
    # of one is the exponential average, which needs no fit.
    alpha: float
    beta: float

    def __post_init__(self) -> None:
        if not (self.alpha >= 0.0 and self.beta >= 0.0 and self.alpha + self.beta <= 1.0 + 1e-12):
            raise ModelError(
                f"alpha {self.alpha:g}, beta {self.beta:g}",
                expected="zero or above, and a sum of at most one",
            )

    @classmethod
    def averaging(cls, memory: float, interval: float) -> VarianceRecursion:
        """Return the exponential average over a time."""
        if not (memory > 0.0 and interval > 0.0):
            raise ModelError(f"a memory of {memory:g} s", expected="above zero")
        beta = float(np.exp(-interval / memory))
        return cls(1.0 - beta, beta)

    @property
    def persistence(self) -> float:
        """How much of a deviation is left a sample later."""
        return self.alpha + self.beta


@dataclass(frozen=True, slots=True, eq=False)
class ChangingNoise:
    """How the white noise of every channel changes."""

    # by channel; channels that are not named stay constant.
    recursions: Mapping[str, VarianceRecursion]
    # by channel, what `rest_variance` finds where the noise is as loud as the constant density
    # says: of the static record that the density comes from. Default: of the recording itself, one
    # number a channel, so that the density is kept on average.
    reference: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        wrong = [c for c in (*self.recursions, *self.reference) if c not in CHANNELS]
        if wrong:
            raise InputError(f"channels {', '.join(wrong)}", expected=", ".join(CHANNELS))
        object.__setattr__(self, "recursions", dict(self.recursions))
        object.__setattr__(self, "reference", dict(self.reference))

    def white_scale(self, imu: ImuRecording) -> FloatArray:
        """Return what multiplies the squared white-noise densities, sample by sample."""
        scale = np.ones((imu.size, 6))
        for c, channel in enumerate(FILTER_CHANNELS):
            recursion = self.recursions.get(channel)
            if recursion is None:
                continue
            signal = imu.channel(channel)
            usual = self.reference.get(channel) or second_difference_variance(signal)
            if usual > 0.0:
                scale[:, c] = one_step_variance(signal, recursion, usual) / usual
        return np.clip(scale, 1.0 / LARGEST_RATIO, LARGEST_RATIO)

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {c: {"alpha": r.alpha, "beta": r.beta} for c, r in self.recursions.items()}


def one_step_variance(
    signal: FloatArray, recursion: VarianceRecursion, constant: float
) -> FloatArray:
    """Variance of the white noise in every sample, given the samples before it."""
    from schuler.estimation.garch.conditional_variance import garch_conditional_variance

    second = np.zeros(signal.size)
    second[2:] = np.diff(signal, 2) / np.sqrt(SECOND_DIFFERENCE_POWER)
    # nothing is known of the first two samples
    second[:2] = np.sqrt(constant)
    return garch_conditional_variance(
        second,
        max(1.0 - recursion.persistence, 0.0) * constant,
        recursion.alpha,
        recursion.beta,
        before=constant,
    )


def second_difference_variance(signal: FloatArray) -> float:
    """Mean square of the second differences over six: the variance of white noise in a signal."""
    if signal.size < 3:
        return 0.0
    return float(np.mean(np.diff(signal, 2) ** 2) / SECOND_DIFFERENCE_POWER)


def rest_variance(static: ImuRecording) -> dict[str, float]:
    """Return the reference of every channel from a static recording."""
    return {c: second_difference_variance(static.channel(c)) for c in CHANNELS}


def averaged_noise(
    interval: float,
    memory: float = DEFAULT_MEMORY,
    reference: Mapping[str, float] | None = None,
) -> ChangingNoise:
    """Let the noise of every channel follow the exponential average of its squares."""
    recursion = VarianceRecursion.averaging(memory, interval)
    return ChangingNoise(dict.fromkeys(CHANNELS, recursion), reference or {})


def fitted_noise(static: ImuRecording) -> ChangingNoise:
    """Fit a GARCH(1, 1) to the noise of every channel of a static recording."""
    from schuler.estimation.garch.fit import fit_garch

    found = {}
    for channel in CHANNELS:
        # differences take the slow bias away; a constant variance fits best where none changes
        fit = fit_garch(np.diff(static.channel(channel))[::2] / np.sqrt(2.0))
        if fit.converged and fit.alpha[0] > 3.0 * fit.standard_errors["alpha_1"]:
            persistence = float(fit.alpha[0] + fit.beta[0])
            # every second difference was seen: one step of the fit is two samples
            found[channel] = _halved(float(fit.alpha[0]), min(persistence, 1.0))
    return ChangingNoise(found, rest_variance(static))


def _halved(alpha: float, persistence: float) -> VarianceRecursion:
    """A recursion of half the step: the root of the persistence, and half the weight."""
    root = float(np.sqrt(persistence))
    return VarianceRecursion(0.5 * alpha, root - 0.5 * alpha)
