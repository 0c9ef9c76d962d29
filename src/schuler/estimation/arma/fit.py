"""ARMA models of a signal by exact maximum likelihood, with errors that can be trusted."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import EstimationError, InputError
from schuler.estimation.arma.likelihood import Likelihood, innovations, scores, split
from schuler.estimation.arma.result import ArmaCandidate, ArmaFit
from schuler.estimation.arma.search import Climb, search
from schuler.estimation.residuals.tests import ResidualTests, residual_tests
from schuler.estimation.signals import checked_signal, outlier_flag
from schuler.noise.arma import poles_of, zeros_of
from schuler.types import FloatArray

__all__ = ["ArmaCandidate", "ArmaFit", "fit_arma"]

ErrorKind = Literal["outer_product", "information", "robust"]
Mean = Literal["ml", "sample", "zero"]

CONVERGED = 1e-6
"""Squared distance to the maximum, in standard errors, up to which a fit counts as converged."""
UNIT_ROOT = 1e-4
COMMON_FACTOR = 0.02
_COMMON_FACTOR_GAIN = 15.0
_RECORD_OF_A_POLE = 10.0
_FORESEEN = 1e-26


def fit_arma(
    signal: ArrayLike,
    p: int,
    q: int,
    *,
    rate: float = 1.0,
    errors: ErrorKind = "outer_product",
    mean: Mean = "ml",
) -> ArmaFit:
    """Fit an ARMA(p, q) with a mean by exact Gaussian maximum likelihood.

    Parameters
    ----------
    signal : (n,) array_like
        Samples in any unit u; scaled inside.
    p, q : int
        Number of autoregressive and moving-average coefficients.
    rate : float
        Samples a second; only `process` depends on it.
    errors : {"outer_product", "information", "robust"}
        Where standard errors come from: the outer product of the scores, the expected
        information, or the sandwich of both, which alone is right when the variance of the
        innovations changes with time. The sandwich is always in `robust_standard_errors`.
    mean : {"ml", "sample", "zero"}
        Estimated with the coefficients, taken off beforehand, or known to be zero.

    Returns
    -------
    ArmaFit
        Stationary and invertible; read its flags.

    Raises
    ------
    InputError
        Not one-dimensional, not finite, negative orders.
    EstimationError
        Too few samples for the order, or a signal that does not vary.

    Notes
    -----
    Spec 5.1, S000 (10) and (11). Hannan-Rissanen and other starts are compared on a segment; the
    best are refined on the whole record by Gauss-Newton steps, each judged by the exact
    likelihood, until the slope of the exact likelihood is zero.

    Examples
    --------
    >>> from schuler import ARMA, fit_arma
    >>> import numpy as np
    >>> noise = ARMA(phi=(-0.9,), theta=(0.4,), driving_variance=1.0, interval=1.0)
    >>> fit = fit_arma(noise.simulate(20_000, 1.0, np.random.default_rng(1)), 1, 1)
    >>> bool(abs(abs(fit.phi[0]) - 0.9) < 3.0 * fit.robust_standard_errors["phi_1"])
    True
    """
    check_orders(p, q)
    values = checked_signal(signal, 10 + 5 * (p + q))
    if mean not in get_args(Mean):
        raise InputError(f"mean '{mean}'", expected="'ml', 'sample' or 'zero'")
    scaled = Scaled.of(values, rate, zero=mean == "zero")
    best = search(scaled.unit, p, q, known_mean=mean != "ml")
    return finish(scaled, best, p, errors, _cancelling(scaled.unit, best, p), zero=mean == "zero")


def check_orders(p: int, q: int) -> None:
    """Raise unless both orders are whole numbers, zero or above."""
    if int(p) != p or int(q) != q or p < 0 or q < 0:
        raise InputError(f"orders ({p}, {q})", expected="whole numbers, zero or above")


@dataclass(frozen=True, slots=True)
class Scaled:
    """A signal of mean zero and variance one, and how it came to be that."""

    unit: FloatArray
    centre: float
    scale: float
    rate: float

    @classmethod
    def of(cls, values: FloatArray, rate: float, *, zero: bool = False) -> Scaled:
        """Scale a signal; one whose mean is known to be zero is not centred."""
        centre, scale = float(values.mean()), float(values.std())
        if zero:
            centre, scale = 0.0, math.hypot(scale, centre)
        return cls((values - centre) / scale, centre, scale, rate)


def finish(
    signal: Scaled,
    best: Climb,
    p: int,
    errors: ErrorKind,
    warnings: tuple[str, ...] = (),
    candidates: tuple[ArmaCandidate, ...] = (),
    *,
    zero: bool = False,
) -> ArmaFit:
    """Turn the maximum of a scaled signal into estimates with errors, tests and flags."""
    unit, scale = signal.unit, signal.scale
    n, k = unit.size, best.coefficients.size
    phi, theta = split(best.coefficients, p)
    _, information, outer = scores(unit, best.coefficients, p, best.at)
    if not (np.isfinite(information).all() and np.isfinite(outer).all()) or (
        best.at.variance < _FORESEEN
    ):
        raise EstimationError(
            f"ARMA({p}, {k - p}) foresees the signal without error: it is not noise",
            expected="noise",
            cure="take off the ramp, step or sinusoid that it is",
        )
    first = 1 if zero else 0
    covariances, singular = _covariances(information[first:, first:], outer[first:, first:])
    covariances = {name: np.pad(c, (first, 0)) for name, c in covariances.items()}
    if errors not in covariances:
        raise InputError(f"errors '{errors}'", expected=f"one of {', '.join(covariances)}")
    back = np.concatenate([[scale], np.ones(k), [scale**2]])
    chosen = covariances[errors] * np.outer(back, back)
    robust = covariances["robust"] * np.outer(back, back)
    mean = signal.centre + scale * best.at.mean
    gain = 1.0 - float(phi.sum())
    standard_errors = _named_errors(chosen, p, k - p, mean, gain)
    residual = innovations(unit - best.at.mean, best.coefficients, p).residual
    tests = residual_tests(residual, fitted_parameters=k)
    value = best.at.value - n * math.log(scale)
    fit = ArmaFit(
        phi=phi,
        theta=theta,
        mean=mean,
        constant=mean * gain,
        innovation_variance=best.at.variance * scale**2,
        covariance=chosen,
        standard_errors=standard_errors,
        robust_standard_errors=_named_errors(robust, p, k - p, mean, gain),
        t_values={},
        p_values={},
        log_likelihood=value,
        aic=2.0 * (k + 2 - first) - 2.0 * value,
        bic=math.log(n) * (k + 2 - first) - 2.0 * value,
        samples=n,
        rate=signal.rate,
        converged=_converged(best, p, n) and not singular,
        flags=(*warnings, *_flags(best, p, residual, tests, singular)),
        diagnostics=tests,
        candidates=candidates,
    )
    for key, estimate in fit.values.items():
        if key != "innovation_variance" and not (zero and key in ("mean", "constant")):
            t = estimate / standard_errors[key]
            fit.t_values[key] = t
            fit.p_values[key] = math.erfc(abs(t) / math.sqrt(2.0))
    return fit


def _covariances(information: FloatArray, outer: FloatArray) -> tuple[dict[str, FloatArray], bool]:
    """Covariances by kind, and whether some direction of the parameters is not determined."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(information), 1e-300))
    by = np.outer(scale, scale)
    inverses, singular = [], False
    for matrix in (information, outer):
        values, vectors = np.linalg.eigh(matrix * by)
        singular = singular or bool(values[0] < 1e-9 * values[-1])
        values = np.maximum(values, 1e-12 * values[-1])
        inverses.append((vectors / values) @ vectors.T * by)
    expected, product = inverses
    sandwich = expected @ outer @ expected
    return {"outer_product": product, "information": expected, "robust": sandwich}, singular


