"""Two checkouts in turn on one machine: a process of each, asked alternately, least CPU time.

What else a machine does changes its clock and empties its caches, so that figures of two runs are
not comparable, and those of one run, in turn, are. Used by `filter_speed` and `streaming` with
`--against PATH`, the path of another checkout; its benchmarks need the same functions.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType

HERE = Path(__file__).resolve().parent.parent

SERVER = """
import json, sys
tasks = {}
exec(sys.argv[1], tasks)
for line in sys.stdin:
    print(json.dumps(tasks["answer"](*json.loads(line))), flush=True)
"""


class Checkout:
    """A process that runs the code of one checkout and answers by `answer(...)`, as JSON."""

    def __init__(self, path: Path, code: str) -> None:
        paths = os.pathsep.join([str(path / "src"), str(path)])
        self._process = subprocess.Popen(
            [sys.executable, "-c", SERVER, code],
            env={**os.environ, "PYTHONPATH": paths},
            cwd=path,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def ask(self, *question: object) -> None:
        """Send one question."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(question) + "\n")
        self._process.stdin.flush()

    def answer(self) -> list[float]:
        """Wait for the answer to the oldest question."""
        assert self._process.stdout is not None
        numbers: list[float] = json.loads(self._process.stdout.readline())
        return numbers

    def __enter__(self) -> Checkout:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        at: TracebackType | None,
    ) -> None:
        self._process.communicate()


def least_in_turn(
    other: Path, code: str, questions: Sequence[object], repeats: int
) -> Iterator[tuple[list[float], list[float]]]:
    """Least answers of this checkout and of another one to every question, number by number."""
    with Checkout(HERE, code) as ours, Checkout(other, code) as theirs:
        for question in questions:
            # compiles, in both at once
            for checkout in (ours, theirs):
                checkout.ask(question)
            for checkout in (ours, theirs):
                checkout.answer()
            both: tuple[list[list[float]], list[list[float]]] = ([], [])
            for _ in range(repeats):
                for checkout, answers in zip((ours, theirs), both, strict=True):
                    checkout.ask(question)
                    answers.append(checkout.answer())
            first, second = ([min(column) for column in zip(*a, strict=True)] for a in both)
            yield first, second
