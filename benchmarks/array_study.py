"""How many IMUs are worth it, and in which geometry: against the error of navigation.

    python -m benchmarks.array_study [--seeds 3] [--first 700]

Equal consumer IMUs on a motorcycle for 150 s, GNSS withheld for 20 s; the extended filter, and one
IMU alone. Largest horizontal error in the outage and heading RMS, means over seeds with standard
errors, beside the 1 / sqrt(k) that independent noise would give. A geometry of equal triads adds up
to the same fused noise; it differs in which faults can be told apart.
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse

import numpy as np

from benchmarks.array_faults import noise_model
from schuler import earth
from schuler.arrays.geometry import tetrahedron_mounting
from schuler.data import ImuArray, Mounting
from schuler.navigation.mechanizations.navigate_array import navigate_array
from schuler.rotations import dcm_from_euler, rotation_vector_from_dcm
from schuler.simulation import motorcycle, simulate_array, simulate_gnss
from schuler.types import FloatArray

DURATION, RATE, OUTAGE = 150.0, 100.0, (100.0, 20.0)


def geometry(name: str, count: int) -> Mounting:
    """IMUs side by side, or tetrahedra inside each other, each turned a little further."""
    if name == "aligned":
        return Mounting.aligned(count)
    four = tetrahedron_mounting(0.05)
    turned = [dcm_from_euler(0.2 * i, 0.3 * i, 0.1 * i) for i in range(-(-count // 4))]
    return Mounting(
        np.concatenate([c @ four.rotation for c in turned])[:count],
        np.concatenate([four.position @ c.T for c in turned])[:count],
    )


def one(seed: int, name: str, count: int) -> FloatArray:
    """Largest horizontal error in the outage, m, and heading RMS from 60 s, deg."""
    rng = np.random.default_rng(seed)
    profile, noise = motorcycle(DURATION, seed, standstill=20.0), noise_model()
    mount = geometry(name, max(count, 2))
    parts = simulate_array(profile, mount.rotation, mount.position, noise, RATE, rng)
    gnss = simulate_gnss(profile, 1.0, position_sd=0.03, velocity_sd=0.03, rng=rng)
    array = ImuArray.from_recordings(parts, mount)
    done = navigate_array(
        array,
        gnss,
        noise,
        mechanization="extended" if count > 1 else "single",
        outages=[OUTAGE],
        time_offset=0.0,
        tune_noise=False,
    ).solution.trajectory
    truth = profile.trajectory(done.time)
    north, east = earth.metres_per_radian(truth.position)
    off = (done.position - truth.position)[:, :2] * np.stack([north, east], axis=1)
    start = float(gnss.time[0]) + OUTAGE[0]
    inside = (done.time > start) & (done.time < start + OUTAGE[1])
    turned = rotation_vector_from_dcm(done.rotation @ truth.rotation.transpose(0, 2, 1))[:, 2]
    heading = np.degrees(np.sqrt(np.mean(turned[done.time > 60.0] ** 2)))
    return np.array([np.linalg.norm(off[inside], axis=1).max(), heading])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first", type=int, default=700)
    options = parser.parse_args()
    print("IMUs geometry     1/sqrt(k)   outage max m      heading RMS deg")
    for count in (1, 2, 4, 8):
        for name in ("aligned", "tetrahedral")[: 1 if count == 1 else 2]:
            seeds = range(options.first, options.first + options.seeds)
            found = np.array([one(seed, name, count) for seed in seeds])
            mean, error = found.mean(axis=0), found.std(axis=0, ddof=1) / np.sqrt(len(found))
            print(
                f"{count:4d} {name:12s} {1.0 / np.sqrt(count):9.2f}   "
                f"{mean[0]:6.2f} +- {error[0]:4.2f}   {mean[1]:8.3f} +- {error[1]:5.3f}",
                flush=True,
            )


if __name__ == "__main__":
    main()
