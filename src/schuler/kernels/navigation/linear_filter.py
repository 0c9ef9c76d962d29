"""A Kalman filter on the error states of a drive that was linearised about one run.

Its steps lead from one measurement to the next, over as many samples as lie between. What a step
adds to the covariance is linear in the densities of the white noise: each of the six channels has
its own part, so that another noise needs no other linearisation.

Errors are computed minus true as in filter.py, and what the run fed back is taken out of them
where it was fed back.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np

from schuler.kernels.compile import kernel
from schuler.kernels.structure_fields import Cube, Flags, Matrix, Places, reals
from schuler.kernels.structures import structure
from schuler.kernels.types import FloatArray, IntArray

PACKED = 45
"""Numbers of a symmetric matrix of the nine navigation errors, row by row of its lower half."""


@structure
class LinearSteps:
    """k steps of s = 9 + m states, each to a moment after which measurements may follow.

    top (k, 9, s) and decay (k, m): transition of the navigation and of the sensor errors; shift
    (k, s): what it takes off; noise (k, m): variance that drives the sensor errors; white
    (k, 6, PACKED) and weight (k, 6): covariance by a unit density of every channel, and its
    squared density; stop (k,): number of the measurement behind the last of this moment; begins
    (k,): whether a filter begins here instead.
    """

    top: Cube
    decay: Matrix
    shift: Matrix
    noise: Matrix
    white: Cube
    weight: Matrix
    stop: Places
    begins: Flags

    @classmethod
    def zeros(cls, steps: int, size: int) -> LinearSteps:
        """To be written."""
        m = size - 9
        return cls(
            top=np.zeros((steps, 9, size)),
            decay=np.zeros((steps, m)),
            shift=np.zeros((steps, size)),
            noise=np.zeros((steps, m)),
            white=np.zeros((steps, 6, PACKED)),
            weight=np.zeros((steps, 6)),
            stop=np.zeros(steps, dtype=np.int64),
            begins=np.zeros(steps, dtype=np.bool_),
        )


@structure
class LinearRows:
    """r measurements of three components.

    design (r, 3, s): H; variance (r, 3): of the noise, 0 where a component is not used; residual
    (r, 3): predicted by the run minus measured; correction (r, s): what the run fed back after
    it; scalar (r, 3, 2): innovation and its variance of every component that is used, written.
    """

    design: Cube
    variance: Matrix
    residual: Matrix
    correction: Matrix
    scalar: Annotated[FloatArray, reals(None, 3, 2)]


@kernel(reduction=True)
def white_noise_parts(
    step: IntArray,
    span: FloatArray,
    ahead: FloatArray,
    rotation: FloatArray,
    force: FloatArray,
    white: FloatArray,
) -> None:
    """Add what a unit of white noise in parts of steps becomes at the end of their step.

    Part j of `step` (n,) lasts `span`; behind it lie `ahead` seconds, in which specific force in
    NED adds up to force[j, 0] and, doubly integrated, to force[j, 1]. Writes white (k, 6, PACKED).
    """
    g = np.zeros(9)
    for j in range(step.size):
        for c in range(6):
            axis = c % 3
            x, y, z = rotation[j, 0, axis], rotation[j, 1, axis], rotation[j, 2, axis]
            if c < 3:
                g[0], g[1], g[2] = ahead[j] * x, ahead[j] * y, ahead[j] * z
                g[3], g[4], g[5] = x, y, z
                g[6], g[7], g[8] = 0.0, 0.0, 0.0
            else:
                for part in range(2):
                    f0, f1, f2 = force[j, 1 - part, 0], force[j, 1 - part, 1], force[j, 1 - part, 2]
                    g[3 * part] = f1 * z - f2 * y
                    g[3 * part + 1] = f2 * x - f0 * z
                    g[3 * part + 2] = f0 * y - f1 * x
                g[6], g[7], g[8] = x, y, z
            place = 0
            for i in range(9):
                for k in range(i + 1):
                    white[step[j], c, place] += span[j] * g[i] * g[k]
                    place += 1


@kernel(reduction=True)
def turn_packed(top: FloatArray, packed: FloatArray, full: FloatArray, half: FloatArray) -> None:
    """F W F' of a packed W and the first nine columns of `top`, in place; two works (9, 9)."""
    place = 0
    for i in range(9):
        for k in range(i + 1):
            full[i, k] = packed[place]
            full[k, i] = packed[place]
            place += 1
    for i in range(9):
        for k in range(9):
            half[i, k] = 0.0
        for q in range(9):
            f = top[i, q]
            for k in range(9):
                half[i, k] += f * full[q, k]
    place = 0
    for i in range(9):
        for k in range(i + 1):
            value = 0.0
            for q in range(9):
                value += half[i, q] * top[k, q]
            packed[place] = value
            place += 1


