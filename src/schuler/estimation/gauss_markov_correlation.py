"""A Gauss-Markov noise out of an autocorrelation, with its sampling error and a test of its shape.

Estimates of neighbouring lags err together (Bartlett 1946): the fit is by generalised least
squares with the covariance that white plus Gauss-Markov noise gives them, which also makes its
misfit a test whether the correlation is exponential at all (S003, figure 2).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from schuler.curves.autocorrelation import AutocorrelationCurve
from schuler.data.to_dict import ToDict
from schuler.errors import EstimationError, InputError
from schuler.estimation.optimizer import Rules, Slopes, minimise
from schuler.noise import GaussMarkov, ProcessSum, WhiteNoise
from schuler.types import FloatArray

_FEW, _MANY = 14, 160
_REACH = 3.0
_REJECT = 0.01
_FEWEST_TIMES = 20.0
_SEARCH = 40
_RULES = Rules(iterations=30, damping=1e-9, longest=0.7, ridge=1e-12, gain=(1e-6, 1.0))


@dataclass(frozen=True, slots=True, eq=False)
class GaussMarkovCorrelation(ToDict):
    """White noise and one Gauss-Markov noise fitted to an autocovariance."""

    JSON = (
        "sigma correlation_time_s=correlation_time white_variance standard_errors "
        "relative_sampling_error=sampling_error misfit degrees_of_freedom p_value exponential "
        "flags"
    )

    sigma: float  # standard deviation of the Gauss-Markov noise, in the unit of the signal
    correlation_time: float  # tc in s
    white_variance: float  # spike at lag 0: variance of the white part of a sample
    standard_errors: dict[str, float]  # of "sigma", "correlation_time" and "white_variance"
    # sqrt(2 Tc/T), the relative standard deviation of the variance of Gauss-Markov noise that was
    # recorded for T (spec 2.1): no method gets below it
    sampling_error: float
    misfit: float  # Chi-square of the fit
    degrees_of_freedom: int  # lags less parameters
    p_value: float  # probability of a misfit as large if the correlation is exponential
    lag: FloatArray  # (k,): lags in s that were fitted
    rate: float  # samples a second
    # "not exponential", "record too short" (less than 20 correlation times), "at the end of the
    # lags" (Tc is as long as the search reached), "white part not resolved"
    flags: tuple[str, ...]

    @property
    def exponential(self) -> bool:
        """True unless the exponential shape is rejected at 1 %."""
        return self.p_value >= _REJECT

    @property
    def process(self) -> ProcessSum:
        """White noise plus Gauss-Markov noise; white noise is left out where it is zero."""
        noise = GaussMarkov(self.sigma, self.correlation_time)
        if self.white_variance <= 0.0:
            return ProcessSum((noise,))
        return WhiteNoise(math.sqrt(self.white_variance / self.rate)) + noise


def fit_gauss_markov(curve: AutocorrelationCurve) -> GaussMarkovCorrelation:
    """Fit R(lag) = sigma² exp(-lag/Tc), with a white spike at lag 0, to an autocovariance.

    Parameters
    ----------
    curve : AutocorrelationCurve
        From `autocorrelation`.

    Returns
    -------
    GaussMarkovCorrelation
        sigma in u, correlation time in s with its sampling error sqrt(2 Tc/T), and the probability
        that the shape is exponential.

    Raises
    ------
    EstimationError
        A correlation that does not decay within the curve.

    Notes
    -----
    S003 Fig. 1, S004 (11).

    Examples
    --------
    >>> import numpy as np, schuler
    >>> noise = schuler.GaussMarkov(1.0, 20.0).simulate(50_000, 0.2, np.random.default_rng(0))
    >>> fit = schuler.fit_gauss_markov(schuler.autocorrelation(noise, 5.0, max_lag=100.0))
    >>> 15.0 < fit.correlation_time < 25.0
    True
    """
    if curve.kind != "biased":
        raise InputError("an unbiased autocovariance", expected="kind='biased'")
    if curve.lag.size < 5:
        raise InputError(f"autocovariance of {curve.lag.size} lags", expected="at least 5")
    if "constant" in curve.flags:
        raise EstimationError("signal does not vary", expected="noise")
    variance = float(curve.autocovariance[0])
    if not variance > 0.0:
        raise EstimationError(f"variance is {variance:g}", expected="above zero")
    relative = curve.autocovariance / variance
    start = _start(relative, curve.samples)
    state, use = start, np.zeros(0, dtype=np.int64)
    for _ in range(3):
        use = _chosen_lags(state, relative.size)
        state, information, misfit, settled = _iterate(state, relative, use, curve.samples)
    return _result(curve, state, information, misfit, use, settled, variance)


def _start(relative: FloatArray, samples: int) -> FloatArray:
    """Least squares over a grid of correlation times: ln sigma², ln Tc in samples, white."""
    last = relative.size - 1
    lags = np.unique(np.round(np.geomspace(1, last, 4 * _SEARCH)).astype(np.int64))
    best, found = math.inf, None
    for time in np.geomspace(0.7, max(last / 1.5, 1.0), _SEARCH):
        shape = np.exp(-lags / time) - 2.0 * time / samples
        level = float(shape @ relative[lags]) / float(shape @ shape)
        cost = float(np.sum((relative[lags] - level * shape) ** 2))
        if level > 0.0 and cost < best:
            best, found = cost, (level, time)
    if found is None:
        raise _no_correlation()
    level, time = found
    return np.array([math.log(min(level, 1.0)), math.log(time), max(1.0 - level, 0.0)])


def _no_correlation() -> EstimationError:
    return EstimationError(
        "no correlation beyond lag 0 stands out of its sampling noise",
        expected="a correlated part",
        cure="model it as white noise, or record longer",
    )


def _chosen_lags(state: FloatArray, count: int) -> NDArray[np.int64]:
    """Lag 0, and lags up to three correlation times: many only where white noise parts them."""
    share = math.exp(min(state[0], 0.0))
    wanted = _FEW if state[2] < share else _MANY
    last = int(min(max(round(_REACH * math.exp(state[1])), 6), count - 1))
    spread = np.linspace(1, last, wanted) if wanted == _MANY else np.geomspace(1, last, wanted)
    if wanted == _FEW:  # steps of a twentieth of Tc say more than the noise of a lag
        shortest = max(1.0, math.exp(state[1]) / 20.0)
        spread = np.geomspace(min(shortest, last), last, wanted)
    lags = np.unique(np.round(spread).astype(np.int64))
    return np.concatenate([[0], lags])


def _model(state: FloatArray, lags: FloatArray, n: int) -> tuple[FloatArray, FloatArray]:
    """Expected biased autocovariance at the lags, and its derivatives by the state."""
    power, time, white = math.exp(state[0]), math.exp(state[1]), state[2]
    loss = 1.0 - lags / n
    decay = np.exp(-lags / time)
    bias = 2.0 * time / n
    gauss = power * (decay * loss - bias)
    spike = np.where(lags == 0, 1.0, 0.0) - 1.0 / n
    by_time = power * (decay * loss * lags / time - bias)
    return gauss + white * spike, np.column_stack([gauss, by_time, spike])


def _covariance(state: FloatArray, lags: FloatArray, n: int) -> FloatArray:
    """Bartlett's covariance of autocovariances of white plus Gauss-Markov noise."""
    power, time, white = math.exp(state[0]), math.exp(state[1]), max(state[2], 0.0)
    own = 1.0 / math.tanh(1.0 / time)  # (1 + phi²)/(1 - phi²)

    def lagged(distance: FloatArray) -> FloatArray:
        far = np.abs(distance)
        decay = np.exp(-far / time)
        total = power**2 * decay * (far + own) + 2.0 * white * power * decay
        return np.asarray(total + np.where(far == 0, white**2, 0.0))

    rows, columns = lags[:, None], lags[None, :]
    return (lagged(rows - columns) + lagged(rows + columns)) / n


