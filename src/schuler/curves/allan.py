"""The overlapping Allan deviation, with honest intervals."""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.curves.allan_curve import AllanCurve, default_factors
from schuler.curves.allan_family import family_deviation
from schuler.curves.confidence import (
    chi_square_bounds,
    local_slope,
    not_by_chance,
    power_law_degrees_of_freedom,
)
from schuler.curves.finite_signal import too_large
from schuler.data._checks import numbers
from schuler.errors import InputError
from schuler.types import FloatArray

_BLOCK = 4096
_WORK_BYTES = 64 * 2**20


def allan_deviation(
    signal: ArrayLike,
    rate: float,
    taus: ArrayLike | None = None,
    kind: Literal[
        "overlapping",
        "nonoverlapping",
        "modified",
        "hadamard",
        "total",
        "modified total",
        "hadamard total",
    ] = "overlapping",
) -> AllanCurve:
    """Return the Allan deviation, or a relative, with 95 % intervals at every cluster time.

    Parameters
    ----------
    signal : (n,) or (n, m) array_like
        Rate-like samples (angular rate, specific force), one signal a column. Work memory is
        below 70 MB or one column, whichever is more; the data are not copied as a whole.
    rate : float
        Samples a second.
    taus : array_like, optional
        Wanted cluster times in s; each is taken to the nearest number of samples, those that the
        record cannot hold twice are dropped. Default: about 20 a decade up to a ninth of the
        record.
    kind : str
        Estimator; all but "overlapping" are those of
        `schuler.curves.allan_family.family_deviation`.

    Returns
    -------
    AllanCurve
        Arrays (t,) for an (n,) signal and (t, m) for (n, m).

    Raises
    ------
    InputError
        Not finite, fewer than 3 samples, more than two dimensions, an impossible rate, or no tau
        that fits.

    Notes
    -----
    Spec 2.3; S004 (13). The intervals take the degrees of freedom of the noise whose slope the
    curve has about each tau.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import allan_deviation
    >>> rate = np.random.default_rng(1).standard_normal(10_000)
    >>> curve = allan_deviation(rate, 100.0, taus=[0.01, 1.0])
    >>> curve.deviation.round(2)
    array([1.  , 0.09])
    """
    if kind != "overlapping":
        return family_deviation(signal, rate, taus, kind)
    data = numbers(signal, "signal")
    if data.ndim not in (1, 2):
        raise InputError(f"signal has shape {data.shape}", expected="numbers (n,) or (n, m)")
    if len(data) < 3:
        raise InputError(f"signal has {len(data)} samples", expected="at least 3")
    if not (np.isfinite(rate) and rate > 0.0):
        raise InputError(f"rate is {rate:g} Hz", expected="a finite number above zero")
    factors = _factors(taus, len(data), float(rate))
    columns = data.reshape(len(data), -1)
    variance = _variances(columns, factors)
    tau = factors / rate
    slopes = np.column_stack([local_slope(tau, v) for v in variance.T])
    slopes = not_by_chance(slopes, factors, len(data))
    freedom = power_law_degrees_of_freedom(slopes, factors, len(data))
    deviation = np.sqrt(variance)
    down, up = chi_square_bounds(freedom)
    shape = (factors.size,) if data.ndim == 1 else deviation.shape
    return AllanCurve(
        tau=tau,
        deviation=deviation.reshape(shape),
        lower=(deviation * down).reshape(shape),
        upper=(deviation * up).reshape(shape),
        degrees_of_freedom=freedom.reshape(shape),
        rate=float(rate),
        samples=len(data),
    )


def _factors(taus: ArrayLike | None, samples: int, rate: float) -> NDArray[np.int64]:
    if taus is None:
        return default_factors(samples)
    wanted = np.atleast_1d(np.asarray(taus, dtype=np.float64))
    if wanted.ndim != 1 or not np.isfinite(wanted).all() or (wanted <= 0.0).any():
        raise InputError("cluster times are not all above zero", expected="finite seconds")
    # a running sum of n samples has n + 1 values, so 2 * factor <= n
    wanted = wanted[wanted * rate <= samples]
    factors = np.unique(np.round(wanted * rate).astype(np.int64))
    factors = factors[(factors >= 1) & (2 * factors <= samples)]
    if factors.size == 0:
        raise InputError(
            "no cluster time fits the record",
            expected=f"times from {1.0 / rate:g} to {samples / 2 / rate:g} s",
        )
    return np.asarray(factors)


def _variances(columns: NDArray[np.generic], factors: NDArray[np.int64]) -> FloatArray:
    """Allan variances of the columns, in the signal's unit squared."""
    from schuler.kernels.noise.allan import allan_sums, integrate

    n, count = columns.shape
    group = max(1, min(count, _WORK_BYTES // (8 * (n + 1))))
    theta = np.empty((group, n + 1))
    sums, out = np.empty(factors.size), np.empty((factors.size, count))
    terms = 2.0 * factors.astype(np.float64) ** 2 * (n + 1 - 2 * factors)
    for start in range(0, count, group):
        part = columns[:, start : start + group]
        if part.dtype != np.float64:
            part = part.astype(np.float64)
        values = np.asarray(part, dtype=np.float64)
        # second differences do not see a constant: a mean of some samples keeps the sums small
        offset = values[:: max(1, n // 4096)].mean(axis=0)
        integrate(values, offset, theta)
        for j in range(values.shape[1]):
            if not np.isfinite(theta[j, -1]):
                _refuse(values[:, j], start + j)
            allan_sums(theta[j], factors, sums, _BLOCK)
            if not np.isfinite(sums).all():
                raise too_large()
            out[:, start + j] = sums / terms
    return out


def _refuse(column: FloatArray, index: int) -> None:
    bad = np.flatnonzero(~np.isfinite(column))
    raise InputError(
        f"signal holds {bad.size} samples that are not finite, the first at row "
        f"{bad[0] if bad.size else 0} of column {index}",
        expected="finite numbers",
        cure="remove or repair these rows first",
    )
