"""Recovery of known noise by the joint fit: ratios to truth, claimed errors, coverage.

    python benchmarks/joint_fit.py [--seeds 50]

7 h at 100 Hz of an accelerometer (white + Gauss-Markov + random walk) and a gyro (white +
Gauss-Markov), the load of the design documents.
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import time
from collections import Counter

import numpy as np

from schuler.estimation.identification import Identification
from schuler.estimation.identify import identify
from schuler.noise import GaussMarkov, ProcessSum, RandomWalk, WhiteNoise
from schuler.noise.gauss_markov import ALLAN_PEAK_HEIGHT, FLICKER_LEVEL
from schuler.units import parse

RATE = 100.0
HOURS = 7.0


def peak(level: float, correlation_time: float) -> GaussMarkov:
    """Gauss-Markov noise whose Allan peak is that of bias instability `level`."""
    return GaussMarkov(FLICKER_LEVEL * level / ALLAN_PEAK_HEIGHT, correlation_time)


TRUTH: dict[str, ProcessSum] = {
    "accel": WhiteNoise(parse("0.045 m/s/sqrt(h)", "accel white noise"))
    + peak(parse("4.6 m/s/h", "accel bias instability"), 7.0)
    + RandomWalk(parse("25 m/s/h^1.5", "accel random walk")),
    "gyro": WhiteNoise(parse("2.1 deg/sqrt(h)", "gyro white noise"))
    + peak(parse("38 deg/h", "gyro bias instability"), 600.0),
}


def table(name: str, truth: ProcessSum, results: list[Identification]) -> list[str]:
    """Rows of recovery for one channel."""
    structures = Counter(" + ".join(p.kind for p in r.process.parts) for r in results)
    lines = [f"{name}: {dict(structures)}"]
    lines.append(f"  {'parameter':32}{'mean':>8}{'sd':>8}{'claimed':>9}{'worst':>8}{'cover':>8}")
    for key, value in truth.parameters.items():
        if key.endswith("initial_sd"):
            continue
        found = [r for r in results if key in r.parameters]
        ratio = np.array([r.parameters[key] / value for r in found])
        claimed = np.mean([r.standard_errors[key] / value for r in found])
        cover = sum(r.intervals[key][0] <= value <= r.intervals[key][1] for r in found)
        lines.append(
            f"  {key:32}{ratio.mean():8.4f}{ratio.std():8.4f}{claimed:9.4f}"
            f"{np.abs(ratio - 1).max():8.4f}{cover / len(results):8.2f}"
        )
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=50)
    options = parser.parse_args()
    samples = int(HOURS * 3600 * RATE)
    for name, truth in TRUTH.items():
        results, spent = [], 0.0
        for seed in range(options.seeds):
            signal = truth.simulate(samples, 1.0 / RATE, np.random.default_rng(1000 + seed))
            start = time.process_time()
            results.append(identify(signal, RATE))
            spent += time.process_time() - start
        print("\n".join(table(name, truth, results)))
        print(f"  CPU s a channel, Allan deviation included: {spent / options.seeds:.3f}\n")


if __name__ == "__main__":
    main()
