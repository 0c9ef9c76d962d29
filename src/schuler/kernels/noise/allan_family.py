"""Sums behind the relatives of the Allan variance: one pass over the data a cluster length.

NIST SP 1065 (Riley 2008), sections 5.2.3 to 5.2.14, for theta the running sum of the samples.
"""

from __future__ import annotations

import numpy as np

from schuler.kernels.compile import kernel
from schuler.kernels.types import FloatArray


@kernel(reduction=True)
def sum_squared_second_differences(
    first: FloatArray, middle: FloatArray, last: FloatArray
) -> float:
    """Return the sum of (last - 2 middle + first)².

    first, middle, last (k,): views into theta, a cluster apart, at any stride.
    """
    total = 0.0
    for k in range(first.size):
        difference = first[k] - 2.0 * middle[k] + last[k]
        total += difference * difference
    return total


@kernel(reduction=True)
def sum_squared_third_differences(
    first: FloatArray, second: FloatArray, third: FloatArray, fourth: FloatArray
) -> float:
    """Return the sum of (fourth - 3 third + 3 second - first)²: the Hadamard variance.

    first, second, third, fourth (k,): views into theta, a cluster apart.
    """
    total = 0.0
    for k in range(first.size):
        difference = fourth[k] - first[k] + 3.0 * (second[k] - third[k])
        total += difference * difference
    return total


@kernel()
def sum_squared_averaged_differences(theta: FloatArray, factor: int) -> float:
    """Return the sum of squares of second differences averaged over a cluster (modified Allan).

    The average moves on by one value at a time. theta (n + 1,): running sum of the samples; factor:
    samples in a cluster; 3 * factor <= n + 1.
    """
    m = factor
    average = 0.0
    for k in range(m):
        average += theta[k] - 2.0 * theta[k + m] + theta[k + 2 * m]
    total = average * average
    for k in range(theta.size - 3 * m):
        average += theta[k + 3 * m] - theta[k] + 3.0 * (theta[k + m] - theta[k + 2 * m])
        total += average * average
    return total / (m * m)


@kernel()
def mean_square_of_total_windows(values: FloatArray, factor: int, step: int) -> float:
    """Return the mean square that the modified total and Hadamard total variances are made of.

    Every window of three clusters has its trend (between the means of its halves) taken off, is
    reflected at both ends, and gives 6 * factor second differences of cluster means. Howe and
    Vernotte 1999; NIST SP 1065, 5.2.12 and 5.2.14. values (n,): theta for the modified total,
    samples for the Hadamard total variance; factor: samples in a cluster; 3 * factor <= n; step:
    values from window to window: 1 is the definition.
    """
    m, width = factor, 3 * factor
    half = width // 2
    gap = 0.5 * width if width % 2 == 0 else 0.5 * (width - 1) + 1.0
    sums = np.empty(3 * width + 1)
    total, windows = 0.0, 0
    for start in range(0, values.size - width + 1, step):
        early, late = 0.0, 0.0
        for k in range(half):
            early += values[start + k]
            late += values[start + width - half + k]
        trend = (late - early) / (half * gap)
        level = (early + late) / (2 * half)
        # running sum of the detrended window in the middle third, then of its mirror images
        sums[width] = 0.0
        for k in range(width):
            detrended = values[start + k] - level - trend * (k - 0.5 * (width - 1))
            sums[width + k + 1] = sums[width + k] + detrended
        end = sums[2 * width]
        for k in range(width + 1):
            sums[2 * width + k] = 2.0 * end - sums[2 * width - k]
            sums[width - k] = -sums[width + k]
        inner = 0.0
        for k in range(6 * m):
            difference = sums[k + 3 * m] - sums[k] + 3.0 * (sums[k + m] - sums[k + 2 * m])
            inner += difference * difference
        total += inner / (6.0 * m * m * m)
        windows += 1
    return total / windows
