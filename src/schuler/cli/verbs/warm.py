"""`schuler warm`: compile every kernel ahead of time."""

from __future__ import annotations

import time

from schuler.cli.console import Screen
from schuler.execution.progress import progress


def warm() -> None:
    """Compile all kernels now, so that the first real run does not wait for it.

    The result is kept on disk until schuler or Numba changes; SCHULER_CACHE_DIR chooses where.

    Example: `schuler warm`

    """
    from schuler.cli.rehearsal import REHEARSALS
    from schuler.kernels.compile import cache_directory

    began = time.monotonic()
    with progress("Compiling kernels") as shown:
        for k, rehearse in enumerate(REHEARSALS):
            rehearse()
            shown.share((k + 1) / len(REHEARSALS))
    screen = Screen()
    screen.line(f"All kernels are compiled ({time.monotonic() - began:.1f} s).")
    kept = cache_directory()
    screen.line("Kept nowhere" if kept is None else f"Kept in {kept}", "dim")
