"""Faults of one sensor among four IMUs, inside the filter: against an oracle that never used it.

    python -m benchmarks.array_faults [--seeds 3] [--only gyro_2 accel_2 ...]
                                      [--mechanizations extended synthetic constrained]

Four equal IMUs on a tetrahedron, a motorcycle for 180 s, a fix a second; the fault comes at 100 s.
Heading RMS from 100 s to the end and the largest position error after 30 s, each divided by that of
the oracle. Ends with exit code 1 where a median is above 1.1, or a healthy sensor was taken out.
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from schuler import earth
from schuler.arrays.geometry import tetrahedron_mounting
from schuler.data import CHANNELS, GnssRecording, ImuArray, NavigationSolution, Trajectory
from schuler.navigation.mechanizations.array_faults import ArrayFaults
from schuler.navigation.mechanizations.array_preparation import prepare_array
from schuler.navigation.mechanizations.navigate_array import run_mechanization
from schuler.navigation.mechanizations.sensor_table import Absence
from schuler.navigation.settings import NavigationSettings
from schuler.noise import GaussMarkov, NoiseModel, RandomWalk, WhiteNoise
from schuler.rotations import rotation_vector_from_dcm
from schuler.simulation import motorcycle, simulate_array, simulate_gnss
from schuler.types import FloatArray

DURATION, RATE, BEGIN = 180.0, 100.0, 100.0
DEG = float(np.radians(1.0))
Fault = Callable[[FloatArray, FloatArray, FloatArray], None]


def add(kind: str, imu: int, axes: slice | int, size: float, start: float = BEGIN,
        stop: float = np.inf, slope: float = 0.0) -> Fault:  # fmt: skip
    """A step or a ramp."""

    def put(time: FloatArray, gyro: FloatArray, accel: FloatArray) -> None:
        rows = (time >= start) & (time < stop)
        off = np.broadcast_to(size + slope * (time[rows] - start), (rows.sum(),))
        values = (gyro if kind == "gyro" else accel)[:, imu, axes]
        values[rows] += off if values.ndim == 1 else off[:, None]

    return put


def stuck(kind: str) -> Fault:
    """One axis shows its last value."""

    def put(time: FloatArray, gyro: FloatArray, accel: FloatArray) -> None:
        first = int(np.searchsorted(time, BEGIN))
        values = gyro if kind == "gyro" else accel
        values[first:, 3, 0] = values[first - 1, 3, 0]

    return put


def silent(time: FloatArray, gyro: FloatArray, accel: FloatArray) -> None:
    """A unit is missing for 10 s."""
    rows = (time >= BEGIN) & (time < BEGIN + 10.0)
    gyro[rows, 3], accel[rows, 3] = np.nan, np.nan


def noisy(time: FloatArray, gyro: FloatArray, accel: FloatArray) -> None:
    """Noise of all gyros of a unit times five for 30 s."""
    rows = (time >= BEGIN) & (time < BEGIN + 30.0)
    noise = np.random.default_rng(99).standard_normal((rows.sum(), 3))
    gyro[rows, 3] += np.sqrt(24.0) * 1e-3 * np.sqrt(RATE) * noise


ALL = slice(None)
Out = tuple[int, int, int | None, float]
"""Kind (0 accelerometers, 1 gyros), IMU, axis or None for all, seconds of first use."""
CASES: dict[str, tuple[list[Fault], list[tuple[int, int, int | None]]]] = {
    "none": ([], []),
    "gyro_0.5": ([add("gyro", 3, 0, 0.5 * DEG)], [(1, 3, 0)]),
    "gyro_2": ([add("gyro", 3, 0, 2.0 * DEG)], [(1, 3, 0)]),
    "gyro_10": ([add("gyro", 3, 0, 10.0 * DEG)], [(1, 3, 0)]),
    "accel_0.5": ([add("accel", 3, 0, 0.5)], [(0, 3, 0)]),
    "accel_2": ([add("accel", 3, 0, 2.0)], [(0, 3, 0)]),
    "gyro_ramp": ([add("gyro", 3, 0, 0.0, slope=0.1 * DEG)], [(1, 3, 0)]),
    "accel_ramp": ([add("accel", 3, 0, 0.0, slope=0.05)], [(0, 3, 0)]),
    "gyro_stuck": ([stuck("gyro")], [(1, 3, 0)]),
    "accel_stuck": ([stuck("accel")], [(0, 3, 0)]),
    "silent": ([silent], [(0, 3, None), (1, 3, None)]),
    "noise_x5": ([noisy], []),
    "unit": ([add("gyro", 3, ALL, 2.0 * DEG)], [(1, 3, None)]),
    "two_in_turn": (
        [add("gyro", 3, ALL, 2.0 * DEG), add("gyro", 2, ALL, 2.0 * DEG, start=130.0)],
        [(1, 3, None), (1, 2, None)],
    ),
    "two_at_once": (
        [add("gyro", 3, ALL, 2.0 * DEG), add("gyro", 2, ALL, -2.0 * DEG)],
        [(1, 3, None), (1, 2, None)],
    ),
    "readmitted": ([add("gyro", 3, 0, 2.0 * DEG, stop=120.0)], [(1, 3, 0)]),
}  # fmt: skip


def noise_model() -> NoiseModel:
    """A consumer MEMS IMU."""
    accel = WhiteNoise(3e-3) + GaussMarkov(0.02, 60.0) + RandomWalk(1e-4, 0.03)
    gyro = WhiteNoise(1e-3) + GaussMarkov(5e-4, 60.0) + RandomWalk(2e-6, 2e-3)
    return NoiseModel({c: gyro if c.startswith("gyro") else accel for c in CHANNELS}, source="twin")


def draw(seed: int, noise: NoiseModel) -> tuple[ImuArray, GnssRecording, Trajectory]:
    """A healthy ride."""
    rng = np.random.default_rng(seed)
    profile = motorcycle(DURATION, seed, standstill=20.0)
    mount = tetrahedron_mounting(0.05)
    parts = simulate_array(profile, mount.rotation, mount.position, noise, RATE, rng)
    gnss = simulate_gnss(profile, 1.0, position_sd=0.03, velocity_sd=0.03, rng=rng)
    array = ImuArray.from_recordings(parts, mount)
    return array, gnss, profile.trajectory(array.time)


def broken(array: ImuArray, faults: Sequence[Fault]) -> ImuArray:
    """The ride with faults in it."""
    gyro, accel = array.gyro.copy(), array.accel.copy()
    for put in faults:
        put(array.time, gyro, accel)
    return replace(array, gyro=gyro, accel=accel)


def never(out: Sequence[tuple[int, int, int | None]]) -> ArrayFaults:
    """What the oracle knows."""
    absences = [
        Absence(kind, tuple(3 * imu + a for a in range(3)) if axis is None else (3 * imu + axis,),
                -np.inf, np.inf)
        for kind, imu, axis in out
    ]  # fmt: skip
    return ArrayFaults(absences=tuple(absences), judged=True)


def errors(solution: NavigationSolution, truth: Trajectory) -> tuple[float, float, float]:
    """Heading RMS, deg, largest position error, m, and NIS a degree of freedom."""
    own = solution.trajectory
    first = int(np.searchsorted(truth.time, own.time[0] - 1e-6))
    t = np.s_[first : first + own.size]
    north, east = earth.metres_per_radian(truth.position[t])
    off = own.position - truth.position[t]
    metres = np.stack([off[:, 0] * north, off[:, 1] * east, off[:, 2]], axis=1)
    turned = own.rotation @ truth.rotation[t].transpose(0, 2, 1)
    heading = np.degrees(rotation_vector_from_dcm(turned)[:, 2])
    late = own.time >= BEGIN
    settled = own.time >= 30.0
    return (
        float(np.sqrt(np.mean(heading[late] ** 2))),
        float(np.linalg.norm(metres[settled], axis=1).max()),
        solution.innovations.gnss.mean_nis,
    )


def main() -> None:
    """Print the table; 1 where the filter falls short of the oracle."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3)
    parser.add_argument("--first", type=int, default=300)
    parser.add_argument("--only", nargs="+", default=list(CASES))
    parser.add_argument("--mechanizations", nargs="+", default=["extended"])
    options = parser.parse_args()
    noise, told = noise_model(), NavigationSettings(time_offset=0.0, tune_noise=False)
    seeds = range(options.first, options.first + options.seeds)
    rides = {seed: draw(seed, noise) for seed in seeds}
    short = wrong = 0
    print("case, mechanization: heading RMS deg / position max m (of the oracle), then ratios with "
          "standard errors; smoothed; NIS; named after s")  # fmt: skip
    for name in options.only:
        faults, out = CASES[name]
        for mechanization in options.mechanizations:
            rows, delays = [], []
            late = mechanization != "constrained"
            for array, gnss, truth in rides.values():
                found = []
                for known in (True, never(out)):
                    hurt = broken(array, faults)
                    ready = prepare_array(hurt, gnss, noise, told, faults=known)
                    for smooth in (False, True)[: 1 + late]:
                        done = run_mechanization(ready, gnss, mechanization, smooth=smooth)
                        found.append(errors(done.solution, truth))
                    if known is True:
                        blamed = [a.record for a in ready.faults.taken_out]
                        names = {(1 if r.sensor == "gyro" else 0, r.name) for r in blamed}
                        right = {(k, f"imu {i + 1}" + ("" if x is None else f" {'xyz'[x]}"))
                                 for k, i, x in out}  # fmt: skip
                        wrong += len(names - right)
                        delays.append(min((r.start for r in blamed), default=np.inf) - BEGIN)
                rows.append(np.array(found).reshape(2, -1, 3))
            short += report(name, mechanization, np.array(rows), delays)
    print(f"{wrong} wrong exclusions")
    sys.exit(1 if short or wrong else 0)


def report(name: str, mechanization: str, found: FloatArray, delays: Sequence[float]) -> int:
    """Print one line; how many medians are above 1.1 of the oracle."""
    texts, short = [], 0
    for late in range(found.shape[2]):
        ours, oracle = found[:, 0, late], found[:, 1, late]
        ratio = ours[:, :2] / oracle[:, :2]
        middle = np.median(ours, axis=0), np.median(oracle, axis=0)
        above = middle[0][:2] / middle[1][:2]
        se = ratio.std(axis=0, ddof=1) / np.sqrt(len(ratio)) if len(ratio) > 1 else [np.nan] * 2
        short += int((above > 1.1).sum())
        texts.append(
            f"{middle[0][0]:.3f}/{middle[0][1]:.3f} ({middle[1][0]:.3f}/{middle[1][1]:.3f}) "
            f"{above[0]:.2f}±{se[0]:.2f}/{above[1]:.2f}±{se[1]:.2f} NIS {middle[0][2]:.2f}"
        )
    said = " ".join(f"{d:.2f}" for d in delays)
    print(f"{name:12s} {mechanization:11s} {'; '.join(texts)}; {said}", flush=True)
    return short


if __name__ == "__main__":
    main()
