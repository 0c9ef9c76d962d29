"""Figures 4 to 6, equations (11) to (18): what noises look like, and how sure a curve is."""

from __future__ import annotations

import math

import numpy as np

from schuler.curves.allan import allan_deviation
from schuler.curves.autocorrelation import autocorrelation
from schuler.curves.spectrum import power_spectral_density
from schuler.estimation.gauss_markov_correlation import fit_gauss_markov
from schuler.noise import (
    BiasInstability,
    GaussMarkov,
    Process,
    Quantization,
    RandomWalk,
    RateRamp,
    WhiteNoise,
)
from schuler.types import FloatArray
from schuler_papers.experiment import Numbers, Results, Size, estimate, generator, numbers, stacked
from schuler_papers.outcome import Band, Curve, Outcome, Panel, Role, Row
from schuler_papers.quinchia2013.sensor import PAPER

LAG_RATE, TIME = 5.0, 20.0
# process, slope of the Allan deviation and of the density (NaN: lines only), its times in s
LAWS: dict[str, tuple[Process, float, float, float, float]] = {
    "quantisation Q": (Quantization(0.05, 0.1), -1.0, 2.0, 0.1, 300.0),
    "white noise N": (WhiteNoise(0.05), -0.5, 0.0, 0.1, 300.0),
    "bias instability B": (BiasInstability(0.05, 0.01, 1e6, 2), 0.0, -1.0, 0.5, 300.0),
    "random walk K": (RandomWalk(5e-3), 0.5, -2.0, 1.0, 200.0),
    "ramp R": (RateRamp(1e-4), 1.0, math.nan, 0.1, 2000.0),
}
ROLES: tuple[Role, ...] = ("x", "y", "z", "better", "other")


def run(seed: int, size: Size) -> Numbers:
    """Simulate every noise alone and correlate a Gauss-Markov noise."""
    rng = generator(seed, PAPER, "laws")
    n = 200_000 if size == "quick" else 1_000_000
    found: dict[str, FloatArray | float] = {}
    for name, (process, _, rise, low, high) in LAWS.items():
        signal = process.simulate(n, 0.1, rng)
        curve = allan_deviation(signal, 10.0)
        use = (curve.tau >= low) & (curve.tau <= high)
        weight = np.sqrt(np.minimum(curve.degrees_of_freedom[use], 1000.0))
        x, y = np.log(curve.tau[use]), np.log(curve.deviation[use])
        found[f"{name}:allan"] = float(np.polyfit(x, y, 1, w=weight)[0])
        found[f"{name}:tau"], found[f"{name}:deviation"] = curve.tau, curve.deviation
        if math.isfinite(rise):
            spectrum = power_spectral_density(signal, 10.0, onesided=True)
            band = (spectrum.frequency > 3e-3) & (spectrum.frequency < 0.5)
            f, s = np.log(spectrum.frequency[band]), np.log(spectrum.density[band])
            sure = np.sqrt(spectrum.degrees_of_freedom[band])
            found[f"{name}:psd"] = float(np.polyfit(f, s, 1, w=sure)[0])
            found[f"{name}:frequency"] = spectrum.frequency
            found[f"{name}:density"] = spectrum.density
    markov = GaussMarkov(1.0, TIME).simulate(n // 4, 1.0 / LAG_RATE, rng)
    lags = autocorrelation(markov, LAG_RATE, max_lag=100.0)
    fit = fit_gauss_markov(lags)
    keep = slice(None, None, 5)
    found |= {"lag": lags.lag[keep], "correlation": lags.correlation[keep]}
    found |= {"time": fit.correlation_time, "claimed": fit.sampling_error}
    return numbers(**found)


def figure_4(results: Results, size: Size) -> Outcome:
    """Autocorrelation of Gauss-Markov noise."""
    lag, mean = results[0]["lag"], stacked(results, "correlation").mean(axis=0)
    law = float(stacked(results, "claimed").mean())
    rows = (
        Row(
            "correlation time found over the true one",
            estimate(stacked(results, "time") / TIME),
            1.0,
            band=Band(1.0 - 3.0 * law, 1.0 + 3.0 * law, "spec", "3 sqrt(2 Tc/T)"),
        ),
        Row(
            "(11) as printed, exp(+beta tau), at three correlation times",
            math.exp(3.0),
            "a decay",
            "wrong in the paper",
            reason="the sign is missing: a correlation above one",
            erratum="E-004-1",
        ),
    )
    panel = Panel(
        "First-order Gauss-Markov noise",
        "lag, s",
        "autocorrelation",
        (
            Curve("measured", lag, mean, "ours"),
            Curve("exp(-lag/Tc)", lag, np.exp(-lag / TIME), "theory", "dash"),
        ),
        "Decays to 1/e at the correlation time of 20 s.",
    )
    return Outcome(rows, (panel,))


def figure_5(results: Results, size: Size) -> Outcome:
    """Slopes of the density."""
    rows, curves = [], []
    for role, (name, (_, _, slope, _, _)) in zip(ROLES, LAWS.items(), strict=True):
        if math.isnan(slope):
            continue
        rows.append(
            Row(
                f"slope of {name}",
                estimate(stacked(results, f"{name}:psd")),
                slope,
                band=Band(slope - 0.05, slope + 0.05, "spec", standard_errors=2.0),
            )
        )
        mean = stacked(results, f"{name}:density").mean(axis=0)
        curves.append(Curve(name, results[0][f"{name}:frequency"], mean, role))
    panel = Panel(
        "Densities of the noises",
        "frequency, Hz",
        "one-sided density",
        tuple(curves),
        "Straight lines of slope 2, 0, -1, -2.",
        log_x=True,
        log_y=True,
    )
    return Outcome(tuple(rows), (panel,))


def figure_6(results: Results, size: Size) -> Outcome:
    """Slopes of the Allan deviation."""
    rows, curves = [], []
    for role, (name, (_, slope, _, _, _)) in zip(ROLES, LAWS.items(), strict=True):
        rows.append(
            Row(
                f"slope of {name}",
                estimate(stacked(results, f"{name}:allan")),
                slope,
                band=Band(slope - 0.05, slope + 0.05, "spec", standard_errors=2.0),
            )
        )
        mean = stacked(results, f"{name}:deviation").mean(axis=0)
        curves.append(Curve(name, results[0][f"{name}:tau"], mean, role))
    panel = Panel(
        "Allan deviations of the noises",
        "cluster time, s",
        "Allan deviation",
        tuple(curves),
        "Straight lines of slope -1, -1/2, 0, +1/2, +1.",
        log_x=True,
        log_y=True,
    )
    return Outcome(tuple(rows), (panel,))
