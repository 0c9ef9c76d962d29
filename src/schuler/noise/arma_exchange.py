"""ARMA(p, q) and white noise + Gauss-Markov noises: the exact change, both ways.

White noise plus k Gauss-Markov noises, sampled, is an ARMA(k, k) with real positive poles, and
without the white noise an ARMA(k, k - 1); spec 5.1.
"""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from schuler.errors import ModelError
from schuler.noise._checks import positive
from schuler.noise.arma import ARMA
from schuler.noise.base import Process, ProcessSum
from schuler.noise.gauss_markov import BiasInstability, GaussMarkov
from schuler.noise.white import WhiteNoise
from schuler.types import FloatArray

_NO_WHITE = 1e-12
_SAME_POLE = 1e-9


def arma_to_gauss_markov_sum(arma: ARMA) -> ProcessSum:
    """Write an ARMA process as white noise and Gauss-Markov noises, where that is possible.

    Parameters
    ----------
    arma : ARMA
        With distinct real poles between 0 and 1.

    Returns
    -------
    ProcessSum
        White noise and one Gauss-Markov noise for each pole: states of a navigation filter.

    Raises
    ------
    ModelError
        Poles that no Gauss-Markov noise has, or parts of negative variance.

    Notes
    -----
    Partial fractions of the spectrum; Granger and Morris 1976.

    Examples
    --------
    >>> import schuler
    >>> arma = schuler.ARMA((1.666, -0.671), (-1.086, 0.160), 1.0, 0.01)
    >>> len(schuler.arma_to_gauss_markov_sum(arma).components)
    3
    """
    dt = arma.interval
    phi, theta = _trimmed(arma.phi), _trimmed(arma.theta)
    if theta.size > phi.size:
        raise ModelError(
            f"ARMA({phi.size}, {theta.size}) has more moving-average than autoregressive terms",
            expected="q <= p, as white noise + Gauss-Markov noises have",
        )
    if phi.size == 0:
        return ProcessSum((WhiteNoise(math.sqrt(arma.driving_variance * dt)),))
    poles = _real_poles(arma)
    moving_average = np.concatenate([theta[::-1], [1.0]])
    total = arma.driving_variance
    white = -total * theta[-1] / phi[-1] if theta.size == phi.size else 0.0
    variances = []
    for i, pole in enumerate(poles):
        others = np.delete(poles, i)
        numerator = np.polyval(moving_average, pole) * np.polyval(moving_average, 1.0 / pole)
        denominator = np.prod(1.0 - others / pole) * np.prod(1.0 - poles * pole)
        variances.append(float(total * numerator / denominator))
    smallest = _NO_WHITE * max(map(abs, [*variances, white]))
    parts: list[Process] = []
    if white < -smallest:
        raise ModelError(
            f"the white part of the ARMA process would have the variance {white:.4g}",
            expected="a positive variance",
            cure="keep the ARMA process, or fit a sum of processes",
        )
    if white > smallest:
        parts.append(WhiteNoise(math.sqrt(white * dt)))
    for pole, variance in zip(poles, variances, strict=True):
        if variance < -smallest:
            raise ModelError(
                f"the Gauss-Markov noise of pole {pole:.6g} would have the variance {variance:.4g}",
                expected="positive variances",
                cure="keep the ARMA process, or fit a sum of processes",
            )
        if variance > smallest:
            parts.append(GaussMarkov(math.sqrt(variance), -dt / math.log(pole)))
    return ProcessSum(tuple(parts))


def _trimmed(coefficients: tuple[float, ...]) -> FloatArray:
    return np.trim_zeros(np.array(coefficients, dtype=np.float64), "b")


def _real_poles(arma: ARMA) -> FloatArray:
    poles = poles_refined(arma)
    for pole in poles:
        if abs(pole.imag) > _SAME_POLE * abs(pole):
            raise ModelError(
                f"ARMA process with the complex poles {pole.real:.6g} ± {abs(pole.imag):.6g}i",
                expected="real positive poles",
                cure="it oscillates: no sum of Gauss-Markov noises does",
            )
        if pole.real <= 0.0:
            raise ModelError(
                f"ARMA process with the pole {pole.real:.6g}",
                expected="real positive poles",
                cure="it alternates in sign: no sum of Gauss-Markov noises does",
            )
    real = np.sort(poles.real)[::-1]
    for first, second in pairwise(real):
        if first - second <= _SAME_POLE * first:
            raise ModelError(
                f"ARMA process with the double pole {first:.6g}", expected="distinct poles"
            )
    return np.asarray(real, dtype=np.float64)


