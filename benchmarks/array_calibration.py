"""Calibration between IMUs on real arrays: eight on a board, four on a quadrotor.

    python -m benchmarks.array_calibration [--no-faults]

Needs the recordings (SCHULER_DATA, or shared/data beside the repository). Ends with exit code 1
when a figure is missed. Disagreement is every calibrated component minus the mean of all sensors,
rms over rows, sensors and axes / 1.4826 times the median absolute deviation.
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
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np

from schuler.arrays.calibration.calibrate import calibrate_array
from schuler.arrays.calibration.disagreement import Disagreement
from schuler.arrays.calibration.judging import (
    disagreement_after,
    mean_slope,
    nominal_disagreement,
    residuals_after,
    track_phases,
    with_biases_at_rest,
)
from schuler.arrays.calibration.result import ArrayCalibration
from schuler.arrays.calibration.rows import find_rests, mask_saturated
from schuler.arrays.clocks.delays import estimate_delays
from schuler.arrays.clocks.jumps import find_jumps
from schuler.arrays.clocks.polling import track_polling
from schuler.arrays.clocks.resampling import low_pass
from schuler.arrays.read import read_array
from schuler.data import ImuArray
from schuler.io import read_imus

BESIDE = Path(__file__).resolve().parents[2] / "shared" / "data"
DATA = Path(os.environ.get("SCHULER_DATA", BESIDE))
FLIGHTS = (2, 3, 7, 9, 10, 11, 13, 15)
GYRO_LIMITS = {"below 500 deg/s": (2.0, 0.42), "below 1500 deg/s": (3.5, 0.80)}
REST_LIMIT, ARM_LIMIT = 0.053, 1.1
AGREE_LIMIT, BIAS_LIMIT, CPU_LIMIT = 0.17, 0.1, 8.0
FAULT = np.radians(2.0)

missed: list[str] = []


def check(good: bool, what: str) -> str:
    if not good:
        missed.append(what)
    return "ok" if good else "MISSED"


def shown(found: Iterable[Disagreement]) -> dict[tuple[str, str], tuple[float, float]]:
    return {
        (d.quantity, d.condition): tuple(  # type: ignore[misc]
            np.degrees([d.rms, d.robust]) if d.quantity == "gyro" else (d.rms, d.robust)
        )
        for d in found
    }


def board() -> None:
    print("mimu8-array: fitted on run 1, judged on run 4 and run 7")
    print(
        "  estimated on the judged run itself: biases at rest (gyros, and differences of the\n"
        "  accelerometers), sampling phases of the polled chips. Rows with a saturated sample of\n"
        "  any gyro within 3 rows are not judged; moving is a mean rate above 5 deg/s."
    )
    begin = time.process_time()
    calibration = calibrate_array(read_array(DATA / "mimu8-array" / "run1.parquet"))
    spent = time.process_time() - begin
    print(f"  reading and fitting run 1: {spent:.1f} CPU s {check(spent < CPU_LIMIT, 'CPU s')}")
    assert calibration.period is not None
    print(
        f"  internal period {1e3 * calibration.period:.4f} ms, beats "
        + " ".join(f"{b:+.2f}" for b in calibration.beat)
        + " Hz"
    )
    before, after = calibration.gravity_fit or (np.nan, np.nan)
    print(
        f"  |force| over {calibration.rests} poses: sd {before:.4f} m/s² before, {after:.4f} after"
    )
    print("  lever arms, mm: " + "; ".join(
        " ".join(f"{1e3 * v:+.2f}" for v in row) for row in calibration.position))  # fmt: skip
    print(f"  (standard errors {1e3 * calibration.position_sd.max():.2f} mm at most)")
    for run in (4, 7):
        judge(calibration, run)


def judge(calibration: ArrayCalibration, run: int) -> None:
    array = read_array(DATA / "mimu8-array" / f"run{run}.parquet")
    used = with_biases_at_rest(calibration, array)
    masked, _ = mask_saturated(array)
    slope = mean_slope(array, used.gyro_correction, used.gyro_bias)
    track = track_phases(used, array)
    nominal = shown(nominal_disagreement(used, masked))
    matrices = shown(disagreement_after(used, masked, None, slope=slope))
    tracked = shown(disagreement_after(used, masked, track, slope=slope))
    sharp = shown(disagreement_after(used, masked, track, slope=slope, sharpen=True))
    kept = shown(disagreement_after(calibration, masked, track, slope=slope))
    print(f"  run {run}: rms / 1.48 MAD   nominal    matrices   + phases   + own derivative"
          "   phases, biases of run 1")  # fmt: skip
    for key, value in tracked.items():
        unit = "deg/s" if key[0] == "gyro" else "m/s²"
        verdict = ""
        if key[0] == "gyro" and key[1] in GYRO_LIMITS:
            rms, robust = GYRO_LIMITS[key[1]]
            good = value[0] <= rms and value[1] <= robust
            verdict = f"  at most {rms} / {robust}: {check(good, f'run {run} {key}')}"
        elif key == ("accel", "at rest"):
            verdict = f"  at most {REST_LIMIT}: {check(value[0] <= REST_LIMIT, f'run {run} {key}')}"
        elif key == ("accel", "below 500 deg/s"):
            verdict = f"  at most {ARM_LIMIT}: {check(value[0] <= ARM_LIMIT, f'run {run} {key}')}"
        cells = "".join(f"{v[key][0]:7.3f}/{v[key][1]:.3f}"
                        for v in (nominal, matrices, tracked, sharp, kept))  # fmt: skip
        print(f"    {key[0]:5} {key[1]:16} {unit:5} {cells}{verdict}")
    held_out(used, array, slope)


def held_out(used: ArrayCalibration, array: ImuArray, slope: np.ndarray) -> None:
    """Phases tracked on the even rows, judged on the odd ones; and a margin of one row only."""
    masked, _ = mask_saturated(array)
    gyro, _, _ = residuals_after(used, masked, None, slope)
    even = gyro.copy()
    even[1::2] = np.nan
    track = track_polling(array.time, even, slope, used.noise, period=used.period)
    odd = replace(
        masked, gyro=np.where(np.arange(array.size)[:, None, None] % 2, masked.gyro, np.nan)
    )
    close, _ = mask_saturated(array, margin=1)
    for words, judged, found in (
        ("phases of even rows, judged on odd", odd, track),
        ("margin of one row only", close, track_phases(used, array)),
    ):
        values = shown(disagreement_after(used, judged, found, slope=slope))
        nominal = shown(nominal_disagreement(used, judged, find_rests(array)))
        sharp = shown(disagreement_after(used, judged, found, slope=slope, sharpen=True))
        text = "; ".join(
            f"{c} {values[k][0]:.2f}/{values[k][1]:.2f} (nominal {nominal[k][0]:.2f}/"
            f"{nominal[k][1]:.2f}, own derivative {sharp[k][0]:.2f}/{sharp[k][1]:.2f})"
            for c in GYRO_LIMITS if (k := ("gyro", c)) in values
        )  # fmt: skip
        print(f"    {words}: {text}")


def smooth(array: ImuArray) -> np.ndarray:
    flat = low_pass(array.time, array.gyro.reshape(array.size, -1), 8.0)
    return flat.reshape(array.gyro.shape)


def quadrotor(with_faults: bool) -> None:
    print("quad-4imu: each flight fitted by itself (rotation, delay, biases, lever arms), 8 Hz")
    print("  path   low-passed gyros, deg/s   delays, ms                 jumps by the stamps")
    biases, positions, named, false = [], [], 0, 0
    for path in FLIGHTS:
        file = DATA / "quad-4imu" / f"path{path:02d}_imu.parquet"
        array = read_array(file)
        one = calibrate_array(array, gyro_model="rotation", accel_model="rotation", bandwidth=8.0)
        body = one.apply(array)
        rates = smooth(body)[60:-60]
        apart = rates - rates.mean(axis=1, keepdims=True)
        rms = np.degrees(np.sqrt(np.nanmean((apart - np.nanmean(apart, axis=0)) ** 2)))
        jumps = find_jumps(array, estimate_delays(array, bandwidth=8.0), bandwidth=15.0)
        delays = " ".join(f"{1e3 * d:+.2f}" for d in one.delay)
        print(f"  {path:4d}   {rms:.3f} {check(rms <= AGREE_LIMIT, f'path {path}'):20}   {delays}"
              f"    {'; '.join(map(str, jumps)) or 'none'}")  # fmt: skip
        biases.append(one.accel_bias)
        positions.append(one.position)
        if with_faults:
            hit, others = named_fault(body)
            named, false = named + hit, false + others
    off = np.abs(np.array(biases) - np.mean(biases, axis=0)).max()
    print(f"  accelerometer biases (differences from the mean) move by {off:.3f} m/s² at most "
          f"over the flights: {check(off <= BIAS_LIMIT, 'biases')}")  # fmt: skip
    print("  lever arms from the mean, cm, over the flights: " + "; ".join(
        " ".join(f"{100 * m:+.1f}" for m in mean) for mean in np.mean(positions, axis=0))
        + f" (sd {100 * np.std(positions, axis=0, ddof=1).max():.2f} at most)")  # fmt: skip
    print("  row by row, the stamps not used:")
    for path, imu in ((3, 3), (11, 1)):
        rows = ImuArray.from_recordings(
            read_imus(DATA / "quad-4imu" / f"path{path:02d}_imu.parquet", rate=120.005)
        )
        jumps = find_jumps(rows, estimate_delays(rows, bandwidth=8.0), bandwidth=15.0)
        good = [j.imu for j in jumps] == [imu]
        print(f"    path {path:2d}: {'; '.join(map(str, jumps))} {check(good, f'jump {path}')}")
    for path in (3, 9, 11, 13):
        array = read_array(DATA / "quad-4imu" / f"path{path:02d}_imu.parquet")
        stamps = [line for line in array.history if "wrong time stamp" in line]
        lost = np.argwhere(np.isnan(array.gyro[:-1, :, 0]))
        text = "; ".join(
            f"{array.names[i]} lacks the sample at {array.time[r]:.3f} s" for r, i in lost
        )
        print(f"    path {path:2d} stamps: {'; '.join([*stamps, *([text] if text else [])])}")
        check(bool(stamps), f"stamps of path {path}")
    if with_faults:
        print(f"  a step of 2 deg/s on one axis for 5 s is named while it lasts on {named} of "
              f"{len(FLIGHTS)} flights: {check(named >= 7, 'faults')}; before it, {false} axes or "
              "units\n  are taken out on the healthy data: rates low-passed to 8 Hz are not white, "
              "and differ by 0.1 deg/s\n  for seconds, which the default thresholds take for "
              "slow faults")  # fmt: skip
    print(
        "  what these flights cannot show: the scale of all gyros, the turn of the whole, biases\n"
        "  of the mean, and any gain against the truth: the reference attitude is the flight\n"
        "  controller's, and its errors are common to all four."
    )


def named_fault(body: ImuArray) -> tuple[int, int]:
    """Put a step on the y axis of the third IMU from 25 to 30 s and ask who did it.

    Returns whether it was named while it lasted, and how many others were taken out before it.
    """
    from schuler.arrays.detection.faults import detect_faults

    gyro = np.array(body.gyro)
    a, b = np.searchsorted(body.time, [25.0, 30.0])
    gyro[a:b, 2, 1] += FAULT
    rates = smooth(replace(body, gyro=gyro))
    good = np.isfinite(rates).all(axis=(1, 2))
    level = np.nanmean(rates - rates.mean(axis=1, keepdims=True), axis=0)
    faulty = replace(
        body,
        time=body.time[good],
        gyro=rates[good] - level,
        accel=np.full(rates[good].shape, np.nan),
    )
    found = detect_faults(faulty).gyro
    assert found is not None
    name = f"{body.names[2]} y"
    hit = any(r.name == name and 25.0 <= r.start <= 30.0 for r in found.records)
    return int(hit), sum(r.start < 25.0 for r in found.records)


def main() -> None:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--no-faults", action="store_true")
    options = parser.parse_args()
    warnings.simplefilter("ignore", RuntimeWarning)
    board()
    quadrotor(not options.no_faults)
    if missed:
        print("missed: " + "; ".join(missed))
        sys.exit(1)


if __name__ == "__main__":
    main()
