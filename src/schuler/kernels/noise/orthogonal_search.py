"""Candidate columns of the Fast Orthogonal Search, block by block (spec 4.1)."""

from __future__ import annotations

from schuler.kernels.compile import kernel
from schuler.kernels.types import FloatArray, IntArray


@kernel()
def fill_candidates(
    signals: FloatArray,
    means: FloatArray,
    sources: IntArray,
    lags: IntArray,
    start: int,
    out: FloatArray,
) -> None:
    """Write the candidates of a block of samples, each less the product of its factors' means.

    With x = m + u, a product is m1 m2 + m1 u2 + u1 (m2 + u2); the constant is never formed, so that
    nothing cancels where the mean (gravity) is large beside the noise. signals (s, n): centred
    signals u, the one to be predicted first; means (s,): means m in the same units; sources, lags
    (c, 2): signals and lags of the two factors; second source -1 for linear candidates; start:
    sample (from zero) that the first column of `out` predicts; out (c, k): filled in place:
    candidate by sample.
    """
    count = out.shape[1]
    for c in range(sources.shape[0]):
        first = signals[sources[c, 0]]
        first = first[start - lags[c, 0] : start - lags[c, 0] + count]
        row = out[c]
        if sources[c, 1] < 0:
            for k in range(count):
                row[k] = first[k]
        else:
            second = signals[sources[c, 1]]
            second = second[start - lags[c, 1] : start - lags[c, 1] + count]
            mean_first, mean_second = means[sources[c, 0]], means[sources[c, 1]]
            for k in range(count):
                row[k] = mean_first * second[k] + first[k] * (mean_second + second[k])
