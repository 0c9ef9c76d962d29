"""Synthetic IMU of eight units: CPU time against a plain NumPy twin, and equality.

    python -m benchmarks.fusion

One hour at 100 Hz, gyros and accelerometers. Constant weights: least squares and recording alone.
On line: weights that follow the noise, bias differences, covariance, chi-square, the largest
likelihood statistics by axis and by unit, every sample. The twin does the same on-line work for
constant weights with arrays (no recursion), so it does less. CPU seconds are the least of several
runs on one thread.
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

import numpy as np

from schuler.arrays.detection.faults import detect_faults
from schuler.arrays.detection.thresholds import likelihood_statistics
from schuler.arrays.geometry import Geometry, orthogonal
from schuler.arrays.redundant import redundant_sensors
from schuler.arrays.synthesis.array_noise import ArrayNoise
from schuler.arrays.synthesis.least_squares import least_squares
from schuler.arrays.synthesis.synthetic import synthesize
from schuler.arrays.tracking import OnlineSettings, follow_sensors
from schuler.data import ImuArray, Mounting

GYRO, ACCEL = 1e-3, 2e-2


def cpu_seconds(work: Callable[[], object], runs: int) -> float:
    """Least CPU time of several runs."""
    times = []
    for _ in range(runs):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


def twin(array: ImuArray, geometry: Geometry) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Constant equal weights and all statistics with plain NumPy: fused gyro, D, largest F."""
    out = []
    for values, sigma in ((array.gyro, GYRO), (array.accel, ACCEL)):
        ell = values.reshape(array.size, -1)
        fit = least_squares(geometry.axes)
        fused = ell @ fit.pi.T
        f = ell - fused @ geometry.axes.T
        d = (f**2).sum(axis=1) / sigma**2
        axis, unit = likelihood_statistics(ell, geometry, np.full(geometry.count, sigma**2))
        out.append((fused, d, axis.max(axis=1), axis.argmax(axis=1), unit.max(axis=1)))
    return out[0][0], out[0][1], out[0][2]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--units", type=int, default=8)
    parser.add_argument("--seconds", type=float, default=3600.0)
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    rng = np.random.default_rng(1)
    n, k = round(options.seconds * 100.0), options.units
    gyro = GYRO * rng.standard_normal((n, k, 3))
    accel = ACCEL * rng.standard_normal((n, k, 3)) + [0.0, 0.0, -9.81]
    array = ImuArray(np.arange(n) / 100.0, gyro, accel, Mounting.aligned(k))
    geometry = orthogonal(k)
    known = ArrayNoise(
        np.full((k, 3), GYRO), np.full((k, 3), ACCEL), np.zeros((k, 3)), np.zeros((k, 3)), 100.0
    )
    sensors = [redundant_sensors(array, s) for s in ("gyro", "accel")]

    def online() -> list[object]:
        return [follow_sensors(s, known.of(s), OnlineSettings()) for s in sensors]

    short = array.between(0.0, 30.0)
    synthesize(short, "ewma")
    detect_faults(short)
    timings = {
        "constant weights": cpu_seconds(
            lambda: synthesize(array, "inverse_variance", noise=known), options.runs
        ),
        "on line": cpu_seconds(online, options.runs),
        "on line with faults": cpu_seconds(lambda: detect_faults(array), options.runs),
        "NumPy twin": cpu_seconds(lambda: twin(array, geometry), max(1, options.runs // 2)),
    }
    followed = follow_sensors(sensors[0], known.of(sensors[0]), OnlineSettings(), adapting=False)
    fused, d, largest = twin(array, geometry)
    # bias differences are followed, so equality is to their size
    differences = {
        "fused": float(np.abs(followed.fused - fused).max() / GYRO),
        "D": float(np.abs(followed.statistic - d).max()),
        "F": float(np.abs(followed.axis_statistic - largest).max()),
    }
    print(
        json.dumps(
            {"samples": n, "units": k, "cpu_s": timings, "difference": differences}, indent=2
        )
    )
    print(f"on line against NumPy: {timings['NumPy twin'] / timings['on line']:.1f} times as fast")


if __name__ == "__main__":
    main()
