"""CPU time of `schuler characterize` from 1 million x 6 samples to a written report.

The whole process counts: start of Python, imports, reading, screening, fitting, page. Kernels are
warm (compiled by a first run). `python -m benchmarks.report_speed [FILE]`; without a file a
simulated log is written first.
"""

from __future__ import annotations

import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

RUNS = 3
SAMPLES = 1_000_000
LIMIT_SECONDS = 6.0


def simulated_log(folder: Path) -> Path:
    import numpy as np

    from schuler.cli.example import EXAMPLE_RATE, example_noise
    from schuler.simulation import simulate_static

    log = simulate_static(
        example_noise(), SAMPLES / EXAMPLE_RATE, EXAMPLE_RATE, np.random.default_rng(3)
    )
    path = folder / "imu.parquet"
    log.to_parquet(path)
    return path


def cpu_seconds(command: list[str]) -> float:
    """Return user and system time of a finished child."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL, env=os.environ)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def main(arguments: list[str]) -> int:
    for name in ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "POLARS_MAX_THREADS"):
        os.environ.setdefault(name, "1")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        log = Path(arguments[0]) if arguments else simulated_log(folder)
        report = folder / "report.html"
        command = [sys.executable, "-m", "schuler", "characterize", str(log)]
        cpu_seconds(command)
        times = [cpu_seconds([*command, "--report", str(report)]) for _ in range(RUNS)]
        size = report.stat().st_size / 1e6
    best = min(times)
    print(f"characterize {log.name} to a report of {size:.1f} MB: {best:.2f} CPU s", end=" ")
    print(f"(runs {', '.join(f'{t:.2f}' for t in times)}; at most {LIMIT_SECONDS:g} wanted)")
    return 0 if best <= LIMIT_SECONDS else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
