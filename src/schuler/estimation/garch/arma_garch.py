"""ARMA noise whose innovations have a changing variance: fitted one after the other, or at once."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from schuler.data.exportable import Exportable
from schuler.estimation.arma.fit import fit_arma
from schuler.estimation.arma.likelihood import admissible
from schuler.estimation.arma.result import ArmaFit
from schuler.estimation.garch.conditional_variance import backcast
from schuler.estimation.garch.fit import CONVERGED, fit_garch
from schuler.estimation.garch.result import GarchFit
from schuler.estimation.garch.search import (
    SMALLEST_CONSTANT,
    Answer,
    Problem,
    climb,
    inverse,
    observed_information,
)
from schuler.estimation.residuals.tests import residual_tests
from schuler.estimation.signals import checked_signal
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class ArmaGarchFit(Exportable):
    """ARMA(p, q) for the mean given the past, GARCH for the variance given the past.

    Parameters
    ----------
    arma : ArmaFit
        After a joint fit with QMLE errors, and with the innovation variance that GARCH implies.
    garch : GarchFit
        Of the innovations.
    joint : bool
        Both parts maximise one likelihood.
    log_likelihood, aic, bic : float
        Of both parts together, the start of the ARMA part being conditional on the mean.
    converged : bool
        Of all parts.
    flags : tuple of str
        Of all parts.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import fit_arma_garch, simulate_garch
    >>> noise, _ = simulate_garch(4_000, 0.1, 0.1, 0.8, np.random.default_rng(1))
    >>> fit = fit_arma_garch(noise, 1, 0)
    >>> fit.converged, fit.joint
    (True, False)
    """

    arma: ArmaFit
    garch: GarchFit
    joint: bool
    log_likelihood: float
    aic: float
    bic: float
    converged: bool
    flags: tuple[str, ...]

    def predict(self, signal: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Mean and variance of every sample given the samples before it: no look-ahead.

        Parameters
        ----------
        signal : (n,) array_like
            In u, at the rate of the fit.

        Returns
        -------
        mean : (n,) ndarray
            In u; with `variance`, what weights need (spec 5.5).
        variance : (n,) ndarray
            In u².
        """
        residual = self.arma.residuals(signal)
        return (
            np.asarray(np.asarray(signal, dtype=np.float64) - residual),
            self.garch.conditional_variance(residual),
        )


@dataclass(frozen=True, slots=True, eq=False)
class _Objective:
    """The likelihood of both parts, for a signal in units of its innovations."""

    unit: FloatArray
    p: int
    q: int
    shocks: int
    memories: int
    before: float
    past: FloatArray

    @property
    def size(self) -> int:
        return 2 + self.p + self.q + self.shocks + self.memories

    def __call__(self, parameters: FloatArray, outer: FloatArray) -> Answer:
        from schuler.kernels.noise.garch import arma_garch_slopes

        score, information = np.empty(self.size), np.empty((self.size, self.size))
        value = arma_garch_slopes(
            self.unit,
            parameters,
            (self.p, self.q, self.shocks, self.memories),
            self.before,
            score,
            information,
            outer,
            self.past,
        )
        return value, score, information


