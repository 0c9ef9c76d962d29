"""Methods whose answer predicts samples from samples, in the words that all methods share."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from schuler.data.to_dict import ToDict
from schuler.errors import InputError, ModelError
from schuler.estimation.arma.fit import ArmaFit
from schuler.estimation.autoregressive.result import ArFit
from schuler.estimation.autoregressive.result import Method as ArMethod
from schuler.estimation.garch.fit import GarchFit
from schuler.estimation.orthogonal_search.result import FosFit
from schuler.estimation.residuals.diagnostics import diagnose_residuals
from schuler.estimation.result import MethodIdentification
from schuler.noise import Process
from schuler.noise.arma import ARMA
from schuler.noise.autoregressive import Autoregressive
from schuler.types import FloatArray

Order = int | tuple[int, int] | None
Model = Any

MOST_LAGS = 20
FOS_LAGS = 10
ARMA_ORDERS = 3
CHOOSING_SAMPLES = 24_000
"""Orders of long ARMA models are chosen on so many samples; the fit takes all."""


@dataclass(frozen=True, slots=True, eq=False)
class ArGarchFit(ToDict):
    """An autoregressive model for the mean, GARCH for the variance of what it leaves."""

    ar: ArFit  # of the signal
    garch: GarchFit  # of its one-step errors

    def residuals(self, signal: FloatArray) -> FloatArray:
        """One-step errors of the AR model, in u."""
        return self.ar.residuals(signal)

    def volatility(self, signal: FloatArray) -> FloatArray:
        """Standard deviation of every sample given its past, in u; from sample p on."""
        return self.garch.volatility(self.ar.residuals(signal))


def by_burg(
    values: FloatArray, rate: float, model: Model, order: Order = None
) -> MethodIdentification:
    """Fit an AR model by Burg's lattice, order by BIC (`select_ar`)."""
    return _by_ar("ar", "burg", values, rate, model, order)


def by_covariance(
    values: FloatArray, rate: float, model: Model, order: Order = None
) -> MethodIdentification:
    """Fit an AR model by least squares, order by BIC (`select_ar`)."""
    return _by_ar("ar-covariance", "covariance", values, rate, model, order)


def by_yule_walker(
    values: FloatArray, rate: float, model: Model, order: Order = None
) -> MethodIdentification:
    """Fit an AR model by Yule-Walker, order by BIC (`select_ar`)."""
    return _by_ar("ar-yule-walker", "yule-walker", values, rate, model, order)


def _one(order: Order, method: str) -> int | None:
    if order is None or (isinstance(order, int) and not isinstance(order, bool)):
        return order
    raise InputError(f"order {order} for method '{method}'", expected="one number")


def _two(order: Order, method: str) -> tuple[int, int] | None:
    if order is None or (isinstance(order, tuple) and len(order) == 2):
        return order
    raise InputError(f"order {order} for method '{method}'", expected="two numbers")


def _no_structure(model: Model, method: str, kind: type[Process] | None = None) -> None:
    if model == "auto" or (kind is not None and isinstance(model, kind)):
        return
    raise InputError(
        f"model {model!r} for method '{method}'",
        expected="'auto'" if kind is None else f"'auto' or an {kind.__name__} process",
        cure="sums of processes are fitted by 'allan', 'psd', 'gmwm' and 'ml'",
    )


