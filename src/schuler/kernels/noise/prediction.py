"""Kalman filter of one scalar signal through a small state space."""

from __future__ import annotations

import numpy as np

from schuler.kernels.compile import kernel
from schuler.kernels.types import FloatArray


@kernel()
def kalman_states(
    signal: FloatArray,
    transition: FloatArray,
    noise: FloatArray,
    output: FloatArray,
    white: float,
    start: FloatArray,
    states: FloatArray,
) -> None:
    """Write the state estimate behind every sample.

    The gain is held once it has stopped changing; from there a step costs a state update only.
    signal (n,): measurements output @ x + white noise; transition, noise (s, s): x(k+1) =
    transition @ x(k) + w, covariance of w; output (s,): output row; white: variance of the white
    noise of a sample; start (s, s): covariance of the state before the first sample; states (n, s):
    filled in place with the estimates from samples up to and with each.
    """
    size = output.size
    covariance, work = start.copy(), np.zeros((size, size))
    state, ahead, gain, row = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(size)
    steady = False
    for k in range(signal.size):
        if not steady:
            total = white
            for i in range(size):
                row[i] = 0.0
                for j in range(size):
                    row[i] += covariance[i, j] * output[j]
            for i in range(size):
                total += output[i] * row[i]
            change, largest = 0.0, 0.0
            for i in range(size):
                value = row[i] / total if total > 0.0 else 0.0
                change = max(change, abs(value - gain[i]))
                largest = max(largest, abs(value))
                gain[i] = value
            steady = k > 10 and change <= 1e-14 * largest
            for i in range(size):
                for j in range(size):
                    covariance[i, j] -= gain[i] * row[j]
            for i in range(size):
                for j in range(size):
                    work[i, j] = 0.0
                    for m in range(size):
                        work[i, j] += transition[i, m] * covariance[m, j]
            for i in range(size):
                for j in range(i + 1):
                    value = noise[i, j]
                    for m in range(size):
                        value += work[i, m] * transition[j, m]
                    covariance[i, j] = value
                    covariance[j, i] = value
        error = signal[k]
        for i in range(size):
            error -= output[i] * state[i]
        for i in range(size):
            state[i] += gain[i] * error
            states[k, i] = state[i]
        for i in range(size):
            ahead[i] = 0.0
            for j in range(size):
                ahead[i] += transition[i, j] * state[j]
        for i in range(size):
            state[i] = ahead[i]
