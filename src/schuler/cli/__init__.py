"""The command line: one thin function for each verb."""

from __future__ import annotations

import sys
from collections.abc import Sequence

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    arguments : sequence of str, optional
        Command line without the name of the program; by default that of the process.

    Returns
    -------
    int
        0 when all is well, 1 for a failed check, 2 for bad input, 130 when interrupted.
    """
    from schuler.cli.app import run

    return run(sys.argv[1:] if arguments is None else arguments)
