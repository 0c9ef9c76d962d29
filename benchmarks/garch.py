"""GARCH(1, 1) on nearly integrated noise in rad/s against arch: CPU time, likelihood, estimates.

    python -m benchmarks.garch [--samples 360000]

alpha0 1.3e-7, alpha 0.0175, beta 0.98. The peer is run as it comes, with its rescaling, and from
the truth on scaled data.
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import json
import time
import warnings
from collections.abc import Callable

import numpy as np
from arch import arch_model

from schuler.estimation.garch.conditional_variance import garch_log_likelihood, simulate_garch
from schuler.estimation.garch.fit import fit_garch

TRUTH = (1.3e-7, 0.0175, 0.98)


def cpu_seconds(work: Callable[[], object], runs: int) -> float:
    """Least CPU time of several runs."""
    times = []
    for _ in range(runs):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=360_000)
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    e = simulate_garch(options.samples, *TRUTH, np.random.default_rng(3))[0]
    fit_garch(e[:600])  # compile
    ours = fit_garch(e, mean="zero")
    truth = garch_log_likelihood(e, *TRUTH)
    names = ("alpha0", "alpha_1", "beta_1")
    result: dict[str, object] = {
        "samples": options.samples,
        "schuler": {
            "cpu_s": round(cpu_seconds(lambda: fit_garch(e, mean="zero"), options.runs), 4),
            "parameters": [ours.values[n] for n in names],
            "z": [
                round((ours.values[n] - t) / ours.standard_errors[n], 3)
                for n, t in zip(names, TRUTH, strict=True)
            ],
            "above_truth": ours.log_likelihood - truth,
            "starts_spread": float(np.ptp([s.log_likelihood for s in ours.starts])),
        },
    }
    scale = 1.0 / float(e.std())
    ways = {
        "arch_raw": (1.0, {"rescale": False}, None),
        "arch_rescaled": (1.0, {"rescale": True}, None),
        "arch_from_truth": (scale, {"rescale": False}, [TRUTH[0] * scale**2, *TRUTH[1:]]),
    }
    for name, (factor, how, start) in ways.items():
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            model = arch_model(e * factor, mean="Zero", **how)
            begin = time.process_time()
            peer = model.fit(disp="off", starting_values=start)
            taken = time.process_time() - begin
        back = (factor * float(peer.scale)) ** 2
        values = np.array([peer.params.iloc[0] / back, *peer.params.iloc[1:]])
        result[name] = {
            "cpu_s": round(taken, 3),
            "flag": int(peer.convergence_flag),
            "parameters": values.tolist(),
            "above_truth": garch_log_likelihood(e, *values) - truth,
        }
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
