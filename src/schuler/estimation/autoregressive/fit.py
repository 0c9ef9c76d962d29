"""Autoregressive models of sensor noise: four estimators, all orders, order selection.

Spec 3; S003 section 3 with its slips put right (E-003-6, 7, 9).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import get_args

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import EstimationError, InputError
from schuler.estimation.autoregressive.cautions import find_cautions
from schuler.estimation.autoregressive.estimators import (
    LagTable,
    Orders,
    burg,
    covariance,
    explicit_error,
    modified_covariance,
    nested_errors,
    yule_walker,
)
from schuler.estimation.autoregressive.result import (
    ArFit,
    ArSelection,
    Caution,
    Criterion,
    Method,
    coefficient_covariance,
    reflection_of,
)
from schuler.estimation.signals import Series, prepare
from schuler.types import FloatArray

__all__ = [
    "ArFit",
    "ArOrders",
    "ArSelection",
    "Caution",
    "fit_ar",
    "fit_ar_orders",
    "select_ar",
    "whiten_lattice",
]


_FLOOR = 16.0
"""A mean squared error below this many roundings of the samples counts as none."""
_SOLVER_FLOOR = (1000.0 * float(np.finfo(np.float64).eps)) ** 2
"""So does one below the rounding of the solvers, by experience a few hundred eps of the signal."""


@dataclass(frozen=True, slots=True, eq=False)
class ArOrders:
    """Autoregressive models of all orders from one pass."""

    method: str  # estimator
    coefficients: FloatArray  # (r, r): row k - 1 holds a_1 .. a_k of order k, then zeros.
    # (r + 1,): of orders 0 .. r in u², as the method defines it (see `ArFit`).
    innovation_variance: FloatArray
    solver: tuple[str, ...]  # how each order was solved
    requested: int  # orders asked for; r is less where the signal is exactly predictable before.

    @property
    def reached(self) -> int:
        """Highest order r that the signal determines."""
        return len(self.solver)

    def polynomial(self, order: int) -> FloatArray:
        """Return (a_1 .. a_k) of one order."""
        if not 0 <= order <= self.reached:
            raise InputError(f"order {order}", expected=f"0 to {self.reached}")
        return self.coefficients[order - 1, :order].copy() if order else np.zeros(0)


def fit_ar_orders(
    signal: ArrayLike, max_order: int, method: Method = "burg", *, remove_mean: bool = True
) -> ArOrders:
    """Fit all orders from 1 to `max_order` at once.

    Parameters
    ----------
    signal : (n,) array_like
        Samples at a constant rate, in u.
    max_order : int
        Highest order.
    method : {"burg", "covariance", "yule-walker"}
        As for `fit_ar`.
    remove_mean : bool
        Take the mean off first; an offset left in costs Yule-Walker (y_1² + y_N²)/N at every order.

    Returns
    -------
    ArOrders
        Innovation variance of every order from 0, in u², and criteria to choose by.

    Raises
    ------
    InputError
        A record that is too short for the order, or not finite.

    Notes
    -----
    S003 equations (5) to (13); erratum E-003-6 for the mean.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> x = np.random.default_rng(0).normal(size=1000)
    >>> schuler.fit_ar_orders(x, 3).innovation_variance.shape
    (4,)
    """
    series = _series(signal, max_order, method, remove_mean)
    return _in_units(_estimate(series, max_order, method), series, method, max_order)


def fit_ar(
    signal: ArrayLike,
    order: int,
    method: Method = "burg",
    *,
    rate: float | None = None,
    remove_mean: bool = True,
) -> ArFit:
    """Fit an autoregressive model of one order, with standard errors and cautions.

    Parameters
    ----------
    signal : (n,) array_like
        Samples at a constant interval, in any unit u; n > 2 order.
    order : int
        p, zero or more.
    method : {"burg", "yule-walker", "covariance", "modified covariance"}
        "burg" is stable and unbiased on peaked spectra; "covariance" is plain least squares and
        may be unstable; "yule-walker" is stable but biased (the cautions say where).
    rate : float, optional
        Samples a second, for `ArFit.process`.
    remove_mean : bool
        Take the mean off first.

    Returns
    -------
    ArFit
        Coefficients of A(z) = 1 + a_1 z^-1 + ..., innovation variance, reflection coefficients.

    Raises
    ------
    InputError
        Unknown method, an impossible order or rate, not finite, too short.
    EstimationError
        A signal that does not vary.

    Notes
    -----
    Spec 3; S003 (1)-(13).

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import fit_ar
    >>> rng = np.random.default_rng(1)
    >>> signal = np.zeros(20_000)
    >>> for k in range(1, signal.size):
    ...     signal[k] = 0.8 * signal[k - 1] + rng.standard_normal()
    >>> fit_ar(signal, 1).coefficients.round(2)
    array([-0.79])
    """
    _check_rate(rate)
    series = _series(signal, order, method, remove_mean)
    return _finish(series, _estimate(series, order, method), order, method, rate, None)


def select_ar(
    signal: ArrayLike,
    max_order: int = 20,
    criterion: Criterion = "bic",
    method: Method = "burg",
    *,
    rate: float | None = None,
    remove_mean: bool = True,
) -> ArFit:
    """Choose the order by an information criterion, all orders on the same samples.

    Parameters
    ----------
    signal : (n,) array_like
        Samples at a constant interval, in any unit u; n > 2 max_order.
    max_order : int
        Highest order tried.
    criterion : {"bic", "aic", "aicc"}
        N ln(MSE) plus ln(N), 2 or corrected 2 a parameter.
    method : {"burg", "yule-walker", "covariance", "modified covariance"}
        Estimator of the chosen order. The criteria compare conditional least squares for every
        method, so that the biases of an estimator do not choose the order.
    rate : float, optional
        Samples a second, for `ArFit.process`.
    remove_mean : bool
        Take the mean off first.

    Returns
    -------
    ArFit
        With `.selection`; order zero means that the signal is white.

    Raises
    ------
    InputError
        Unknown method or criterion, an impossible order or rate, not finite, too short.
    EstimationError
        A signal that does not vary.

    Notes
    -----
    Spec 3: n = pmax+1 .. N for every p. The parameters are a_1 .. a_p and the variance.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import select_ar
    >>> white = np.random.default_rng(1).standard_normal(5_000)
    >>> select_ar(white, max_order=5).order
    0
    """
    _check_rate(rate)
    if criterion not in get_args(Criterion):
        raise InputError(f"criterion '{criterion}'", expected="'bic', 'aic' or 'aicc'")
    series = _series(signal, max_order, method, remove_mean)
    selection = _select(series, max_order, criterion)
    orders = _estimate(series, selection.order, method)
    return _finish(series, orders, selection.order, method, rate, selection)


def whiten_lattice(signal: ArrayLike, reflection: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Forward and backward prediction errors by the lattice of S003 Fig. 4, from rest.

    Parameters
    ----------
    signal : (n,) array_like
        Samples, in u, their mean taken off.
    reflection : (p,) array_like
        Reflection coefficients, first order first.

    Returns
    -------
    forward, backward : (n,) ndarray
        Prediction errors of order p, in u; the first p samples have an incomplete past.

    Notes
    -----
    S003 Fig. 4 and equations (10) to (13).

    Examples
    --------
    >>> import numpy as np, schuler
    >>> x = np.random.default_rng(0).normal(size=500)
    >>> fit = schuler.fit_ar(x, 2, "burg")
    >>> forward, _ = schuler.whiten_lattice(x - fit.mean, fit.reflection)
    >>> bool(np.allclose(forward[2:], fit.residuals(x)))
    True
    """
    forward = np.array(signal, dtype=np.float64)
    if forward.ndim != 1:
        raise InputError(f"signal has shape {forward.shape}", expected="(n,)")
    backward = forward.copy()
    for gamma in np.atleast_1d(np.asarray(reflection, dtype=np.float64)):
        delayed = np.concatenate([np.zeros(1), backward[:-1]])[: forward.size]
        backward = delayed + gamma * forward
        forward = forward + gamma * delayed
    return forward, backward


