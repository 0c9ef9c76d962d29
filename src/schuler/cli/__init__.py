"""The command line: one thin function for each verb.

A verb of another package is a function that an entry point of the group ``schuler.verbs`` names;
its signature and numpydoc docstring make its options, it returns the exit code. It may use what
`__init__.pyi` lists, and nothing else of this package: `Screen` (headings, tables and findings on
the terminal), `say` (one line on stderr), `Outputs` with `STDOUT` and `json_text` (files that are
written together at the end), `command_provenance` (for a report) and `say_when_compiling`.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command."""
    from schuler.cli.app import run

    return run(sys.argv[1:] if arguments is None else arguments)
