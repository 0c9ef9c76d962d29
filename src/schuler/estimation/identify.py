"""One door to every way of finding the processes in a signal."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Literal, overload

from numpy.typing import ArrayLike

from schuler.errors import InputError
from schuler.estimation import series_methods, structure_methods
from schuler.estimation.allan_route import identify_prepared
from schuler.estimation.disturbances.prepare import Prepared, has_lines, prepared
from schuler.estimation.identification import Identification
from schuler.estimation.parts import checked_model
from schuler.estimation.result import MethodIdentification
from schuler.estimation.signals import checked_signal, outlier_flag
from schuler.noise import Process
from schuler.types import FloatArray

Method = Literal[
    "allan",
    "slope",
    "psd",
    "autocorrelation",
    "gmwm",
    "gmwm-robust",
    "ml",
    "ar",
    "ar-covariance",
    "ar-yule-walker",
    "arma",
    "fos",
    "garch",
]
Order = int | tuple[int, int] | None

METHODS: dict[str, str] = {
    "allan": "joint fit of the Allan deviation",
    "slope": "lines of fixed slope on the Allan deviation",
    "psd": "joint fit of the power spectral density",
    "autocorrelation": "white + one Gauss-Markov noise from the autocorrelation",
    "gmwm": "generalised method of wavelet moments",
    "gmwm-robust": "the same, outliers held back",
    "ml": "maximum likelihood through the state space",
    "ar": "autoregressive, Burg",
    "ar-covariance": "autoregressive, least squares",
    "ar-yule-walker": "autoregressive, Yule-Walker",
    "arma": "ARMA, exact maximum likelihood",
    "fos": "Fast Orthogonal Search",
    "garch": "AR, then GARCH for a variance that changes",
}
"""Every method, in words; the order is that of tables and reports."""

STRUCTURAL = ("allan", "slope", "psd", "autocorrelation", "gmwm", "gmwm-robust", "ml")
"""Methods whose answer is a sum of processes: their parameters mean the same."""

_SHORTEST_RECORD = 100


@overload
def identify(
    signal: ArrayLike,
    rate: float,
    model: str | Process = ...,
    method: Literal["allan"] = ...,
    *,
    order: Order = ...,
    shortest: float | None = ...,
    columns: Mapping[str, ArrayLike] | None = ...,
) -> Identification: ...
@overload
def identify(
    signal: ArrayLike,
    rate: float,
    model: str | Process = ...,
    *,
    method: str,
    order: Order = ...,
    shortest: float | None = ...,
    columns: Mapping[str, ArrayLike] | None = ...,
) -> Identification | MethodIdentification: ...
@overload
def identify(
    signal: ArrayLike,
    rate: float,
    model: str | Process,
    method: str,
    *,
    order: Order = ...,
    shortest: float | None = ...,
    columns: Mapping[str, ArrayLike] | None = ...,
) -> Identification | MethodIdentification: ...
def identify(
    signal: ArrayLike,
    rate: float,
    model: str | Process = "auto",
    method: str = "allan",
    *,
    order: Order = None,
    shortest: float | None = None,
    columns: Mapping[str, ArrayLike] | None = None,
) -> Identification | MethodIdentification:
    """Find the processes that a signal is made of, with standard errors.

    Parameters
    ----------
    signal : (n,) array_like
        Samples at rest, in rad/s or m/s² (or any unit; the result is in the same).
    rate : float
        Samples a second.
    model : str or Process
        "auto" chooses among white noise, quantisation, bias instability (flicker), up to three
        Gauss-Markov noises, random walk and ramp; "classical" is W+B+K, as datasheets have it;
        letters such as "W+G+G+K" fix the structure (W white noise, Q quantisation, B bias
        instability, G Gauss-Markov, K random walk, R ramp); a process (sum) fixes it and gives
        start values.
    method : str
        "allan" (generalised least squares on the logarithm of the Allan variance), or any other
        of `METHODS`.
    order : int or (int, int), optional
        Of "ar" and its relatives, "arma", "garch", "fos"; chosen where not given.
    shortest : float, optional
        Time in s below which "psd" and "ml" do not look.
    columns : mapping of str to (n,) array_like, optional
        Quantities beside the signal, such as {"temperature": celsius}: what follows them, their
        squares or their rates beyond doubt is taken off first (methods whose answer is a sum of
        processes).

    Returns
    -------
    Identification or MethodIdentification
        Process, errors, limits, misfit, verdict on the record.

    Raises
    ------
    InputError
        Not one-dimensional, not finite, an impossible rate, an unknown method or model.
    EstimationError
        Fewer than 100 samples, or a signal that does not vary.
    ModelError
        A structure that the method cannot fit.

    Notes
    -----
    Spec 2.4 (b), with the covariance of neighbouring points from the fitted process itself.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> signal = schuler.WhiteNoise(1e-3).simulate(20_000, 0.01, np.random.default_rng(1))
    >>> found = schuler.identify(signal, 100.0)
    >>> round(found.parameters["white_noise.density"], 4)
    0.001
    """
    if method not in METHODS:
        raise InputError(f"method '{method}'", expected=", ".join(METHODS))
    if order is not None and method in STRUCTURAL:
        raise InputError(
            f"an order for method '{method}'", expected="none", cure="give a process as model"
        )
    if not (math.isfinite(rate) and rate > 0.0):
        raise InputError(f"rate is {rate:g} Hz", expected="a finite number above zero")
    model = checked_model(model)
    if shortest is not None and not 0.0 < shortest < math.inf:
        raise InputError(f"shortest time {shortest} s", expected="above zero, finite")
    if columns and method not in STRUCTURAL:
        raise InputError(
            f"columns for method '{method}'", expected=f"one of {', '.join(STRUCTURAL)}"
        )
    values = checked_signal(signal, _SHORTEST_RECORD)
    if method in STRUCTURAL:
        ready = prepared(values, float(rate), columns, lines=not has_lines(model))
        return identify_structure(ready, model, method, shortest)
    return _SERIES[method](values, float(rate), model, order)


def identify_structure(
    ready: Prepared, model: str | Process, method: str, shortest: float | None = None
) -> Identification | MethodIdentification:
    """Find the processes of a signal that was made ready, once for all methods."""
    if method != "allan":
        return _STRUCTURE[method](ready, model, shortest)
    found = identify_prepared(ready, model)
    outlier = outlier_flag(ready.raw, float(ready.raw.mean()))
    return replace(found, flags=(outlier, *found.flags)) if outlier else found


_STRUCTURE: dict[str, Callable[[Prepared, Any, float | None], MethodIdentification]] = {
    "slope": structure_methods.by_slopes,
    "psd": structure_methods.by_spectrum,
    "autocorrelation": structure_methods.by_autocorrelation,
    "gmwm": structure_methods.by_wavelet_moments,
    "gmwm-robust": structure_methods.by_robust_wavelet_moments,
    "ml": structure_methods.by_likelihood,
}
_SERIES: dict[str, Callable[[FloatArray, float, Any, Order], MethodIdentification]] = {
    "ar": series_methods.by_burg,
    "ar-covariance": series_methods.by_covariance,
    "ar-yule-walker": series_methods.by_yule_walker,
    "arma": series_methods.by_arma,
    "fos": series_methods.by_orthogonal_search,
    "garch": series_methods.by_garch,
}
