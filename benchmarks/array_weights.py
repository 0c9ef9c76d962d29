"""Noise of an array followed inside the filter: constant against followed weights, by seeds.

    python -m benchmarks.array_weights [--seeds 3] [--first 500] [--scenes unit_x10 ...]

Four equal IMUs on a tetrahedron, a motorcycle for 180 s, GNSS withheld from 100 to 120 and from 140
to 160 s. Position RMS in the outages, squared position error over its claimed variance a degree of
freedom there, and NIS outside; means over seeds, and followed minus constant with its standard
error. Ends with exit code 1 where followed weights are worse beyond two standard errors.
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import sys
from dataclasses import replace

import numpy as np

from benchmarks.array_faults import RATE, draw, noise_model
from schuler import earth
from schuler.data import ImuArray, NavigationSolution, Trajectory
from schuler.navigation.mechanizations.array_weights import FilterWeights
from schuler.navigation.mechanizations.navigate_array import navigate_array
from schuler.types import FloatArray

WINDOWS = ((100.0, 20.0), (140.0, 20.0))
SCENES = ("equal", "axis_x10", "unit_x10", "unit_x10_60s", "all_x5_60s")
WEIGHTS: tuple[FilterWeights, ...] = ("constant", "averaged_volatility", "ewma", "garch")
GYRO, ACCEL = 1e-3 * np.sqrt(RATE), 3e-3 * np.sqrt(RATE)


def louder(array: ImuArray, scene: str, seed: int) -> ImuArray:
    """Add noise to some of the sensors."""
    rng = np.random.default_rng([seed, 77])
    factor = np.ones((array.size, array.count, 3))
    during = (array.time > 100.0) & (array.time < 160.0) if "60s" in scene else slice(None)
    if scene == "axis_x10":
        factor[:, 3, 0] = 10.0
    elif scene.startswith("unit"):
        factor[during, 3] = 10.0
    elif scene.startswith("all"):
        factor[during] = 5.0
    more = np.sqrt(factor**2 - 1.0)
    gyro = array.gyro + GYRO * more * rng.standard_normal(more.shape)
    if scene == "axis_x10":
        return replace(array, gyro=gyro)
    accel = array.accel + ACCEL * more * rng.standard_normal(more.shape)
    return replace(array, gyro=gyro, accel=accel)


def judged(solution: NavigationSolution, truth: Trajectory) -> FloatArray:
    """RMS in the outages, m, normalised squared error a degree, NIS a degree."""
    own = solution.trajectory
    t = np.searchsorted(truth.time, own.time - 1e-6)
    north, east = earth.metres_per_radian(truth.position[t])
    off = own.position - truth.position[t]
    metres = np.stack([off[:, 0] * north, off[:, 1] * east, -off[:, 2]], axis=1)
    inside = np.zeros(own.size, bool)
    for start, seconds in WINDOWS:
        inside |= (own.time > start + 1.0) & (own.time < start + seconds)
    error, claimed = metres[inside], solution.position_covariance[inside]
    square = np.einsum("na,na->n", error, np.linalg.solve(claimed, error[..., None])[..., 0])
    return np.array(
        [
            np.sqrt(np.mean(np.sum(error**2, axis=1))),
            np.mean(square) / 3.0,
            solution.innovations.gnss.mean_nis,
        ]
    )


def main() -> None:
    """Print the table; 1 where following costs."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first", type=int, default=500)
    parser.add_argument("--scenes", nargs="+", default=list(SCENES))
    parser.add_argument("--weights", nargs="+", default=["constant", "ewma"])
    options = parser.parse_args()
    noise, worse = noise_model(), 0
    print("scene         weights               m RMS   error²/claim  NIS   less than constant, m")
    for scene in options.scenes:
        found: dict[str, list[FloatArray]] = {w: [] for w in options.weights}
        for seed in range(options.first, options.first + options.seeds):
            array, gnss, truth = draw(seed, noise)
            loud = louder(array, scene, seed)
            for weights in options.weights:
                done = navigate_array(
                    loud, gnss, noise, weights=weights,
                    outages=[(a - gnss.time[0], s) for a, s in WINDOWS],
                    time_offset=0.0, tune_noise=False,
                )  # fmt: skip
                found[weights].append(judged(done.solution, truth))
        for weights in options.weights:
            values = np.array(found[weights])
            less = np.array(found[options.weights[0]])[:, 0] - values[:, 0]
            error = less.std(ddof=1) / np.sqrt(len(less)) if len(less) > 1 else np.nan
            worse += int(less.mean() < -2.0 * error)
            mean = values.mean(axis=0)
            print(
                f"{scene:13s} {weights:20s} {mean[0]:6.2f} {mean[1]:10.2f} {mean[2]:9.2f}   "
                f"{less.mean():6.3f} +- {error:5.3f}",
                flush=True,
            )
    sys.exit(1 if worse else 0)


if __name__ == "__main__":
    main()
