"""The papers done again: CPU time of each, and what a second process is worth.

    python -m benchmarks.reproduce [PAPER ...] [--full] [--seeds N] [--processes 2] [--speed-only]

The speed-up compares wall times of the same work in this process and in several (their start
included); numbers must be the same. On a machine that does other work as well the speed-up is
less: the load is printed.
"""

# ruff: noqa: E402 - the number of threads is set before NumPy is imported

from __future__ import annotations

from schuler.execution.executors import one_thread

one_thread()

import argparse
import os
import time
from dataclasses import replace

from schuler_papers.experiment import Size
from schuler_papers.registry import PAPERS
from schuler_papers.reproduction import Reproduction, reproduce


def timed(
    papers: list[str], size: Size, seeds: int | None, processes: int
) -> tuple[float, Reproduction]:
    """Wall time and outcome of one run."""
    start = time.perf_counter()
    done = reproduce(papers, size=size, seeds=seeds, processes=processes)
    return time.perf_counter() - start, done


def same(first: Reproduction, second: Reproduction) -> int:
    """How many values differ, those that are times left out."""

    def values(done: Reproduction) -> list[dict[str, object]]:
        kept = [r for r in done.items if "omputing time" not in r.item.title]
        return replace(done, items=tuple(kept)).rows()

    return sum(a != b for a, b in zip(values(first), values(second), strict=True))


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("papers", nargs="*", default=list(PAPERS))
    parser.add_argument("--full", action="store_true")
    parser.add_argument("--seeds", type=int)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--speed-only", action="store_true")
    options = parser.parse_args()
    size: Size = "full" if options.full else "quick"
    if not options.speed_only:
        print(f"CPU seconds, {size}")
        total = 0.0
        for paper in options.papers:
            _, done = timed([paper], size, options.seeds, 1)
            bad = sum(not row.holds for r in done.items for row in r.outcome.rows)
            words = f"{len(done.rows())} values, {bad} outside their bands"
            print(f"  {paper:14s} {done.cpu_seconds:8.1f}  {words}")
            total += done.cpu_seconds
        print(f"  {'together':14s} {total:8.1f}")
    print(f"load before: {os.getloadavg()[0]:.2f} on {os.cpu_count()} cores")
    wall: dict[int, float] = {}
    runs: dict[int, Reproduction] = {}
    for processes in (1, options.processes):
        wall[processes], runs[processes] = timed(options.papers, size, options.seeds, processes)
        cpu = runs[processes].cpu_seconds
        print(
            f"  {processes} processes: {wall[processes]:8.1f} s wall, {cpu:8.1f} s of CPU, "
            f"{cpu / wall[processes]:.2f} cores"
        )
    one, many = runs[1], runs[options.processes]
    print(f"  speed-up {wall[1] / wall[options.processes]:.2f}; {same(one, many)} values differ")
    print(f"load after: {os.getloadavg()[0]:.2f}")


if __name__ == "__main__":
    main()
