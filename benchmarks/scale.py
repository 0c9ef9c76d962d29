"""What grows how: samples of one record, logs of a fleet, runs of a Monte Carlo, workers.

    python -m benchmarks.scale samples [SIZE ...]   Allan and joint fit in pieces
    python -m benchmarks.scale logs [COUNT ...]     a database of 1 to 10 000 logs (figures made up)
    python -m benchmarks.scale workers              200 logs of 10 min by one and by two processes,
                                                    and by one and by two Dask workers on loopback
    python -m benchmarks.scale trials [RUNS]        filters of 5 min, 15 states, beside their kernel
    python -m benchmarks.scale sweep                outages on rtk-drive by one and by two threads
    python -m benchmarks.scale page                 docs/cost-against-size.md of what was measured

Every figure is kept in benchmarks/results/scale.json, with the load of the machine when it was
taken; the page is made of that file alone. The records are written below the folder of temporary
files and removed: 1e9 samples take 4 GB of disk and a quarter of an hour.
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

import os

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "POLARS_MAX_THREADS"):
    os.environ.setdefault(_name, "1")

import json
import resource
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from schuler.execution import Workers
    from schuler.fleet import LogEntry

RESULTS = Path(__file__).parent / "results" / "scale.json"
PAGE = Path(__file__).parents[1] / "docs" / "cost-against-size.md"
SIZES = (1e5, 1e6, 1e7, 1e8)
COUNTS = (1, 10, 100, 1000, 10_000)
IN_MEMORY = 1e7
"""Samples up to which the record is also fitted in memory."""
RATE = 1000.0
BLOCK = 1 << 20
DENSITY, WALK = 1e-4, 1e-6


def load() -> float:
    return round(os.getloadavg()[0], 1)


def keep(kind: str, key: str, found: dict[str, Any]) -> None:
    """Enter one figure, in the place of an older one."""
    RESULTS.parent.mkdir(exist_ok=True)
    known = json.loads(RESULTS.read_text()) if RESULTS.exists() else {}
    known.setdefault(kind, {})[key] = found
    RESULTS.write_text(json.dumps(known, indent=1, sort_keys=True) + "\n")
    print(kind, key, json.dumps(found), flush=True)


# samples of one record


def write_record(path: Path, samples: int) -> None:
    """Write one gyro at rest, white noise and a random walk, never more than a block in memory."""
    import polars
    from polars.io.plugins import register_io_source

    def blocks(*_: object) -> Iterator[polars.DataFrame]:
        rng, level = np.random.default_rng(20261130), 0.0
        for start in range(0, samples, BLOCK):
            n = min(BLOCK, samples - start)
            steps = rng.standard_normal(n, dtype=np.float32) * (WALK / RATE**0.5)
            walk = level + np.cumsum(steps, dtype=np.float64)
            level = float(walk[-1])
            white = rng.standard_normal(n, dtype=np.float32) * (DENSITY * RATE**0.5)
            yield polars.DataFrame({"gyro_x_rad_s": (walk + white).astype(np.float32)})

    schema = polars.Schema({"gyro_x_rad_s": polars.Float32})
    frame = register_io_source(blocks, schema=schema)
    frame.sink_parquet(path, compression="uncompressed", row_group_size=BLOCK)


def fit_record(path: Path, how: str) -> dict[str, float]:
    """Allan deviation and joint fit of a record, in pieces or in memory; CPU s, and MB at most."""
    from schuler.curves.allan import allan_deviation
    from schuler.curves.spectrum import power_spectral_density
    from schuler.estimation.joint_fit import fit_factors, identify_curve
    from schuler.estimation.long_record import characterize_pieces
    from schuler.io import read_imu
    from schuler.io.pieces import read_imu_pieces
    from schuler.screening.screen import screen

    begin = time.process_time()
    if how == "pieces":
        pieces = read_imu_pieces(path, rate=RATE)
        found = characterize_pieces(pieces, "W+K").channels["gyro_x"]
    else:  # the same steps, each on the whole record
        imu = read_imu(path, rate=RATE)
        screen(imu)
        signal = imu.channel("gyro_x")
        power_spectral_density(signal, RATE, onesided=False, segment=min(1 << 16, signal.size // 2))
        factors = fit_factors(signal.size)
        found = identify_curve(allan_deviation(signal, RATE, factors / RATE), "W+K")
    return {
        "cpu_s": round(time.process_time() - begin, 2),
        "memory_mb": round(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0),
        "white": found.parameters["white_noise.density"] / DENSITY,
        "walk": found.parameters.get("random_walk.density", 0.0) / WALK,
        "load": load(),
    }


def samples(sizes: list[float]) -> None:
    for size in sorted(sizes):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "record.parquet"
            write_record(path, int(size))
            for how in ("pieces", "memory"):
                if how == "memory" and size > IN_MEMORY:
                    continue
                command = [sys.executable, "-m", "benchmarks.scale", "fit", str(path), how]
                done = subprocess.run(command, check=True, capture_output=True, text=True)
                keep("samples", f"{size:.0e} {how}", json.loads(done.stdout.splitlines()[-1]))


# logs of a fleet


def logs(counts: list[float]) -> None:
    from schuler.fleet import FleetDatabase, summarise_fleet

    for count in map(int, counts):
        rng = np.random.default_rng(count)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "fleet.sqlite"
            with FleetDatabase(path) as database:
                begin = time.process_time()
                for k in range(count):
                    database.save(f"{k}", made_up(k, rng))
                entered = time.process_time() - begin
                begin = time.process_time()
                summarise_fleet(database)
                told = time.process_time() - begin
            keep("logs", f"{count}", {
                "enter_ms_a_log": round(1e3 * entered / count, 2), "summary_s": round(told, 2),
                "database_kb_a_log": round(path.stat().st_size / 1e3 / count, 1), "load": load(),
            })  # fmt: skip


def made_up(k: int, rng: np.random.Generator) -> dict[str, Any]:
    """What a log of a fleet of hundred sensors would leave."""
    figures = [
        (f"{sensor}_{axis}", name, value, 0.02 * value, None)
        for sensor in ("gyro", "accel")
        for axis in "xyz"
        for name in ("N", "B", "K")
        for value in [1e-3 * np.exp(0.03 * rng.standard_normal())]
    ]
    return {
        "file": f"{k}.csv", "sensor": "X", "serial": f"SN{k % 100:03d}", "kind": "noise",
        "date": f"{2016 + k // 1000 % 10}-01-{1 + k % 28:02d}", "temperature": 20.0 + k % 7,
        "status": "done", "model": "x" * 2000, "figures": figures,
    }  # fmt: skip


# workers


def write_logs(folder: Path, count: int, seconds: float) -> list[Path]:
    import polars

    rng, n, files = np.random.default_rng(7), int(seconds * 100.0), []
    for k in range(count):
        columns = {"time_s": np.arange(n) / 100.0}
        for sensor, unit, size in (("gyro", "rad_s", 1e-3), ("accel", "m_s2", 1e-2)):
            level = 9.81 if sensor == "accel" else 0.0
            for axis in "xyz":
                walk = np.cumsum(1e-3 * size * rng.standard_normal(n))
                values = size * rng.standard_normal(n) + walk + level * (axis == "z")
                columns[f"{sensor}_{axis}_{unit}"] = values
        files.append(folder / f"{k:03d}.parquet")
        polars.DataFrame(columns).write_parquet(files[-1])
    return files


@contextmanager
def dask_cluster(number: int) -> Iterator[str]:
    """Give the address of a scheduler on loopback with so many workers of one thread."""
    from distributed import Client

    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        address = f"tcp://127.0.0.1:{free.getsockname()[1]}"
    where = ("--host", "127.0.0.1", "--no-dashboard")
    port = ("--port", address.rpartition(":")[2])
    worker = ("dask_worker", address, *where, "--nthreads", "1", "--no-nanny")
    started = [
        subprocess.Popen(
            [sys.executable, "-m", f"distributed.cli.{command[0]}", *command[1:]],
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )
        for command in (("dask_scheduler", *where, *port), *(worker for _ in range(number)))
    ]  # fmt: skip
    try:
        with Client(address, timeout="60s", set_as_default=False) as client:
            client.wait_for_workers(number, timeout="60s")
        yield address
    finally:
        for process in reversed(started):
            process.kill()
            process.wait()


def workers_compared(count: int) -> None:
    from schuler.execution import workers
    from schuler.fleet import FleetDatabase, LogEntry, run_batch

    with tempfile.TemporaryDirectory() as folder:
        entries = [LogEntry(f) for f in write_logs(Path(folder), count, 600.0)]

        def timed(name: str, how: Workers, logs: list[LogEntry]) -> dict[str, float]:
            with FleetDatabase(Path(folder) / f"{name}.sqlite") as database:
                begin = time.perf_counter()
                run_batch(logs, database, executor=how)
                wall = time.perf_counter() - begin
                worked = database._connection.execute("SELECT sum(cpu_seconds) FROM log")
                (inside,) = worked.fetchone()
            return {
                "wall_s": round(wall, 1), "cpu_of_the_logs_s": round(inside, 1), "load": load(),
            }  # fmt: skip

        for number in (1, 2):
            name = f"{count} logs by {number}"
            keep("workers", name, timed(name, workers(number), entries))
        for number in (1, 2):
            with dask_cluster(number) as address:
                # a worker imports and loads its kernels once, whatever the number of logs
                timed(f"first {number}", workers(scheduler=address), entries[: 2 * number])
                name = f"{count} logs by {number} of Dask"
                keep("workers", name, timed(name, workers(scheduler=address), entries))


# filters


def trials(runs: int) -> None:
    from schuler import FilterExperiment, NoiseModel, RandomWalk, WhiteNoise, monte_carlo
    from schuler.navigation.stepping import FilterStepper
    from schuler.simulation import car_urban

    gyro, accel = WhiteNoise(2e-4) + RandomWalk(2e-6), WhiteNoise(2e-3) + RandomWalk(1e-4)
    profile = car_urban(300.0, np.random.default_rng(3))
    experiment = FilterExperiment(profile, NoiseModel.isotropic(gyro, accel))
    monte_carlo(experiment, 2, seed=9)
    spent = {"kernel": 0.0, "drawing": 0.0}

    def timed(owner: type, name: str, kind: str) -> None:
        plain = getattr(owner, name)

        def call(*arguments: Any, **options: Any) -> Any:
            begin = time.thread_time()
            found = plain(*arguments, **options)
            spent[kind] += time.thread_time() - begin
            return found

        setattr(owner, name, call)

    timed(FilterStepper, "advance", "kernel")
    timed(FilterExperiment, "_drawn", "drawing")
    for number in (1, 2):
        spent.update(kernel=0.0, drawing=0.0)
        wall, cpu = time.perf_counter(), time.process_time()
        with ThreadPoolExecutor(number) as pool:
            result = monte_carlo(experiment, runs, seed=1, executor=pool)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        mean, low, high = result.squares_within("truth: nees", 9)
        keep("trials", f"{runs} runs, {number} threads", {
            "wall_s": round(wall, 1), "cpu_s": round(cpu, 1),
            "kernel_cpu_s": round(spent["kernel"], 1), "drawing_cpu_s": round(spent["drawing"], 1),
            "filter_over_kernel": round((cpu - spent["drawing"]) / spent["kernel"], 3),
            "nees_over_9": round(mean, 3), "band": [round(low, 3), round(high, 3)], "load": load(),
        })  # fmt: skip


def sweep() -> None:
    from benchmarks.outages_rtk_drive import SWEEP, folder_of
    from schuler.evaluation import evaluate_outages
    from schuler.io import read_gnss, read_imu
    from schuler.navigation import threads

    folder = folder_of([])
    imu, gnss = read_imu(folder / "imu.parquet"), read_gnss(folder / "gnss.parquet")
    evaluate_outages(imu, gnss, windows=((120.0, 30.0),))
    for number in (1, 2):
        threads.MOST_THREADS = number
        wall, cpu = time.perf_counter(), time.process_time()
        found = evaluate_outages(imu, gnss, sweep=SWEEP)
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        keep("sweep", f"{number} threads", {
            "wall_s": round(wall, 1), "cpu_s": round(cpu, 1), "load": load(),
            "windows": len(found.causal.windows), "runs": len(found.runs),
        })  # fmt: skip


# the page


def page() -> None:
    """Write the page of what was measured."""
    known = json.loads(RESULTS.read_text())
    kinds = {k: known.get(k, {}) for k in ("samples", "logs", "workers", "trials", "sweep")}
    lines = [HEAD]
    rows = []
    sizes = sorted({k.split()[0] for k in kinds["samples"]}, key=float)
    for size in sorted(sizes):
        one, whole = (kinds["samples"].get(f"{size} {how}") for how in ("pieces", "memory"))
        per = 1e6 / float(size)
        rows.append((
            f"{float(size):.0e}", one and one["cpu_s"], one and f"{per * one['cpu_s']:.3g}",
            one and one["memory_mb"], whole and whole["cpu_s"], whole and whole["memory_mb"],
        ))  # fmt: skip
    columns = ("samples", "CPU s", "µs a sample", "MB at most", "in memory CPU s", "MB at most")
    lines += ["## One record, one channel", "", *table(columns, rows), "", SAMPLES]
    rows = [(f"{int(k):,}".replace(",", " "), *(v[n] for n in LOG_FIGURES))
            for k, v in sorted(kinds["logs"].items(), key=lambda i: int(i[0]))]  # fmt: skip
    columns = ("logs", "entering one, ms", "summary, s", "database, kB a log")
    lines += ["## A fleet", "", *table(columns, rows), "", LOGS]
    for kind, title, text in (
        ("workers", "Static logs by processes", WORKERS),
        ("trials", "Many filters", TRIALS),
        ("sweep", "A sweep of outages by threads", SWEEP_TEXT),
    ):
        if not kinds[kind]:
            continue
        first = next(iter(kinds[kind].values()))
        names = [n for n in first if n != "band"]
        rows = [(k, *(v.get(n) for n in names)) for k, v in sorted(kinds[kind].items())]
        columns = ("", *(n.replace("_", " ") for n in names))
        lines += [f"## {title}", "", *table(columns, rows), "", text]
    PAGE.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")


LOG_FIGURES = ("enter_ms_a_log", "summary_s", "database_kb_a_log")
HEAD = """# Cost against size