def _named_errors(
    covariance: FloatArray, p: int, q: int, mean: float, gain: float
) -> dict[str, float]:
    spread = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    # constant = mean (1 - sum phi)
    slope = np.concatenate([[gain], np.full(p, -mean), np.zeros(q + 1)])
    constant = math.sqrt(max(float(slope @ covariance @ slope), 1e-300))
    return {
        **{f"phi_{i}": float(spread[i]) for i in range(1, p + 1)},
        **{f"theta_{j}": float(spread[p + j]) for j in range(1, q + 1)},
        "mean": float(spread[0]),
        "constant": constant,
        "innovation_variance": float(spread[-1]),
    }


def _converged(best: Climb, p: int, n: int) -> bool:
    """Zero slope, and no root so near the circle that the maximum is not inside."""
    phi, theta = split(best.coefficients, p)
    slowest = max((float(abs(r[0])) for r in (poles_of(phi), zeros_of(theta)) if r.size), default=0)
    return best.distance < CONVERGED and 1.0 - slowest > 1e-6 and n * (1.0 - slowest) > 1.0


def _flags(
    best: Climb, p: int, residual: FloatArray, tests: ResidualTests | None, singular: bool
) -> tuple[str, ...]:
    flags = []
    n = residual.size
    if best.distance >= CONVERGED:
        flags.append("not converged: the likelihood still rises")
    if singular:
        flags.append("not identified: some combination of the coefficients is not determined")
    flags += edge_flags(best.coefficients, p, n)
    outlier = outlier_flag(residual)
    if outlier:
        flags.append(outlier)
    if tests and tests.arch_lm.p_value < 1e-3:
        flags.append(
            "changing variance: the innovations are heteroskedastic (ARCH-LM "
            f"p = {tests.arch_lm.p_value:.1g}); use robust_standard_errors, fit a GARCH"
        )
    if tests and tests.ljung_box_robust.p_value < 1e-3:
        flags.append(
            "correlation left: the innovations are not white (robust Ljung-Box "
            f"p = {tests.ljung_box_robust.p_value:.1g}); try higher orders"
        )
    return tuple(flags)