def poles_refined(arma: ARMA) -> NDArray[np.complex128]:
    """Poles other than zero, each improved by Newton steps on the polynomial."""
    polynomial = np.concatenate([[1.0], -_trimmed(arma.phi)])
    slope = np.polyder(polynomial)
    roots = np.roots(polynomial).astype(np.complex128)
    for _ in range(3):
        steep = np.polyval(slope, roots)
        step = np.polyval(polynomial, roots) / np.where(steep == 0.0, 1.0, steep)
        roots = np.where(np.abs(step) < 1e-6, roots - step, roots)
    return roots


def gauss_markov_sum_to_arma(process: Process, dt: float) -> ARMA:
    """Write white noise + Gauss-Markov noises, sampled every `dt` seconds, as one ARMA process."""
    white, parts = _collect(process, positive(dt, "dt"))
    if not parts and white == 0.0:
        raise ModelError("a process of variance zero", expected="something that varies")
    step = np.array([dt / time for time in sorted(parts, reverse=True)])
    variance = np.array([parts[time] for time in sorted(parts, reverse=True)])
    poles, losses = np.exp(-step), -np.expm1(-step)
    strength = -variance * np.expm1(-2.0 * step)
    zeros = _bracketed_zeros(poles, losses, strength, white)
    phi = -np.poly(poles)[1:] if poles.size else np.zeros(0)
    theta = np.poly(zeros)[1:] if zeros.size else np.zeros(0)
    # at z = -1 every factor is of the order of one
    spectrum = white + float(np.sum(strength / (1.0 + poles) ** 2))
    driving = spectrum * float(np.prod((1.0 + poles) ** 2) / np.prod((1.0 + zeros) ** 2))
    return ARMA(tuple(phi.tolist()), tuple(theta.tolist()), driving, dt)


def _collect(process: Process, dt: float) -> tuple[float, dict[float, float]]:
    """Variance of a white sample, and variances by correlation time."""
    white = 0.0
    parts: dict[float, float] = {}
    for part in process.components:
        noises: tuple[GaussMarkov, ...] = ()
        if isinstance(part, WhiteNoise):
            white += part.density**2 / dt
        elif isinstance(part, GaussMarkov):
            noises = (part,)
        elif isinstance(part, BiasInstability):
            noises = part.gauss_markovs
        else:
            raise ModelError(
                f"a process of kind '{part.kind}' has no ARMA form here",
                expected="white noise, Gauss-Markov noise, bias instability",
            )
        for noise in noises:
            if noise.sigma > 0.0:
                time = noise.correlation_time
                parts[time] = parts.get(time, 0.0) + noise.sigma**2
    return white, parts


def _bracketed_zeros(
    poles: FloatArray, losses: FloatArray, strength: FloatArray, white: float
) -> FloatArray:
    """Zeros inside the unit circle, slowest first."""
    from scipy.optimize import brentq

    if poles.size == 0:
        return np.zeros(0)
    corners = losses**2 / poles

    def spectrum(a: float) -> float:
        return white + float(np.sum(strength / (losses**2 - poles * a)))

    found = []
    for i in range(poles.size - (0 if white > 0.0 else 1)):
        low = float(corners[i])
        if i + 1 < poles.size:
            high = float(corners[i + 1])
        else:
            # far enough for the white part to win
            high = low + float(np.sum(strength / poles)) / white * 2.0 + low
        span = high - low
        inner_low, inner_high = low + 1e-15 * span, high - 1e-15 * span
        inner_low, inner_high = (
            max(inner_low, np.nextafter(low, high)),
            min(inner_high, np.nextafter(high, low)),
        )
        a = float(brentq(spectrum, inner_low, inner_high, xtol=1e-300, rtol=1e-15, maxiter=500))
        # (1 - zero)² = a zero; the root between 0 and 1, without cancellation
        found.append(1.0 - 0.5 * (math.sqrt(a * a + 4.0 * a) - a))
    return np.array(found)
