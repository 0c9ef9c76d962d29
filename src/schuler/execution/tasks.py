"""Many independent pieces of work: spread, resumed, and the same whoever does them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from schuler.errors import InputError
from schuler.execution.executors import Workers
from schuler.execution.store import Arrays, Kept

CPU_SECONDS = "cpu seconds"
"""Name under which the cost of a piece of work is kept with its result."""
MOST_STARTS = 5


@dataclass(frozen=True, slots=True)
class Task:
    """One piece of work.

    Parameters
    ----------
    key : str
        Its name, which is also the name of its file.
    function : callable
        At the top of a module, because other processes find it by name; returns float64 arrays
        by name.
    arguments : tuple
        For the function; plain values.
    """

    key: str
    function: Callable[..., Arrays]
    arguments: tuple[Any, ...] = ()


def run_tasks(
    tasks: Sequence[Task],
    crew: Workers,
    kept: Kept | None = None,
    told: Callable[[str, int, int], None] | None = None,
) -> dict[str, Arrays]:
    """Do all the work that has not been done before.

    When workers die, what they had in hand is given to others.
    """
    if len({task.key for task in tasks}) != len(tasks):
        raise InputError("two pieces of work of one name")
    done: dict[str, Arrays] = {}
    if kept is not None:
        found = {task.key: kept.load(task.key) for task in tasks}
        done = {key: arrays for key, arrays in found.items() if arrays is not None}

    def finish(task: Task, arrays: Arrays) -> None:
        if kept is not None:
            kept.save(task.key, arrays)
        done[task.key] = arrays
        if told is not None:
            told(task.key, len(done), len(tasks))

    starts = 0
    while left := [task for task in tasks if task.key not in done]:
        starts += 1
        if starts > MOST_STARTS:
            raise InputError(
                f"the workers broke down {MOST_STARTS} times",
                cure="use fewer processes (memory?), and go on with what is kept",
            )
        # when a process was killed, a new pool does what is left
        with crew.start() as executor, suppress(BrokenExecutor):
            _spread(left, executor, crew.ahead, finish)
    return {task.key: done[task.key] for task in tasks}


def _spread(
    tasks: Sequence[Task],
    executor: Executor,
    ahead: int,
    finish: Callable[[Task, Arrays], None],
) -> None:
    waiting: dict[Future[Arrays], Task] = {}
    queue = iter(tasks)
    while True:
        while len(waiting) < ahead and (task := next(queue, None)) is not None:
            waiting[executor.submit(timed, task.function, task.arguments)] = task
        if not waiting:
            return
        ready, _ = wait(waiting, return_when=FIRST_COMPLETED)
        for future in ready:
            finish(waiting.pop(future), future.result())


def timed(function: Callable[..., Arrays], arguments: tuple[Any, ...]) -> Arrays:
    """Call a function and note what it cost."""
    import numpy as np

    start = time.process_time()
    arrays = function(*arguments)
    return arrays | {CPU_SECONDS: np.asarray(time.process_time() - start)}