@kernel(reduction=True)
def join_step(
    base: LinearSteps, k: int, jump: FloatArray, joined: LinearSteps, n: int, work: FloatArray
) -> None:
    """Let step k of `base` follow what step n of `joined` is so far; `jump` is fed back before."""
    s = jump.size
    top, whole, full = base.top[k], work[0], work[1]
    shift = joined.shift[n]
    for i in range(s):
        shift[i] += jump[i]
    for i in range(9):
        for a in range(s):
            whole[i, a] = top[i, a] * joined.decay[n, a - 9] if a > 8 else 0.0
        for q in range(9):
            f = top[i, q]
            for a in range(s):
                whole[i, a] += f * joined.top[n, q, a]
        full[0, i] = 0.0
        for a in range(s):
            full[0, i] += top[i, a] * shift[a]
    for i in range(9):
        shift[i] = full[0, i]
        for a in range(s):
            joined.top[n, i, a] = whole[i, a]
    for j in range(s - 9):
        shift[9 + j] *= base.decay[k, j]
        joined.decay[n, j] *= base.decay[k, j]
    for c in range(6):
        turn_packed(top, joined.white[n, c], work[0], work[1])
        for place in range(base.white.shape[2]):
            joined.white[n, c, place] += base.white[k, c, place]


@kernel()
def join_steps(
    base: LinearSteps, first: IntArray, last: IntArray, jump: FloatArray, joined: LinearSteps
) -> None:
    """Make one step of all those of `base` behind `first` up to `last`.

    `jump` (k, s): what the run fed back at the end of every step.
    """
    s = jump.shape[1]
    work = np.zeros((2, 9, s))
    for n in range(first.size):
        k = min(first[n] + 1, last[n])
        joined.top[n, :, :] = base.top[k]
        joined.decay[n, :] = base.decay[k]
        joined.white[n, :, :] = base.white[k]
        for after in range(k + 1, last[n] + 1):
            join_step(base, after, jump[after - 1], joined, n, work)


@kernel(reduction=True)
def move_errors(
    steps: LinearSteps, k: int, covariance: FloatArray, error: FloatArray, work: FloatArray
) -> None:
    """P <- F P F' + Q and e <- F e - shift over step k; half of the drive's noise comes first."""
    s = error.size
    m = s - 9
    top, decay, noise = steps.top[k], steps.decay[k], steps.noise[k]
    for j in range(m):
        covariance[9 + j, 9 + j] += 0.5 * noise[j]
    for i in range(9):
        value = 0.0
        for a in range(s):
            work[i, a] = 0.0
            value += top[i, a] * error[a]
        work[9, i] = value - steps.shift[k, i]
        for q in range(s):
            f = top[i, q]
            if f != 0.0:
                for a in range(s):
                    work[i, a] += f * covariance[q, a]
    place = 0
    for i in range(9):
        error[i] = work[9, i]
        for q in range(i + 1):
            value = 0.0
            for c in range(6):
                value += steps.weight[k, c] * steps.white[k, c, place]
            for a in range(s):
                value += work[i, a] * top[q, a]
            covariance[i, q], covariance[q, i] = value, value
            place += 1
        for j in range(m):
            value = work[i, 9 + j] * decay[j]
            covariance[i, 9 + j], covariance[9 + j, i] = value, value
    for j in range(m):
        error[9 + j] = decay[j] * error[9 + j] - steps.shift[k, 9 + j]
        for i in range(m):
            covariance[9 + j, 9 + i] *= decay[j] * decay[i]
        covariance[9 + j, 9 + j] += 0.5 * noise[j]


@kernel(reduction=True)
def take_row(
    rows: LinearRows, u: int, covariance: FloatArray, error: FloatArray, gain: FloatArray
) -> None:
    """Update with the components of measurement u one after the other, then feed back."""
    s = error.size
    for i in range(3):
        if rows.variance[u, i] <= 0.0:
            continue
        innovation, total = rows.residual[u, i], rows.variance[u, i]
        for a in range(s):
            gain[a] = 0.0
        for q in range(s):
            h = rows.design[u, i, q]
            if h != 0.0:
                innovation -= h * error[q]
                for a in range(s):
                    gain[a] += h * covariance[q, a]
        for a in range(s):
            total += rows.design[u, i, a] * gain[a]
        rows.scalar[u, i, 0], rows.scalar[u, i, 1] = innovation, total
        for q in range(s):
            share = gain[q] / total
            error[q] += share * innovation
            for a in range(s):
                covariance[q, a] -= share * gain[a]
    for a in range(s):
        error[a] -= rows.correction[u, a]


@kernel()
def linear_innovations(
    steps: LinearSteps, rows: LinearRows, covariance: FloatArray, error: FloatArray
) -> None:
    """Filter from a start (s, s), (s,) at every step that begins, and write the innovations."""
    s = error.size
    own, e = covariance.copy(), error.copy()
    work, gain = np.zeros((10, s)), np.zeros(s)
    u = 0
    for k in range(steps.begins.size):
        if steps.begins[k]:
            for i in range(s):
                e[i] = error[i]
                for j in range(s):
                    own[i, j] = covariance[i, j]
        else:
            move_errors(steps, k, own, e, work)
        while u < steps.stop[k]:
            take_row(rows, u, own, e, gain)
            u += 1
