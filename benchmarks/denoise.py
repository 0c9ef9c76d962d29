"""Wavelet de-noising against PyWavelets by hand: CPU time and error.

    python benchmarks/denoise.py

Slow motion and white noise of 0.35, 2.52 million samples, db4, soft thresholds. One thread; CPU
seconds are the least of several runs on the same arrays.
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import json
import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pywt

from schuler.denoising import CausalDenoiser, denoise

SAMPLES = 2_520_000


def cpu_seconds(work: Callable[[], object], runs: int) -> float:
    """Least CPU time of several runs."""
    times = []
    for _ in range(runs):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def by_hand(signal: np.ndarray, level: int) -> np.ndarray:
    """Universal soft threshold in four lines of PyWavelets."""
    c = pywt.wavedec(signal, "db4", mode="symmetric", level=level)
    sd = np.median(np.abs(c[-1])) / 0.6745
    limit = sd * math.sqrt(2.0 * math.log(signal.size))
    return pywt.waverec([c[0]] + [pywt.threshold(d, limit, "soft") for d in c[1:]], "db4")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()
    t = np.arange(SAMPLES) / 100.0
    motion = np.sin(2 * np.pi * 0.05 * t) + 0.5 * np.sin(2 * np.pi * 0.21 * t + 1.0)
    signal = motion + 0.35 * np.random.default_rng(1).standard_normal(SAMPLES)

    def error(estimate: np.ndarray) -> float:
        return round(float(np.sqrt(np.mean((estimate - motion) ** 2))), 4)

    rows: list[dict[str, Any]] = []
    for level in (3, 6, 8):
        works: dict[str, Callable[[], np.ndarray]] = {
            "pywt by hand, universal": lambda n=level: by_hand(signal, n),
            "schuler universal": lambda n=level: (
                denoise(signal, level=n, threshold="universal", scale="sln").signal
            ),
            "schuler SURE": lambda n=level: denoise(signal, level=n).signal,
            "schuler details zero": lambda n=level: denoise(signal, level=n, details="zero").signal,
            "schuler causal exact": lambda n=level: CausalDenoiser("db4", n).push(signal),
        }
        for name, work in works.items():
            rows.append(
                {
                    "tool": name,
                    "level": level,
                    "cpu_s": round(cpu_seconds(work, options.runs), 4),
                    "rmse": None if "causal" in name else error(work()),
                }
            )
    print(json.dumps(rows, indent=1))


if __name__ == "__main__":
    main()
