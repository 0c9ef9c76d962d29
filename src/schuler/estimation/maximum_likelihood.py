"""Exact maximum likelihood of white noise + Gauss-Markov noises + random walk + a constant.

The efficient alternative to moments: nothing in the record is lost to averaging over scales. The
unknown constant (or the start of the walk) is diffuse, so that the likelihood is that of all
differences. Spec 10; Ye, Bar-Shalom, Willett, Zaki 2024, IEEE Sensors Journal.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from schuler.curves.wavelet_variance import WaveletVarianceCurve, wavelet_variance
from schuler.data.to_dict import plain
from schuler.errors import EstimationError, InputError, ModelError
from schuler.estimation.curve_fit import limits_of
from schuler.estimation.disturbances.outliers import contamination
from schuler.estimation.gmwm.fit import fit_gmwm_curves
from schuler.estimation.gmwm.scatter import (
    misfit,
    pooled_points,
    pooled_scatter,
    relative_covariance,
)
from schuler.estimation.identification import FitDiagnostics, Identification
from schuler.estimation.optimizer import Rules, Slopes, minimise
from schuler.estimation.parts import (
    FittedParts,
    Names,
    estimates_of,
    free_parameters,
    log_bounds,
    logs_of,
    with_logs,
)
from schuler.estimation.record import judge_record
from schuler.estimation.slopes import slope_method
from schuler.noise import (
    BiasInstability,
    GaussMarkov,
    Process,
    ProcessSum,
    RateRamp,
    WhiteNoise,
)
from schuler.noise.elements import Elements
from schuler.types import FloatArray

_SHORTEST_RECORD = 100
_STEP = 1e-6
_STEADY = 1e-13
_RULES = Rules(damping=1e-3, most=1e8, floor=1e-6, ridge=1e-9, close=1e-7, rounding=1e-12)
_LONGEST_BLOCK = 64
_FEWEST_BLOCKS = 20_000
_VANISHED = 1e-7


@dataclass(frozen=True, slots=True, eq=False)
class LikelihoodIdentification(Identification):
    """What maximum likelihood found.

    Parameters
    ----------
    log_likelihood : float
        Diffuse log-likelihood at the estimate, of the block means.
    aic, bic : float
        Information criteria; comparable among models of the same data and block.
    innovation_variance : float
        Of a block mean, one step ahead.
    block : int
        Samples averaged into one value; 1 for the likelihood of every sample.
    wavelet : WaveletVarianceCurve
        Curve of the data, against which the misfit in `diagnostics` is counted.
    flags : tuple of str
        What a reader should know, in plain words.

    Notes
    -----
    All else as in `Identification`; standard errors come from the information.
    """

    log_likelihood: float
    aic: float
    bic: float
    innovation_variance: float
    block: int
    wavelet: WaveletVarianceCurve
    flags: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return plain values for JSON, in SI."""
        names = ("log_likelihood", "aic", "bic", "innovation_variance", "block", "flags")
        more = {name: plain(getattr(self, name)) for name in names}
        more |= {"method": "maximum likelihood", "converged": self.diagnostics.converged}
        return Identification.to_dict(self) | more


def fit_maximum_likelihood(
    signal: ArrayLike,
    rate: float,
    model: str | Process = "auto",
    block: int | Literal["auto"] = 1,
) -> LikelihoodIdentification:
    """Find the parameters of a sum of processes by exact Gaussian maximum likelihood.

    Parameters
    ----------
    signal : (n,) array_like
        Samples at rest, in rad/s or m/s² (or any unit; the result is in the same).
    rate : float
        Samples a second.
    model : {"auto", "classical"} or Process
        A sum of white noise, Gauss-Markov noises, random walk, bias instability (a constant is
        always there); "auto" takes the structure that wavelet moments choose. A ramp is taken off
        by least squares first.
    block : int or "auto"
        Average so many samples into one value first; the processes of the means are the exact
        ones. "auto" averages long records as far as white noise dominates. What is lost is
        knowledge of N (its error grows with the square root of the block) and of noise faster
        than a block.

    Returns
    -------
    LikelihoodIdentification
        Process, standard errors from the information, misfit of the wavelet variance.

    Raises
    ------
    InputError
        Not one-dimensional, not finite, an impossible rate or block, an unknown model.
    EstimationError
        Fewer than 100 samples or means, or a signal that does not vary.
    ModelError
        A process that this likelihood does not know, or nothing to fit.

    Examples
    --------
    >>> import numpy as np
    >>> from schuler import GaussMarkov, WhiteNoise, fit_maximum_likelihood
    >>> truth = WhiteNoise(1e-3) + GaussMarkov(1e-2, 1.0)
    >>> signal = truth.simulate(20_000, 0.01, np.random.default_rng(1))
    >>> found = fit_maximum_likelihood(signal, 100.0, model=truth)
    >>> round(found.parameters["gauss_markov.correlation_time"], 1)
    1.1
    """
    values = np.asarray(signal)
    if values.ndim != 1:
        raise InputError(f"signal has shape {values.shape}", expected="(n,), one channel at a time")
    if values.size < _SHORTEST_RECORD:
        raise EstimationError(
            f"signal has {values.size} samples", expected=f"at least {_SHORTEST_RECORD}"
        )
    curve = wavelet_variance(values, rate)
    begin = fit_gmwm_curves([curve], _known(model), contamination(values).ratio)
    flags = [f for f in begin.flags if f.startswith("heavy tails")]
    line = RateRamp(0.0)
    if any(isinstance(p, RateRamp) for p in begin.process.parts):
        values, line = _without_line(values, rate)
        flags.append(f"a line of {line.slope:.4g} a second was taken off by least squares first")
        begin = fit_gmwm_curves([wavelet_variance(values, rate)], _known(model))
    fastest = 0.43 / rate
    parts = tuple(q for p in begin.process.parts if p.likelihood for q in p.coarser(fastest))
    flags += [
        f"{p.kind} is part of the wavelet fit but not of this likelihood, and was left out"
        for p in begin.process.parts
        if not p.likelihood and not isinstance(p, RateRamp)
    ]
    if not any(isinstance(p, WhiteNoise | GaussMarkov | BiasInstability) for p in parts):
        parts = (WhiteNoise(math.sqrt(2.0 * float(curve.variance[0]) / rate)), *parts)
    count = _block(block, parts, values.size, 1.0 / rate)
    means = _block_means(values, count)
    if line.slope:
        parts = (*parts, line)
    found = _maximise(parts, means, 1.0 / rate, count)
    return _result(found, curve, count, means.size, flags)


