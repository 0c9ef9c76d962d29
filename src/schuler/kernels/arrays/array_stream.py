"""One sample of an array as it comes: looked at, fused, and block by block tested for faults.

What is in use changes between samples: pi of the axes, and which are out, are arrays that whoever
holds the stream writes (navigation/mechanizations/array_stream.py).
"""

from __future__ import annotations

import math
from typing import Annotated

import numpy as np

from schuler.kernels.arrays.redundancy import follow
from schuler.kernels.arrays.redundancy_data import Redundancy
from schuler.kernels.compile import kernel
from schuler.kernels.structure_fields import (
    ArrayField,
    Cube,
    Flags,
    Matrix,
    Vector,
    Vector3,
    reals,
)
from schuler.kernels.structures import structure
from schuler.kernels.types import BoolArray, FloatArray

FlagCube = Annotated[BoolArray, ArrayField(np.dtype(np.bool_), (None, None, None))]
FlagTable = Annotated[BoolArray, ArrayField(np.dtype(np.bool_), (None, None))]

FUSED, CHANGED, IMPOSSIBLE = 0, 1, 2
"""What `take_sample` found: all is well; an IMU fell silent or is back; numbers that cannot be."""


@structure
class ArrayStream:
    """The latest samples of k IMUs in rows, and how they are fused now.

    time (rows,): s; values (rows, 2, 3 k): accelerometers, gyros, zero where silent; unheard
    (rows, k): who was silent; absent (rows, 2, 3 k): what was not used; tensor (rows, 9): what
    turns lever arms into force; silent (k,), out (2, 3 k), pi (2, 3, 3 k): now; arm (9, 3 k): see
    `arm_coefficients`; moment (9, 3): what rotation adds to the fused force; sums (2, 3 k): of the
    values less what rotation adds; force, rate: of the latest row; most (2,): what accelerometers
    and gyros can show; turning: there are lever arms.
    """

    time: Vector
    values: Cube
    unheard: FlagTable
    absent: FlagCube
    tensor: Annotated[FloatArray, reals(None, 9)]
    silent: Flags
    out: FlagTable
    pi: Cube
    arm: Annotated[FloatArray, reals(9, None)]
    moment: Annotated[FloatArray, reals(9, 3)]
    sums: Matrix
    force: Vector3
    rate: Vector3
    most: Vector
    turning: bool


@kernel()
def heard(s: ArrayStream, row: int) -> int:
    """Look at a sample: who is silent must be so already, and is set to zero."""
    values, count = s.values, s.silent.size
    for i in range(count):
        total = 0.0
        for c in range(2):
            for m in range(3 * i, 3 * i + 3):
                total += values[row, c, m]
        there = math.isfinite(total)
        if there == s.silent[i]:
            return CHANGED
        s.unheard[row, i] = not there
        for c in range(2):
            for m in range(3 * i, 3 * i + 3):
                if not there:
                    values[row, c, m] = 0.0
                if abs(values[row, c, m]) > s.most[c]:
                    return IMPOSSIBLE
    return FUSED


@kernel(inline=True)
def write_tensor(s: ArrayStream, row: int, p: float, q: float, r: float) -> None:
    """Write what turns lever arms into force; acceleration since the rate (p, q, r) before."""
    x, y, z = s.rate[0], s.rate[1], s.rate[2]
    a = b = c = 0.0
    if row > 0:
        step = s.time[row] - s.time[row - 1]
        a, b, c = (x - p) / step, (y - q) / step, (z - r) / step
    tensor = s.tensor
    tensor[row, 0], tensor[row, 4] = -(y * y) - z * z, -(x * x) - z * z
    tensor[row, 8] = -(x * x) - y * y
    tensor[row, 1], tensor[row, 3] = x * y - c, x * y + c
    tensor[row, 2], tensor[row, 6] = x * z + b, x * z - b
    tensor[row, 5], tensor[row, 7] = y * z - a, y * z + a


@kernel(inline=True)
def add_up(s: ArrayStream, row: int, kind: int, into: Vector3) -> None:
    """Fuse the accelerometers (0) or the gyros (1) of a row."""
    values, pi = s.values, s.pi
    x = y = z = 0.0
    for m in range(values.shape[2]):
        value = values[row, kind, m]
        x += pi[kind, 0, m] * value
        y += pi[kind, 1, m] * value
        z += pi[kind, 2, m] * value
    into[0], into[1], into[2] = x, y, z


@kernel()
def fuse_row(s: ArrayStream, row: int) -> None:
    """Fuse the row behind that of the rate that is kept, and keep who was left out."""
    p, q, r = s.rate[0], s.rate[1], s.rate[2]
    for m in range(s.values.shape[2]):
        s.absent[row, 0, m], s.absent[row, 1, m] = s.out[0, m], s.out[1, m]
    add_up(s, row, 1, s.rate)
    add_up(s, row, 0, s.force)
    if s.turning:
        write_tensor(s, row, p, q, r)
        for i in range(3):
            for c in range(9):
                s.force[i] -= s.tensor[row, c] * s.moment[c, i]


@kernel()
def sum_row(s: ArrayStream, row: int) -> None:
    """Add the values of a row to the sums."""
    for m in range(s.values.shape[2]):
        s.sums[1, m] += s.values[row, 1, m]
        force = s.values[row, 0, m]
        if s.turning:
            for c in range(9):
                force -= s.tensor[row, c] * s.arm[c, m]
        s.sums[0, m] += force


@kernel()
def take_sample(s: ArrayStream, row: int) -> int:
    """Look at the sample in a row and fuse it, unless something is not as before."""
    found = heard(s, row)
    if found == FUSED:
        fuse_row(s, row)
        sum_row(s, row)
    return found


@kernel()
def fuse_again(s: ArrayStream, first: int, stop: int, fused: FloatArray) -> None:
    """Fuse rows once more as it is done now; fused (2, rows, 3) gets forces and rates."""
    if first > 0:
        add_up(s, first - 1, 1, s.rate)
    for row in range(first, stop):
        fuse_row(s, row)
        for i in range(3):
            fused[0, row - first, i], fused[1, row - first, i] = s.force[i], s.rate[i]


@kernel()
def sum_rows(s: ArrayStream, first: int, stop: int) -> None:
    """Make the sums those of some rows."""
    for m in range(s.values.shape[2]):
        s.sums[0, m] = s.sums[1, m] = 0.0
    for row in range(first, stop):
        sum_row(s, row)


@kernel()
def watch_block(s: ArrayStream, r: Redundancy, kind: int, stop: int) -> int:
    """Test the block of rows before `stop`; returns the number of events."""
    given, memory, block = r.given, r.memory, r.tuning.block
    for t in range(block):
        row = stop - block + t
        for m in range(s.values.shape[2]):
            silent = s.unheard[row, m // 3]
            given.measurements[t, m] = math.nan if silent else s.values[row, kind, m]
        if given.arm_tensor.shape[0] > 0:
            for c in range(9):
                given.arm_tensor[t, c] = s.tensor[row, c]
    for m in range(memory.taken.size):
        # the kernel counts blocks from here on: what was taken out before is one block older
        memory.taken[m] -= 1
    memory.events[0] = 0
    number = follow(r)
    memory.seen[0] += block
    return number
