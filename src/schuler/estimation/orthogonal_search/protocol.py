"""Training, evaluation and prediction of a Fast Orthogonal Search on three parts of a record."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from schuler.data.to_dict import ToDict
from schuler.errors import InputError
from schuler.estimation.orthogonal_search.result import FosFit
from schuler.estimation.orthogonal_search.search import Stopping, fast_orthogonal_search
from schuler.estimation.predictors.innovation_floor import (
    check_prediction_floor,
    innovation_variance_of_signal,
)
from schuler.estimation.products import dot

__all__ = ["EvaluatedSearch", "OrthogonalSearchProtocol", "search_by_protocol"]


@dataclass(frozen=True, slots=True)
class EvaluatedSearch:
    """One setting of the search on the evaluation data."""

    # max_lag, degree: setting
    max_lag: int
    degree: int
    terms: int  # terms found in training
    mean_square_error: float  # One-step error on the evaluation data, in u²


@dataclass(frozen=True, slots=True, eq=False)
class OrthogonalSearchProtocol(ToDict):
    """The chosen model and its error on data that nothing was chosen by."""

    fit: FosFit  # trained on the first part; its held-out error is that of the prediction part.
    # max_lag, degree: setting that did best on the evaluation part
    max_lag: int
    degree: int
    evaluated: tuple[EvaluatedSearch, ...]  # all settings
    horizons: tuple[int, ...]  # steps ahead
    mean_square_error: tuple[float, ...]  # on the prediction part at every horizon, in u²
    innovation_variance: float  # floor of the prediction part, in u²


def search_by_protocol(
    signal: ArrayLike,
    training: int,
    evaluation: int,
    *,
    max_lags: Sequence[int] = (1, 2, 5, 10),
    degrees: Sequence[int] = (1, 2),
    max_terms: int | None = None,
    stopping: Stopping | None = "family-wise",
    horizons: Sequence[int] = (1, 10, 100, 1000),
) -> OrthogonalSearchProtocol:
    """Train on the first part, choose lags and degree on the second, predict the rest.

    Parameters
    ----------
    signal : (n,) array_like
        Samples at a constant rate, in u.
    training, evaluation : int
        Samples of the first and of the second part.
    max_lags, degrees : sequence of int
        Candidates.
    max_terms : int, optional
        Most terms of a model.
    stopping : {"family-wise", "single"} or None
        When the search ends, as for `fast_orthogonal_search`.
    horizons : sequence of int
        Steps ahead at which the rest is predicted.

    Returns
    -------
    OrthogonalSearchProtocol
        Chosen lags and degree, and mean square errors by horizon on data never seen, u².

    Raises
    ------
    InputError
        Parts that leave nothing to predict.

    Notes
    -----
    S003 section 4, its three parts of 3, 3 and 54 minutes.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> x = np.random.default_rng(0).normal(size=5000)
    >>> schuler.search_by_protocol(x, 1000, 1000, max_lags=(1, 2), horizons=(1,)).degree
    1
    """
    data = np.asarray(signal, dtype=np.float64)
    if data.ndim != 1 or min(training, evaluation) < 1 or data.size < training + evaluation + 2048:
        raise InputError(
            f"a record of {data.size} samples in parts of {training}, {evaluation} and the rest",
            expected="a rest of at least 2048 samples",
        )
    first, second = data[:training], data[training : training + evaluation]
    rest = data[training + evaluation :]
    table: list[EvaluatedSearch] = []
    best: tuple[FosFit, EvaluatedSearch, np.ndarray] | None = None
    start = max(max_lags)
    for degree in sorted(degrees):
        for lag in sorted(max_lags):
            fit = fast_orthogonal_search(first, lag, degree, max_terms, stopping=stopping)
            squares = fit.residuals(second)[start - fit.memory :] ** 2
            entry = EvaluatedSearch(lag, degree, len(fit.terms), float(squares.mean()))
            table.append(entry)
            if best is None or _clearly_less(squares, best[2]):
                best = (fit, entry, squares)
    if best is None:
        raise InputError("no lags or degrees to try", expected="at least one of each")
    return _predicted(best[0], best[1], tuple(table), first, rest, tuple(horizons))


def _clearly_less(new: np.ndarray, old: np.ndarray) -> bool:
    gain = old - new
    return bool(gain.mean() > 2.0 * gain.std() / np.sqrt(gain.size))


def _predicted(
    fit: FosFit,
    entry: EvaluatedSearch,
    table: tuple[EvaluatedSearch, ...],
    training: np.ndarray,
    rest: np.ndarray,
    horizons: tuple[int, ...],
) -> OrthogonalSearchProtocol:
    from dataclasses import replace

    residuals = fit.residuals(rest)
    held_out = dot(residuals, residuals) / residuals.size
    floor = innovation_variance_of_signal(rest)
    check_prediction_floor(held_out, floor, samples=residuals.size, what="orthogonal search")
    longest = max(horizons)
    origins = np.linspace(
        max(fit.memory - 1, 0), rest.size - 1 - longest, min(4000, rest.size - longest), dtype=int
    )
    foreseen = fit.predict(rest, horizons, origins=origins)
    measured = rest[origins[:, None] + np.array(horizons)]
    errors = np.mean((measured - foreseen) ** 2, axis=0)
    final = replace(fit, held_out_mean_square_error=held_out)
    return OrthogonalSearchProtocol(
        final,
        entry.max_lag,
        entry.degree,
        table,
        horizons,
        tuple(float(e) for e in errors),
        floor,
    )