def fit_arma_garch(
    signal: ArrayLike,
    p: int,
    q: int,
    garch_p: int = 1,
    garch_q: int = 1,
    *,
    joint: bool = False,
    rate: float = 1.0,
) -> ArmaGarchFit:
    """Fit an ARMA model, and a GARCH model to what it leaves.

    Parameters
    ----------
    signal : (n,) array_like
        Samples in any unit u.
    p, q : int
        Orders of the ARMA part.
    garch_p, garch_q : int
        Past squares and past variances.
    joint : bool
        False: the ARMA part by Gaussian likelihood, then GARCH on its residuals, as in S000;
        consistent, with robust errors for the ARMA part. True: one likelihood for all, from
        there; the ARMA part becomes more precise because calm samples count for more.
    rate : float
        Samples a second.

    Returns
    -------
    ArmaGarchFit
        Chained where a joint fit has no changing variance to work with, flagged.

    Raises
    ------
    InputError
        Not one-dimensional, not finite, impossible orders.
    EstimationError
        Too few samples, or a signal that does not vary.

    Notes
    -----
    Spec 5.2, S000 section 5. (Tables 1 and 2 of S000 belong to different axes, E-000-15.)

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import fit_arma_garch, simulate_garch
    >>> noise, _ = simulate_garch(4_000, 0.1, 0.1, 0.8, np.random.default_rng(1))
    >>> fit = fit_arma_garch(noise, 1, 0)
    >>> fit.converged, fit.joint
    (True, False)
    """
    values = checked_signal(signal, 10 + 5 * (p + q))
    arma = fit_arma(values, p, q, rate=rate, errors="robust")
    residual = arma.residuals(values)
    garch = fit_garch(residual, garch_p, garch_q, rate=rate, mean="zero")
    scale = math.sqrt(arma.innovation_variance)
    unit = values / scale
    objective = _Objective(
        unit,
        p,
        q,
        garch_p,
        garch_q,
        backcast(residual / scale),
        np.empty((2, unit.size)),
    )
    usable = garch.method in ("maximum likelihood", "variance targeting") and garch.persistence > 0
    start = np.concatenate(
        [
            [arma.mean / scale],
            arma.phi,
            arma.theta,
            [max(garch.alpha0 / scale**2, 2.0 * SMALLEST_CONSTANT)],
            garch.alpha,
            garch.beta,
        ]
    )
    # a changing variance of the ARMA residuals is what the GARCH part is for
    told = [f for f in arma.flags if not f.startswith("changing variance")]
    flags = tuple(dict.fromkeys([*told, *garch.flags]))
    if joint and usable:
        return _joint(values, scale, objective, start, arma, garch)
    if joint:
        flags = (*flags, "chained: no changing variance for a joint fit")
    count = 2 + p + q + garch_p + garch_q
    value = garch.log_likelihood
    if usable:
        value = _in_unit(objective(start, np.zeros((0, 0)))[0], values.size, scale)
    return ArmaGarchFit(
        arma=arma,
        garch=garch,
        joint=False,
        log_likelihood=value,
        aic=2.0 * count - 2.0 * value,
        bic=math.log(values.size) * count - 2.0 * value,
        converged=arma.converged and garch.converged,
        flags=flags,
    )


def _in_unit(value: float, n: int, scale: float) -> float:
    return value - 0.5 * n * math.log(2.0 * math.pi) - n * math.log(scale)


def _joint(
    values: FloatArray,
    scale: float,
    objective: _Objective,
    start: FloatArray,
    arma: ArmaFit,
    garch: GarchFit,
) -> ArmaGarchFit:
    p, q, k, n = objective.p, objective.q, objective.size, values.size
    lead = 1 + p + q
    place = np.arange(k)
    problem = Problem(
        evaluate=lambda u: objective(u, np.zeros((0, 0))),
        lower=np.where(place < lead, -np.inf, np.where(place == lead, SMALLEST_CONSTANT, 0.0)),
        positive=place == lead,
        weights=place > lead,
        allowed=lambda u: admissible(u[1:lead], p),
    )
    summit = climb(problem, start)
    outer = np.zeros((k, k))
    objective(summit.parameters, outer)
    bread, _ = inverse(observed_information(problem, summit))
    _, singular = inverse(summit.information)
    back = np.ones(k)
    back[0], back[lead] = scale, scale**2
    covariance = bread @ outer @ bread * np.outer(back, back)
    found = summit.parameters * back
    value = _in_unit(summit.value, n, scale)
    aic, bic = 2.0 * k - 2.0 * value, math.log(n) * k - 2.0 * value
    converged = summit.distance < CONVERGED and not singular and bool(summit.free.all())
    new_garch = _garch_part(garch, found[lead:], covariance[lead:, lead:], converged)
    new_arma = _arma_part(arma, found, covariance, new_garch, converged, values)
    after = residual_tests(objective.past[0] / np.sqrt(objective.past[1]), fitted_parameters=p + q)
    new_garch = replace(new_garch, after=after, log_likelihood=value, aic=aic, bic=bic)
    flags = [f for f in arma.flags if not f.startswith(("not converged", "changing variance"))]
    flags += [f for f in garch.flags if not f.startswith(("not converged", "nearly integrated"))]
    if not converged:
        flags.append("not converged: the joint likelihood has no inner maximum here")
    return ArmaGarchFit(
        arma=replace(new_arma, log_likelihood=value, aic=aic, bic=bic),
        garch=new_garch,
        joint=True,
        log_likelihood=value,
        aic=aic,
        bic=bic,
        converged=converged,
        flags=tuple(dict.fromkeys(flags)),
    )


