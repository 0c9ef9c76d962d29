"""Progress of long work, on a terminal only."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Advance = Callable[[float], None]
"""Takes the share of the work that is done, 0 to 1."""

REFRESH_SECONDS = 0.1


def _say_nothing(share: float) -> None:
    """Take the share of the work and show nothing."""


@contextmanager
def progress(title: str, *, known: bool = False) -> Iterator[Advance]:
    """Show that work is going on, on standard error, and only when that is a terminal.

    What appeared is wiped when the work ends.

    Parameters
    ----------
    title : str
        What is being done, in the user's words.
    known : bool
        The work will tell how far it is; otherwise a clock and a pulse are shown.

    Yields
    ------
    callable
        Takes the share of the work that is done, 0 to 1.
    """
    if not sys.stderr.isatty():
        yield _say_nothing
        return
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

    columns = (TextColumn("{task.description}"), BarColumn(bar_width=24), TimeElapsedColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as display:
        task = display.add_task(escape(title), total=1.0 if known else None)
        shown = time.monotonic()

        def advance(share: float) -> None:
            nonlocal shown
            now = time.monotonic()
            if now - shown > REFRESH_SECONDS or share >= 1.0:
                shown = now
                display.update(task, completed=min(max(share, 0.0), 1.0))

        yield advance
