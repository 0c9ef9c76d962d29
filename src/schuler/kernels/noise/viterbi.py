"""The most likely sequence of states that change rarely (Viterbi's algorithm)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.compile import kernel


@kernel()
def rare_changes(
    log_likelihood: NDArray[np.float64], penalty: float, path: NDArray[np.int64]
) -> None:
    """Find the sequence of states of largest likelihood, each change paid for.

    log_likelihood (n, s): of each sample in each state; penalty: what a change from any state to
    any other costs; path (n,): receives the states. Source: Viterbi 1967, IEEE Trans. Inf. Theory
    13(2), with one cost for all changes, so that each step needs the best state only: O(n s).
    """
    n, states = log_likelihood.shape
    came_from = np.empty((n, states), dtype=np.int64)
    score = np.zeros(states)
    for i in range(n):
        best = 0
        for s in range(1, states):
            if score[s] > score[best]:
                best = s
        top = score[best] - penalty
        for s in range(states):
            stays = score[s] >= top
            came_from[i, s] = s if stays else best
            score[s] = (score[s] if stays else top) + log_likelihood[i, s]
    last = 0
    for s in range(1, states):
        if score[s] > score[last]:
            last = s
    for i in range(n - 1, -1, -1):
        path[i] = last
        last = came_from[i, last]