def _ar(values: FloatArray, rate: float, kind: ArMethod, order: int | None) -> ArFit:
    from schuler.estimation.autoregressive.fit import fit_ar, select_ar

    if order is None:
        most = min(MOST_LAGS, (values.size - 2) // 4)
        return select_ar(values, most, "bic", kind, rate=rate)
    return fit_ar(values, order, kind, rate=rate)


def _by_ar(
    method: str, kind: ArMethod, values: FloatArray, rate: float, model: Model, order: Order
) -> MethodIdentification:
    _no_structure(model, method, Autoregressive)
    wanted = model.order if isinstance(model, Autoregressive) else _one(order, method)
    fit = _ar(values, rate, kind, wanted)
    process, why = _process_of(fit)
    # the cautions of the order alone do not concern the one-step errors
    parameters = {f"a_{k}": float(a) for k, a in enumerate(fit.coefficients, 1)}
    errors = {f"a_{k}": float(e) for k, e in enumerate(fit.standard_errors, 1)}
    return MethodIdentification(
        method=method,
        process=process,
        no_process=why,
        parameters={**parameters, "innovation_variance": fit.innovation_variance},
        standard_errors={**errors, "innovation_variance": fit.innovation_standard_error},
        limits={},
        diagnostics=diagnose_residuals(
            fit.residuals(values),
            fitted_parameters=fit.order,
            expected_variance=fit.innovation_variance,
        ),
        converged=True,
        flags=fit.notes,
        fit=fit,
    )


def _process_of(fit: ArFit | ArmaFit) -> tuple[Process | None, str]:
    try:
        return fit.process, ""
    except ModelError as error:
        return None, str(error)


def by_arma(
    values: FloatArray, rate: float, model: Model, order: Order = None
) -> MethodIdentification:
    """Fit an ARMA model by exact maximum likelihood, orders by BIC (`select_arma`, `fit_arma`)."""
    from schuler.estimation.arma.fit import fit_arma
    from schuler.estimation.arma.selection import select_arma

    _no_structure(model, "arma", ARMA)
    wanted = _two(order, "arma")
    if isinstance(model, ARMA):
        wanted = (len(model.phi), len(model.theta))
    if wanted is None:
        most = min(ARMA_ORDERS, max((values.size - 10) // 20, 0))
        fit = select_arma(values, most, most, criterion="bic", rate=rate, choosing=CHOOSING_SAMPLES)
    else:
        fit = fit_arma(values, *wanted, rate=rate)
    process, why = _process_of(fit)
    return MethodIdentification(
        method="arma",
        process=process,
        no_process=why,
        parameters=fit.values,
        standard_errors=fit.standard_errors,
        limits={},
        diagnostics=diagnose_residuals(
            fit.residuals(values),
            fitted_parameters=sum(fit.order),
            expected_variance=fit.innovation_variance,
        ),
        converged=fit.converged,
        flags=fit.flags,
        fit=fit,
    )


def by_orthogonal_search(
    values: FloatArray, rate: float, model: Model, order: Order = None
) -> MethodIdentification:
    """Choose lags (and products) by Fast Orthogonal Search, the last third held out."""
    from schuler.estimation.orthogonal_search.search import fast_orthogonal_search

    _no_structure(model, "fos")
    lags, degree = (order, 1) if isinstance(order, int) else _two(order, "fos") or (FOS_LAGS, 1)
    split = 2 * values.size // 3
    fit = fast_orthogonal_search(
        values[:split], lags, degree, stopping="family-wise", held_out=values[split:]
    )
    process, why = _of_terms(fit, rate)
    residuals = fit.residuals(values)
    return MethodIdentification(
        method="fos",
        process=process,
        no_process=why,
        parameters={
            **dict(zip(fit.names, fit.coefficients.tolist(), strict=True)),
            "intercept": fit.intercept,
            "innovation_variance": fit.mean_square_error,
        },
        standard_errors=dict(zip(fit.names, fit.standard_errors.tolist(), strict=True)),
        limits={},
        diagnostics=diagnose_residuals(
            residuals,
            fitted_parameters=len(fit.terms),
            expected_variance=fit.training_mean_square_error,
        ),
        converged=True,
        flags=fit.notes,
        fit=fit,
    )


def _of_terms(fit: FosFit, rate: float) -> tuple[Process | None, str]:
    """A search that chose lags alone has found an autoregressive process."""
    if any(len(term) > 1 for term in fit.terms):
        return None, "products of samples are in the model, which no sum of processes describes"
    if not fit.terms:
        from schuler.noise import WhiteNoise

        return WhiteNoise(math.sqrt(fit.training_mean_square_error / rate)), ""
    coefficients = np.zeros(fit.memory)
    for (lag,), value in zip(fit.terms, fit.coefficients, strict=True):
        coefficients[lag - 1] = -value
    try:
        found = Autoregressive(
            tuple(coefficients.tolist()), fit.training_mean_square_error, 1.0 / rate
        )
    except ModelError as error:
        return None, str(error)
    return found, ""


def by_garch(
    values: FloatArray, rate: float, model: Model, order: Order = None
) -> MethodIdentification:
    """Fit AR by BIC, then GARCH to what it leaves (`select_ar`, `fit_garch`)."""
    from schuler.estimation.garch.fit import fit_garch

    _no_structure(model, "garch")
    p, q = _two(order, "garch") or (1, 1)
    ar = _ar(values, rate, "burg", None)
    residuals = ar.residuals(values)
    garch = fit_garch(residuals, p, q, rate=rate, mean="zero")
    process, why = _process_of(ar)
    return MethodIdentification(
        method="garch",
        process=process,
        no_process=why,
        parameters=garch.values,
        standard_errors=garch.standard_errors,
        limits={},
        diagnostics=diagnose_residuals(
            garch.standardized_residuals(residuals),
            fitted_parameters=ar.order,
            expected_variance=garch.unconditional_variance
            if math.isfinite(garch.unconditional_variance)
            else None,
            variance=float(np.mean(residuals**2)),
        ),
        converged=garch.converged,
        flags=(
            "the process is the AR part with its mean variance; the variance itself changes",
            *garch.flags,
        )
        if garch.persistence > 0.0
        else garch.flags,
        fit=ArGarchFit(ar, garch),
    )
