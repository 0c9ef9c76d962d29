"""Methods whose answer is a sum of processes, in the words that all methods share."""

from __future__ import annotations

from typing import Any

import numpy as np

from schuler.curves.allan import allan_deviation
from schuler.errors import EstimationError, InputError, SchulerError
from schuler.estimation.allan_route import identify_prepared
from schuler.estimation.disturbances.prepare import Prepared
from schuler.estimation.identification import Identification
from schuler.estimation.ieee952 import process_parameters
from schuler.estimation.residuals.diagnostics import (
    ResidualDiagnostics,
    diagnose_residuals,
    process_residuals,
)
from schuler.estimation.result import Fit, MethodIdentification
from schuler.estimation.signals import outlier_flag
from schuler.estimation.slopes import SlopeReadings, slope_method
from schuler.noise import BiasInstability, Process, ProcessSum, RandomWalk, WhiteNoise
from schuler.types import FloatArray

Model = Any
_MOST_PREDICTED = 500_000

_SHARED_FLAGS = {
    "trend": "the signal is a trend rather than noise: remove it, or model a RateRamp",
    "misfit": "no sum of these processes fits the spectrum: standard errors were widened",
    "fast part left out": "frequencies above the sensor's own filter were left out of the fit",
    "not converged": "the fit did not converge",
    "not exponential": "the correlation is not that of one Gauss-Markov noise: use another method",
    "record too short": "the record is shorter than 20 correlation times",
    "at the end of the lags": "the correlation time is as long as the search reached",
    "white part not resolved": "a white part could not be told from zero",
}


def process_diagnostics(
    values: FloatArray, process: Process, rate: float, block: int = 1
) -> ResidualDiagnostics | None:
    """Look at what the Kalman predictor of a process leaves of a signal.

    Of a very long record the middle is looked at: states of every sample would fill the memory.
    """
    if values.size > _MOST_PREDICTED:
        first = (values.size - _MOST_PREDICTED) // 2
        values = values[first : first + _MOST_PREDICTED]
    if block > 1:
        whole = values.size // block * block
        values = (values[:whole] - values[0]).reshape(-1, block).mean(axis=1)
        rate = rate / block
    try:
        residuals = process_residuals(values, process, rate)
    except SchulerError:
        return None
    return diagnose_residuals(
        residuals, expected_variance=_innovation_variance(process, 1.0 / rate), block=block
    )


def _innovation_variance(process: Process, dt: float) -> float | None:
    try:
        variance = float(process.innovation_variance(dt))
    except SchulerError:
        return None
    return variance if np.isfinite(variance) else None


def shared_flag(flag: str) -> str:
    """Return the plain words of a flag of an estimator."""
    return _SHARED_FLAGS.get(flag, flag)


def _answer(
    method: str,
    ready: Prepared,
    process: Process,
    errors: dict[str, float],
    fit: Fit,
    *,
    converged: bool = True,
    flags: tuple[str, ...] = (),
    block: int = 1,
) -> MethodIdentification:
    """An answer in shared words; `errors` has the keys of all that was estimated."""
    words = [shared_flag(flag) for flag in flags]
    outlier = outlier_flag(ready.raw, float(ready.raw.mean()))
    if outlier and method != "gmwm-robust":
        words.append(outlier)
    values = process_parameters(process)
    parameters = {key: values[key] for key in errors}
    diagnostics = process_diagnostics(ready.values, process, ready.rate, block)
    if ready.steady:
        process, numbers, sure = ready.with_lines(process)
        parameters, errors = {**parameters, **numbers}, {**errors, **sure}
    return MethodIdentification(
        method=method,
        process=process,
        no_process="",
        parameters=parameters,
        standard_errors=errors,
        limits=dict(fit.limits) if isinstance(fit, Identification) else {},
        diagnostics=diagnostics,
        converged=converged,
        flags=(*ready.flags(False), *words),
        fit=fit,
        lines=ready.lines,
        effects=ready.effects,
    )


def by_slopes(ready: Prepared, model: Model, shortest: float | None = None) -> MethodIdentification:
    """Read N, B and K off straight runs of the Allan deviation (`slope_method`)."""
    _only_auto(model, "slope")
    curve = allan_deviation(ready.values, ready.rate)
    readings = slope_method(curve)
    parts, errors = _of_readings(readings, ready.rate, curve.duration)
    if not parts:
        raise EstimationError(
            "the Allan deviation has no straight run of slope -1/2, 0 or +1/2",
            cure="use method 'allan', which needs none",
        )
    flags = (
        "errors are those of S004 (15), for clusters that do not overlap; where white noise and "
        "random walk cross, the slope method takes the crossing for bias instability",
    )
    return _answer("slope", ready, ProcessSum(parts), errors, readings, flags=flags)


