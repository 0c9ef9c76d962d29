"""What the errors of filters that run side by side have in common: GNSS and the start.

Every filter knows its own covariance only. Errors that two share come from fixes that both use
and from the alignment, and pass through the transitions and gains of either: from node to node
P_ij <- T_i P_ij T_j' + sum of K_i sqrt(r_i r_j) K_j', where T_i = (I - K_i H_i) F_i. All of that
is what a filter keeps for its smoother.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.navigation.engine import FilterRun
from schuler.types import FloatArray, IntArray

SHOWN = 15
"""Numbers of a claim: covariance of position, variances of velocity and of attitude."""


@dataclass(frozen=True, slots=True, eq=False)
class SharedErrors:
    """Covariances between k solutions at N nodes."""

    time: FloatArray  # (N,): of the nodes, s
    # before, after: (N, k, k, 15) as `claims` has them, without and with the measurements of the
    # node; nothing for i = j.
    before: FloatArray
    after: FloatArray

    def at(self, time: FloatArray, i: int, j: int) -> FloatArray:
        """Return what solutions i and j share at the samples, (n, 15)."""
        last = self.time.size - 1
        node = np.clip(np.searchsorted(self.time, time, side="right") - 1, 0, last)
        ahead = np.minimum(node + 1, last)
        span = np.where(ahead > node, self.time[ahead] - self.time[node], 1.0)
        share = np.clip((time - self.time[node]) / span, 0.0, 1.0)[:, None]
        share[ahead == node] = 0.0
        shared: FloatArray = self.after[node, i, j] * (1.0 - share)
        shared += self.before[ahead, i, j] * share
        return shared


def claims(position: FloatArray, velocity: FloatArray, attitude: FloatArray) -> FloatArray:
    """Covariance of position (n, 3, 3) and variances (n, 3) side by side, (n, 15)."""
    return np.concatenate([position.reshape(-1, 9), velocity, attitude], axis=1)


def shared_errors(
    runs: Sequence[FilterRun],
    blocks: Sequence[NDArray[np.int64]],
    start: FloatArray,
    lasting: Sequence[IntArray] = (),
) -> SharedErrors | None:
    """Follow what the runs share; None where their nodes are not the same.

    start (k, 9): standard deviations of what the alignments have in common. `lasting`: for each
    run the states of unit variance that are errors of GNSS, the same in all.
    """
    time = runs[0].nodes.time
    if any(run.pieces or not np.array_equal(run.nodes.time, time) for run in runs):
        return None
    k, size = len(runs), max(9 + block.shape[0] for block in blocks)
    shared = np.zeros((k, k, size, size))
    nine = np.arange(9)
    shared[:, :, nine, nine] = start[:, None] * start[None, :]
    own = 9 + np.array(lasting, dtype=np.int64)
    here = np.arange(k)
    if own.size:
        shared[here[:, None, None], here[None, :, None], own[:, None], own[None]] = 1.0
    before, after = np.empty((2, time.size, k, k, SHOWN))
    steps = [_steps(run, block, size) for run, block in zip(runs, blocks, strict=True)]
    for node, parts in enumerate(zip(*steps, strict=True)):
        moved, updated, noise = (np.stack(p) for p in zip(*parts, strict=True))
        shared = moved[:, None] @ shared @ moved.transpose(0, 2, 1)[None]
        if own.size:
            kept = moved[here[:, None], own, own]
            fresh = np.sqrt(np.maximum(1.0 - kept**2, 0.0))
            added = fresh[:, None] * fresh[None]
            shared[here[:, None, None], here[None, :, None], own[:, None], own[None]] += added
        before[node] = _shown(shared)
        if noise.any():
            shared = updated[:, None] @ shared @ updated.transpose(0, 2, 1)[None]
            shared += noise.transpose(0, 2, 1)[:, None] @ noise[None]
        after[node] = _shown(shared)
    return SharedErrors(time, before, after)


def _shown(shared: FloatArray) -> FloatArray:
    """The parts of (k, k, s, s) that solutions claim."""
    k = shared.shape[0]
    of_position = shared[:, :, :3, :3].reshape(k, k, 9)
    rest = np.diagonal(shared, axis1=2, axis2=3)[:, :, 3:9]
    return np.concatenate([of_position, rest], axis=2)


def _steps(
    run: FilterRun, block: NDArray[np.int64], size: int
) -> Iterator[tuple[FloatArray, FloatArray, FloatArray]]:
    """Yield for every node the transition to it, that of its updates, and K sqrt(r) of each.

    Matrices (size, size) with nothing in the places that the run has not; noise (c, size), as
    many rows in all runs that take the same measurements.
    """
    m = block.shape[0]
    state = np.repeat(np.arange(m), block[:, 1])
    within = np.concatenate([np.arange(count) for count in block[:, 1]] or [np.empty(0, int)])
    within = within.astype(int)
    for stretch in run.stretches():
        nodes, aiding = stretch.nodes, stretch.aiding
        for number in range(stretch.first, stretch.stop):
            row = number % len(nodes.covariance)
            moved, updated = np.zeros((size, size)), np.eye(size)
            moved[:9, : 9 + m] = nodes.top[row]
            moved[9 + state, 9 + block[state, 0] + within] = nodes.transition[row][state, within]
            begin, end = nodes.aid[row]
            noise = np.zeros((3 * (end - begin), size))
            for u in range(begin, end):
                place = u % len(aiding.row)
                for c in np.flatnonzero(aiding.scalar[u, :, 1]):
                    h, gain = np.zeros((2, size))
                    h[: 9 + m], gain[: 9 + m] = aiding.row[place, c], aiding.gain[place, c]
                    # of s = h P h' + r, h K is the part that is not noise
                    variance = aiding.scalar[u, c, 1] * (1.0 - h @ gain)
                    updated -= np.outer(gain, h @ updated)
                    noise -= np.outer(noise @ h, gain)
                    noise[3 * (u - begin) + c] = np.sqrt(max(variance, 0.0)) * gain
            yield moved, updated, noise
