"""The relatives of the Allan deviation: non-overlapping, modified, Hadamard and the total kinds.

All of them read rate-like samples, take one pass a cluster time, and come with intervals from
their own degrees of freedom (NIST SP 1065, sections 5.2 to 5.4).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.curves.allan_curve import AllanCurve, default_factors
from schuler.curves.allan_family_confidence import (
    Kind,
    family_degrees_of_freedom,
    variance_bias,
)
from schuler.curves.confidence import chi_square_bounds, local_slope, not_by_chance
from schuler.curves.finite_signal import checked_rate, finite_samples
from schuler.errors import InputError
from schuler.types import FloatArray

KINDS: tuple[Kind, ...] = (
    "nonoverlapping",
    "modified",
    "hadamard",
    "total",
    "modified total",
    "hadamard total",
)
_CLUSTERS: dict[str, int] = {
    "nonoverlapping": 2,
    "modified": 3,
    "hadamard": 3,
    "total": 2,
    "modified total": 3,
    "hadamard total": 3,
}
_LONGEST_FRACTION = {"total": 3, "modified total": 5, "hadamard total": 5}
_WINDOWS_A_CLUSTER = 4


def family_deviation(
    signal: ArrayLike,
    rate: float,
    taus: ArrayLike | None = None,
    kind: Kind = "modified",
) -> AllanCurve:
    """Return a relative of the Allan deviation with 95 % intervals at every cluster time."""
    if kind not in KINDS:
        raise InputError(
            f"Allan deviation of kind '{kind}'", expected=", ".join(("overlapping", *KINDS))
        )
    data = finite_samples(signal, shortest=4, columns=True)
    rate = checked_rate(rate)
    columns = data.reshape(len(data), -1)
    samples = len(data)
    factors = _wanted_factors(taus, samples, rate, kind)
    tau = factors / rate
    variance = np.column_stack(
        [_column(columns[:, j], factors, kind) for j in range(len(columns[0]))]
    )
    slopes = np.column_stack([local_slope(tau, v) for v in variance.T])
    if not kind.startswith("modified"):
        slopes = not_by_chance(slopes, factors, samples)
    freedom = family_degrees_of_freedom(kind, slopes, factors, samples)
    bias = variance_bias(kind, slopes, factors, samples)
    deviation = np.sqrt(variance)
    down, up = chi_square_bounds(freedom)
    unbiased = deviation / np.sqrt(bias)
    shape = (factors.size,) if data.ndim == 1 else deviation.shape
    return AllanCurve(
        tau=tau,
        deviation=deviation.reshape(shape),
        lower=(unbiased * down).reshape(shape),
        upper=(unbiased * up).reshape(shape),
        degrees_of_freedom=freedom.reshape(shape),
        rate=rate,
        samples=samples,
        kind=kind,
    )


def _wanted_factors(
    taus: ArrayLike | None, samples: int, rate: float, kind: Kind
) -> NDArray[np.int64]:
    longest = samples // _CLUSTERS[kind]
    if taus is None:
        factors = default_factors(samples)
        if kind in _LONGEST_FRACTION:
            more = default_factors(9 * max(samples // _LONGEST_FRACTION[kind], 1))
            factors = np.unique(np.concatenate([factors, more[more > factors[-1]]]))
        return np.asarray(factors[factors <= longest])
    wanted = np.atleast_1d(np.asarray(taus, dtype=np.float64))
    if wanted.ndim != 1 or not np.isfinite(wanted).all() or (wanted <= 0.0).any():
        raise InputError("cluster times are not all above zero", expected="finite seconds")
    wanted = wanted[wanted * rate <= samples]
    factors = np.unique(np.round(wanted * rate).astype(np.int64))
    factors = factors[(factors >= 1) & (factors <= longest)]
    if factors.size == 0:
        raise InputError(
            "no cluster time fits the record",
            expected=f"times from {1.0 / rate:g} to {longest / rate:g} s",
        )
    return np.asarray(factors)


def _column(column: FloatArray, factors: NDArray[np.int64], kind: Kind) -> FloatArray:
    """Variances of one signal at every cluster length."""
    # no kind sees a constant, and without it the running sum keeps its digits
    centred = np.ascontiguousarray(column - column.mean())
    if column.min() == column.max():
        return np.zeros(factors.size)
    theta = np.concatenate([[0.0], np.cumsum(centred)])
    if kind == "total":
        theta = _reflected(theta)
    return np.array([_variance(kind, centred, theta, int(m)) for m in factors])


def _reflected(theta: FloatArray) -> FloatArray:
    """Theta continued at both ends through its end points (Howe 1995)."""
    inner = theta[-2:0:-1]
    return np.concatenate([2.0 * theta[0] - inner, theta, 2.0 * theta[-1] - inner])


def _variance(kind: Kind, signal: FloatArray, theta: FloatArray, m: int) -> float:
    from schuler.kernels.noise import allan_family as sums

    if kind == "nonoverlapping":
        at = theta[::m]
        terms = at.size - 2
        total = sums.sum_squared_second_differences(at[:-2], at[1:-1], at[2:])
        return float(total / (2.0 * m * m * terms))
    if kind == "modified":
        terms = theta.size - 3 * m + 1
        return float(sums.sum_squared_averaged_differences(theta, m) / (2.0 * m * m * terms))
    if kind == "hadamard" or (kind == "hadamard total" and m == 1):
        terms = theta.size - 3 * m
        total = sums.sum_squared_third_differences(
            theta[:terms], theta[m : terms + m], theta[2 * m : terms + 2 * m], theta[3 * m :]
        )
        return float(total / (6.0 * m * m * terms))
    if kind == "total":
        inside = (theta.size + 4) // 3 - 2
        start = inside + 1  # the second value of the record itself
        total = sums.sum_squared_second_differences(
            theta[start - m : start - m + inside],
            theta[start : start + inside],
            theta[start + m : start + m + inside],
        )
        return float(total / (2.0 * m * m * inside))
    step = max(1, m // _WINDOWS_A_CLUSTER)
    if kind == "modified total":
        return float(sums.mean_square_of_total_windows(theta, m, step) / (2.0 * m * m))
    return float(sums.mean_square_of_total_windows(signal, m, step) / 6.0)
