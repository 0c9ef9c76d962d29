"""Work is spread, resumed, and nothing is lost when a worker dies."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scale_work import die_once, noise, refuse, threads

from schuler.errors import InputError
from schuler.execution.executors import workers
from schuler.execution.store import Kept
from schuler.execution.tasks import CPU_SECONDS, Task, run_tasks


def means(done: dict[str, dict[str, np.ndarray]]) -> list[float]:
    return [float(arrays["mean"]) for arrays in done.values()]


EXPECTED = [float(noise(seed)["mean"]) for seed in range(8)]


def test_numbers_do_not_depend_on_the_number_of_processes() -> None:
    tasks = [Task(f"noise-{seed}", noise, (seed,)) for seed in range(8)]
    told: list[int] = []
    here = run_tasks(tasks, workers(1), told=lambda _key, done, of: told.append(done * 100 + of))
    assert means(here) == EXPECTED
    assert told == [100 * k + 8 for k in range(1, 9)]
    assert list(here) == [task.key for task in tasks]
    tasks += [Task("threads", threads, (0,))]
    there = run_tasks(tasks, workers(2))
    assert there["threads"].pop("threads") == 1.0
    del there["threads"]
    assert means(there) == EXPECTED
    assert all(arrays[CPU_SECONDS] >= 0.0 for arrays in there.values())


def test_a_killed_process_loses_nothing(tmp_path: Path) -> None:
    tasks = [Task(f"noise-{seed}", die_once, (seed, str(tmp_path))) for seed in range(8)]
    assert means(run_tasks(tasks, workers(2))) == EXPECTED
    assert (tmp_path / "died").exists()


def test_a_stopped_run_goes_on_where_it_was(tmp_path: Path) -> None:
    kept = Kept(tmp_path / "kept")
    first = [Task(f"noise-{seed}", noise, (seed,)) for seed in range(5)]
    with pytest.raises(ValueError, match="seed 9"):
        run_tasks([*first, Task("noise-9", refuse, (9,))], workers(1), kept)
    assert list(kept.names()) == [task.key for task in first]
    # a file that was cut off is done again, the others are not
    damaged = tmp_path / "kept" / "noise-2.npz"
    damaged.write_bytes(damaged.read_bytes()[:40])
    told: list[str] = []
    everything = [Task(f"noise-{seed}", noise, (seed,)) for seed in range(8)]
    done = run_tasks(everything, workers(1), kept, lambda key, _done, _of: told.append(key))
    assert told == ["noise-2", "noise-5", "noise-6", "noise-7"]
    assert means(done) == EXPECTED


def test_what_cannot_be_asked_for() -> None:
    with pytest.raises(InputError, match="one or more"):
        workers(0)
    with pytest.raises(InputError, match="one of them"):
        workers(2, "tcp://127.0.0.1:1")
    with pytest.raises(InputError, match="one name"):
        run_tasks([Task("a", noise, (1,)), Task("a", noise, (2,))], workers(1))
