"""Predictors compared on the same held-out data, one step and many steps ahead (spec 4.5)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from schuler.errors import InputError
from schuler.estimation.autoregressive.fit import select_ar
from schuler.estimation.autoregressive.result import ArFit
from schuler.estimation.orthogonal_search.result import FosFit
from schuler.estimation.predictors.innovation_floor import (
    check_prediction_floor,
    innovation_variance_of_signal,
)
from schuler.estimation.signals import prepare
from schuler.noise import Process
from schuler.types import FloatArray, IntArray

__all__ = ["PredictorComparison", "PredictorErrors", "compare_predictors", "multi_step_ar"]

Predictor = Callable[[IntArray, Sequence[int]], FloatArray]

_FAR_ORIGINS = 4000
_WARM_UP = 10


@dataclass(frozen=True, slots=True, eq=False)
class PredictorErrors:
    """Held-out errors of one predictor."""

    name: str  # such as "last value"
    mean_square_error: FloatArray  # (h,): at every horizon, in u²
    # (h,): the same over the innovation variance: one is the best that exists at one step
    normalised: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class PredictorComparison:
    """All predictors on the same samples."""

    horizons: tuple[int, ...]  # steps ahead
    predictors: tuple[PredictorErrors, ...]  # baselines first
    innovation_variance: float  # what the errors are divided by, in u²
    # "process" if it is that of the given process, else "spectrum" of the held-out data
    floor_from: str
    samples: int  # One-step predictions compared
    ar_order: int  # order that BIC chose

    def __getitem__(self, name: str) -> PredictorErrors:
        """Return the errors of one predictor by its name."""
        for one in self.predictors:
            if one.name == name:
                return one
        names = ", ".join(f"'{p.name}'" for p in self.predictors)
        raise InputError(f"no predictor '{name}'", expected=names)

    def to_dict(self) -> dict[str, Any]:
        """Return plain Python for JSON."""
        return {
            "horizons": list(self.horizons),
            "innovation_variance": self.innovation_variance,
            "floor_from": self.floor_from,
            "samples": self.samples,
            "ar_order": self.ar_order,
            "predictors": {
                p.name: {
                    "mean_square_error": p.mean_square_error.tolist(),
                    "normalised": p.normalised.tolist(),
                }
                for p in self.predictors
            },
        }


def compare_predictors(
    train: ArrayLike,
    held_out: ArrayLike,
    *,
    rate: float,
    process: Process | None = None,
    models: Mapping[str, ArFit | FosFit] | None = None,
    horizons: Sequence[int] = (1, 10, 100, 1000),
    max_order: int = 20,
) -> PredictorComparison:
    """Compare predictors with the baselines that any of them must beat.

    Parameters
    ----------
    train, held_out : (n,) array_like
        Samples at a constant rate, in u.
    rate : float
        Samples a second, Hz.
    process : Process, optional
        The true or identified process; adds a Kalman predictor and its innovation variance.
    models : mapping of str to ArFit or FosFit, optional
        Further predictors by name.
    horizons : sequence of int
        Steps ahead.
    max_order : int
        Of the AR model that BIC chooses.

    Returns
    -------
    PredictorComparison
        Mean square errors by predictor and horizon, u², also over the innovation variance.

    Raises
    ------
    InputError
        Too little held out.

    Notes
    -----
    A one-step error below the innovation variance is refused as a mistake (Kolmogorov, Szegő).

    Examples
    --------
    >>> import numpy as np, schuler
    >>> x = np.random.default_rng(0).normal(size=4000)
    >>> found = schuler.compare_predictors(x[:2000], x[2000:], rate=1.0, horizons=(1,))
    >>> bool(found["zero"].mean_square_error[0] < found["last value"].mean_square_error[0])
    True
    """
    steps = tuple(int(h) for h in horizons)
    if not steps or min(steps) < 1:
        raise InputError(f"horizons {steps}", expected="1 or more steps")
    mean = prepare(train, fewest=4 * max_order).mean
    unseen = prepare(held_out, fewest=4 * max_order)
    data = np.asarray(held_out, dtype=np.float64)
    ar = select_ar(train, max_order, rate=rate)
    every = {"AR by BIC": ar, **(models or {})}
    predictors = _baselines(data, mean, process, rate)
    predictors |= {name: _model_predictor(model, data) for name, model in every.items()}
    memory = max(m.order if isinstance(m, ArFit) else m.memory for m in every.values())
    first = max(memory, unseen.values.size // _WARM_UP)
    origins = np.arange(first, data.size - max(steps))
    if origins.size < 2:
        raise InputError(
            f"{data.size} held-out samples for {max(steps)} steps ahead",
            cure="hold out more data or ask for fewer steps",
        )
    floor = process.innovation_variance(1.0 / rate) if process is not None else 0.0
    source = "process" if floor > 0.0 else "spectrum"
    if floor <= 0.0:
        floor = innovation_variance_of_signal(held_out)
    rows = []
    for name, predictor in predictors.items():
        errors = _mean_squares(data, predictor, steps, origins)
        if 1 in steps:
            one = float(errors[steps.index(1)])
            check_prediction_floor(one, floor, samples=origins.size, what=name)
        rows.append(PredictorErrors(name, errors, errors / floor))
    return PredictorComparison(steps, tuple(rows), floor, source, int(origins.size), ar.order)


def multi_step_ar(
    fit: ArFit, signal: ArrayLike, steps: Sequence[int], origins: ArrayLike
) -> FloatArray:
    """Predict y(origin + h) by an autoregressive model.

    Parameters
    ----------
    fit : ArFit
        The model.
    signal : (n,) array_like
        Samples, in u.
    steps : sequence of int
        Steps h ahead, not decreasing.
    origins : (m,) array_like of int
        Samples up to which all is known.

    Returns
    -------
    (m, len(steps)) ndarray
        Predictions, in u.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> x = np.random.default_rng(0).normal(size=500)
    >>> schuler.multi_step_ar(schuler.fit_ar(x, 2), x, [1, 5], [100, 200, 300]).shape
    (3, 2)
    """
    data = np.asarray(signal, dtype=np.float64) - fit.mean
    base, p = np.asarray(origins, dtype=np.int64), fit.order
    out = np.full((base.size, len(steps)), fit.mean)
    if p == 0:
        return out
    companion = np.zeros((p, p))
    companion[0], companion[1:, :-1] = -fit.coefficients, np.eye(p - 1)
    windows = np.lib.stride_tricks.sliding_window_view(data, p)[:, ::-1]
    past = windows[base - p + 1]
    for column, step in enumerate(steps):
        out[:, column] += past @ np.linalg.matrix_power(companion, step)[0]
    return out


def _baselines(
    data: FloatArray, mean: float, process: Process | None, rate: float
) -> dict[str, Predictor]:
    found: dict[str, Predictor] = {
        "zero": lambda origins, ahead: np.full((origins.size, len(ahead)), mean),
        "last value": lambda origins, ahead: np.repeat(data[origins][:, None], len(ahead), axis=1),
    }
    if process is not None:
        found["Kalman"] = _kalman_predictor(process, data - mean, rate, mean)
    return found


def _model_predictor(model: ArFit | FosFit, data: FloatArray) -> Predictor:
    if isinstance(model, ArFit):
        return lambda origins, ahead: multi_step_ar(model, data, ahead, origins)
    return lambda origins, ahead: model.predict(data, ahead, origins=origins)


def _kalman_predictor(process: Process, centred: FloatArray, rate: float, mean: float) -> Predictor:
    from schuler.kernels.noise.prediction import kalman_states

    dt = 1.0 / rate
    space = process.state_space(dt)
    states = np.zeros((centred.size, space.size))
    kalman_states(
        centred,
        space.transition,
        space.noise_covariance,
        space.output,
        space.white_density**2 / dt,
        space.initial_covariance,
        states,
    )

    def predict(origins: IntArray, ahead: Sequence[int]) -> FloatArray:
        rows = [space.output @ np.linalg.matrix_power(space.transition, h) for h in ahead]
        return np.asarray(mean + states[origins] @ np.array(rows).reshape(len(ahead), -1).T)

    return predict


def _mean_squares(
    data: FloatArray, predictor: Predictor, steps: tuple[int, ...], origins: IntArray
) -> FloatArray:
    out = np.empty(len(steps))
    far = origins[:: max(1, math.ceil(origins.size / _FAR_ORIGINS))]
    later = [k for k, h in enumerate(steps) if h > 1]
    for column, step in enumerate(steps):
        if step == 1:
            out[column] = np.mean((data[origins + 1] - predictor(origins, (1,))[:, 0]) ** 2)
    if later:
        foreseen = predictor(far, tuple(steps[k] for k in later))
        for column, k in enumerate(later):
            out[k] = np.mean((data[far + steps[k]] - foreseen[:, column]) ** 2)
    return out
