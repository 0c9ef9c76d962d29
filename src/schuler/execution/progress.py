"""Progress of long work, on a terminal only."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import Progress as Display
    from rich.progress import TaskID


class Progress:
    """What the work tells while it runs; where nobody watches, nothing happens.

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

    def share(self, done: float) -> None:
        """Tell how much is done."""
        if self._display is not None and self._task is not None:
            self._display.update(self._task, completed=min(max(done, 0.0), 1.0), total=1.0)

    def say(self, text: str) -> None:
        """Tell what is being done right now."""
        if self._display is not None and self._task is not None:
            from rich.markup import escape

            self._display.update(self._task, description=escape(f"{self._title}: {text}"))

    def tell(self, text: str, done: float) -> None:
        """Tell both."""
        self.say(text)
        self.share(done)


@contextmanager
def progress(title: str) -> Iterator[Progress]:
    """Show that work is going on, on standard error, and only when that is a terminal.

    What appeared is wiped when the work ends.
    """
    if not sys.stderr.isatty():
        yield Progress(title)
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import BarColumn, TextColumn, TimeElapsedColumn
    from rich.progress import Progress as Display

    columns = (TextColumn("{task.description}"), BarColumn(bar_width=24), TimeElapsedColumn())
    with Display(*columns, console=Console(stderr=True), transient=True) as display:
        yield Progress(title, display, display.add_task(escape(title), total=None))
