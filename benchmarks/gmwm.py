"""Wavelet moments and maximum likelihood on the load W1: CPU time, recovery, coverage.

    python -m benchmarks.gmwm [--seeds 30] [--hours 7] [--rate 100] [--likelihood]

7 h at 100 Hz of an accelerometer (white + Gauss-Markov + random walk) and a gyro (white +
Gauss-Markov); structure found, not given. For comparison, the R package gmwm 3.0.0 on the same
load: 3.7 CPU s a channel with the structure given, correlation time 50 % off, no standard errors
within 400 s.
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import time
from collections.abc import Callable

import numpy as np

from benchmarks.joint_fit import TRUTH, table
from schuler.estimation.gmwm.fit import fit_gmwm
from schuler.estimation.identification import Identification
from schuler.estimation.identify import identify
from schuler.estimation.maximum_likelihood import fit_maximum_likelihood
from schuler.noise import WhiteNoise

Method = Callable[[np.ndarray], Identification]


def methods(rate: float, likelihood: bool) -> dict[str, Method]:
    """What is compared; likelihood of every sample only if asked for."""
    found: dict[str, Method] = {
        "wavelet moments": lambda x: fit_gmwm(x, rate),
        "wavelet moments, robust": lambda x: fit_gmwm(x, rate, robust=True),
        "joint fit of the Allan curve": lambda x: identify(x, rate),
        "maximum likelihood of block means": lambda x: fit_maximum_likelihood(
            x, rate, block="auto"
        ),
    }
    if likelihood:
        found["maximum likelihood"] = lambda x: fit_maximum_likelihood(x, rate)
    return found


def contamination(rate: float, samples: int) -> None:
    """White noise with growing shares of outliers: plain against robust deviation."""
    from schuler.curves.wavelet_variance import wavelet_variance

    print("deviation of white noise over truth (scales of 1, 16 and 256 samples)")
    for share, size in ((0.0, 0.0), (0.01, 20.0), (0.05, 10.0), (0.15, 8.0), (0.5, 6.7)):
        rng = np.random.default_rng(5)
        signal = WhiteNoise(1.0).simulate(samples, 1.0 / rate, rng)
        outlier = rng.standard_normal(samples) * size * np.sqrt(rate)
        signal += (rng.random(samples) < share) * outlier
        line = f"  {100 * share:4.0f} % of {size:4.1f} sigma:"
        for name, robust, efficiency in (
            ("plain", False, 0.6),
            ("robust", True, 0.6),
            ("robust, efficiency 0.3", True, 0.3),
            ("coefficients", "coefficients", 0.6),
        ):
            curve = wavelet_variance(signal, rate, robust, efficiency)  # type: ignore[arg-type]
            ratio = np.sqrt(curve.variance / WhiteNoise(1.0).wavelet_variance(curve.scale))
            line += f"  {name} " + " ".join(f"{ratio[k]:.3f}" for k in (0, 4, 8))
        print(line)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=30)
    parser.add_argument("--hours", type=float, default=7.0)
    parser.add_argument("--rate", type=float, default=100.0)
    parser.add_argument("--likelihood", action="store_true")
    options = parser.parse_args()
    samples = int(options.hours * 3600 * options.rate)
    for name, truth in TRUTH.items():
        chosen = methods(options.rate, options.likelihood)
        results: dict[str, list[Identification]] = {m: [] for m in chosen}
        spent: dict[str, list[float]] = {m: [] for m in chosen}
        for seed in range(options.seeds):
            rng = np.random.default_rng(1000 + seed)
            signal = truth.simulate(samples, 1.0 / options.rate, rng)
            if seed == 0:
                for method in chosen.values():
                    method(signal[: samples // 8])  # compiled before it is timed
            for label, method in chosen.items():
                start = time.process_time()
                results[label].append(method(signal))
                spent[label].append(time.process_time() - start)
        for label, found in results.items():
            print("\n".join(table(f"{name}, {label}", truth, found)))
            print(
                f"  CPU s a channel: min {min(spent[label]):.3f} mean {np.mean(spent[label]):.3f}"
            )
        print(flush=True)
    contamination(options.rate, 1_000_000)


if __name__ == "__main__":
    main()
