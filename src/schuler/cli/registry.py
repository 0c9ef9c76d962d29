"""The verbs of the program: ours, and those that other packages add by an entry point."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from importlib.metadata import EntryPoint, entry_points
from importlib.util import find_spec
from pathlib import Path

VERBS = (
    "demo",
    "characterize",
    "calibrate",
    "fuse",
    "faults",
    "navigate",
    "observability",
    "outages",
    "tune",
    "simulate",
    "export",
    "geometry",
    "warm",
)
"""Our verbs, in the order of the help; each is a function of its name in a module of its name."""
GROUP = "schuler.verbs"
"""Entry points of other packages: NAME = MODULE:FUNCTION."""


def verbs() -> Iterator[tuple[str, str]]:
    """Yield name and import path of every verb; ours come first and cannot be replaced."""
    known = set(VERBS)
    for name in VERBS:
        yield name, f"schuler.cli.verbs.{name}:{name}"
    for point in _points():
        if point.name not in known:
            known.add(point.name)
            yield point.name, point.value


@cache
def _points() -> tuple[EntryPoint, ...]:
    return tuple(sorted(entry_points(group=GROUP)))


def help_line(path: str) -> str:
    """Return the first line of the docstring of a verb, read from its source without importing it.

    Importing every verb to list them would cost more than the listing.
    """
    module, _, name = path.partition(":")
    try:
        spec = find_spec(module)
        if spec is None or spec.origin is None:
            return f"cannot be used: there is no module {module}"
        tree = ast.parse(Path(spec.origin).read_text(encoding="utf-8"))
    except (ImportError, OSError, SyntaxError, ValueError) as error:
        return f"cannot be used: {error}"
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and node.name == name:
            return (ast.get_docstring(node) or "").partition("\n")[0]
    return ""
