"""Sums of products of a long series with its own past."""

from __future__ import annotations

from schuler.kernels.compile import kernel
from schuler.kernels.types import FloatArray

_BLOCK = 2048


@kernel(reduction=True)
def _dot(a: FloatArray, b: FloatArray) -> float:
    total = 0.0
    for k in range(a.size):
        total += a[k] * b[k]
    return total


@kernel()
def add_lagged_products(values: FloatArray, sums: FloatArray) -> None:
    """Add the sums of v(t) v(t-k), k = 0, 1, ..., all lags of a block while it is at hand."""
    for start in range(0, values.size, _BLOCK):
        end = min(start + _BLOCK, values.size)
        for k in range(sums.size):
            first = max(start, k)
            if first < end:
                sums[k] += _dot(values[first:end], values[first - k : end - k])
