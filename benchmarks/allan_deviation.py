"""Overlapping Allan deviation against allantools: CPU time, memory, equality.

    python benchmarks/allan_deviation.py

2.52 million samples of 6 channels (7 h at 100 Hz), 52 cluster times from 0.01 to 2520 s, one
thread. CPU seconds are the least of several runs on the same arrays.
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import json
import time
import tracemalloc
from collections.abc import Callable

import allantools
import numpy as np

from schuler.curves.allan import allan_deviation

RATE = 100.0


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
    parser.add_argument("--samples", type=int, default=2_520_000)
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    rng = np.random.default_rng(1)
    signal = rng.standard_normal((options.samples, 6)) + 9.8
    factors = np.geomspace(1, options.samples / 10, 52)
    taus = np.unique(np.round(factors)) / RATE
    channels = [np.ascontiguousarray(signal[:, j]) for j in range(6)]

    def peer() -> list[np.ndarray]:
        return [allantools.oadev(c, rate=RATE, data_type="freq", taus=taus)[1] for c in channels]

    allan_deviation(signal[:1000], RATE)  # compile
    ours = cpu_seconds(lambda: allan_deviation(signal, RATE, taus), options.runs)
    theirs = cpu_seconds(peer, max(1, options.runs // 2))
    tracemalloc.start()
    curve = allan_deviation(signal, RATE, taus)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    difference = float(np.abs(np.array(peer()).T / curve.deviation - 1.0).max())
    result = {
        "samples": options.samples,
        "channels": 6,
        "cluster_times": int(taus.size),
        "schuler_cpu_s": round(ours, 4),
        "allantools_cpu_s": round(theirs, 4),
        "ratio": round(theirs / ours, 1),
        "peak_mb_above_data": round(peak / 1e6, 1),
        "largest_relative_difference": difference,
    }
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
