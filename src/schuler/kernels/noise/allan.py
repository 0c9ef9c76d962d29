"""Sums of squared second differences of the integrated signal: the Allan variance.

Spec 2.3 (S004 (13)): sigma²(T) = 1/(2 T² M) sum_k (theta_{k+2n} - 2 theta_{k+n} + theta_k)².
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.compile import kernel
from schuler.kernels.types import FloatArray


@kernel()
def integrate(signal: FloatArray, offset: FloatArray, theta: FloatArray) -> None:
    """Write the running sum of every column less its offset; theta[:, 0] = 0.

    signal (n, m): samples, at any stride; offset (m,): about the mean of every column, taken off so
    that the sums stay small (second differences do not see it); theta (m, n + 1): filled in place.
    """
    total = np.zeros(offset.size)
    for c in range(offset.size):
        theta[c, 0] = 0.0
    for k in range(signal.shape[0]):
        for j in range(offset.size):
            total[j] += signal[k, j] - offset[j]
            theta[j, k + 1] = total[j]


@kernel(reduction=True)
def squared_second_differences(
    first: FloatArray,
    middle: FloatArray,
    last: FloatArray,
    wide_middle: FloatArray,
    wide_last: FloatArray,
) -> tuple[float, float]:
    """Return the sums of (last - 2 middle + first)² for two clusters that start together.

    Two at a time, because loading is what takes the time. first, middle, last (k,): views into the
    running sum, a cluster apart; wide_middle, wide_last (k,): the same for a second cluster length.
    """
    total, wide_total = 0.0, 0.0
    for k in range(first.size):
        difference = first[k] - 2.0 * middle[k] + last[k]
        total += difference * difference
        wide = first[k] - 2.0 * wide_middle[k] + wide_last[k]
        wide_total += wide * wide
    return total, wide_total


@kernel()
def allan_sums(theta: FloatArray, factors: NDArray[np.int64], sums: FloatArray, block: int) -> None:
    """Add up the squared second differences of every cluster length, block by block.

    All cluster lengths are served while a block of `theta` is in the cache, two at a time: pairs
    share the terms that both have, the shorter one then takes its last few alone. theta (n + 1,):
    running sum of the samples; factors (t,): samples in a cluster, increasing; 2 * factor <= n;
    sums (t,): filled in place with sum over k of (theta[k+2m] - 2 theta[k+m] + theta[k])²; block:
    terms served before the next cluster length gets its turn.
    """
    for c in range(sums.size):
        sums[c] = 0.0
    for start in range(0, theta.size, block):
        for j in range(0, factors.size, 2):
            m = factors[j]
            w = factors[min(j + 1, factors.size - 1)]
            end = min(start + block, theta.size - 2 * m)
            stop = max(start, min(end, theta.size - 2 * w))
            if stop > start:
                short, wide = squared_second_differences(
                    theta[start:stop],
                    theta[start + m : stop + m],
                    theta[start + 2 * m : stop + 2 * m],
                    theta[start + w : stop + w],
                    theta[start + 2 * w : stop + 2 * w],
                )
                sums[j] += short
                if j + 1 < factors.size:
                    sums[j + 1] += wide
            for k in range(stop, end):
                difference = theta[k] - 2.0 * theta[k + m] + theta[k + 2 * m]
                sums[j] += difference * difference