def _known(
    model: str | Process,
) -> str | Process:
    if isinstance(model, Process):
        strange = [
            p.kind for p in model.components if not (p.likelihood or isinstance(p, RateRamp))
        ]
        if strange:
            raise ModelError(
                f"the likelihood does not know '{strange[0]}'",
                expected="white noise, Gauss-Markov, random walk, bias instability",
                cure="use wavelet moments",
            )
    return model


def _without_line(values: NDArray[Any], rate: float) -> tuple[FloatArray, RateRamp]:
    """The signal less its least squares line through the middle, and the line."""
    time = (np.arange(values.size) - 0.5 * (values.size - 1)) / rate
    slope = float(time @ (values - values.mean())) / float(time @ time)
    return np.asarray(values - slope * time), RateRamp(slope)


def _block(wanted: int | str, parts: Sequence[Process], samples: int, dt: float) -> int:
    if wanted == "auto":
        white = math.fsum(p.elements(dt).white for p in parts)
        block = 1
        while block < _LONGEST_BLOCK and samples // (2 * block) >= _FEWEST_BLOCKS:
            # what the other processes add from mean to mean must stay well below white noise
            moved = math.fsum(
                4.0 * float(p.wavelet_variance(2 * block * dt))
                for p in parts
                if not isinstance(p, WhiteNoise)
            )
            if 20.0 * moved > white / (2 * block):
                break
            block *= 2
        return block
    if not isinstance(wanted, int | np.integer) or wanted < 1:
        raise InputError(f"block is {wanted}", expected="1, 2, ... or 'auto'")
    if samples // wanted < _SHORTEST_RECORD:
        raise EstimationError(
            f"{samples // wanted} means of {wanted} samples",
            expected=f"at least {_SHORTEST_RECORD}",
            cure="take a shorter block",
        )
    return int(wanted)


