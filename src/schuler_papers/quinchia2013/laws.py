"""Figures 4 to 6, equations (11) to (18): what noises look like, and how sure a curve is."""

from __future__ import annotations

import math

import numpy as np

from schuler import (
    BiasInstability,
    GaussMarkov,
    Process,
    Quantization,
    RandomWalk,
    RateRamp,
    WhiteNoise,
    allan_deviation,
    autocorrelation,
    fit_gauss_markov,
    power_spectral_density,
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
from schuler_papers.judging import Found, Value, plain
from schuler_papers.outcome import Curve, Panel, Proof, Role
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


def figure_4(results: Results, size: Size) -> Found:
    """Autocorrelation of Gauss-Markov noise."""
    lag, mean = results[0]["lag"], stacked(results, "correlation").mean(axis=0)
    law = 3.0 * float(stacked(results, "claimed").mean())
    growth = math.exp(3.0)
    proof = Proof("no correlation is above one, exp(+3) is", growth, 1.0, math.inf, "bound")
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
    values: dict[str, Value] = {"ratio": stacked(results, "time") / TIME, "growth": growth}
    band = {"ratio": np.array([1.0 - law, 1.0 + law])}
    return Found(values, band, {"growth": proof}, panels=(panel,))


def figure_5(results: Results, size: Size) -> Found:
    """Slopes of the density."""
    names = [name for name, law in LAWS.items() if not math.isnan(law[2])]
    panel = _slopes(
        results, names, ("frequency", "density"), "Densities of the noises",
        ("frequency, Hz", "one-sided density"), "Straight lines of slope 2, 0, -1, -2.",
    )  # fmt: skip
    return Found(plain(results, size).values, panels=(panel,))


def figure_6(results: Results, size: Size) -> Found:
    """Slopes of the Allan deviation."""
    panel = _slopes(
        results, list(LAWS), ("tau", "deviation"), "Allan deviations of the noises",
        ("cluster time, s", "Allan deviation"), "Straight lines of slope -1, -1/2, 0, +1/2, +1.",
    )  # fmt: skip
    return Found(plain(results, size).values, panels=(panel,))


def _slopes(
    results: Results,
    names: list[str],
    columns: tuple[str, str],
    title: str,
    axes: tuple[str, str],
    words: str,
) -> Panel:
    x, y = columns
    curves = tuple(
        Curve(name, results[0][f"{name}:{x}"], stacked(results, f"{name}:{y}").mean(axis=0), role)
        for name, role in zip(names, ROLES, strict=False)
    )
    return Panel(title, *axes, curves, words, log_x=True, log_y=True)
