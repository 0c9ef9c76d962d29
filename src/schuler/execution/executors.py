"""Where work is done: here, in processes of this machine, or on a Dask cluster."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from typing import ParamSpec, TypeVar

from schuler.errors import InputError

PATIENCE = 10.0
"""Seconds in which a scheduler has to answer."""
P = ParamSpec("P")
R = TypeVar("R")

_THREADS = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMBA_NUM_THREADS",
)


class InProcess(Executor):
    """The executor that does the work at once, where it is asked for."""

    def submit(self, fn: Callable[P, R], /, *arguments: P.args, **options: P.kwargs) -> Future[R]:
        """Call the function now."""
        future: Future[R] = Future()
        try:
            future.set_result(fn(*arguments, **options))
        except Exception as error:
            future.set_exception(error)
        return future


@dataclass(frozen=True, slots=True)
class Workers:
    """How executors are made, and how much work may wait in them."""

    # returns a context in which an executor works; called again when one has broken down.
    start: Callable[[], AbstractContextManager[Executor]]
    ahead: int  # so many pieces of work are handed over before the first has to be done
    words: str  # who they are


def one_thread() -> None:
    """Keep linear algebra to one thread, so that processes share the cores and sums do not differ.

    It has an effect only before NumPy is imported.
    """
    for name in _THREADS:
        os.environ[name] = "1"


def workers(processes: int | None = None, scheduler: str | None = None) -> Workers:
    """Return the workers that were asked for."""
    if scheduler is not None:
        if processes is not None:
            raise InputError("processes and a scheduler together", expected="one of them")
        return _dask(scheduler)
    count = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    count = (count or 1) if processes is None else processes
    if count < 1:
        raise InputError(f"{count} processes", expected="one or more")
    if count == 1:
        return Workers(InProcess, 1, "this process")
    return Workers(partial(_pool, count), 2 * count, f"{count} processes")


def lent(executor: Executor, ahead: int = 64) -> Workers:
    """Return an executor of somebody else as workers; it is not shut down."""
    return Workers(lambda: nullcontext(executor), ahead, type(executor).__name__)


@contextmanager
def _pool(count: int) -> Iterator[Executor]:
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import get_context

    pool = ProcessPoolExecutor(count, get_context("spawn"), initializer=one_thread)
    try:
        yield pool
    finally:
        pool.shutdown(wait=False, cancel_futures=True)


def _dask(address: str) -> Workers:
    if find_spec("distributed") is None:
        raise InputError(
            "a Dask scheduler, but Dask is not installed", cure="pip install 'schuler[dask]'"
        )
    return Workers(partial(_cluster, address), 1000, f"Dask at {address}")


@contextmanager
def _cluster(address: str) -> Iterator[Executor]:
    from distributed import Client

    try:
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(
            f"no Dask scheduler answers ({error})",
            expected="an address such as tcp://127.0.0.1:8786",
            where=address,
        ) from None
    with client:  # its end cancels what is still waiting
        yield client.get_executor(pure=False, retries=3)
