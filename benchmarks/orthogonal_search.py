"""Fast Orthogonal Search against sysidentpy's FROLS: CPU time, terms, the zero-start case.

    python -m benchmarks.orthogonal_search [--peer PYTHON]

36 000 samples, lags 1 to 10 and their products (65 candidates), 10 terms, one thread. CPU seconds
are the least of several runs. sysidentpy wants an older NumPy than schuler: give the interpreter
of an environment that has it, and it is timed there on the same arrays.
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import json
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np

from schuler.estimation.orthogonal_search.search import fast_orthogonal_search

MAX_LAG, TERMS = 10, 10
PEER = """
import json, sys, time, warnings
warnings.simplefilter("ignore")
import numpy as np
from sysidentpy.model_structure_selection import FROLS
from sysidentpy.basis_function import Polynomial
from sysidentpy.parameter_estimation import LeastSquares
out = {}
for name in ("drawn", "zero_start"):
    y = np.load(sys.argv[1] + "/" + name + ".npy").reshape(-1, 1)
    times = []
    for _ in range(int(sys.argv[2])):
        model = FROLS(order_selection=False, n_terms=10, ylag=10, model_type="NAR",
                      basis_function=Polynomial(degree=2), estimator=LeastSquares())
        start = time.process_time()
        model.fit(y=y)
        times.append(time.process_time() - start)
    out[name] = {"cpu_s": round(min(times), 4), "terms": np.asarray(model.final_model).tolist(),
                 "sum_of_error_reductions": float(np.sum(model.err))}
print(json.dumps(out))
"""


def load(samples: int, seed: int) -> np.ndarray:
    """y = 1.2 y1 - 0.5 y2 + 0.1 y5 + 0.3 y1 y3 - 0.25 y2² + 0.1 e."""
    e = 0.1 * np.random.default_rng(seed).standard_normal(samples + 200)
    y = [0.0] * (samples + 200)
    for k in range(5, samples + 200):
        linear = 1.2 * y[k - 1] - 0.5 * y[k - 2] + 0.1 * y[k - 5]
        y[k] = linear + 0.3 * y[k - 1] * y[k - 3] - 0.25 * y[k - 2] ** 2 + e[k]
    return np.array(y[200:])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=36_000)
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("--peer", help="Python interpreter of an environment with sysidentpy")
    options = parser.parse_args()
    drawn, unseen = load(options.samples, 1), load(options.samples, 2)
    zero_start = drawn.copy()
    zero_start[:MAX_LAG] = 0.0
    fast_orthogonal_search(drawn, MAX_LAG, 2, TERMS)  # compile
    result: dict[str, object] = {"samples": options.samples, "candidates": 65, "terms": TERMS}
    for name, y in (("drawn", drawn), ("zero_start", zero_start)):
        times = []
        for _ in range(options.runs):
            start = time.process_time()
            fit = fast_orthogonal_search(y, MAX_LAG, 2, TERMS, stopping=None)
            times.append(time.process_time() - start)
        stopped = fast_orthogonal_search(y, MAX_LAG, 2, TERMS, held_out=unseen)
        result[f"schuler_{name}"] = {
            "cpu_s": round(min(times), 4),
            "terms": fit.terms,
            "sum_of_error_reductions": sum(r.error_reduction for r in fit.ranking),
            "terms_by_family_wise_stopping": stopped.terms,
            "held_out_rmse": stopped.mean_square_error**0.5,
        }
    if options.peer:
        with tempfile.TemporaryDirectory() as folder:
            np.save(Path(folder) / "drawn.npy", drawn)
            np.save(Path(folder) / "zero_start.npy", zero_start)
            done = subprocess.run(
                [options.peer, "-c", PEER, folder, str(max(1, options.runs // 2))],
                check=True,
                capture_output=True,
                text=True,
            )
        result["sysidentpy"] = json.loads(done.stdout)
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