def _series(signal: ArrayLike, order: int, method: str, remove_mean: bool) -> Series:
    if method not in get_args(Method):
        raise InputError(
            f"AR method '{method}'", expected=", ".join(f"'{m}'" for m in get_args(Method))
        )
    if isinstance(order, bool) or int(order) != order or order < 0:
        raise InputError(f"AR order {order}", expected="a whole number, zero or more")
    return prepare(signal, fewest=2 * int(order) + 2, remove_mean=remove_mean)


def _check_rate(rate: float | None) -> None:
    if rate is not None and not (np.isfinite(rate) and rate > 0.0):
        raise InputError(f"rate is {rate:g} Hz", expected="a finite number above zero")


def _floor(series: Series) -> float:
    return _FLOOR * series.rounding + _SOLVER_FLOOR


def _estimate(series: Series, order: int, method: Method) -> Orders:
    y, floor = series.values, _floor(series)
    if order == 0:
        return Orders(np.zeros((0, 0)), np.array([float(y @ y) / y.size]), ())
    if method == "yule-walker":
        return yule_walker(y, order)
    if method == "burg":
        return burg(y, order, floor)
    if method == "covariance":
        return covariance(y, order, floor)
    return modified_covariance(y, order, floor)


def _in_units(orders: Orders, series: Series, method: str, requested: int) -> ArOrders:
    return ArOrders(
        method, orders.coefficients, orders.error * series.scale**2, orders.solver, requested
    )


