"""Sums of products of long series on one thread.

BLAS wakes all its threads for a product of long vectors, and they spin longer than they work:
many times the CPU time for nothing gained.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path

import numpy as np

from schuler.types import FloatArray

_PIECE = 262_144
"""Multiplications up to which a matrix product stays on one thread."""
_MOST_ROWS = 16
"""Up to so many rows, pieces cost no more than the whole."""


def dot(a: FloatArray, b: FloatArray) -> float:
    """Sum of products of two vectors."""
    return float(np.einsum("i,i->", a, b))


def gram(rows: FloatArray) -> FloatArray:
    """Products (k, k) of the rows of a (k, n) array."""
    count, length = rows.shape
    if count > _MOST_ROWS:
        with one_blas_thread():
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


_calls = threading.Lock()
_inside = [0, 0]
"""How many are inside now, and the threads that the first of them found."""


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Keep products to one thread, where NumPy brought the OpenBLAS that it uses."""
    found = _threads_of_blas()
    if found is None:
        yield
        return
    tell, set_to = found
    with _calls:
        if _inside[0] == 0:
            _inside[1] = tell()
            set_to(1)
        _inside[0] += 1
    try:
        yield
    finally:
        with _calls:
            _inside[0] -= 1
            if _inside[0] == 0:
                set_to(_inside[1])


@cache
def _threads_of_blas() -> tuple[Callable[[], int], Callable[[int], None]] | None:
    """The functions of NumPy's own OpenBLAS that tell and set its threads."""
    folder = Path(np.__file__).parent.with_name("numpy.libs")
    for path in folder.glob("*openblas*"):
        try:
            library = ctypes.CDLL(str(path))
        except OSError:
            continue
        for name in ("scipy_openblas_{}_num_threads64_", "openblas_{}_num_threads64_"):
            tell = getattr(library, name.format("get"), None)
            set_to = getattr(library, name.format("set"), None)
            if tell is not None and set_to is not None:
                return tell, set_to
    return None
