"""What other packages add to this one: entry points, read from what is installed.

The same as `importlib.metadata.entry_points`, whose import alone would cost a sixth of the listing
of the verbs.
"""

from __future__ import annotations

import sys
from pathlib import Path


def plugins(group: str) -> dict[str, str]:
    """Return name and "module:attribute" of the entry points of a group, by name."""
    found: dict[str, str] = {}
    seen: set[str] = set()
    for folder in dict.fromkeys(sys.path):
        for file in Path(folder or ".").glob("*-info/entry_points.txt"):
            package = file.parent.name.partition("-")[0].lower()
            if package not in seen:  # what comes first on the path hides the rest
                seen.add(package)
                found = _group(file, group) | found
    return dict(sorted(found.items()))


def _group(file: Path, group: str) -> dict[str, str]:
    try:
        text = file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return {}
    found, inside = {}, False
    for line in map(str.strip, text.splitlines()):
        if line.startswith("["):
            inside = line == f"[{group}]"
        elif inside and "=" in line and not line.startswith(("#", ";")):
            name, _, value = line.partition("=")
            found[name.strip()] = value.partition("[")[0].strip()  # without extras
    return found
