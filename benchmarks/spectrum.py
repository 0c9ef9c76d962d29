"""Spectrum and autocorrelation: CPU time beside SciPy and statsmodels, recovery of known noise.

    python benchmarks/spectrum.py [--seeds 6]

7 h at 100 Hz, one channel, one thread; CPU seconds are the least of several runs on the same
arrays.
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import json
import time
from collections.abc import Callable

import numpy as np
from scipy.signal import welch
from statsmodels.tsa.stattools import acf

from schuler.curves.autocorrelation import autocorrelation
from schuler.curves.spectrum import power_spectral_density
from schuler.estimation.gauss_markov_correlation import fit_gauss_markov
from schuler.estimation.spectrum.fit import fit_spectrum
from schuler.noise import BiasInstability, GaussMarkov, RandomWalk, WhiteNoise
from schuler.units import parse

RATE = 100.0
SAMPLES = 2_520_000
TRUTH = (
    WhiteNoise(parse("0.045 m/s/sqrt(h)", "accel white noise"))
    + BiasInstability(parse("4.22 m/s/h", "accel bias instability"), 0.02, 1e5)
    + RandomWalk(parse("24.95 m/s/h^1.5", "accel random walk"))
)


def cpu_seconds(work: Callable[[], object], runs: int) -> float:
    """Least CPU time of several runs."""
    times = []
    for _ in range(runs):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def speed(runs: int) -> dict[str, float]:
    """CPU seconds of ours and of the peers."""
    signal = TRUTH.simulate(SAMPLES, 1.0 / RATE, np.random.default_rng(1))
    curve = power_spectral_density(signal, RATE, onesided=False)
    slow = GaussMarkov(1.0, 20.0).simulate(SAMPLES, 1.0 / RATE, np.random.default_rng(2))
    lags = 10_000
    correlation = autocorrelation(slow, RATE, lags / RATE)
    theirs = acf(slow, adjusted=False, fft=True, nlags=lags)
    works: dict[str, Callable[[], object]] = {
        "schuler_psd": lambda: power_spectral_density(signal, RATE, onesided=False),
        "scipy_welch_same_segment": lambda: welch(signal, RATE, nperseg=curve.segment),
        "schuler_fit_auto": lambda: fit_spectrum(curve),
        "schuler_fit_classical": lambda: fit_spectrum(curve, "classical"),
        "schuler_acf_with_robust_band": lambda: autocorrelation(slow, RATE, lags / RATE),
        "statsmodels_acf": lambda: acf(slow, adjusted=False, fft=True, nlags=lags),
        "schuler_gauss_markov_fit": lambda: fit_gauss_markov(correlation),
    }
    result = {f"{name}_cpu_s": round(cpu_seconds(w, runs), 4) for name, w in works.items()}
    result["acf_largest_difference"] = float(np.abs(correlation.correlation - theirs).max())
    return result


def recovery(seeds: int) -> dict[str, dict[str, float]]:
    """Ratios to truth and claimed relative errors of the classical joint fit."""
    values = TRUTH.parameters
    fits = []
    for seed in range(seeds):
        signal = TRUTH.simulate(SAMPLES, 1.0 / RATE, np.random.default_rng(100 + seed))
        fits.append(fit_spectrum(power_spectral_density(signal, RATE, onesided=False), "classical"))
    table = {}
    for key in fits[0].parameters:
        ratio = np.array([f.parameters[key] / values[key] for f in fits])
        claimed = np.mean([f.standard_errors[key] / values[key] for f in fits])
        table[key] = {
            "mean": round(float(ratio.mean()), 4),
            "sd": round(float(ratio.std()), 4),
            "claimed": round(float(claimed), 4),
        }
    return table


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=6)
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()
    print(json.dumps({"speed": speed(options.runs), "recovery": recovery(options.seeds)}, indent=2))


if __name__ == "__main__":
    main()
