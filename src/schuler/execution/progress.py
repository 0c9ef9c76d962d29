"""Progress of long work on standard error: a line that moves on a terminal, plain lines elsewhere.

Nothing is shown for work that ends within a second or two.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Event, Thread
from typing import TYPE_CHECKING, Literal, TextIO

if TYPE_CHECKING:
    from rich.progress import Progress as Display
    from rich.progress import TaskID

FIRST, EVERY = 3.0, 5.0
"""Seconds until the first plain line, and from one to the next."""
MARK = "... "
"""Begins every plain line, so that they can be told from what is said of the result."""

Manner = Literal["usual", "quiet", "verbose"]
_manner: list[Manner] = ["usual"]


def behave(manner: Manner) -> None:
    """Choose how much is told: nothing, the usual, or every step with its time."""
    _manner[0] = manner


class Progress:
    """What the work tells while it runs.

    Parameters
    ----------
    title : str
        What is being done.
    display : rich.progress.Progress, optional
        Where it is shown.
    task : TaskID, optional
        Its line there.
    """

    def __init__(
        self, title: str, display: Display | None = None, task: TaskID | None = None
    ) -> None:
        self._title = title
        self._display = display
        self._task = task
        self._began = time.monotonic()
        self._text = title
        self._share: float | None = None

    def share(self, done: float) -> None:
        """Tell how much is done."""
        self._share = min(max(done, 0.0), 1.0)
        if self._display is not None and self._task is not None:
            self._display.update(self._task, completed=self._share, total=1.0)

    def say(self, text: str) -> None:
        """Tell what is being done right now."""
        self._text = f"{self._title}: {text}"
        if self._display is not None and self._task is not None:
            from rich.markup import escape

            self._display.update(self._task, description=escape(self._text))
        elif _manner[0] == "verbose":
            self.write(sys.stderr)

    def tell(self, text: str, done: float) -> None:
        """Tell both."""
        self.say(text)
        self.share(done)

    def write(self, stream: TextIO) -> None:
        """Write one plain line: what, how much of it, for how long."""
        share = "" if self._share is None else f", {100.0 * self._share:.0f} %"
        line = f"{MARK}{self._text}{share}, {time.monotonic() - self._began:.0f} s"
        encoding = getattr(stream, "encoding", None) or "utf-8"
        print(line.encode(encoding, "backslashreplace").decode(encoding), file=stream, flush=True)


@contextmanager
def progress(title: str) -> Iterator[Progress]:
    """Show that work is going on; on a terminal what appeared is wiped when the work ends."""
    if _manner[0] == "quiet":
        yield Progress(title)
    elif sys.stderr.isatty():
        with _moving(title) as shown:
            yield shown
    else:
        with _plain_lines(title) as shown:
            yield shown


@contextmanager
def _moving(title: str) -> Iterator[Progress]:
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Display

    columns = (TextColumn("{task.description}"), BarColumn(bar_width=24), TimeElapsedColumn())
    with Display(*columns, console=Console(stderr=True), transient=True) as display:
        yield Progress(title, display, display.add_task(escape(title), total=None))


@contextmanager
def _plain_lines(title: str) -> Iterator[Progress]:
    """Write a line every few seconds from a thread of its own: the work itself may be compiled."""
    shown, ended, stream = Progress(title), Event(), sys.stderr

    def watch() -> None:
        wait = FIRST
        while not ended.wait(wait):
            shown.write(stream)
            wait = EVERY

    if _manner[0] == "verbose":
        shown.write(stream)
    thread = Thread(target=watch, name="progress", daemon=True)
    thread.start()
    try:
        yield shown
    finally:
        ended.set()
        thread.join()