def _t_and_p(
    estimates: dict[str, float], errors: dict[str, float]
) -> tuple[dict[str, float], dict[str, float]]:
    t = {key: estimates[key] / error for key, error in errors.items() if error > 0.0}
    return t, {key: math.erfc(abs(v) / math.sqrt(2.0)) for key, v in t.items()}


def _garch_part(
    garch: GarchFit,
    found: FloatArray,
    covariance: FloatArray,
    converged: bool,
) -> GarchFit:
    p, q = garch.order
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    errors = {
        "alpha0": float(spread[0]),
        **{f"alpha_{i}": float(spread[i]) for i in range(1, p + 1)},
        **{f"beta_{j}": float(spread[p + j]) for j in range(1, q + 1)},
        "persistence": math.sqrt(max(float(covariance[1:, 1:].sum()), 0.0)),
    }
    fit = replace(
        garch,
        alpha0=float(found[0]),
        alpha=found[1 : p + 1],
        beta=found[p + 1 :],
        covariance=covariance,
        standard_errors=errors,
        method="maximum likelihood",
        converged=converged,
    )
    t_values, p_values = _t_and_p(fit.values, errors)
    return replace(fit, t_values=t_values, p_values=p_values)


def _arma_part(
    arma: ArmaFit,
    found: FloatArray,
    covariance: FloatArray,
    garch: GarchFit,
    converged: bool,
    values: FloatArray,
) -> ArmaFit:
    """Mean, phi, theta and the variance that GARCH implies, with their covariance."""
    p, q = arma.order
    lead, k = 1 + p + q, found.size
    loss = 1.0 - garch.persistence
    slope = np.zeros((lead + 1, k))
    slope[:lead, :lead] = np.eye(lead)
    slope[lead, lead] = 1.0 / loss
    slope[lead, lead + 1 :] = garch.alpha0 / loss**2
    chosen = slope @ covariance @ slope.T
    phi, mean = found[1 : p + 1], float(found[0])
    gain = 1.0 - float(phi.sum())
    spread = np.sqrt(np.maximum(np.diag(chosen), 1e-300))
    along = np.concatenate([[gain], np.full(p, -mean), np.zeros(q + 1)])
    errors = {
        **{f"phi_{i}": float(spread[i]) for i in range(1, p + 1)},
        **{f"theta_{j}": float(spread[p + j]) for j in range(1, q + 1)},
        "mean": float(spread[0]),
        "constant": math.sqrt(max(float(along @ chosen @ along), 1e-300)),
        "innovation_variance": float(spread[-1]),
    }
    fit = replace(
        arma,
        phi=phi,
        theta=found[p + 1 : lead],
        mean=mean,
        constant=mean * gain,
        innovation_variance=garch.unconditional_variance,
        covariance=chosen,
        standard_errors=errors,
        robust_standard_errors=dict(errors),
        converged=converged,
    )
    t_values, p_values = _t_and_p(fit.values, errors)
    t_values.pop("innovation_variance", None)
    p_values.pop("innovation_variance", None)
    diagnostics = residual_tests(fit.residuals(values), fitted_parameters=p + q)
    return replace(fit, t_values=t_values, p_values=p_values, diagnostics=diagnostics)
