"""Smoothing backwards over the nodes of a filter run, from its end or from a fixed lag.

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
def back_through_node(
    node: int,
    adjoint: Array,
    information: Array,
    node_top: Array,
    node_transition: Array,
    node_aid: Integers,
    block: Integers,
    aid_accepted: NDArray[np.bool_],
    aid_row: Array,
    aid_gain: Array,
    aid_scalar: Array,
    work: Array,
) -> None:
    """Take the adjoint variables from behind a node's updates to behind those of the node before.

    Arrays as `run_filter` leaves them, rows modulo their number; `work` (s, s).
    """
    place, kept = node % node_top.shape[0], max(aid_row.shape[0], 1)
    all_aids = max(aid_accepted.size, 1)
    for u in range(node_aid[place, 1] - 1, node_aid[place, 0] - 1, -1):
        if not aid_accepted[u % all_aids]:
            continue
        for i in range(2, -1, -1):
            if aid_scalar[u % all_aids, i, 1] > 0.0:
                back_through_update(
                    adjoint,
                    information,
                    aid_row[u % kept, i],
                    aid_gain[u % kept, i],
                    aid_scalar[u % all_aids, i, 0],
                    aid_scalar[u % all_aids, i, 1],
                    work[0],
                )
    back_through_transition(
        adjoint, information, node_top[place], node_transition[place], block, work
    )


@kernel()
def smoothed_state(
    covariance: Array,
    adjoint: Array,
    information: Array,
    line: Array,
    error: Array,
    position: Array,
    variance: Array,
) -> None:
    """What is known at a node with everything behind it: x = -P lambda, P - P Lambda P.

    Writes the error (s,) left in the filter's state, the covariance (3, 3) of position and the
    variances (s,) of all states.
    """
    n = adjoint.size
    for i in range(n):
        value = 0.0
        for q in range(n):
            value -= covariance[i, q] * adjoint[q]
            line[q] = 0.0
        error[i] = value
        for q in range(n):
            p = covariance[i, q]
            for r in range(n):
                line[r] += p * information[q, r]
        value = covariance[i, i]
        for r in range(n):
            value -= line[r] * covariance[r, i]
        variance[i] = max(value, 0.0)
        if i < 3:
            for j in range(3):
                value = covariance[i, j]
                for r in range(n):
                    value -= line[r] * covariance[r, j]
                position[i, j] = value


@kernel()
def smooth_nodes(
    first: int,
    stop: int,
    adjoint: Array,
    information: Array,
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
    """Smooth the nodes from stop - 1 down to `first`; the adjoint variables go on from there.

    Arrays of nodes and measurements as `run_filter` leaves them, rows modulo their number.
    adjoint (s,) and information (s, s): zero at the end of a run. Writes, by number of node,
    smoothed_error (k, s): estimated error left in the filter's state after its update at each
    node; smoothed_position (k, 3, 3): its position covariance; smoothed_variance (k, s).
    """
    n = adjoint.size
    work, line = np.empty((n, n)), np.empty(n)
    for k in range(stop - 1, first - 1, -1):
        smoothed_state(
            node_covariance[k % node_covariance.shape[0]],
            adjoint,
            information,
            line,
            smoothed_error[k],
            smoothed_position[k],
            smoothed_variance[k],
        )
        back_through_node(
            k,
            adjoint,
            information,
            node_top,
            node_transition,
            node_aid,
            block,
            aid_accepted,
            aid_row,
            aid_gain,
            aid_scalar,
            work,
        )


@kernel()
def smooth_with_lag(
    horizon: Integers,
    first: int,
    node_covariance: Array,
    node_top: Array,
    node_transition: Array,
    node_aid: Integers,
    block: Integers,
    aid_accepted: NDArray[np.bool_],
    aid_row: Array,
    aid_gain: Array,
    aid_scalar: Array,
    here_error: Array,
    here_position: Array,
    here_variance: Array,
    next_error: Array,
    next_position: Array,
    next_variance: Array,
) -> None:
    """Smooth each node, and the one behind it, with what is measured up to a horizon.

    horizon (k,): the last node whose measurements may be used for node first + i; node i itself
    where nothing later may. Arrays of nodes as in `smooth_nodes`. Writes by i the state at the
    node and that at the next one under the same horizon, each as in `smoothed_state`; the latter
    is left alone where the horizon is the node itself.
    """
    n = node_covariance.shape[1]
    places = node_covariance.shape[0]
    adjoint, information = np.empty(n), np.empty((n, n))
    work, line = np.empty((n, n)), np.empty(n)
    for i in range(horizon.size):
        node = first + i
        adjoint[:] = 0.0
        information[:, :] = 0.0
        for k in range(horizon[i], node, -1):
            if k == node + 1:
                smoothed_state(
                    node_covariance[k % places],
                    adjoint,
                    information,
                    line,
                    next_error[i],
                    next_position[i],
                    next_variance[i],
                )
            back_through_node(
                k,
                adjoint,
                information,
                node_top,
                node_transition,
                node_aid,
                block,
                aid_accepted,
                aid_row,
                aid_gain,
                aid_scalar,
                work,
            )
        smoothed_state(
            node_covariance[node % places],
            adjoint,
            information,
            line,
            here_error[i],
            here_position[i],
            here_variance[i],
        )
