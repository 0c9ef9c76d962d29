"""Orders of an ARMA model by AIC or BIC, with care for roots that do not belong."""

from __future__ import annotations

import math
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import InputError
from schuler.estimation.arma.fit import (
    UNIT_ROOT,
    ErrorKind,
    Scaled,
    check_orders,
    finish,
    is_common_factor,
    nearest_pair,
)
from schuler.estimation.arma.likelihood import split
from schuler.estimation.arma.result import ArmaCandidate, ArmaFit
from schuler.estimation.arma.search import Climb, climb, search
from schuler.estimation.signals import checked_signal
from schuler.noise.arma import poles_of, zeros_of
from schuler.types import FloatArray


def select_arma(
    signal: ArrayLike,
    max_p: int = 4,
    max_q: int = 4,
    *,
    criterion: Literal["aic", "bic"] = "aic",
    rate: float = 1.0,
    errors: ErrorKind = "outer_product",
    choosing: int | None = None,
) -> ArmaFit:
    """Choose the orders of an ARMA model by AIC or BIC, all on the same samples.

    Parameters
    ----------
    signal : (n,) array_like
        Samples in any unit u.
    max_p, max_q : int
        The grid is 0 .. max_p by 0 .. max_q.
    criterion : {"aic", "bic"}
        AIC as in S000; BIC finds the true order of a long record more reliably.
    rate : float
        Samples a second.
    errors : {"outer_product", "information", "robust"}
        As for `fit_arma`.
    choosing : int, optional
        Orders are compared on so many samples in the middle of the record, and only the best is
        fitted to all of it.

    Returns
    -------
    ArmaFit
        The best among the fits that are stationary and invertible (all roots below 1 - 1e-4) and
        have no common factor; `candidates` has all of them, with the reason of rejection.

    Raises
    ------
    InputError
        Not one-dimensional, not finite, unknown criterion.
    EstimationError
        Too few samples, or a signal that does not vary.

    Notes
    -----
    Spec 5.1.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import select_arma
    >>> white = np.random.default_rng(1).standard_normal(3_000)
    >>> select_arma(white, 1, 1, criterion="bic").phi.size
    0
    """
    check_orders(max_p, max_q)
    if criterion not in ("aic", "bic"):
        raise InputError(f"criterion '{criterion}'", expected="'aic' or 'bic'")
    values = checked_signal(signal, 10 + 5 * (max_p + max_q))
    scaled = Scaled.of(values, rate)
    unit, scale = scaled.unit, scaled.scale
    size = min(max(choosing or unit.size, 10 + 5 * (max_p + max_q)), unit.size)
    middle = (unit.size - size) // 2
    part = unit[middle : middle + size]
    climbs: dict[tuple[int, int], Climb] = {}
    for p in range(max_p + 1):
        for q in range(max_q + 1):
            climbs[p, q] = _with_neighbours(part, p, q, climbs)
    candidates = tuple(
        _candidate(p, q, found, climbs, size, scale) for (p, q), found in climbs.items()
    )
    allowed = [c for c in candidates if not c.rejected]
    warnings: tuple[str, ...] = () if allowed else ("no order passes: every fit was rejected",)
    chosen = min(allowed or candidates, key=lambda c: c.aic if criterion == "aic" else c.bic)
    if size < unit.size:
        warnings += (
            f"orders ({chosen.p}, {chosen.q}) were chosen by {criterion.upper()} among "
            f"{len(candidates)} on {size} samples in the middle of the record",
        )
    best = climb(unit, climbs[chosen.p, chosen.q].coefficients, chosen.p)
    return finish(scaled, best, chosen.p, errors, warnings, candidates)


def _with_neighbours(
    unit: FloatArray, p: int, q: int, climbs: dict[tuple[int, int], Climb]
) -> Climb:
    """Search, and never end below a smaller model that is a special case."""
    hints = []
    if p:
        small = climbs[p - 1, q].coefficients
        hints.append(np.concatenate([small[: p - 1], [0.0], small[p - 1 :]]))
    if q:
        hints.append(np.append(climbs[p, q - 1].coefficients, 0.0))
    found = search(unit, p, q, hints, rough=True)
    for start in hints:
        again = climb(unit, start, p, rough=True, steps=0)
        if again.at.value > found.at.value:
            found = max(climb(unit, start, p, rough=True), found, key=lambda c: c.at.value)
    return found


def _candidate(
    p: int, q: int, found: Climb, climbs: dict[tuple[int, int], Climb], n: int, scale: float
) -> ArmaCandidate:
    rejected = ""
    phi, theta = split(found.coefficients, p)
    distance, pole, _ = nearest_pair(found.coefficients, p)
    if phi.size and abs(poles_of(phi)[0]) > 1.0 - UNIT_ROOT:
        rejected = f"pole of modulus {abs(poles_of(phi)[0]):.6f}"
    elif theta.size and abs(zeros_of(theta)[0]) > 1.0 - UNIT_ROOT:
        rejected = f"zero of modulus {abs(zeros_of(theta)[0]):.6f}"
    elif p and q and is_common_factor(distance, found.at, climbs[p - 1, q - 1].at):
        rejected = f"common factor near {pole:.3f}: reduces to ARMA({p - 1}, {q - 1})"
    value = found.at.value - n * math.log(scale)
    count = p + q + 2
    aic, bic = 2.0 * count - 2.0 * value, math.log(n) * count - 2.0 * value
    return ArmaCandidate(p, q, value, aic, bic, rejected)
