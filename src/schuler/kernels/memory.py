"""Everything a filter remembers from one sample to the next, in one flat array.

So a run can stop after any sample, be copied, and go on later or once more from there: the batch
filter, the streaming filter and the smoother that recomputes what it did not store all enter the
same step. `carve` gives the parts their names.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from schuler.kernels.compile import kernel

Array = NDArray[np.float64]

# places of whole numbers: samples taken, measurements taken, nodes made, whether the discrete
# blocks are set to move, refusals in a row of each of 16 kinds; then the steps of each state
# (m places) as raise_blocks keeps them
COUNTERS = 20


@kernel()
def memory_size(m: int, widest: int, accumulating: bool) -> int:
    """Places that `carve` needs for m sensor states in blocks of at most `widest`.

    `accumulating`: whether the transition between nodes is kept as well, for a smoother.
    """
    size = 80 + m + 4 * m * widest + (9 + m) * (9 + m)
    if accumulating:
        size += m * widest + 9 * 264
    return size


@kernel()
def scratch_size(m: int, widest: int) -> int:
    """Places of work that a step needs and forgets."""
    return (max(9, widest) + 24) * 264 + 4 * m + 5 * (9 + m) + 64


@kernel(inline=True)
def carve_navigation(
    memory: Array,
) -> tuple[Array, Array, Array, Array, Array, Array, Array, Array, Array, Array, Array, Array]:
    """Views of what belongs to navigation.

    Position (3,), velocity (3,), quaternion (4,), rotation (3, 3); earth (10,) and transport (3,)
    of the last step; increments of the last sample: angle (3,) and velocity (3,), their coning
    (3,) and sculling (3,); past (3, 6): rate and specific force of the samples before it, newest
    first; habits (14,): smoothed force (3) and rate (3) of a vehicle, weight of a new sample in
    the rate, noise of that rate, step that the transition was made for, log-likelihood, time of
    the last sample, step before it, two places free.
    """
    return (
        memory[0:3],
        memory[3:6],
        memory[6:10],
        memory[10:19].reshape((3, 3)),
        memory[19:29],
        memory[29:32],
        memory[32:35],
        memory[35:38],
        memory[38:41],
        memory[41:44],
        memory[44:62].reshape((3, 6)),
        memory[62:76],
    )


@kernel(inline=True)
def carve_sensors(
    memory: Array, m: int, widest: int
) -> tuple[Array, Array, Array, Array, Array, Array]:
    """Views of what belongs to the sensor states.

    States (m,); transition, noise, power, power_noise (m, w), see kernels/transition.py; then the
    covariance (9 + m, 9 + m) of everything.
    """
    first, block, n = 80, m * widest, 9 + m
    a = first + m
    return (
        memory[first:a],
        memory[a : a + block].reshape((m, widest)),
        memory[a + block : a + 2 * block].reshape((m, widest)),
        memory[a + 2 * block : a + 3 * block].reshape((m, widest)),
        memory[a + 3 * block : a + 4 * block].reshape((m, widest)),
        memory[a + 4 * block : a + 4 * block + n * n].reshape((n, n)),
    )


@kernel(inline=True)
def carve_total(memory: Array, m: int, widest: int) -> tuple[Array, Array]:
    """Views of the transition since the last node: nine rows of 264, and blocks (m, w).

    Of no size where the memory does not accumulate it.
    """
    a = memory_size(m, widest, False)
    if memory.size == a:
        return memory[0:0], memory[0:0].reshape((0, widest))
    return (
        memory[a + m * widest : a + m * widest + 9 * 264],
        memory[a : a + m * widest].reshape((m, widest)),
    )
