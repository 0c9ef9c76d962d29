"""The four estimators of autoregressive coefficients, all orders at once.

Spec 3 (S003 (6)-(13)). Signals are centred and scaled (`_series`). Least squares come from one
Gram matrix whose entries are lag products less end corrections; where it is too ill-conditioned
for that, from an orthogonal triangular factor of the data themselves.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import chain

import numpy as np

from schuler.estimation.products import dot
from schuler.noise.lattice import levinson, step_up
from schuler.types import FloatArray

BLOCK = 4096
LARGEST_CONDITION = 1e7
"""Condition number of the Gram matrix up to which normal equations are trusted."""
_SPIKED_END = 1e-4
_ROWS = 8192


@dataclass(frozen=True, slots=True, eq=False)
class Orders:
    """Coefficients of orders 1 .. r by one estimator, in units of the scaled signal."""

    coefficients: FloatArray  # (r, r): row k - 1 holds a_1 .. a_k, then zeros.
    error: FloatArray  # (r + 1,): the estimator's own mean squared one-step error of orders 0 .. r.
    # how each order was solved: "levinson", "lattice", "normal equations" or "QR"
    solver: tuple[str, ...]
    # (r,): where the estimator works with them; the same for all orders.
    reflection: FloatArray | None = None


@dataclass(slots=True)
class LagTable:
    """Lag products of a signal, and the ends that Gram matrices leave out."""

    signal: FloatArray  # (n,): scaled samples
    order: int  # highest lag
    products: FloatArray = field(init=False)
    _head: FloatArray = field(init=False)
    _tail: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        from schuler.kernels.noise.autoregressive import lag_products

        p, y = self.order, self.signal
        self.products = np.empty(p + 1)
        lag_products(y, BLOCK, self.products)
        # head[k, t]: products y(m) y(m-k) with m < t; tail[k, t]: with m >= n - t
        self._head, self._tail = np.zeros((p + 1, p + 1)), np.zeros((p + 1, p + 1))
        for k in range(p + 1):
            early = np.where(np.arange(p) >= k, y[:p] * y[np.maximum(np.arange(p) - k, 0)], 0.0)
            late = y[y.size - np.arange(1, p + 1)] * y[y.size - np.arange(1, p + 1) - k]
            self._head[k, 1:], self._tail[k, 1:] = np.cumsum(early), np.cumsum(late)

    def gram(self, order: int, first: int | None = None) -> FloatArray:
        """Sums over n = first .. N-1 (from zero) of y(n-i) y(n-j), for i, j = 0 .. order."""
        start = order if first is None else first
        i, j = np.indices((order + 1, order + 1))
        lag, near = np.abs(i - j), np.minimum(i, j)
        return np.asarray(
            self.products[lag] - self._head[lag, start - near] - self._tail[lag, near]
        )


def trusted(gram: FloatArray, energy: float) -> bool:
    """Tell whether normal equations with this Gram matrix keep eight digits."""
    diagonal = np.diag(gram)
    if not diagonal.min() > _SPIKED_END * energy:
        return False
    root = np.sqrt(diagonal)
    values = np.linalg.eigvalsh(gram / np.outer(root, root))
    return bool(values[0] * LARGEST_CONDITION > values[-1])


def lagged_rows(signal: FloatArray, order: int, first: int) -> Iterator[FloatArray]:
    """Blocks of rows (y(n-1), .., y(n-p), y(n)) from n = first on."""
    windows = np.lib.stride_tricks.sliding_window_view(signal[first - order :], order + 1)
    for start in range(0, len(windows), _ROWS):
        part = windows[start : start + _ROWS, ::-1]
        yield np.concatenate([part[:, 1:], part[:, :1]], axis=1)


def triangular_factor(blocks: Iterator[FloatArray], columns: int) -> FloatArray:
    """R of the QR factorisation of rows that come in blocks; memory of one block."""
    factor = np.zeros((0, columns))
    for block in blocks:
        factor = np.asarray(np.linalg.qr(np.concatenate([factor, block]), mode="r"))
    square = np.zeros((columns, columns))
    square[: len(factor)] = factor
    return square


def _solve_factor(factor: FloatArray) -> FloatArray:
    from scipy.linalg import solve_triangular

    return -np.asarray(solve_triangular(factor[:-1, :-1], factor[:-1, -1]))


def _solve_gram(gram: FloatArray, samples: int) -> tuple[FloatArray, float]:
    from scipy.linalg import cho_solve

    root = np.sqrt(np.diag(gram)[1:])
    lower = np.linalg.cholesky(gram[1:, 1:] / np.outer(root, root))
    a = -np.asarray(cho_solve((lower, True), gram[1:, 0] / root)) / root
    return a, quadratic_error(gram, a, samples)


def quadratic_error(gram: FloatArray, coefficients: FloatArray, samples: int) -> float:
    """Mean squared one-step error of any coefficients from a Gram matrix."""
    full = np.append(1.0, coefficients)
    return max(float(full @ gram @ full) / samples, 0.0)


def explicit_error(signal: FloatArray, coefficients: FloatArray, first: int) -> float:
    """Mean squared one-step error of any coefficients from the residuals themselves."""
    from schuler.kernels.noise.autoregressive import one_step_residuals

    residuals = np.empty(signal.size - first)
    one_step_residuals(signal, coefficients, first, residuals)
    return dot(residuals, residuals) / residuals.size


def yule_walker(signal: FloatArray, order: int) -> Orders:
    """Levinson's recursion on the biased autocovariance: S003 (6)-(9g); always stable."""
    from schuler.kernels.noise.autoregressive import lag_products

    products = np.empty(order + 1)
    lag_products(signal, BLOCK, products)
    reflection, error = levinson(products / signal.size)
    return Orders(step_up(reflection), error, ("levinson",) * reflection.size, reflection)


