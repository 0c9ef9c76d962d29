"""Thresholds of parity tests: from the false-alarm rate, and from labelled faults as in S002."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from schuler.arrays.geometry import Geometry
from schuler.arrays.synthesis.least_squares import least_squares
from schuler.errors import InputError
from schuler.types import FloatArray

Fault = Literal["axis", "unit"]
Criterion = Literal["counts", "probabilities"]


def chi_square_threshold(deviation: float, false_alarm_rate: float, freedom: int) -> float:
    """Return the threshold of D = f'f for sensors of equal noise and a false-alarm rate.

    Parameters
    ----------
    deviation : float
        Standard deviation of a sample of every sensor.
    false_alarm_rate : float
        Probability of an alarm in a sample without fault, 0 to 1.
    freedom : int
        Redundant axes: M - 3.

    Returns
    -------
    float
        In the square of the unit of `deviation`.

    Raises
    ------
    InputError
        A probability, deviation or number outside its range.

    Notes
    -----
    S002 (2) and (3).

    Examples
    --------
    >>> import schuler
    >>> round(schuler.chi_square_threshold(0.0194, 0.05, 9), 5)
    0.00637
    """
    from scipy.stats import chi2

    if freedom < 1 or not 0.0 < false_alarm_rate < 1.0 or not deviation > 0.0:
        raise InputError(
            f"{freedom} degrees of freedom, a false-alarm rate of {false_alarm_rate:g}, a "
            f"deviation of {deviation:g}",
            expected="at least one, a probability between 0 and 1, a positive deviation",
        )
    return float(deviation**2 * chi2.isf(false_alarm_rate, freedom))


def likelihood_statistics(
    measurements: ArrayLike, geometry: Geometry, variances: ArrayLike | None = None
) -> tuple[FloatArray, FloatArray]:
    """Return how well a fault of each axis, and of each unit, explains every sample.

    Parameters
    ----------
    measurements : (n, M) array_like
        One column for each axis.
    geometry : Geometry
        Axes and housings of the sensors.
    variances : (M,) array_like, optional
        Of a sample of each axis; one if not given.

    Returns
    -------
    axis : (n, M) ndarray
        Gain in the log likelihood, times two, if this axis alone is at fault.
    unit : (n, k) ndarray
        The same for all axes of one housing together.

    Notes
    -----
    The chi-square statistic D of S002 (2) says that something is wrong, these say what.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> four = schuler.Geometry.from_mounting(schuler.tetrahedron_mounting())
    >>> step = np.zeros((1, 12))
    >>> step[0, 4] = 6.0
    >>> int(schuler.likelihood_statistics(step, four)[0].argmax())
    4
    """
    ell = np.atleast_2d(np.asarray(measurements, dtype=np.float64))
    s = np.ones(geometry.count) if variances is None else np.asarray(variances, dtype=np.float64)
    fit = least_squares(geometry.axes, s)
    f = ell @ fit.residual.T
    q = fit.residual * s
    seen = np.diag(q) > 1e-9 * s
    axis = np.where(seen, f**2 / np.where(seen, np.diag(q), 1.0), 0.0)
    columns = []
    for u in np.unique(geometry.units):
        mine = np.flatnonzero(geometry.units == u)
        inverse = np.linalg.pinv(q[np.ix_(mine, mine)], rcond=1e-9, hermitian=True)
        columns.append(np.einsum("ni,ij,nj->n", f[:, mine], inverse, f[:, mine]))
    return np.asarray(axis), np.stack(columns, axis=1)


def likelihood_threshold(
    geometry: Geometry,
    false_alarm_rate: float,
    *,
    fault: Fault = "axis",
    variances: ArrayLike | None = None,
    draws: int = 200_000,
    seed: int = 0,
) -> float:
    """Return the threshold of the largest likelihood statistic."""
    from scipy.stats import chi2

    if geometry.redundancy < 1 or not 0.0 < false_alarm_rate < 1.0:
        raise InputError(
            f"a false-alarm rate of {false_alarm_rate:g} with {geometry.redundancy} redundant axes",
            expected="a probability between 0 and 1, and redundancy",
        )
    kinds = np.bincount(np.unique(geometry.units, return_inverse=True)[1])
    if false_alarm_rate * draws < 100.0:
        if fault == "axis":
            return float(chi2.isf(false_alarm_rate / geometry.count, 1))
        return float(chi2.isf(false_alarm_rate / kinds.size, int(kinds.max())))
    s = np.ones(geometry.count) if variances is None else np.asarray(variances, dtype=np.float64)
    noise = np.random.default_rng(seed).standard_normal((draws, geometry.count)) * np.sqrt(s)
    axis, unit = likelihood_statistics(noise, geometry, s)
    largest = (axis if fault == "axis" else unit).max(axis=1)
    return float(np.quantile(largest, 1.0 - false_alarm_rate))


@dataclass(frozen=True, slots=True)
class EmpiricalThreshold:
    """The threshold that parts samples with and without fault best, and how badly it does.

    Parameters
    ----------
    threshold : float
        Of the statistic.
    criterion : str
        "counts" or "probabilities".
    cost : float
        What was made small.
    samples, faults : int
        How many there were.
    false_alarms, missed : int
        How many at this threshold.
    """

    threshold: float
    criterion: str
    cost: float
    samples: int
    faults: int
    false_alarms: int
    missed: int

    @property
    def missed_share(self) -> float:
        """Faults that were not found, of all faults."""
        return self.missed / self.faults if self.faults else float("nan")

    @property
    def false_alarms_per_fault(self) -> float:
        """False alarms over faults: the ratio that S002 prints."""
        return self.false_alarms / self.faults if self.faults else float("nan")

    @property
    def false_alarms_per_alarm(self) -> float:
        """False alarms over alarms: the other reading (E-002-4)."""
        alarms = self.false_alarms + self.faults - self.missed
        return self.false_alarms / alarms if alarms else float("nan")

    @property
    def never_alarming(self) -> float:
        """What the criterion costs when no alarm is ever raised; a threshold must beat it."""
        return 1.0


def threshold_performance(
    statistic: ArrayLike, faulty: ArrayLike, threshold: float, criterion: Criterion = "counts"
) -> EmpiricalThreshold:
    """Return how a given threshold does on labelled samples.

    Parameters
    ----------
    statistic : (n,) array_like
        D of every sample.
    faulty : (n,) array_like of bool
        Which samples hold a fault.
    threshold : float
        An alarm is raised above it.
    criterion : {"counts", "probabilities"}
        How its cost is counted.

    Returns
    -------
    EmpiricalThreshold
        With missed faults and false alarms.

    Raises
    ------
    InputError
        Shapes that differ.

    Notes
    -----
    S002 Fig. 7.

    Examples
    --------
    >>> import schuler
    >>> schuler.threshold_performance([0.1, 0.9], [False, True], 0.95).missed_share
    1.0
    """
    d, bad = np.asarray(statistic, dtype=np.float64), np.asarray(faulty, dtype=bool)
    if d.shape != bad.shape or d.ndim != 1:
        raise InputError(f"statistics {d.shape} and labels {bad.shape}", expected="(n,) both")
    faults = int(np.count_nonzero(bad))
    false_alarms = int(np.count_nonzero((d > threshold) & ~bad))
    missed = int(np.count_nonzero((d <= threshold) & bad))
    cost = (false_alarms + missed) / max(faults, 1)
    if criterion == "probabilities":
        cost = false_alarms / max(d.size - faults, 1) + missed / max(faults, 1)
    return EmpiricalThreshold(
        float(threshold), criterion, cost, d.size, faults, false_alarms, missed
    )


def empirical_threshold(
    statistic: ArrayLike, faulty: ArrayLike, criterion: Criterion = "counts"
) -> EmpiricalThreshold:
    """Return the threshold that makes false alarms and missed faults fewest.

    Parameters
    ----------
    statistic : (n,) array_like
        D of every sample.
    faulty : (n,) array_like of bool
        Which samples hold a fault.
    criterion : {"counts", "probabilities"}
        Smallest number of both errors, or smallest sum of their probabilities.

    Returns
    -------
    EmpiricalThreshold
        The threshold, and how many faults it misses and alarms it raises in vain.

    Raises
    ------
    InputError
        Shapes that differ, or only one kind of sample.

    Notes
    -----
    S002 Fig. 7.

    Examples
    --------
    >>> import schuler
    >>> schuler.empirical_threshold([0.1, 0.2, 0.9, 1.0], [False, False, True, True]).threshold
    0.2
    """
    d, bad = np.asarray(statistic, dtype=np.float64), np.asarray(faulty, dtype=bool)
    if d.shape != bad.shape or d.ndim != 1:
        raise InputError(f"statistics {d.shape} and labels {bad.shape}", expected="(n,) both")
    if not bad.any() or bad.all():
        raise InputError(
            f"{np.count_nonzero(bad)} of {bad.size} samples with a fault", expected="some of both"
        )
    order = np.argsort(d)
    labels = bad[order]
    # threshold at each sorted value: what is above alarms
    missed = np.concatenate([[0], np.cumsum(labels)])
    healthy = np.concatenate([[0], np.cumsum(~labels)])
    false_alarms = healthy[-1] - healthy
    if criterion == "counts":
        cost = false_alarms + missed
    else:
        cost = false_alarms / healthy[-1] + missed / missed[-1]
    values = np.concatenate([[-np.inf], d[order]])
    # equal values cannot be parted
    last = np.concatenate([values[1:] != values[:-1], [True]])
    best = int(np.flatnonzero(last)[np.argmin(cost[last])])
    return threshold_performance(d, bad, float(values[best]), criterion)
