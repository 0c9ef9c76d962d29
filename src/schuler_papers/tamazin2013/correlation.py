"""Figures 1, 2 and 5: what the signal is like before anything is fitted."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from schuler.curves.allan import allan_deviation
from schuler.curves.autocorrelation import autocorrelation
from schuler.estimation.gauss_markov_correlation import fit_gauss_markov
from schuler.noise import GaussMarkov, Process, WhiteNoise
from schuler.types import FloatArray
from schuler_papers.experiment import (
    Numbers,
    Results,
    Size,
    estimate,
    generator,
    numbers,
    stacked,
)
from schuler_papers.outcome import Band, Curve, Outcome, Panel, Row
from schuler_papers.tamazin2013.predictors import ACCELEROMETER, GYRO, PAPER, RATE

SIGMA, CORRELATION_TIME, LAG_RATE = 1.0, 20.0, 5.0
MIXTURE: Process = WhiteNoise(0.1) + GaussMarkov(1.0, 2.0) + GaussMarkov(1.0, 100.0)
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
    from schuler.io import read_imu

    imu = read_imu(folder / "adis16405-static" / f"imu{seed % 6 + 1}.parquet")
    step = round(imu.rate / 5.0)
    usable = imu.accel.shape[0] // step * step
    averaged = imu.accel[:usable, 1].reshape(-1, step).mean(axis=1)
    return _correlated("real", averaged - averaged.mean(), imu.rate / step)


def figure_1(results: Results, size: Size) -> Outcome:
    """The autocorrelation of first-order Gauss-Markov noise."""
    found = stacked(results, "single_time")
    law = float(stacked(results, "single_claimed").mean())
    lag = results[0]["single_lag"]
    rows = (
        Row(
            "correlation time found over the true one",
            estimate(found / CORRELATION_TIME),
            printed=1.0,
            band=Band(1.0 - 3.0 * law, 1.0 + 3.0 * law, "spec", "3 sqrt(2 Tc/T)"),
        ),
        Row(
            "share of records whose exponential shape is not rejected at 1 %",
            estimate(stacked(results, "single_p") > 0.01),
            band=Band(0.85, 1.0, "theory", "0.99 less the scatter of few records"),
        ),
        Row(
            "correlation at one correlation time",
            estimate(_at(results, "single", CORRELATION_TIME)),
            printed=math.exp(-1.0),
            band=Band(0.30, 0.44, "theory", "1/e within its sampling error", standard_errors=2.0),
        ),
    )
    return Outcome(rows, (_drawn(results, "single", np.exp(-lag / CORRELATION_TIME)),))


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


def figure_2(results: Results, size: Size) -> Outcome:
    """A correlation that is not exponential."""
    lag = results[0]["mixed_lag"]
    covariance = MIXTURE.components[1].autocovariance(lag) + MIXTURE.components[2].autocovariance(
        lag
    )
    power = 2.0 + 0.1**2 * LAG_RATE
    law = np.where(lag == 0.0, 1.0, covariance / power)
    rows = (
        Row(
            "share of records in which one exponential is rejected at 1 %",
            estimate(stacked(results, "mixed_p") < 0.01),
            printed="'a higher-order process'",
            band=Band(0.9, 1.0, "spec", "exponential rejected"),
        ),
    )
    note = (
        "A sum of Gauss-Markov noises is higher-order and has a closed form; an AR model of high "
        "order fitted sample by sample is not needed for it."
    )
    return Outcome(rows, (_drawn(results, "mixed", law),), (note,))


def figure_2_recording(results: Results, size: Size) -> Outcome:
    """The correlation of a real accelerometer."""
    rows = (
        Row(
            "share of six records in which one exponential is rejected at 1 %",
            estimate(stacked(results, "real_p") < 0.01),
            printed="'a higher-order process'",
            band=Band(0.5, 1.0, "theory", "several time scales at once"),
        ),
    )
    return Outcome(rows, (_drawn(results, "real", None),))


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


def figure_5(results: Results, size: Size) -> Outcome:
    """An hour of both sensors."""
    minutes = (10.0 if size == "quick" else 60.0) * (np.arange(200) + 0.5) / 200.0
    rows = []
    panels = []
    for sensor, unit in ((ACCELEROMETER, "m/s²"), (GYRO, "deg/h")):
        white = sensor.process.components[0]
        assert isinstance(white, WhiteNoise)
        sample = white.density * math.sqrt(RATE) / sensor.unit
        rows += [
            Row(
                f"{sensor.name}: standard deviation of a sample, from neighbours",
                estimate(stacked(results, f"{sensor.name}_white")),
                printed=None,
                unit=unit,
                band=Band(0.99 * sample, 1.01 * sample, "theory", "N/sqrt(dt)"),
                verdict="reproduced in kind",
            ),
            Row(
                f"{sensor.name}: Allan deviation at 1 s over that of the process",
                estimate(stacked(results, f"{sensor.name}_ratio")[:, 1]),
                band=Band(0.94, 1.06, "theory", "sampling error", standard_errors=2.0),
                verdict="reproduced in kind",
            ),
            Row(
                f"{sensor.name}: rounding to 16 bits over step/sqrt(12)",
                estimate(stacked(results, f"{sensor.name}_rounding")),
                band=Band(0.99, 1.01, "theory"),
                verdict="reproduced in kind",
            ),
        ]
        low, high = results[0][f"{sensor.name}_low"], results[0][f"{sensor.name}_high"]
        panels.append(
            Panel(
                sensor.name,
                "min",
                unit,
                (Curve("twin", minutes, 0.5 * (low + high), "data", "band", low, high),),
                f"Simulated {sensor.name} signal over time.",
            )
        )
    return Outcome(tuple(rows), tuple(panels))
