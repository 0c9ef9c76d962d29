"""Figures 6 and 7, Tables 1 and 2, equation (29): predictors compared on the same data.

The paper gives FOS the raw signal and everybody else the de-noised one. Here every method gets
both, is trained on the first three minutes, and is judged on what it has not seen.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Literal

import numpy as np

from schuler import (
    GaussMarkov,
    Process,
    RandomWalk,
    WhiteNoise,
    compare_predictors,
    denoise,
    fast_orthogonal_search,
    fit_ar,
    fit_ar_orders,
    innovation_variance_of_signal,
    multi_step_ar,
    read_imu,
    search_by_protocol,
)
from schuler_papers.experiment import FloatArray, Numbers, Size, generator, numbers

ArMethod = Literal["yule-walker", "covariance", "burg"]

PAPER = "tamazin2013"
RATE = 200.0
ORDERS = np.arange(1, 11)
SECOND_DEGREE_LAGS = np.array([1, 2, 3, 4, 6, 10])
AR_METHODS: tuple[ArMethod, ...] = ("yule-walker", "covariance", "burg")
METHODS = (*AR_METHODS, "FOS, degree 1")
DEG_H = math.radians(1.0) / 3600.0


@dataclass(frozen=True, slots=True)
class Sensor:
    """A twin of one channel of the Crossbow CC-300.

    Parameters
    ----------
    name : str
        Experiment.
    process : Process
        Its noise, in SI.
    step : float
        Resolution of 16 bits, in SI.
    unit : float
        The unit of the tables in SI.
    printed_covariance : float
        Error of the covariance method at order 1 as printed, in that unit squared.
    printed_floor : float
        Error of Yule-Walker at order 10 as printed.
    """

    name: str
    process: Process
    step: float
    unit: float
    printed_covariance: float
    printed_floor: float


ACCELEROMETER = Sensor(
    "accelerometer",
    WhiteNoise(1e-3) + GaussMarkov(2e-3, 100.0) + RandomWalk(1e-5),
    4.0 * 9.80665 / 2**16,
    1.0,
    3e-11,
    5e-9,
)
GYRO = Sensor(
    "gyro",
    WhiteNoise(100.0 * DEG_H) + GaussMarkov(60.0 * DEG_H, 100.0) + RandomWalk(1.0 * DEG_H),
    200.0 * math.radians(1.0) / 2**16,
    DEG_H,
    5e-6,
    2e-6,
)


def run_accelerometer(seed: int, size: Size) -> Numbers:
    """Compare predictors on a twin of the accelerometer."""
    return _run_twin(ACCELEROMETER, seed, size)


def run_gyro(seed: int, size: Size) -> Numbers:
    """Compare predictors on a twin of the gyro."""
    return _run_twin(GYRO, seed, size)


def run_recording(seed: int, size: Size, folder: Path) -> Numbers:
    """Compare predictors on the y accelerometer of the six static ADIS16405 recordings."""
    imu = read_imu(folder / "adis16405-static" / f"imu{seed % 6 + 1}.parquet")
    samples = round((1200.0 if size == "quick" else 3600.0) * imu.rate)
    raw = imu.accel[:samples, 1] - imu.accel[:samples, 1].mean()
    return _compare(raw, imu.rate, 3, None, 1.0)


def _run_twin(sensor: Sensor, seed: int, size: Size) -> Numbers:
    rng = generator(seed, PAPER, sensor.name)
    samples = 120_000 if size == "quick" else 720_000
    noise = sensor.process.simulate(samples, 1.0 / RATE, rng)
    raw = np.round(noise / sensor.step) * sensor.step
    found = _compare(raw / sensor.unit, RATE, 4, sensor.process, sensor.unit)
    return found | _offset_left_in(raw, sensor)


def _compare(
    raw: FloatArray, rate: float, level: int, process: Process | None, unit: float
) -> Numbers:
    smooth = denoise(raw, wavelet="db4", level=level, details="zero").signal
    training = round(180.0 * rate)
    rest = slice(2 * training, None)
    found = numbers(samples=raw.size)
    for kind, signal in (("raw", raw), ("smooth", smooth)):
        mean = signal[:training].mean()
        train, unseen = signal[:training] - mean, signal[rest] - mean
        found |= {f"{kind}_{k}": v for k, v in _errors(train, unseen).items()}
        found[f"{kind}_floor"] = np.asarray(innovation_variance_of_signal(unseen))
        weights = fast_orthogonal_search(train, 10, 1, 9, stopping=None).coefficients
        found[f"{kind}_weight_sum"] = np.asarray(weights.sum())
        found[f"{kind}_weight_squares"] = np.asarray(weights @ weights)
    if process is not None:
        mean = raw[:training].mean()
        scaled = _in_unit(process, unit)
        found["true_floor"] = np.asarray(scaled.innovation_variance(1.0 / rate))
        found |= _next_second(raw[:training] - mean, raw[rest] - mean, rate, scaled)
    shown = fit_ar(smooth[:training], 10, "covariance")
    left = shown.residuals(raw[rest])
    found["smooth_model_on_raw"] = np.asarray(left @ left / left.size)
    chosen = search_by_protocol(raw, training, training, max_lags=(1, 4, 10))
    found["protocol_degree"] = np.asarray(chosen.degree)
    found["protocol_error"] = np.asarray(chosen.mean_square_error[0])
    return found | _seconds(smooth[:training] - smooth[:training].mean())


def _errors(train: FloatArray, unseen: FloatArray) -> Numbers:
    """Held-out one-step errors of all methods and orders, from the same sample on."""
    linear = np.empty((len(METHODS), ORDERS.size))

    def error(residuals: FloatArray) -> float:
        kept = residuals[-(unseen.size - ORDERS[-1]) :]
        return float(kept @ kept) / kept.size

    for column, order in enumerate(ORDERS.tolist()):
        for row, method in enumerate(AR_METHODS):
            fit = fit_ar(train, order, method, remove_mean=False)
            linear[row, column] = error(fit.residuals(unseen))
        search = fast_orthogonal_search(train, order, 1, order, stopping=None)
        linear[-1, column] = error(search.residuals(unseen))
    quadratic = np.empty(SECOND_DEGREE_LAGS.size)
    terms = np.empty(SECOND_DEGREE_LAGS.size)
    for column, lag in enumerate(SECOND_DEGREE_LAGS.tolist()):
        search = fast_orthogonal_search(train, lag, 2)
        quadratic[column] = error(search.residuals(unseen))
        terms[column] = len([t for t in search.terms if len(t) > 1])
    return numbers(linear=linear, quadratic=quadratic, quadratic_terms=terms)


def _offset_left_in(raw: FloatArray, sensor: Sensor) -> Numbers:
    """What the methods say of a record as quiet as the paper's whose mean was not taken off."""
    smooth = denoise(raw, wavelet="db4", level=4, details="zero").signal
    alone = fit_ar_orders(smooth, 1, "covariance").innovation_variance[1]
    quiet = smooth / sensor.unit * math.sqrt(sensor.printed_covariance / (alone / sensor.unit**2))
    # the window ends of a shorter record weigh more: the same floor at any length
    with_offset = quiet + math.sqrt(0.5 * sensor.printed_floor * quiet.size)
    own = fit_ar_orders(with_offset, 10, "yule-walker", remove_mean=False).innovation_variance
    plain = fit_ar_orders(with_offset, 10, "covariance", remove_mean=False).innovation_variance
    return numbers(
        offset_floor=(with_offset[0] ** 2 + with_offset[-1] ** 2) / with_offset.size,
        offset_hour=math.sqrt(0.5 * sensor.printed_floor * 3600.0 * RATE),
        offset_yule_walker=own[1:],
        offset_covariance=plain[1:],
        quiet_density=math.sqrt(sensor.printed_covariance / (alone / sensor.unit**2)),
    )


