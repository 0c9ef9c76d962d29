"""What is left when a model has predicted every sample, and whether that is white noise."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from schuler.data.to_dict import ToDict
from schuler.errors import EstimationError, InputError
from schuler.estimation.products import dot
from schuler.estimation.residuals.tests import (
    ResidualTests,
    lagged_products,
    residual_tests,
    robust_autocorrelation_band,
)
from schuler.noise import Process, ProcessSum
from schuler.types import FloatArray

LAGS = 40
_QUANTILES = 199
_LEVEL = 1e-3
_NOTABLE = 0.02
_FAT = 1.1
_FEWEST = 200


@dataclass(frozen=True, slots=True, eq=False)
class ResidualDiagnostics(ToDict):
    """One-step prediction errors of a model on its own signal, and the tests of them."""

    JSON = (
        "samples block variance expected_variance correlation robust_band_95=robust_band "
        "kurtosis tests white constant_variance gaussian verdict"
    )

    samples: int  # residuals that were looked at
    variance: float  # their mean square in the unit of the signal squared
    expected_variance: float | None  # what the model says it should be
    correlation: FloatArray  # (k,): autocorrelation at lags 1 .. k samples.
    # band, robust_band: (k,) half width of the 95 % band of white residuals, their variance being
    # constant or not
    band: FloatArray
    robust_band: FloatArray
    quantiles: FloatArray  # (q,): of the residuals over their standard deviation
    normal_quantiles: FloatArray  # (q,): of Gaussian noise, for comparison
    kurtosis: float  # fourth moment over the squared second; 3 for Gaussian noise.
    # Ljung-Box plain and robust, squares, ARCH-LM, Jarque-Bera; None if they cannot be made.
    tests: ResidualTests | None
    # means of so many samples were predicted, because the model leaves out what is faster
    block: int = 1

    @property
    def white(self) -> bool:
        """True where no correlation is left, at the 0.1 % level, whatever the variance does."""
        return self.tests is not None and self.tests.ljung_box_robust.p_value >= _LEVEL

    @property
    def largest_correlation(self) -> tuple[int, float]:
        """Lag in samples and value of the largest autocorrelation."""
        k = int(np.argmax(np.abs(self.correlation)))
        return k + 1, float(self.correlation[k])

    @property
    def constant_variance(self) -> bool:
        """True where past squares do not foretell the present one, at the 0.1 % level."""
        return self.tests is not None and self.tests.arch_lm.p_value >= _LEVEL

    @property
    def gaussian(self) -> bool:
        """True where skewness and kurtosis are those of Gaussian noise, at the 0.1 % level."""
        return self.tests is not None and self.tests.jarque_bera.p_value >= _LEVEL

    @property
    def verdict(self) -> str:
        """The same in a few words, with the size of what is left and not its significance alone.

        A million samples make the smallest blemish significant.
        """
        words = []
        lag, value = self.largest_correlation
        if self.white:
            words.append("white")
        else:
            slight = "nearly white" if abs(value) < _NOTABLE else "correlated"
            words.append(f"{slight}: up to {value:+.3f} at lag {lag}")
        if not self.constant_variance:
            words.append("variance changes")
        if not self.gaussian and abs(self.kurtosis / 3.0 - 1.0) > _FAT - 1.0:
            shape = "heavy tails" if self.kurtosis > 3.0 else "short tails"
            words.append(f"{shape}: kurtosis {self.kurtosis:.3g}")
        return "; ".join(words)


def diagnose_residuals(
    residuals: ArrayLike,
    *,
    fitted_parameters: int = 0,
    expected_variance: float | None = None,
    variance: float | None = None,
    block: int = 1,
) -> ResidualDiagnostics | None:
    """Look at the one-step prediction errors of a model."""
    from scipy.special import ndtri

    values = np.asarray(residuals, dtype=np.float64)
    if values.size < _FEWEST or not np.isfinite(values).all():
        return None
    largest = float(np.abs(values).max())
    if largest == 0.0:
        return None
    unit = values / largest
    mean_square = dot(unit, unit) / unit.size
    lags = min(LAGS, values.size // 5)
    try:
        robust = robust_autocorrelation_band(values, lags, z=1.959964)
    except (EstimationError, InputError):
        return None
    centred = unit - unit.mean()
    products = lagged_products(centred, lags)
    share = (np.arange(_QUANTILES) + 0.5) / _QUANTILES
    squares = centred * centred
    second = float(products[0]) / unit.size
    return ResidualDiagnostics(
        samples=values.size,
        variance=mean_square * largest**2 if variance is None else variance,
        expected_variance=expected_variance,
        correlation=products[1:] / products[0],
        band=np.full(lags, 1.959964 / math.sqrt(values.size)),
        robust_band=robust,
        quantiles=_quantiles(centred, share) / math.sqrt(second),
        normal_quantiles=np.asarray(ndtri(share)),
        kurtosis=dot(squares, squares) / unit.size / second**2,
        tests=residual_tests(values, fitted_parameters=fitted_parameters),
        block=block,
    )


def _quantiles(values: FloatArray, share: FloatArray) -> FloatArray:
    """Many quantiles of one series: sorted once, `np.quantile` selects anew for every one."""
    ordered, place = np.sort(values), share * (values.size - 1)
    below = np.minimum(place.astype(np.int64), values.size - 2)
    return np.asarray(ordered[below] + (place - below) * (ordered[below + 1] - ordered[below]))


def process_residuals(signal: ArrayLike, process: Process, rate: float) -> FloatArray:
    """One-step prediction errors of the Kalman filter that a process makes optimal."""
    from schuler.kernels.noise.prediction import kalman_states

    values = np.asarray(signal, dtype=np.float64)
    values = values - values.mean()
    # a power of two changes no digit, and squares of 1e-200 would vanish
    scale = 2.0 ** round(math.log2(max(float(np.abs(values).max()), 1e-300)))
    values /= scale
    dt = 1.0 / rate
    space = ProcessSum(process.coarser(0.43 * dt)).state_space(dt)
    if space.size == 0:
        return np.asarray(values * scale)
    start = space.initial_covariance / scale**2
    start = start + np.diag(np.where(np.diag(start) == 0.0, float(values.var()), 0.0))
    states = np.zeros((values.size, space.size))
    white = space.white_density**2 / dt / scale**2
    noise = space.noise_covariance / scale**2
    kalman_states(values, space.transition, noise, space.output, white, start, states)
    ahead = states[:-1] @ (space.transition.T @ space.output)
    settling = min(values.size // 100, 1000)
    return np.asarray((values[1:] - ahead)[settling:] * scale)