def _finish(
    series: Series,
    orders: Orders,
    requested: int,
    method: str,
    rate: float | None,
    selection: ArSelection | None,
) -> ArFit:
    order = len(orders.solver)
    a = orders.coefficients[order - 1, :order].copy() if order else np.zeros(0)
    if not np.isfinite(a).all():
        raise EstimationError(
            f"no finite autoregressive coefficients of order {order}", cure="use a lower order"
        )
    mean_square = explicit_error(series.values, a, order)
    own = float(orders.error[order]) if order else mean_square
    reflection = reflection_of(a) if orders.reflection is None else orders.reflection[:order]
    return ArFit(
        coefficients=a,
        innovation_variance=own * series.scale**2,
        mean_square_error=mean_square * series.scale**2,
        standard_errors=_standard_errors(series, a, mean_square),
        reflection=reflection,
        mean=series.offset,
        samples=series.values.size,
        method=method,
        solver=orders.solver[-1] if order else "mean",
        cautions=find_cautions(series, orders, reflection, requested, method, mean_square),
        rate=None if rate is None else float(rate),
        selection=selection,
    )


def _standard_errors(series: Series, a: FloatArray, mean_square: float) -> FloatArray:
    """Of long records; for unstable models from the Gram matrix of the data."""
    if a.size == 0:
        return np.zeros(0)
    samples = series.values.size
    if (np.abs(reflection_of(a)) < 1.0).all():
        variances = np.diag(coefficient_covariance(a, samples))
    else:
        gram = LagTable(series.values, a.size).gram(a.size)[1:, 1:]
        variances = mean_square * np.diag(np.linalg.pinv(gram, hermitian=True))
    return np.sqrt(np.maximum(variances, 0.0))


def _select(series: Series, max_order: int, criterion: Criterion) -> ArSelection:
    errors = np.maximum(nested_errors(series.values, max_order), _floor(series))
    terms = series.values.size - max_order
    count = np.arange(max_order + 1) + 1.0
    fit = terms * np.log(errors)
    room = terms - count - 1.0
    if criterion == "aicc" and room.min() <= 0.0:
        raise InputError(
            f"{terms} samples for order {max_order} by AICc", expected="more samples than orders"
        )
    values = {
        "aic": fit + 2.0 * count,
        "aicc": fit + 2.0 * count * (1.0 + (count + 1.0) / np.maximum(room, 0.5)),
        "bic": fit + np.log(terms) * count,
    }
    return ArSelection(
        criterion=criterion,
        order=int(np.argmin(values[criterion])),
        mean_square_error=errors * series.scale**2,
        aic=values["aic"],
        aicc=values["aicc"],
        bic=values["bic"],
        samples=terms,
    )
