"""GNSS outages on the recording rtk-drive: inertial and GNSS only, causal and smoothed.

Seven windows of 30 s, windows of 60 s (in two runs, as they would meet in one), and the sweep of
30 s windows every 10 s. `python -m benchmarks.outages_rtk_drive [FOLDER] [--no-sweep]`; the
folder of the recording is $SCHULER_DATA/rtk-drive, or shared/data/rtk-drive beside the
repository, if not given. The sweep takes most of the time.
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

from schuler.data import GnssRecording, ImuRecording
from schuler.evaluate import OutageEvaluation, OutageStatistics, evaluate_outages
from schuler.readers import read_gnss, read_imu

SEVEN = tuple((float(start), 30.0) for start in range(120, 481, 60))
MINUTES = (
    tuple((float(start), 60.0) for start in (120, 240, 360, 480)),
    tuple((float(start), 60.0) for start in (180, 300, 420)),
)
SWEEP = (30.0, 10.0)
MOST_CAUSAL_M = 30.0
LEAST_INSIDE = 0.85
MOST_SMOOTHED_M = 1.1


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
    print(line("smoothed", found.smoothed))
    return found


def main(arguments: list[str]) -> int:
    sweep = "--no-sweep" not in arguments
    folder = folder_of([a for a in arguments if not a.startswith("--")])
    imu, gnss = read_imu(folder), read_gnss(folder)
    seven = judged("seven windows of 30 s", imu, gnss, windows=SEVEN)
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
    for windows in MINUTES:
        starts = ", ".join(f"{w[0]:.0f}" for w in windows)
        judged(f"windows of 60 s from {starts} s", imu, gnss, windows=windows)
    if sweep:
        judged("sweep of 30 s every 10 s", imu, gnss, sweep=SWEEP)
    causal, smoothed = seven.causal, seven.smoothed
    checks = (
        (causal.mean_of_max_m <= MOST_CAUSAL_M, f"causal at most {MOST_CAUSAL_M:g} m"),
        (causal.within_2_sigma >= LEAST_INSIDE, f"causal inside 2 sigma {LEAST_INSIDE:.0%}"),
        (smoothed.mean_of_max_m <= MOST_SMOOTHED_M, f"smoothed at most {MOST_SMOOTHED_M:g} m"),
    )
    for good, text in checks:
        print(("reached: " if good else "MISSED: ") + text)
    return 0 if all(good for good, _ in checks) else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
