"""Faults of sensors and receivers, over motions and mechanizations: is anything lost in silence?

    python -m benchmarks.fault_campaign [--motions car_urban train] [--faults stuck] [--seeds 1]
                                        [--mechanizations single extended] [--duration 150]

Every run is judged against the truth after the fault began. Clocks agree and the filter is told
so; noise is white and known. "coped": the error is as large as claimed (NEES of position over 3 at
most LIMIT, or at most twice that of the same run without fault); "detected": it is not (or the
solution leaves the rest out: nan), and a finding says so that the run without fault does not have;
"stopped": a clear error; "silently lost": none of these. The command ends with exit code 1 when
anything is silently lost, or ends in another exception.
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import sys
import warnings
from collections import Counter
from dataclasses import replace

import numpy as np

from schuler import (
    GnssGrade,
    ImuArray,
    Mounting,
    NavigationSolution,
    NoiseModel,
    Profile,
    Scenario,
    SimulatedDrive,
    WhiteNoise,
    earth,
    navigate,
    navigate_array,
    screen,
    simulate_drive,
)
from schuler.arrays.geometry import tetrahedron_mounting
from schuler.errors import SchulerError
from schuler.simulation.faults import (
    DropOut,
    NoiseBurst,
    RampFault,
    SampleSlip,
    StepFault,
    StuckFault,
    TimeJump,
)
from schuler.simulation.gnss_faults import LateStamps, WrongFix
from schuler.simulation.motions.profile import from_waypoints

LIMIT = 3.0
NOISE = NoiseModel.isotropic(WhiteNoise(5e-5), WhiteNoise(7e-4))
# White, as the filter takes it, so that runs without fault are honest and NEES shows the fault.
RECEIVER = GnssGrade("white", 1, (0.03, 0.03, 0.05), (0.0, 0.0, 0.0), 60.0, (0.03, 0.03, 0.05))
GYRO, ACCEL = ("gyro_z",), ("accel_x",)


def faults(sound: Scenario, at: float) -> dict[str, dict[str, object]]:
    """Changes of a scenario by the name of the fault, which begins at a time.

    Those of GNSS begin behind a tunnel, where there is one.
    """
    imu = {
        "gyro step 1 deg/s": StepFault(start=at, channels=GYRO, size=np.radians(1.0)),
        "accel step 0.5 m/s2": StepFault(start=at, channels=ACCEL, size=0.5),
        "gyro ramp": RampFault(start=at, channels=GYRO, slope=np.radians(0.02)),
        "gyro stuck": StuckFault(start=at, channels=GYRO),
        "accel stuck": StuckFault(start=at, channels=ACCEL),
        "noise burst 10 s": NoiseBurst(start=at, duration=10.0, channels=GYRO, deviation=0.1),
        "samples slip": SampleSlip(start=at, channels=GYRO, samples=20),
        "rows missing 5 s": DropOut(start=at, duration=5.0),
        "rows held 5 s": DropOut(start=at, duration=5.0, hold=True),
        "stamps jump 0.5 s": TimeJump(start=at, jump=0.5),
        "stamps jump back 0.5 s": TimeJump(start=at, jump=-0.5),
    }
    found: dict[str, dict[str, object]] = {name: {"faults": (f,)} for name, f in imu.items()}
    at = max([at, *(start + length + 20.0 for start, length in sound.outages)])
    found["one wrong fix 100 m"] = {"fix_faults": (WrongFix(start=at, north=100.0),)}
    found["wrong fixes 20 s"] = {"fix_faults": (WrongFix(start=at, duration=20.0, east=30.0),)}
    found["late stamps 0.4 s"] = {"fix_faults": (LateStamps(start=at, late=0.4),)}
    found["outage 30 s"] = {"outages": (*sound.outages, (at, 30.0))}
    found["outliers 5 %"] = {"outlier_rate": 0.05}
    found["claims half of its errors"] = {"claimed_scale": 0.5}
    return found


def straight(duration: float, speed: float, push: float, climb: float = 0.0) -> Profile:
    """Stand, speed up with `push` m/s2 to `speed` towards the north (and up), and keep it."""
    time = np.arange(0.0, duration + 0.25, 0.5)
    moving = np.clip(time - 40.0, 0.0, None)
    reached = speed / push
    way = np.where(moving < reached, 0.5 * push * moving**2, speed * (moving - 0.5 * reached))
    position = np.column_stack(
        [np.full(time.size, 0.8), np.full(time.size, 0.2), 300.0 + climb * way]
    )
    position[:, 0] += way / earth.metres_per_radian(position[0])[0]
    return from_waypoints(time, position, np.zeros((time.size, 3)))


def ship(duration: float) -> Profile:
    """A ship in swell: 5 m/s, rolling by 15 and pitching by 4 degrees."""
    time = np.arange(0.0, duration + 0.25, 0.5)
    swell = np.clip((time - 40.0) / 20.0, 0.0, 1.0)
    way = 5.0 * np.cumsum(swell) * 0.5
    position = np.column_stack([np.full(time.size, 0.8), np.full(time.size, 0.2),
                                1.5 * swell * np.sin(0.7 * time)])  # fmt: skip
    position[:, 0] += way / earth.metres_per_radian(position[0])[0]
    roll = np.radians(15.0) * swell * np.sin(0.6 * time)
    pitch = np.radians(4.0) * swell * np.sin(0.7 * time + 0.5)
    heading = np.radians(8.0) * swell * np.sin(0.05 * time)
    return from_waypoints(time, position, np.column_stack([roll, pitch, heading]))


TUNNEL = {"tunnel": ("car_mixed", 120.0, 600.0)}
"""Motion, and start and length of a tunnel in s, by which the duration given becomes longer."""
OWN = {
    "train": lambda duration: straight(duration, 60.0, 0.8),
    "rocket": lambda duration: straight(duration, 800.0, 40.0, climb=1.0),
    "ship": ship,
}
SHAKEN = {"helicopter": ("drone", 3.0)}
MOTIONS = ("car_urban", "car_mixed", "motorcycle", "walk", "drone", *SHAKEN, *TUNNEL, *OWN)


def scenario(motion: str, duration: float, several: bool) -> Scenario:
    """Return a twin without faults."""
    base, vibration = SHAKEN.get(motion, (motion, 0.0))
    profile = OWN[motion](duration) if motion in OWN else None
    made = Scenario(base, NOISE, RECEIVER, duration=duration, profile=profile, vibration=vibration)
    if motion in TUNNEL:
        base, start, length = TUNNEL[motion]
        made = replace(made, motion=base, duration=duration + length, outages=((start, length),))
    if not several:
        return made
    mounting = tetrahedron_mounting()
    return replace(made, array_rotations=mounting.rotation,
                   array_positions=0.05 * np.eye(4, 3))  # fmt: skip


def solve(
    drive: SimulatedDrive, mechanization: str, several: Scenario
) -> tuple[NavigationSolution, set[str]]:
    """Navigate, and return the solution with the kinds of what was found."""
    told = {f.kind for imu in drive.imus for f in screen(imu).findings if f.severity != "info"}
    if mechanization == "single":
        solution = navigate(drive.imus[0], drive.gnss, NOISE, time_offset=0.0)
    else:
        mounting = Mounting(several.array_rotations, several.array_positions)
        array = ImuArray.from_recordings(drive.imus, mounting)
        done = navigate_array(
            array, drive.gnss, NOISE, mechanization=mechanization, time_offset=0.0
        )
        solution = done.solution
    told |= {
        f["kind"] for f in solution.settings["findings"] if f["severity"] in ("warning", "error")
    }
    return solution, told


def nees(solution: NavigationSolution, drive: SimulatedDrive, after: float) -> float:
    """Mean NEES of position over 3, once a second after a time."""
    track, truth = solution.trajectory, drive.truth
    wanted = np.arange(after, track.time[-1] - 0.5)
    rows = np.unique(np.clip(np.searchsorted(track.time, wanted), 0, track.time.size - 1))
    at = track.time[rows]
    true = np.column_stack([np.interp(at, truth.time, c) for c in truth.position.T])
    north, east = earth.metres_per_radian(true)
    error = (track.position[rows] - true) * np.column_stack([north, east, np.full(at.size, -1.0)])
    weighed = np.linalg.solve(solution.position_covariance[rows], error[:, :, None])[:, :, 0]
    # what the solution leaves out (in gaps) is not claimed
    return float(np.nanmean(np.sum(error * weighed, axis=1)) / 3.0)


def judge(
    motion: str, mechanization: str, seed: int, duration: float, wanted: list[str]
) -> list[tuple[str, str, float]]:
    """Return fault, verdict and NEES of every fault of one twin."""
    sound = scenario(motion, duration, mechanization != "single")
    at = 0.6 * sound.duration
    rows: list[tuple[str, str, float]] = []
    usual, known = np.nan, set()
    for name, change in {"none": {}, **faults(sound, at)}.items():
        if name != "none" and wanted and not any(w in name for w in wanted):
            continue
        made = replace(sound, **change)  # type: ignore[arg-type]
        try:
            drive = simulate_drive(made, seed)
            solution, told = solve(drive, mechanization, made)
            size = nees(solution, drive, at)
        except SchulerError as error:
            rows.append((name, f"stopped ({str(error)[:60]})", np.nan))
            continue
        if name == "none":
            usual, known = size, told
            rows.append((name, "healthy" if size < LIMIT else "dishonest", size))
            continue
        # what a run without fault calls not to be believed is not silent with one
        fresh = told - known | (told & {"claims"})
        if size <= max(LIMIT, 2.0 * usual):
            verdict = "coped"
        else:
            verdict = f"detected ({', '.join(sorted(fresh))})" if fresh else "silently lost"
        rows.append((name, verdict, size))
    return rows


def main() -> int:
    """Run the campaign and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--motions", nargs="+", default=["car_urban", "train"], choices=MOTIONS)
    parser.add_argument("--mechanizations", nargs="+", default=["single"],
                        choices=("single", "synthetic", "extended", "constrained"))  # fmt: skip
    parser.add_argument("--faults", nargs="+", default=[], help="parts of names")
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--duration", type=float, default=150.0)
    options = parser.parse_args()
    counts: Counter[str] = Counter()
    for motion in options.motions:
        for mechanization in options.mechanizations:
            for seed in range(1, options.seeds + 1):
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    rows = judge(motion, mechanization, seed, options.duration, options.faults)
                print(f"{motion}, {mechanization}, seed {seed}")
                for name, verdict, size in rows:
                    counts[verdict.partition(" (")[0]] += 1
                    print(f"  {name:28} NEES/3 {size:9.2f}  {verdict}", flush=True)
    print(", ".join(f"{n} {v}" for v, n in counts.most_common()))
    return 1 if counts["silently lost"] else 0


if __name__ == "__main__":
    sys.exit(main())
