"""Lag products, the Burg lattice and one-step residuals: the passes of autoregressive fits.

Spec 3 (S003 (6)-(13)). Every pass goes block by block, so that one block serves all lags or both
halves of a lattice stage while it is in the cache; the block sums also keep rounding small.
"""

from __future__ import annotations

from schuler.kernels.compile import kernel
from schuler.kernels.types import FloatArray


@kernel(reduction=True, inline=True)
def dot(first: FloatArray, second: FloatArray) -> float:
    """Return the sum of products of two views of equal length.

    first, second (n,): views.
    """
    total = 0.0
    for k in range(first.size):
        total += first[k] * second[k]
    return total


@kernel(reduction=True, inline=True)
def energy(first: FloatArray, second: FloatArray) -> float:
    """Return the sum of squares of two views of equal length.

    first, second (n,): views.
    """
    total = 0.0
    for k in range(first.size):
        total += first[k] * first[k] + second[k] * second[k]
    return total


@kernel()
def lag_products(signal: FloatArray, block: int, out: FloatArray) -> None:
    """Sum y(n) y(n-k) over all n >= k, for every lag k.

    signal (n,): samples; block: samples served for all lags before the next block; out (p + 1,):
    filled in place; entry k belongs to lag k.
    """
    for lag in range(out.size):
        out[lag] = 0.0
    for start in range(0, signal.size, block):
        stop = min(start + block, signal.size)
        for lag in range(out.size):
            begin = max(start, lag)
            if begin < stop:
                out[lag] += dot(signal[begin:stop], signal[begin - lag : stop - lag])


@kernel(inline=True)
def lattice_stage(forward: FloatArray, backward: FloatArray, reflection: float) -> None:
    """Replace e_f and e_b(n-1) of a stage by those of the next; S003 (12).

    forward, backward (n,): views of equal length, changed in place; reflection: reflection
    coefficient gamma.
    """
    for k in range(forward.size):
        before = forward[k]
        forward[k] = before + reflection * backward[k]
        backward[k] += reflection * before


@kernel()
def burg_lattice(
    forward: FloatArray,
    backward: FloatArray,
    floor: float,
    block: int,
    reflection: FloatArray,
    error: FloatArray,
) -> int:
    """Reflection coefficients that minimise forward and backward errors, stage by stage.

    gamma_k = -2 sum e_f(n) e_b(n-1) / sum (e_f(n)² + e_b(n-1)²), sums from n = k+1 (S003 (13) with
    its lower limit put right). One pass a stage: a block is carried to the next stage and its sums
    are taken while it is in the cache. The one-sample delay of the backward error is a shift of the
    pairs, never of the data. forward, backward (n,): two copies of the signal, overwritten; floor:
    mean squared error below which the lattice ends: the signal is exactly predictable; block:
    samples of a block; reflection (p,): filled in place; error (p,): mean of forward and backward
    squared errors behind each stage, filled in place. Returns stages done; fewer than p where the
    error reached the floor.
    """
    # pairs (e_f(n), e_b(n-1)): after k stages forward[k + i] belongs to backward[i]
    cross, power = 0.0, 0.0
    pairs = forward.size - 1
    for start in range(0, pairs, block):
        stop = min(start + block, pairs)
        ahead, behind = forward[start + 1 : stop + 1], backward[start:stop]
        cross += dot(ahead, behind)
        power += energy(ahead, behind)
    for order in range(reflection.size):
        if power <= 2.0 * floor * pairs:
            return order
        gamma = -2.0 * cross / power
        reflection[order] = gamma
        shift = order + 1
        cross, power, whole = 0.0, 0.0, 0.0
        for start in range(0, pairs, block):
            stop = min(start + block, pairs)
            ahead, behind = forward[start + shift : stop + shift], backward[start:stop]
            lattice_stage(ahead, behind, gamma)
            whole += energy(ahead, behind)
            # the pairs of the next stage that this block completes
            first = start + shift if start == 0 else start + shift - 1
            ahead, behind = (
                forward[first + 1 : stop + shift],
                backward[first - shift : stop - 1],
            )
            cross += dot(ahead, behind)
            power += energy(ahead, behind)
        error[order] = whole / (2.0 * pairs)
        pairs -= 1
    return reflection.size


@kernel()
def one_step_residuals(
    signal: FloatArray, coefficients: FloatArray, start: int, out: FloatArray
) -> None:
    """Write e(n) = y(n) + sum a_k y(n-k) from n = start on (counted from zero).

    signal (n,): samples; coefficients (p,): a_1 .. a_p of A(z); start: first sample predicted, at
    least p; out (n - start,): filled in place.
    """
    block = 4096
    for begin in range(start, signal.size, block):
        stop = min(begin + block, signal.size)
        part = out[begin - start : stop - start]
        now = signal[begin:stop]
        for k in range(part.size):
            part[k] = now[k]
        for lag in range(1, coefficients.size + 1):
            weight = coefficients[lag - 1]
            past = signal[begin - lag : stop - lag]
            for k in range(part.size):
                part[k] += weight * past[k]