def edge_flags(coefficients: FloatArray, p: int, n: int) -> list[str]:
    """Say which roots are too near the unit circle for the record."""
    phi, theta = split(coefficients, p)
    limit = max(UNIT_ROOT, _RECORD_OF_A_POLE / n)
    flags = []
    if phi.size and 1.0 - abs(poles_of(phi)[0]) < limit:
        flags.append(
            f"unit root: a pole of modulus {abs(poles_of(phi)[0]):.8f} cannot be told from a "
            "random walk or ramp by this record; remove the trend or model a RandomWalk"
        )
    if theta.size and 1.0 - abs(zeros_of(theta)[0]) < UNIT_ROOT:
        flags.append(
            f"unit zero: a zero of modulus {abs(zeros_of(theta)[0]):.8f} lies on the unit circle; "
            "the signal was differenced once too often or has a constant part taken out"
        )
    return flags


def nearest_pair(coefficients: FloatArray, p: int) -> tuple[float, complex, complex]:
    """Distance between the closest pole and zero, and both; infinite if there is no pair."""
    phi, theta = split(coefficients, p)
    if not (phi.size and theta.size):
        return math.inf, 0j, 0j
    poles, zeros = poles_of(phi), zeros_of(theta)
    apart = np.abs(poles[:, None] - zeros[None, :])
    i, j = np.unravel_index(int(np.argmin(apart)), apart.shape)
    return float(apart[i, j]), complex(poles[i]), complex(zeros[j])


def is_common_factor(distance: float, at: Likelihood, without: Likelihood) -> bool:
    """Tell whether a close pair of pole and zero may be taken out.

    A slow Gauss-Markov noise under much white noise is a close pair too, but one that the
    likelihood holds on to; a pair that cancels gains next to nothing.
    """
    return distance <= COMMON_FACTOR and 2.0 * (at.value - without.value) < _COMMON_FACTOR_GAIN


def _cancelling(unit: FloatArray, best: Climb, p: int) -> tuple[str, ...]:
    """Say so where a pole and a zero cancel."""
    distance, pole, zero = nearest_pair(best.coefficients, p)
    if distance > COMMON_FACTOR:
        return ()
    q = best.coefficients.size - p
    smaller = search(unit, p - 1, q - 1, rough=True, known_mean=best.at.known_mean)
    if not is_common_factor(distance, best.at, smaller.at):
        return ()
    return (
        f"common factor: pole {pole:.4f} and zero {zero:.4f} cancel, "
        f"ARMA({p}, {q}) reduces to ARMA({p - 1}, {q - 1})",
    )
