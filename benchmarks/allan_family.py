"""Relatives of the Allan deviation against allantools: CPU time and equality.

    python benchmarks/allan_family.py [--samples 1000000]

The plain kinds on a long record; the total kinds of allantools only on 900 samples, where they
already take seconds. One thread; CPU seconds are the least of several runs on the same arrays.
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

import allantools
import numpy as np

from schuler.curves.allan_family import KINDS, family_deviation

RATE = 100.0
PEERS = {
    "nonoverlapping": allantools.adev,
    "modified": allantools.mdev,
    "hadamard": allantools.ohdev,
    "total": allantools.totdev,
    "modified total": allantools.mtotdev,
    "hadamard total": allantools.htotdev,
}


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
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()
    signal = np.random.default_rng(1).standard_normal(options.samples)
    rows = []
    for kind in KINDS:
        slow = " " in kind
        family_deviation(signal[:500], RATE, kind=kind)  # compile
        taus = family_deviation(signal, RATE, kind=kind).tau
        ours = cpu_seconds(
            lambda k=kind, t=taus: family_deviation(signal, RATE, t, k), 1 if slow else options.runs
        )
        row = {
            "kind": kind,
            "samples": options.samples,
            "cluster_times": int(taus.size),
            "schuler_cpu_s": round(ours, 4),
        }
        part = signal[:900] if slow else signal
        few = taus[taus <= len(part) / RATE / 5.0]
        peer = PEERS[kind]
        theirs = cpu_seconds(
            lambda p=part, t=few, f=peer: f(p, rate=RATE, data_type="freq", taus=t), 1
        )
        same = family_deviation(part, RATE, few, kind)
        tau, deviation, _, _ = peer(part, rate=RATE, data_type="freq", taus=few)
        matched = np.interp(tau, same.tau, same.deviation)
        row |= {
            "peer_samples": len(part),
            "peer_cluster_times": int(few.size),
            "allantools_cpu_s": round(theirs, 4),
            "schuler_same_load_cpu_s": round(
                cpu_seconds(lambda p=part, t=few, k=kind: family_deviation(p, RATE, t, k), 2), 4
            ),
            "largest_relative_difference": float(np.abs(matched / deviation - 1.0).max()),
        }
        rows.append(row)
    print(json.dumps(rows, indent=2))


if __name__ == "__main__":
    main()
