"""Is anything left in the residuals? Tests for correlation, changing variance, Gaussian shape."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from schuler.data._checks import check_finite
from schuler.data.to_dict import ToDict
from schuler.errors import EstimationError, InputError
from schuler.estimation.products import dot
from schuler.types import FloatArray


@dataclass(frozen=True, slots=True)
class HypothesisTest(ToDict):
    """A test statistic and how likely chance alone exceeds it."""

    name: str  # what was tested
    statistic: float  # Chi-square distributed under the null hypothesis
    degrees_of_freedom: int  # of that distribution
    p_value: float  # probability of a larger statistic by chance


def _chi_square(name: str, statistic: float, degrees_of_freedom: int) -> HypothesisTest:
    from scipy.special import chdtrc

    p_value = float(chdtrc(degrees_of_freedom, max(statistic, 0.0)))
    return HypothesisTest(name, float(statistic), int(degrees_of_freedom), p_value)


def _varying(residuals: ArrayLike, lags: int) -> FloatArray:
    """Residuals as a checked array, scaled to unit variance (the tests do not depend on it)."""
    values = np.asarray(residuals, dtype=np.float64)
    if values.ndim != 1:
        raise InputError(f"residuals have shape {values.shape}", expected="(n,)")
    check_finite(values, "residuals")
    if lags < 1:
        raise InputError(f"{lags} lags were asked for", expected="at least 1")
    if values.size < 3 * lags + 3:
        raise EstimationError(
            f"{values.size} residuals", expected=f"at least {3 * lags + 3} for {lags} lags"
        )
    largest = float(np.abs(values).max())
    scale = float(np.std(values / largest)) * largest if largest > 0.0 else 0.0
    if not scale > 1e-13 * largest:
        raise EstimationError("the residuals do not vary", expected="noise")
    return np.asarray(values / scale)


def lagged_products(values: FloatArray, lags: int) -> FloatArray:
    """Sums of v(t) v(t-k), k = 0 .. lags."""
    from schuler.kernels.noise.lagged_products import add_lagged_products

    sums = np.zeros(lags + 1)
    add_lagged_products(values, sums)
    return sums


def robust_autocorrelation_band(residuals: ArrayLike, lags: int, z: float = 2.0) -> FloatArray:
    """Half-width of the band in which the autocorrelation of a white residual lies.

    Holds when the variance of the residual changes with its own past (GARCH), where the plain
    band z/sqrt(n) is too narrow.

    Parameters
    ----------
    residuals : (n,) array_like
        In any unit.
    lags : int
        Number of lags.
    z : float
        Quantile of the normal law.

    Returns
    -------
    (lags,) ndarray
        For lags 1, 2, ...

    Notes
    -----
    Erratum E-000-12 of S000; Diebold 1986.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> x = np.random.default_rng(0).normal(size=10_000)
    >>> bool(np.allclose(schuler.robust_autocorrelation_band(x, 3), 0.02, rtol=0.05))
    True
    """
    values = _varying(residuals, lags)
    return np.asarray(z * np.sqrt(_robust_variances(values, lags) / values.size))


def _robust_variances(values: FloatArray, lags: int) -> FloatArray:
    """N times the variance of the autocorrelations at lags 1 .. lags, no correlation assumed."""
    squares = (values - values.mean()) ** 2
    products = lagged_products(squares, lags)[1:]
    counts = values.size - np.arange(1, lags + 1)
    return np.asarray(products / counts / squares.mean() ** 2)


def ljung_box_test(
    residuals: ArrayLike, lags: int = 20, *, robust: bool = False, fitted_parameters: int = 0
) -> HypothesisTest:
    """Test whether the autocorrelations up to a lag are all zero.

    Parameters
    ----------
    residuals : (n,) array_like
        Any unit.
    lags : int
        Largest lag.
    robust : bool
        Allow for a variance that changes with time: every autocorrelation is divided by its
        heteroskedasticity-robust standard error.
    fitted_parameters : int
        Number of ARMA coefficients that were fitted to the same data; lowers the degrees of
        freedom.

    Returns
    -------
    HypothesisTest
        n (n + 2) sum r_k²/(n - k), chi-square.

    Raises
    ------
    InputError
        Not one-dimensional, not finite, no degree of freedom left.
    EstimationError
        Too few samples, or no variation.

    Notes
    -----
    Ljung and Box 1978; robust form after Lobato, Nankervis and Savin 2001. Spec 5.2 and 8.1.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import ljung_box_test
    >>> bool(ljung_box_test(np.random.default_rng(1).standard_normal(5_000)).p_value > 0.05)
    True
    """
    values = _varying(residuals, lags)
    if fitted_parameters >= lags:
        raise InputError(
            f"{lags} lags for {fitted_parameters} fitted parameters", expected="more lags"
        )
    products = lagged_products(values - values.mean(), lags)
    if robust:
        variances = _robust_variances(values, lags)
        return _box("Ljung-Box, robust", products, values.size, fitted_parameters, variances)
    return _box("Ljung-Box", products, values.size, fitted_parameters)


def _box(
    name: str,
    products: FloatArray,
    n: int,
    fitted_parameters: int,
    variances: FloatArray | None = None,
) -> HypothesisTest:
    """Weigh the squared autocorrelations up to the last lag; plain ones have variance 1/n."""
    lags = products.size - 1
    weights = n * (n + 2.0) / (n - np.arange(1, lags + 1))
    if variances is not None:
        weights = weights / variances
    correlations = products[1:] / products[0]
    return _chi_square(name, float(np.sum(weights * correlations**2)), lags - fitted_parameters)


def arch_lm_test(residuals: ArrayLike, lags: int = 10) -> HypothesisTest:
    """Engle's Lagrange multiplier test, whether past squares foretell the present one.

    Parameters
    ----------
    residuals : (n,) array_like
        Mean zero.
    lags : int
        Number of past squares.

    Returns
    -------
    HypothesisTest
        (n - lags) R² of the regression of the squares on a constant and their past.

    Raises
    ------
    InputError
        Not one-dimensional, not finite.
    EstimationError
        Too few samples, or squares that do not vary.

    Notes
    -----
    Spec 5.2, S000 section 5. On the standardised residuals of a fitted GARCH model the test is
    slightly conservative, because the parameters were fitted to the same data.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import arch_lm_test
    >>> bool(arch_lm_test(np.random.default_rng(1).standard_normal(5_000)).p_value > 0.05)
    True
    """
    squares = _varying(residuals, lags) ** 2
    squares = squares - squares.mean()
    return _arch_lm(squares, lagged_products(squares, lags))


def _arch_lm(squares: FloatArray, products: FloatArray) -> HypothesisTest:
    """Regress centred squares on their past, all from products at lags 0 .. m."""
    n, lags = squares.size, products.size - 1
    count = n - lags
    gram = np.empty((lags + 1, lags + 1))
    # the first row misses the products of the first samples
    gram[0] = [products[k] - float(squares[k:lags] @ squares[: lags - k]) for k in range(lags + 1)]
    gram[:, 0] = gram[0]
    # the products of neighbouring lags differ by their first and last terms only
    for i in range(1, lags + 1):
        for j in range(i, lags + 1):
            first = squares[lags - i] * squares[lags - j]
            last = squares[n - i] * squares[n - j]
            gram[i, j] = gram[j, i] = gram[i - 1, j - 1] + first - last
    means = np.array([float(squares[lags - k : n - k].mean()) for k in range(lags + 1)])
    covariance = gram / count - np.outer(means, means)
    if not covariance[0, 0] > 1e-20:
        raise EstimationError("the squares of the residuals do not vary", expected="noise")
    slopes = np.linalg.lstsq(covariance[1:, 1:], covariance[1:, 0], rcond=1e-13)[0]
    explained = float(slopes @ covariance[1:, 0]) / float(covariance[0, 0])
    return _chi_square("ARCH-LM", count * explained, lags)


def jarque_bera_test(residuals: ArrayLike) -> HypothesisTest:
    """Test whether skewness and kurtosis are those of Gaussian noise.

    Parameters
    ----------
    residuals : (n,) array_like
        In any unit.

    Returns
    -------
    HypothesisTest
        Statistic, chi-square with two degrees of freedom, and its p-value.

    Raises
    ------
    InputError
        Too short, or not finite.

    Notes
    -----
    Jarque and Bera 1980.

    Examples
    --------
    >>> import numpy as np, schuler
    >>> tails = np.random.default_rng(0).standard_t(4, size=5000)
    >>> bool(schuler.jarque_bera_test(tails).p_value < 1e-6)
    True
    """
    values = _varying(residuals, 1)
    values = values - values.mean()
    squares = values * values
    second = float(squares.mean())
    skewness = dot(squares, values) / values.size / second**1.5
    kurtosis = dot(squares, squares) / values.size / second**2
    statistic = values.size * (skewness**2 + (kurtosis - 3.0) ** 2 / 4.0) / 6.0
    return _chi_square("Jarque-Bera", statistic, 2)


@dataclass(frozen=True, slots=True)
class ResidualTests(ToDict):
    """The tests of one residual series."""

    # ljung_box, ljung_box_robust: correlation of the values, the variance being constant or not
    ljung_box: HypothesisTest
    ljung_box_robust: HypothesisTest
    ljung_box_squares: HypothesisTest  # correlation of the squares
    arch_lm: HypothesisTest  # squares on past squares
    jarque_bera: HypothesisTest  # Gaussian shape


def residual_tests(residuals: ArrayLike, *, fitted_parameters: int = 0) -> ResidualTests | None:
    """Run all tests, 20 lags for correlation and 10 for changing variance."""
    lags = 20 + fitted_parameters
    try:
        values = _varying(residuals, lags)
        squares = values**2
        # the products of the squares serve three tests, those of the values two
        products = lagged_products(values - values.mean(), lags)
        centred = squares - squares.mean()
        if not dot(centred, centred) > 1e-20 * squares.size:
            return None
        square_products = lagged_products(centred, lags)
        return ResidualTests(
            ljung_box=_box("Ljung-Box", products, values.size, fitted_parameters),
            ljung_box_robust=_box(
                "Ljung-Box, robust",
                products,
                values.size,
                fitted_parameters,
                _robust_variances(values, lags),
            ),
            ljung_box_squares=_box("Ljung-Box", square_products[:21], values.size, 0),
            arch_lm=_arch_lm(centred, square_products[:11]),
            jarque_bera=jarque_bera_test(values),
        )
    except EstimationError:
        return None
