"""Gaussian likelihood of white noise + Gauss-Markov noises + a level, by the Kalman filter.

Several filters with slightly different parameters run over the data side by side; differences of
their innovations give the score and the expected information (Durbin and Koopman, Time Series
Analysis by State Space Methods, 2012, ch. 5 and 7).

State s of sample (or block mean) k: x_s(k+1) = phi_s x_s(k) + w_s, y(k) = sum a_s x_s(k) + u, with
var w_s = q_s, var u = r, cov(w_s, u) = c_s. The last state is a level (phi = 1) of which nothing
is known at the start: exact diffuse initialisation by the first value.
"""

from __future__ import annotations

import math

import numpy as np

from schuler.kernels.compile import kernel
from schuler.kernels.structure_fields import Matrix, Vector
from schuler.kernels.structures import structure
from schuler.kernels.types import FloatArray


@structure
class SideBySide:
    """Constants of f filters of d states: phi, a (load), q (drive), c (shared), r (noise, (f,)).

    stationary (f, d): variances of the states that have one.
    """

    phi: Matrix
    load: Matrix
    drive: Matrix
    shared: Matrix
    stationary: Matrix
    noise: Vector


@kernel()
def start_at_first(
    first: float, f: int, filters: SideBySide, state: FloatArray, covariance: FloatArray
) -> None:
    """Write state and covariance of filter f predicted for the second value."""
    phi, load, drive = filters.phi[f], filters.load[f], filters.drive[f]
    shared, stationary, noise = filters.shared[f], filters.stationary[f], filters.noise[f]
    d = phi.size
    level = d - 1
    total = noise
    for i in range(level):
        total += load[i] * load[i] * stationary[i]
    # the level is the first value less all else: its error is minus theirs
    for i in range(d):
        state[i] = 0.0
        for j in range(d):
            covariance[i, j] = 0.0
    for i in range(level):
        covariance[i, i] = phi[i] * phi[i] * stationary[i]
        covariance[i, level] = -phi[i] * load[i] * stationary[i]
        covariance[level, i] = covariance[i, level]
    covariance[level, level] = total
    state[level] = first
    for i in range(d):
        covariance[i, i] += drive[i]
        # u is part of the first value and hangs together with the step that follows
        covariance[level, i] -= shared[i]
        covariance[i, level] -= shared[i]


@kernel(inline=True)
def covariance_step(
    f: int,
    filters: SideBySide,
    covariance: FloatArray,
    gain: FloatArray,
    work: FloatArray,
    tolerance: float,
) -> tuple[float, float]:
    """Write gain and covariance of filter f one step on; return innovation variance and change."""
    phi, load, noise = filters.phi, filters.load, filters.noise
    drive, shared = filters.drive, filters.shared
    d = phi.shape[1]
    variance = noise[f]
    for i in range(d):
        total = 0.0
        for j in range(i + 1):
            total += covariance[f, i, j] * load[f, j]
        for j in range(i + 1, d):
            total += covariance[f, j, i] * load[f, j]
        work[i] = total
        variance += load[f, i] * total
    inverse = 1.0 / variance
    change = 0.0
    for i in range(d):
        gain[f, i] = (phi[f, i] * work[i] + shared[f, i]) * inverse
    for i in range(d):
        scaled = gain[f, i] * variance
        for j in range(i):
            covariance[f, i, j] = phi[f, i] * phi[f, j] * covariance[f, i, j] - scaled * gain[f, j]
        before = covariance[f, i, i]
        after = phi[f, i] * phi[f, i] * before - scaled * gain[f, i] + drive[f, i]
        covariance[f, i, i] = after
        change = max(change, abs(after - before) - tolerance * abs(after))
    return variance, change