def _block_means(values: NDArray[Any], block: int) -> FloatArray:
    whole = values.size // block * block
    data = np.asarray(values[:whole], dtype=np.float64)
    offset = data[:: max(1, data.size // 4096)].mean()
    return np.ascontiguousarray((data - offset).reshape(-1, block).mean(axis=1))


def _states(parts: Sequence[Process], dt: float, block: int) -> tuple[FloatArray, float]:
    """States of the means of `block` samples: rows phi, a, q, c, start variance; and r.

    With w_j the step from sample j - 1 to j of a block, the mean holds (1/b) sum w_j c_j,
    c_j = 1 + phi + ... + phi^(b-1-j), and the state at the next block holds phi^(b-j) w_j.
    """
    seen = Elements.together([p.elements(dt) for p in parts])
    noises = seen.gauss_markovs
    rows = np.empty((5, len(noises) + 1))
    noise = seen.white / block
    for k in range(len(noises) + 1):
        is_level = k == len(noises)
        start, decay = (0.0, 0.0) if is_level else (noises[k][0], dt / noises[k][1])
        variance = seen.walk if is_level else -start * math.expm1(-2.0 * decay)
        powers = np.exp(-decay * np.arange(block))
        sums = np.cumsum(powers)
        within, across = sums[: block - 1], np.exp(-decay * np.arange(1, block))
        rows[0, k] = math.exp(-decay * block)
        rows[1, k] = sums[-1] / block
        rows[2, k] = variance * float(np.sum(powers**2))
        rows[3, k] = variance * float(within @ across) / block
        rows[4, k] = start
        noise += variance * float(within @ within) / block**2
    return rows, noise


@dataclass(frozen=True, slots=True, eq=False)
class _Maximum:
    parts: tuple[Process, ...]
    names: Names
    covariance: FloatArray
    log_likelihood: float
    innovation_variance: float
    converged: bool


def _evaluate(
    parts: Sequence[Process],
    names: Names,
    logs: FloatArray,
    data: FloatArray,
    dt: float,
    block: int,
) -> tuple[float, float, FloatArray, FloatArray]:
    """Log-likelihood, innovation variance, score and information at `logs`."""
    from schuler.kernels.noise.likelihood import SideBySide, likelihood_pass

    moved = [logs, *(logs + _STEP * unit for unit in np.eye(logs.size))]
    built = [_states(with_logs(parts, names, m), dt, block) for m in moved]
    rows = np.ascontiguousarray(np.array([b[0] for b in built]).transpose(1, 0, 2))
    noise = np.array([b[1] for b in built])
    score, information = np.zeros(logs.size), np.zeros((logs.size, logs.size))
    many = SideBySide(rows[0], rows[1], rows[2], rows[3], rows[4], noise)
    total, variance = likelihood_pass(data, many, _STEP, _STEADY, score, information)
    return total, variance, score, information


def _maximise(parts: Sequence[Process], data: FloatArray, dt: float, block: int) -> _Maximum:
    """Fisher scoring with damping; amplitudes and times stay within what the data can show."""
    names = tuple(f for f in free_parameters(parts) if parts[f[0]].random)
    if not names:
        raise ModelError("the model has no parameter that a likelihood shows")
    scale = float(np.std(np.diff(data)))
    if scale == 0.0:
        raise EstimationError("signal does not vary", expected="noise")
    # in units of its own steps, so that the unit of the signal decides nothing
    unit = data / scale
    parts = [p.scaled(1.0 / scale) if p.random else p for p in parts]
    low, high = log_bounds(parts, names, 0.5 * block * dt, data.size * block * dt)
    low = np.maximum(low, math.log(_VANISHED * math.sqrt(dt)))

    def slopes(logs: FloatArray) -> Slopes[float]:
        value, variance, score, information = _evaluate(parts, names, logs, unit, dt, block)
        return Slopes(-value, score, information, variance)

    found = minimise(slopes, np.clip(logs_of(parts, names), low, high), (low, high), _RULES)
    information = found.slopes.curvature + 1e-9 * np.eye(len(names))
    fitted = with_logs(parts, names, found.at)
    return _Maximum(
        tuple(p.scaled(scale) if p.random else p for p in fitted),
        names,
        np.asarray(np.linalg.inv(information), dtype=np.float64),
        -found.value - (data.size - 1) * math.log(scale),
        found.slopes.state * scale**2,
        found.converged,
    )


def _result(
    found: _Maximum, curve: WaveletVarianceCurve, block: int, count: int, flags: list[str]
) -> LikelihoodIdentification:
    process = ProcessSum(found.parts)
    if not found.converged:
        flags.append("the search for the maximum did not converge")
    keep = curve.factors >= block
    model = curve.of(process)
    scatter = relative_covariance(process, curve)[np.ix_(keep, keep)]
    chi_square = misfit(curve.variance[keep], model[keep], scatter)
    freedom = int(np.count_nonzero(keep)) - len(found.names)
    wider = _widening(chi_square, freedom)
    if wider > 1.0:
        flags.append(
            f"the model misses the wavelet variance (chi-square {chi_square:.3g} for {freedom}): "
            f"errors were widened {math.sqrt(wider):.3g} times"
        )
    covariance = wider * found.covariance
    numbers = estimates_of(found.parts, found.names, covariance)
    points = pooled_points([curve])
    fitted = FittedParts(found.parts, found.names, covariance, 0.0, found.converged)
    absent = limits_of(fitted, points, pooled_scatter(process, [curve], points))
    parameters = len(found.names)
    return LikelihoodIdentification(
        process=process,
        standard_errors=numbers.errors,
        intervals=numbers.intervals,
        limits={**absent, **numbers.limits},
        curve=curve.allan,
        diagnostics=FitDiagnostics(
            chi_square=chi_square,
            degrees_of_freedom=freedom,
            discrepancy=0.0,
            tau=curve.scale[keep],
            residuals=0.5 * np.log(curve.variance / model)[keep],
            candidates={},
            converged=found.converged,
        ),
        slopes=slope_method(curve.allan),
        verdict=judge_record(process, numbers.errors, curve.duration),
        log_likelihood=found.log_likelihood,
        aic=2.0 * parameters - 2.0 * found.log_likelihood,
        bic=math.log(count) * parameters - 2.0 * found.log_likelihood,
        innovation_variance=found.innovation_variance,
        block=block,
        wavelet=curve,
        flags=tuple(flags),
    )


def _widening(chi_square: float, freedom: int) -> float:
    """By how much more the estimates scatter than the information says, as the misfit shows."""
    from scipy.special import chdtrc

    by_chance = freedom <= 0 or float(chdtrc(freedom, chi_square)) >= 1e-3
    return 1.0 if by_chance else chi_square / freedom
