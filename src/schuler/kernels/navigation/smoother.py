"""Smoothing backwards over the nodes of a filter run, from its end or from a fixed lag.

The modified Bryson-Frazier form: equal to Rauch-Tung-Striebel in exact arithmetic, but it never
inverts a covariance, so states that are known almost perfectly or not at all do no harm.
Bierman, Factorization Methods for Discrete Sequential Estimation, 1977, section X.4.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np

from schuler.kernels.compile import kernel
from schuler.kernels.navigation.filter_data import AidingOutputs, NodeOutputs
from schuler.kernels.structure_fields import Matrix, Vector, reals
from schuler.kernels.structures import structure
from schuler.kernels.types import FloatArray, IntArray


@structure
class Adjoint:
    """The adjoint variables lambda (s,) and Lambda (s, s), with work (s, s) and line (s,)."""

    vector: Vector
    matrix: Matrix
    work: Matrix
    line: Vector

    @classmethod
    def zero(cls, size: int) -> Adjoint:
        """As at the end of a run with `size` states."""
        square = np.zeros((2, size, size))
        return cls(np.zeros(size), square[0], square[1], np.zeros(size))


@structure
class Smoothed:
    """What is known of k nodes with everything behind them, by number of node.

    error (k, s): left in the filter's state after its update there; position (k, 3, 3): its
    covariance of position; variance (k, s); lasting (k, 3, 3): covariance of position with three
    states from number `first` on, errors of GNSS that last; no rows where there are none.
    """

    error: Matrix
    position: Annotated[FloatArray, reals(None, 3, 3)]
    variance: Matrix
    lasting: Annotated[FloatArray, reals(None, 3, 3)]
    first: int

    @classmethod
    def zeros(cls, nodes: int, size: int, first: int = -1) -> Smoothed:
        """To be written."""
        shape, kept = (nodes, size), nodes if first >= 0 else 0
        square = np.zeros((nodes + kept, 3, 3))
        return cls(np.zeros(shape), square[:nodes], np.zeros(shape), square[nodes:], first)


@kernel()
def back_through_update(
    a: Adjoint, row: FloatArray, gain: FloatArray, innovation: float, variance: float
) -> None:
    """Take the adjoint variables back through one scalar update, in place.

    lambda <- (I - K h)' lambda - h' nu/s and Lambda <- (I - K h)' Lambda (I - K h) + h' h/s.
    """
    adjoint, information, work = a.vector, a.matrix, a.line
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
def information_times(a: Adjoint, top: FloatArray, sensor: FloatArray, block: IntArray) -> None:
    """Write Lambda F to the work."""
    information, work = a.matrix, a.work
    n = a.vector.size
    m = n - 9
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


@kernel()
def transposed_times(a: Adjoint, top: FloatArray, sensor: FloatArray, block: IntArray) -> None:
    """Lambda <- F' times the work, made symmetric."""
    information, work = a.matrix, a.work
    n = a.vector.size
    for i in range(9):
        for k in range(n):
            information[i, k] = 0.0
    for j in range(n - 9):
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


@kernel()
def back_through_transition(
    a: Adjoint, top: FloatArray, sensor: FloatArray, block: IntArray
) -> None:
    """Lambda <- F' lambda and Lambda <- F' Lambda F, in place; F as the filter stores it."""
    information_times(a, top, sensor, block)
    transposed_times(a, top, sensor, block)
    adjoint, before = a.vector, a.line
    n = adjoint.size
    for i in range(n):
        before[i] = adjoint[i]
    for i in range(9):
        adjoint[i] = 0.0
    for j in range(n - 9):
        first = block[j, 0]
        value = 0.0
        for q in range(first, first + block[j, 1]):
            value += sensor[q, j - first] * before[9 + q]
        adjoint[9 + j] = value
    for q in range(9):
        value = before[q]
        for i in range(n):
            adjoint[i] += top[q, i] * value


@kernel()
def back_through_node(
    node: int, nodes: NodeOutputs, aiding: AidingOutputs, block: IntArray, a: Adjoint
) -> None:
    """Take the adjoint variables from behind a node's updates to behind those of the node before.

    Arrays as `run_filter` leaves them, rows modulo their number.
    """
    place, kept = node % nodes.top.shape[0], max(aiding.row.shape[0], 1)
    all_aids = max(aiding.accepted.size, 1)
    for number in range(nodes.aid[place, 1] - 1, nodes.aid[place, 0] - 1, -1):
        u = number % all_aids
        if not aiding.accepted[u]:
            continue
        for i in range(2, -1, -1):
            if aiding.scalar[u, i, 1] > 0.0:
                back_through_update(
                    a,
                    aiding.row[number % kept, i],
                    aiding.gain[number % kept, i],
                    aiding.scalar[u, i, 0],
                    aiding.scalar[u, i, 1],
                )
    back_through_transition(a, nodes.top[place], nodes.transition[place], block)


@kernel()
def smooth_node(covariance: FloatArray, a: Adjoint, smoothed: Smoothed, k: int) -> None:
    """What is known at a node with everything behind it: x = -P lambda, P - P Lambda P."""
    adjoint, information, line = a.vector, a.matrix, a.line
    n = adjoint.size
    for i in range(n):
        value = 0.0
        for q in range(n):
            value -= covariance[i, q] * adjoint[q]
            line[q] = 0.0
        smoothed.error[k, i] = value
        for q in range(n):
            p = covariance[i, q]
            for r in range(n):
                line[r] += p * information[q, r]
        value = covariance[i, i]
        for r in range(n):
            value -= line[r] * covariance[r, i]
        smoothed.variance[k, i] = max(value, 0.0)
        if i < 3:
            for j in range(3):
                value = covariance[i, j]
                for r in range(n):
                    value -= line[r] * covariance[r, j]
                smoothed.position[k, i, j] = value
            for j in range(3 if smoothed.first >= 0 else 0):
                value = covariance[i, smoothed.first + j]
                for r in range(n):
                    value -= line[r] * covariance[r, smoothed.first + j]
                smoothed.lasting[k, i, j] = value


@kernel()
def smooth_nodes(
    first: int,
    stop: int,
    nodes: NodeOutputs,
    aiding: AidingOutputs,
    block: IntArray,
    a: Adjoint,
    smoothed: Smoothed,
) -> None:
    """Smooth the nodes from stop - 1 down to `first`; the adjoint variables go on from there."""
    for k in range(stop - 1, first - 1, -1):
        smooth_node(nodes.covariance[k % nodes.covariance.shape[0]], a, smoothed, k)
        back_through_node(k, nodes, aiding, block, a)


@kernel()
def smooth_with_lag(
    horizon: IntArray,
    first: int,
    nodes: NodeOutputs,
    aiding: AidingOutputs,
    block: IntArray,
    a: Adjoint,
    here: Smoothed,
    ahead: Smoothed,
) -> None:
    """Smooth each node, and the one behind it, with what is measured up to a horizon."""
    places = nodes.covariance.shape[0]
    for i in range(horizon.size):
        node = first + i
        for j in range(a.vector.size):
            a.vector[j] = 0.0
            for k in range(a.vector.size):
                a.matrix[j, k] = 0.0
        for k in range(horizon[i], node, -1):
            if k == node + 1:
                smooth_node(nodes.covariance[k % places], a, ahead, i)
            back_through_node(k, nodes, aiding, block, a)
        smooth_node(nodes.covariance[node % places], a, here, i)
