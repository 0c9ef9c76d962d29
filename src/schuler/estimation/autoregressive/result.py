"""What an autoregressive fit has found, and what is to be said about it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.data.exportable import Exportable
from schuler.data.to_dict import ToDict
from schuler.errors import InputError, ModelError
from schuler.noise import Process, WhiteNoise
from schuler.noise.autoregressive import Autoregressive
from schuler.noise.lattice import step_down
from schuler.types import FloatArray

Method = Literal["burg", "yule-walker", "covariance", "modified covariance"]
Criterion = Literal["bic", "aic", "aicc"]


@dataclass(frozen=True, slots=True)
class Caution:
    """Something to know before a result is used."""

    kind: str  # short name, e.g. "unstable".
    text: str  # the same in plain words, with numbers


@dataclass(frozen=True, slots=True, eq=False)
class ArSelection(ToDict):
    """Information criteria of all orders, on the same samples."""

    criterion: str  # the one that chose: "bic", "aic" or "aicc"
    order: int  # the chosen order
    # (p + 1,): One-step errors of orders 0 .. p on n = p+1 .. N, in u².
    mean_square_error: FloatArray
    # aic, aicc, bic: (p + 1,) smaller is better
    aic: FloatArray
    aicc: FloatArray
    bic: FloatArray
    samples: int  # N - p, the same for every order


@dataclass(frozen=True, slots=True, eq=False)
class ArFit(Exportable):
    """An autoregressive model y(n) - mean = -sum a_k (y(n-k) - mean) + e(n).

    Parameters
    ----------
    coefficients : (p,) ndarray
        a_1 .. a_p of A(z) = 1 + a_1 z^-1 + ... (spec 0).
    innovation_variance : float
        Mean squared one-step error in u² as the method defines it: of the forward errors
        ("covariance"), of forward and backward errors ("burg", "modified covariance"), or of the
        record with zeros before and behind it ("yule-walker").
    mean_square_error : float
        Mean of the squared forward errors on n = p+1 .. N, in u², whatever the method.
    standard_errors : (p,) ndarray
        Of the coefficients, by the theory of long records: sampling noise, not bias.
    reflection : (p,) ndarray
        gamma_1 .. gamma_p; all magnitudes below one if and only if the model is stable.
    mean : float
        What was taken off the signal, in u.
    samples : int
        N.
    method, solver : str
        Estimator, and how its equations were solved.
    cautions : tuple of Caution
        What to know before use.
    rate : float or None
        Samples a second; `process` needs it.
    selection : ArSelection or None
        How the order was chosen.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import fit_ar
    >>> fit_ar(np.random.default_rng(1).standard_normal(5_000), 2).reflection.round(1) + 0.0
    array([0., 0.])
    """

    JSON = (
        "method order coefficients standard_errors reflection innovation_variance "
        "innovation_standard_error mean_square_error poles stable mean samples rate solver "
        "flags notes selection"
    )

    coefficients: FloatArray
    innovation_variance: float
    mean_square_error: float
    standard_errors: FloatArray
    reflection: FloatArray
    mean: float
    samples: int
    method: str
    solver: str
    cautions: tuple[Caution, ...]
    rate: float | None
    selection: ArSelection | None = None

    @property
    def order(self) -> int:
        """Number of coefficients p."""
        return int(self.coefficients.size)

    @property
    def innovation_standard_error(self) -> float:
        """Standard error of the innovation variance for Gaussian noise, in u²."""
        return self.innovation_variance * math.sqrt(2.0 / max(self.samples - self.order, 1))

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Roots of A(z) in z, largest first."""
        return poles_of(self.coefficients)

    @property
    def stable(self) -> bool:
        """True if all poles are inside the unit circle, also after rounding."""
        inside = np.abs(self.reflection) < 1.0
        return bool(inside.all() and (np.abs(self.poles) < 1.0).all())

    @property
    def flags(self) -> tuple[str, ...]:
        """Kinds of the cautions."""
        return tuple(c.kind for c in self.cautions)

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences of the cautions."""
        return tuple(c.text for c in self.cautions)

    @property
    def process(self) -> Process:
        """The stationary process of the model; white noise at order zero.

        Raises
        ------
        ModelError
            The rate was not given, or the model is unstable.
        """
        if self.rate is None:
            raise ModelError("the fit does not know its sample rate", cure="give fit_ar rate=...")
        dt = 1.0 / self.rate
        if self.order == 0:
            return WhiteNoise(math.sqrt(self.innovation_variance * dt))
        return Autoregressive(tuple(self.coefficients.tolist()), self.innovation_variance, dt)

    def residuals(self, signal: ArrayLike) -> FloatArray:
        """One-step prediction errors e(n) of a signal, n = p+1 .. N.

        Parameters
        ----------
        signal : (n,) array_like
            Any signal of the same kind, in u; the mean of the fit is taken off.

        Returns
        -------
        (n - p,) ndarray
            Measured less predicted, in u.
        """
        from schuler.kernels.noise.autoregressive import one_step_residuals

        data = np.ascontiguousarray(signal, dtype=np.float64)
        if data.ndim != 1 or data.size <= self.order or not np.isfinite(data).all():
            raise InputError(
                f"signal of shape {data.shape} to predict",
                expected=f"more than {self.order} finite numbers (n,)",
            )
        out = np.empty(data.size - self.order)
        one_step_residuals(data - self.mean, self.coefficients, self.order, out)
        return out


def poles_of(coefficients: FloatArray) -> NDArray[np.complex128]:
    """Roots of A(z) in z, largest first."""
    roots = np.asarray(np.roots(np.append(1.0, coefficients)), dtype=np.complex128)
    # np.roots drops roots at zero that trailing zero coefficients stand for
    roots = np.append(roots, np.zeros(coefficients.size - roots.size))
    return np.asarray(roots[np.argsort(-np.abs(roots))])


def coefficient_covariance(coefficients: FloatArray, samples: int) -> FloatArray:
    """Covariance of estimated coefficients in long records: sigma² R^-1/N of the model itself."""
    from scipy.linalg import toeplitz

    p = coefficients.size
    lower = toeplitz(np.append(1.0, coefficients[:-1]), np.zeros(p))
    upper = toeplitz(coefficients[::-1], np.zeros(p))
    return np.asarray((lower @ lower.T - upper @ upper.T) / samples)


def reflection_of(coefficients: FloatArray) -> FloatArray:
    """Reflection coefficients of a fitted polynomial."""
    return step_down(coefficients)
