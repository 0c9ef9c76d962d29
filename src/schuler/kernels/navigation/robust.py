"""Weights for GNSS that is worse than it says, and noise that follows what the innovations show.

Numbers of `robustness` (9,):

    0     0: a gate refuses; 1: Huber weights; 2: Student-t weights
    1-3   squared innovation of 1, 2 or 3 degrees beyond which a measurement is doubted
    4     what an update remembers of the noise seen before; 0: the noise is not adapted
    5     how many updates the receiver's own word counts for at the start
    6, 7  least and largest factor on its variance
    8     degrees of freedom of Student's distribution

Huber, Robust Statistics, 2nd ed., section 7.3, applied to the normalised innovation; Student-t:
weight (nu + p) / (nu + d^2), Lange, Little, Taylor 1989, J. Am. Stat. Assoc. 84:881. Adapted noise:
Särkkä, Nummenmaa 2009, IEEE Trans. Automatic Control 54:596, one factor for all components.
"""

from __future__ import annotations

import math

from schuler.kernels.compile import kernel
from schuler.kernels.navigation.filter_data import Measurement
from schuler.kernels.types import FloatArray


@kernel(inline=True)
def robust_weight(nis: float, degrees: int, robustness: FloatArray) -> float:
    """Weight of a measurement with this squared innovation: 1 where it is as expected."""
    if robustness[0] == 1.0:
        limit = robustness[degrees]
        return 1.0 if nis <= limit else float(math.sqrt(limit / nis))
    freedom = robustness[8]
    return float(min(1.0, (freedom + degrees) / (freedom + nis)))


@kernel(inline=True)
def scale_noise(
    kind: int, robustness: FloatArray, adapted: FloatArray, variance: FloatArray
) -> None:
    """Multiply the variances (3,) of a measurement by the factor found so far.

    adapted (4,): shape and scale of the inverse gamma distribution of the factor, by kind; zero
    before the first.
    """
    if robustness[4] == 0.0 or adapted[2 * kind] == 0.0:
        return
    factor = adapted[2 * kind + 1] / adapted[2 * kind]
    factor = min(max(factor, robustness[6]), robustness[7])
    for i in range(3):
        variance[i] *= factor


@kernel()
def adapt_noise(
    kind: int,
    robustness: FloatArray,
    nis: float,
    degrees: int,
    z: Measurement,
    covariance: FloatArray,
    adapted: FloatArray,
) -> None:
    """Take an update into the distribution of the factor on the claimed variances.

    What is left of a residual after the update, squared, plus H P H' after it, has the variance
    of the noise as its mean. A measurement that is doubted counts as one at the limit, whether it
    was used or refused (then its `error` is zero): so noise that is far too small can grow, and a
    few wrong fixes do not count for much.
    """
    if robustness[4] == 0.0:
        return
    n = z.design.shape[1]
    if adapted[2 * kind] == 0.0:
        adapted[2 * kind] = 1.5 * robustness[5]
        adapted[2 * kind + 1] = 1.5 * robustness[5]
    weight = min(1.0, robustness[degrees] / nis) if nis > 0.0 else 1.0
    adapted[2 * kind] *= robustness[4]
    adapted[2 * kind + 1] *= robustness[4]
    for i in range(3):
        if not math.isfinite(z.variance[i]):
            continue
        left = z.residual[i]
        spread = 0.0
        for k in range(n):
            h = z.design[i, k]
            if h == 0.0:
                continue
            left -= h * z.error[k]
            for q in range(n):
                if z.design[i, q] != 0.0:
                    spread += h * covariance[k, q] * z.design[i, q]
        adapted[2 * kind] += 0.5
        adapted[2 * kind + 1] += 0.5 * weight * (left * left + spread) / z.variance[i]
