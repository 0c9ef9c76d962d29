"""A Dask cluster on this machine: one of its two workers is killed while it works."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import polars
import pytest
from scale_work import noise, noise_after

from schuler.errors import InputError
from schuler.execution import Kept, executors
from schuler.execution.executors import workers
from schuler.execution.tasks import Task, run_tasks
from schuler.fleet import FleetDatabase, LogEntry, run_batch

ROOT = Path(__file__).parents[2]


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    address = f"tcp://127.0.0.1:{port}"
    seen = os.pathsep.join([str(ROOT / "src"), str(Path(__file__).parent)])
    environment = os.environ | {"PYTHONPATH": seen, "OPENBLAS_NUM_THREADS": "1"}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}

    def start(*arguments: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-m", "distributed.cli." + arguments[0], *arguments[1:]]
        return subprocess.Popen(command, env=environment, cwd=tmp_path, **quiet)  # type: ignore[call-overload,no-any-return]

    options = ("--host", "127.0.0.1", "--no-dashboard")
    processes = [start("dask_scheduler", *options, "--port", str(port))]
    common = (address, "--host", "127.0.0.1", "--nthreads", "1", "--no-nanny", "--no-dashboard")
    processes += [start("dask_worker", *common) for _ in range(2)]
    try:
        yield address, processes
    finally:
        for process in processes:
            process.kill()
        for process in processes:
            process.wait()


def test_one_of_two_workers_is_killed_and_nothing_is_lost(
    cluster: tuple[str, list[subprocess.Popen[bytes]]], tmp_path: Path
) -> None:
    from distributed import Client

    address, processes = cluster
    with Client(address, timeout="30s", set_as_default=False) as client:
        client.wait_for_workers(2, timeout=30)
    traces = tmp_path / "traces"
    traces.mkdir()
    tasks = [Task(f"noise-{k}", noise_after, (k, 0.2, str(traces))) for k in range(12)]
    victim = processes[1]
    killed: list[int] = []

    def told(_key: str, done: int, _of: int) -> None:
        if done >= 3 and not killed:
            killed.append(done)
            # at this moment it holds one piece in hand and more in its queue
            victim.send_signal(signal.SIGKILL)
            victim.wait()

    done = run_tasks(tasks, workers(scheduler=address), told=told)
    assert killed
    assert victim.returncode == -signal.SIGKILL
    for k, arrays in enumerate(done.values()):
        assert arrays["mean"] == noise(k)["mean"]
    who = {trace.name.partition("-")[0] for trace in traces.iterdir()}
    assert who == {str(processes[1].pid), str(processes[2].pid)}


def test_a_scheduler_that_goes_away_is_told_and_what_was_done_is_kept(
    cluster: tuple[str, list[subprocess.Popen[bytes]]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    from distributed import Client

    address, processes = cluster
    with Client(address, timeout="30s", set_as_default=False) as client:
        client.wait_for_workers(2, timeout=30)
    monkeypatch.setattr(executors, "PATIENCE", 2.0)
    traces, kept = tmp_path / "traces", Kept(tmp_path / "kept")
    traces.mkdir()
    tasks = [Task(f"noise-{k}", noise_after, (k, 0.1, str(traces))) for k in range(12)]

    def told(_key: str, done: int, _of: int) -> None:
        if done == 3:
            processes[0].kill()
            processes[0].wait()

    with pytest.raises(InputError, match="scheduler is gone"):
        run_tasks(tasks, workers(scheduler=address), kept, told)
    before = set(kept.names())
    assert len(before) >= 3
    done = run_tasks(tasks, workers(1), kept)
    assert all(done[f"noise-{k}"]["mean"] == noise(k)["mean"] for k in range(12))


def test_a_batch_on_a_cluster_gives_the_numbers_of_one_process(
    cluster: tuple[str, list[subprocess.Popen[bytes]]], tmp_path: Path
) -> None:
    """Logs of eight sensors; a worker is killed when the first is done."""
    from distributed import Client

    address, processes = cluster
    with Client(address, timeout="30s", set_as_default=False) as client:
        client.wait_for_workers(2, timeout=30)
    rng = np.random.default_rng(5)
    entries = []
    for k in range(8):
        columns = {"time_s": np.arange(3000) / 20.0}
        columns |= {f"gyro_{a}_rad_s": 1e-3 * rng.standard_normal(3000) for a in "xyz"}
        polars.DataFrame(columns).write_parquet(tmp_path / f"{k}.parquet")
        entries.append(LogEntry(tmp_path / f"{k}.parquet", serial=f"SN{k}"))

    def told(_file: str, done: int, _of: int) -> None:
        if done == 1:
            processes[1].kill()

    found = []
    for name, executor in (("dask", workers(scheduler=address)), ("here", workers(1))):
        with FleetDatabase(tmp_path / f"{name}.sqlite") as database:
            report = run_batch(
                entries, database, executor=executor, told=told if name == "dask" else None
            )
            assert (report.done, report.failed) == (8, 0)
            found.append([(m.serial, m.axis, m.name, m.value) for m in database.measurements()])
    assert found[0] == found[1]


def test_a_scheduler_that_does_not_answer(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(executors, "PATIENCE", 2.0)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(InputError, match="no Dask scheduler answers"):
        run_tasks([Task("a", noise, (1,))], workers(scheduler=f"tcp://127.0.0.1:{port}"))
