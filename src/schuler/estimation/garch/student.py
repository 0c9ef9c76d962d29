"""GARCH whose Z has Student's law: wild samples are held back, the tail is estimated (spec 5.2)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from schuler.estimation.garch.conditional_variance import garch_conditional_variance
from schuler.estimation.garch.differences import climb_samples
from schuler.estimation.garch.result import GarchFit
from schuler.types import FloatArray

_START = 8.0
_FEWEST, _NORMAL = 2.1, 200.0


def student_log_likelihoods(residual: FloatArray, variance: FloatArray, nu: float) -> FloatArray:
    """Log likelihood of every sample, Z of unit variance and `nu` degrees of freedom."""
    constant = math.lgamma(0.5 * (nu + 1.0)) - math.lgamma(0.5 * nu)
    constant -= 0.5 * math.log(math.pi * (nu - 2.0))
    ratio = residual**2 / (variance * (nu - 2.0))
    return np.asarray(constant - 0.5 * np.log(variance) - 0.5 * (nu + 1.0) * np.log1p(ratio))


def with_student(fit: GarchFit, residual: FloatArray) -> tuple[GarchFit, list[str]]:
    """Maximise Student's likelihood from a Gaussian fit; errors are sandwich and Hessian."""
    p, q = fit.order
    n, scale = residual.size, float(np.sqrt(fit.alpha0))
    small = 1e-8
    start = np.log(
        np.concatenate([[1.0], np.maximum(fit.alpha, small), np.maximum(fit.beta, small), [1.0]])
    )
    start[-1] = math.log(_START - 2.0)

    def samples(at: FloatArray) -> FloatArray:
        numbers = np.exp(at)
        variance = garch_conditional_variance(
            residual / scale, numbers[0], numbers[1 : p + 1], numbers[p + 1 : -1],
            before=fit.start_variance / scale**2,
        )  # fmt: skip
        return student_log_likelihoods(residual / scale, variance, 2.0 + float(numbers[-1]))

    def allowed(at: FloatArray) -> bool:
        return float(np.exp(at[1:-1]).sum()) < 1.0 - 1e-7

    high = np.full(start.size, np.inf)
    high[-1] = math.log(_NORMAL - 2.0)
    low = np.full(start.size, math.log(1e-12))
    low[-1] = math.log(_FEWEST - 2.0)
    found = climb_samples(samples, start, (low, high), allowed)
    numbers = np.exp(found.at) * np.concatenate([[scale**2], np.ones(p + q), [1.0]])
    back = np.outer(numbers, numbers)
    sandwich, plain = found.sandwich * back, found.hessian * back
    value = found.value - n * math.log(scale)
    count = p + q + 2
    nu = 2.0 + float(numbers[-1])
    errors, own = _named(sandwich, p, q), _named(plain, p, q)
    out = replace(
        fit,
        alpha0=float(numbers[0]),
        alpha=numbers[1 : p + 1],
        beta=numbers[p + 1 : -1],
        covariance=sandwich[:-1, :-1],
        standard_errors=errors,
        hessian_standard_errors=own,
        log_likelihood=value,
        aic=2.0 * count - 2.0 * value,
        bic=math.log(n) * count - 2.0 * value,
        converged=found.converged,
        degrees_of_freedom=nu,
        degrees_of_freedom_error=math.sqrt(max(float(sandwich[-1, -1]), 0.0)),
    )
    for key, estimate in out.values.items():
        if errors.get(key, 0.0) > 0.0:
            out.t_values[key] = estimate / errors[key]
            out.p_values[key] = math.erfc(abs(out.t_values[key]) / math.sqrt(2.0))
    flags = [] if found.converged else ["the search for Student's likelihood did not converge"]
    if nu > 0.5 * _NORMAL:
        flags.append("Z is normal: Student's law has nothing to add")
    return out, flags


def _named(covariance: FloatArray, p: int, q: int) -> dict[str, float]:
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    return {
        "alpha0": float(spread[0]),
        **{f"alpha_{i}": float(spread[i]) for i in range(1, p + 1)},
        **{f"beta_{j}": float(spread[p + j]) for j in range(1, q + 1)},
        "persistence": math.sqrt(max(float(covariance[1:-1, 1:-1].sum()), 0.0)),
    }