def _iterate(
    state: FloatArray, relative: FloatArray, use: NDArray[np.int64], n: int
) -> tuple[FloatArray, FloatArray, float, bool]:
    """Gauss-Newton with the covariance at the start of it: state, information, misfit, settled."""
    from scipy.linalg import solve_triangular

    lags = use.astype(np.float64)
    covariance = _covariance(state, lags, n)
    covariance += np.diag(1e-9 * np.diag(covariance))
    lower = np.linalg.cholesky(covariance)

    def whitened(what: FloatArray) -> FloatArray:
        return np.asarray(solve_triangular(lower, what, lower=True))

    def slopes(at: FloatArray) -> Slopes[None]:
        model, jacobian = _model(at, lags, n)
        columns, residual = whitened(jacobian), whitened(relative[use] - model)
        return Slopes(float(residual @ residual), columns.T @ residual, columns.T @ columns, None)

    low = np.array([-np.inf, math.log(0.3), -np.inf])
    high = np.array([np.inf, math.log(relative.size), np.inf])
    found = minimise(slopes, state, (low, high), _RULES)
    return found.at, found.slopes.curvature, found.value, found.converged


def _result(
    curve: AutocorrelationCurve,
    state: FloatArray,
    information: FloatArray,
    misfit: float,
    use: NDArray[np.int64],
    settled: bool,
    variance: float,
) -> GaussMarkovCorrelation:
    from scipy.special import chdtrc

    errors = np.sqrt(np.diag(np.linalg.pinv(information, rcond=1e-14)))
    # sigma² is not known to a factor of e, and no lag alone stands out of white noise
    stands_out = float(np.max(curve.correlation[1:] - 2.5 * curve.band[1:])) > 0.0
    if not np.isfinite(state).all() or (errors[0] > 0.5 and not stands_out):
        raise _no_correlation()
    sigma = math.sqrt(variance) * math.exp(0.5 * state[0])
    time = math.exp(state[1]) / curve.rate
    freedom = use.size - 3
    p_value = float(chdtrc(freedom, misfit))
    flags = []
    if p_value < _REJECT:
        flags.append("not exponential")
    if curve.duration < _FEWEST_TIMES * time or errors[0] > 0.5:
        flags.append("record too short")
    if math.exp(state[1]) > 0.9 * curve.lag.size:
        flags.append("at the end of the lags")
    if state[2] < 1.96 * errors[2]:
        flags.append("white part not resolved")
    if not settled:
        flags.append("not converged")
    return GaussMarkovCorrelation(
        sigma=sigma,
        correlation_time=time,
        white_variance=max(float(state[2]), 0.0) * variance,
        standard_errors={
            "sigma": 0.5 * sigma * float(errors[0]),
            "correlation_time": time * float(errors[1]),
            "white_variance": variance * float(errors[2]),
        },
        sampling_error=math.sqrt(2.0 * time / curve.duration),
        misfit=misfit,
        degrees_of_freedom=int(freedom),
        p_value=p_value,
        lag=use / curve.rate,
        rate=curve.rate,
        flags=tuple(flags),
    )
