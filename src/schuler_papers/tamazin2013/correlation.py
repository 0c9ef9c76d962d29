"""Figures 1, 2 and 5: what the signal is like before anything is fitted."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from schuler import (
    GaussMarkov,
    WhiteNoise,
    allan_deviation,
    autocorrelation,
    fit_gauss_markov,
    read_imu,
)
from schuler_papers.experiment import (
    FloatArray,
    Numbers,
    Results,
    Size,
    generator,
    numbers,
    stacked,
)
from schuler_papers.judging import Found, plain
from schuler_papers.outcome import Curve, Panel
from schuler_papers.tamazin2013.predictors import ACCELEROMETER, GYRO, PAPER, RATE

SIGMA, CORRELATION_TIME, LAG_RATE = 1.0, 20.0, 5.0
MIXTURE = WhiteNoise(0.1) + GaussMarkov(1.0, 2.0) + GaussMarkov(1.0, 100.0)
_SHOWN = 60


def run(seed: int, size: Size) -> Numbers:
    """Correlate a Gauss-Markov noise and a mixture of two, two hours long."""
    rng = generator(seed, PAPER, "correlation")
    samples = round((2.0 if size == "quick" else 10.0) * 3600.0 * LAG_RATE)
    single = GaussMarkov(SIGMA, CORRELATION_TIME).simulate(samples, 1.0 / LAG_RATE, rng)
    mixed = MIXTURE.simulate(samples, 1.0 / LAG_RATE, rng)
    return _correlated("single", single, LAG_RATE) | _correlated("mixed", mixed, LAG_RATE)


def _correlated(name: str, signal: FloatArray, rate: float) -> Numbers:
    curve = autocorrelation(signal, rate, max_lag=300.0)
    fit = fit_gauss_markov(curve)
    keep = np.unique(np.linspace(0, curve.lag.size - 1, _SHOWN).round().astype(int))
    return numbers(
        **{
            f"{name}_lag": curve.lag[keep],
            f"{name}_correlation": curve.correlation[keep],
            f"{name}_time": fit.correlation_time,
            f"{name}_claimed": fit.sampling_error,
            f"{name}_p": fit.p_value,
            f"{name}_share": fit.sigma**2 / (fit.sigma**2 + fit.white_variance),
        }
    )


def run_recording(seed: int, size: Size, folder: Path) -> Numbers:
    """Correlate the y accelerometer of one of six static ADIS16405 recordings."""
    imu = read_imu(folder / "adis16405-static" / f"imu{seed % 6 + 1}.parquet")
    step = round(imu.rate / 5.0)
    usable = imu.accel.shape[0] // step * step
    averaged = imu.accel[:usable, 1].reshape(-1, step).mean(axis=1)
    return _correlated("real", averaged - averaged.mean(), imu.rate / step)


def figure_1(results: Results, size: Size) -> Found:
    """The autocorrelation of first-order Gauss-Markov noise."""
    law = 3.0 * float(stacked(results, "single_claimed").mean())
    lag = results[0]["single_lag"]
    values = {
        "ratio": stacked(results, "single_time") / CORRELATION_TIME,
        "shape": (stacked(results, "single_p") > 0.01).astype(float),
        "at time": _at(results, "single", CORRELATION_TIME),
    }
    panel = _drawn(results, "single", np.exp(-lag / CORRELATION_TIME))
    return Found(values, {"ratio": np.array([1.0 - law, 1.0 + law])}, panels=(panel,))


def _at(results: Results, name: str, lag: float) -> FloatArray:
    values = [np.interp(lag, r[f"{name}_lag"], r[f"{name}_correlation"]) for r in results]
    return np.array(values)


def _drawn(results: Results, name: str, law: FloatArray | None) -> Panel:
    lag = results[0][f"{name}_lag"]
    values = stacked(results, f"{name}_correlation")
    mean = values.mean(axis=0)
    time = float(stacked(results, f"{name}_time").mean())
    share = float(stacked(results, f"{name}_share").mean())
    curves = [Curve("measured, mean", lag, mean, "ours")]
    if len(results) > 1:
        low, high = values.min(axis=0), values.max(axis=0)
        curves.insert(0, Curve("all records", lag, mean, "ours", "band", low, high))
    if law is not None:
        curves.append(Curve("closed form", lag, law, "theory", "dash"))
    if name != "single":
        curves.append(
            Curve("one exponential, fitted", lag, share * np.exp(-lag / time), "paper", "dash")
        )
    return Panel(
        {"single": "Gauss-Markov noise", "mixed": "a mixture", "real": "ADIS16405, y"}[name],
        "lag, s",
        "autocorrelation",
        tuple(curves),
        "Autocorrelation by lag.",
    )


def figure_2(results: Results, size: Size) -> Found:
    """A correlation that is not exponential."""
    lag = results[0]["mixed_lag"]
    covariance = sum(p.autocovariance(lag) for p in MIXTURE.components[1:])
    power = 2.0 + 0.1**2 * LAG_RATE
    law = np.where(lag == 0.0, 1.0, covariance / power)
    rejected = (stacked(results, "mixed_p") < 0.01).astype(float)
    return Found({"rejected": rejected}, panels=(_drawn(results, "mixed", law),))


def figure_2_recording(results: Results, size: Size) -> Found:
    """The correlation of a real accelerometer."""
    rejected = (stacked(results, "real_p") < 0.01).astype(float)
    return Found({"rejected": rejected}, panels=(_drawn(results, "real", None),))


def run_signal(seed: int, size: Size) -> Numbers:
    """Draw the signals of figure 5."""
    rng = generator(seed, PAPER, "signal")
    samples = 120_000 if size == "quick" else 720_000
    found: Numbers = {}
    for sensor in (ACCELEROMETER, GYRO):
        exact = sensor.process.simulate(samples, 1.0 / RATE, rng) / sensor.unit
        step = sensor.step / sensor.unit
        raw = np.round(exact / step) * step
        taus = np.array([0.1, 1.0, 10.0, 60.0])
        curve = allan_deviation(raw, RATE, taus)
        expected = np.sqrt(sensor.process.allan_variance(curve.tau)) / sensor.unit
        parts = raw.reshape(200, -1)
        found |= numbers(
            **{
                f"{sensor.name}_ratio": curve.deviation / expected,
                f"{sensor.name}_rounding": (raw - exact).std() * math.sqrt(12.0) / step,
                f"{sensor.name}_low": parts.min(axis=1),
                f"{sensor.name}_high": parts.max(axis=1),
                f"{sensor.name}_white": np.diff(raw).std() / math.sqrt(2.0),
            }
        )
    return found


def figure_5(results: Results, size: Size) -> Found:
    """An hour of both sensors."""
    minutes = (10.0 if size == "quick" else 60.0) * (np.arange(200) + 0.5) / 200.0
    bands, panels = {}, []
    for sensor, unit in ((ACCELEROMETER, "m/s²"), (GYRO, "deg/h")):
        white = sensor.process.components[0]
        assert isinstance(white, WhiteNoise)
        sample = white.density * math.sqrt(RATE) / sensor.unit
        bands[f"{sensor.name}_white"] = np.array([0.99 * sample, 1.01 * sample])
        low, high = results[0][f"{sensor.name}_low"], results[0][f"{sensor.name}_high"]
        shown = Curve("twin", minutes, 0.5 * (low + high), "data", "band", low, high)
        words = f"Simulated {sensor.name} signal over time."
        panels.append(Panel(sensor.name, "min", unit, (shown,), words))
    return Found(plain(results, size).values, bands, panels=tuple(panels))
