"""Fixed-interval smoothing backwards over the nodes of a filter run.

The modified Bryson-Frazier form: equal to Rauch-Tung-Striebel in exact arithmetic, but it never
inverts a covariance, so states that are known almost perfectly or not at all do no harm.
Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, section X.4.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.compile import kernel

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


@kernel()
def back_through_update(
    adjoint: Array,
    information: Array,
    row: Array,
    gain: Array,
    innovation: float,
    variance: float,
    work: Array,
) -> None:
    """Take the adjoint variables back through one scalar update, in place.

    lambda <- (I - K h)' lambda - h' nu/s and Lambda <- (I - K h)' Lambda (I - K h) + h' h/s.
    """
    n = adjoint.size
    along = 0.0
    for i in range(n):
        along += gain[i] * adjoint[i]
        work[i] = 0.0
    quadratic = 1.0 / variance
    for i in range(n):
        g = gain[i]
        if g != 0.0:
            for k in range(n):
                work[k] += g * information[i, k]
    for k in range(n):
        quadratic += work[k] * gain[k]
    shift = along + innovation / variance
    for i in range(n):
        h = row[i]
        w = work[i]
        if h != 0.0:
            adjoint[i] -= h * shift
            for k in range(n):
                information[i, k] += h * (quadratic * row[k] - work[k])
        for k in range(n):
            information[i, k] -= w * row[k]


@kernel()
def back_through_transition(
    adjoint: Array,
    information: Array,
    top: Array,
    sensor: Array,
    block: Integers,
    work: Array,
) -> None:
    """Lambda <- F' lambda and Lambda <- F' Lambda F, in place; F as the filter stores it."""
    n = adjoint.size
    m = n - 9
    # work = Lambda F
    for i in range(n):
        for k in range(9):
            work[i, k] = 0.0
        for j in range(m):
            first, size = block[j, 0], block[j, 1]
            if size == 1:
                value = information[i, 9 + j] * sensor[j, 0]
            else:
                value = 0.0
                for q in range(first, first + size):
                    value += information[i, 9 + q] * sensor[q, j - first]
            work[i, 9 + j] = value
        for q in range(9):
            value = information[i, q]
            if value != 0.0:
                for k in range(n):
                    work[i, k] += value * top[q, k]
    # information = F' work
    for i in range(9):
        for k in range(n):
            information[i, k] = 0.0
    for j in range(m):
        first, size = block[j, 0], block[j, 1]
        for k in range(n):
            information[9 + j, k] = 0.0
        for q in range(first, first + size):
            factor = sensor[q, j - first]
            if factor != 0.0:
                for k in range(n):
                    information[9 + j, k] += factor * work[9 + q, k]
    for q in range(9):
        for i in range(n):
            value = top[q, i]
            if value != 0.0:
                for k in range(n):
                    information[i, k] += value * work[q, k]
    for i in range(n):
        for k in range(i):
            mean = 0.5 * (information[i, k] + information[k, i])
            information[i, k] = mean
            information[k, i] = mean
    for i in range(n):
        work[0, i] = adjoint[i]
    for i in range(9):
        adjoint[i] = 0.0
    for j in range(m):
        first = block[j, 0]
        value = 0.0
        for q in range(first, first + block[j, 1]):
            value += sensor[q, j - first] * work[0, 9 + q]
        adjoint[9 + j] = value
    for q in range(9):
        value = work[0, q]
        for i in range(n):
            adjoint[i] += top[q, i] * value


@kernel()
def smooth_nodes(
    nodes: int,
    node_covariance: Array,
    node_top: Array,
    node_transition: Array,
    node_aid: Integers,
    block: Integers,
    aid_accepted: NDArray[np.bool_],
    aid_row: Array,
    aid_gain: Array,
    aid_scalar: Array,
    smoothed_error: Array,
    smoothed_position: Array,
    smoothed_variance: Array,
) -> None:
    """Smooth all nodes of `run_filter`.

    Writes smoothed_error (k, s): estimated error left in the filter's state after its update at
    each node; smoothed_position (k, 3, 3): its position covariance; smoothed_variance (k, s).
    """
    n = node_covariance.shape[1]
    adjoint = np.zeros(n)
    information = np.zeros((n, n))
    work = np.empty((max(n, 1), n))
    line = np.empty(n)
    for k in range(nodes - 1, -1, -1):
        covariance = node_covariance[k]
        for i in range(n):
            value = 0.0
            for q in range(n):
                value -= covariance[i, q] * adjoint[q]
                line[q] = 0.0
            smoothed_error[k, i] = value
            for q in range(n):
                p = covariance[i, q]
                for r in range(n):
                    line[r] += p * information[q, r]
            value = covariance[i, i]
            for r in range(n):
                value -= line[r] * covariance[r, i]
            smoothed_variance[k, i] = max(value, 0.0)
            if i < 3:
                for j in range(3):
                    value = covariance[i, j]
                    for r in range(n):
                        value -= line[r] * covariance[r, j]
                    smoothed_position[k, i, j] = value
        for u in range(node_aid[k, 1] - 1, node_aid[k, 0] - 1, -1):
            if not aid_accepted[u]:
                continue
            for i in range(2, -1, -1):
                if aid_scalar[u, i, 1] > 0.0:
                    back_through_update(
                        adjoint,
                        information,
                        aid_row[u, i],
                        aid_gain[u, i],
                        aid_scalar[u, i, 0],
                        aid_scalar[u, i, 1],
                        line,
                    )
        back_through_transition(adjoint, information, node_top[k], node_transition[k], block, work)