def _of_readings(
    readings: SlopeReadings, rate: float, duration: float
) -> tuple[tuple[Process, ...], dict[str, float]]:
    parts: list[Process] = []
    errors: dict[str, float] = {}
    named = (
        ("white_noise.density", readings.white_noise),
        ("bias_instability.level", readings.bias_instability),
        ("random_walk.density", readings.random_walk),
    )
    for key, reading in named:
        if reading is None:
            continue
        errors[key] = reading.value * reading.relative_error
        if key.startswith("white"):
            parts.append(WhiteNoise(reading.value))
        elif key.startswith("bias"):
            parts.append(BiasInstability.of_samples(reading.value, 1.0 / rate, duration))
        else:
            parts.append(RandomWalk(reading.value))
    return tuple(parts), errors


def _only_auto(model: Model, method: str) -> None:
    if model != "auto":
        raise InputError(
            f"a model for method '{method}'",
            expected="'auto'",
            cure="methods 'allan', 'psd', 'gmwm' and 'ml' fit a model that is given",
        )


def random_parts(process: ProcessSum) -> ProcessSum:
    """Return what a spectrum can be fitted by: a process without its drifts."""
    random = tuple(p for p in process.parts if p.random)
    if not random:
        raise EstimationError(
            "nothing random is left for a spectrum beside "
            + " + ".join(p.kind for p in process.parts),
            cure="use method 'allan', which fits drifts",
        )
    return ProcessSum(random)


def by_spectrum(
    ready: Prepared, model: Model, shortest: float | None = None
) -> MethodIdentification:
    """Fit the power spectral density (`identify_spectrum`)."""
    from schuler.estimation.spectrum.fit import identify_spectrum

    block = 1 if shortest is None else max(round(shortest * ready.rate), 1)
    highest = 0.5 * ready.rate / block
    if isinstance(model, str):
        # a spectrum alone cannot tell a slow Gauss-Markov noise from a walk
        model = random_parts(identify_prepared(ready, model).process)
    band = None if block == 1 else (0.0, highest)
    fit = identify_spectrum(ready.values, ready.rate, model, band=band)
    return _answer(
        "psd",
        ready,
        fit.process,
        fit.standard_errors,
        fit,
        converged=fit.converged,
        flags=fit.flags,
        block=block,
    )


def by_autocorrelation(
    ready: Prepared, model: Model, shortest: float | None = None
) -> MethodIdentification:
    """Fit white and one Gauss-Markov noise to the autocorrelation (`fit_gauss_markov`)."""
    from schuler.curves.autocorrelation import autocorrelation
    from schuler.estimation.gauss_markov_correlation import fit_gauss_markov

    _only_auto(model, "autocorrelation")
    fit = fit_gauss_markov(autocorrelation(ready.values, ready.rate))
    errors = {
        "gauss_markov.sigma": fit.standard_errors["sigma"],
        "gauss_markov.correlation_time": fit.standard_errors["correlation_time"],
    }
    density = process_parameters(fit.process).get("white_noise.density")
    if density:
        # N² = variance/rate
        errors["white_noise.density"] = fit.standard_errors["white_variance"] / (
            2.0 * ready.rate * density
        )
    return _answer(
        "autocorrelation",
        ready,
        fit.process,
        errors,
        fit,
        converged="not converged" not in fit.flags,
        flags=fit.flags,
    )


def by_wavelet_moments(
    ready: Prepared, model: Model, shortest: float | None = None
) -> MethodIdentification:
    """Fit the wavelet variance (`fit_gmwm`)."""
    return _by_moments("gmwm", ready, model, False)


def by_robust_wavelet_moments(
    ready: Prepared, model: Model, shortest: float | None = None
) -> MethodIdentification:
    """Fit the robust wavelet variance (`fit_gmwm`)."""
    return _by_moments("gmwm-robust", ready, model, True)


def _by_moments(method: str, ready: Prepared, model: Model, robust: bool) -> MethodIdentification:
    from schuler.estimation.gmwm.fit import fit_gmwm

    fit = fit_gmwm(ready.values, ready.rate, model, robust)
    believed = ready.believed(fit.process, model)
    if believed is not None:
        fit = fit_gmwm(ready.values, ready.rate, believed, robust)
    return _of_identification(method, ready, fit)


def by_likelihood(
    ready: Prepared, model: Model, shortest: float | None = None
) -> MethodIdentification:
    """Maximise the likelihood (`fit_maximum_likelihood`)."""
    from schuler.estimation.maximum_likelihood import fit_maximum_likelihood

    block = 1 if shortest is None else max(round(shortest * ready.rate), 1)
    fit = fit_maximum_likelihood(ready.values, ready.rate, model, block)
    return _of_identification("ml", ready, fit, block)


def _of_identification(
    method: str, ready: Prepared, fit: Identification, block: int | None = None
) -> MethodIdentification:
    return _answer(
        method,
        ready,
        fit.process,
        fit.standard_errors,
        fit,
        converged=fit.diagnostics.converged,
        flags=fit.flags,
        block=fastest_block(fit, ready.rate) if block is None else block,
    )


def fastest_block(fit: Identification, rate: float) -> int:
    """Return the samples in the shortest time that a fit describes."""
    return max(round(float(fit.diagnostics.tau[0]) * rate), 1)
