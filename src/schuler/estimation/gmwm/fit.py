"""Processes from wavelet variances, plain or robust."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal

from numpy.typing import ArrayLike, NDArray

from schuler.curves.wavelet_variance import WaveletVarianceCurve, wavelet_variance
from schuler.data._checks import numbers
from schuler.errors import EstimationError, InputError
from schuler.estimation.disturbances.outliers import contamination
from schuler.estimation.gmwm.moments import MomentFit, fit_moments, heterogeneity
from schuler.estimation.gmwm.result import GmwmIdentification, describe_fit
from schuler.estimation.gmwm.scatter import pooled_points, pooled_scatter
from schuler.estimation.parts import parts_of_model
from schuler.estimation.selection import from_several_starts, rough_process, select_structure
from schuler.noise import Process

__all__ = [
    "GmwmIdentification",
    "at_scales_from",
    "fit_gmwm",
    "fit_gmwm_curves",
    "one_channel",
]

Model = str | Process
Robust = bool | Literal["samples", "coefficients"]

_SHORTEST_RECORD = 100
_BAND_EDGES = (10, 50)
_FEWEST_SCALES = 8
_MISFIT = 1e-3


def fit_gmwm(
    signal: ArrayLike,
    rate: float,
    model: Model = "auto",
    robust: Robust = False,
    efficiency: float = 0.6,
) -> GmwmIdentification:
    """Find the sum of processes of a signal by the generalised method of wavelet moments.

    Parameters
    ----------
    signal : (n,) array_like
        Samples at rest, in rad/s or m/s² (or any unit; the result is in the same).
    rate : float
        Samples a second.
    model : {"auto", "classical"} or Process
        "auto" chooses among white noise, quantisation, up to three Gauss-Markov noises, random
        walk and ramp; "classical" is white noise, bias instability and random walk; a process
        (sum) fixes the structure.
    robust : bool or {"samples", "coefficients"}
        As for `wavelet_variance`: hold outliers back.
    efficiency : float
        Of the robust estimate.

    Returns
    -------
    GmwmIdentification
        Process, sandwich standard errors, J test, flags.

    Raises
    ------
    InputError
        Not one-dimensional, not finite, an impossible rate, an unknown model.
    EstimationError
        Fewer than 100 samples, or a signal that does not vary.
    ModelError
        A model without a parameter that a wavelet variance shows.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import WhiteNoise, fit_gmwm
    >>> signal = WhiteNoise(1e-3).simulate(60_000, 0.01, np.random.default_rng(1))
    >>> [part.kind for part in fit_gmwm(signal, 100.0).process.parts]
    ['white_noise']
    """
    values = one_channel(signal)
    curve = wavelet_variance(values, rate, robust, efficiency)
    return fit_gmwm_curves([curve], model, contamination(values).ratio if not robust else 1.0)


def fit_gmwm_curves(
    curves: Sequence[WaveletVarianceCurve], model: Model = "auto", tails: float = 1.0
) -> GmwmIdentification:
    """Fit one model to wavelet variance curves of one sensor."""
    if any(c.rate != curves[0].rate for c in curves):
        raise InputError("records at different rates", expected="one rate")
    for curve in curves:
        if curve.scale.size < 4 or not (curve.variance > 0.0).all():
            raise EstimationError(
                "signal does not vary at every scale",
                expected="noise",
                cure="check that the channel was recorded and is not stuck",
            )
    start = _start(model, curves[0])
    kept, fit = list(curves), None
    candidates: dict[str, float] = {}
    for edge in (1, *_BAND_EDGES):
        slow = [at_scales_from(c, (edge - 0.5) / c.rate) for c in curves]
        if edge > 1 and min(c.scale.size for c in slow) < _FEWEST_SCALES:
            break
        kept = slow
        fit, candidates = _fit(start, kept, 0.0)
        if _fits(fit, kept, 0.0):
            break
    assert fit is not None
    granted = 0.0
    if not _fits(fit, kept, 0.0):
        granted = _discrepancy(fit, kept, 0.0)
        fit, candidates = _fit(start, kept, granted)
        more = _discrepancy(fit, kept, granted)
        if more != granted:
            granted = more
            fit = fit_moments(fit.parts, kept, granted)
    return describe_fit(fit, kept, granted, candidates, tails)


def _fit(
    start: tuple[Process, ...] | None,
    curves: Sequence[WaveletVarianceCurve],
    granted: float,
) -> tuple[MomentFit, dict[str, float]]:
    """Choose the structure where it is not given, and fit it."""
    points = pooled_points(curves)
    if start is None:
        scatter = pooled_scatter(rough_process(points), curves, points)
        chosen, candidates = select_structure(points, scatter.with_discrepancy(granted))
        return fit_moments(chosen.parts, curves, granted), candidates
    scatter = pooled_scatter(rough_process(points), curves, points)
    best = from_several_starts(start, points, scatter)
    return fit_moments(best.parts, curves, granted), {}


def _misfit(
    fit: MomentFit, curves: Sequence[WaveletVarianceCurve], granted: float
) -> tuple[float, int]:
    """Misfit within records and its degrees of freedom: what records do not share is left out."""
    if len(curves) == 1:
        return fit.cost, max(fit.degrees_of_freedom, 1)
    between, freedom = heterogeneity(fit, curves, granted)
    return fit.cost - between, max(fit.degrees_of_freedom - freedom, 1)


def _fits(fit: MomentFit, curves: Sequence[WaveletVarianceCurve], granted: float) -> bool:
    """Whether the misfit may be chance."""
    from scipy.special import chdtri

    chi_square, freedom = _misfit(fit, curves, granted)
    return chi_square <= float(chdtri(freedom, _MISFIT))


def one_channel(signal: ArrayLike) -> NDArray[Any]:
    """Check that a signal is one channel of at least a hundred samples."""
    values = numbers(signal, "signal")
    if values.ndim != 1:
        raise InputError(f"signal has shape {values.shape}", expected="(n,), one channel at a time")
    if values.size < _SHORTEST_RECORD:
        raise EstimationError(
            f"signal has {values.size} samples",
            expected=f"at least {_SHORTEST_RECORD}",
            cure="record longer",
        )
    return values


def at_scales_from(curve: WaveletVarianceCurve, shortest: float) -> WaveletVarianceCurve:
    """Return the curve at scales from `shortest` s on."""
    keep = curve.scale >= shortest * (1.0 - 1e-9)
    return replace(
        curve,
        scale=curve.scale[keep],
        variance=curve.variance[keep],
        lower=curve.lower[keep],
        upper=curve.upper[keep],
        degrees_of_freedom=curve.degrees_of_freedom[keep],
    )


def _start(model: Model, curve: WaveletVarianceCurve) -> tuple[Process, ...] | None:
    if model == "auto":
        return None
    return parts_of_model(model, 1.0 / curve.rate, curve.duration, "a wavelet variance")


def _discrepancy(fit: MomentFit, curves: Sequence[WaveletVarianceCurve], granted: float) -> float:
    """Relative sd to grant to every wavelet variance so that the misfit is as expected."""
    if _fits(fit, curves, granted):
        return granted
    low, high = 1e-5, 3.0
    for _ in range(12):
        middle = math.sqrt(low * high)
        again = fit_moments(fit.parts, curves, middle, steps=1)
        chi_square, freedom = _misfit(again, curves, middle)
        low, high = (middle, high) if chi_square > freedom else (low, middle)
    return math.sqrt(low * high)
