"""Sums of products of long series on one thread.

BLAS wakes all its threads for a product of long vectors, and they spin longer than they work:
many times the CPU time for nothing gained.
"""

from __future__ import annotations

import numpy as np

from schuler.types import FloatArray

_PIECE = 262_144
"""Multiplications up to which a matrix product stays on one thread."""
_MOST_ROWS = 16
"""Wider products are worth the threads."""


def dot(a: FloatArray, b: FloatArray) -> float:
    """Sum of products of two vectors."""
    return float(np.einsum("i,i->", a, b))


def gram(rows: FloatArray) -> FloatArray:
    """Products (k, k) of the rows of a (k, n) array."""
    count, length = rows.shape
    if count > _MOST_ROWS:
        return np.asarray(rows @ rows.T)
    step = max(_PIECE // count**2, 1)
    total = np.zeros((count, count))
    for start in range(0, length, step):
        piece = rows[:, start : start + step]
        # a copy, because the product of an array with itself takes another, slower way
        total += piece @ piece.copy().T
    return total


def by_rows(rows: FloatArray, vector: FloatArray) -> FloatArray:
    """Products (k,) of the rows of a (k, n) array with a vector."""
    return np.array([dot(row, vector) for row in rows])