def _next_second(train: FloatArray, unseen: FloatArray, rate: float, process: Process) -> Numbers:
    """Mean square errors of the mean of the next second, which is what an outage integrates."""
    step = round(rate)
    means = [s[: s.size // step * step].reshape(-1, step).mean(axis=1) for s in (train, unseen)]
    told = compare_predictors(
        *means, rate=rate / step, process=process, horizons=(1,), max_order=10
    )
    first = means[1].size // 10
    origins = np.arange(first + 1, means[1].size) * step - 1
    ahead = np.linspace(1, step, 5).astype(int)
    foreseen = multi_step_ar(fit_ar(train, 10, "covariance"), unseen, ahead.tolist(), origins)
    left = means[1][first + 1 :] - foreseen.mean(axis=1)
    names = {"zero": "second_zero", "last value": "second_last", "AR by BIC": "second_slow_ar"}
    names["Kalman"] = "second_kalman"
    found = {to: told[name].mean_square_error[0] for name, to in names.items()}
    return numbers(second_fast_ar=left @ left / left.size, **found)


def _in_unit(process: Process, unit: float) -> Process:
    white, markov, walk = process.components
    assert isinstance(white, WhiteNoise)
    assert isinstance(markov, GaussMarkov)
    assert isinstance(walk, RandomWalk)
    return (
        WhiteNoise(white.density / unit)
        + GaussMarkov(markov.sigma / unit, markov.correlation_time)
        + RandomWalk(walk.density / unit)
    )


def _seconds(train: FloatArray) -> Numbers:
    """CPU time of fits of orders 10 and 1 on the same samples."""
    return numbers(seconds=_costs(train, 10), seconds_1=_costs(train, 1))


def _costs(train: FloatArray, order: int) -> list[float]:
    def cost(fit: Callable[[], object]) -> float:
        best = math.inf
        for _ in range(3):
            start = time.process_time()
            fit()
            best = min(best, time.process_time() - start)
        return best

    linear = [cost(partial(fit_ar_orders, train, order, m)) for m in AR_METHODS]
    search = partial(fast_orthogonal_search, train, order, stopping=None)
    return [*linear, *(cost(partial(search, degree=d, max_terms=10)) for d in (1, 2))]