<!-- made by python -m benchmarks.scale page -->

What grows how, measured on a shared machine of two cores (CPU seconds; wall times are told with the
load, the number of processes that wanted a core, because they mean little without it), by
`python -m benchmarks.scale`. Records and logs are simulated; those of a fleet of more than a few
hundred logs are made-up figures, because only the database is asked there.
"""
SAMPLES = """Reading Parquet, screening, Allan deviation, spectrum and joint fit; every sample is
read once. From ten million samples on the cost a sample does not rise, and memory by a few MB
a tenfold length (sums of longer clusters). What
limits next is reading and screening on one core. Files of a dataset are independent: sums of
parts (`--sums-out`) by as many processes as there are cores are the next step.
"""
LOGS = """Work on the logs themselves is the same for each, and not in this table. What
limits next is the
summary: it holds every figure in memory, some 18 a log, and grows in proportion.
"""
WORKERS = """Each log stands alone. What limits next is the memory of processes (about 250 MB each)
and the one writer of the database.
"""
TRIALS = """The filter (start, schedule, kernel, judging) beside its kernel alone; drawing noise and
fixes is told by itself. What limits next is drawing: twelve streams of random numbers a run.
"""
SWEEP_TEXT = """Runs that share no fixes go to threads, because the kernels of the filter let go of
the interpreter. Under load wall times
favour the run with more threads: the ratio here is no proof. What limits next is the number of
runs that a sweep falls into, and memory for the smoothers of all that run at once.
"""


def table(columns: tuple[str, ...], rows: list[tuple[Any, ...]]) -> list[str]:
    """Rows of Markdown."""

    def told(cell: Any) -> str:
        return "–" if cell is None else str(cell)

    return [
        "| " + " | ".join(columns) + " |",
        "|" + "---|" * len(columns),
        *("| " + " | ".join(map(told, row)) + " |" for row in rows),
    ]


def main() -> None:
    what, *rest = sys.argv[1:] or ["page"]
    if what == "fit":
        print(json.dumps(fit_record(Path(rest[0]), rest[1])))
    elif what == "samples":
        samples([float(r) for r in rest] or list(SIZES))
    elif what == "logs":
        logs([float(r) for r in rest] or list(COUNTS))
    elif what == "workers":
        workers_compared(int(rest[0]) if rest else 200)
    elif what == "trials":
        trials(int(rest[0]) if rest else 1000)
    elif what == "sweep":
        sweep()
    elif what == "page":
        page()
    else:
        raise SystemExit(__doc__)


if __name__ == "__main__":
    main()
