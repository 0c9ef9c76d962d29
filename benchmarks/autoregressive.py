"""Autoregressive models of orders 1 to 10 against statsmodels and spectrum: CPU time, equality.

    python -m benchmarks.autoregressive

720 000 samples of an AR(10) with poles as an IMU on a vibrating plate has them, one thread. CPU
seconds are the least of several runs on the same array. `spectrum.arburg` is a Python loop over
samples and orders (about 110 s here): it is timed on a twentieth of the record.
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
import spectrum
from statsmodels.regression.linear_model import burg, yule_walker

from schuler.estimation.autoregressive.fit import fit_ar, fit_ar_orders, select_ar
from schuler.noise.autoregressive import Autoregressive

HALF_PLANE = [(0.98, 0.12), (0.95, 0.27), (0.9, 0.05)]
POLES = [r * np.exp(2j * np.pi * s * f) for r, f in HALF_PLANE for s in (1, -1)]
POLES += [0.97, -0.6, 0.5, -0.3]
ORDER = 10


def cpu_seconds(work: Callable[[], object], runs: int) -> float:
    """Least CPU time of several runs."""
    times = []
    for _ in range(runs):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=720_000)
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    truth = np.poly(POLES).real
    process = Autoregressive(tuple(truth[1:].tolist()), 1.0, 1.0)
    y = process.simulate(options.samples, 1.0, np.random.default_rng(1))
    y -= y.mean()
    part = y[: options.samples // 20]
    orders = range(1, ORDER + 1)
    peers: dict[str, dict[str, Callable[[], object]]] = {
        "burg": {
            "statsmodels": lambda: [burg(y, p, demean=False) for p in orders],
            "spectrum, a twentieth": lambda: [spectrum.arburg(part, p) for p in orders],
        },
        "yule-walker": {
            "statsmodels": lambda: [yule_walker(y, p, method="mle") for p in orders],
            "spectrum": lambda: [spectrum.aryule(y, p) for p in orders],
        },
        "covariance": {"spectrum": lambda: [spectrum.arcovar(y, p) for p in orders]},
        "modified covariance": {"spectrum": lambda: [spectrum.modcovar(y, p) for p in orders]},
    }
    reference = {
        "burg": lambda p: -burg(y, p, demean=False)[0],
        "yule-walker": lambda p: -yule_walker(y, p, method="mle")[0],
        "covariance": lambda p: np.real(spectrum.arcovar(y, p)[0]),
        "modified covariance": lambda p: np.real(spectrum.modcovar(y, p)[0]),
    }
    result: dict[str, object] = {"samples": options.samples, "orders": ORDER}
    for method, named in peers.items():
        fit_ar_orders(y, ORDER, method)  # compile
        found = fit_ar_orders(y, ORDER, method)
        result[method] = {
            "schuler_cpu_s": round(
                cpu_seconds(lambda m=method: fit_ar_orders(y, ORDER, m), options.runs), 4
            ),
            "schuler_one_fit_with_errors_and_cautions_cpu_s": round(
                cpu_seconds(lambda m=method: fit_ar(y, ORDER, m), options.runs), 4
            ),
            **{f"{peer}_cpu_s": round(cpu_seconds(work, 1), 4) for peer, work in named.items()},
            "largest_difference_to_peer": max(
                float(np.abs(found.polynomial(p) - reference[method](p)).max()) for p in (1, 5, 10)
            ),
            "largest_error_to_truth": float(np.abs(found.polynomial(ORDER) - truth[1:]).max()),
            "solver": found.solver[-1],
        }
    result["select_ar_up_to_20_cpu_s"] = round(cpu_seconds(lambda: select_ar(y), options.runs), 4)
    result["selected_order"] = select_ar(y).order
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