@kernel()
def innovations(
    values: FloatArray,
    start: int,
    stop: int,
    phi: FloatArray,
    load: FloatArray,
    gain: FloatArray,
    state: FloatArray,
    out: FloatArray,
) -> None:
    """Run one filter in its steady state and write innovations.

    values (n,): data; start, stop: which of them; phi, load, gain (d,): constants of the filter;
    state (d,): prediction, carried on in place; out (m,): filled up to stop - start.
    """
    d = phi.size
    for k in range(start, stop):
        v = values[k]
        for i in range(d):
            v -= load[i] * state[i]
        for i in range(d):
            state[i] = phi[i] * state[i] + gain[i] * v
        out[k - start] = v


@kernel(reduction=True)
def difference_products(
    base: FloatArray, one: FloatArray, other: FloatArray
) -> tuple[float, float]:
    """Return the sums of (one - base) base and of (one - base)(other - base).

    base, one, other (m,): innovations of three filters.
    """
    score, information = 0.0, 0.0
    for k in range(base.size):
        difference = one[k] - base[k]
        score += difference * base[k]
        information += difference * (other[k] - base[k])
    return score, information


@kernel()
def likelihood_pass(
    values: FloatArray,
    many: SideBySide,
    step: float,
    tolerance: float,
    score: FloatArray,
    information: FloatArray,
) -> tuple[float, float]:
    """Run f filters; filter 0 has the parameters, filter i has parameter i moved by `step`."""
    phi, load = many.phi, many.load
    n, filters, d = values.size, phi.shape[0], phi.shape[1]
    state, gain = np.empty((filters, d)), np.empty((filters, d))
    covariance, work = np.empty((filters, d, d)), np.empty(d)
    v, variance = np.empty(filters), np.empty(filters)
    for i in range(filters - 1):
        score[i] = 0.0
        for j in range(filters - 1):
            information[i, j] = 0.0
    for i in range(filters):
        start_at_first(values[0], i, many, state[i], covariance[i])
    deviance = 0.0
    k = 1
    steady = False
    while k < n and not steady:
        steady = True
        for i in range(filters):
            variance[i], change = covariance_step(i, many, covariance, gain, work, tolerance)
            steady = steady and change <= 0.0
            error = values[k]
            for j in range(d):
                error -= load[i, j] * state[i, j]
            for j in range(d):
                state[i, j] = phi[i, j] * state[i, j] + gain[i, j] * error
            v[i] = error
        deviance += math.log(variance[0]) + v[0] * v[0] / variance[0]
        inverse = 1.0 / variance[0]
        for i in range(filters - 1):
            dv = v[i + 1] - v[0]
            df = (variance[i + 1] - variance[0]) * inverse
            score[i] -= dv * v[0] * inverse + 0.5 * df * (1.0 - v[0] * v[0] * inverse)
            for j in range(i + 1):
                df_other = (variance[j + 1] - variance[0]) * inverse
                information[i, j] += dv * (v[j + 1] - v[0]) * inverse + 0.5 * df * df_other
        k += 1
    block = 2048
    buffer, zero = np.empty((filters, block)), np.zeros(block)
    inverse = 1.0 / variance[0]
    while k < n:
        stop = min(k + block, n)
        m = stop - k
        for i in range(filters):
            innovations(values, k, stop, phi[i], load[i], gain[i], state[i], buffer[i])
        base = buffer[0, :m]
        squares = difference_products(base, zero[:m], zero[:m])[1]
        deviance += m * math.log(variance[0]) + squares * inverse
        for i in range(filters - 1):
            df = (variance[i + 1] - variance[0]) * inverse
            for j in range(i + 1):
                own, both = difference_products(base, buffer[i + 1, :m], buffer[j + 1, :m])
                df_other = (variance[j + 1] - variance[0]) * inverse
                information[i, j] += both * inverse + 0.5 * m * df * df_other
                if j == i:
                    score[i] -= own * inverse + 0.5 * df * (m - squares * inverse)
        k = stop
    for i in range(filters - 1):
        score[i] /= step
        for j in range(i + 1):
            information[i, j] /= step * step
            information[j, i] = information[i, j]
    total = -0.5 * (deviance + (n - 1) * math.log(2.0 * math.pi))
    return total, variance[0]
