"""The verbs of the program: ours, and those that other packages add by an entry point."""

from __future__ import annotations

import re
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from schuler.plugins import plugins

VERBS = (
    "demo",
    "characterize",
    "calibrate",
    "fuse",
    "faults",
    "navigate",
    "observability",
    "outages",
    "evaluate",
    "compare",
    "tune",
    "simulate",
    "export",
    "geometry",
    "batch",
    "denoise",
    "convert",
    "read",
    "formats",
    "view",
    "run",
    "warm",
)
"""Our verbs; each is a function of its name in a module of its name, but for `BESIDE`."""
BESIDE = {"formats": "read", "view": "read"}
"""Verbs that stand in the module of another."""
GROUP = "schuler.verbs"
"""Entry points of other packages: NAME = MODULE:FUNCTION."""


@cache
def verbs() -> dict[str, str]:
    """Return the import path of every verb; ours come first and cannot be replaced."""
    ours = {name: f"schuler.cli.verbs.{BESIDE.get(name, name)}:{name}" for name in VERBS}
    return ours | {name: path for name, path in plugins(GROUP).items() if name not in ours}


def help_line(path: str) -> str:
    """Return the first line of the docstring of a verb, read from its source without importing it.

    Importing every verb to list them would cost more than the listing.
    """
    module, _, name = path.partition(":")
    source = _source(module)
    if source is None:
        return f"Cannot be used: there is no module {module}."
    try:
        text = source.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        return f"Cannot be used: {error}."
    found = re.search(rf'^def {re.escape(name)}\(.*?"""(.*?)(?:"""|\n)', text, re.M | re.S)
    return found[1].strip() if found else ""


def _source(module: str) -> Path | None:
    """Return the file of a module without importing the packages that it is in."""
    package, *parts = module.split(".")
    spec = find_spec(package)
    if spec is None:
        return None
    if not parts:
        return Path(spec.origin) if spec.origin else None
    for place in spec.submodule_search_locations or ():
        base = Path(place, *parts)
        for file in (base.with_suffix(".py"), base / "__init__.py"):
            if file.is_file():
                return file
    return None
