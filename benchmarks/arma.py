"""ARMA by exact maximum likelihood against statsmodels: CPU time, estimates, errors.

    python -m benchmarks.arma [--default] [--samples 360000]

ARMA(2, 2) with phi (1.666, -0.671), theta (-1.086, 0.160) and unit innovations, 360 000 samples;
then the grid 0..4 x 0..4 on the first 60 000. The peer is ARIMA(...).fit by innovations_mle (about
15 s); `--default` adds its state-space default with standard errors (about 60 s).
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
from statsmodels.tsa.arima.model import ARIMA

from schuler.estimation.arma.fit import fit_arma
from schuler.estimation.arma.selection import select_arma
from schuler.noise.arma import ARMA

TRUTH = ARMA((1.666, -0.671), (-1.086, 0.160), 1.0, 1.0)
NAMES = ("mean", "phi_1", "phi_2", "theta_1", "theta_2", "innovation_variance")


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
    parser.add_argument("--default", action="store_true", help="also the slow state-space fit")
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    e = np.random.default_rng(1).standard_normal(options.samples + 1000)
    x = TRUTH.respond_to(e)[1000:]
    fit_arma(x[:500], 2, 2)  # compile
    ours = fit_arma(x, 2, 2)
    result: dict[str, object] = {
        "samples": options.samples,
        "schuler_cpu_s": round(cpu_seconds(lambda: fit_arma(x, 2, 2), options.runs), 4),
        "schuler_log_likelihood": ours.log_likelihood,
        "schuler_grid_60k_cpu_s": round(cpu_seconds(lambda: select_arma(x[:60_000]), 2), 3),
        "schuler_grid_60k_order": select_arma(x[:60_000]).order,
    }
    methods = {"innovations_mle": "none", **({"statespace": "opg"} if options.default else {})}
    model = ARIMA(x, order=(2, 0, 2), trend="c")
    for method, covariance in methods.items():
        start = time.process_time()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            peer = model.fit(method=method, cov_type=covariance)
        taken = time.process_time() - start
        values, errors = np.asarray(peer.params), [ours.standard_errors[n] for n in NAMES]
        distance = [(ours.values[n] - v) / s for n, v, s in zip(NAMES, values, errors, strict=True)]
        result[f"statsmodels_{method}"] = {
            "cpu_s": round(taken, 2),
            "log_likelihood": float(model.loglike(values)),
            "ours_less_theirs_in_errors": [round(float(d), 5) for d in distance],
        }
        if covariance == "opg":
            ratio = np.asarray(errors) / np.asarray(peer.bse)
            result["error_ratio_to_statsmodels"] = [round(float(r), 5) for r in ratio]
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
