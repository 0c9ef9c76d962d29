"""Exact Gaussian innovations of an ARMA process.

Spec 5.1: the Kalman filter of the state space of Harvey (Forecasting, Structural Time Series
Models and the Kalman Filter, 3.3) runs with its full covariance until the innovation variance
has come down to its limit, 1 in units of the driving noise; from there on the gains are the
moving-average coefficients and the filter is a plain recursion.
"""

from __future__ import annotations

import numpy as np

from schuler.kernels.compile import kernel
from schuler.kernels.types import FloatArray


@kernel()
def settle(
    signal: FloatArray,
    phi: FloatArray,
    theta: FloatArray,
    covariance: FloatArray,
    state: FloatArray,
    response_state: FloatArray,
    sums: FloatArray,
    out: FloatArray,
) -> int:
    """Run the filter with its full covariance until its gains are constant."""
    s = phi.size
    gain = np.zeros(s)
    filtered = np.zeros((s + 1, s + 1))
    calm = 0
    for t in range(signal.size):
        variance = covariance[0, 0]
        calm = calm + 1 if variance - 1.0 < 1e-13 else 0
        if calm > s:
            return t
        scale = 1.0 / np.sqrt(variance)
        innovation = signal[t] - state[0]
        unit = 1.0 - response_state[0]
        u = innovation * scale
        o = unit * scale
        sums[0] += u * u
        sums[1] += u * o
        sums[2] += o * o
        sums[3] += np.log(variance)
        if out.size > 0:
            out[0, t] = u
            out[1, t] = o
            out[2, t] = np.log(variance)
        for i in range(s):
            gain[i] = covariance[i, 0] / variance
        for i in range(s):
            state[i] += gain[i] * innovation
            response_state[i] += gain[i] * unit
            for j in range(s):
                filtered[i, j] = covariance[i, j] - gain[i] * gain[j] * variance
        # the newest sample is known exactly: keep rounding from blowing up old errors
        for i in range(s):
            filtered[i, 0] = 0.0
            filtered[0, i] = 0.0
        first, unit_first = state[0], response_state[0]
        for i in range(s):
            behind = state[i + 1] if i + 1 < s else 0.0
            unit_behind = response_state[i + 1] if i + 1 < s else 0.0
            state[i] = phi[i] * first + behind
            response_state[i] = phi[i] * unit_first + unit_behind
            for j in range(s):
                covariance[i, j] = filtered[i + 1, j + 1] + theta[i] * theta[j]
    return signal.size


@kernel()
def exact_innovations(
    signal: FloatArray,
    phi: FloatArray,
    theta: FloatArray,
    covariance: FloatArray,
    out: FloatArray,
) -> tuple[float, float, float, float]:
    """Standardised innovations u of a signal and o of a constant, and what the likelihood needs.

    `out` (3, n) or (3, 0): u, o and the logarithms of the variances, where they are wanted.
    """
    s = phi.size
    state = np.zeros(s + 1)
    response_state = np.zeros(s + 1)
    sums = np.zeros(4)
    start = settle(signal, phi, theta, covariance, state[:s], response_state[:s], sums, out)
    n = signal.size
    residual, response, log_variance = out[0], out[1], out[2]
    uu, uo, oo = sums[0], sums[1], sums[2]
    write = out.size > 0
    if s <= 5 and (s < 5 or phi[4] == 0.0):
        # up to four lags: states in registers, the hot loop of every fit
        f1, f2, f3, f4 = 0.0, 0.0, 0.0, 0.0
        m1, m2, m3, m4 = 0.0, 0.0, 0.0, 0.0
        a1, a2, a3, a4 = state[0], 0.0, 0.0, 0.0
        b1, b2, b3, b4 = response_state[0], 0.0, 0.0, 0.0
        f1 = phi[0]
        if s > 1:
            f2, m1, a2, b2 = phi[1], theta[1], state[1], response_state[1]
        if s > 2:
            f3, m2, a3, b3 = phi[2], theta[2], state[2], response_state[2]
        if s > 3:
            f4, m3, a4, b4 = phi[3], theta[3], state[3], response_state[3]
        if s > 4:
            m4 = theta[4]
        for t in range(start, n):
            x = signal[t]
            u = x - a1
            o = 1.0 - b1
            uu += u * u
            uo += u * o
            oo += o * o
            if write:
                residual[t] = u
                response[t] = o
                log_variance[t] = 0.0
            a1 = (f1 * x + a2) + m1 * u
            a2 = (f2 * x + a3) + m2 * u
            a3 = (f3 * x + a4) + m3 * u
            a4 = f4 * x + m4 * u
            b1 = (f1 + b2) + m1 * o
            b2 = (f2 + b3) + m2 * o
            b3 = (f3 + b4) + m3 * o
            b4 = f4 + m4 * o
        return uu, uo, oo, sums[3]
    for t in range(start, n):
        x = signal[t]
        u = x - state[0]
        o = 1.0 - response_state[0]
        uu += u * u
        uo += u * o
        oo += o * o
        if write:
            residual[t] = u
            response[t] = o
            log_variance[t] = 0.0
        for i in range(s):
            ahead = theta[i + 1] if i + 1 < s else 0.0
            state[i] = phi[i] * x + state[i + 1] + ahead * u
            response_state[i] = phi[i] + response_state[i + 1] + ahead * o
    return uu, uo, oo, sums[3]
