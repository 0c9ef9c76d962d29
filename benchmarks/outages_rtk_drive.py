"""GNSS outages on the recording rtk-drive, without and with what is known of the vehicle.

Seven windows of 30 s, windows of 60 s (in two runs, as they would meet in one), and the sweep of
30 s windows every 10 s; causal and smoothed. `python -m benchmarks.outages_rtk_drive [FOLDER]
[--no-sweep] [--plain | --vehicle | --odometer]`: inertial and GNSS only, or with wheels that roll,
standstill and the vibration of the wheels (both if nothing is said); or with wheels that roll,
standstill and an odometer that is simulated (speed of the smoothed drive, 1 % too large, 0.05 m/s
of white noise, ten a second). The folder of the recording is
$SCHULER_DATA/rtk-drive, or shared/data/rtk-drive beside the repository. Every run aligns and tunes
from what is outside its windows; the sweep takes most of the time. Exit code 1 if a target is
missed.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import numpy as np

from schuler import MeasurementOptions, Odometer, navigate
from schuler.data import GnssRecording, ImuRecording
from schuler.evaluation import OutageEvaluation, OutageStatistics, evaluate_outages
from schuler.io import read_gnss, read_imu

SEVEN = tuple((float(start), 30.0) for start in range(120, 481, 60))
MINUTES = (
    tuple((float(start), 60.0) for start in (120, 240, 360, 480)),
    tuple((float(start), 60.0) for start in (180, 300, 420)),
)
SWEEP = (30.0, 10.0)
VEHICLE = ("nhc", "zupt", "wheel")
LEAST_INSIDE = 0.90
NIS = (0.8, 1.2)
# mean of the largest errors in m: (causal, smoothed), without and with the vehicle
PLAIN = {"seven": (30.0, 1.1)}
WITH_ODOMETER = {"minutes": (3.0, 0.5)}
AIDED = {"seven": (1.8, 0.40), "minutes": (10.0, 0.65), "sweep": (4.0, 0.40)}
SWEEP_MEDIAN = 1.8


def folder_of(arguments: list[str]) -> Path:
    if arguments:
        return Path(arguments[0])
    beside = Path(__file__).resolve().parents[2] / "shared" / "data"
    return Path(os.environ.get("SCHULER_DATA", beside)) / "rtk-drive"


def line(label: str, statistics: OutageStatistics) -> str:
    return (
        f"  {label:9s}{len(statistics.windows):4d} windows: maxima mean "
        f"{statistics.mean_of_max_m:7.2f}, median {statistics.median_of_max_m:7.2f}, worst "
        f"{statistics.worst_m:7.2f} m; mean error {statistics.mean_m:6.2f} m; inside 2 sigma "
        f"{statistics.within_2_sigma:.3f}"
    )


def judged(title: str, imu: ImuRecording, gnss: GnssRecording, **how: object) -> OutageEvaluation:
    begin = time.process_time()
    found = evaluate_outages(imu, gnss, **how)  # type: ignore[arg-type]
    print(f"{title} ({time.process_time() - begin:.1f} CPU s)")
    print(line("causal", found.causal))
    print(line("smoothed", found.smoothed), flush=True)
    return found


def joined(parts: list[OutageEvaluation]) -> OutageEvaluation:
    """Several evaluations as one."""
    return OutageEvaluation(
        causal=OutageStatistics(tuple(w for p in parts for w in p.causal.windows)),
        smoothed=OutageStatistics(tuple(w for p in parts for w in p.smoothed.windows)),
        sweep=False,
        runs=tuple(r for p in parts for r in p.runs),
    )


def windows_of(seven: OutageEvaluation) -> None:
    for window, bridge in zip(seven.causal.windows, seven.smoothed.windows, strict=True):
        print(
            f"    {window.start_s:5.0f} s: causal {window.max_m:6.2f} m (claimed sd "
            f"{window.claimed_sd_m:6.2f} m), smoothed {bridge.max_m:5.2f} m (claimed sd "
            f"{bridge.claimed_sd_m:5.2f} m)"
        )
    run = seven.runs[0]
    print(
        f"    offsets: position {run['time_offset_position_s']:.4f} s, velocity "
        f"{run['time_offset_velocity_s']:.4f} s; receiver sd times "
        f"{run['gnss_position_sd_factor']:.2f} and {run['gnss_velocity_sd_factor']:.2f}; "
        f"NIS {run['nis_over_degrees']:.3f}"
    )
    if "constraint_sd_right_m_s" in run:
        print(
            f"    constraints: {run['constraint_sd_right_m_s']:.3f} m/s right and "
            f"{run['constraint_sd_down_m_s']:.3f} m/s down"
        )
    if "wheel_speeds" in run:
        print(
            f"    wheel {run['wheel_turns_per_metre']} turns a metre, {run['wheel_speeds']} speeds"
        )


def evaluated(
    imu: ImuRecording, gnss: GnssRecording, aiding: tuple[str, ...], *, sweep: bool, **how: object
) -> dict[str, OutageEvaluation]:
    how |= {"aiding": aiding}
    seven = judged("seven windows of 30 s", imu, gnss, windows=SEVEN, **how)
    windows_of(seven)
    minutes = []
    for windows in MINUTES:
        starts = ", ".join(f"{w[0]:.0f}" for w in windows)
        title = f"windows of 60 s from {starts} s"
        minutes.append(judged(title, imu, gnss, windows=windows, **how))
    found = {"seven": seven, "minutes": joined(minutes)}
    print("all windows of 60 s")
    print(line("causal", found["minutes"].causal))
    print(line("smoothed", found["minutes"].smoothed), flush=True)
    if sweep:
        found["sweep"] = judged("sweep of 30 s every 10 s", imu, gnss, sweep=SWEEP, **how)
    return found


def simulated_odometer(imu: ImuRecording, gnss: GnssRecording) -> Odometer:
    """Return what a wheel would have shown of the drive."""
    path = navigate(imu, gnss, smooth=True, aiding=("nhc", "zupt")).trajectory
    rng = np.random.default_rng(2026)
    time = np.arange(path.time[0], path.time[-1], 0.1)
    speed = np.interp(time, path.time, np.linalg.norm(path.velocity, axis=1))
    return Odometer(time, 1.01 * speed + 0.05 * rng.standard_normal(time.size), sd=0.05)


def checked(
    name: str, found: dict[str, OutageEvaluation], most: dict[str, tuple[float, float]]
) -> bool:
    checks = []
    for key, (causal, smoothed) in most.items():
        if key not in found:
            continue
        for kind, limit in (("causal", causal), ("smoothed", smoothed)):
            statistics: OutageStatistics = getattr(found[key], kind)
            checks += [
                (statistics.mean_of_max_m <= limit, f"{key} {kind} at most {limit:g} m"),
                (
                    statistics.within_2_sigma >= LEAST_INSIDE,
                    f"{key} {kind} inside 2 sigma {LEAST_INSIDE:.0%}",
                ),
            ]
        nis = [run["nis_over_degrees"] for run in found[key].runs]
        fair = NIS[0] <= min(nis) and max(nis) <= NIS[1]
        checks.append((fair, f"{key} NIS within {NIS[0]:g} .. {NIS[1]:g}"))
        if key == "sweep":
            median = found[key].causal.median_of_max_m
            checks.append((median <= SWEEP_MEDIAN, f"sweep median at most {SWEEP_MEDIAN:g} m"))
    for good, text in checks:
        print(f"{'reached' if good else 'MISSED'}: {name}, {text}")
    return all(good for good, _ in checks)


def main(arguments: list[str]) -> int:
    sweep = "--no-sweep" not in arguments
    folder = folder_of([a for a in arguments if not a.startswith("--")])
    imu, gnss = read_imu(folder), read_gnss(folder)
    good = True
    if not {"--vehicle", "--odometer"} & set(arguments):
        print("inertial and GNSS only")
        good &= checked("plain", evaluated(imu, gnss, (), sweep=sweep), PLAIN)
    if "--odometer" in arguments:
        print("with nhc, zupt and an odometer")
        options = MeasurementOptions(sources=(simulated_odometer(imu, gnss),))
        found = evaluated(imu, gnss, ("nhc", "zupt"), sweep=sweep, measurements=options)
        return 0 if checked("odometer", found, WITH_ODOMETER) else 1
    if "--plain" not in arguments:
        print(f"with {', '.join(VEHICLE)}")
        good &= checked("vehicle", evaluated(imu, gnss, VEHICLE, sweep=sweep), AIDED)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
