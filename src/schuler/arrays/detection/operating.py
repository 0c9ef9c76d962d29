"""Operating curves: what share of faults is found, and blamed rightly, at what false-alarm rate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from schuler.arrays.detection.thresholds import likelihood_statistics
from schuler.arrays.geometry import Geometry
from schuler.arrays.merit import figures_of_merit
from schuler.types import FloatArray

RATES = tuple(np.logspace(-4, np.log10(0.5), 40).tolist())


@dataclass(frozen=True, slots=True, eq=False)
class OperatingCurve:
    """Tests of one sample against a step on one axis.

    Parameters
    ----------
    false_alarm_rate : (r,) ndarray
        Probability of an alarm in a sample without fault.
    chi_square_power : (r,) ndarray
        Probability that D exceeds its threshold, by the non-central chi-square law.
    likelihood_power : (r,) ndarray
        Probability that the largest axis statistic exceeds its threshold, simulated.
    right_axis : (r,) ndarray
        Of the faults found by it, the share that is blamed on the right axis.
    right_unit : (r,) ndarray
        Of the same, the share blamed on an axis of the right unit.
    size : float
        Of the fault, in standard deviations of the axis.
    axis : int
        Which axis.
    """

    false_alarm_rate: FloatArray
    chi_square_power: FloatArray
    likelihood_power: FloatArray
    right_axis: FloatArray
    right_unit: FloatArray
    size: float
    axis: int


def chi_square_power(
    geometry: Geometry, axis: int, size: ArrayLike, false_alarm_rate: ArrayLike
) -> FloatArray:
    """Return the probability that the chi-square test sees a step on one axis.

    Parameters
    ----------
    geometry : Geometry
        Axes of the sensors.
    axis : int
        Which axis fails, from 0.
    size : float or array_like
        Of the step, in standard deviations of the axis.
    false_alarm_rate : float or array_like
        Of the test, 0 to 1.

    Returns
    -------
    ndarray
        Of the shape of `size` and `false_alarm_rate` together, 0 to 1.

    Notes
    -----
    Non-central chi-square with the share of the step that shows in the residuals; S002 (2), (3).

    Examples
    --------
    >>> import schuler
    >>> four = schuler.Geometry.from_mounting(schuler.tetrahedron_mounting())
    >>> round(float(schuler.chi_square_power(four, 0, 5.0, 0.05)), 2)
    0.88
    """
    from scipy.stats import chi2, ncx2

    share = figures_of_merit(geometry).residual_share[axis]
    rate = np.asarray(false_alarm_rate, dtype=np.float64)
    threshold = chi2.isf(rate, geometry.redundancy)
    # SciPy's law is poor at zero, where it is the central one
    shift = np.maximum(np.asarray(size, dtype=np.float64) ** 2 * share, 1e-12)
    return np.asarray(ncx2.sf(threshold, geometry.redundancy, shift), dtype=np.float64)


def operating_curve(
    geometry: Geometry,
    size: float,
    *,
    axis: int = 0,
    rates: ArrayLike = RATES,
    draws: int = 100_000,
    seed: int = 0,
) -> OperatingCurve:
    """Return what the tests do against a step on one axis."""
    rate = np.asarray(rates, dtype=np.float64)
    rng = np.random.default_rng(seed)
    healthy, _ = likelihood_statistics(rng.standard_normal((draws, geometry.count)), geometry)
    noise = rng.standard_normal((draws, geometry.count))
    noise[:, axis] += size
    faulty, _ = likelihood_statistics(noise, geometry)
    threshold = np.quantile(healthy.max(axis=1), 1.0 - rate)
    largest = faulty.max(axis=1, keepdims=True)
    found = largest > threshold
    number = np.maximum(found.sum(axis=0), 1)
    # of axes that look alike each is blamed in turn
    blamed = faulty >= largest * (1.0 - 1e-9)
    share = blamed / blamed.sum(axis=1, keepdims=True)
    right_unit = share[:, geometry.units == geometry.units[axis]].sum(axis=1)
    return OperatingCurve(
        rate,
        chi_square_power(geometry, axis, size, rate),
        np.asarray(found.mean(axis=0)),
        np.asarray(share[:, axis] @ found / number),
        np.asarray(right_unit @ found / number),
        size,
        axis,
    )
