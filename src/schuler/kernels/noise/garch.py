"""Conditional variances of GARCH noise, with likelihood, scores and information in one pass.

Spec 5.2: s_t = alpha_0 + sum alpha_i e²(t-i) + sum beta_j s(t-j), p squared shocks, q variances.
"""

from __future__ import annotations

import numpy as np

from schuler.kernels.compile import kernel
from schuler.kernels.types import FloatArray


@kernel()
def garch_variances(
    squares: FloatArray,
    alpha0: float,
    alpha: FloatArray,
    beta: FloatArray,
    before: float,
    variances: FloatArray,
) -> None:
    """Fill in the conditional variances, each from the past alone."""
    for t in range(squares.size):
        total = alpha0
        for i in range(alpha.size):
            total += alpha[i] * (squares[t - 1 - i] if t > i else before)
        for j in range(beta.size):
            total += beta[j] * (variances[t - 1 - j] if t > j else before)
        variances[t] = total


@kernel()
def garch11_slopes(
    squares: FloatArray,
    alpha0: float,
    alpha: float,
    beta: float,
    before: float,
    score: FloatArray,
    information: FloatArray,
    outer: FloatArray,
) -> float:
    """Log likelihood of GARCH(1,1) less its constant, with derivatives."""
    product, logs, fit = 1.0, 0.0, 0.0
    g0 = g1 = g2 = 0.0
    i00 = i01 = i02 = i11 = i12 = i22 = 0.0
    o00 = o01 = o02 = o11 = o12 = o22 = 0.0
    d0 = d1 = d2 = 0.0
    square, variance = before, before
    with_outer = outer.size > 0
    for t in range(squares.size):
        d0 = 1.0 + beta * d0
        d1 = square + beta * d1
        d2 = variance + beta * d2
        variance = alpha0 + alpha * square + beta * variance
        square = squares[t]
        inverse = 1.0 / variance
        ratio = square * inverse
        fit += ratio
        # one logarithm for many samples
        product *= variance
        if not 1e-100 < product < 1e100:
            logs += np.log(product)
            product = 1.0
        a, b, c = d0 * inverse, d1 * inverse, d2 * inverse
        surprise = 0.5 * (ratio - 1.0)
        g0 += surprise * a
        g1 += surprise * b
        g2 += surprise * c
        i00 += a * a
        i01 += a * b
        i02 += a * c
        i11 += b * b
        i12 += b * c
        i22 += c * c
        if with_outer:
            a, b, c = surprise * a, surprise * b, surprise * c
            o00 += a * a
            o01 += a * b
            o02 += a * c
            o11 += b * b
            o12 += b * c
            o22 += c * c
    score[0], score[1], score[2] = g0, g1, g2
    information[0, 0], information[1, 1], information[2, 2] = 0.5 * i00, 0.5 * i11, 0.5 * i22
    information[0, 1] = information[1, 0] = 0.5 * i01
    information[0, 2] = information[2, 0] = 0.5 * i02
    information[1, 2] = information[2, 1] = 0.5 * i12
    if with_outer:
        outer[0, 0], outer[1, 1], outer[2, 2] = o00, o11, o22
        outer[0, 1] = outer[1, 0] = o01
        outer[0, 2] = outer[2, 0] = o02
        outer[1, 2] = outer[2, 1] = o12
    return float(-0.5 * (logs + np.log(product) + fit))


@kernel()
def arma_garch_slopes(
    signal: FloatArray,
    parameters: FloatArray,
    orders: tuple[int, int, int, int],
    before: float,
    score: FloatArray,
    information: FloatArray,
    outer: FloatArray,
    work: FloatArray,
) -> float:
    """Log likelihood of ARMA(p, q) with GARCH(shocks, memories) innovations, less its constant.

    orders: p, q, shocks, memories; p of -1: without a mean; work (2, n): residuals
    and variances.
    """
    p, q, shocks, memories = orders
    residual, variances = work[0], work[1]
    k = parameters.size
    lead = p + q + 1
    mean = parameters[0] if p >= 0 else 0.0
    depth = max(q, memories, shocks) + 1
    de = np.zeros((depth, k))
    ds = np.zeros((depth, k))
    one = np.zeros(k)
    with_outer = outer.size > 0
    for m in range(k):
        score[m] = 0.0
        for r in range(k):
            information[m, r] = 0.0
            if with_outer:
                outer[m, r] = 0.0
    value = 0.0
    for t in range(signal.size):
        now = t % depth
        e = signal[t] - mean
        for m in range(k):
            de[now, m] = 0.0
            ds[now, m] = 0.0
        if p >= 0:
            de[now, 0] = -1.0
        for i in range(1, p + 1):
            past = signal[t - i] - mean if t >= i else 0.0
            e -= parameters[i] * past
            de[now, i] = -past
            if t >= i:
                de[now, 0] += parameters[i]
        for j in range(1, q + 1):
            if t >= j:
                e -= parameters[p + j] * residual[t - j]
                de[now, p + j] -= residual[t - j]
                for m in range(lead):
                    de[now, m] -= parameters[p + j] * de[(t - j) % depth, m]
        residual[t] = e
        s = parameters[lead]
        ds[now, lead] = 1.0
        for i in range(1, shocks + 1):
            square = residual[t - i] * residual[t - i] if t >= i else before
            s += parameters[lead + i] * square
            ds[now, lead + i] += square
            if t >= i:
                for m in range(lead):
                    slope = 2.0 * residual[t - i] * de[(t - i) % depth, m]
                    ds[now, m] += parameters[lead + i] * slope
        for j in range(1, memories + 1):
            weight = parameters[lead + shocks + j]
            variance = variances[t - j] if t >= j else before
            s += weight * variance
            ds[now, lead + shocks + j] += variance
            if t >= j:
                for m in range(k):
                    ds[now, m] += weight * ds[(t - j) % depth, m]
        variances[t] = s
        value -= 0.5 * (np.log(s) + e * e / s)
        surprise = 0.5 * (e * e / s - 1.0) / s
        for m in range(k):
            one[m] = surprise * ds[now, m] - e / s * de[now, m]
            score[m] += one[m]
        for m in range(k):
            left, right = 0.5 * ds[now, m] / (s * s), de[now, m] / s
            for r in range(m + 1):
                information[m, r] += left * ds[now, r] + right * de[now, r]
                if with_outer:
                    outer[m, r] += one[m] * one[r]
    for m in range(k):
        for r in range(m):
            information[r, m] = information[m, r]
            if with_outer:
                outer[r, m] = outer[m, r]
    return value


@kernel()
def garch_noise(
    noise: FloatArray,
    alpha0: float,
    alpha: FloatArray,
    beta: FloatArray,
    before: float,
    variances: FloatArray,
) -> None:
    """Turn white unit noise into GARCH noise, in place."""
    for t in range(noise.size):
        total = alpha0
        for i in range(alpha.size):
            total += alpha[i] * (noise[t - 1 - i] ** 2 if t > i else before)
        for j in range(beta.size):
            total += beta[j] * (variances[t - 1 - j] if t > j else before)
        variances[t] = total
        noise[t] *= np.sqrt(total)
