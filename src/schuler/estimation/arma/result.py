"""What an ARMA fit gives."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.data.exportable import Exportable
from schuler.data.to_dict import plain
from schuler.estimation.arma.likelihood import innovations
from schuler.estimation.residuals.tests import ResidualTests
from schuler.estimation.signals import checked_signal
from schuler.noise.arma import ARMA, poles_of, zeros_of
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True)
class ArmaCandidate:
    """One order of a selection."""

    # p, q: orders
    p: int
    q: int
    # log_likelihood, aic, bic: on the same samples for all orders
    log_likelihood: float
    aic: float
    bic: float
    rejected: str  # why it cannot be chosen; empty if it can.


@dataclass(frozen=True, slots=True, eq=False)
class ArmaFit(Exportable):
    """x(t) = constant + sum phi_i x(t-i) + e(t) + sum theta_j e(t-j), fitted.

    Parameters
    ----------
    phi : (p,) ndarray
        Autoregressive coefficients.
    theta : (q,) ndarray
        Moving-average coefficients.
    mean : float
        Mean of the signal in u.
    constant : float
        mean (1 - sum phi), S000's nu, in u.
    innovation_variance : float
        Of e, in u².
    covariance : (p + q + 2, p + q + 2) ndarray
        Of mean, phi, theta, innovation variance; the kind that was asked for.
    standard_errors : dict of str to float
        By "phi_1", ..., "theta_1", ..., "mean", "constant", "innovation_variance".
    robust_standard_errors : dict of str to float
        The same from the sandwich, which stays right when the variance of e changes with time.
    t_values, p_values : dict of str to float
        Value over standard error and its two-sided probability, for phi, theta, mean, constant.
    log_likelihood, aic, bic : float
        Exact; p + q + 2 parameters.
    samples : int
        Length of the signal.
    rate : float
        Samples a second, for `process`.
    converged : bool
        The slope of the exact likelihood is zero at an inner point.
    flags : tuple of str
        What to know before use; empty if nothing.
    diagnostics : ResidualTests or None
        Tests of the innovations.
    candidates : tuple of ArmaCandidate
        The orders that `select_arma` compared.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import fit_arma
    >>> fit_arma(np.random.default_rng(2).standard_normal(2_000), 1, 0).converged
    True
    """

    JSON = "poles zeros log_likelihood aic bic samples rate converged flags diagnostics candidates"

    phi: FloatArray
    theta: FloatArray
    mean: float
    constant: float
    innovation_variance: float
    covariance: FloatArray
    standard_errors: dict[str, float]
    robust_standard_errors: dict[str, float]
    t_values: dict[str, float]
    p_values: dict[str, float]
    log_likelihood: float
    aic: float
    bic: float
    samples: int
    rate: float
    converged: bool
    flags: tuple[str, ...]
    diagnostics: ResidualTests | None
    candidates: tuple[ArmaCandidate, ...] = ()

    @property
    def order(self) -> tuple[int, int]:
        """Orders p and q."""
        return self.phi.size, self.theta.size

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Poles in the z plane, slowest first."""
        return poles_of(self.phi)

    @property
    def zeros(self) -> NDArray[np.complex128]:
        """Zeros in the z plane, slowest first."""
        return zeros_of(self.theta)

    @property
    def process(self) -> ARMA:
        """The process of the samples, without the mean."""
        phi, theta = tuple(self.phi.tolist()), tuple(self.theta.tolist())
        return ARMA(phi, theta, self.innovation_variance, 1.0 / self.rate)

    @property
    def values(self) -> dict[str, float]:
        """Estimates by the names of the standard errors."""
        return {
            **{f"phi_{i}": float(v) for i, v in enumerate(self.phi, 1)},
            **{f"theta_{j}": float(v) for j, v in enumerate(self.theta, 1)},
            "mean": self.mean,
            "constant": self.constant,
            "innovation_variance": self.innovation_variance,
        }

    def residuals(self, signal: ArrayLike) -> FloatArray:
        """One-step prediction errors of a signal; only the past of each sample is used.

        Parameters
        ----------
        signal : (n,) array_like
            In the unit and at the rate of the fit.

        Returns
        -------
        (n,) ndarray
            In u; the first few have more variance than the innovation variance.
        """
        values = checked_signal(signal, 1, varying=False)
        scale = math.sqrt(self.innovation_variance)
        coefficients = np.concatenate([self.phi, self.theta])
        found = innovations((values - self.mean) / scale, coefficients, self.phi.size)
        return np.asarray(found.residual * np.exp(0.5 * found.log_variance) * scale)

    def predict(self, signal: ArrayLike) -> FloatArray:
        """One-step predictions, the conditional mean given the past of each sample.

        Parameters
        ----------
        signal : (n,) array_like
            In the unit and at the rate of the fit.

        Returns
        -------
        (n,) ndarray
            In u; the first is the mean.
        """
        return np.asarray(np.asarray(signal, dtype=np.float64) - self.residuals(signal))

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, in SI."""
        named = {
            "value": self.values,
            "standard_error": self.standard_errors,
            "robust_standard_error": self.robust_standard_errors,
            "t_value": self.t_values,
            "p_value": self.p_values,
        }
        parameters = {k: {n: plain(v.get(k)) for n, v in named.items()} for k in self.values}
        p, q = self.order
        return Exportable.to_dict(self) | {"p": p, "q": q, "parameters": parameters}
