"""Many independent pieces of work: spread, resumed, and the same whoever does them."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    wait,
)
from dataclasses import dataclass
from typing import Any, Protocol

from schuler.errors import InputError
from schuler.execution.executors import Workers

CPU_SECONDS = "cpu seconds"
"""Name under which the cost of a piece of work is kept with its result."""
MOST_STARTS = 5
Found = dict[str, Any]
"""Result of a piece of work: plain values or arrays by name."""


class Store(Protocol):
    """Where results are kept, so that a stopped run goes on: a folder, a database."""

    def load(self, key: str) -> Found | None:
        """Return the result of a piece of work that has been done."""

    def save(self, key: str, outcome: Mapping[str, Any], /) -> None:
        """Keep the result of a piece of work, whole or not at all."""


@dataclass(frozen=True, slots=True)
class Task:
    """One piece of work."""

    key: str  # its name, which is also the name of its file
    # at the top of a module, because other processes find it by name
    function: Callable[..., Found]
    arguments: tuple[Any, ...] = ()  # for the function; plain values.


def run_tasks(
    tasks: Sequence[Task],
    crew: Workers,
    kept: Store | None = None,
    told: Callable[[str, int, int], None] | None = None,
    lost: Callable[[Task], Found] | None = None,
) -> dict[str, Found]:
    """Do all the work that has not been done before.

    When workers die, what they had in hand is given to others; `lost` says what becomes of a
    piece of work that kills its worker again and again.
    """
    if len({task.key for task in tasks}) != len(tasks):
        raise InputError("two pieces of work of one name")
    done: dict[str, Found] = {}
    if kept is not None:
        found = {task.key: kept.load(task.key) for task in tasks}
        done = {key: arrays for key, arrays in found.items() if arrays is not None}

    def finish(task: Task, arrays: Found) -> None:
        if kept is not None:
            kept.save(task.key, arrays)
        done[task.key] = arrays
        if told is not None:
            told(task.key, len(done), len(tasks))

    starts, gone = 0, False
    while left := [task for task in tasks if task.key not in done]:
        starts += 1
        # when a process was killed, a new pool does what is left; from the third time on one
        # piece at a time, so that the one that kills its worker is known
        ahead = crew.ahead if starts <= 2 else 1
        try:
            with crew.start() as executor:
                _spread(left, executor, ahead, finish)
        except CancelledError:  # nobody here cancels: it was the scheduler, perhaps restarted
            gone = True
            if starts >= MOST_STARTS:
                raise _gone("it went away again and again") from None
        except InputError as error:
            if gone:
                raise _gone(error.found) from None
            raise
        except BrokenExecutor:
            alone = next(task for task in left if task.key not in done) if ahead == 1 else None
            if alone is not None and lost is not None:
                finish(alone, lost(alone))
            elif starts >= MOST_STARTS:
                raise InputError(
                    f"the workers broke down {MOST_STARTS} times, at last over "
                    f"{alone.key if alone else 'several pieces of work'}",
                    cure="use fewer processes (memory?), and go on with what is kept",
                ) from None
    return {task.key: done[task.key] for task in tasks}


def _gone(why: str) -> InputError:
    return InputError(
        f"the scheduler is gone ({why})",
        expected="one that stays until the work is done",
        cure="start it again and run the same command: what was done is kept",
    )


def _spread(
    tasks: Sequence[Task],
    executor: Executor,
    ahead: int,
    finish: Callable[[Task, Found], None],
) -> None:
    waiting: dict[Future[Found], Task] = {}
    queue = iter(tasks)
    while True:
        while len(waiting) < ahead and (task := next(queue, None)) is not None:
            waiting[executor.submit(timed, task.function, task.arguments)] = task
        if not waiting:
            return
        ready, _ = wait(waiting, return_when=FIRST_COMPLETED)
        for future in ready:
            finish(waiting.pop(future), future.result())


def timed(function: Callable[..., Found], arguments: tuple[Any, ...]) -> Found:
    """Call a function and note what it cost."""
    import numpy as np

    start = time.process_time()
    arrays = function(*arguments)
    return arrays | {CPU_SECONDS: np.asarray(time.process_time() - start)}
