"""A Dask cluster on this machine: one of its two workers is killed while it works."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from scale_work import noise, noise_after

from schuler.errors import InputError
from schuler.execution.executors import workers
from schuler.execution.tasks import Task, run_tasks

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


def test_a_scheduler_that_does_not_answer() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(InputError, match="no Dask scheduler answers"):
        run_tasks([Task("a", noise, (1,))], workers(scheduler=f"tcp://127.0.0.1:{port}"))
