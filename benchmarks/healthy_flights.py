"""Healthy flights of a quadrotor with four IMUs: is any sensor excluded, and are faults named?

    python -m benchmarks.healthy_flights [--injections 4] [--flights 03 09] [--seed 20] [--passing]

Needs the recordings (SCHULER_DATA, or shared/data beside the repository). Each flight is judged
with the calibration of another one, or calibrated in passing with the fault inside. Ends with exit
code 1 when a healthy sensor is excluded.
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import sys
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np

from schuler.arrays.calibration.calibrate import calibrate_array
from schuler.arrays.calibration.result import ArrayCalibration
from schuler.arrays.detection.calibrated_parts import prepare_by_parts
from schuler.arrays.detection.fault_log import FaultRecord
from schuler.arrays.detection.faults import detect_faults
from schuler.arrays.read import read_array
from schuler.data import ImuArray

BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data"
DATA = Path(os.environ.get("SCHULER_DATA", BESIDE)) / "quad-4imu"
FLIGHTS = ("02", "03", "07", "09", "10", "11", "13", "15")
SIZES = {"gyro": np.radians(2.0), "accel": 0.5}


def excluded(array: ImuArray, board: ArrayCalibration | None) -> list[FaultRecord]:
    ready = prepare_by_parts(array, calibration=board)
    found = detect_faults(ready.array, ready.settings)
    return [r for r in found.records if r.kind != "missing"]


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--injections", type=int, default=4)
    parser.add_argument("--flights", nargs="+", choices=FLIGHTS, default=list(FLIGHTS))
    parser.add_argument("--seed", type=int, default=20)
    parser.add_argument("--passing", action="store_true")
    options = parser.parse_args()
    warnings.simplefilter("ignore", RuntimeWarning)
    rng = np.random.default_rng(options.seed)
    arrays = {p: read_array(DATA / f"path{p}_imu.parquet") for p in FLIGHTS}
    delays: dict[str, list[float]] = {kind: [] for kind in SIZES}
    false = wrong = 0
    for i, p in enumerate(FLIGHTS):
        if p not in options.flights:
            continue
        other = FLIGHTS[(i + 3) % len(FLIGHTS)]
        board = None if options.passing else calibrate_array(arrays[other], bandwidth=8.0)
        healthy = excluded(arrays[p], board)
        false += len(healthy)
        for kind, size in SIZES.items():
            for _ in range(options.injections):
                imu, axis = int(rng.integers(4)), int(rng.integers(3))
                start = float(rng.uniform(15.0, arrays[p].time[-1] - 8.0))
                values = getattr(arrays[p], kind).copy()
                values[arrays[p].time >= start, imu, axis] += size * rng.choice([-1.0, 1.0])
                found = excluded(replace(arrays[p], **{kind: values}), board)
                name = f"{arrays[p].names[imu]} {'xyz'[axis]}"
                right = [r.start for r in found if (r.sensor, r.name) == (kind, name)]
                delays[kind].append(min((t - start for t in right), default=np.inf))
                wrong += len(found) - len(right)
        print(f"path {p}: {[r.text for r in healthy]}", flush=True)
    print(
        f"{false} healthy sensors excluded on {len(options.flights)} flights, "
        f"{wrong} wrong in injections"
    )
    for kind, times in delays.items():
        share = [float(np.mean(np.array(times) <= limit)) for limit in (1.0, 2.0, np.inf)]
        print(f"{kind}: named within 1 s {share[0]:.2f}, 2 s {share[1]:.2f}, ever {share[2]:.2f} "
              f"of {len(times)}")  # fmt: skip
    sys.exit(1 if false else 0)


if __name__ == "__main__":
    main()