def burg(signal: FloatArray, order: int, floor: float) -> Orders:
    """Burg's lattice: S003 (10)-(13); always stable."""
    from schuler.kernels.noise.autoregressive import burg_lattice

    reflection, error = np.zeros(order), np.zeros(order)
    reached = burg_lattice(signal.copy(), signal.copy(), floor, BLOCK, reflection, error)
    power = dot(signal, signal) / signal.size
    done = reflection[:reached]
    error = np.append(power, error[:reached])
    return Orders(step_up(done), error, ("lattice",) * reached, done)


def covariance(signal: FloatArray, order: int, floor: float) -> Orders:
    """Least squares on n = k+1 .. N for every order k, no window: S003 3.2."""
    return _least_squares(signal, order, floor, both_ways=False)


def modified_covariance(signal: FloatArray, order: int, floor: float) -> Orders:
    """Least squares of forward and backward prediction together."""
    return _least_squares(signal, order, floor, both_ways=True)


def _least_squares(signal: FloatArray, order: int, floor: float, *, both_ways: bool) -> Orders:
    table = LagTable(signal, order)
    ways = (signal, signal[::-1]) if both_ways else (signal,)
    rows, solver = np.zeros((order, order)), []
    error = [float(table.products[0]) / signal.size]
    whole: FloatArray | None = None
    for k in range(1, order + 1):
        terms = signal.size - k
        gram = table.gram(k)
        if both_ways:
            gram, terms = gram + gram[::-1, ::-1], 2 * terms
        if trusted(gram, float(table.products[0])):
            rows[k - 1, :k], mean_square = _solve_gram(gram, terms)
            solver.append("normal equations")
        else:
            if whole is None:
                rows_of = chain(*(lagged_rows(y, order, order) for y in ways))
                whole = triangular_factor(rows_of, order + 1)
            factor = _lower_order(whole, ways, k, order)
            if abs(factor[k - 1, k - 1]) ** 2 <= floor * terms:
                break
            rows[k - 1, :k] = _solve_factor(factor)
            mean_square = float(factor[k, k]) ** 2 / terms
            solver.append("QR")
        error.append(mean_square)
        if mean_square <= floor:
            break
    reached = len(solver)
    return Orders(rows[:reached, :reached], np.array(error), tuple(solver))


def _lower_order(whole: FloatArray, ways: tuple[FloatArray, ...], k: int, order: int) -> FloatArray:
    """Factor of order k on its own n >= k, from that of the highest order on n >= order."""
    if k == order:
        return whole
    columns = np.append(np.arange(k), order)
    early = [next(lagged_rows(y[:order], k, k)) for y in ways]
    return np.asarray(np.linalg.qr(np.concatenate([whole[:, columns], *early]), mode="r"))


def nested_errors(signal: FloatArray, order: int) -> FloatArray:
    """Least mean squared errors of orders 0 .. p, all on the same samples n = p+1 .. N."""
    table = LagTable(signal, order)
    gram = table.gram(order)
    terms = signal.size - order
    turn = np.append(np.arange(1, order + 1), 0)
    if trusted(gram, float(table.products[0])):
        last = np.linalg.cholesky(gram[np.ix_(turn, turn)])[-1]
    else:
        last = triangular_factor(lagged_rows(signal, order, order), order + 1)[:, -1]
    return np.asarray(np.cumsum(last[::-1] ** 2)[::-1] / terms)
