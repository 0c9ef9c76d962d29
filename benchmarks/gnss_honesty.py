"""Whether claims hold when errors of GNSS last: grades of receivers, rates and motions.

    python -m benchmarks.gnss_honesty [--seeds 2] [--grades RTK ...] [--rates 1 ...]
        [--motions car ...] [--truth matched ...] [--how default|off|known] [--tune] [--arm X Y Z]

A row is the mean over seeds of: real horizontal error (RMS, m), normalised square a degree (N),
share inside two sigma, causal and smoothed; velocity square a degree, smoothed; normalised
innovation squared; CPU seconds. The first quarter of a drive is not judged. `--truth` changes what
the receiver really does, its claim stays: correlation times, white, slow alone, claims that are too
large or too small. `--how known` tells the filter the true split and time offset: what chance alone
does, drive by drive (a drive holds a handful of slow errors). Seeds are 9001 and on unless told;
nothing was tuned on them.
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import sys
import time
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import schuler
from schuler.data import NavigationSolution
from schuler.earth import metres_per_radian
from schuler.navigation.preparation.prepare import prepare
from schuler.navigation.run import run
from schuler.simulation import Profile, car_urban, drone, ideal_imu, simulate_imu, walk
from schuler.simulation.receivers import (
    DIFFERENTIAL_CODE,
    L1_CODE,
    RTK_FIXED,
    GnssGrade,
    simulate_receiver,
)

Array = NDArray[np.float64]
GRADES = {"RTK": RTK_FIXED, "diff": DIFFERENTIAL_CODE, "L1": L1_CODE}
MOTIONS = {"car": car_urban, "drone": drone, "walk": walk}
INSIDE = 6.180074306244168
NOISE = schuler.NoiseModel(
    {
        f"{sensor}_{axis}": schuler.WhiteNoise(white) + schuler.RandomWalk(walk_)
        for sensor, white, walk_ in (("gyro", 1e-4, 3e-6), ("accel", 1.5e-3, 1e-4))
        for axis in "xyz"
    },
    rate=50.0,
)


def truth(grade: GnssGrade, kind: str) -> tuple[GnssGrade, float]:
    """What the receiver really does, and the factor on its claim."""
    whole, none = grade.position_sd, (0.0, 0.0, 0.0)
    if kind.startswith("tau"):
        return replace(grade, correlation_time=float(kind[3:])), 1.0
    if kind.startswith("claims"):
        return grade, float(kind[6:])
    return {
        "matched": grade,
        "white": replace(grade, white_sd=whole, correlated_sd=none),
        "slow": replace(grade, white_sd=(1e-3, 1e-3, 1e-3), correlated_sd=whole),
    }[kind], 1.0


def judge(solution: NavigationSolution, profile: Profile) -> list[float]:
    """Real error, square a degree, share inside, and the square of velocity."""
    path = solution.trajectory
    pick = slice(path.size // 4, None, max(1, path.size // 600))
    true = profile.trajectory(path.time[pick])
    north, east = metres_per_radian(true.position)
    off = (path.position[pick] - true.position)[:, :2] * np.stack([north, east], axis=1)
    claimed = solution.position_covariance[pick][:, :2, :2]
    square = np.einsum("ki,ki->k", off, np.linalg.solve(claimed, off[..., None])[..., 0])
    speed = ((path.velocity[pick] - true.velocity) / solution.velocity_sd[pick])[:, :2] ** 2
    real = float(np.sqrt(np.mean(np.sum(off**2, axis=1))))
    return [real, float(square.mean()) / 2.0, float(np.mean(square < INSIDE)), float(speed.mean())]


def one(motion: str, grade: GnssGrade, rate: float, seed: int, options: Any) -> list[float]:
    """Draw a drive, solve it, and judge both solutions."""
    profile = MOTIONS[motion](options.duration, seed, standstill=20.0)
    rng = np.random.default_rng([11, seed])
    imu = simulate_imu(ideal_imu(profile, options.imu_rate), NOISE, rng)
    actual, scale = truth(grade, options.truth)
    gnss = simulate_receiver(
        profile, actual, rate, rng=rng, claimed_scale=scale, lever_arm=options.arm
    )
    told: dict[str, Any] = {}
    if options.how == "off":
        told["measurements"] = schuler.MeasurementOptions(correlated=None)
    elif options.how == "known":
        whole, white = np.square(actual.position_sd), np.square(actual.white_sd)
        share = float(white[0] / whole[0]) / scale**2
        split = schuler.GnssErrorModel(
            share, 1.0 / scale**2 - share, actual.correlation_time, fit=False
        )
        told["measurements"] = schuler.MeasurementOptions(correlated=split)
        told |= {"time_offset": 0.0, "lever_arm": options.arm}
    begun = time.process_time()
    used, setup = prepare(imu, gnss, NOISE, tune_noise=options.tune or None, **told)
    done = run(used, gnss, setup, smooth=True)
    spent = time.process_time() - begun
    assert done.smoothed is not None
    if options.verbose:
        split = setup.measurements.correlated
        print("   ", seed, split, round(setup.factors.velocity_sd, 2), setup.lever_arm)
        for f in done.causal.settings["findings"]:
            print("      ", f["kind"], f["message"])
    position = done.causal.innovations.of_kind("GNSS position").mean_nis
    row = [*judge(done.causal, profile), *judge(done.smoothed, profile), position, spent]
    if options.verbose:
        print("      ", np.round(row, 3))
    return row


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=2)
    parser.add_argument("--first", type=int, default=9001)
    parser.add_argument("--grades", nargs="+", default=list(GRADES))
    parser.add_argument("--rates", nargs="+", type=float, default=[1.0])
    parser.add_argument("--motions", nargs="+", default=["car"])
    parser.add_argument("--truth", default="matched")
    parser.add_argument("--how", default="default", choices=("default", "off", "known"))
    parser.add_argument("--tune", action="store_true")
    parser.add_argument("--duration", type=float, default=300.0)
    parser.add_argument("--imu-rate", type=float, default=50.0)
    parser.add_argument("--arm", nargs=3, type=float, default=(0.0, 0.0, 0.0))
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    print(f"{options.truth}, {options.how}, {options.seeds} seeds from {options.first}")
    print("                    causal m      N   in | smoothed m      N   in   Nv |  NIS  CPU s")
    for grade in options.grades:
        for rate in options.rates:
            for motion in options.motions:
                rows = [
                    one(motion, GRADES[grade], rate, options.first + k, options)
                    for k in range(options.seeds)
                ]
                m = np.mean(rows, axis=0)
                error = np.std(rows, axis=0) / np.sqrt(max(len(rows) - 1, 1))
                print(
                    f"{grade:5}{rate:5g} Hz {motion:6}{m[0]:8.3f} {m[1]:5.2f}±{error[1]:4.2f}"
                    f"{100 * m[2]:4.0f} |{m[4]:8.3f} {m[5]:5.2f}±{error[5]:4.2f}{100 * m[6]:4.0f}"
                    f"{m[7]:6.2f} |{m[8]:5.2f}{m[9]:6.1f}",
                    flush=True,
                )
    return 0


if __name__ == "__main__":
    sys.exit(main())
