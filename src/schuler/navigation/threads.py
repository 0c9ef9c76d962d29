"""Independent runs side by side: the kernels of the filter let other threads run."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

Case = TypeVar("Case")
Result = TypeVar("Result")

MOST_THREADS = 4
"""Every run keeps what its smoother needs."""


def in_threads(one: Callable[[Case], Result], cases: Iterable[Case]) -> list[Result]:
    """Do one thing to all cases; the results are in their order, the first error is raised."""
    whole = list(cases)
    threads = min(len(whole), usable_cores(), MOST_THREADS)
    if threads < 2:
        return [one(case) for case in whole]
    with ThreadPoolExecutor(threads) as pool:
        running = [pool.submit(one, case) for case in whole]
        try:
            return [future.result() for future in running]
        finally:
            for future in running:
                future.cancel()


def usable_cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1
