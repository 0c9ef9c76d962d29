"""Lasting faults of gyros in motion: eight real chips on a board, turned by hand.

    python -m benchmarks.faults_in_motion [--passes 12]

Needs the recordings (SCHULER_DATA, or shared/data beside the repository). Ends with exit code 1
when a figure is missed. Calibration, covariance and thresholds come from run 1 alone; run 4 and
run 7 are judged, with their own biases at rest and sampling phases. Faults last for one window of
1 s and are put into the raw readings before anything is estimated; saturated samples stay so.
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ[_name] = "1"

import argparse
import sys
import time
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np

from schuler.arrays.calibration.calibrate import calibrate_array
from schuler.arrays.calibration.result import ArrayCalibration
from schuler.arrays.calibration.rows import mask_saturated
from schuler.arrays.detection.healthy_motion import HealthyMotion, learn_healthy_motion
from schuler.arrays.detection.lasting_faults import LastingFaults, detect_lasting_faults
from schuler.arrays.read import read_array
from schuler.data import ImuArray

BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data"
DATA = Path(os.environ.get("SCHULER_DATA", BESIDE))
SPEEDS = {"slow, 5 to 100 deg/s": (5.0, 100.0), "above 800 deg/s": (800.0, np.inf)}
FAULTS = {
    "slow, 5 to 100 deg/s": (0.1, 0.2, 0.3, 0.5),
    "above 800 deg/s": (0.5, 1.0, 2.0, 5.0),
}
WANTED = {("slow, 5 to 100 deg/s", 0.5), ("above 800 deg/s", 5.0)}
POWER, FALSE, CHI_SQUARE = 0.95, 0.01, 0.02
APART = 4.0

missed: list[str] = []


def check(good: bool, what: str) -> str:
    if not good:
        missed.append(what)
    return "ok" if good else "MISSED"


def rows_of(found: LastingFaults, low: float, high: float) -> np.ndarray:
    speed = np.degrees(found.offsets.speed)
    return np.asarray((speed >= low) & (speed < high))


def clustered(alarm: np.ndarray, start: np.ndarray) -> float:
    """Standard error of a share, windows of the same 4 s being one."""
    _, group = np.unique(start // APART, return_inverse=True)
    sums = np.bincount(group, alarm - alarm.mean())
    return float(np.sqrt(np.sum(sums**2)) / alarm.size)


def false_alarms(found: LastingFaults, title: str, judged: bool) -> np.ndarray:
    kept = []
    for name, (low, high) in {"at rest": (0.0, 5.0), **SPEEDS}.items():
        rows = rows_of(found, low, high)
        alarm = found.alarm[rows].astype(float)
        error = clustered(alarm, found.offsets.start[rows])
        print(f"  {title}, {name:21}: {100 * alarm.mean():.2f} ± {100 * error:.2f} % of "
              f"{alarm.size} windows")  # fmt: skip
        kept.append([alarm.sum(), alarm.size])
    rows = rows_of(found, 5.0, 500.0)
    share = float(found.inconsistent[rows].mean())
    verdict = check(share <= CHI_SQUARE, f"{title}: chi-square") if judged else ""
    print(f"  {title}, chi-square below 500 deg/s: {100 * share:.1f} % above its threshold of 1 %"
          f" {verdict} (theory's threshold: {100 * found.exceedance(0.01, rows):.1f} %); "
          f"{found.offsets.skipped} windows not judged")  # fmt: skip
    return np.array(kept)


def injected(
    calibration: ArrayCalibration, healthy: HealthyMotion, array: ImuArray, found: LastingFaults,
    chosen: np.ndarray, sizes: np.ndarray, rng: np.random.Generator,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:  # fmt: skip
    """Put faults into the chosen windows: which are found, on the right axis, and sensor."""
    gyro = np.array(array.gyro)
    saturated = np.isnan(mask_saturated(array, margin=0)[0].gyro)
    imu, axis = rng.integers(array.count, size=chosen.size), rng.integers(3, size=chosen.size)
    for w, i, a, size in zip(chosen, imu, axis, sizes, strict=True):
        first, last = np.searchsorted(array.time, [found.offsets.start[w], found.offsets.stop[w]])
        gyro[first : last + 1, i] += calibration.gyro_sensor[i, :, a] * size
    gyro[saturated] = array.gyro[saturated]
    again = detect_lasting_faults(calibration, replace(array, gyro=gyro), healthy)
    place = np.searchsorted(again.offsets.start, found.offsets.start[chosen])
    place = np.minimum(place, again.offsets.start.size - 1)
    same = again.offsets.start[place] == found.offsets.start[chosen]
    suspect = again.suspect[place]
    return (
        same & again.alarm[place],
        same & (suspect == 3 * imu + axis),
        same & (suspect // 3 == imu),
    )


def power(
    calibration: ArrayCalibration, healthy: HealthyMotion, array: ImuArray, found: LastingFaults,
    passes: int, title: str,
) -> None:  # fmt: skip
    rng = np.random.default_rng(5)
    told: dict[tuple[str, float], list[tuple[bool, bool, bool]]] = {}
    for step in range(passes):
        order = rng.permutation(found.offsets.start.size)
        chosen: list[int] = []
        for w in order:
            if not any(rows_of(found, *s)[w] for s in SPEEDS.values()):
                continue
            if all(abs(found.offsets.start[w] - found.offsets.start[c]) >= APART for c in chosen):
                chosen.append(int(w))
        classes = [next(n for n, s in SPEEDS.items() if rows_of(found, *s)[w]) for w in chosen]
        # every pass one size of fault in each class
        sizes = np.array([FAULTS[n][step % len(FAULTS[n])] for n in classes])
        signs = np.radians(sizes) * rng.choice([-1.0, 1.0], sizes.size)
        outcome = injected(
            calibration, healthy, array, found, np.array(chosen), signs, rng
        )  # fmt: skip
        for n, size, *one in zip(classes, sizes, *outcome, strict=True):
            told.setdefault((n, float(size)), []).append(tuple(one))
    for (name, size), hits in sorted(told.items(), key=lambda t: (t[0][0][0] == "a", t[0][1])):
        values = np.array(hits, dtype=bool)
        seen, n = values[:, 0], len(hits)
        share = seen.mean()
        error = np.sqrt(max(share * (1 - share), 1 / n) / n)
        right = values[seen, 1].mean() if seen.any() else np.nan
        verdict = ""
        if (name, size) in WANTED:
            verdict = f"at least {POWER}: {check(share >= POWER, f'{title}: {name} {size}')}"
        print(f"  {title}, {name:21}, {size:.1f} deg/s: found {share:.3f} ± {error:.3f} of {n}, "
              f"then the axis right {right:.3f} {verdict}")  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--passes", type=int, default=12)
    options = parser.parse_args()
    warnings.simplefilter("ignore", RuntimeWarning)
    arrays = {r: read_array(DATA / "mimu8-array" / f"run{r}.parquet") for r in (1, 4, 7)}
    calibration = calibrate_array(arrays[1])
    healthy = learn_healthy_motion(calibration, [arrays[1]])
    print(
        f"learnt from run 1: scale {100 * healthy.scale:.3f} %, timing {1e6 * healthy.timing:.1f} "
        f"µs, floor {np.degrees(healthy.floor):.4f} deg/s, colour {healthy.colour:.2f}; windows "
        f"at rest, below and above 500 deg/s: {healthy.windows.tolist()}"
    )
    total = np.zeros((3, 2))
    for run in (4, 7):
        begin = time.process_time()
        found = detect_lasting_faults(calibration, arrays[run], healthy)
        print(f"run {run}: {time.process_time() - begin:.1f} CPU s for 10 min")
        total += false_alarms(found, f"run {run}", judged=True)
        power(calibration, healthy, arrays[run], found, options.passes, f"run {run}")
    for name, (alarms, windows) in zip(("at rest", *SPEEDS), total, strict=True):
        share = alarms / windows
        print(f"both runs, {name}: {100 * share:.2f} % false alarms of {windows:.0f} windows, at "
              f"most 1 %: {check(share <= FALSE, f'false alarms {name}')}")  # fmt: skip
    print("learnt from two runs, judged on the third (calibration of run 1 in both):")
    for other, run in ((7, 4), (4, 7)):
        both = learn_healthy_motion(calibration, [arrays[1], arrays[other]])
        found = detect_lasting_faults(calibration, arrays[run], both)
        false_alarms(found, f"run {run}", judged=False)
    if missed:
        print("missed: " + "; ".join(missed))
        sys.exit(1)


if __name__ == "__main__":
    main()
