"""The command line: one thin function for each verb."""

from __future__ import annotations

import sys
from collections.abc import Sequence

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command."""
    from schuler.cli.app import run

    return run(sys.argv[1:] if arguments is None else arguments)
