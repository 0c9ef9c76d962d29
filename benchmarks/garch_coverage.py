"""GARCH(1, 1): means and coverage of 95 % intervals over many seeds.

    python -m benchmarks.garch_coverage [--seeds 200]

Truth alpha0 0.01, alpha 0.05, beta 0.90 on 20 000 samples, and the nearly integrated truth
1.3e-7, 0.0175, 0.982 on 60 000.
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import json
import time

import numpy as np

from schuler.estimation.garch.conditional_variance import simulate_garch
from schuler.estimation.garch.fit import fit_garch

NAMES = ("alpha0", "alpha_1", "beta_1")


def study(truth: tuple[float, float, float], samples: int, seeds: int) -> dict[str, object]:
    """Ratios of the mean estimates to the truth, coverage, persistence."""
    fits = []
    start = time.process_time()
    for child in np.random.SeedSequence(1).spawn(seeds):
        e = simulate_garch(samples, *truth, np.random.default_rng(child))[0]
        fits.append(fit_garch(e, mean="zero"))
    values = np.array([[f.values[n] for n in NAMES] for f in fits])
    errors = np.array([[f.standard_errors[n] for n in NAMES] for f in fits])
    inside = np.abs(values - truth) < 1.96 * errors
    return {
        "truth": truth,
        "samples": samples,
        "seeds": seeds,
        "mean_over_truth": np.round(values.mean(axis=0) / truth, 4).tolist(),
        "median_over_truth": np.round(np.median(values, axis=0) / truth, 4).tolist(),
        "scatter_of_the_mean": np.round(values.std(axis=0) / truth / np.sqrt(seeds), 4).tolist(),
        "coverage": inside.mean(axis=0).round(3).tolist(),
        "alpha_within_0.004": float(np.mean(np.abs(values[:, 1] - truth[1]) < 0.004)),
        "persistence_above_0.997": float(np.mean([f.persistence > 0.997 for f in fits])),
        "converged": float(np.mean([f.converged for f in fits])),
        "cpu_s": round(time.process_time() - start, 2),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=200)
    options = parser.parse_args()
    studies = [
        study((0.01, 0.05, 0.90), 20_000, options.seeds),
        study((1.3e-7, 0.0175, 0.982), 60_000, options.seeds // 2),
    ]
    print(json.dumps(studies, indent=2))


if __name__ == "__main__":
    main()
